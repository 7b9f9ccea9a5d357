"""Faults planted in the logic, one line each: the comparison with the emulated board sees every one of them."""

import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from test_modules import MODULES, simulated
from test_totals import answered_and_counted
from test_version_2 import OFTEN

from logic import RTL
from pair import Pair, answers
from taxel.simulate import NOT_RETURNED
from taxel.wire import Command

sys.path.insert(0, str(RTL / "tools"))

from prove import PROOFS

#: File, what stands there, what stands there instead.
FAULTS = [
    ("taxel_change_detector.sv", "moved_of > 16'(of_weighed", "moved_of >= 16'(of_weighed"),
    ("taxel_change_detector.sv", "{channel, now.step[STEP_BITS-1:0]}", "{now.step[STEP_BITS-1:0], channel}"),
    ("taxel_change_detector.sv", "if (step_end) ended <= read;", "if (read_done) ended <= read;"),
    ("taxel_change_detector.sv", "&& !weighed.not_returned && !of_weighed", "&& !of_weighed"),
    ("taxel_comparator_column.sv", "first   <= sample[0];", "first   <= sample[1];"),
    ("taxel_ramp_counter.sv", "pairs_next <= full;", "pairs_next <= full - 15'd1;"),
    ("taxel_comparator_array.sv", "inverted_now <= senses[DELAY-1];", "inverted_now <= 1'b0;"),
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
    ("taxel_status_sender.sv", "{bits, rest} <= {rest, rest[0]};", "{bits, rest} <= totals;"),
    ("taxel_status_sender.sv", "digits    <= '0;", ""),
]


#: Those of version 2 of the wire.
VERSION_2 = [
    ("taxel_packer_v2.sv", "8'(gap >> 6) - 8'd1", "8'(gap >> 6)"),
    ("taxel_packer_v2.sv", "since_last <= RESTLESS", "since_last <= '0"),
    ("taxel_packer_v2.sv", "(moved || behind);", "moved;"),
    ("taxel_line_sorter.sv", "oldest.x == gathering.x && ", ""),
    ("taxel_refresh.sv", "since_line + BITS'(lines) + BITS'(1)", "since_line + BITS'(lines)"),
    ("taxel_session.sv", "crc_32c(crc, 16'd0) ^ of_count", "of_count"),
    ("taxel_time_stamper.sv", "clocks_us == 7'(SHORT - 1)", "clocks_us == 7'(SHORT)"),
    ("taxel_change_detector.sv", "row_fetched  <= row_copied;", "row_fetched  <= place;"),
    ("taxel_change_detector.sv", "found.at     = found.format", "found.at     = of_judged.format"),
    ("taxel_datagram_sender.sv", "{now.line[2:0], STRIDE}", "{3'd0, STRIDE}"),
    ("taxel_datagram_sender.sv", "chosen.part == SUM ? crc >> 16", "chosen.part[1] ? crc >> 16"),
    ("taxel_mux_ctrl.sv", "frame_sync: r.frame_sync,", "frame_sync: 1'b1,"),
    ("taxel_mux_ctrl.sv", "r.ramp > 16'd255", "r.ramp > 16'd150"),
]


#: Those of afferents.
SPIKES = [
    ("taxel_afferents.sv", "THRESHOLD'(size) > held_4", "THRESHOLD'(size) >= held_4"),
    ("taxel_afferents.sv", "if (fresh_2) held_3.begun <= 1'b0;", ""),
    ("taxel_afferents.sv", "if (!read.format.spikes) begun <= '0;", "if (1'b0) begun <= '0;"),
    ("taxel_afferents.sv", "read.step == 3'(STEPS - 1)", "1'b1"),
    ("taxel_afferents.sv", "sampled && (returned || !held_5.begun)", "sampled"),
    ("taxel_afferents.sv", "if (!held_5.begun || fires) stored.base", "if (!held_5.begun) stored.base"),
    ("taxel_afferents.sv", "fires ? raised : lowered", "lowered"),
    ("taxel_afferents.sv", "held_4.threshold > rest_4 ?", "held_4.threshold >= rest_4 ?"),
    ("taxel_afferents.sv", "32'(threshold.rest)) >> 2", "32'(threshold.rest)) >> 3"),
    ("taxel_afferents.sv", "24'(threshold.rest)) >> 4", "24'(threshold.rest)) >> 5"),
    ("taxel_afferents.sv", "more       <= !less;", "more       <= less;"),
    ("taxel_afferents.sv", "size[21:6]", "size[22:7]"),
    ("taxel_power_law.sv", "24'd1110689,", "24'd1100689,"),
    ("taxel_change_detector.sv", "(spikes ? fires : beyond)", "(beyond || (spikes && fires))"),
    ("taxel_change_detector.sv", "(!spikes && (PREVIOUS", "((PREVIOUS"),
    ("taxel_change_detector.sv", "line_pending && of_fetched.ended.format.spikes", "1'b0"),
    ("taxel_change_detector.sv", "line_after(line_due,", "line_after(line_next + 7'd1,"),
    ("taxel_packer_v1.sv", "VALUED || now.format.spikes", "VALUED"),
    ("taxel_packer_v2.sv", "VALUED || format.spikes", "VALUED"),
    ("taxel_packer_v2.sv", "DIFFERENCE && !format.spikes", "DIFFERENCE"),
    ("taxel_mux_ctrl.sv", "r.mechanoreceptor || r.ramp", "r.ramp"),
]


#: Those that the tests of single modules see: module, what stands there, what stands there instead.
OF_MODULES = [
    ("afferents", "size[21:6]", "size[22:7]"),
    ("afferents", "if (fresh_2) held_3.begun <= 1'b0;", ""),
    ("change_detector", "moved_of > 16'(of_weighed", "moved_of >= 16'(of_weighed"),
    ("change_detector", "else if (changed) lost_before <= 1'b1;", ""),
    ("change_detector", "row_fetched  <= row_copied;", "row_fetched  <= place;"),
    ("change_detector", "totals_pending && !totals_busy", "totals_pending"),
    ("comparator_array", "inverted_now <= senses[DELAY-1];", "inverted_now <= 1'b0;"),
    ("comparator_array", "&& !open && !begun) || begins", ") || begins"),
    ("comparator_column", "first   <= sample[0];", "first   <= sample[1];"),
    ("comparator_column", " && !closes", ""),
    ("datagram_sender", "{now.line[2:0], STRIDE}", "{3'd0, STRIDE}"),
    ("datagram_sender", "buffer[{bank, place}]", "buffer[{1'b0, place}]"),
    ("ethernet_board", "if (!runs || !up) waited <= '0;", "if (1'b0) waited <= '0;"),
    ("ethernet_board", ".D0(txd[k]), .D1(txd[k+4])", ".D0(txd[k+4]), .D1(txd[k])"),
    ("ethernet_frame", "16'(size) + 16'd28", "16'(size) + 16'd20"),
    ("ethernet_frame", "at >= size", "at > size"),
    ("event_fifo", "push && waiting == (PLACES + 1)'(DEPTH - 1)", "push && waiting == (PLACES + 1)'(DEPTH - 2)"),
    ("event_fifo", "none && !stored && landing", "none && !stored"),
    ("link", "to == 2'd3 || last", "to == 2'd3"),
    ("link", "second ? data[15:8] : data[7:0]", "data[7:0]"),
    ("line_select", " && aim_lines <= known", ""),
    ("line_select", "out > in ? out : in", "in"),
    ("line_sorter", "oldest.x == gathering.x && ", ""),
    ("line_sorter", "line.lost   <= 1'b0;", ""),
    ("mux_ctrl", "32'(EARLY + 1);", "32'(EARLY + 2);"),
    ("mux_ctrl", "read.noise_floor   <= active", "read.noise_floor   <= written"),
    ("packer_v1", "9'(k == 1 ? MOST - 1 : MOST - 2)", "9'(MOST - 1)"),
    ("packer_v1", "oldest.frame == now.frame && ", ""),
    ("packer_v2", "(moved || behind);", "moved;"),
    ("packer_v2", "8'(gap >> 6) - 8'd1", "8'(gap >> 6)"),
    ("power_law", "24'd1110689,", "24'd1110690,"),
    ("power_law", "11'd2047 : ticks[10:0]", "11'd2046 : ticks[10:0]"),
    ("random_lines", "w[0] ^ w[2] ^ w[3] ^ w[5]", "w[0] ^ w[2] ^ w[3] ^ w[4]"),
    ("random_lines", "if (first) swapped <= '0;", ""),
    ("register_file", "changed.record != written.record", "changed.record"),
    ("register_file", "reserved ? 4'd4 : ", ""),
    ("status_sender", "{bits, rest} <= {rest, rest[0]};", "{bits, rest} <= totals;"),
    ("status_sender", "given[k] <= counts[k];", ""),
    ("synchroniser", "{settled, unsettled} <= {unsettled, from}", "{settled, unsettled} <= {from, from}"),
    ("synchroniser", "{settled, unsettled} <= {unsettled, from}", "{settled, unsettled} <= {!unsettled, from}"),
    ("time_stamper", "clocks_us == 7'(SHORT - 1)", "clocks_us == 7'(SHORT)"),
    ("time_stamper", "if (frame_start) of_frame <= now;", "of_frame <= now;"),
    ("top", "tvalid && tready && tlast", "tvalid && tlast"),
    ("top", ".frame_sync(active.frame_sync)", ".frame_sync(1'b0)"),
    ("uart_rx", "CLOCKS / 2 - 1)", "CLOCKS / 2)"),
    ("uart_rx", "valid  <= line;", "valid  <= 1'b1;"),
    ("uart_rx", "CLOCKS / 2 - 1", "CLOCKS - 1"),
    ("uart_rx", "busy <= !line;", ""),
    ("uart_rx", "busy <= !line && !low;", "busy <= !line;"),
    ("uart_rx", "broken <= !line;", "broken <= 1'b1;"),
    ("udp_sender", "at_write({filled, place})", "at_write({1'b0, place})"),
    ("udp_sender", "room ? place + BITS'(1) : place", "place + BITS'(1)"),
    ("announcement", "came <= crossed != last;", "came <= crossed;"),
    ("standing_word", "if (take) ", ""),
    ("two_clock_memory", "if (write) ", ""),
]


def test_quick_each_planted_fault_has_one_place():
    """Those of the proofs too: an edit whose text moved plants nothing."""
    edits = [*FAULTS, *TOTALS, *VERSION_2, *SPIKES]
    edits += [(f"taxel_{module}.sv", there, instead) for module, there, instead in OF_MODULES]
    for proof in PROOFS:
        sources = {Path(source).name: RTL / source for source in proof.sources}
        for file, there, _ in proof.faults:
            assert sources[file].read_text().count(there) == 1, (proof.name, file, there)
    for file, there, instead in edits:
        assert (RTL / file).read_text().count(there) == 1, (file, there)
        assert there != instead


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


@pytest.mark.slow
@pytest.mark.parametrize("fault", SPIKES, ids=[f"{file[6:-3]}-{k}" for k, (file, _, _) in enumerate(SPIKES)])
def test_a_fault_of_afferents_is_seen(fault, tmp_path):
    plant(fault, tmp_path)
    assert any(differs_in_spikes(tmp_path, intensity) for intensity in ("nothing", "difference"))


@pytest.mark.slow
@pytest.mark.parametrize("fault", OF_MODULES, ids=[f"{module}-{k}" for k, (module, _, _) in enumerate(OF_MODULES)])
def test_a_fault_is_seen_by_the_test_of_its_module(fault, tmp_path):
    module, there, instead = fault
    plant((f"taxel_{module}.sv", there, instead), tmp_path)
    assert any(simulated(module, parameters, tmp_path).returncode == 2 for parameters in MODULES[module])


def test_the_sources_without_a_fault_are_not_taken_for_one():
    assert not differs(Pair(8, 8))
    assert not differs_in_version_2(RTL)
    assert not any(differs_in_spikes(RTL, intensity) for intensity in ("nothing", "difference"))


def differs_in_spikes(source, intensity: str) -> bool:
    """Play frames in which every fault of afferents shows; return whether the logic is told from the emulated board."""
    rng = np.random.default_rng(7)
    pair = Pair(3, 64, source=source, intensity=intensity, version_2=OFTEN)
    spikes = 983 << 16 | 0b01010
    parts = [
        [Command(4, 33 << 16 | 150), Command(5, 2 << 16 | 3 << 8 | 51)],
        [Command(0, spikes)],
        [Command(0, 0b01000)],
        [Command(0, spikes)],
        [Command(4, 400 << 16 | 150)],
        [Command(0, spikes | 0b10000)],
        [Command(0, 0b11000)],
        [Command(0, spikes | 0b10000)],
        [Command(0, 0b11000), Command(4, 150), Command(0, spikes | 0b10000)],
    ]
    ticks = np.zeros((64, 3), np.uint16)
    for part in parts:
        pair.write(part)
        for _ in range(25):
            # Some taxels move by little around the ticks of which the table has an entry that differs in a fault.
            moved = rng.random((64, 3)) < rng.choice([0.0, 0.1, 0.5])
            drawn = np.where(rng.random((64, 3)) < 0.5, rng.integers(54, 60, (64, 3)), rng.integers(0, 150, (64, 3)))
            ticks = np.where(moved, drawn, ticks).astype(np.uint16)
            read = ticks.copy()
            read[rng.random((64, 3)) < 0.05] = NOT_RETURNED
            pair.frame(read)
    pair.finish()
    return not (pair.agrees and answers(pair.serial) == pair.answers)


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
        pair.write(part if isinstance(part, list) else pair.board.registers.commands_to(part))
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
