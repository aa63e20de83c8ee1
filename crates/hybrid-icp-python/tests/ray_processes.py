"""The processes of our actors on this machine, to be killed."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import uuid
from pathlib import Path

MARK = "HYBRID_ICP_RAY_TEST"


def can_start(seconds: float) -> bool:
    """Whether Ray starts on this machine at all: where it may not start processes it fails, or waits for ever."""
    options = "num_cpus=1, include_dashboard=False, _node_ip_address='127.0.0.1', log_to_driver=False"
    code = f"import ray; ray.init('local', {options}); ray.shutdown()"
    environment = os.environ | {"RAY_USAGE_STATS_ENABLED": "0"}
    with subprocess.Popen([sys.executable, "-c", code], env=environment, start_new_session=True) as probe:
        try:
            return probe.wait(seconds) == 0
        except subprocess.TimeoutExpired:
            os.killpg(probe.pid, signal.SIGKILL)
            return False


def start(cpus: int) -> None:
    """Starts Ray for this process alone."""
    import ray

    # Workers inherit the environment of the process that starts Ray: the mark tells ours from any others.
    os.environ.update({MARK: uuid.uuid4().hex, "RAY_USAGE_STATS_ENABLED": "0"})
    ray.init("local", num_cpus=cpus, include_dashboard=False, _node_ip_address="127.0.0.1", log_to_driver=False)


def workers() -> list[int]:
    """Process ids of our actors."""
    mark = f"{MARK}={os.environ[MARK]}".encode()
    found = []
    for process in Path("/proc").iterdir():
        try:
            command = (process / "cmdline").read_bytes()
            if b"ray::" in command and b"Worker" in command and mark in (process / "environ").read_bytes().split(b"\0"):
                found.append(int(process.name))
        except (OSError, ValueError):
            continue
    return found
