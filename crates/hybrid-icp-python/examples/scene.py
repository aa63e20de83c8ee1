"""Generates the frame of the examples.

An angle bracket is 42 cm away, without noise. The initial pose has an error of 1 cm and 5 degrees.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hybrid_icp import Camera, Model, Observation, render_depth

Array = npt.NDArray[np.float64]


def bracket() -> tuple[Array, npt.NDArray[np.int64]]:
    """Returns vertices (V, 3) in millimeters and faces (F, 3) of an angle bracket of about 9 cm.

    It is narrower at one end, so that no two of its poses look the same.
    """
    profile = np.array([[-12, -8], [58, -8], [58, 10], [10, 14], [6, 62], [-12, 62.0]])
    ends = [np.insert(profile, 1, -40, axis=1), np.insert(0.7 * profile, 1, 50, axis=1)]
    vertices = np.concatenate(ends)
    corners = len(profile)
    faces = []
    for a in range(corners):
        b = (a + 1) % corners
        faces += [(a, b + corners, b), (a, a + corners, b + corners)]
    # Each end is a fan of triangles from its inner corner.
    inner = 3
    for step in range(1, corners - 1):
        a, b = (inner + step) % corners, (inner + step + 1) % corners
        faces += [(inner, a, b), (inner + corners, b + corners, a + corners)]
    return vertices, np.array(faces)


def pose(rotation_vector: npt.ArrayLike, translation: npt.ArrayLike) -> Array:
    """Returns a 4x4 pose from a rotation vector in radians and a translation in meters."""
    vector = np.asarray(rotation_vector, float)
    angle = float(np.linalg.norm(vector))
    x, y, z = vector / angle if angle else vector
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    result = np.eye(4)
    result[:3, :3] += np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    result[:3, 3] = translation
    return result


@dataclass
class Scene:
    """A frame with its ground truth."""

    model: Model
    camera: Camera
    #: Meters, shape (H, W), with a wall behind the object.
    depth: npt.NDArray[np.float32]
    mask: npt.NDArray[np.bool_]
    observation: Observation
    #: The true pose and the initial pose, camera from object, meters.
    true: Array
    rough: Array


def scene(camera: Camera | None = None) -> Scene:
    """Returns the frame. The default camera has 640x480 pixels."""
    model = Model(*bracket(), unit="mm")
    camera = camera or Camera(600, 600, 319.5, 239.5, 640, 480)
    true = pose([0.9, -0.5, 0.3], [0.02, -0.01, 0.42])
    depth = render_depth(model, camera, true)
    mask = depth > 0
    depth[~mask] = 0.7
    rough = true.copy()
    rough[:3] = (pose([0.06, -0.05, 0.04], [0, 0, 0]) @ true)[:3]
    rough[:3, 3] = true[:3, 3] + [0.006, -0.005, 0.008]
    return Scene(model, camera, depth, mask, Observation(depth, mask, camera), true, rough)
