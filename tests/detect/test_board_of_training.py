"""A readout and the board that it reads: its noise floor, and in what it differs from that of the training."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

import taxel
from taxel import Array
from taxel.detect import Example, PlainRule, Readout, run
from taxel.detect.board import of_training, other_frames
from taxel.encode import ContactArea
from taxel.reading import Facts, InMemory, Marks
from taxel.simulate import Board
from taxel.wire import Registers

ARRAY = Array(4, 4, pitch_mm=2.0)
TOUCHES = 3


def touched(seed: int, noise_floor: int) -> tuple[taxel.Recording, np.ndarray, np.ndarray]:
    """Return what a board sends of touches that end slowly, and when each begins and ends, us."""
    random = np.random.default_rng(seed)
    registers = Registers(array=ARRAY, noise_floor=noise_floor)
    board, sent, begins, ends = Board(registers, ARRAY), [], [], []
    for _ in range(TOUCHES):
        loaded, peak = random.random((4, 4)) < 0.6, random.integers(40, 120, (4, 4))
        loaded[1, 1:3] = True
        share = np.concatenate(
            [np.zeros(random.integers(100, 200)), np.ones(100), np.linspace(1, 0, random.integers(40, 120))]
        )
        begins.append(board.time_us + registers.frame_us * int(np.argmax(share)))
        for part in share:
            sent += board.frame(np.rint(20 + part * loaded * peak).astype(np.uint16))
        ends.append(board.time_us)
    for _ in range(200):
        sent += board.frame(np.full(16, 20, np.uint16))
    events = taxel.wire.decode(b"".join(sent), array=ARRAY)
    recording = taxel.Recording.of(InMemory(Facts(array=ARRAY), events, Marks(registers=registers)))
    return recording, np.array(begins), np.array(ends)


REST = taxel.Tare.take(taxel.Frames(np.full((2, 4, 4), 20.0), [0, 192], unit="ticks", array=ARRAY))
RULE = PlainRule("area", 2, labels=("contact", "lift"), noise_floor=3.0, unit="ticks")
NEURON = taxel.Neuron(tau=0.2, refractory=0.5)
READOUT = Readout(
    ContactArea(levels=[2], noise_floor=3.0),
    {"contact": (NEURON, [1.0, 0.0]), "lift": (NEURON, [0.0, 1.0])},
    array=ARRAY,
)


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1), st.integers(0, 25), st.sampled_from([RULE, READOUT]))
def test_a_higher_noise_floor_of_the_board_silences_no_lift(seed, noise_floor, detector):
    recording, begins, ends = touched(seed, noise_floor)
    found = run(detector, recording, tare=REST)
    for label, times in (("contact", begins), ("lift", ends)):
        t = found.t[found.label == label]
        assert len(t) == TOUCHES
        assert (np.abs(t - times) < 2000).all()


def walked(rate_hz: int, side: str) -> taxel.Recording:
    frames = taxel.Frames(np.zeros((20, 4, 4), np.float32), np.arange(20) * (10**6 // rate_hz), array=ARRAY)
    return taxel.Recording.of(InMemory(Facts(array=ARRAY, side=side), frames))


@given(st.integers(1, 1000), st.integers(1, 1000), *2 * [st.sampled_from(["", "left", "right"])])
def test_a_readout_says_where_rate_or_side_of_frames_differ_from_those_of_the_training(then, now, side, other):
    nothing = taxel.detect.score(taxel.Detections([], [], []), {})
    training = of_training([Example(walked(then, side), {})], nothing, 1.0)
    line = other_frames(training, walked(now, other))
    assert ("frames a second" in line) == (10**6 // then > 1.1 * (10**6 // now) or 10**6 // now > 1.1 * (10**6 // then))
    assert (" side" in line) == ("" not in (side, other) and side != other)
    assert other_frames({}, walked(now, other)) == ""
