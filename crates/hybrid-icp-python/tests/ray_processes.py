"""Finds the processes of our Ray actors on this machine, so that tests can kill them."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import uuid
from pathlib import Path

MARK = "HYBRID_ICP_RAY_TEST"


def can_start(seconds: float) -> bool:
    """Returns whether Ray starts. It fails or waits forever if it cannot start processes."""
    options = "num_cpus=1, include_dashboard=False, log_to_driver=False"
    options += ", _node_ip_address='127.0.0.1'"
    code = f"import ray; ray.init('local', {options}); ray.shutdown()"
    environment = os.environ | {"RAY_USAGE_STATS_ENABLED": "0"}
    command = [sys.executable, "-c", code]
    with subprocess.Popen(command, env=environment, start_new_session=True) as probe:
        try:
            return probe.wait(seconds) == 0
        except subprocess.TimeoutExpired:
            os.killpg(probe.pid, signal.SIGKILL)
            return False


def start(cpus: int) -> None:
    """Starts Ray for this process only."""
    import ray

    # Workers inherit the environment of the process that starts Ray. The mark identifies ours.
    os.environ.update({MARK: uuid.uuid4().hex, "RAY_USAGE_STATS_ENABLED": "0"})
    address = "127.0.0.1"
    ray.init(
        "local", num_cpus=cpus, include_dashboard=False, _node_ip_address=address,
        log_to_driver=False,
    )


def workers() -> list[int]:
    """Returns the process ids of our actors."""
    mark = f"{MARK}={os.environ[MARK]}".encode()
    found = []
    for process in Path("/proc").iterdir():
        try:
            command = (process / "cmdline").read_bytes()
            environment = (process / "environ").read_bytes().split(b"\0")
            if b"ray::" in command and b"Worker" in command and mark in environment:
                found.append(int(process.name))
        except (OSError, ValueError):
            continue
    return found
