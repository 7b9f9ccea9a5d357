"""Each module by itself, by cocotb in Verilator: against a model in plain Python, with random inputs and pauses."""

import os
import subprocess
from pathlib import Path

import pytest
from builds import BUILDS, MODULES, kept

from logic import RTL


def simulated(
    module: str, parameters: str, source: Path = RTL, seed: int | None = None
) -> subprocess.CompletedProcess[str]:
    """Run a module's tests, with a seed of their own where none is given; the exit status is 2 where one fails."""
    python = RTL.parent / ".venv-rtl" / "bin" / "python"
    command = [python, RTL / "bench" / "modules" / "run.py", module, *parameters.split(), "--source", source]
    command += [] if seed is None else ["--seed", str(seed)]
    # Within pytest cocotb would end with another status.
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST")}
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


@pytest.mark.parametrize(
    ("module", "parameters"), BUILDS, ids=[" ".join(build).split(" AT_RESET")[0] for build in BUILDS]
)
def test_a_module_does_what_its_page_says(module, parameters):
    result = simulated(module, parameters)
    assert result.returncode == 0, result.stdout[-3000:] + result.stderr[-3000:]


@pytest.mark.parametrize(("module", "parameters", "seed"), kept())
def test_a_seed_that_once_failed_passes(module, parameters, seed):
    result = simulated(module, parameters, seed=seed)
    assert result.returncode == 0, result.stdout[-3000:] + result.stderr[-3000:]


def test_every_module_has_its_test():
    sources = {path.stem.removeprefix("taxel_") for path in RTL.glob("taxel_*.sv")}
    assert sources - {"types", "registers"} == set(MODULES)
