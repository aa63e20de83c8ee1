"""Pictures of observations, models and poses as arrays and PNG files."""

from __future__ import annotations

import struct
import zlib
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ._errors import InputError
from ._native import Camera, render_depth

if TYPE_CHECKING:
    from ._native import Model, Observation
    from ._results import Result

_Image = npt.NDArray[np.uint8]

#: Color of contours: green on anything.
CONTOUR = (0, 220, 0)


def png(image: _Image) -> bytes:
    """Returns RGB pixels as a PNG file."""
    height, width, _ = image.shape

    def chunk(tag: bytes, data: bytes) -> bytes:
        check = struct.pack(">I", zlib.crc32(tag + data))
        return struct.pack(">I", len(data)) + tag + data + check

    rows = np.concatenate([np.zeros((height, 1), np.uint8), image.reshape(height, -1)], axis=1)
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    chunks = (b"IHDR", header), (b"IDAT", zlib.compress(rows.tobytes())), (b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunk(*parts) for parts in chunks)


def gray(depth: npt.NDArray[np.float32]) -> _Image:
    """Returns a depth image as RGB: near is bright, missing is black."""
    values = np.zeros(depth.shape, np.uint8)
    measured = depth > 0
    if measured.any():
        near, far = np.percentile(depth[measured], [1, 99])
        share = np.clip((far - depth[measured]) / max(far - near, 1e-6), 0, 1)
        values[measured] = (50 + 205 * share).astype(np.uint8)
    return np.repeat(values[..., None], 3, axis=2)


def border(inside: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """Returns the pixels of a region that have a neighbor outside."""
    padded = np.pad(inside, 1)
    inner = padded[:-2, 1:-1] & padded[2:, 1:-1] & padded[1:-1, :-2] & padded[1:-1, 2:]
    return inside & ~inner


def of_observation(observation: Observation) -> bytes:
    """Returns the depth with the border of the mask as a PNG file."""
    image = gray(observation.depth)
    image[border(observation.mask)] = (255, 180, 0)
    return png(image)


def of_model(model: Model) -> bytes:
    """Returns the shaded model, seen from the upper right, as a PNG file."""
    size = 240
    camera = Camera(size, size, (size - 1) / 2, (size - 1) / 2, size, size)
    right, down = np.array([0.8, -0.6, 0.0]), np.array([-0.3, -0.4, -0.87])
    down -= right * (right @ down)
    down /= np.linalg.norm(down)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, down, np.cross(right, down)])
    pose[:3, 3] = [0, 0, 2.4 * model.radius] - pose[:3, :3] @ np.array(model.center)
    depth = render_depth(model, camera, pose)
    slopes = np.gradient(np.where(depth > 0, depth, np.nan) * size / (2.4 * model.radius))
    shade = 1 / np.sqrt(1 + slopes[0] ** 2 + slopes[1] ** 2)
    values = np.where(depth > 0, 60 + 195 * np.nan_to_num(shade, nan=0.3), 255).astype(np.uint8)
    return png(np.repeat(values[..., None], 3, axis=2))


def pairs(
    observation: Observation, T_co: npt.ArrayLike, model: Model, count: int
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Returns observed and rendered points, meters, at up to `count` pixels that have both."""
    camera = observation.camera
    rendered, measured = render_depth(model, camera, T_co), observation.depth
    v, u = np.nonzero((rendered > 0) & (measured > 0) & observation.mask)
    step = max(len(v) // max(count, 1), 1)
    v, u = v[::step], u[::step]
    rays = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, 0 * u + 1], axis=1)
    return rays * measured[v, u, None], rays * rendered[v, u, None]


def residuals(
    observation: Observation, result: Result, model: Model | None
) -> npt.NDArray[np.float32]:
    """Returns the measured minus the rendered depth; NaN where one of them is missing."""
    rendered = render_depth(result._model(model), observation.camera, result.T_co)
    measured = observation.depth
    both = (rendered > 0) & (measured > 0)
    return np.where(both, measured - rendered, np.float32(np.nan))


def overlay(
    observation: Observation, T_co: npt.ArrayLike, model: Model, image: Any
) -> _Image:
    """Draws the contour of a model over an image, or over the picture of the depth."""
    camera = observation.camera
    if image is None:
        painted = gray(observation.depth)
    else:
        painted = np.array(image)
        shape = (camera.height, camera.width)
        if painted.dtype != np.uint8 or painted.shape not in (shape, (*shape, 3)):
            raise InputError(
                f"image is an array of {painted.dtype} with shape {painted.shape}, "
                f"expected uint8 with shape {shape} or {(*shape, 3)}"
            )
        if painted.ndim == 2:
            painted = np.repeat(painted[..., None], 3, axis=2)
    painted[border(render_depth(model, camera, T_co) > 0)] = CONTOUR
    return painted
