"""The longest ramps and the shortest reads that the rules allow, whatever their crossings take."""

import contextlib

import numpy as np
import pytest

from pair import Pair
from taxel import DeviceError
from taxel.simulate import NOT_RETURNED
from taxel.wire import Command
from verilated import RTL, SOURCES, copied

#: Ticks between the longest ramp and the step's period, by rule 3.
FALLS = 5


def with_late_crossings(to):
    """Write the sources with crossings that take each change at once or a clock later, as the proofs have them."""
    copied(to)
    for name, crossings in (("comparator_array", 2), ("announcement", 1)):
        text = (to / f"taxel_{name}.sv").read_text()
        assert text.count("  taxel_synchroniser ") == crossings
        (to / f"taxel_{name}.sv").write_text(text.replace("  taxel_synchroniser ", "  taxel_late_synchroniser "))
    late = (RTL / "fpv" / "late_synchroniser.sv").read_text()
    begins = "  always_ff @(posedge clk) begin"
    assert late.count(begins) == 1
    late = late.replace(begins, f"  always_ff @(posedge clk) late <= 1'($urandom);\n{begins}")
    (to / "taxel_late_synchroniser.sv").write_text(late.replace("taxel_synchroniser", "taxel_late_synchroniser"))
    with (to / "taxel.f").open("a") as order:
        order.write("taxel_late_synchroniser.sv\n")


@pytest.mark.slow
@pytest.mark.parametrize("period", [26, 27, 40, 41, 75, 76])
def test_a_ramp_as_long_as_its_step_allows_loses_no_value(period, tmp_path):
    with_late_crossings(tmp_path)
    rng = np.random.default_rng(period)
    pair = Pair(4, 8, source=tmp_path, seed=period)
    held, ramp = pair.board.registers, 3 * period - FALLS
    line = {"line_period": 0.04 * period, "line_read": 0.04 * period}
    step = {"step_period": 0.01 * period, "step_read": 0.01 * period}
    pair.write(held.commands_to(held.replace(**line, **step, ramp=ramp, noise_floor=0)))
    for _ in range(60):
        drawn = rng.integers(0, ramp + 2, (8, 4))
        ends = rng.choice([0, 1, ramp - 3, ramp - 2, ramp - 1, ramp, 60_000, NOT_RETURNED], (8, 4))
        pair.frame(np.where(rng.random((8, 4)) < 0.5, drawn, ends).astype(np.uint16))
    pair.finish()
    assert pair.received == pair.expected
    assert sum(map(len, pair.received)) > 5_000


def longest(registers):
    """Return the longest ramp that the rules allow beside what the other registers hold."""
    for ramp in range(3 * round(registers.step_read * 100), 0, -1):
        with contextlib.suppress(DeviceError):
            return registers.replace(ramp=ramp).ramp
    raise AssertionError("every ramp is refused")


@pytest.mark.parametrize("read", [26, 27])
def test_quick_a_write_after_which_a_read_follows_at_once_loses_no_value(read, tmp_path):
    with_late_crossings(tmp_path)
    rng = np.random.default_rng(read)
    pair = Pair(2, 8, source=tmp_path, seed=read)
    settles = pair.board.registers.replace(
        **dict.fromkeys(("line_period", "line_read"), 1.2),
        step_period=0.3,
        step_read=0.01 * read,
        ramp=1,
        noise_floor=0,
    )
    settles = settles.replace(ramp=longest(settles))
    pair.write(pair.board.registers.commands_to(settles))
    # From here on one register changes: the first read of a frame follows the last one's without a pause, or with one.
    for k in range(40):
        (command,) = pair.board.registers.commands_to(settles.replace(step_read=0.3) if k % 2 == 0 else settles)
        data = command.to_bytes()
        while data or not pair.answered:
            pair.frame(rng.integers(0, settles.ramp + 2, (8, 2)).astype(np.uint16), data)
            data = b""
    pair.finish()
    assert pair.received == pair.expected


#: Whether the crossings of the fast clock take a change a clock later at random.
LATE = [False, True]


@pytest.mark.parametrize("late", LATE)
@pytest.mark.parametrize("read", [4, 5, 6])
def test_quick_a_read_is_judged_by_the_registers_of_its_frame_however_short_it_is(read, late, tmp_path):
    source = SOURCES
    if late:
        with_late_crossings(tmp_path)
        source = tmp_path
    rng = np.random.default_rng(read)
    pair = Pair(3, 8, source=source, seed=read)
    held = pair.board.registers
    times = {"line_period": 1.04, "line_read": 1.04, "step_period": 0.26, "step_read": 0.01 * read, "noise_floor": 0}
    short = held.replace(**times, ramp=1)
    pair.write(held.commands_to(short.replace(ramp=longest(short))))
    for k in range(60):
        ramp = pair.board.registers.ramp
        data, after = b"", 0
        if pair.answered and k % 2:
            # The ramp's length and the comparators' sense change with a frame, right behind the last read.
            flags, length = 8 | int(rng.integers(0, 2)) << 2, int(rng.integers(1, longest(short) + 1))
            command = Command(0, flags) if rng.random() < 0.5 else Command(4, length)
            data, after = command.to_bytes(), int(rng.integers(0, 300))
        pair.frame(rng.integers(0, ramp + 2, (8, 3)).astype(np.uint16), data, after)
    pair.finish()
    assert pair.received == pair.expected
    assert sum(map(len, pair.received)) > 1_000
