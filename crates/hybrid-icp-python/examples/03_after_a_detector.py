"""Refines the pose of a detector, with meshes, images and cameras of trimesh and Open3D.

Each conversion is one line. Libraries that are not installed are skipped with a message.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scene import Array, bracket, scene

from hybrid_icp import Camera, Model, Observation, Pipeline, adi


def detect(depth: npt.NDArray[np.float32]) -> tuple[npt.NDArray[np.bool_], Array]:
    """Simulates a detector: returns a mask and a pose with an error of 1 cm and some degrees."""
    rough = np.round(scene().rough, 3)
    # Detectors often round rotations, but the module requires an orthogonal matrix. Compute the
    # nearest rotation.
    u, _, vt = np.linalg.svd(rough[:3, :3])
    rough[:3, :3] = u @ vt
    return depth < 0.65, rough


def refine(model: Model, camera: Camera, depth: npt.NDArray[np.float32]) -> Array:
    """Returns a pose that a robot can trust, or raises an exception."""
    mask, rough = detect(depth)
    result = Pipeline().refine(model, Observation(depth, mask, camera), rough)
    if result.confidence < 0.95:
        raise RuntimeError(f"the pose is uncertain: {result} {result.warnings}")
    return result.T_co


def from_trimesh() -> Model:
    import trimesh

    mesh = trimesh.Trimesh(*bracket())
    return Model.from_trimesh(mesh, unit="mm")


def from_open3d() -> tuple[Model, Camera]:
    import open3d

    vertices, faces = bracket()
    mesh = open3d.geometry.TriangleMesh(
        open3d.utility.Vector3dVector(vertices),
        open3d.utility.Vector3iVector(faces.astype(np.int32)),
    )
    intrinsic = open3d.camera.PinholeCameraIntrinsic(640, 480, 600, 600, 319.5, 239.5)
    model = Model.from_open3d(mesh, unit="mm")
    return model, Camera.from_K(intrinsic.intrinsic_matrix, (intrinsic.width, intrinsic.height))


def main() -> None:
    frame = scene()
    tried: list[tuple[str, Model, Camera]] = []
    try:
        tried.append(("trimesh", from_trimesh(), frame.camera))
    except ImportError as error:
        print(f"skipped: {error}")
    try:
        tried.append(("Open3D", *from_open3d()))
    except (ImportError, OSError) as error:
        print(f"skipped: {error}")
    for name, model, camera in tried:
        found = refine(model, camera, frame.depth)
        print(f"{name}: {model}, ADI {adi(found, frame.true, model) * 1000:.2f} mm")


if __name__ == "__main__":
    main()
