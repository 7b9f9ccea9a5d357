"""Faults planted in the logic, one line each: the comparison with the emulated board sees every one of them."""

import shutil

import numpy as np
import pytest
from test_totals import answered_and_counted
from test_version_2 import OFTEN, written

from logic import RTL
from pair import Pair, answers
from taxel.simulate import NOT_RETURNED
from taxel.wire import Command

#: File, what stands there, what stands there instead.
FAULTS = [
    ("taxel_change_detector.sv", "moved > 16'(of_compared", "moved >= 16'(of_compared"),
    ("taxel_change_detector.sv", "{channel, now.step[STEP_BITS-1:0]}", "{now.step[STEP_BITS-1:0], channel}"),
    ("taxel_change_detector.sv", "if (step_end) ended <= read;", "if (read_done) ended <= read;"),
    ("taxel_change_detector.sv", "&& !judged.not_returned && !of_judged", "&& !of_judged"),
    ("taxel_comparator_column.sv", "first   <= sample[0];", "first   <= sample[1];"),
    ("taxel_ramp_counter.sv", "pairs <= full;", "pairs <= full - 15'd1;"),
    ("taxel_comparator_array.sv", "if (begins) inverted_now <= inverted_next;", "inverted_now <= 1'b0;"),
    ("taxel_time_stamper.sv", "CLOCKS - 1", "CLOCKS"),
    ("taxel_mux_ctrl.sv", "read.stamp         <= stamp;", "if (frame_start) read.stamp <= stamp;"),
    ("taxel_mux_ctrl.sv", "32'(EARLY + 1);", "32'(EARLY + 2);"),
    ("taxel_mux_ctrl.sv", "read.noise_floor   <= active", "read.noise_floor   <= written"),
    ("taxel_register_file.sv", "changed.record != written.record", "changed.record"),
]


#: Those that only an answer with totals shows.
TOTALS = [
    ("taxel_totals.sv", "if (done) totals", "if (over) totals"),
    ("taxel_totals.sv", "if (done) totals <=", "totals <="),
    ("taxel_change_detector.sv", "judged.last && !of_judged.initial_frame", "judged.last"),
    ("taxel_change_detector.sv", "assign sent = changed && !full;", "assign sent = push;"),
    ("taxel_top.sv", "tvalid && tready && tlast", "tvalid && tlast"),
    ("taxel_status_sender.sv", "{bits, rest} <= {rest, count_t'(0)};", "{bits, rest} <= totals;"),
    ("taxel_status_sender.sv", "'0 : digits, bits", "digits : digits, bits"),
]


#: Those of version 2 of the wire.
VERSION_2 = [
    ("taxel_packer_v2.sv", "8'(gap >> 6) - 8'd1", "8'(gap >> 6)"),
    ("taxel_packer_v2.sv", "now.at - last <= RESTLESS", "now.at - last <= '0"),
    ("taxel_packer_v2.sv", "|| position <= reached);", ");"),
    ("taxel_line_sorter.sv", "oldest.x == gathering.x && ", ""),
    ("taxel_refresh.sv", "line_start + BITS'(lines) + BITS'(1)", "line_start + BITS'(lines)"),
    ("taxel_session.sv", "crc_32c(crc, count_before[7:0]), count_before[15:8]", "crc, count_before[7:0]"),
    ("taxel_time_stamper.sv", "clocks_us == 7'(SHORT - 1)", "clocks_us == 7'(SHORT)"),
    ("taxel_change_detector.sv", "if (store) again", "if (store && !of_judged.initial_frame) again"),
    ("taxel_change_detector.sv", "found.at     = found.format", "found.at     = of_judged.format"),
    ("taxel_datagram_sender.sv", "{now.line[2:0], STRIDE}", "{3'd0, STRIDE}"),
    ("taxel_datagram_sender.sv", "if (at < body_end + 11'(SPAN)) crc", "if (at < body_end) crc"),
    ("taxel_mux_ctrl.sv", "frame_sync: r.frame_sync}", "frame_sync: 1'b1}"),
    ("taxel_mux_ctrl.sv", "r.ramp > 16'd255", "r.ramp > 16'd150"),
]


def plant(fault, to):
    """Write the sources with one edit."""
    file, there, instead = fault
    for source in RTL.glob("*.sv"):
        shutil.copy(source, to)
    text = (to / file).read_text()
    assert text.count(there) == 1
    (to / file).write_text(text.replace(there, instead))


@pytest.mark.slow
@pytest.mark.parametrize("fault", FAULTS, ids=[f"{file[6:-3]}-{k}" for k, (file, _, _) in enumerate(FAULTS)])
def test_a_fault_is_seen(fault, tmp_path):
    plant(fault, tmp_path)
    assert differs(Pair(8, 8, source=tmp_path))


@pytest.mark.slow
@pytest.mark.parametrize("fault", TOTALS, ids=range(len(TOTALS)))
def test_a_fault_of_the_totals_is_seen(fault, tmp_path):
    plant(fault, tmp_path)
    answered, counted = answered_and_counted(Pair(8, 8, source=tmp_path, FAULT_CLOCKS=1 << 30), 8)
    assert answered != counted


@pytest.mark.slow
@pytest.mark.parametrize("fault", VERSION_2, ids=[f"{file[6:-3]}-{k}" for k, (file, _, _) in enumerate(VERSION_2)])
def test_a_fault_of_version_2_is_seen(fault, tmp_path):
    plant(fault, tmp_path)
    assert differs_in_version_2(tmp_path)


def test_the_sources_without_a_fault_are_not_taken_for_one():
    assert not differs(Pair(8, 8))
    assert not differs_in_version_2(RTL)


def differs_in_version_2(source) -> bool:
    """Play frames in which every fault of version 2 shows; return whether the logic is told from the emulated board."""
    rng = np.random.default_rng(4)
    first = rng.integers(0, 150, (64, 3)).astype(np.uint16)
    pair = Pair(3, 64, source=source, first=first, version_2=OFTEN)
    held = pair.board.registers
    parts = [
        [],
        [Command(0, 0b11000)],
        [Command(4, 160)],
        [Command(0, 0b10000)],
        held.with_preset("2 kHz"),
        [Command(0, 0b11000)],
        [Command(4, 200)],
        [Command(0, 8)],
    ]
    for part in parts:
        written(pair, part if isinstance(part, list) else pair.board.registers.commands_to(part))
        for _ in range(30):
            moved = rng.random((64, 3)) < rng.choice([0.0, 0.02, 0.5])
            pair.frame(np.where(moved, rng.integers(0, 600, (64, 3)), 0).astype(np.uint16), b"")
    pair.finish()
    return not (pair.agrees and answers(pair.serial) == pair.answers)


def differs(pair: Pair) -> bool:
    """Play frames in which every fault of the list shows; return whether the logic is told from the emulated board."""
    rng = np.random.default_rng(3)
    writes = [
        Command(0, 0), Command(5, 7 << 16), Command(4, 33), Command(7, 1 << 16), Command(7, 1 << 16), Command(0, 4),
        Command(5, 7 << 16 | 20 << 8), Command(0, 8), Command(1, 1777), Command(7, 0), Command(5, 7 << 16),
    ]  # fmt: skip
    ticks = np.zeros((8, 8), np.uint16)
    for k in range(120):
        moved = rng.integers(-4, 5, (8, 8)) + np.where(rng.random((8, 8)) < 0.3, rng.integers(-99, 99, (8, 8)), 0)
        ticks = np.clip(ticks.astype(int) + moved, 0, 160).astype(np.uint16)
        sent = ticks.copy()
        sent[rng.random((8, 8)) < 0.02] = NOT_RETURNED
        command = writes.pop(0).to_bytes() if writes and pair.answered and k > 3 else b""
        # Some are complete around the last clock at which a write acts in the next frame.
        frame = round(pair.board.registers.frame_us * 100)
        at = frame - 420 + int(rng.integers(-6, 7)) if command else 0
        if not command and pair.answered and k > 60:
            # In the middle of a frame: the noise floor must not change before its end.
            command, at = Command(5, 7 << 16 | (5 if k % 2 else 60) << 8).to_bytes(), frame // 4
        pair.frame(sent, command, at)
    for _ in range(40):
        pair.frame(np.zeros((8, 8), np.uint16))
    same = pair.received == pair.expected[: len(pair.received)] and len(pair.expected) - len(pair.received) <= 2
    return not (same and answers(pair.serial) == pair.answers)
