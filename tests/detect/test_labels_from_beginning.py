"""Labels counted from the beginning of recordings whose times are dates."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from formats import bags

import taxel
from taxel.tasks.labels import references

BEGIN = 1_741_947_667_480_000


def walk(place: Path, begin: int = BEGIN) -> taxel.Recording:
    t = begin + np.arange(100) * 10_000
    taxel.convert(taxel.Frames(np.zeros((100, 1, 2)), t, unit="N"), place)
    return taxel.open(place)


def table(place: Path, *rows: str, header: str = "label,t_us") -> Path:
    place.write_text("\n".join([header, *rows]) + "\n")
    return place


def test_labels_of_a_recording_of_dates_count_from_its_beginning(tmp_path: Path) -> None:
    made = [walk(tmp_path / "a.npz"), walk(tmp_path / "b.npz", BEGIN + 10**9)]
    # A table may mix both: each row tells.
    rows = ("a,contact,0", "a,lift,990000", "b,contact,400000", f"a,contact,{BEGIN + 500_000}")
    labels = table(tmp_path / "labels.csv", *rows, header="recording,label,t_us")
    wanted = [
        {"contact": [BEGIN, BEGIN + 500_000], "lift": [BEGIN + 990_000]},
        {"contact": [BEGIN + 10**9 + 400_000]},
    ]
    of_table = [{label: t.tolist() for label, t in events.items()} for events in references(labels, made)]
    assert of_table == wanted
    # The same where the table is beside its recording, and where several are given.
    own = [
        table(
            recording.path.with_name(f"{recording.path.stem}.notes.csv"), *(row[2:] for row in rows if row[0] == name)
        )
        for recording, name in zip(made, "ab", strict=True)
    ]
    for source in ("notes", own):
        found = references(source, [taxel.open(recording.path) for recording in made])
        assert [{label: t.tolist() for label, t in events.items()} for events in found] == wanted
    trials = taxel.information.read_trials(labels, made, window_ms=1.0)
    assert [trial.start_us for trial in trials] == [BEGIN, BEGIN + 990_000, BEGIN + 10**9 + 400_000, BEGIN + 500_000]


@pytest.mark.parametrize(("begin", "times"), [(BEGIN, (-1, 1_000_001)), (10**14, (1, 5))])
def test_other_labels_outside_a_recording_are_refused(tmp_path: Path, begin: int, times: tuple[int, int]) -> None:
    made = walk(tmp_path / "a.npz", begin)
    labels = table(tmp_path / "labels.csv", *(f"contact,{t}" for t in times))
    with pytest.warns(UserWarning, match="left out: outside"), pytest.raises(taxel.ProblemError, match="none within"):
        references(labels, [made])


@pytest.mark.parametrize("apart_ms", [0, 40, 60])
def test_labels_of_sources_count_from_the_first_of_them(tmp_path: Path, apart_ms: int) -> None:
    sent = [
        (topic, bags.array_of(np.float64), 10 * k + later, None, bags.multi_array(np.zeros((2, 2)), (2, 2), float))
        for k in range(100)
        for topic, later in (("/a", 0), ("/b", apart_ms))
    ]
    bag = bags.write(tmp_path / "a.bag", sent)
    both = [taxel.open(bag, topic=topic) for topic in ("/a", "/b")]
    labels = table(tmp_path / "labels.csv", "contact,500000")
    found = references(labels, both)
    assert [events["contact"].tolist() for events in found] == [[bags.BEGIN_NS // 1000 + 500_000]] * 2


def test_times_of_a_board_s_own_clock_are_not_counted_anew_and_not_read(tmp_path: Path) -> None:
    begin = 4_000_000
    events = taxel.Events([begin, begin + 10**6], [1, 1], [2, 2], [True, False], array=taxel.Array(8, 8))
    taxel.convert(events, tmp_path / "a.mcap")
    table(tmp_path / "a.notes.csv", "contact,4500000")
    recording = taxel.open(tmp_path / "a.mcap")
    assert [note.t for note in recording.notes] == [4_500_000]
    assert "_decoded" not in vars(recording._main.reader)
    # A converted recording of dates is none of a board's own clock.
    dates = taxel.Events(events.t + BEGIN, events.x, events.y, events.p, array=events.array)
    taxel.convert(dates, tmp_path / "b.mcap")
    table(tmp_path / "b.notes.csv", "contact,500000")
    assert [note.t for note in taxel.open(tmp_path / "b.mcap").notes] == [BEGIN + begin + 500_000]
