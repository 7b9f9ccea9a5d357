"""Lines out of bytes: the same wherever they are cut, each byte in a line or counted; read of a file or a pipe."""

from __future__ import annotations

import io
import os
import re
import time
from collections.abc import Callable
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from taxel._base.text_lines import TextLines
from taxel.live import line_input

#: Bytes of which lines, their ends and too long ones are made.
PARTS = st.sampled_from([b"1", b"\x00", b"\xff", b"\n", b"\r", b"\r\n", b"1" * 7, b"\xc3\xa9" * 40])


def split(data: bytes, longest: int) -> tuple[list[tuple[str, int, bool]], tuple[int, int]]:
    """Return the lines of bytes by their definition, and the numbers of bytes that are left out."""
    *parts, last = re.split(rb"\r\n|\r|\n", data)
    parts += [last] if len(last) > longest else []
    lines = [(part[:longest].decode("utf-8", "replace"), len(part[:longest]), len(part) > longest) for part in parts]
    beyond = sum(max(0, len(part) - longest) for part in parts)
    return lines, (beyond, len(last) if len(last) <= longest else 0)


@given(st.lists(PARTS, max_size=40), st.sampled_from([1, 8, 200]), st.lists(st.integers(0, 400), max_size=20))
def test_wherever_bytes_are_cut_the_lines_are_the_same(parts: list[bytes], longest: int, cuts: list[int]) -> None:
    data, lines, found = b"".join(parts), TextLines(longest), []
    places = sorted({0, len(data), *(cut % (len(data) + 1) for cut in cuts)})
    for begin, end in pairwise(places):
        found += lines.push(data[begin:end])
    lines.discard()
    expected, left_out = split(data, longest)
    assert [(line.text, line.size, line.is_cut) for line in found] == expected
    assert lines.take_left_out() == left_out
    assert lines.take_left_out() == (0, 0)


def test_the_last_line_may_lack_its_end_and_no_text_is_known() -> None:
    lines = TextLines(8)
    assert [line.is_text for line in lines.push(b"1,\t2\n\x001\n\xfe\n3,4")] == [True, False, False]
    assert ([line.text for line in lines.end()], lines.end()) == (["3,4"], [])


@pytest.mark.parametrize("reader", [line_input._polled, line_input._by_thread])
def test_a_pipe_is_read_with_a_time_limit(reader: Callable[[io.FileIO], Callable[[], bytes | None]]) -> None:
    ours, theirs = os.pipe()
    read = reader(io.FileIO(ours))
    assert read() is None
    os.write(theirs, b"12345")
    begun, received = time.monotonic(), b""
    while received != b"12345" and time.monotonic() < begun + 30:
        received += read() or b""
    os.close(theirs)
    while (end := read()) is None and time.monotonic() < begun + 30:
        pass
    assert (received, end) == (b"12345", b"")
