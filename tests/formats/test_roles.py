"""Roles are data: what is likely is said, what is open is asked until it is answered, what is stated stays."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from shell import call

import taxel
from taxel import FormatError, Frames
from taxel._base.table_text import Text
from taxel.formats.layout import Layout
from taxel.formats.roles import Role
from taxel.formats.table_form import form_of

from .strangers import NAMES, READINGS, lines, rows, written
from .tables import frames, layouts, opened

U = lines(lambda k: f"{k * 10},{k % 5},{k % 3}", 50)


@pytest.mark.parametrize("layout", ["falls = true\n", 'unit = "N"\n', "pitch_mm = 5\n", "rate_hz = 100\n", "[table]\n"])
def test_what_a_layout_does_not_state_is_found_as_without_it(tmp_path: Path, layout: str) -> None:
    (tmp_path / "a.csv").write_text(U)
    (tmp_path / "a.layout.toml").write_text(layout)
    found = taxel.open(tmp_path / "a.csv").frames()
    assert found.t.tolist() == [10_000 * k for k in range(50)]
    assert found.values.shape == (50, 1, 2)


def test_questions_stay_open_until_each_is_answered(tmp_path: Path) -> None:
    text = lines(lambda k: f"{k * 0.5 + READINGS[k, 0] / 99:.3f},{rows(k, 2)}", 60, "pos,a,b")
    path = tmp_path / "a.csv"
    path.write_text(text)
    with pytest.raises(FormatError, match="also open: the unit of the time"):
        taxel.open(path)
    layout = tmp_path / "a.layout.toml"
    layout.write_text('[table]\ntime_column = "pos"\n')
    with pytest.raises(FormatError, match="the unit of the time") as caught:
        taxel.open(path)
    assert "may be the time" not in str(caught.value)
    layout.write_text('[table]\ntime_column = "pos"\ntime_unit = "s"\n')
    assert len(taxel.open(path).frames()) == 60
    layout.write_text("[table]\ntime_column = 0\nframe_lines = 1\n")
    assert taxel.open(path).frames().values.shape == (60, 1, 3)


#: Columns beside eight sensors, the name and the cell of a line, and what becomes of each.
BESIDE = {
    "strike": (lambda k: str(100 * (k // 20 % 2)), "label"),
    "iteration": (lambda k: str(k % 90), "counter"),
    "Mean": (lambda k: f"{READINGS[k].mean():.2f}", "total"),
    "left foot": (lambda k: f"{READINGS[k, :4].sum():.1f}", "total"),
    "gain": (lambda k: "5", "constant"),
    "pose_x": (lambda k: f"{np.sin(k):.3f}", "stray"),
}


@given(at=st.integers(0, 8), kind=st.sampled_from([*BESIDE]))
def test_a_column_that_is_no_sensor_is_found_by_what_it_holds(
    at: int, kind: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    cell, role = BESIDE[kind]
    names, folder = NAMES.split(","), tmp_path_factory.mktemp("beside")
    head = ",".join(["t_ms", *names[:at], kind, *names[at:]])
    text = head + "\n"
    for k in range(200):
        own = rows(k).split(",")
        text += ",".join([str(10 * k), *own[:at], cell(k), *own[at:]]) + "\n"
    if role in ("label", "stray"):
        found = layouts(folder, text)
        assert len(found) == 2 + (role == "label")
        sizes = [frames(opened(folder, text, layout))[1][7] for layout in found]
        assert [len(row) for row in sizes] == [8, *[8] * (role == "label"), 9]
        return
    found = opened(folder, text)
    assert len(frames(found)[1][0]) == 8 + (role == "constant")
    assert f"{kind} always 5" in found.said if role == "constant" else f"{kind} left out: " in found.said


def test_sensors_that_read_few_values_or_one_are_sensors(tmp_path: Path) -> None:
    """Also beside each other, in a series, and where one says what two others say together."""
    text = lines(lambda k: f"{10 * k},{k // 20 % 2},{k // 30 % 2},0,{k // 25 % 3}", 200, "t_ms,s1,s2,s3,s4")
    assert len(frames(opened(tmp_path, text))[1][0]) == 4
    text = lines(lambda k: f"{10 * k},{k // 20 % 2},{k // 30 % 2},{k // 40 % 2}", 200, "t_ms,thumb,index,middle")
    assert len(frames(opened(tmp_path, text))[1][0]) == 3


def test_lines_over_the_whole_file_say_what_a_column_is(tmp_path: Path) -> None:
    """The first thousand lines of the last column hold 0 and 1; it is a sensor that is touched later."""
    names, random = "a,b,c,d", np.random.default_rng(1)

    def line(k: int, last: int) -> str:
        return f"{10 * k},{','.join(map(str, random.integers(0, 900, 3)))},{last}"

    text = lines(lambda k: line(k, int(k // 50 % 2 if k < 5000 else random.integers(0, 900))), 20_000, f"t_ms,{names}")
    assert len(frames(opened(tmp_path, text))[1][0]) == 4
    text = lines(lambda k: line(k, k // 50 % 2), 20_000, f"t_ms,{names}")
    assert len(layouts(tmp_path, text)) == 3


def test_later_lines_that_contradict_the_first_are_said(tmp_path: Path) -> None:
    """A column that is named as labels, and is a sensor that is touched later."""

    def text(count: int) -> str:
        return lines(
            lambda k: f"{10 * k},{k % 9},{k % 7},{k % 311 if k >= count else k // 50 % 2}", 9000, "t_ms,a,b,contact"
        )

    assert " other values in later lines, as 1" in opened(tmp_path, text(5000)).said
    assert "later lines" not in opened(tmp_path, text(9000)).said


def test_a_time_a_counter_and_a_total_that_later_lines_contradict_are_said(tmp_path: Path) -> None:
    random = np.random.default_rng(5)

    def said(count: int) -> str:
        def line(k: int) -> str:
            cells = random.integers(0, 900, 3)
            time, number, total = (10 * k, k, cells.sum()) if k < count else random.integers(0, 900, 3)
            return ",".join(map(str, [time, number, *cells, total]))

        (tmp_path / "a.csv").write_text(lines(line, 9000, "t_ms,iter,a,b,c,L"))
        return "; ".join(form_of(Text(tmp_path / "a.csv"), Layout(tmp_path / "a.csv"))[0].said)

    assert "first lines" not in said(9000)
    found = said(3000)
    assert "t_ms, the time by the first lines, does not ascend in later ones" in found
    assert "iter, the counter by the first lines, does not ascend in later ones" in found
    assert "L is the sum or mean of others in the first lines alone" in found


def test_info_shows_roles_that_are_likely_and_refuses_open_ones(tmp_path: Path, capsys) -> None:
    code, shown, _ = call(capsys, "info", written("9 a mean", tmp_path))
    assert code == 0
    assert "~ Mean  " in shown
    code, shown, _ = call(capsys, "info", tmp_path / "a.csv", "--json")
    roles = [Role(**role) for role in json.loads(shown)["roles"]]
    assert [role.role for role in roles] == ["time", *["taxel"] * 8, "total"]
    assert roles[1].first == READINGS[:3, 0].astype(str).tolist()
    code, shown, error = call(capsys, "info", written("9 places", tmp_path))
    assert (code, shown) == (2, "")
    assert "# ? area  " in error
    for command in (("convert", tmp_path / "a.csv", tmp_path / "b.npz"), ("train", tmp_path / "a.csv", "-o", "x")):
        code, _, error = call(capsys, *command)
        assert code == 2
        assert "# ? area  " in error
    with pytest.raises(FormatError, match=r"\n# \? area  "):
        taxel.open(tmp_path / "a.csv")


def test_repairs_of_times_are_said_with_a_layout_too(tmp_path: Path) -> None:
    layout = '[table]\ntime_column = "time_ms"\ntime_unit = "ms"\n'
    found = opened(tmp_path, "time_ms,a\n0,1\n10,2\n30,4\n20,3\n40,5\n", layout)
    assert "1 line out of order, sorted by time" in found.said


def test_an_array_keeps_its_times_and_its_questions(tmp_path: Path) -> None:
    values, path = np.random.default_rng(1).random((100, 8)).astype(np.float32), tmp_path / "a.npz"
    np.savez(path, left=values, right=values + 1, time=np.arange(100) * 0.02)
    (tmp_path / "a.layout.toml").write_text('[data]\narray = "right"\n')
    found = taxel.open(path).frames()
    assert found.t.tolist() == [20_000 * k for k in range(100)]
    np.testing.assert_array_equal(found.values[:, 0], values + 1)
    np.save(tmp_path / "b.npy", np.zeros((45, 450, 52)))
    (tmp_path / "b.layout.toml").write_text("rate_hz = 100\n")
    with pytest.raises(FormatError, match="which axis is the time"):
        taxel.open(tmp_path / "b.npy")
    (tmp_path / "b.layout.toml").write_text('rate_hz = 100\n[data]\naxes = "row time column"\n')
    assert isinstance(found, Frames)
    assert taxel.open(tmp_path / "b.npy").frames().values.shape == (450, 45, 52)
