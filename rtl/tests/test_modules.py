"""Each module by itself, by cocotb in Verilator: against a model in plain Python, with random inputs and pauses."""

import os
import subprocess
from pathlib import Path

import pytest

from logic import RTL
from modules.structs import pack


def held(**fields: int) -> str:
    """Return the parameter that sets what registers hold at reset: what obeys the rules, but for the fields given."""
    times = {"line_period": 300, "line_read": 300, "step_period": 75, "step_read": 55, "ramp": 150, "noise_floor": 3}
    return f"AT_RESET=175'h{pack('registers_t', frame_sync=1, **times, **fields):x}"


#: Modules, each with the parameters of its builds.
MODULES = {
    "afferents": ["COLUMNS=3 STEPS=2 ADDRESS_BITS=5", "COLUMNS=1 STEPS=1 ADDRESS_BITS=5"],
    "answer_queue": [""],
    "change_detector": [
        "COLUMNS=3 ROWS=6 CHANNELS=4 STEPS=2",
        "COLUMNS=3 ROWS=8 CHANNELS=8 STEPS=1 PREVIOUS_SAMPLE=1 DIFFERENCE=1 HOLDS=1",
        "COLUMNS=2 ROWS=16 CHANNELS=4 STEPS=4 REPEATS=0 HOLDS=1",
    ],
    "clock_div": ["PERIOD=7"],
    "command_receiver": [""],
    "comparator_array": ["CHANNELS=8", "CHANNELS=16 DELAY=5"],
    "comparator_column": [""],
    "datagram_sender": ["ROWS=5 BOARD=4711", "ROWS=128", "ROWS=1"],
    "ethernet_board": ["COLUMNS=3 ROWS=5 BAUD_CLOCKS=8 RESET_CLOCKS=60"],
    "ethernet_frame": [""],
    "event_fifo": ["DEPTH=4 BITS=8", "DEPTH=5 BITS=12"],
    "link": ["BYTES=1", "BYTES=4"],
    "line_select": ["COLUMNS=9", "COLUMNS=6 HALF=3"],
    "line_sorter": ["ROWS=64", "ROWS=20"],
    "mux_ctrl": ["COLUMNS=5 STEPS=2", "COLUMNS=3 STEPS=1"],
    "packer_v1": ["MOST=7", "VALUED=0 MOST=280"],
    "packer_v2": [
        "ROWS=9 MOST=60",
        "ROWS=128 MOST=688 HOLD_US=1000 DIFFERENCE=1",
        "ROWS=64 MOST=128 VALUED=0 HEARTBEAT_US=30000",
    ],
    "power_law": [""],
    "ramp_counter": [""],
    "random_lines": [""],
    "refresh": ["EVERY=1000"],
    "register_file": [
        f"COLUMNS=8 {held(lines=7)}",
        f"COLUMNS=128 ROWS=128 CHANNELS=64 STEPS=2 {held(lines=127, wire_version=1)}",
    ],
    "session": [""],
    "status_sender": ["FAULT_CLOCKS=1000 ROWS=7 COLUMNS=128", "FAULT_CLOCKS=300 ROWS=64 COLUMNS=64 CHANNELS=64"],
    "stream_register": ["BITS=12"],
    "synchroniser": [""],
    "time_stamper": [""],
    "top": [
        f"COLUMNS=3 ROWS=20 QUEUE=1024 STATES_US=0 BAUD_CLOCKS=8 FAULT_CLOCKS=1000000000 LINK_BYTES={link_bytes}"
        for link_bytes in (1, 4)
    ],
    "totals": [""],
    "uart_rx": ["CLOCKS=8", "CLOCKS=17"],
    "uart_tx": ["CLOCKS=5"],
    "udp_sender": ["MOST=90"],
}
BUILDS = [(module, build) for module, builds in MODULES.items() for build in builds]


def simulated(module: str, parameters: str, source: Path = RTL) -> subprocess.CompletedProcess[str]:
    """Run a module's tests; the exit status is 2 where one fails."""
    python = RTL.parent / ".venv-rtl" / "bin" / "python"
    command = [python, RTL / "bench" / "modules" / "run.py", module, *parameters.split(), "--source", source]
    # Within pytest cocotb would end with another status.
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST")}
    return subprocess.run(command, env=environment, capture_output=True, text=True, timeout=600, check=False)


@pytest.mark.parametrize(
    ("module", "parameters"), BUILDS, ids=[" ".join(build).split(" AT_RESET")[0] for build in BUILDS]
)
def test_a_module_does_what_its_page_says(module, parameters):
    result = simulated(module, parameters)
    assert result.returncode == 0, result.stdout[-3000:] + result.stderr[-3000:]


def test_every_module_has_its_test():
    sources = {path.stem.removeprefix("taxel_") for path in RTL.glob("taxel_*.sv")}
    assert sources - {"types", "registers"} == set(MODULES)
