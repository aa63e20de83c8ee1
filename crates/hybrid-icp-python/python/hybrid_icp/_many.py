"""Refinement of many items on threads."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TYPE_CHECKING

from ._errors import InputError, InputWarning

if TYPE_CHECKING:
    import numpy.typing as npt

    from ._native import Model, Observation, Pipeline
    from ._results import Result


def refine(
    pipeline: Pipeline,
    items: Iterable[tuple[Model, Observation, npt.ArrayLike]],
    threads: int,
) -> list[Result]:
    """Refines every item. The native code runs without the GIL, so threads suffice.

    Items are read as threads become free, so that an iterable of images needs little memory.
    """
    if threads < 1:
        raise InputError(f"threads is {threads}, expected 1 or more")

    def result(index: int, item: tuple[Model, Observation, npt.ArrayLike]) -> Result:
        try:
            return pipeline.refine(*item)
        except (InputError, InputWarning, TypeError) as error:
            raise type(error)(f"items[{index}]: {error}") from error

    results: list[Result] = []
    running: deque[Future[Result]] = deque()
    with ThreadPoolExecutor(threads) as pool:
        try:
            for index, item in enumerate(items):
                if len(running) >= 2 * threads:
                    results.append(running.popleft().result())
                running.append(pool.submit(result, index, item))
            results.extend(future.result() for future in running)
        finally:
            for future in running:
                future.cancel()
    return results
