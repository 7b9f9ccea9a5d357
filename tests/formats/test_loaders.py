"""Loaders of other people's files: each trap of the formats, on files made here."""

from __future__ import annotations

import os
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from taxel import FormatError, ProblemError, formats
from taxel.formats import gaitndd, gaitpdb, moticon, pedar, plate

from .making import (
    footfall,
    interpolated,
    pack_212,
    write_gaitndd,
    write_gaitpdb,
    write_moticon,
    write_pedar,
    write_plate,
)

SHARED = Path(os.environ.get("TAXEL_DATA", Path(__file__).parents[3] / "shared" / "data"))


def shared(name: str) -> Path:
    if not (SHARED / name).is_dir():
        pytest.skip(f"no {name} in {SHARED}: set TAXEL_DATA")
    return SHARED / name


# plate


@given(seed=st.integers(0, 2**32 - 1), start=st.integers(0, 8), sensors=st.integers(8, 20))
def test_interpolated_rows_come_back_within_one_count(seed, start, sensors):
    rng = np.random.default_rng(seed)
    true = rng.integers(2, 600, (sensors, 5, 6))
    found = plate.sensor_rows(interpolated(true, start, 45))
    used = found[: len(true)]
    assert np.abs(used - true[: len(used)])[: len(true) // 2 * 2 - 2].max() <= 1


def test_rows_that_were_not_interpolated_are_refused():
    image = np.random.default_rng(1).integers(0, 500, (30, 8, 8))
    with pytest.raises(FormatError, match="not interpolated three from two"):
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
        (lambda h5: h5.create_dataset("notes", data=[1]), "subj900.h5: data set 'notes'; must be named imgNNN"),
        (lambda h5: h5.create_dataset("img002", data=[1.5]), "subj900.h5, img002: must be whole numbers"),
        (lambda h5: h5.create_dataset("img002", data=np.zeros((9, 4, 5), int)), "subj900.h5, img002: never loaded"),
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
    with pytest.raises(FormatError, match=r"subj900.h5: not a whole HDF5 file"):
        list(formats.trials(tmp_path, "plate"))


# gaitpdb


@pytest.mark.parametrize("name", ["GaCo99_01.txt", "SiPt01_01.txt.gz"])
def test_gaitpdb_gives_both_feet(tmp_path, name):
    write_gaitpdb(tmp_path, name)
    left, right = formats.trials(tmp_path)
    assert (left.foot, right.foot) == ("left", "right")
    assert left.group == ("healthy" if "Co" in name else "patient")
    assert left.frames.values.shape == (600, 1, 8)
    assert list(left.truth["contact"]) == [1_000_000 * k for k in range(1, 6)]  # the first is cut by the start
    assert list(left.truth["foot_off"]) == [1_000_000 * k + 600_000 for k in range(1, 6)]


def test_short_stances_do_not_count():
    total = np.zeros(300)
    total[50:69], total[100:120] = 60.0, 60.0
    assert gaitpdb.contacts(total).tolist() == [[100, 120]]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda r: [*r[:6], r[6] + "\t1", *r[7:]], "line 7: 20 cells, must have 19"),
        (lambda r: [*r[:6], r[6].replace("0.06", "0,06"), *r[7:]], "line 7: time has a decimal comma"),
        (lambda r: [*r[:6], "\t" + r[6].split("\t", 1)[1], *r[7:]], "line 7: time is empty"),
        (lambda r: [*r[:6], "x" + r[6], *r[7:]], "line 7: time is 'x0.06', not a number"),
        (lambda r: [*r[:6], "nan" + r[6][4:], *r[7:]], "line 7: time is 'nan', not a finite number"),
        (lambda r: [*r[:6], r[2], *r[7:]], "line 7: time 0.02 s does not ascend"),
        (lambda r: r[:1], "fewer than 2 lines"),
    ],
)
def test_a_spoilt_gaitpdb_line_is_named(tmp_path, change, said):
    write_gaitpdb(tmp_path, change=change)
    with pytest.raises(FormatError, match=f"GaCo99_01.txt[,:] {said}"):
        list(formats.trials(tmp_path))


def test_a_damaged_gzip_file_is_one_error(tmp_path):
    file = write_gaitpdb(tmp_path, "GaCo99_01.txt.gz")
    file.write_bytes(file.read_bytes()[:-40])
    with pytest.raises(FormatError, match="not a whole gzip file"):
        list(formats.trials(tmp_path))


# gaitndd


@given(st.lists(st.integers(-2048, 2047), min_size=2, max_size=40).filter(lambda v: len(v) % 2 == 0))
def test_format_212_round_trip(values):
    assert gaitndd.format_212(pack_212(np.array(values))).tolist() == values


def test_gaitndd_gives_step_times_and_leaves_out_invalid_samples(tmp_path):
    write_gaitndd(tmp_path)
    left, right = formats.trials(tmp_path)
    assert list(left.truth["contact"]) == [1_000_000 * k for k in range(2, 9)]
    assert list(left.truth["foot_off"]) == [1_000_000 * k - 400_000 for k in range(3, 9)]
    assert (len(left.frames), len(right.frames)) == (3000, 2999)
    assert right.truth == {}
    assert right.frames.t[0] == 3333


@pytest.mark.parametrize(
    ("file", "old", "new", "said"),
    [
        (".hea", " 212 ", " 16 ", "line 2: format 16; only 212 is read"),
        (".hea", "300 3000\r", "300 3001\r", "4500 bytes; 3001 samples of format 212 are 4503"),
        (".hea", " 0 500 ", " 0 501 ", "first value 500; the header says 501"),
        (".hea", "control99.let", "../control99.let", "is not a plain file name"),
        (".ts", "5.0000\t1.0000", "5,0000\t1.0000", "line 3: time has a decimal comma"),
        (".ts", "5.0000\t1.0000", "4.0000\t1.0000", "line 3: time, left stride and swing do not follow"),
    ],
)
def test_a_spoilt_gaitndd_file_is_named(tmp_path, file, old, new, said):
    path = write_gaitndd(tmp_path).with_suffix(file)
    content = path.read_bytes().decode()
    assert old in content
    path.write_bytes(content.replace(old, new, 1).encode())
    with pytest.raises(FormatError, match=said):
        list(formats.trials(tmp_path))


def test_a_wrong_checksum_is_found(tmp_path):
    path = write_gaitndd(tmp_path).with_suffix(".let")
    data = bytearray(path.read_bytes())
    data[100] ^= 1
    path.write_bytes(data)
    with pytest.raises(FormatError, match="samples sum to"):
        list(formats.trials(tmp_path))


# Moticon


def test_moticon_rows_that_are_missing_for_a_foot_are_missing_not_zero(tmp_path):
    write_moticon(tmp_path)
    left, right = formats.trials(tmp_path)
    assert (len(left.frames), len(right.frames)) == (199 - 11, 199)
    assert left.frames.t[0] == 100_000
    assert 600_000 not in left.frames.t
    assert 1_200_000 not in right.frames.t
    assert left.frames.values[left.frames.t == 610_000].min() == 2.5
    assert [list(left.truth[e]) for e in ("contact", "foot_off")] == [[500_000], [1_000_000]]
    assert left.series["total"].max() == 400


def test_moticon_reports_are_taken_where_they_are(tmp_path):
    write_moticon(tmp_path)
    (tmp_path / "steps.csv").write_text("recording,foot,contact_s,toe_off_s\n240101_000000,left,0.503,1.004\n")
    left, _ = formats.trials(tmp_path)
    assert [list(left.truth[e]) for e in ("contact", "foot_off")] == [[503_000], [1_004_000]]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda r: [*r[:20], r[20] + "\t", *r[21:]], "line 21: 54 cells, must have 53"),
        (lambda r: [*r[:20], r[20].replace("0.00\t", "\t", 1), *r[21:]], "line 21: .* is empty, other cells"),
        (lambda r: [*r[:20], r[20].replace("0.17", "0,17"), *r[21:]], "line 21: time has a decimal comma"),
        (lambda r: [r[0], r[1], r[2].replace("left pressure", "left force"), *r[3:]], "no column 'left pressure 1'"),
    ],
)
def test_a_spoilt_moticon_line_is_named(tmp_path, change, said):
    write_moticon(tmp_path, change)
    with pytest.raises(FormatError, match=f"240101_000000.txt, line \\d+.*{said}|{said}"):
        list(formats.trials(tmp_path))


# pedar


def test_pedar_gives_two_insoles_and_its_own_sum_as_truth(tmp_path):
    write_pedar(tmp_path)
    left, right = formats.trials(tmp_path)
    assert left.frames.values.shape == (200, 1, 5)
    assert left.frames.unit == "kPa"
    assert list(left.truth["contact"]) == [200_000, 700_000, 1_200_000, 1_700_000][: len(left.truth["contact"])]
    assert len(right.truth["contact"]) == len(right.truth["foot_off"])


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda r: [*r[:9], r[9] + "\t1.0", *r[10:]], "line 10: 12 cells, must have 11"),
        (lambda r: [*r[:9], r[9].replace(".", ","), *r[10:]], "line 10: time.secs. has a decimal comma"),
        (lambda r: [r[0], r[1].replace("100", "50"), *r[2:]], "line 7: 10000 us after the line before, at 50 Hz"),
        (lambda r: [r[0], *r[2:]], "no 'scanning rate"),
        (lambda r: [*r[:4], *r[5:]], "no line of column names"),
    ],
)
def test_a_spoilt_pedar_line_is_named(tmp_path, change, said):
    write_pedar(tmp_path, change)
    with pytest.raises(FormatError, match=f"walk.asc.*{said}"):
        list(formats.trials(tmp_path))


# the registry


def test_a_folder_of_no_or_of_several_formats_is_refused(tmp_path):
    with pytest.raises(FormatError, match="holds no known format"):
        list(formats.trials(tmp_path))
    write_pedar(tmp_path)
    write_gaitpdb(tmp_path)
    with pytest.raises(FormatError, match=r"several formats \(gaitpdb, pedar\)"):
        list(formats.trials(tmp_path))
    assert len(list(formats.trials(tmp_path, "pedar"))) == 2
    with pytest.raises(ProblemError, match="format is 'emed': must be one of"):
        list(formats.trials(tmp_path, "emed"))
    with pytest.raises(FileNotFoundError):
        list(formats.trials(tmp_path / "nothing"))


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: list(formats.trials(3)), "path is 3"),
        (lambda: list(plate.trials(None)), "path is None"),
        (lambda: list(gaitpdb.trials(3.5)), "path is 3.5"),
        (lambda: list(gaitndd.trials(b"")), "path is"),
        (lambda: list(moticon.trials([])), "path is"),
        (lambda: list(pedar.trials({})), "path is"),
        (lambda: gaitndd.step_times(3), "path is 3"),
        (lambda: gaitndd.format_212("text"), "data is 'text'"),
        (lambda: gaitpdb.contacts("text"), "total"),
        (lambda: pedar.contacts([[1.0], [2.0]]), "total"),
        (lambda: plate.sensor_rows(np.zeros((9, 4, 5))), "image has shape"),
        (lambda: plate.events(np.ones((9, 4))), "image has shape"),
        (lambda: plate.events("text"), "image"),
        (lambda: formats.Trial("a", "a", frames=3, truth={}, source=""), "frames is 3"),
    ],
)
def test_nonsense_in_an_argument_is_one_clear_error(call, said):
    with pytest.raises(ProblemError, match=said) as error:
        call()
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("write", [write_gaitpdb, write_moticon, write_pedar])
@given(at=st.integers(0, 3000), byte=st.integers(0, 255))
def test_one_changed_byte_never_crashes(write, tmp_path_factory, at, byte):
    folder = tmp_path_factory.mktemp("one_byte")
    file = write(folder)
    data = bytearray(file.read_bytes())
    data[at % len(data)] = byte
    file.write_bytes(data)
    kind = {write_gaitpdb: "gaitpdb", write_moticon: "moticon", write_pedar: "pedar"}[write]
    try:
        trials = list(formats.FORMATS[kind].trials(file))
    except FormatError as error:
        said = str(error)
    else:
        said = file.name if all(len(trial.frames) for trial in trials) else "a trial without a picture"
    assert file.name in said
    assert "\n" not in said


# the shared recordings


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


def test_derived_truth_equals_events_csv_of_gaitpdb(tmp_path):
    folder = shared("insole_gaitpdb")
    for file in gaitpdb.files(folder):
        (tmp_path / file.name).symlink_to(file)
    pairs = list(zip(gaitpdb.trials(tmp_path), gaitpdb.trials(folder), strict=True))
    assert len(pairs) == 48
    for derived, told in pairs:
        assert all(np.array_equal(derived.truth[e], told.truth[e]) for e in told.truth)


def test_gaitndd_has_the_strides_that_its_table_of_people_says():
    folder = shared("insole_gaitndd")
    people = {row["person"]: row for row in formats.text.table(folder / "people.csv", ["person"])}
    for trial in gaitndd.trials(folder):
        if trial.foot == "left":
            row = people[trial.person]
            assert len(trial.truth["foot_off"]) == int(row["reference_strides"])
            assert trial.truth["contact"][1] == round(float(row["reference_from_s"]) * 1e6)


def test_moticon_markers_and_reports_agree_within_6_ms(tmp_path):
    folder = shared("insole_moticon")
    for file in moticon.files(folder):
        (tmp_path / file.name).symlink_to(file)
    counts = []
    for marked, told in zip(moticon.trials(tmp_path), moticon.trials(folder), strict=True):
        for event in ("contact", "foot_off"):
            counts.append(len(told.truth[event]))
            assert np.abs(marked.truth[event] - told.truth[event]).max() <= 6500
    assert counts == [7, 7, 7, 7, 9, 9, 9, 9]


def test_pedar_contacts_are_the_rows_that_the_readme_lists():
    left, right = pedar.trials(shared("pressure_formats"))
    assert list(left.truth["contact"] // 10_000 - 1) == [343, 477, 603, 734, 859, 988, 1119, 1249, 1389]
    assert list(right.truth["contact"] // 10_000 - 1) == [406, 536, 665, 793, 922, 1056, 1181, 1320]
