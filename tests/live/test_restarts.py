"""Boards that are killed and started again: where times step back the verdict lists it, live as in the recording."""

from __future__ import annotations

import socket as udp
from pathlib import Path

import numpy as np
import pytest
from draws import seeds
from loopback import until

import taxel
from taxel.live import Live
from taxel.simulate import Board, Version2
from taxel.wire import Registers

LOOPBACK = "127.0.0.1"


def steps_of(t: np.ndarray) -> list[dict[str, int]]:
    """Return where times step back, from the definition."""
    steps: list[dict[str, int]] = []
    behind = False
    latest = -(2**62)
    for time in t.tolist():
        if time >= latest:
            latest, behind = time, False
            continue
        if not behind:
            steps.append({"after_us": latest, "by_us": 0, "events": 0})
        behind = True
        steps[-1]["by_us"] = max(steps[-1]["by_us"], latest - time)
        steps[-1]["events"] += 1
    return steps


def life(draw: np.random.Generator, wire: int, session: int, frames: int) -> list[bytes]:
    """Return the datagrams of a board from its start on."""
    board = Board(Registers(wire_version=wire), version_2=Version2(seed=session, states_us=0))
    ticks, sent = np.full(4096, 40, np.uint16), []
    for _ in range(frames):
        ticks[draw.integers(0, 4096, draw.integers(0, 4))] = draw.integers(0, 150)
        sent += board.frame(ticks)
    return sent


@pytest.mark.parametrize("wire", [1, 2])
@pytest.mark.parametrize("seed", seeds(8, quick=1))
def test_over_any_restarts_each_step_back_is_in_the_verdict_live_as_in_the_file(
    tmp_path: Path, wire: int, seed: int
) -> None:
    draw = np.random.default_rng([wire, seed])
    path, later = tmp_path / "a.mcap", tmp_path / "later.mcap"
    sent: list[bytes] = []
    for _ in range(draw.integers(2, 6)):
        own = life(draw, wire, int(draw.integers(1, 3)), int(draw.integers(1, 1500)))
        sent += own[draw.integers(0, 4) :][: draw.integers(1, len(own) + 1)]
    order = np.arange(len(sent)) + draw.integers(0, 6, len(sent)) * (draw.random(len(sent)) < 0.1)
    came = [sent[k] for k in np.argsort(order, kind="stable") for _ in range(1 + (draw.random() < 0.05))]
    came = [one for one in came if draw.random() > 0.02]
    with (
        Live(0, host=LOOPBACK, record=path) as live,
        Live(0, host=LOOPBACK, record_later=True) as late,
        udp.socket(udp.AF_INET, udp.SOCK_DGRAM) as link,
    ):
        half = len(came) // 2
        for k, one in enumerate(came):
            if k == half:
                until(lambda: late.counters["decoded"] == half)
                late.record(later)
            for receiver in (live, late):
                link.sendto(one, receiver.address)
            if k % 50 == 0:
                until(lambda: live.counters["decoded"] == k + 1)  # noqa: B023  called at once
        until(lambda: live.counters["decoded"] == late.counters["decoded"] == len(came))
        ended, summary = late.end_recording(), live.stop()
    recording = taxel.open(path)
    expected = steps_of(recording.events.t)
    assert summary.verdict.to_dict() == recording.verdict.to_dict()
    assert summary.counters["wire_steps_back"] == len(expected)
    if len(expected) <= 256:
        assert recording.verdict.steps_back == expected
    assert ("times step back" in recording.verdict) == bool(expected)
    far = sum(step["by_us"] > 100_000 for step in expected)
    assert (recording.verdict.damaged.get("events_out_of_order", 0) > 0) >= bool(far)
    # A recording that began later states those since it began.
    assert ended.verdict.to_dict() == taxel.open(later).verdict.to_dict()
    own = steps_of(taxel.open(later).events.t)
    assert len(ended.verdict.steps_back) >= min(len(own), 256)
    # Without its end, a file has what decoding finds.
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(path.read_bytes()[: -(path.stat().st_size // 4)])
    some = taxel.open(cut)
    if len(steps := steps_of(some.events.t)) <= 256:
        assert some.verdict.steps_back == steps
    taxel.convert(recording, tmp_path / "b.mcap")
    assert taxel.open(tmp_path / "b.mcap").verdict.steps_back == recording.verdict.steps_back
