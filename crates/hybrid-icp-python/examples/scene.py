"""The frame that the examples generate: a lumpy object without symmetry, half a metre away, and a pose that is a centimetre off."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hybrid_icp import Camera, Model, Observation, render_depth

Array = npt.NDArray[np.float64]


def lumpy(rings: int = 24, sectors: int = 48) -> tuple[Array, npt.NDArray[np.int64]]:
    """Vertices (V, 3) in millimetres and faces (F, 3) of a closed surface of about 12 cm."""
    polar, around = np.meshgrid(np.linspace(0, np.pi, rings + 1)[1:-1], np.arange(sectors) * 2 * np.pi / sectors, indexing="ij")
    radius = 45 + 12 * np.cos(3 * around) * np.sin(polar) ** 2 + 9 * np.sin(around + 2 * polar) + 10 * np.cos(polar)
    rim = radius[..., None] * np.stack([np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar)], -1)
    vertices = np.concatenate([rim.reshape(-1, 3), [[0, 0, 55], [0, 0, -35]]])
    top, bottom = len(vertices) - 2, len(vertices) - 1
    faces = []
    for sector in range(sectors):
        beside = (sector + 1) % sectors
        faces.append((top, sector, beside))
        for ring in range(0, (rings - 2) * sectors, sectors):
            a, b, c, d = ring + sector, ring + beside, ring + sectors + beside, ring + sectors + sector
            faces += [(a, d, c), (a, c, b)]
        last = (rings - 2) * sectors
        faces.append((bottom, last + beside, last + sector))
    return vertices, np.array(faces)


def pose(rotation_vector: npt.ArrayLike, translation: npt.ArrayLike) -> Array:
    """A 4x4 pose from an axis times an angle in radians, and metres."""
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
    """A frame in which the truth is known."""

    model: Model
    camera: Camera
    #: Metres, shape (H, W), a wall behind the object.
    depth: npt.NDArray[np.float32]
    mask: npt.NDArray[np.bool_]
    observation: Observation
    #: The true pose and a rough one, camera from object, metres.
    true: Array
    rough: Array


def scene(camera: Camera | None = None) -> Scene:
    """Makes the frame, 640x480 unless a camera is given."""
    model = Model(*lumpy(), unit="mm")
    camera = camera or Camera(600, 600, 319.5, 239.5, 640, 480)
    true = pose([2.2, 0.6, 0.3], [0.02, -0.01, 0.5])
    depth = render_depth(model, camera, true)
    mask = depth > 0
    depth[~mask] = 0.7
    rough = true.copy()
    rough[:3] = (pose([0.06, -0.05, 0.04], [0, 0, 0]) @ true)[:3]
    rough[:3, 3] = true[:3, 3] + [0.006, -0.005, 0.008]
    return Scene(model, camera, depth, mask, Observation(depth, mask, camera), true, rough)
