"""Draw one-line faults by a seed over all modules, and say what catches each: its module's test, whole frames, or a proof.

Usage: python rtl/tools/faults.py [--seed N] [--count N] [--to FILE] [--proofs]. With the Python of `.venv`. It writes a line a fault to FILE,
by default `rtl/build/faults-SEED.tsv`, and goes on where it was stopped; it fails where fewer than `ENOUGH` of them are caught. A fault takes
ten minutes at most. `rtl/tools/faults.md` has the faults that were drawn once, and what those change that nothing caught. With `--proofs`
faults are drawn for each proof until it finds one; a proof that finds none of `TRIES` fails.
"""

from __future__ import annotations

import argparse
import contextlib
import random
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "dv"))

from prove import PROOFS, Proof, checked
from scenes import SCENES
from verilated import QUIET, RTL, SOURCES, copied, listed, run

#: A fault is looked for so long, s.
LONGEST = 600
#: Seeds of a module's test.
SEEDS = (1, 2)
#: Of faults that are drawn, how many must be caught: of fifty, six changed nothing that a board does.
ENOUGH = 0.8
#: How many faults a proof has at most to find one, and for how long it looks for each, s.
TRIES, LOOKS = 12, 300
#: Made from registers.toml.
LEFT_OUT = ("taxel_registers", "taxel_power_law")

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
    lines = (SOURCES / f"{module}.sv").read_text().splitlines()
    for number, (line, next_line) in enumerate(zip(lines, [*lines[1:], ""], strict=True), 1):
        code = line.split("//")[0]
        body = body or code.startswith((");", "package "))
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
    modules = sorted(file.stem for file in listed() if file.stem not in LEFT_OUT)
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
    copied(to)
    file = to / f"{fault.module}.sv"
    lines = file.read_text().splitlines()
    lines[fault.line - 1] = fault.instead
    file.write_text("\n".join(lines) + "\n")
    top = "taxel_ethernet_board"
    try:
        run(
            *("verilator", "--lint-only", *QUIET, "-Wno-fatal", f"-I{RTL / 'dv'}", "--top-module", top),
            *("-F", to / "taxel.f"),
        )
    except RuntimeError:
        return False
    return True


def by_module(fault: Fault, source: Path, until: float) -> str | None:
    """Run the test of the module, all builds with two seeds; return which seed caught the fault."""
    test = RTL / "dv" / "modules" / f"{fault.module.replace('taxel', 'test', 1)}.py"
    python = RTL.parent / ".venv-rtl" / "bin" / "python"
    for seed in SEEDS if test.exists() else ():
        command = [python, "-m", "pytest", "-q", "-x", test, "-k", test.stem, "--source", source, "--seed", str(seed)]
        left = max(until - time.monotonic(), 1)
        result = subprocess.run(command, capture_output=True, check=False, timeout=left)
        if result.returncode == 1:
            return f"test, seed {seed}"
    return None


def by_proof(fault: Fault, source: Path, until: float) -> str | None:
    """Run the proofs of the module; return which one caught the fault."""
    for proof in PROOFS:
        if fault.module in proof.sources:
            left = max(until - time.monotonic(), 1)
            if checked(proof, proof.looking, source, left) == "FAIL":
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
    return int(any(differs(source) for differs in SCENES.values()))


def can_fail(proof: Proof, seed: int) -> bool:
    """Return whether a proof finds one of some faults that are drawn in its sources."""
    rng = random.Random(f"{seed} {proof.name}")
    # A package that is made is no module, but its rules are what a proof is of.
    places = [
        fault
        for name in proof.sources
        if not name.startswith("fpv/")
        for kind in sites(name).values()
        for fault in kind
    ]
    for fault in rng.sample(places, min(TRIES, len(places))):
        with tempfile.TemporaryDirectory() as folder:
            source = Path(folder)
            with contextlib.suppress(subprocess.TimeoutExpired):
                if plant(fault, source) and checked(proof, proof.looking, source, LOOKS) == "FAIL":
                    print(f"{proof.name} finds {fault.module}:{fault.line} {fault.instead.strip()}", flush=True)
                    return True
    print(f"{proof.name}: found none of the faults that were drawn", flush=True)
    return False


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
    parser.add_argument(
        "--seed",
        type=int,
        default=random.SystemRandom().randrange(1 << 31),
        help="another one each time where none is given",
    )
    parser.add_argument("--count", type=int, default=50)
    parser.add_argument("--to", type=Path)
    parser.add_argument("--proofs", action="store_true", help="look for faults with each proof instead")
    parser.add_argument("--frames", type=Path, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.frames:
        return frames(given.frames)
    if given.proofs:
        return sum(not can_fail(proof, given.seed) for proof in PROOFS)
    table = given.to or RTL / "build" / f"faults-{given.seed}.tsv"
    print(f"seed {given.seed}", flush=True)
    table.parent.mkdir(exist_ok=True)
    done = table.read_text().splitlines() if table.exists() else []
    left = found = 0
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
        found += not before.endswith(("not elaborated", "\tnothing", "\tnothing in ten minutes"))
        if left == given.count:
            break
    print(f"{found} of {left} were caught")
    return 0 if found >= ENOUGH * left else 1


if __name__ == "__main__":
    sys.exit(main())
