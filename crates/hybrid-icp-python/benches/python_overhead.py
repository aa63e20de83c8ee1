"""What a call from Python costs over Rust, and how a batch scales with threads.

    python benches/python_overhead.py

Ratios and differences within one run; a quiet machine, please. A pipeline that finds no pairs at once is timed for the overhead, as all that
is left of `refine` then is the call, the two scores, and what the module adds.
"""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from hybrid_icp import DepthImage, Observation, Pipeline, mve

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "examples"))

from scene import scene


def median_us(call: Callable[[], object], times: int = 200) -> float:
    spent = []
    for _ in range(times):
        start = time.perf_counter()
        call()
        spent.append(time.perf_counter() - start)
    return statistics.median(spent) * 1e6


def main() -> None:
    frame = scene()
    model, camera, depth, mask, observation = frame.model, frame.camera, frame.depth, frame.mask, frame.observation
    true, rough = frame.true, frame.rough
    hybrid = Pipeline.preset("hybrid")

    image = DepthImage(depth)
    print(f"DepthImage of 640x480: {median_us(lambda: DepthImage(depth)):.0f} us")
    print(f"Observation of an array, {mask.sum()} masked: {median_us(lambda: Observation(depth, mask, camera)):.0f} us")
    print(f"Observation of a DepthImage: {median_us(lambda: Observation(image, mask, camera)):.0f} us")
    print(f"refine, hybrid: {median_us(lambda: hybrid.refine(model, observation, rough)):.0f} us")
    print(f"mve: {median_us(lambda: mve(model, observation, rough)):.0f} us")

    # Nothing to render, nothing to pair: the object is beside the image.
    beside = true.copy()
    beside[0, 3] = 5.0
    nothing = Pipeline.preset("projective-point-to-point")
    print(f"overhead of refine, at most: {median_us(lambda: nothing.refine(model, observation, beside), 2000):.1f} us")
    two = np.stack([beside, beside])
    threaded = median_us(lambda: nothing.refine_batch(model, observation, two, threads=2), 500)
    print(f"overhead of refine_batch on two threads, at most: {threaded:.0f} us")

    random = np.random.default_rng(1)
    poses = np.repeat(true[None], 256, 0)
    poses[:, :3, 3] += random.normal(0, 0.008, (256, 3))
    spent: dict[int, list[float]] = {1: [], 2: []}
    for threads in spent:
        hybrid.refine_batch(model, observation, poses, threads=threads)
    for _ in range(15):
        for threads, times in spent.items():
            start = time.perf_counter()
            hybrid.refine_batch(model, observation, poses, threads=threads)
            times.append(time.perf_counter() - start)
    for threads, times in spent.items():
        print(f"refine_batch of 256, {threads} threads: median {statistics.median(times) * 1e3:.0f} ms, fastest {min(times) * 1e3:.0f} ms")
    # Each pair of runs stood side by side; the fastest of either is what other programs on the machine disturbed least.
    pairs = statistics.median(one / both for one, both in zip(spent[1], spent[2]))
    print(f"two threads over one: median of pairs {pairs:.2f}x, fastest {min(spent[1]) / min(spent[2]):.2f}x")


if __name__ == "__main__":
    main()
