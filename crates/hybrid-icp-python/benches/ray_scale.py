"""Measures the overhead of Ray over `bop refine` for the same rows and number of workers.

    cargo xtask scale --ray --threads 2

runs `bop refine`, and then this program with its output and time. A second run kills one worker in
the middle. Fails if the bytes differ.
"""

from __future__ import annotations

import argparse
import os
import signal
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from ray_processes import start, workers

from hybrid_icp import Pipeline


def main() -> None:
    parser = argparse.ArgumentParser()
    for name in ("dataset", "results", "expected"):
        parser.add_argument(name, type=Path)
    parser.add_argument("--rows", type=int, required=True)
    parser.add_argument("--workers", type=int, required=True)
    parser.add_argument("--seconds", type=float, required=True, help="time of bop refine")
    options = parser.parse_args()

    began = time.perf_counter()
    import hybrid_icp.ray

    imported = time.perf_counter()
    start(cpus=options.workers)
    started = time.perf_counter() - imported
    print(f"Ray: imported in {imported - began:.1f} s, started in {started:.1f} s")
    expected = options.expected.read_bytes()

    def run(kill: bool) -> None:
        seen: list[tuple[float, int]] = []
        killed: list[int] = []

        def watch(done: int, total: int) -> None:
            seen.append((time.perf_counter() - began, done))
            if kill and not killed and done >= total // 3:
                alive = workers()
                if alive:
                    os.kill(alive[0], signal.SIGKILL)
                    killed.append(alive[0])

        output = options.expected.with_name("ray.csv")
        began = time.perf_counter()
        hybrid_icp.ray.refine(
            options.dataset, options.results, output, pipeline=Pipeline.preset("hybrid"),
            rescore="mve", workers=options.workers, limit=options.rows, resume=False,
            progress=watch,
        )
        seconds = time.perf_counter() - began
        if kill and not killed:
            raise SystemExit("found no worker to kill, expected at least one")
        same = output.read_bytes() == expected
        more = (seconds - options.seconds) / options.rows * 1000
        first, last = seen[0], seen[-1]
        rate = (last[1] - first[1]) / (last[0] - first[0])
        print(
            f"{options.rows} rows, {options.workers} workers{', one killed' if kill else ''}:"
            f" {seconds:.1f} s, {options.rows / seconds:.0f} rows/s,"
            f" {more:.2f} ms per row more than bop refine ({options.seconds:.1f} s);"
            f" first task after {first[0]:.1f} s, then {rate:.0f} rows/s;"
            f" {'the same bytes' if same else 'OTHER BYTES'}"
        )
        if not same:
            raise SystemExit(1)

    run(kill=False)
    run(kill=True)


if __name__ == "__main__":
    main()
