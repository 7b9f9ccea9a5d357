"""Commands and registers: presets, rules, order of writes."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from refusal import refused

import taxel
from taxel import wire
from taxel._base.errors import Place
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


@given(
    names=st.tuples(st.sampled_from(["5.2 kHz", "2 kHz"]), st.sampled_from(["5.2 kHz", "2 kHz"])),
    floor=st.integers(0, 255),
)
def test_writes_lead_to_the_target_and_none_is_refused_on_the_way(names, floor):
    start, target = Registers.preset(names[0]), Registers.preset(names[1]).replace(noise_floor=floor)
    board = taxel.simulate.Board(start)
    for command in start.commands_to(target):
        assert board.command(command.to_bytes()) == f"ok REG{command.register}=0x{command.value:08X}\n"
    assert board.registers == target


def test_a_wrong_order_is_refused_half_way():
    board = taxel.simulate.Board(Registers.preset("5.2 kHz"))
    slow = Registers.preset("2 kHz")
    assert board.command(Command(4, slow.words[4]).to_bytes()) == "bad REG4 rule 3\n"
    assert board.command(Command(3, slow.words[3]).to_bytes()) == "bad REG3 rule 2\n"
    assert board.command(Command(2, slow.words[2]).to_bytes()) == "bad REG2 rule 1\n"
    assert board.registers == Registers.preset("5.2 kHz")


def test_what_is_hardly_meant_is_warned_of():
    (settling,) = Registers(step_read=0.6).warnings
    assert settling.endswith("(rule 5)")
    shuffled = Registers(random_lines=True, lines=2, step_read=0.23, ramp=60)
    assert shuffled.warnings == ()
    (settling,) = shuffled.replace(step_read=0.24).warnings
    assert settling.endswith("(rule 5)")
    (floor,) = Registers(noise_floor=150).warnings
    assert floor.endswith("(rule 6)")


def test_the_manuals_names_are_aliases_in_its_own_units():
    assert Registers(row_change_period=400, nrows=31) == Registers(line_period=4.0, lines=32)


@pytest.mark.parametrize(
    ("call", "argument"),
    [
        (lambda: Registers(speed=1), "speed"),
        (lambda: Registers(line_period=3.001), "line_period"),
        (lambda: Registers(line_period=float("nan")), "line_period"),
        (lambda: Registers(ramp=1.5), "ramp"),
        (lambda: Registers(ramp=-1), "ramp"),
        (lambda: Registers(nrows=0.5), "nrows"),
        (lambda: Registers.preset("fast"), "preset"),
        (
            lambda: Registers().with_preset("128 x 128, 1 kHz"),
            "preset",
        ),
        (
            lambda: Registers(array=taxel.Array(128, 128)).with_preset("2 kHz"),
            "preset",
        ),
        (lambda: Command(8, 0), "register"),
        (lambda: Command(0, -1), "value"),
        (lambda: Command(0, 2**32), "value"),
    ],
)
def test_nonsense_is_refused_in_one_line(call, argument):
    with refused(argument=argument):
        call()


def test_bytes_that_are_no_command_are_refused_by_place():
    with refused(taxel.FormatError):
        Command.from_bytes(b"abcd")
    with refused(taxel.FormatError, place=Place(byte=0)):
        Command.from_bytes(b"abcde")


def test_boards_with_other_channels_are_not_led_to():
    with refused(taxel.DeviceError):
        Registers().commands_to(Registers.preset("20.8 kHz"))
