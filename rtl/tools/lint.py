"""Lint the RTL: each module's head by its form, the rest with Verilator, every warning an error.

Where Verilator is not installed, it says so.

Usage: python rtl/tools/lint.py
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "dv"))

from verilated import QUIET, RTL, SOURCES, listed, run, verilator

#: Builds that differ in what is elaborated; a board is one with the cells' models of the bench.
BUILDS: tuple[tuple[str, dict[str, int]], ...] = (
    ("taxel_top", {}),
    ("taxel_top", {"COLUMNS": 5, "ROWS": 7, "PREVIOUS_SAMPLE": 1, "DIFFERENCE": 1, "VALUED": 0, "LINK_BYTES": 4}),
    ("taxel_ethernet_board", {}),
)


#: What the comment before each module states, each at the start of a line.
STATED = ("Throughput: ", "Latency: ", "Loses ")


def unstated() -> list[str]:
    """Return what modules do not state of themselves in the comment before them, and what stands in their heads instead.

    Packages are imported behind a module's ports: not all front ends read them before.
    """
    errors = []
    for file in listed():
        head, module, body = re.split(r"^(module|package)\b", file.read_text(), maxsplit=1, flags=re.MULTILINE)
        if module == "module":
            lines = head.splitlines()
            errors += [
                f"{file.name}: no line of its head comment begins with {stated!r}"
                for stated in STATED
                if not any(line.startswith(f"// {stated}") for line in lines)
            ]
            if re.search(r"\bimport\b", body.partition(");\n")[0]):
                errors.append(f"{file.name}: a package is imported before the ports; their types are package::type")
    return errors


def main() -> int:
    """Lint each build; return the exit status."""
    if errors := unstated():
        print("\n".join(errors))
        return 1
    if verilator() is None:
        print("rtl: not linted, as Verilator is not installed: make rtl-tools")
        return 0
    for top, parameters in BUILDS:
        options = [f"-G{name}={value}" for name, value in parameters.items()]
        try:
            run(
                *("verilator", "--lint-only", "-Wall", *QUIET, f"-I{RTL / 'dv'}", "--top-module", top, *options),
                *("-F", SOURCES / "taxel.f"),
            )
        except RuntimeError as error:
            print(error)
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
