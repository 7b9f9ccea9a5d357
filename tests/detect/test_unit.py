"""A readout and a plain rule hold the unit of the values that they were trained on, and refuse values in another."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from refusal import refused
from shell import call

import taxel
from taxel import Array, Events, Frames, Readout, Tare
from taxel.detect import Example, PlainRule, Recipe, fit, judge, load, run, tune
from taxel.encode import LevelCrossing
from taxel.live import Live
from taxel.panel.shown_files import Opening, ShownFiles

#: As recordings name units; ticks are those of a board's events.
UNITS = st.sampled_from(["ticks", "counts", "as sent", "N", "mN", "kPa", "Pa", "N/cm2"])
ARRAY = Array(2, 2)
RECIPE = Recipe(LevelCrossing([5.0]), {"tau": 2.0, "ub": 2.0, "delay_ms": 1.0})


def pressed(unit: str) -> Frames:
    """Two taxels are pressed for 0.1 s, each half a second."""
    t = np.arange(200)
    values = np.zeros((200, 2, 2))
    values[t % 50 >= 40, 0] = 9.0
    return Frames(values, 10_000 * t, unit=unit, array=ARRAY)


def example(unit: str) -> Example:
    frames = pressed(unit)
    return Example(frames, {"contact": [400_000, 900_000, 1_400_000, 1_900_000]}, Tare.take(frames, stop_us=300_000))


def events() -> Events:
    return Events([0, 1000], [0, 1], [0, 0], [True, True], array=ARRAY, intensity=[9, 9])


def both(unit: str) -> list[Readout | PlainRule]:
    rule = tune([example(unit)], ["contact"])["contact"]
    assert rule is not None
    return [fit([example(unit)], RECIPE), rule]


@given(UNITS, UNITS)
def test_values_in_another_unit_are_refused_by_a_file_too(own: str, other: str) -> None:
    tare = example(own).tare
    for made in both(own):
        again = type(made).from_json(made.to_json())
        assert (again.unit, again) == (own, made)
        if other == own:
            assert len(run(again, pressed(other), tare=tare))
            continue
        with refused():
            run(again, pressed(other), tare=tare)
        with refused():
            again.stream(tare=tare).push(pressed(other))


@given(UNITS)
def test_events_are_ticks(own: str) -> None:
    tare = example(own).tare
    for made in both(own):
        if own == "ticks":
            run(made, events(), tare=tare)
            made.stream(tare=tare).push(events())
            continue
        for reads in (partial(run, made, tare=tare), made.stream(tare=tare).push):
            with refused():
                reads(events())
        with refused():
            Live(0, host="127.0.0.1", readout=made, tare=tare)


@given(UNITS)
def test_a_file_without_a_unit_reads_values_in_any(unit: str) -> None:
    for made in both("N"):
        text = json.loads(made.to_json())
        del text["unit"]
        old = type(made).from_json(json.dumps(text))
        assert old.unit is None
        assert "unit" not in json.loads(old.to_json())
        assert run(old, pressed(unit), tare=example(unit).tare) == run(made, pressed("N"), tare=example("N").tare)


@pytest.mark.parametrize("does", [lambda x: fit(x, RECIPE), lambda x: judge(x, RECIPE, 2), tune])
def test_recordings_in_different_units_are_not_trained_on_together(does) -> None:
    with refused():
        does([example("kPa"), example("N")])


def test_the_commands_and_the_page_name_both_units(tmp_path: Path, capsys) -> None:
    from taxel.panel.training import Training

    for unit in ("kPa", "counts"):
        taxel.convert(pressed(unit), tmp_path / f"{unit}.npz")
    table = tmp_path / "labels.csv"
    table.write_text("label,t_us\n" + "".join(f"contact,{t}\n" for t in (400_000, 900_000, 1_400_000, 1_900_000)))
    readout = tmp_path / "readout.json"
    code, _, error = call(capsys, "train", tmp_path / "kPa.npz", "--labels", table, "-o", readout)
    assert code == 0, error
    assert load(readout).unit == "kPa"
    code, out, error = call(capsys, "detect", tmp_path / "counts.npz", "--readout", readout, "--tare", "0.3")
    said = "values are in counts, but the readout was trained on kPa: give values in kPa, as a calibration gives"
    assert (code, out, error.count("\n"), said in error) == (2, "", 1, True), error
    handler = Training(Opening(), ShownFiles())
    with refused():
        handler.detect(tmp_path / "counts.npz", None, readout)
    labels, _, found = handler.detect(tmp_path / "kPa.npz", None, readout)
    assert (labels, len(found) > 0) == (["contact"], True)
    code, _, error = call(capsys, "live", "--readout", readout, "--tare", "0.05", "--seconds", "0.1")
    last = error.splitlines()[-1]
    assert (code, "live values are in ticks, but the readout was trained on kPa" in last) == (2, True), error
