"""Refines 6D object poses in depth images.

A detector provides a segmentation mask and an initial pose. `Pipeline.refine` refines the pose and
scores how well it explains the image. `Pipeline()` is the default, ``"auto"``: it refines, and
searches for the object if the refined pose explains the image badly. `Pipeline("hybrid")` is Hybrid
ICP as in the paper (Dreczkowski & Johns), which selects the kind of registration by that score.

Conventions:

- Lengths are in meters, angles in radians.
- Poses are 4x4 float64 matrices. ``T_co`` maps object coordinates to camera coordinates.
- Cameras look along +z, with x right and y down.
- Images have the indices [v, u]. Pixel centers are at integers.
- Depth is along the optical axis, and 0 for pixels without a measurement.

Examples
--------
A plate is 0.5 m in front of the camera, and the detector reports 0.54 m:

>>> import numpy as np
>>> from hybrid_icp import Camera, Model, Observation, Pipeline, render_depth
>>> corners = [[-.1, -.1, 0], [.1, -.1, 0], [.1, .1, 0], [-.1, .1, 0]]
>>> model = Model(corners, [[0, 2, 1], [0, 3, 2]])
>>> camera = Camera(100, 100, 31.5, 31.5, 64, 64)
>>> true = np.eye(4)
>>> true[2, 3] = 0.5
>>> depth = render_depth(model, camera, true)
>>> observation = Observation(depth, depth > 0, camera)
>>> rough = np.eye(4)
>>> rough[2, 3] = 0.54
>>> result = Pipeline().refine(model, observation, rough)
>>> result.outcome, bool(result.mve < result.mve_initial)
('refined', True)
"""

from importlib import import_module as _import
from importlib.metadata import version as _version
from typing import TYPE_CHECKING as _TYPE_CHECKING

from ._errors import FileError, HybridIcpError, InputError, InputWarning
from ._native import (
    Camera,
    DepthImage,
    Fuser,
    Model,
    Observation,
    Pipeline,
    PoseEstimate,
    SequentialEstimator,
    Tracker,
    add,
    adi,
    align,
    diagnose,
    fuse,
    mask_in_box,
    mspd,
    mssd,
    mve,
    parts,
    point_to_plane_step,
    point_to_point_step,
    read_cloud,
    read_depth,
    read_depth_png,
    read_mask,
    read_mask_png,
    read_pose,
    render_depth,
    vsd,
)
from ._results import (
    Alignment,
    Alternative,
    DecisionEvent,
    Diagnosis,
    Fault,
    IterationEvent,
    RegimeEvent,
    Result,
    SequentialStep,
    StageEvent,
    Tracked,
)

__all__ = [
    "Alignment",
    "Alternative",
    "Camera",
    "DecisionEvent",
    "DepthImage",
    "Diagnosis",
    "Fault",
    "FileError",
    "Fuser",
    "HybridIcpError",
    "InputError",
    "InputWarning",
    "IterationEvent",
    "Model",
    "Observation",
    "Pipeline",
    "PoseEstimate",
    "RegimeEvent",
    "Result",
    "SequentialEstimator",
    "SequentialStep",
    "StageEvent",
    "Tracked",
    "Tracker",
    "add",
    "adi",
    "align",
    "diagnose",
    "fuse",
    "mask_in_box",
    "mspd",
    "mssd",
    "mve",
    "parts",
    "point_to_plane_step",
    "point_to_point_step",
    "read_cloud",
    "read_depth",
    "read_depth_png",
    "read_mask",
    "read_mask_png",
    "read_pose",
    "render_depth",
    "vsd",
]

__version__ = _version("hybrid-icp")

if not _TYPE_CHECKING:

    def __getattr__(name: str) -> object:
        """Imports a module of the package at its first use, with the library that it needs."""
        if name in ("adapters", "bop", "plot", "rerun"):
            return _import(f"{__name__}.{name}")
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
