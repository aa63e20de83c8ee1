"""Measures the time and memory of `hybrid-icp bop refine` on generated scenes.

The time is compared between numbers of threads and numbers of hypotheses per frame.
"""

import csv
import os
import shutil
import statistics
import subprocess
import sys
import time

ROUNDS = 5
OUTPUT = "refined_synthetic-test.csv"


def generate(programs, folder, frames, objects, hypotheses):
    shutil.rmtree(folder, ignore_errors=True)
    command = [
        programs / "hybrid-icp", "bop", "generate", "--out", folder, "--scenes", "1", "--images", str(frames),
        "--instances", str(objects), "--starts", str(hypotheses),
    ]  # fmt: skip
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return folder


def start(programs, folder, threads):
    command = [
        programs / "hybrid-icp", "bop", "refine", "--dataset", folder, "--results", folder / "initial_synthetic-test.csv",
        "--output", folder / OUTPUT, "--threads", str(threads), "--pipeline", "hybrid",
    ]  # fmt: skip
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def finish(process):
    if process.wait() != 0:
        sys.exit(f"scaling: {' '.join(map(str, process.args))}: exit status {process.returncode}")


def refine(programs, folder, threads):
    """Returns the total seconds, and the seconds in the pipeline by the result file."""
    begin = time.perf_counter()
    finish(start(programs, folder, threads))
    seconds = time.perf_counter() - begin
    with (folder / OUTPUT).open() as file:
        by_image = {(row["scene_id"], row["im_id"]): float(row["time"]) for row in csv.DictReader(file)}
    return seconds, sum(by_image.values())


def peak_memory(programs, folder, threads):
    """Returns the peak resident memory as text.

    The peak is read from the running process. After its end, the system's report would include the
    memory of this process at the fork. The peak only grows, so the last value misses only the growth
    of the last moments.
    """
    process = start(programs, folder, threads)
    peak = None
    while process.poll() is None:
        try:
            with open(f"/proc/{process.pid}/status") as status:
                text = status.read()
        except OSError:
            break  # Not Linux.
        found = [line.split()[1] for line in text.splitlines() if line.startswith("VmHWM:")]
        # Until its program is loaded, the process is a copy of this one.
        if found and "Name:\thybrid-icp" in text:
            peak = int(found[0])
        time.sleep(0.001)
    finish(process)
    return "unknown on this system" if peak is None else f"{peak / 1024:.0f} MB"


def report(programs, folder):
    lines = ["| `bop refine` | measured | target |", "|---|---|---|"]

    many = generate(programs, folder / "frames", 8, 10, 10)
    ratios, ones = [], []
    for _ in range(ROUNDS):
        one, two = refine(programs, many, 1)[0], refine(programs, many, 2)[0]
        ratios.append(one / two)
        ones.append(one)
    lines.append(
        f"| 8 frames × 10 objects × 10 hypotheses: 1 thread : 2 threads | {statistics.median(ratios):.2f} "
        f"({min(ratios):.2f}–{max(ratios):.2f}) of {statistics.median(ones):.2f} s, "
        f"{os.cpu_count()} processors | ≥ 1.8 on two cores |"
    )

    crowded = generate(programs, folder / "crowded", 1, 10, 100)
    lines.append(
        f"| a frame of 10 objects × 100 hypotheses: peak resident memory | {peak_memory(programs, crowded, 2)} | < 200 MB |"
    )

    for hypotheses in (1, 10, 100, 1000):
        frame = generate(programs, folder / f"hypotheses-{hypotheses}", 1, 1, hypotheses)
        costs = [refine(programs, frame, 1)[1] / hypotheses * 1e3 for _ in range(ROUNDS)]
        lines.append(
            f"| one object, {hypotheses} hypotheses in a frame: per hypothesis | {statistics.median(costs):.2f} ms "
            f"({min(costs):.2f}–{max(costs):.2f}), peak {peak_memory(programs, frame, 1)} | flat |"
        )
    return "\n".join(lines)
