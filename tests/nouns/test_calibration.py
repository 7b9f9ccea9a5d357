"""Calibrations: each curve rises and can be inverted, fits find what was put in, another array is refused."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from refusal import refused

import taxel
from taxel import Array, Calibration, FormatError, Frames, Load
from taxel._base.errors import Place

ARRAY = Array(3, 4, pitch_mm=5.0, name="small")
DAY = "2026-11-21"


def frames(values, unit="counts", array=ARRAY):
    values = np.broadcast_to(np.asarray(values, float), (1, *array.shape)) if np.ndim(values) < 3 else values
    return Frames(values, np.arange(len(values)), unit=unit, array=array)


exponents = st.floats(0.3, 3.0)
gains = st.floats(1e-3, 1e3)


# fits


@given(exponents, gains, st.integers(0, 2**31))
@settings(max_examples=30)
def test_a_fit_to_several_loads_finds_gain_and_exponent(exponent, gain, seed):
    rng = np.random.default_rng(seed)
    loads = []
    for scale in (1.0, 3.0, 10.0):
        read = rng.uniform(1.0, 10.0, (1, *ARRAY.shape)) * scale
        loads.append(Load(frames(read), float((gain * read**exponent).sum())))
    found = Calibration.fit(loads, date=DAY)
    assert found.apply(loads[1].frames).total() == pytest.approx([loads[1].load], rel=1e-4)
    assert json.loads(found.to_json())["curve"]["power"]["exponent"] == pytest.approx(exponent, rel=1e-3)
    assert found.residual == pytest.approx(0.0, abs=1e-4)
    assert [made for *_, made in found.loads] == pytest.approx([load.load for load in loads], rel=1e-3)


def test_two_loads_that_two_exponents_fit_are_said_to_be_too_few():
    """One strong taxel and six weak ones against four in between."""
    strong, between = np.zeros((2, 1, *ARRAY.shape))
    strong[0].flat[:7], between[0].flat[:4] = [100.0, *[10.0] * 6], 50.0
    ratio = [(strong**e).sum() / (between**e).sum() for e in (0.5, 1.0, 3.0)]
    assert ratio[0] > ratio[1] < ratio[2], "the same share of the two loads belongs to two exponents"
    loads = [Load(frames(read), float((read[read > 0] ** 0.5).sum())) for read in (strong, between)]
    with pytest.warns(UserWarning, match="would fit the loads as well; to be sure, add a load"):
        Calibration.fit(loads, date=DAY)
    loads.append(Load(frames(strong + between), float(((strong + between) ** 0.5).sum())))
    found = Calibration.fit(loads, date=DAY)
    assert json.loads(found.to_json())["curve"]["power"]["exponent"] == pytest.approx(0.5, rel=1e-3)


def test_a_probe_on_single_taxels_gives_these_their_gain_and_the_others_the_common_one():
    read = np.zeros((2, 1, *ARRAY.shape))
    read[0, 0, 1, 2], read[1, 0, 0, 3] = 10.0, 10.0
    loads = [Load(frames(read[0]), 1.0, "N", (2, 1)), Load(frames(read[1]), 3.0, "N", (3, 0))]
    found = Calibration.fit(loads, exponent=1.0, each=True, date=DAY)
    assert (found.gain[1, 2], found.gain[0, 3]) == (pytest.approx(0.1), pytest.approx(0.3))
    assert 0.1 < found.gain[2, 0] < 0.3


# what lies beside a recording


def made_beside(folder, calibration, name="press.calibration.json"):
    taxel.convert(frames(np.arange(36.0).reshape(3, 3, 4)), folder / "press.npz")
    calibration.save(folder / name)
    return taxel.open(folder / "press.npz")


@pytest.mark.parametrize("name", ["press.calibration.json", "calibration.json"])
def test_a_recording_finds_the_calibration_beside_it(tmp_path, name):
    calibration = Calibration.table(ARRAY, [40.0], [4.0], unit="N", date=DAY)
    recording = made_beside(tmp_path, calibration, name)
    assert recording.calibration == calibration
    assert recording.calibrated().unit == "N"
    assert np.array_equal(recording.calibrated().values, calibration.apply(recording.frames()).values)
    # Values are converted to N only on request: encoders and readouts receive them as they were read.
    assert recording.frames().unit == "counts"


@pytest.mark.parametrize("entry", ["unit", "of", "curve", "array", "gain", "rest", "date", "floor", "loads", "taxel"])
@pytest.mark.parametrize("nonsense", [None, "x", -1, [], {}, [[1]], 1e400, True])
def test_a_spoilt_file_is_one_line(tmp_path, entry, nonsense):
    said = json.loads(Calibration.fit([Load(frames(2.0), 6.0)], rest=np.ones(ARRAY.shape), date=DAY).to_json())
    file = tmp_path / "calibration.json"
    file.write_text(json.dumps(said | {entry: nonsense}))
    # Missing entries and valid alternatives, with which the file still loads.
    if (entry, nonsense) in [("rest", None), ("loads", []), ("loads", {}), ("of", "x"), ("date", None)]:
        assert isinstance(Calibration.load(file), Calibration)
        return
    with refused(FormatError, place=Place("calibration.json")) as error:
        Calibration.load(file)
    assert len(str(error.value)) < 500
