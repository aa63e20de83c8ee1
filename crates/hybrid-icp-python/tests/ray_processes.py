"""The processes of our actors on this machine, to be killed."""

from __future__ import annotations

import os
import uuid
from pathlib import Path

MARK = "HYBRID_ICP_RAY_TEST"


def start(cpus: int) -> None:
    """Starts Ray for this process alone."""
    import ray

    # Workers inherit the environment of the process that starts Ray: the mark tells ours from any others.
    os.environ.update({MARK: uuid.uuid4().hex, "RAY_USAGE_STATS_ENABLED": "0"})
    ray.init(num_cpus=cpus, include_dashboard=False, _node_ip_address="127.0.0.1", log_to_driver=False)


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
