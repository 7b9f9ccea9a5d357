"""Single modules by cocotb, in Verilator: those that are neither proved nor tested by themselves elsewhere."""

import subprocess

import pytest

from logic import RTL

MODULES = {
    "answer_queue": [],
    "clock_div": ["PERIOD=7"],
    "command_receiver": [],
    "ramp_counter": [],
    "refresh": ["EVERY=1000"],
    "session": [],
    "stream_register": ["BITS=12"],
    "totals": [],
    "uart_tx": ["CLOCKS=5"],
}


@pytest.mark.parametrize("module", MODULES)
def test_a_module_does_what_its_page_says(module):
    python = RTL.parent / ".venv-rtl" / "bin" / "python"
    command = [python, RTL / "bench" / "modules" / "run.py", module, *MODULES[module]]
    result = subprocess.run(command, capture_output=True, text=True, timeout=600, check=False)
    assert result.returncode == 0, result.stdout[-3000:] + result.stderr[-3000:]
