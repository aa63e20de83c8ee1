"""Visible Surface Discrepancy (BOP'19) over whole images, as evaluation scripts compute it."""

import numpy as np

TOLERANCES = [0.05 * k for k in range(1, 11)]
DELTA = 0.015  # meters


def distances(depth, camera):
    fx, fy, cx, cy = camera
    u, v = np.meshgrid(np.arange(depth.shape[1]), np.arange(depth.shape[0]))
    return depth.astype(np.float64) * np.sqrt(((u - cx) / fx) ** 2 + ((v - cy) / fy) ** 2 + 1.0)


def visible(test, model):
    """Returns the pixels at which a model is visible.

    The model is at most delta behind the measured surface, or the pixel has no measurement.
    """
    near = model.astype(np.float32) - test.astype(np.float32) <= DELTA
    return (model > 0) & (near | (test == 0))


def vsd(depth_test, depth_truth, depth_estimate, camera, diameter):
    """Returns e(tau) for ten tolerances, given as shares of the diameter.

    Depths are in meters, and 0 at pixels without a surface.
    """
    test, truth, estimate = (distances(depth, camera) for depth in (depth_test, depth_truth, depth_estimate))
    seen_truth = visible(test, truth)
    seen_estimate = visible(test, estimate) | (seen_truth & (estimate > 0))
    both = seen_truth & seen_estimate
    union = np.count_nonzero(seen_truth | seen_estimate)
    if union == 0:
        return [1.0] * len(TOLERANCES)
    apart = np.abs(truth[both] - estimate[both]) / diameter
    missed = union - np.count_nonzero(both)
    return [(np.count_nonzero(apart >= tau) + missed) / union for tau in TOLERANCES]


def check():
    """Checks the code above against a case computed by bop_toolkit."""

    def image(*rows):
        return np.array([[float(x) for x in row.split()] for row in rows], dtype=np.float32) / 1000

    nothing, far = "0 " * 7, "1000 " * 7
    test = image(
        "0 1000 1000 1000 1000 1000 1000", "1000 500 500 500 500 1000 1000", "1000 500 505 510 480 1000 1000",
        "1000 500 0 510 480 1000 1000", "1000 500 505 300 500 1000 1000", far,
    )  # fmt: skip
    truth = image(
        nothing, "0 500 500 500 500 0 0", "0 500 505 510 515 0 0", "0 500 505 510 515 0 0", "0 500 505 510 515 0 0", nothing
    )
    estimate = image(
        nothing, "0 0 502 504 506 540 0", "0 0 507 530 519 525 0", "0 0 509 512 560 527 0", "0 0 509 512 514 527 0", nothing
    )
    errors = vsd(test, truth, estimate, (10, 12, 3, 2.5), 0.1)
    expected = [11 / 17] + [10 / 17] * 3 + [9 / 17] * 6
    assert np.allclose(errors, expected, atol=1e-12), errors
