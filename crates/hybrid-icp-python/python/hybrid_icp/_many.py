"""Refinement of many items on threads."""

from __future__ import annotations

import os
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy.typing as npt

    from ._native import Model, Observation, Pipeline
    from ._results import Result


def refine(
    pipeline: Pipeline,
    items: Iterable[tuple[Model, Observation, npt.ArrayLike]],
    threads: int | None,
) -> list[Result]:
    """Refines every item. The native code runs without the GIL, so threads suffice."""
    with ThreadPoolExecutor(threads or os.cpu_count()) as pool:
        return list(pool.map(lambda item: pipeline.refine(*item), items))
