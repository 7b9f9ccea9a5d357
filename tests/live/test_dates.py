"""Dates as the times of lines: live they are those of the same file."""

from __future__ import annotations

import math
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from loopback import until

import taxel
from taxel._core import seconds_of
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


@given(
    st.datetimes(datetime(1700, 1, 1), datetime(2250, 1, 1)),
    st.integers(-1439, 1439),
    st.sampled_from(["T", " "]),
    st.sampled_from(".,"),
)
def test_drawn_dates_are_those_of_the_standard_library(at: datetime, minutes: int, between: str, point: str) -> None:
    zone = timezone(timedelta(minutes=minutes))
    texts = {
        at.isoformat(between, "microseconds").replace(".", point): at.replace(tzinfo=UTC),
        at.isoformat(between, "seconds"): at.replace(microsecond=0, tzinfo=UTC),
        at.replace(tzinfo=zone).isoformat(between, "microseconds"): at.replace(tzinfo=zone),
        f"{at.day}.{at.month}.{at.year:04}{between}{at:%H:%M}": at.replace(second=0, microsecond=0, tzinfo=UTC),
        f"{at:%H%M%S}": at.replace(year=1970, month=1, day=1, microsecond=0, tzinfo=UTC),
    }
    for text, expected in texts.items():
        since = expected - datetime(1970, 1, 1, tzinfo=UTC)
        assert seconds_of(text) == since.total_seconds(), text


@given(st.text("0123456789.:-+,TZ /", max_size=24))
def test_no_text_is_a_date_that_is_none_by_the_standard_library(text: str) -> None:
    seconds = seconds_of(text)
    if math.isnan(seconds) or text.count(".") >= 2:
        return
    for whole in (text, f"1970-01-01T{text}"):
        try:
            at = datetime.fromisoformat(whole)
        except ValueError:
            continue
        since = (at if at.tzinfo else at.replace(tzinfo=UTC)) - datetime(1970, 1, 1, tzinfo=UTC)
        assert seconds == pytest.approx(since.total_seconds(), rel=1e-12)
        return
    pytest.fail(f"{text!r} is {seconds}")


@pytest.mark.parametrize("stated", ["time=1:iso", "time=1", ""])
@pytest.mark.parametrize("form", FORMS)
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
