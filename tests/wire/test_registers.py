"""Commands and registers: presets, rules, order of writes."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from taxel import wire
from taxel.wire import Command, Registers

#: The reference's table: row_change, row_read, col_change, col_read, ramp_time, nrows, frames/s.
TABLE = {
    "5.2 kHz": (300, 300, 75, 55, 150, 63, 5208.33),
    "2 kHz": (781, 780, 195, 175, 510, 63, 2000.64),
    "20.8 kHz": (75, 75, 75, 55, 150, 63, 20_833.3),
}


@pytest.mark.parametrize("name", TABLE)
def test_a_preset_is_the_references(name):
    r = Registers.preset(name)
    timing = (r.row_change_period, r.row_read_duration, r.col_change_period, r.col_read_duration)
    assert (*timing, r.ramp_time, r.nrows) == TABLE[name][:-1]
    assert 1e6 / r.frame_us == pytest.approx(TABLE[name][-1], rel=1e-5)
    assert r.noise_floor == (10 if name == "2 kHz" else 3)
    assert r.warnings == ()
    assert r.frame_sync
    assert not (r.random_lines)
    assert not (r.record)
    assert not (r.invert_comparator)
    assert not (r.mechanoreceptor)


def test_presets_are_named_and_the_first_is_the_default():
    assert tuple(TABLE) == wire.PRESETS[:3]
    assert all(name.endswith(("FA-1", "64 channels")) or name.startswith("128 x 128") for name in wire.PRESETS[3:])
    assert Registers() == Registers.preset("5.2 kHz")


def test_words_lie_as_table_5_5_says():
    r = Registers(random_lines=True, line_period=5.28, noise_floor=7, lines=33, record=True)
    assert r.words == (0b1001, 528, 300, 55 << 16 | 75, 150, 7 << 8 | 32 << 16, 0, 1 << 16)


@given(register=st.integers(0, 7), value=st.integers(0, 2**32 - 1))
def test_a_command_is_table_5_1_and_comes_back(register, value):
    tops = sum((value >> (8 * k + 7) & 1) << k for k in range(4))
    sevens = [value >> 8 * k & 0x7F for k in (3, 2, 1, 0)]
    command = Command(register, value)
    assert command.to_bytes() == bytes([0x80 | register << 4 | tops, *sevens])
    assert Command.from_bytes(command.to_bytes()) == command
