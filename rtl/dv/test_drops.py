"""A link that carries less than there is: what finds no room in the queue is all that is missing, and is counted."""

import numpy as np
import pytest

from pair import Pair
from scenes import in_version_2, last_faults
from taxel.wire import Command, Decoder


def rows(pair: Pair, version: int, datagrams: list[bytes]) -> list[tuple[int, ...]]:
    """Return the events of datagrams: time, column, row, polarity, value."""
    decoder = Decoder(version, array=pair.array)
    events = [decoder.push(datagram) for datagram in datagrams]
    return [
        row
        for part in events
        for row in zip(*(getattr(part, name).tolist() for name in ("t", "x", "y", "p", "intensity")), strict=True)
    ]


@pytest.mark.parametrize("version", [1, 2])
def test_quick_the_rest_is_the_emulated_boards(version):
    rng = np.random.default_rng([7, version])
    pair = Pair(8, 8, QUEUE=16, version_2={"states_us": 0})
    still = np.zeros((8, 8), np.uint16)
    # Frames of 160 us: events of two never have the same time.
    pair.frame(still, Command(1, 2000).to_bytes())
    while not pair.answered:
        pair.frame(still)
    if version == 2:
        in_version_2(pair)
    pair.frame(still)
    pair.logic.datagrams()
    played = []
    for k in range(60):
        if k < 50:
            moves = rng.random((8, 8)) < rng.choice([0.02, 0.3, 1.0])
            still = np.where(moves, rng.integers(0, 150, (8, 8)), still).astype(np.uint16)
            pair.logic.call("link", int(rng.choice([0, 1, 3, 256])))
        else:
            pair.logic.call("link", 256)
        played.append(still)
        pair.logic.ticks(still)
        pair.logic.edge()
    pair.logic.edge()
    received = pair.logic.datagrams()
    found = rows(pair, version, received)
    start, expected = round(pair.board.time_us), []
    for k, ticks in enumerate(played):
        accepted, time = np.zeros((8, 8), bool), start + 160 * k
        for t, x, y, _, _ in found:
            if t == (time if version == 2 else time // 100 * 100):
                accepted[y, x] = True
        expected += pair.board.frame(ticks, accepted=accepted)
    assert found == rows(pair, version, expected)
    assert len(found) > 300
    dropped = pair.board.counts["dropped"]
    assert dropped > 300
    pair.logic.run(30_000)
    assert last_faults(pair.serial + pair.logic.serial())["queue"] == dropped
    if version == 2:
        assert any(datagram[17] & 4 for datagram in received)
        assert not received[0][17] & 4
