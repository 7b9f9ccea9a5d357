"""Published data sets: each trap of a format on files made here, and the recordings as published where those are."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.formats import making
from tests.formats.making import footfall, interpolated, pack_212, shared

import taxel
from taxel_studies.datasets import data_set, files, gaitndd, gaitpdb, icub, plate, popu, trials

MODULES = {"plate": plate, "gaitpdb": gaitpdb, "gaitndd": gaitndd, "icub": icub, "popu": popu}


@pytest.mark.parametrize("name", MODULES)
def test_taxel_opens_a_data_set_by_its_entry_point_with_its_truth_as_notes(name: str, tmp_path: Path) -> None:
    path = getattr(making, f"write_{name}")(tmp_path)
    assert files(data_set(name), tmp_path) == [path]
    found, opened = list(trials(MODULES[name], tmp_path)), taxel.open_all(path)
    sensors = [source for each in opened for source in each.sources.values()]
    assert [each.kind for each in opened] == [name] * len(opened)
    as_opened = plate.begun_unloaded if name == "plate" else lambda trial: trial
    assert [each.frames() for each in sensors] == [as_opened(trial).frames for trial in found]
    for each, trial in zip(sensors, found, strict=True):
        expected = sorted((int(t), event) for event, times in trial.truth.items() for t in times)
        assert sorted((note.t, note.text) for note in each.notes) == expected
        assert each.side == trial.foot


@pytest.mark.parametrize("name", MODULES)
@given(at=st.integers(0, 30_000), byte=st.integers(0, 255), cut=st.booleans())
def test_a_damaged_file_is_read_or_one_clear_error(
    name: str, tmp_path_factory: pytest.TempPathFactory, at: int, byte: int, cut: bool
) -> None:
    path = getattr(making, f"write_{name}")(tmp_path_factory.mktemp("damaged"))
    data = bytearray(path.read_bytes())
    data[at % len(data)] = byte
    path.write_bytes(data[: at % len(data)] if cut else data)
    said = path.stem
    try:
        taxel.open_all(path)
    except taxel.Error as error:
        said = str(error)
    assert path.stem in said


@pytest.mark.parametrize("how", ["external", "virtual", "link"])
def test_no_byte_of_another_file_is_read_by_one_of_the_plate(how: str, tmp_path: Path) -> None:
    path = making.write_plate(tmp_path)
    with h5py.File(path, "r+") as h5:
        if how == "link":
            del h5["img001"]
            h5["img001"] = h5py.ExternalLink(making.write_plate(tmp_path, "other"), "img001")
        else:
            making.elsewhere(h5, "img001", how)
    with pytest.raises(taxel.FormatError, match="in this file"):
        taxel.open_all(path)


@given(seed=st.integers(0, 2**32 - 1), start=st.integers(0, 8), sensors=st.integers(8, 20))
def test_interpolated_rows_come_back_within_one_count(seed: int, start: int, sensors: int) -> None:
    rng = np.random.default_rng(seed)
    true = rng.integers(2, 600, (sensors, 5, 6))
    found = plate.sensor_rows(interpolated(true, start, 45))
    used = found[: len(true)]
    assert np.abs(used - true[: len(used)])[: len(true) // 2 * 2 - 2].max() <= 1
    # Columns and frames without any load stay so, and change no other.
    around = [(0, 0), tuple(rng.integers(0, 4, 2)), tuple(rng.integers(0, 4, 2))]
    padded = plate.sensor_rows(np.pad(interpolated(true, start, 45), around))
    assert np.array_equal(padded, np.pad(found, around))


def test_the_truth_of_the_plate_follows_its_rules_or_a_table(tmp_path: Path) -> None:
    path = making.write_plate(tmp_path)
    derived = next(iter(plate.trials(path)))
    loaded = np.flatnonzero(footfall(0).sum(axis=(0, 1)))
    contact, heel_off, foot_off = (derived.truth[event][0] for event in ("contact", "heel_off", "foot_off"))
    assert (contact, foot_off) == (2000 * loaded[0], 2000 * (loaded[-1] + 1))
    assert contact < heel_off < foot_off
    assert len(derived.frames) == loaded[-1] + 2  # the padding after the end is gone
    (tmp_path / "events.csv").write_text(
        "subject,trial,contact_frame,heel_off_frame,foot_off_frame\nsubj900,1,3,20,33\n"
    )
    first, told = plate.trials(path)
    assert first.truth["contact"] == contact
    assert told.truth["contact"].tolist() == [6000]


def test_the_plate_is_opened_unloaded_before_its_first_load(tmp_path: Path) -> None:
    for trial in plate.trials(making.write_plate(tmp_path)):
        frames = plate.begun_unloaded(trial).frames
        loaded = frames.t[frames.values.any(axis=(1, 2))]
        assert loaded[0] == trial.truth["contact"][0]
        assert frames.t[0] == loaded[0] - 600_000
        assert set(np.diff(frames.t).tolist()) == {plate.FRAME_US}


@pytest.mark.parametrize("name", ["GaCo99_01.txt", "SiPt01_01.txt.gz"])
def test_gaitpdb_gives_both_feet(tmp_path: Path, name: str) -> None:
    left, right = gaitpdb.trials(making.write_gaitpdb(tmp_path, name))
    assert (left.foot, right.foot) == ("left", "right")
    assert left.group == ("healthy" if "Co" in name else "patient")
    assert left.frames.values.shape == (600, 1, 8)
    assert left.truth["contact"].tolist() == [1_000_000 * k for k in range(1, 6)]  # the first is cut by the start
    assert left.truth["foot_off"].tolist() == [1_000_000 * k + 600_000 for k in range(1, 6)]
    for foot, sign in ((left, -1), (right, 1)):
        places = foot.frames.array.places
        assert places is not None
        # Sensor 1 is the heel (y forwards is -800 there), sensor 8 the front.
        assert places.x.ravel().tolist() == [sign * x for x in (500, 700, 300, 700, 300, 700, 300, 500)]
        assert places.y.ravel().tolist() == [800, 400, 400, 0, 0, -400, -400, -800]


@given(st.lists(st.integers(-2048, 2047), min_size=2, max_size=40).filter(lambda v: len(v) % 2 == 0))
def test_format_212_round_trip(values: list[int]) -> None:
    assert gaitndd.format_212(pack_212(np.array(values))).tolist() == values


def test_gaitndd_gives_step_times_and_leaves_out_invalid_samples(tmp_path: Path) -> None:
    left, right = gaitndd.trials(making.write_gaitndd(tmp_path))
    assert left.truth["contact"].tolist() == [1_000_000 * k for k in range(2, 9)]
    assert left.truth["foot_off"].tolist() == [1_000_000 * k - 400_000 for k in range(3, 9)]
    assert (len(left.frames), len(right.frames)) == (3000, 2999)
    assert right.truth == {}
    assert right.frames.t[0] == 3333


@pytest.mark.parametrize(("name", "folder", "count"), [("gaitpdb", "insole_gaitpdb", 48), ("plate", "plate", 360)])
def test_derived_truth_equals_the_table_of_the_published_recordings(
    name: str, folder: str, count: int, tmp_path: Path
) -> None:
    source = data_set(name)
    for file in files(source, shared(folder)):
        (tmp_path / file.name).symlink_to(file)
    pairs = list(zip(trials(source, tmp_path), trials(source, shared(folder)), strict=True))
    assert len(pairs) == count
    assert all(np.array_equal(derived.truth[e], told.truth[e]) for derived, told in pairs for e in told.truth)


def test_interpolating_the_plates_sensors_again_gives_the_image_back() -> None:
    with h5py.File(files(plate, shared("plate"))[0]) as h5:
        for name in list(h5)[:10]:
            image = h5[name][...].astype(np.int64)
            sensors = plate.sensor_rows(image)
            first = int(np.flatnonzero(image.any(axis=(1, 2)))[0])
            again = (interpolated(sensors, first - k, image.shape[0]) for k in range(min(first, 2) + 1))
            assert min(np.abs(each - image).max() for each in again) <= 1
