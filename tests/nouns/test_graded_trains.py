"""Graded spike trains: values that are refused, files, and trains of several kinds joined."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from hypothesis import HealthCheck, given, settings
from refusal import refused

from taxel import SpikeTrains
from taxel._base.errors import Place
from taxel._core import FormatError

from .trains import some


def graded(*values: float) -> SpikeTrains:
    return SpikeTrains(np.arange(len(values), dtype=float), [0, len(values)], 0.0, 10.0, values, kind="graded")


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(some())
def test_a_file_keeps_the_kind(tmp_path: Path, trains: SpikeTrains) -> None:
    back = SpikeTrains.load(trains.save(tmp_path / "a.npz", overwrite=True))
    assert back == trains
    assert back.kind == trains.kind
    with np.load(tmp_path / "a.npz") as file:
        assert ("kind" in file, "values" in file) == (trains.kind == "graded", trains.kind != "unsigned")


def test_files_without_a_kind_are_signed_if_they_have_values(tmp_path: Path) -> None:
    columns = {"times": [1.0, 2.0], "offsets": [0, 2], "start": 0.0, "stop": 3.0}
    np.savez(tmp_path / "a.npz", **columns)
    np.savez(tmp_path / "b.npz", **columns, values=np.float32([-1, 0]))
    np.savez(tmp_path / "c.npz", **columns, values=np.float32([-1, 2]), kind="wavy")
    np.savez(tmp_path / "d.npz", **columns, values=np.float32([-1, 0]), kind="graded")
    np.savez(tmp_path / "e.npz", **columns, kind="graded")
    assert SpikeTrains.load(tmp_path / "a.npz").kind == "unsigned"
    assert SpikeTrains.load(tmp_path / "b.npz").kind == "signed"
    for name in ("c.npz", "d.npz", "e.npz"):
        with refused(FormatError, place=Place(name)):
            SpikeTrains.load(tmp_path / name)


def test_trains_side_by_side_have_a_window_that_holds_all() -> None:
    both = SpikeTrains.side_by_side([SpikeTrains.from_lists([[1.0]], -2.0, 3.0), SpikeTrains.from_lists([], 0.0, 9.0)])
    assert (both.start, both.stop) == (-2.0, 9.0)
    for wrong in ([], [3], 3):
        with refused(argument="parts"):
            SpikeTrains.side_by_side(wrong)


def test_a_graded_train_says_its_kind() -> None:
    trains = graded(0.5, -2.0)
    assert repr(trains) == "SpikeTrains(1 train, 2 spikes, graded, 0 to 10 ms)"
    assert not trains.signed
    assert trains != SpikeTrains(trains.times, trains.offsets, 0.0, 10.0, trains.values)
    assert trains.between(0.5, 2.0).kind == trains.select([0, 0]).kind == trains.lasting(99.0).kind == "graded"
    assert [text.get_text() for text in trains.plot().get_legend().get_texts()] == ["above 0", "below 0"]
    with refused():
        trains.lasting(0.5)
