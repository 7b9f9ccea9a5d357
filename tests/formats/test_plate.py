"""Each trap of the format on files made here, and on the footscan-type plate as published, where that is there."""

from __future__ import annotations

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from taxel import FormatError, formats
from taxel.formats import plate

from .making import (
    footfall,
    interpolated,
    shared,
    write_plate,
)


@given(seed=st.integers(0, 2**32 - 1), start=st.integers(0, 8), sensors=st.integers(8, 20))
def test_interpolated_rows_come_back_within_one_count(seed, start, sensors):
    rng = np.random.default_rng(seed)
    true = rng.integers(2, 600, (sensors, 5, 6))
    found = plate.sensor_rows(interpolated(true, start, 45))
    used = found[: len(true)]
    assert np.abs(used - true[: len(used)])[: len(true) // 2 * 2 - 2].max() <= 1
    # Columns and frames without any load stay so, and change no other.
    around = [(0, 0), tuple(rng.integers(0, 4, 2)), tuple(rng.integers(0, 4, 2))]
    padded = plate.sensor_rows(np.pad(interpolated(true, start, 45), around))
    assert np.array_equal(padded, np.pad(found, around))


def test_rows_that_were_not_interpolated_are_refused():
    image = np.random.default_rng(1).integers(0, 500, (30, 8, 8))
    with pytest.raises(FormatError, match="cells do not fit rows that were interpolated"):
        plate.sensor_rows(image)


def test_plate_truth_follows_the_rules(tmp_path):
    trials = list(formats.trials(write_plate(tmp_path)))
    assert [t.name for t in trials] == ["subj900/00", "subj900/01"]
    total = footfall(0).sum(axis=(0, 1))
    loaded = np.flatnonzero(total)
    assert trials[0].truth["contact"][0] == 2000 * loaded[0]
    assert trials[0].truth["foot_off"][0] == 2000 * (loaded[-1] + 1)
    assert trials[0].truth["contact"][0] < trials[0].truth["heel_off"][0] < trials[0].truth["foot_off"][0]
    assert len(trials[0].frames) == loaded[-1] + 2  # the padding after the end is gone


def test_events_csv_of_the_folder_is_taken_where_it_is(tmp_path):
    write_plate(tmp_path)
    (tmp_path / "events.csv").write_text(
        "subject,trial,contact_frame,heel_off_frame,foot_off_frame\nsubj900,1,3,20,33\n"
    )
    derived, told = formats.trials(tmp_path)
    assert told.truth["contact"][0] == 6000
    assert derived.truth["contact"][0] != 6000


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (
            lambda h5: h5.create_dataset("notes", data=[1]),
            "subj900.h5: the data set 'notes' must have a name like imgNNN",
        ),
        (lambda h5: h5.create_dataset("img002", data=[1.5]), "subj900.h5, img002: must contain whole numbers"),
        (
            lambda h5: h5.create_dataset("img002", data=np.zeros((9, 4, 5), int)),
            "subj900.h5, img002: no count is above 0",
        ),
    ],
)
def test_a_plate_file_that_is_none_says_where(tmp_path, spoil, said):
    with h5py.File(write_plate(tmp_path), "a") as h5:
        spoil(h5)
    with pytest.raises(FormatError, match=said):
        list(formats.trials(tmp_path, "plate"))


def test_a_cut_hdf5_file_is_one_error(tmp_path):
    file = write_plate(tmp_path)
    file.write_bytes(file.read_bytes()[:3000])
    with pytest.raises(FormatError, match=r"subj900.h5: the HDF5 file is damaged"):
        list(formats.trials(tmp_path, "plate"))


def test_derived_truth_equals_events_csv_on_the_plate():
    folder = shared("plate")
    known = plate._events_table(folder / "events.csv")
    wrong = 0
    for file in plate.files(folder):
        with h5py.File(file) as h5:
            for name in h5:
                found = plate.events(h5[name][...].astype(np.int32))
                told = known[file.stem, int(name[3:])]
                wrong += any(found[event] != frame for event, frame in told.items())
    assert (wrong, len(known)) == (0, 360)


def test_interpolating_the_plates_sensors_again_gives_the_image_back():
    with h5py.File(plate.files(shared("plate"))[0]) as h5:
        for name in list(h5)[:10]:
            image = h5[name][...].astype(np.int64)
            sensors = plate.sensor_rows(image)
            first = int(np.flatnonzero(image.any(axis=(1, 2)))[0])
            best = min(
                np.abs(interpolated(sensors, first - k, image.shape[0]) - image).max() for k in range(min(first, 2) + 1)
            )
            assert best <= 1
