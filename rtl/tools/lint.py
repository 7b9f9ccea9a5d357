"""Lint the RTL with Verilator, every warning an error; where Verilator is not installed, say so.

Usage: python rtl/tools/lint.py
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "bench"))

from logic import PACKAGES, QUIET, RTL, run, verilator

#: Builds that differ in what is elaborated; a board is one with the cells' models of the bench.
BUILDS: tuple[tuple[str, dict[str, int]], ...] = (
    ("taxel_top", {}),
    ("taxel_top", {"COLUMNS": 5, "ROWS": 7, "PREVIOUS_SAMPLE": 1, "DIFFERENCE": 1, "VALUED": 0}),
    ("taxel_ethernet_board", {}),
)


def main() -> int:
    """Lint each build; return the exit status."""
    if verilator() is None:
        print("rtl: not linted, as Verilator is not installed: make rtl-tools")
        return 0
    for top, parameters in BUILDS:
        options = [f"-G{name}={value}" for name, value in parameters.items()]
        sources = [RTL / name for name in (*PACKAGES, f"{top}.sv")]
        folders = [f"-I{RTL}", f"-I{RTL / 'bench'}"]
        try:
            run("verilator", "--lint-only", "-Wall", *QUIET, *folders, "--top-module", top, *options, *sources)
        except RuntimeError as error:
            print(error)
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
