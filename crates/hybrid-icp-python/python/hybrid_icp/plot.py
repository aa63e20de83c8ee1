"""Plots of refinements with matplotlib, which is optional: ``pip install matplotlib``.

>>> from hybrid_icp import Pipeline, plot  # doctest: +SKIP
>>> events = []  # doctest: +SKIP
>>> result = Pipeline().refine(model, observation, T_co, events.append)  # doctest: +SKIP
>>> plot.convergence(events)  # doctest: +SKIP
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from . import IterationEvent, Model, Observation, Result

__all__ = ["convergence", "correspondences", "overlay"]


def _axes(ax: Any) -> Any:
    if ax is not None:
        return ax
    from matplotlib import pyplot

    return pyplot.subplots()[1]


def convergence(events: Sequence[IterationEvent], ax: Any = None) -> Any:
    """Plots the loss of every iteration, and a line where a stage starts.

    Parameters
    ----------
    events : sequence of IterationEvent
        The events that an observer received, such as `events.append`.
    ax : matplotlib.axes.Axes, optional

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = _axes(ax)
    ax.semilogy([event.mean_loss for event in events], marker=".")
    for index, event in enumerate(events):
        if event.iteration == 0:
            ax.axvline(index, color="0.8", zorder=0)
    ax.set(xlabel="iteration", ylabel="mean loss, m²")
    return ax


def overlay(
    result: Result,
    observation: Observation,
    image: npt.ArrayLike | None = None,
    ax: Any = None,
) -> Any:
    """Shows `Result.overlay`, cut to the object.

    Parameters
    ----------
    result : Result
    observation : Observation
    image : array_like, shape (H, W) or (H, W, 3), uint8, optional
        Gray or RGB values of the pixels. By default, the picture of the depth.
    ax : matplotlib.axes.Axes, optional

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = _axes(ax)
    ax.imshow(result.overlay(observation, image))
    v, u = np.nonzero(observation.mask)
    if len(v):
        border = 0.3 * max(np.ptp(u), np.ptp(v)) + 5
        ax.set(
            xlim=(u.min() - border, u.max() + border),
            ylim=(v.max() + border, v.min() - border),
        )
    ax.set_title(f"confidence {result.confidence:.2f}, MVE {result.mve:.3f}")
    return ax


def correspondences(
    observation: Observation,
    T_co: npt.ArrayLike,
    model: Model,
    ax: Any = None,
    *,
    count: int = 300,
) -> Any:
    """Plots observed points and the rendered points at their pixels, from above.

    Parameters
    ----------
    observation : Observation
    T_co : array_like, shape (4, 4)
        Camera from object, meters.
    model : Model
    ax : matplotlib.axes.Axes, optional
    count : int, optional
        Largest number of pairs.

    Returns
    -------
    matplotlib.axes.Axes
    """
    from ._pictures import pairs

    ax = _axes(ax)
    observed, rendered = pairs(observation, T_co, model, count)
    ends = np.stack([observed, rendered], axis=1)
    for a, b in ends:
        ax.plot([a[0], b[0]], [a[2], b[2]], color="0.7", linewidth=0.5, zorder=0)
    ax.plot(observed[:, 0], observed[:, 2], ".", markersize=2, label="observed")
    ax.plot(rendered[:, 0], rendered[:, 2], ".", markersize=2, label="model")
    ax.set(xlabel="x, meters", ylabel="z, meters", aspect="equal")
    ax.legend()
    return ax
