"""Runs the program ``hybrid-icp``: ``python -m hybrid_icp demo``."""

import sys

from ._native import run_program


def main() -> None:
    """Runs the program with the arguments of this process, and exits."""
    sys.exit(run_program(["hybrid-icp", *sys.argv[1:]]))


if __name__ == "__main__":
    main()
