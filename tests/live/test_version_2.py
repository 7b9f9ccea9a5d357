"""A board of version 2, heard live and read again: nothing lost, and said so."""

import re
import socket as udp

import numpy as np
from loopback import until

import taxel
from taxel.simulate import Board, Faults, Scene, Silence, Version2, emulate
from taxel.wire import Command, Registers


def test_the_numbers_of_a_verdict_are_those_of_the_recording(tmp_path):
    """What the verdict of version 2 counts, the counts of its recording count."""
    acts, faults = [Silence(80.0), Scene.draw(seed=3)], Faults(lost=0.1, corrupted=0.1, repeated=0.05, seed=5)
    path = tmp_path / "two.mcap"
    with taxel.live.Live(0, host="127.0.0.1", record=path) as live:
        emulate("{}:{}".format(*live.address), acts, seed=1, tare_ms=20.0, wire=2, faults=faults)
        verdict = live.stop().verdict
    recording = taxel.open(path)
    assert (recording.verdict, recording.verdict.to_dict()) == (verdict, verdict.to_dict())
    assert verdict.status == "lost"
    said = {what: int(n) for n, what in re.findall(r"(\d+) ([^,;]+)", verdict)}
    found = recording.counts["decoder_version_2"]
    assert said["datagrams lost or damaged on the way"] == found["missing"] == verdict.lost["lost_on_the_way"] > 5
    assert said["datagrams damaged"] == sum(found[cause] for cause in ("checksum", "short", "foreign")) > 5
    assert said.get("values repaired from the board's refresh", 0) == found["repaired"]


def test_resets_and_changes_of_version_are_marked_in_the_recording(tmp_path):
    board, frames = (
        Board(Registers(), version_2=Version2(states_us=0)),
        [np.full(4096, 20 + 10 * k, np.uint16) for k in (0, 1)],
    )
    path, again = tmp_path / "board.mcap", tmp_path / "again.mcap"

    def play(n):
        for k in range(n):
            for datagram in board.frame(frames[k % 2]):
                socket.sendto(datagram, live.address)

    def speak(version):
        registers = board.registers.replace(wire_version=version)
        board.command(Command(0, registers.words[0]).to_bytes())

    with udp.socket(udp.AF_INET, udp.SOCK_DGRAM) as socket, taxel.live.Live(0, host="127.0.0.1", record=path) as live:
        play(2)
        speak(2)
        play(2)
        until(lambda: live.counters["wire_version"] == 2)
        board.reset()
        speak(2)
        play(3)
        until(lambda: live.counters["wire_v2"]["resets"] == 1)
        speak(1)
        live.expect_version(1)
        until(lambda: live.counters["decoded"] and live.next(0.05) is None)
        play(3)
        until(lambda: live.counters["wire"]["changes"] == 4 * 4096)
        summary = live.stop()
    assert summary.counters["wire_refused"] == 0
    recording = taxel.open(path)
    changes = [(c.change, c.version, c.asked) for c in recording.board_changes]
    assert changes == [("wire", 2, False), ("reset", None, False), ("wire", 1, True)]
    events = recording.events
    assert len(events) == summary.counters["events"] == 9 * 4096
    assert (np.diff(events.t) >= 0).all()
    assert [c.t for c in recording.board_changes] == sorted(c.t for c in recording.board_changes)
    taxel.convert(path, again)
    assert taxel.open(again).events == events
    assert taxel.open(again).board_changes == recording.board_changes
