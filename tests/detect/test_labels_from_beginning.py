"""Labels counted from the beginning of recordings whose times are dates."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

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
