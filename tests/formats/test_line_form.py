"""What lines of a live source are, by the first of them: columns, time, lines of a frame, and what is refused."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from numpy.typing import NDArray
from refusal import refused

import taxel
from taxel._base.errors import Place
from taxel.formats.form import Form
from taxel.formats.layout import PrintedFrames
from taxel.formats.line_form import form_of_lines


def row(count: int) -> str:
    return ",".join("7" * count)


def repeated(line: Callable[[int], str], count: int = 20) -> list[str]:
    return [line(k) for k in range(count)]


def form(
    lines: Sequence[str], size: int | None = None, unit: str = "", *, are_taxels: bool = True, **stated: object
) -> Form | None:
    def unit_of(stamps: NDArray[np.float64], numbers: Sequence[int]) -> str:
        assert len(stamps) == len(numbers)
        return unit

    return form_of_lines(lines, PrintedFrames("lines:-", **stated), size, unit_of, are_taxels=are_taxels)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("lines", "keys", "expected"),
    [
        (repeated(lambda _: row(256)), {}, (256, (), 1)),
        (repeated(lambda _: "7"), {}, (1, (), 1)),
        (repeated(lambda k: f"{500 + 10 * k},{row(6)}"), {}, (6, ((0, 1e3),), 1)),
        (repeated(lambda k: "" if k % 5 == 3 else row(6)), {}, (6, (), 4)),
        (repeated(lambda k: f"2024-05-01 10:15:02.{k:02}0,{row(7)}"), {}, (7, ((0, 1e6),), 1)),
        (repeated(lambda k: f"01.05.2024 10:15:02,{k:02}0;7;7;7"), {}, (3, ((0, 1e6),), 1)),
        (["Mat 1.0", *repeated(lambda _: row(64))], {}, (64, (), 1)),
        (["7", *repeated(lambda _: row(3))], {}, (3, (), 1)),
        (["a:3,b:4"] * 5, {}, (2, (), 1)),
        (["[3, 4] -> 5"] * 5, {}, (3, (), 1)),
        (["01 1E 0A"] * 5, {}, (3, (), 1)),
        (["1;2;3;"] * 9, {"leave_out": ["4"], "size": 3}, (3, (), 1)),
        (["a;b;c;note", *["1;2;3;"] * 9], {"leave_out": ["note"], "size": 3}, (3, (), 1)),
        (["t,x,a,b", "0,hi,1,2", "9,hi,1,2"], {"time": "t:ms", "leave_out": ["x"], "size": 2}, (2, ((0, 1e3),), 1)),
        (repeated(lambda k: f"{k},{1000 * k},5,6"), {"time": "1+2", "size": 2}, (2, ((0, 1e6), (1, 1e-3)), 1)),
        (["1 2 3 4 5 6 7"] * 64, {"frame_lines": 8, "size": 56}, (7, (), 8)),
        # What is stated says how many columns are taxels, whatever they look like.
        (repeated(lambda k: f"{k * 10},7,7"), {"size": 3}, (3, (), 1)),
        (["contact,state", "1,2", "3,4"], {"size": 2}, (2, (), 1)),
    ],
)
def test_lines_are_understood(
    lines: list[str], keys: dict[str, object], expected: tuple[int, tuple[tuple[int, float], ...], int]
) -> None:
    found = form(lines, **keys)  # type: ignore[arg-type]
    assert found is not None
    assert (len(found.taxels), found.clocks, found.lines) == expected


def test_lines_without_numbers_have_no_form() -> None:
    assert form(["hello"] * 20) is None
    assert form([]) is None


def test_the_unit_of_stamps_is_that_in_which_lines_arrive() -> None:
    lines = repeated(lambda k: f"{10_000 * k},{row(5)}")
    found = form(lines, unit="us")
    assert found is not None
    assert found.clocks == ((0, 1.0),)


@pytest.mark.parametrize(
    ("lines", "keys"),
    [
        (["10,7,7", "20,7,7", "30,7,7"], {}),
        (repeated(lambda k: f"{k},{['left', 'right'][k % 2]},7,7"), {}),
        (["left: 1,2", "right: 3,4"] * 9, {}),
        (['{"t": 0, "left": [1, 2]}', '{"t": 5, "right": [3, 4]}'] * 9, {}),
        (["1,2"] * 5, {"time": "3:ms"}),
        (["1,2"] * 5, {"leave_out": ["c"]}),
        (["1,2"] * 5, {"leave_out": ["1", "2"]}),
    ],
)
def test_what_lines_do_not_show_is_refused(lines: list[str], keys: dict[str, object]) -> None:
    with refused(taxel.ProblemError):
        form(lines, **keys)  # type: ignore[arg-type]


def test_a_unit_that_is_none_and_another_number_of_columns_are_refused() -> None:
    with refused(taxel.ProblemError, "time_unit"):
        form(["1,2"] * 5, time="1:q")
    with refused(taxel.FormatError, place=Place(line=1)):
        form(["1,2"] * 5, columns=["a", "b", "c"])


def test_columns_of_quantities_are_all_kept_but_for_texts() -> None:
    found = form(["t_us,acc_x,battery,mode", "0,1,2,walk", "10,2,3,walk"], are_taxels=False)
    assert found is not None
    assert (found.names, found.clocks, found.taxels) == (
        ("t_us", "acc_x", "battery", "mode"),
        ((0, 1.0),),
        (1, 2),
    )
