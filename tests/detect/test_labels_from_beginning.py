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


def test_labels_within_the_duration_of_a_recording_of_dates_count_from_its_beginning(tmp_path: Path) -> None:
    made = [walk(tmp_path / "a.npz"), walk(tmp_path / "b.npz", BEGIN + 10**9)]
    rows = ("a,contact,0", "a,lift,990000", "b,contact,400000")
    labels = table(tmp_path / "labels.csv", *rows, header="recording,label,t_us")
    with pytest.warns(
        UserWarning,
        match=r"labels.csv: times .* the beginning of .*a.npz, 2025-03-14 10:21:07.480 UTC; for 1 other ",
    ) as said:
        found = references(labels, made)
    assert len(said) == 1
    assert [{label: t.tolist() for label, t in events.items()} for events in found] == [
        {"contact": [BEGIN], "lift": [BEGIN + 990_000]},
        {"contact": [BEGIN + 10**9 + 400_000]},
    ]


@pytest.mark.parametrize(("begin", "times"), [(BEGIN, (1, 990_001)), (BEGIN, (-1, 5)), (10**14, (1, 5))])
def test_other_labels_outside_a_recording_are_refused(tmp_path: Path, begin: int, times: tuple[int, int]) -> None:
    made = walk(tmp_path / "a.npz", begin)
    labels = table(tmp_path / "labels.csv", *(f"contact,{t}" for t in times))
    with pytest.warns(UserWarning, match="left out: outside"), pytest.raises(taxel.ProblemError, match="none within"):
        references(labels, [made])


@pytest.mark.parametrize(("apart_ms", "is_known"), [(0, True), (40, True), (60, False)])
def test_labels_of_sources_count_from_the_first_of_them_unless_they_begin_apart(
    tmp_path: Path, apart_ms: int, is_known: bool
) -> None:
    sent = [
        (topic, bags.array_of(np.float64), 10 * k + later, None, bags.multi_array(np.zeros((2, 2)), (2, 2), float))
        for k in range(100)
        for topic, later in (("/a", 0), ("/b", apart_ms))
    ]
    bag = bags.write(tmp_path / "a.bag", sent)
    both = [taxel.open(bag, topic=topic) for topic in ("/a", "/b")]
    labels = table(tmp_path / "labels.csv", "contact,500000")
    if is_known:
        with pytest.warns(UserWarning, match="times are counted from"):
            found = references(labels, both)
        assert [events["contact"].tolist() for events in found] == [[bags.BEGIN_NS // 1000 + 500_000]] * 2
        return
    with pytest.warns(UserWarning, match="left out"), pytest.raises(taxel.ProblemError, match="none within"):
        references(labels, both)
