"""Which builds of which modules are tested, and the seeds that a test once failed with."""

from pathlib import Path

from structs import pack


def held(**fields: int) -> str:
    """Return the parameter that sets what registers hold at reset: what obeys the rules, but for the fields given."""
    times = {"line_period": 300, "line_read": 300, "step_period": 75, "step_read": 55, "ramp": 150, "noise_floor": 3}
    return f"AT_RESET=176'h{pack('registers_t', frame_sync=1, **times, **fields):x}"


#: Modules, each with the parameters of its builds.
MODULES = {
    "afferents": ["COLUMNS=3 STEPS=2 ADDRESS_BITS=5", "COLUMNS=1 STEPS=1 ADDRESS_BITS=5"],
    "announcement": [""],
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
    "ethernet_board": ["COLUMNS=3 ROWS=5 BAUD_CLOCKS=8 RESET_CLOCKS=60 PATTERN_CLOCKS=500"],
    "ethernet_frame": [""],
    "event_fifo": ["DEPTH=4 BITS=8", "DEPTH=5 BITS=12"],
    "link": ["BYTES=1", "BYTES=4"],
    "line_select": ["COLUMNS=9", "COLUMNS=6 HALF=3", "COLUMNS=5 HALF=1"],
    "line_sorter": ["ROWS=64", "ROWS=20"],
    "mux_ctrl": ["COLUMNS=5 STEPS=2 CSEL_CLOCKS=1", "COLUMNS=3 STEPS=1 HOLD=6 CSEL_CLOCKS=2", "COLUMNS=3 STEPS=4"],
    "packer_v1": ["MOST=7", "VALUED=0 MOST=280"],
    "packer_v2": [
        "ROWS=9 MOST=60",
        "ROWS=128 MOST=688 HOLD_US=1000 DIFFERENCE=1",
        "ROWS=64 MOST=128 VALUED=0 HEARTBEAT_US=30000",
    ],
    "pattern": ["", "COLUMNS=5 ROWS=7", "COLUMNS=128 ROWS=128 ROW_BITS=7", "COLUMNS=1 ROWS=1"],
    "power_law": [""],
    "ramp_counter": ["", "DELAY=6", "DELAY=9"],
    "random_lines": [""],
    "refresh": ["EVERY=1000"],
    "register_file": [
        f"COLUMNS=8 {held(lines=7)}",
        f"COLUMNS=128 ROWS=128 CHANNELS=64 STEPS=2 {held(lines=127, wire_version=1)}",
    ],
    "session": [""],
    "standing_word": ["BITS=11"],
    "status_sender": ["FAULT_CLOCKS=1000 ROWS=7 COLUMNS=128", "FAULT_CLOCKS=300 ROWS=64 COLUMNS=64 CHANNELS=64"],
    "stream_register": ["BITS=12"],
    "synchroniser": [""],
    "time_stamper": [""],
    "top": [
        f"COLUMNS=3 ROWS=20 QUEUE=1024 STATES_US=0 BAUD_CLOCKS=8 FAULT_CLOCKS=1000000000 LINK_BYTES={link_bytes}"
        for link_bytes in (1, 4)
    ],
    "totals": [""],
    "two_clock_memory": ["BITS=5 PLACES=3"],
    "uart_rx": ["CLOCKS=8", "CLOCKS=17"],
    "uart_tx": ["CLOCKS=5"],
    "udp_sender": ["MOST=90"],
}
BUILDS = [(module, build) for module, builds in MODULES.items() for build in builds]

#: Where seeds are kept, one a line behind the module and its parameters.
KEPT = Path(__file__).parent / "kept_seeds.txt"


def kept() -> list[tuple[str, str, int]]:
    """Return the cases that are kept: module, parameters, seed."""
    rows = (line.split() for line in KEPT.read_text().splitlines() if not line.startswith("#"))
    return [(module, " ".join(parameters), int(seed)) for module, *parameters, seed in rows]


def keep(module: str, parameters: str, seed: int) -> None:
    """Keep a case that failed, unless it is there."""
    if (module, parameters, seed) not in kept():
        with KEPT.open("a") as file:
            file.write(" ".join(filter(None, (module, parameters, str(seed)))) + "\n")
