"""Dates as the times of lines: live they are those of the same file."""

from __future__ import annotations

from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from draws import mixed
from loopback import until

import taxel
from taxel.live import Live

#: How a logger prints a time, with the separator of its cells.
FORMS = {
    "with T": (lambda at: at.isoformat(timespec="milliseconds"), ","),
    "with a blank": (lambda at: at.isoformat(" ", "milliseconds"), ","),
    "quoted": (lambda at: f'"{at.isoformat(" ", "milliseconds")}"', ","),
    "with a zone": (lambda at: at.isoformat(timespec="milliseconds") + "+02:00", "\t"),
    "with points": (lambda at: f"{at:%d.%m.%Y %H:%M:%S},{at.microsecond // 1000:03}", ";"),
    "with points and few digits": (lambda at: f"{at.day}.{at.month}.{at.year} {at:%H:%M:%S}", ";"),
    "of a day": (lambda at: f"{at:%H:%M:%S}.{at.microsecond // 1000:03}", ","),
}


@pytest.mark.parametrize(("form", "stated"), mixed([*FORMS], ["time=1:iso", "time=1", ""]))
def test_times_live_are_those_of_the_file(tmp_path: Path, form: str, stated: str) -> None:
    rng = np.random.default_rng(len(form))
    write, separator = FORMS[form]
    at = datetime(1975 + len(form), 2, 27, 10, 15, 2)
    lines = []
    for _ in range(40):
        at += timedelta(milliseconds=int(rng.integers(1_000, 9_000)))
        lines.append(separator.join([write(at), *map(str, rng.integers(0, 99, 3))]))
    file = tmp_path / "a.csv"
    file.write_text("\n".join(lines) + "\n")
    (tmp_path / "a.layout.toml").write_text(
        f"rows = 1\ncolumns = 3\n\n[table]\nseparator = {separator!r}\ntime_column = 1\ntime_unit = 'iso'\n".replace(
            "'", '"'
        )
    )
    keys = ",".join(key for key in (f"lines:{file}", "array=1x3", "rate=1", stated) if key)
    with Live(sources=keys, record=tmp_path / "a.mcap") as live:
        until(lambda: live.counters["frames"] == len(lines))
        summary = live.stop()
    expected, frames = taxel.open(file).frames(), taxel.open(tmp_path / "a.mcap").frames()
    assert np.array_equal(frames.t, expected.t)
    assert np.array_equal(frames.values, expected.values)
    # What waited in a file has no clock to compare with.
    assert summary.verdict.damaged == {}
