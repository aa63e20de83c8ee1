"""How `hybrid-icp bop refine` scales: threads, memory, hypotheses per frame. On synthetic frames of `benches/examples/bop_frame.rs`."""

import csv
import os
import statistics
import subprocess
import sys
import time

ROUNDS = 3


def generate(programs, folder, frames, objects, hypotheses):
    subprocess.run(
        [programs / "examples" / "bop_frame", folder, str(frames), str(objects), str(hypotheses)], check=True
    )
    return folder


def refine(programs, folder, threads):
    """Returns seconds, peak resident memory in MB, and seconds in the pipeline by image, as the result file states them."""
    output = folder / "refined_synthetic-test.csv"
    command = [
        programs / "hybrid-icp", "bop", "refine", "--dataset", folder, "--results", folder / "starts_synthetic-test.csv",
        "--output", output, "--threads", str(threads),
    ]  # fmt: skip
    start = time.perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    seconds = time.perf_counter() - start
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        sys.exit(f"scaling: {' '.join(map(str, command))}: exit status {process.returncode}")
    with output.open() as file:
        by_image = {(row["scene_id"], row["im_id"]): float(row["time"]) for row in csv.DictReader(file)}
    # Linux counts in KiB, macOS in bytes.
    memory = usage.ru_maxrss / (1 << 20 if sys.platform == "darwin" else 1 << 10)
    return seconds, memory, by_image


def report(programs, folder):
    lines = ["| `bop refine` | measured | wanted |", "|---|---|---|"]

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
    for threads in (1, 2):
        _, memory, _ = refine(programs, crowded, threads)
        lines.append(
            f"| a frame of 10 objects × 100 hypotheses, {threads} thread{'s'[: threads - 1]}: peak resident memory | "
            f"{memory:.0f} MB | < 200 MB |"
        )

    for hypotheses in (1, 10, 100, 1000):
        frame = generate(programs, folder / f"hypotheses-{hypotheses}", 1, 1, hypotheses)
        costs, memories = [], []
        for _ in range(ROUNDS):
            _, memory, by_image = refine(programs, frame, 1)
            costs.append(sum(by_image.values()) / hypotheses * 1e3)
            memories.append(memory)
        lines.append(
            f"| one object, {hypotheses} hypotheses in a frame: per hypothesis (peak memory) | "
            f"{statistics.median(costs):.2f} ms ({statistics.median(memories):.0f} MB) | flat |"
        )
    return "\n".join(lines)
