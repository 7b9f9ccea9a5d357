"""Draw one-line faults by a seed over all modules, and say what catches each: its module's test, a proof, or whole frames.

Usage: python rtl/tools/faults.py [--seed N] [--count N] [--to FILE]. With the Python of `.venv`. It writes a line a fault to FILE, by
default `rtl/build/faults-SEED.tsv`, and goes on where it was stopped. A fault takes ten minutes at most. `rtl/tools/faults.md` has the
faults that were drawn once, and what those change that nothing caught.
"""

from __future__ import annotations

import argparse
import random
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

RTL = Path(__file__).parents[1]
sys.path[:0] = [str(RTL / folder) for folder in ("tools", "tests", "bench", "bench/modules")]

from builds import MODULES  # noqa: E402
from prove import PROOFS, checked  # noqa: E402
from test_planted_faults import differs, differs_in_spikes, differs_in_version_2  # noqa: E402

from logic import PACKAGES, QUIET, run  # noqa: E402
from pair import Pair  # noqa: E402

#: A fault is looked for so long, s.
LONGEST = 600
#: Seeds of a module's test.
SEEDS = (1, 2)
#: Made from registers.toml, or without a line that does anything.
LEFT_OUT = ("taxel_registers", "taxel_power_law", "taxel_types")

#: What stands in a line, and what stands there instead, by kinds. A comparison stands behind a name or a bracket within a condition.
EDITS: dict[str, list[tuple[str, str]]] = {
    "operator": [
        (r" == ", " != "), (r" != ", " == "), (r" < ", " <= "), (r" > ", " >= "), (r" >= ", " > "),
        (r"(?<=[(?&|=] )([\w.\[\]']+) <= (?=[^;]*[?)&|])", r"\1 < "), (r" && ", " || "), (r" \|\| ", " && "), (r" \+ ", " - "),
        (r" - ", " + "), (r" >> ", " << "), (r"(?<=[(=&|?] )!(?=[a-z(])", ""), (r" \? ([\w.']+) : ([\w.']+)", r" ? \2 : \1"),
    ],
    "constant": [
        (r"\b(\d+)'d(\d+)\b", "+1"), (r"\b(\d+)'d([1-9]\d*)\b", "-1"), (r"1'b0", "1'b1"), (r"1'b1", "1'b0"),
        (r"'\(([1-9]\d*)\)", "-1"), (r"= '0;", "= '1;"),
    ],
    "width": [(r"^  (?:input +|output +)?logic \[(\d+):0\]", "-1"), (r"(?<=\w)\[(\d+):0\](?=[^;]*;)", "-1"), (r"\b(\d+)'\(", "-1")],
    "reset": [(r"^( +)(?:if \(reset\w*\) )([\w.]+) +<= [^;]+;", r"\1"), (r"(if \(reset\w*\)) \{([\w.]+), ", r"\1 {")],
    "handshake": [
        (r"(\w*(?:valid|ready|taken|full|room|free|empty|sending|pop|push|waits|allowed)\w*) && ", ""),
        (r" && !?(\w*(?:valid|ready|taken|full|room|free|empty|sending|pop|push|waits|allowed)\w*)", ""),
        (r" \|\| !?(\w*(?:valid|ready|taken|full|room|free|empty|sending|pop|push|waits|allowed)\w*)", ""),
    ],
    "crossing": [
        (r"\{settled, unsettled\} <= \{unsettled, from\}", "{settled, unsettled} <= {from, from}"),
        (r"(taxel_(?:synchroniser|announcement|standing_word|two_clock_memory).*\.(?:from|take|announce)\()(\w)", r"\1!\2"),
        (r"(?<= )(\w*(?:crossed|last|fast|there|here)\w*) != ", r"!\1 != "), (r"(copied|copy|over|number|came|begins|waits) <= ", r"\1 <= !"),
    ],
}  # fmt: skip


#: Where clocks meet.
CROSSINGS = (
    "announcement",
    "comparator_array",
    "ethernet_board",
    "standing_word",
    "synchroniser",
    "uart_rx",
    "udp_sender",
)


@dataclass(frozen=True)
class Fault:
    """One line of a module that is another one."""

    kind: str
    module: str
    line: int  # counted from 1
    there: str
    instead: str


def replaced(match: re.Match[str], instead: str) -> str:
    """Return what stands in the place of a match: a number one more or less, or what the edit says."""
    if instead not in ("+1", "-1"):
        return match.expand(instead)
    last = len(match.groups())
    number = str(int(match[last]) + int(instead))
    start, end = match.start(last) - match.start(), match.end(last) - match.start()
    return match[0][:start] + number + match[0][end:]


def sites(module: str) -> dict[str, list[Fault]]:
    """Return all faults of a module by their kinds: comments, parameters' checks and what is asserted have none."""
    found: dict[str, list[Fault]] = {kind: [] for kind in EDITS}
    body = False
    lines = (RTL / f"{module}.sv").read_text().splitlines()
    for number, (line, next_line) in enumerate(zip(lines, [*lines[1:], ""], strict=True), 1):
        code = line.split("//")[0]
        body = body or code.startswith(");")
        # What a build's parameters must obey stands over its $error.
        if not body or "$error" in next_line or re.search(r"\$error|assert|localparam|genvar|parameter", code):
            continue
        for kind, edits in EDITS.items():
            if kind == "crossing" and module.removeprefix("taxel_") not in CROSSINGS:
                continue
            for there, instead in edits:
                for match in re.finditer(there, code):
                    other = code[: match.start()] + replaced(match, instead) + code[match.end() :]
                    found[kind].append(Fault(kind, module, number, code.strip(), other.rstrip()))
    return found


def drawn(seed: int) -> Iterator[Fault]:
    """Draw faults, each another one: first the kind, then the module, then the place."""
    rng = random.Random(seed)
    modules = sorted(file.stem for file in RTL.glob("taxel_*.sv") if file.stem not in LEFT_OUT)
    places = {module: sites(module) for module in modules}
    seen: set[Fault] = set()
    while True:
        kind = rng.choice(list(EDITS))
        module = rng.choice([module for module in modules if places[module][kind]])
        fault = rng.choice(places[module][kind])
        if fault not in seen:
            seen.add(fault)
            yield fault


def plant(fault: Fault, to: Path) -> bool:
    """Write the sources with the fault; return whether they can be elaborated."""
    for source in RTL.glob("*.sv"):
        shutil.copy(source, to)
    file = to / f"{fault.module}.sv"
    lines = file.read_text().splitlines()
    lines[fault.line - 1] = fault.instead
    file.write_text("\n".join(lines) + "\n")
    top = "taxel_ethernet_board"
    try:
        run(
            *("verilator", "--lint-only", *QUIET, "-Wno-fatal", f"-I{to}", f"-I{RTL / 'bench'}", "--top-module", top),
            *(to / name for name in (*PACKAGES, f"{top}.sv")),
        )
    except RuntimeError:
        return False
    return True


def by_module(fault: Fault, source: Path, until: float) -> str | None:
    """Run the test of the module, all builds with two seeds; return which build and seed caught the fault."""
    module = fault.module.removeprefix("taxel_")
    python = RTL.parent / ".venv-rtl" / "bin" / "python"
    for seed in SEEDS:
        for build in MODULES[module]:
            command = [python, RTL / "bench" / "modules" / "run.py", module, *build.split(), "--source", source]
            left = max(until - time.monotonic(), 1)
            # Its simulator is ended with it, by its own limit.
            result = subprocess.run([*command, "--seed", str(seed)], capture_output=True, check=False, timeout=left)
            if result.returncode == 2:
                return f"test, seed {seed}"
    return None


def by_proof(fault: Fault, source: Path, until: float) -> str | None:
    """Run the proofs of the module; return which one caught the fault."""
    for proof in PROOFS:
        if f"{fault.module}.sv" in proof.sources:
            mode = "bmc" if proof.engine.startswith("smtbmc") else "prove"
            left = max(until - time.monotonic(), 1)
            if checked(proof, f"{proof.name}_drawn", mode, source=source, longest=left) == "FAIL":
                return proof.name
    return None


def by_frames(source: Path, until: float) -> str | None:
    """Compare whole frames with the emulated board; return whether they caught the fault."""
    command = [sys.executable, __file__, "--frames", str(source)]
    left = max(until - time.monotonic(), 1)
    result = subprocess.run(command, capture_output=True, check=False, timeout=left)
    return "frames" if result.returncode else None


def frames(source: Path) -> int:
    """Return 0 where whole frames of these sources are the emulated board's."""
    return int(
        differs(Pair(8, 8, source=source)) or differs_in_version_2(source) or differs_in_spikes(source, "difference")
    )


def caught(fault: Fault, source: Path) -> str:
    """Return what catches a fault first, or that nothing does."""
    until = time.monotonic() + LONGEST
    steps = (
        lambda: by_module(fault, source, until),
        lambda: by_frames(source, until),
        lambda: by_proof(fault, source, until),
    )
    for step in steps:
        try:
            if found := step():
                return found
        except subprocess.TimeoutExpired:
            return "nothing in ten minutes"
    return "nothing"


def main() -> int:
    """Draw faults and look for each; return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=50)
    parser.add_argument("--to", type=Path)
    parser.add_argument("--frames", type=Path, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.frames:
        return frames(given.frames)
    table = given.to or RTL / "build" / f"faults-{given.seed}.tsv"
    table.parent.mkdir(exist_ok=True)
    done = table.read_text().splitlines() if table.exists() else []
    left = 0
    for number, fault in enumerate(drawn(given.seed), 1):
        row = f"{number}\t{fault.kind}\t{fault.module}:{fault.line}\t{fault.there}\t{fault.instead.strip()}\t"
        if (before := next((line for line in done if line.startswith(row)), None)) is None:
            with tempfile.TemporaryDirectory() as folder:
                source = Path(folder)
                before = row + (caught(fault, source) if plant(fault, source) else "not elaborated")
            with table.open("a") as file:
                file.write(before + "\n")
            print(before, flush=True)
        left += not before.endswith("not elaborated")
        if left == given.count:
            break
    return 0


if __name__ == "__main__":
    sys.exit(main())
