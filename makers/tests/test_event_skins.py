"""Event skins that are no grid: a line has the number of a taxel; and times of a host that polls."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from shell import call

import taxel

RANDOM = np.random.default_rng(3)
COUNT = 600
T_US = 1_580_000_000_000_000 + np.sort(RANDOM.integers(0, 5_000_000, COUNT))
TAXELS, FALLS = RANDOM.integers(0, 80, COUNT), RANDOM.integers(0, 2, COUNT)


def written(path: Path, t_us: np.ndarray = T_US, more: str = "") -> Path:
    rows = zip(FALLS, TAXELS, t_us, strict=True)
    path.write_text("".join(f"{falls} {taxel} {t / 1e6:.6f}{more}\n" for falls, taxel, t in rows))
    return path


@pytest.mark.parametrize("more", ["", " 1580000000.5 0.25"])
def test_events_of_two_fingers_open_by_themselves(more: str, tmp_path: Path) -> None:
    events = taxel.open(written(tmp_path / "grasp.tact", more=more)).events
    assert events.array.shape == (1, 80)
    np.testing.assert_array_equal(events.x, TAXELS)
    np.testing.assert_array_equal(events.p, FALLS == 0)
    assert np.abs(events.t - T_US).max() <= 1


def test_lines_that_a_host_swapped_are_sorted_and_those_of_another_run_refused(tmp_path: Path) -> None:
    t = T_US.copy()
    t[[100, 300]] = t[[101, 301]]
    t[[101, 301]] -= 20
    with pytest.warns(UserWarning, match="2 lines out of order, sorted by time"):
        events = taxel.open(written(tmp_path / "grasp.tact", t)).events
    assert (np.diff(events.t) >= 0).all()
    assert np.bincount(events.x, minlength=80).tolist() == np.bincount(TAXELS, minlength=80).tolist()
    again = np.concatenate([T_US[300:], T_US[:300]])
    with pytest.raises(taxel.FormatError, match="before that of the line above"):
        taxel.open(written(tmp_path / "again.tact", again))


def test_places_of_taxels_come_from_a_layout(tmp_path: Path) -> None:
    path = written(tmp_path / "grasp.tact")
    (tmp_path / "grasp.layout.toml").write_text("rows = 8\ncolumns = 10\npitch_mm = 2\n")
    events = taxel.open(path).events
    assert (events.array.shape, events.array.pitch_mm) == ((8, 10), 2)
    np.testing.assert_array_equal(10 * events.y + events.x.astype(int), TAXELS)


@pytest.mark.parametrize("names", ["t_us,taxel,p", "t_us,address,polarity", "t_us,addr,on"])
def test_a_table_of_events_may_have_one_address(names: str, tmp_path: Path) -> None:
    rows = zip(T_US, TAXELS, FALLS, strict=True)
    (tmp_path / "a.csv").write_text(names + "\n" + "".join(f"{t},{taxel},{p}\n" for t, taxel, p in rows))
    events = taxel.open(tmp_path / "a.csv").events
    assert events.array.shape == (1, TAXELS.max() + 1)
    np.testing.assert_array_equal(events.x, TAXELS)
    np.testing.assert_array_equal(events.p, FALLS == 1)
    np.testing.assert_array_equal(events.t, T_US)


def test_info_says_how_fine_the_times_of_a_polled_skin_are(tmp_path: Path, capsys) -> None:
    code, shown, _ = call(capsys, "info", written(tmp_path / "a.tact"))
    assert (code, "resolution" in shown) == (0, False)
    polled = (
        np.sort(RANDOM.choice([*range(80), *range(130, 160)], COUNT)) * 15_700 + T_US[0] + RANDOM.integers(0, 9, COUNT)
    )
    code, shown, _ = call(capsys, "info", written(tmp_path / "b.tact", np.sort(polled)))
    assert "15.7 ms apart" in shown
