"""The emulated board against the reference's section 3, read slowly (oracle.py)."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

import taxel
from taxel import wire
from taxel.simulate import NOT_RETURNED, Board
from taxel.wire import Registers

from . import oracle


def frames(rng, taxels, count):
    """Yield trip times that drift, jump, stick and trip never."""
    ticks = rng.integers(0, 40, taxels)
    for _ in range(count):
        ticks = np.clip(ticks + rng.integers(-4, 5, taxels), 0, 200)
        touched = rng.random(taxels) < rng.choice([0.0, 0.02, 1.0])
        ticks[touched] = rng.integers(0, 300, int(touched.sum()))
        shown = ticks.copy()
        shown[rng.random(taxels) < 0.01] = NOT_RETURNED
        yield shown.astype(np.uint16)


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    shape=st.sampled_from([(64, 64), (16, 8), (64, 5)]),
    previous=st.sampled_from(["last_sent", "last_sample"]),
    intensity=st.sampled_from(["value", "difference"]),
    fields=st.fixed_dictionaries(
        {
            "random_lines": st.booleans(),
            "frame_sync": st.booleans(),
            "noise_floor": st.integers(0, 12),
            "line_period": st.sampled_from([10.24, 700.0]),
        }
    ),
    channels=st.sampled_from([16, 64]),
    queue=st.sampled_from([16_384, 3000, 301, 1]),
    most=st.sampled_from([None, 0, 1, 5]),
)
def test_the_board_sends_what_the_reference_says(seed, shape, previous, intensity, fields, channels, queue, most):
    rng = np.random.default_rng(seed)
    array = taxel.Array(*shape)
    preset = {"step_period": 0.75, "line_read": 3.0}
    registers = Registers(array=array, lines=int(rng.integers(1, shape[1] + 1)), channels=channels, **preset, **fields)
    options = {"previous": previous, "intensity": intensity, "queue": queue}
    board = Board(registers, array, **options)
    slow = oracle.Board(registers, columns=shape[1], rows=shape[0], **options)
    for k, ticks in enumerate(frames(rng, array.taxels, 6)):
        taken = most if most is None or k % 2 else 10**6
        expected = slow.frame(ticks, 10**9 if taken is None else taken)
        assert board.frame(ticks, most=taken) == expected
        if k == 2:
            board.record(True)
            slow.mark(True)
    counts = board.counts
    assert (counts["dropped"], counts["not_returned"]) == (slow.dropped, slow.not_returned)
    assert counts["frames"] == 6


def test_without_loss_the_decoder_gives_back_what_the_board_held():
    rng, board, decoder = np.random.default_rng(3), Board(Registers(noise_floor=0)), wire.Decoder()
    held = np.zeros(4096, int)
    for ticks in frames(rng, 4096, 20):
        for datagram in board.frame(ticks.reshape(64, 64)):
            events = taxel.Events.from_numpy(decoder.push(datagram).to_numpy(), decoder.array)
            held[decoder.array.index(events.x, events.y)] = events.intensity
            assert len(datagram) <= 1400
            assert len(datagram) % 10 == 0
        known = ticks != NOT_RETURNED
        assert (held[known] == np.minimum(ticks, 150)[known]).all()
    assert decoder.counts.changes == board.counts["changes"]
