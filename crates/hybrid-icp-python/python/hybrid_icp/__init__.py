"""Refine 6D object poses in depth images.

A detector gives a segmentation mask and a rough pose. `Pipeline().refine` returns a better pose and its score. `Pipeline()` runs
the default ``"auto"``, which also searches for the object if refinement fails. `Pipeline("hybrid")` is the method of the paper
(Dreczkowski & Johns), which selects the registration from the image.

Conventions: metres and radians; poses are 4x4 float64 matrices ``T_co`` that take object coordinates to the camera's; cameras look
along +z with x right and y down; images are indexed [v, u] with pixel centres at integers; depth is along the optical axis, 0 where
nothing was measured.

Examples
--------
A plate half a metre in front of the camera, and a detector that is four centimetres off:

>>> import numpy as np
>>> from hybrid_icp import Camera, Model, Observation, Pipeline, render_depth
>>> model = Model([[-.1, -.1, 0], [.1, -.1, 0], [.1, .1, 0], [-.1, .1, 0]], [[0, 2, 1], [0, 3, 2]])
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

from ._errors import FileError, HybridIcpError, InputError, InputWarning
from ._native import (
    Camera,
    DepthImage,
    Fuser,
    IterationEvent,
    Model,
    Observation,
    Pipeline,
    PoseEstimate,
    RegimeEvent,
    Result,
    SequentialEstimator,
    SequentialStep,
    StageEvent,
    add,
    adi,
    fuse,
    mspd,
    mssd,
    mve,
    point_to_plane_step,
    point_to_point_step,
    read_depth_png,
    read_mask_png,
    render_depth,
    vsd,
)

__all__ = [
    "Camera",
    "DepthImage",
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
    "add",
    "adi",
    "fuse",
    "mspd",
    "mssd",
    "mve",
    "point_to_plane_step",
    "point_to_point_step",
    "read_depth_png",
    "read_mask_png",
    "render_depth",
    "vsd",
]
