"""What a path is: whoever asks (opening, a folder, a command, the page) gets the same answer."""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import EntryPoint
from pathlib import Path

import numpy as np
import pytest
from formats import bags, making
from refusal import refused
from shell import call

import taxel
from taxel import FormatError
from taxel._base.errors import Place
from taxel.formats.layout import Layout
from taxel.reading import Facts, InMemory, Reader
from taxel.recording.kinds import _from_elsewhere, check_recording, is_recording, kind_of, recordings_in

from .making import some_events, some_frames

Write = Callable[[Path], Path]


def of_taxel(name: str, *, frames: bool = False) -> Write:
    def write(folder: Path) -> Path:
        taxel.convert(some_frames() if frames else some_events(), folder / name)
        return folder / name

    return write


def without_ending(folder: Path) -> Path:
    return of_taxel("walk.mcap")(folder).rename(folder / "walk")


def bag(name: str) -> Write:
    return lambda folder: bags.write(folder / name, [("/palm", bags.PALM, 2.0, 0.0, bags.palm(np.zeros(768)))])


def content(name: str, data: str | bytes) -> Write:
    def write(folder: Path) -> Path:
        (folder / name).write_bytes(data.encode() if isinstance(data, str) else data)
        return folder / name

    return write


def arrays(name: str, **stored: np.ndarray) -> Write:
    def write(folder: Path) -> Path:
        np.savez(folder / name, **stored)
        return folder / name

    return write


def spikes(folder: Path) -> Path:
    return taxel.SpikeTrains.from_lists([[1.0], [2.0]], 0, 50).save(folder / "spikes.npz")


def described(write: Write) -> Write:
    def with_layout(folder: Path) -> Path:
        (folder / "layout.toml").write_text("rows = 1\ncolumns = 3\nrate_hz = 100\n")
        return write(folder)

    return with_layout


TABLE = "1,2,3\n" * 30
MADE = ("moticon", "pedar", "emed", "tekscan", "event_camera")
PLAIN = {"t": np.arange(4), "values": np.ones((4, 1, 3), np.float32)}
OTHERS = {"a": np.ones((4, 3))}
FILES: dict[str, tuple[Write, str | None]] = {
    **{kind: (of_taxel(f"walk.{kind}"), kind) for kind in ("mcap", "lsa", "npz", "csv", "h5")},
    **{f"frames {kind}": (of_taxel(f"walk.{kind}", frames=True), kind) for kind in ("mcap", "npz", "h5")},
    "without an ending": (without_ending, "mcap"),
    "plain columns": (arrays("a.npz", **PLAIN), "npz"),
    "damaged archive": (content("a.npz", b"PK\x03\x04 and no more"), "npz"),
    **{name: (getattr(making, f"write_{name}"), name) for name in MADE},
    **{f"bag {name}": (bag(name), "ros") for name in ("grasp.bag", "grasp.db3", "grasp.mcap", "grasp")},
    **{f"table {ending}": (content(f"a{ending}", TABLE), "table") for ending in (".csv", ".txt", ".dat")},
    "table with a layout": (described(content("a.csv", TABLE)), "table"),
    "arrays": (arrays("a.npz", **OTHERS), "arrays"),
    "arrays with a layout": (described(arrays("a.npz", **OTHERS)), "arrays"),
    "packed table": (content("a.csv", b"\x1f\x8b\x08\x00"), "table"),
    "prose": (content("a.txt", "of a hand\n"), "table"),
    "labels": (content("a.csv", "label,t_us\nheel,5\n"), None),
    "labels whose times come first": (content("a.csv", "t_us,label\n5,heel\n"), None),
    "no labels": (content("a.notes.csv", ""), None),
    "spike trains": (spikes, None),
    "picture": (content("a.mcap", b"\x89PNG\r\n\x1a\n"), "mcap"),
    "program": (content("a.py", "import taxel\n"), None),
    "empty": (content("a.npz", b""), "npz"),
}


def why(call: Callable[[], object]) -> str | None:
    """Return the text of the error of a format that a call raises."""
    try:
        call()
    except FormatError as error:
        return str(error)
    return None


@pytest.mark.parametrize("name", FILES)
def test_a_path_is_the_same_for_whoever_asks(name: str, tmp_path: Path) -> None:
    write, expected = FILES[name]
    path = write(tmp_path)
    assert kind_of(path) == expected
    refused = why(lambda: check_recording(path))
    # A file that is damaged is one, and so is a table that can be read in two ways; opening it says what is wrong.
    is_one = name in ("picture", "empty") or expected in ("table", "arrays")
    assert is_recording(path) == (refused is None or is_one)
    if refused is not None:
        assert why(lambda: taxel.open_all(path)) == refused
        assert path not in recordings_in(path.parent) or is_one


def test_a_folder_leaves_out_what_is_of_others_whatever_its_ending(tmp_path: Path) -> None:
    own = of_taxel("walk.npz", frames=True)(tmp_path)
    spikes(tmp_path)
    arrays("others.npz", **OTHERS)(tmp_path)
    content("people.csv", "t_us,label\n5,heel\n")(tmp_path)
    content("table.csv", TABLE)(tmp_path)
    grasp = bag("grasp.mcap")(tmp_path)
    assert [recording.path for recording in taxel.open_all(tmp_path)] == [own]
    assert recordings_in(tmp_path) == [own, grasp]
    (tmp_path / "others.layout.toml").write_text("rows = 1\ncolumns = 3\nrate_hz = 100\n")
    assert [recording.path for recording in taxel.open_all(tmp_path)] == [own]


@pytest.mark.parametrize(("write", "says"), [(spikes, "spike trains"), (arrays("a.npz", **OTHERS), "is the time")])
def test_a_folder_that_holds_nothing_else_says_what_it_is(write: Write, says: str, tmp_path: Path) -> None:
    path = write(tmp_path)
    refused = why(lambda: taxel.open_all(tmp_path))
    assert refused == why(lambda: taxel.open(path))
    assert says in str(refused)


@pytest.mark.parametrize("name", ["grasp.bag", "grasp.db3", "grasp.mcap", "grasp"])
def test_a_bag_without_its_reader_names_what_to_install(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("taxel.recording.kinds._from_elsewhere", dict)
    path = bag(name)(tmp_path)
    with refused(FormatError, place=Place(name)) as caught:
        taxel.open(path, topic="/palm")
    assert "pip install 'taxel[makers,ros]'" in str(caught.value)
    assert not is_recording(path)
    assert call(capsys, "info", path)[0] == 2


class Distribution:
    """A format of another distribution: files that end in .grasp, with a frame of two values a byte."""

    @staticmethod
    def knows(path: Path) -> bool:
        return path.suffix == ".grasp"

    @staticmethod
    def read(path: Path, layout: Layout | None) -> list[Reader]:  # noqa: ARG004  the size follows from the layout
        values = np.frombuffer(path.read_bytes(), np.uint8).astype(np.float32).reshape(-1, 1, 2)
        frames = taxel.Frames(values, np.arange(len(values)) * 1000, unit="N")
        return [InMemory(Facts(path=path, array=frames.array, kind="grasp", name=name), frames) for name in "ab"]


def test_a_format_of_another_distribution_is_opened_as_any_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("taxel.recording.kinds._from_elsewhere", lambda: {"grasp": Distribution()})
    path = content("one.grasp", b"\x01\x02\x03\x04")(tmp_path)
    (tmp_path / "one.layout.toml").write_text("rows = 2\ncolumns = 1\n")
    assert recordings_in(tmp_path) == [path]
    first, second = taxel.open_all(tmp_path)
    assert [first.name, second.name, first.kind] == ["a", "b", "grasp"]
    assert first.frames().values.tolist() == [[[1.0], [2.0]], [[3.0], [4.0]]]


def test_a_format_that_does_not_load_is_said_and_taxel_reads_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    points = [EntryPoint("broken", "not_there", "taxel.formats")]
    monkeypatch.setattr("taxel.recording.kinds.entry_points", lambda group: points)
    _from_elsewhere.cache_clear()
    with pytest.warns(UserWarning, match="format broken are not read, as not_there does not load: No module"):
        assert kind_of(content("a.csv", TABLE)(tmp_path)) == "table"
    _from_elsewhere.cache_clear()
