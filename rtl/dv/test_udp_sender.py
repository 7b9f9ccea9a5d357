"""Frames of Ethernet as the simulated sender makes them, by a parser of their own: RFC 791, RFC 768, IEEE 802.3."""

import numpy as np
import pytest

from ethernet import GAP, payload_of
from sender import Sender


def sent(sender: Sender, payloads: list[bytes]) -> list[tuple[bytes, int]]:
    for payload in payloads:
        sender.send(payload)
    sender.finish()
    return sender.frames()


def test_quick_frames_of_each_length_carry_their_payload():
    rng = np.random.default_rng(1)
    lengths = [*range(1, 70), 255, 256, 257, 511, 1399, 1400, 1471, 1472]
    rng.shuffle(lengths)
    payloads = [rng.bytes(length) for length in lengths]
    frames = sent(Sender(), payloads)
    assert [payload_of(frame) for frame, _ in frames] == payloads
    assert {len(frame) for frame, _ in frames} >= {8 + 64, 8 + 65, 8 + 1518}
    assert min(gap for _, gap in frames) >= GAP


#: The link's clock, ps, in how many of 256 clocks a byte is offered, and a seed.
CLOCKS = [(8000, 30, 2), (7990, 256, 3), (8012, 140, 4), (40_000, 256, 5)]


@pytest.mark.parametrize(("link_ps", "of_256", "seed"), CLOCKS)
def test_random_payloads_and_clocks(link_ps, of_256, seed):
    rng = np.random.default_rng(seed)
    sender = Sender(link_ps=link_ps, phase_ps=int(rng.integers(0, 8000)), seed=seed)
    sender.offers(of_256)
    short, long = rng.integers(1, 60, 100), rng.integers(1, 1401, 30)
    payloads = [rng.bytes(int(length)) for length in rng.permutation(np.concatenate([short, long]))]
    frames = sent(sender, payloads)
    assert [payload_of(frame) for frame, _ in frames] == payloads
    assert min(gap for _, gap in frames[1:]) >= GAP


def test_a_reset_forgets_what_was_not_sent_and_breaks_no_later_frame():
    rng = np.random.default_rng(6)
    sender = Sender()
    for length in (700, 900, 1400):
        sender.send(rng.bytes(length))
    sender.run(1700)
    sender.run(100, reset=True)
    sender.frames()
    # The core's reset begins with what is left of the payload that was being offered.
    sender.finish()
    sender.frames()
    payloads = [rng.bytes(int(length)) for length in rng.integers(1, 1401, 20)]
    assert [payload_of(frame) for frame, _ in sent(sender, payloads)] == payloads
