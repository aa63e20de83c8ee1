"""Measures the overhead of a call from Python, and the speedup of a batch with two threads.

    python benches/python_overhead.py

Run this on a quiet machine, and compare only times of one run. The overhead is the time of a
pipeline that finds no pairs: only the call, the two scores and the work of the module remain.
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
    model, camera, observation = frame.model, frame.camera, frame.observation
    depth, mask = frame.depth, frame.mask
    true, rough = frame.true, frame.rough
    hybrid = Pipeline.preset("hybrid")

    image = DepthImage(depth)
    print(f"DepthImage of 640x480: {median_us(lambda: DepthImage(depth)):.0f} us")
    # The count includes the normals, which are estimated when they are asked for.
    of_array = median_us(lambda: Observation(depth, mask, camera).n_surfels)
    print(f"Observation of an array, {mask.sum()} masked: {of_array:.0f} us")
    of_image = median_us(lambda: Observation(image, mask, camera).n_surfels)
    print(f"Observation of a DepthImage: {of_image:.0f} us")
    print(f"refine, hybrid: {median_us(lambda: hybrid.refine(model, observation, rough)):.0f} us")
    print(f"mve: {median_us(lambda: mve(model, observation, rough)):.0f} us")

    # The object is outside the image: there is nothing to render and nothing to pair.
    outside = true.copy()
    outside[0, 3] = 5.0
    nothing = Pipeline.preset("projective-point-to-point")
    call = median_us(lambda: nothing.refine(model, observation, outside), 2000)
    print(f"overhead of refine, at most: {call:.1f} us")
    two = np.stack([outside, outside])
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
        median, fastest = statistics.median(times) * 1e3, min(times) * 1e3
        print(f"refine_batch of 256, {threads} threads: median {median:.0f} ms", end=", ")
        print(f"fastest {fastest:.0f} ms")
    # The two runs of a pair are adjacent in time. Other programs disturb the fastest run least.
    pairs = statistics.median(one / both for one, both in zip(spent[1], spent[2]))
    fastest = min(spent[1]) / min(spent[2])
    print(f"speedup of two threads: median of pairs {pairs:.2f}x, fastest {fastest:.2f}x")


if __name__ == "__main__":
    main()
