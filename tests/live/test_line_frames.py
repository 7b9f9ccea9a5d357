"""Frames of lines as they arrive: which are whole, and how the others are counted."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from taxel._base.text_lines import ArrivedLine
from taxel.formats.layout import PrintedFrames
from taxel.formats.line_form import form_of_lines
from taxel.live.line_frames import LineFrames


def frames_of(example: str, size: int, **stated: object) -> LineFrames:
    form = form_of_lines([example], PrintedFrames("lines:-", **stated), size, lambda *_: "")  # type: ignore[arg-type]
    assert form is not None
    return LineFrames(form, size)


def push(frames: LineFrames, *texts: str) -> tuple[int, int, int]:
    """Return the number of frames, of strange lines and of bytes of unfinished lines that lines give."""
    for text in texts:
        frames.push(ArrivedLine(text, 0, len(text), is_text="\ufffd" not in text))
    passed = frames.take_passed()
    return len(passed.values), passed.strange, passed.unfinished


def test_a_frame_that_was_under_way_when_reading_began_is_no_loss_and_a_later_one_is() -> None:
    frames = frames_of("1,2", 4, frame_end="blank", columns=["a", "b"])
    assert push(frames, "1,2", "", "1,2", "3,4") == (0, 0, 0)
    assert push(frames, "") == (1, 0, 0)
    assert push(frames, "5,6", "", "7,8") == (0, 1, 0)
    frames.restart()
    assert push(frames) == (0, 1, 0)
    assert push(frames, "9,9", "") == (0, 0, 3)
    assert frames.unread["unfinished_frames"]["lines"] == 2


@pytest.mark.parametrize(
    ("lines", "time", "expected"),
    [
        (["17,5", "17,5", "17,5", "18,5", "16,5", "19,5"], "1:s", (3, "17000000 in column 1")),
        (["1,0,5", "1,1000,5", "1,1000,5"], "1+2", (1, "1000001 in column 1+2")),
    ],
)
def test_stamps_that_repeat_or_step_back_are_counted_with_their_column(
    lines: list[str], time: str, expected: tuple[int, str]
) -> None:
    frames = frames_of(lines[0], 1, time=time)
    push(frames, *lines)
    found = frames.unread["repeated_stamps"]
    assert (found["lines"], found["first"]) == expected


numbers = st.floats(-1e6, 1e6, width=32)


@given(
    st.integers(1, 5).flatmap(lambda n: st.lists(st.lists(numbers, min_size=n, max_size=n), min_size=1, max_size=12)),
    st.sampled_from([",", ";", "\t", " ", " ; "]),
    st.booleans(),
    st.data(),
)
def test_frames_are_those_that_were_printed_whatever_is_between_them(
    rows: list[list[float]], separator: str, by_lines: bool, data: st.DataObject
) -> None:
    """Each whole line is a frame's, and each other one is handed on as it came."""
    count = len(rows[0])
    example = separator.join("1" * count)
    frames = frames_of(example, count * (2 if by_lines else 1), **({"frame_lines": 2} if by_lines else {}))
    printed, odd = [], []
    for k, row in enumerate(rows):
        if (not by_lines or k % 2 == 0) and data.draw(st.booleans()):
            odd.append(data.draw(st.sampled_from(["Sensor ready", "x,y", separator.join("1" * (count + 1))])))
            printed.append(odd[-1])
        printed.append(separator.join(repr(value) for value in row))
    for text in printed:
        frames.push(ArrivedLine(text, 0))
    passed = frames.take_passed()
    whole = rows[: len(rows) // 2 * 2] if by_lines else rows
    expected = np.array(whole, np.float64).reshape(-1)
    assert np.array_equal(np.array(passed.values, np.float64).reshape(-1), expected)
    assert [text for _, text in passed.unread] == odd
    assert passed.lines == len(rows) + len(passed.unread)
