"""What holds for every format: the laws run over the registry."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from refusal import refused_saying as refused

import taxel
from taxel import FormatError, ProblemError, formats
from taxel.cli import main
from taxel.formats import gaitndd, gaitpdb, moticon, pedar, plate

from . import making
from .making import write_gaitpdb, write_moticon, write_pedar


def test_a_folder_of_no_or_of_several_formats_is_refused(tmp_path):
    with pytest.raises(FormatError, match="contains no known format"):
        list(formats.trials(tmp_path))
    write_pedar(tmp_path)
    write_gaitpdb(tmp_path)
    with pytest.raises(FormatError, match=r"several formats \(gaitpdb, pedar\)"):
        list(formats.trials(tmp_path))
    with pytest.raises(FormatError, match=r"several formats \(gaitpdb, pedar\): name one file"):
        taxel.open_all(tmp_path)
    assert len(list(formats.trials(tmp_path, "pedar"))) == 2


def test_the_folder_that_one_is_in_opens_by_a_dot(tmp_path, monkeypatch):
    (tmp_path / "trials").mkdir()
    write_pedar(tmp_path / "trials")
    monkeypatch.chdir(tmp_path / "trials")
    names = [one.name for one in taxel.open_all(tmp_path / "trials")]
    for place in (".", "./", Path()):
        assert [one.name for one in taxel.open_all(place)] == names
    (tmp_path / "trials" / "deeper").mkdir()
    monkeypatch.chdir(tmp_path / "trials" / "deeper")
    assert [one.name for one in taxel.open_all("..")] == names


def test_a_format_is_one_that_there_is(tmp_path):
    write_pedar(tmp_path)
    with pytest.raises(ProblemError, match="format is 'zebris': must be one of"):
        list(formats.trials(tmp_path, "zebris"))
    with pytest.raises(FileNotFoundError):
        list(formats.trials(tmp_path / "nothing"))


@pytest.mark.skipif(not Path("/proc/self/io").exists(), reason="counts bytes read as Linux does")
@pytest.mark.parametrize("ending", ["csv", "txt", "asc", "asf", "lst", "h5", "npz"])
def test_a_large_file_is_recognised_by_its_beginning(ending, tmp_path):
    """The panel recognises a file before it serves its page."""
    file = tmp_path / f"hour.{ending}"
    file.write_bytes(b"t_us,x0y0\n" + b"1000,2\n" * 4_000_000)

    def read() -> int:
        return int(Path("/proc/self/io").read_text().split()[1])

    before = read()
    assert [name for name, kind in formats.FORMATS.items() if kind.files(file)] == []
    assert read() - before < 1 << 20


@pytest.mark.parametrize("write", [making.write_pedar, making.write_emed, making.write_tekscan])
def test_an_ending_in_capitals_is_the_same_ending(write, tmp_path):
    """Programs of Windows and before write WALK.ASC."""
    file = write(tmp_path)
    plain = [trial.recorded for trial in formats.trials(file)]
    file = file.rename(tmp_path / file.name.upper())
    assert [trial.recorded for trial in formats.trials(file)] == plain
    assert [trial.recorded for trial in formats.trials(tmp_path)] == plain


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
        (lambda: formats.Trial("a", "a", recorded=3, truth={}, source=""), "recorded is 3"),
    ],
)
def test_nonsense_in_an_argument_is_one_clear_error(call, said):
    with refused(said):
        call()


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
        said = file.name if all(len(trial.frames) for trial in trials) else "a trial without a frame"
    assert file.name in said
    assert "\n" not in said


def made(name: str, folder: Path) -> Path:
    """Write a small file of a format."""
    return getattr(making, f"write_{name}")(folder)


@pytest.mark.parametrize("name", formats.FORMATS)
def test_every_format_has_tests_of_its_own_and_a_maker_of_small_files(name: str) -> None:
    """A format without them cannot be told from one that is broken."""
    assert (Path(__file__).parent / f"test_{name}.py").exists(), f"add tests/formats/test_{name}.py"
    assert hasattr(making, f"write_{name}"), f"add write_{name} to tests/formats/making.py"
    assert len(formats.FORMATS[name].about) > 20, f"the first line of taxel/formats/{name}.py says what it reads"


def test_every_module_of_a_format_is_registered() -> None:
    folder = Path(formats.__file__).parent
    shared_by_all = {"__init__", "checks", "layout", "layout_text", "text", "trial", "array_file", "column_names"}
    shared_by_all |= {"foreign", "lines", "table", "table_form", "table_text", "times", "xdf"}
    missing = {p.stem for p in folder.glob("*.py")} - shared_by_all - set(formats.FORMATS)
    assert not missing, f"taxel/formats/__init__.py: FORMATS lacks {', '.join(sorted(missing))}"


@pytest.mark.parametrize("name", formats.FORMATS)
def test_a_file_is_known_by_one_format_only_and_reads_the_same_however_it_is_asked_for(
    name: str, tmp_path: Path
) -> None:
    path = made(name, tmp_path)
    assert [n for n, kind in formats.FORMATS.items() if kind.files(tmp_path)] == [name]
    assert path in formats.FORMATS[name].files(tmp_path)
    every = [list(formats.trials(place, kind)) for place in (tmp_path, path) for kind in (None, name)]
    assert len(every[0]) > 0
    for trials in every[1:]:
        for a, b in zip(every[0], trials, strict=True):
            assert (a.name, a.recorded) == (b.name, b.recorded)
            assert {e: list(t) for e, t in a.truth.items()} == {e: list(t) for e, t in b.truth.items()}


@pytest.mark.parametrize("name", formats.FORMATS)
def test_a_trial_has_a_name_of_its_own_and_its_truth_lies_within_it(name: str, tmp_path: Path) -> None:
    made(name, tmp_path)
    trials = list(formats.trials(tmp_path))
    assert len({t.name for t in trials}) == len(trials)
    for trial in trials:
        t = trial.recorded.t
        margin = formats.trial.MARGIN_US + int(np.diff(t).max())
        for event, times in trial.truth.items():
            assert trial.source, f"{trial.name}: {event} without a source"
            assert ((times >= t.min() - margin) & (times <= t.max() + margin)).all()


@pytest.mark.parametrize("name", formats.FORMATS)
def test_a_trial_survives_our_own_kinds_of_file(name: str, tmp_path: Path) -> None:
    made(name, tmp_path)
    trial = next(iter(formats.trials(tmp_path)))
    taxel.convert(trial.recorded, tmp_path / "a.npz")
    rec = taxel.open(tmp_path / "a.npz")
    assert (rec.events if rec.has_events else rec.frames()) == trial.recorded


@pytest.mark.parametrize("name", formats.FORMATS)
@pytest.mark.parametrize("path", [3, None, 3.5, b"", [], {}, "a\0b"])
def test_nonsense_for_a_path_is_one_clear_error(name: str, path: object) -> None:
    with refused("path is"):
        list(formats.FORMATS[name].trials(path))


@pytest.mark.parametrize("name", formats.FORMATS)
def test_a_folder_without_its_files_is_a_format_error(name: str, tmp_path: Path) -> None:
    with pytest.raises(FormatError, match=str(tmp_path)):
        list(formats.FORMATS[name].trials(tmp_path))


def test_a_trial_may_hold_events_as_well_as_frames() -> None:
    events = taxel.Events([0, 300], [1, 2], [0, 0], [True, False], array=taxel.Array(1, 3))
    trial = formats.Trial("a", "a", events, {"contact": np.array([0])}, "made here")
    assert trial.events is events
    assert trial.scored == (0, 300)
    with pytest.raises(ProblemError, match="contains events and no frames"):
        _ = trial.frames


@pytest.mark.parametrize("name", formats.FORMATS)
def test_the_command_line_says_what_is_in_it_trial_by_trial(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A trial's name may hold what a file's may not."""
    file = made(name, tmp_path)
    for place in (file, tmp_path):
        with pytest.raises(SystemExit) as ended:
            main(["info", str(place), "--json"])
        said = capsys.readouterr()
        assert not ended.value.code, said.err
        every = json.loads(said.out)
        every = every if isinstance(every, list) else [every]
        trials = list(formats.trials(place))
        assert len({one["file"] for one in every}) == len(every) == len(trials)
        assert {one["kind"] for one in every} == {name}
        assert all(one["file"].startswith(str(place)) for one in every)
    assert taxel.open_all(tmp_path)[0].verdict == f"losses unknown: the {name} recording does not record them"
