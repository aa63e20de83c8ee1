"""Logs refinements for the viewer Rerun, which is optional: ``pip install rerun-sdk``.

>>> import rerun as rr  # doctest: +SKIP
>>> from hybrid_icp import rerun  # doctest: +SKIP
>>> rr.init("refinement", spawn=True)  # doctest: +SKIP
>>> result = rerun.refine(pipeline, model, observation, T_co)  # doctest: +SKIP
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from . import IterationEvent, Model, Observation, Pipeline, Result

__all__ = ["refine"]


def refine(
    pipeline: Pipeline,
    model: Model,
    observation: Observation,
    T_co: npt.ArrayLike,
    *,
    count: int = 300,
) -> Result:
    """Refines a pose and logs it to the current recording, on the timeline "iteration".

    The recording has the cloud (`observed`), the mesh at each pose (`object`), the pairs of
    observed and rendered points (`pairs`), and the scalars `n_pairs` and `mean_loss`. Lengths are
    in meters, in the frame of the camera.

    Parameters
    ----------
    pipeline : Pipeline
    model : Model
    observation : Observation
    T_co : array_like, shape (4, 4)
        The initial pose, camera from object, meters.
    count : int, optional
        Largest number of pairs that are drawn.

    Returns
    -------
    Result
        That of `Pipeline.refine`.
    """
    import rerun as rr

    from ._pictures import pairs

    rr.log("/", rr.ViewCoordinates.RDF, static=True)
    rr.log("observed", rr.Points3D(observation.surfels()[0]), static=True)
    mesh = rr.Mesh3D(vertex_positions=model.vertices, triangle_indices=model.faces)
    rr.log("object", mesh, static=True)

    def log(step: int, T: npt.NDArray[np.float64]) -> None:
        rr.set_time("iteration", sequence=step)
        rr.log("object", rr.Transform3D(translation=T[:3, 3], mat3x3=T[:3, :3]))
        ends = np.stack(pairs(observation, T, model, count), axis=1)
        rr.log("pairs", rr.LineStrips3D(list(ends)))

    events: list[IterationEvent] = []
    result = pipeline.refine(model, observation, T_co, events.append)
    for step, event in enumerate(events):
        log(step, event.T_co)
        rr.log("n_pairs", rr.Scalars(event.n_pairs))
        rr.log("mean_loss", rr.Scalars(event.mean_loss))
    log(len(events), result.T_co)
    return result
