"""The values that arrive, compared with the pattern that a board makes itself."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel._base.messages import counted
from taxel.array import Array
from taxel.board_check.received import DecodedValues
from taxel.board_check.results import Difference, PatternCheck
from taxel.wire import Registers

#: Number of frames after which the numbers of the pattern's frames begin again.
_FRAMES = 65_536
#: Frames that may be of the comparators still as the pattern is switched on.
_AHEAD = 64


class PatternFrames:
    """Which frames of the pattern events may be of, by their times.

    A stamp is the start of a frame, rounded down to the resolution of the version of the wire. So an event is of one of
    `several` frames, which are more than one where several have the same stamp.
    """

    def __init__(self, registers: Registers, anchor_us: int, resolution_us: float) -> None:
        self.frame_us, self.anchor_us, self.resolution_us = registers.frame_us, anchor_us, resolution_us
        self.several = max(math.ceil(resolution_us / self.frame_us), 1)
        self.number, self.after_us = 0, resolution_us / 2

    def first(self, t: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the first frame that each time may be of."""
        since = (t - self.anchor_us - self.after_us) / self.frame_us
        return self.number + np.ceil(np.round(since, 6)).astype(np.int64)


def period_of(array: Array) -> int:
    """Return the number of frames after which the pattern repeats itself."""
    return max(256 << (array.columns - 1).bit_length(), 32 << (array.rows - 1).bit_length())


def _expected(array: Array, registers: Registers, x: Any, y: Any, frames: NDArray[np.int64]) -> NDArray[np.uint16]:
    """Return the pattern's values of taxels in frames."""
    x, y, n = np.broadcast_arrays(x, y, (frames % _FRAMES).astype(np.uint16))
    x, y, n = (np.ascontiguousarray(column.ravel(), np.uint16) for column in (x, y, n))
    return _core.pattern_values(array._parts(), x, y, n, registers.ramp).reshape(frames.shape)


def _right(
    values: DecodedValues, chosen: Any, array: Array, registers: Registers, frames: PatternFrames
) -> NDArray[np.bool_]:
    """Return which of these values are those of a frame that they may be of."""
    first = frames.first(values.t[chosen])
    right = np.zeros(first.shape, bool)
    for k in range(frames.several):
        right |= _expected(array, registers, values.x[chosen], values.y[chosen], first + k) == values.value[chosen]
    return right


def numbered(values: DecodedValues, array: Array, registers: Registers) -> tuple[PatternFrames, float]:
    """Return the numbers of frames that explain most values, and the share that they explain."""
    # Behind the middle nothing is left of what was before the pattern.
    later = np.arange(len(values.t) // 2, len(values.t))
    some = later[np.unique(np.linspace(0, len(later) - 1, 64).astype(int))]
    frames = PatternFrames(registers, int(values.t[some[0]]), values.resolution_us)
    # A frame more or less moves the ball by a sixteenth of a taxel, a tick.
    k, best, number = frames.first(values.t[some]), -1, 0
    for start in range(0, _FRAMES, 4096):
        numbers = np.arange(start, start + 4096)
        expected = _expected(array, registers, values.x[some], values.y[some], numbers[:, None] + k)
        near = (np.abs(expected.astype(np.int32) - values.value[some]) <= 2).sum(axis=1)
        if near.max() > best:
            best, number = int(near.max()), int(numbers[near.argmax()])
    more = later[np.unique(np.linspace(0, len(later) - 1, 2000).astype(int))]
    tries = []
    for after in range(16):
        for off in range(-6, 7):
            frames.number, frames.after_us = number + off, after / 16 * values.resolution_us
            tries.append(
                (_right(values, more, array, registers, frames).mean(), -abs(off), frames.number, frames.after_us)
            )
    share, _, frames.number, frames.after_us = max(tries)
    return frames, float(share)


def _meaning(values: DecodedValues, at: int, frame: int, expected: int, array: Array, registers: Registers) -> str:
    """Return what may have made a value differ."""
    x, y, value = int(values.x[at]), int(values.y[at]), int(values.value[at])
    exchanged = x != y and x < array.rows and y < array.columns
    if exchanged and int(_expected(array, registers, y, x, np.array([frame]))[0]) == value:
        return "it is the value of the taxel with row and column exchanged: lines and steps are mixed up"
    near = np.arange(frame - 32, frame + 33)
    off = near[_expected(array, registers, x, y, near) == value] - frame
    if len(off) and value not in (0, expected):
        k = int(off[np.abs(off).argmin()])
        when = f"{counted(abs(k), 'frame')} {'later' if k > 0 else 'before'}"
        return (
            f"it is the value of this taxel {when}: frames do not last as long as the registers say, or a frame was "
            "left out"
        )
    if (value ^ expected).bit_count() == 1:
        return "one bit differs: the link is disturbed, or its clock does not suit the PHY"
    return (
        "the pattern has no similar value: if the register pattern is off, it is a comparator's value; otherwise it "
        "was damaged"
    )


def compared(
    values: DecodedValues, datagrams: int, array: Array, registers: Registers, frames: PatternFrames, begun: bool
) -> PatternCheck:
    """Compare each value, and what every taxel holds, with the pattern."""
    everything = np.arange(len(values.t))
    right, number = _right(values, everything, array, registers, frames), frames.first(values.t)
    # Where the pattern was switched on just before, the first events may be the comparators'.
    of_pattern = np.ones(right.shape, bool)
    if begun:
        period = period_of(array)
        turns = (int(number.min()) + _AHEAD) // period * period
        frames.number -= turns
        number = number - turns
        of_pattern = number >= 0
    wrong = np.flatnonzero(~right & of_pattern)
    order = np.argsort(values.t, kind="stable")
    order = order[of_pattern[order]]
    stamps, starts = np.unique(values.t[order], return_index=True)
    ends = np.append(starts[1:], len(order))
    held, behind, first_behind = np.full(array.shape, -1, np.int64), np.zeros(array.shape, bool), None
    y, x = np.indices(array.shape)
    # Of several frames with one stamp the last one is not known.
    floor = registers.noise_floor + (4 if frames.several > 1 else 0)
    each = max(len(stamps) // 500, 1)
    for k in range(len(stamps) - 1):
        now = order[starts[k] : ends[k]]
        held[values.y[now], values.x[now]] = values.value[now]
        if k % each:
            continue
        n = int(frames.first(stamps[k : k + 1])[0]) + frames.several - 1
        expected = _expected(array, registers, x, y, np.full(array.shape, n)).astype(np.int64)
        off = (held >= 0) & (np.abs(expected - held) > floor)
        if off.any() and first_behind is None:
            row, column = np.argwhere(off)[0]
            first_behind = Difference(
                *(
                    int(stamps[k]),
                    int(column),
                    int(row),
                    n % _FRAMES,
                    int(expected[row, column]),
                    int(held[row, column]),
                ),
                meaning="the event of a change is missing: dropped by the board (fault queue), or lost on the way",
            )
        behind |= off
    first = first_behind
    if len(wrong):
        at = wrong[values.t[wrong].argmin()]
        several = number[at] + np.arange(frames.several)
        expected_values = _expected(array, registers, values.x[at], values.y[at], several)
        # Of several frames that it may be of, that from which it differs in the fewest bits.
        nearest = int(np.bitwise_count(expected_values ^ values.value[at]).argmin())
        n, expected_value = int(several[nearest]), int(expected_values[nearest])
        if first is None or values.t[at] <= first.t:
            first = Difference(
                *(int(values.t[at]), int(values.x[at]), int(values.y[at]), n % _FRAMES),
                *(expected_value, int(values.value[at])),
                meaning=_meaning(values, int(at), n, expected_value, array, registers),
            )
    taxels = len(np.unique(values.y.astype(np.int64) * array.columns + values.x))
    return PatternCheck(
        *(registers, values.version, datagrams, len(values.t), len(stamps), values.counts, taxels),
        *(len(wrong), int(behind.sum()), first, values.speed),
    )
