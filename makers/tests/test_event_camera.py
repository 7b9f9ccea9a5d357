"""Files of event cameras: what faery reads is what decoders by hand read, and damage is named."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import numpy as np
import pytest
from formats.event_files import some_rows, write
from refusal import refused

import taxel
from taxel import Events, FormatError, Frames
from taxel._base.errors import Place
from taxel.cli import main
from taxel.formats.event_camera import Reduction
from taxel.tasks import Training
from taxel_makers import event_camera

pytest.importorskip("faery")


def rows_of(events: Events) -> np.ndarray:
    return np.stack([events.t, events.x.astype(int), events.y.astype(int), events.p.astype(int)], 1)


def counted(rows: np.ndarray, reduction: Reduction, size: tuple[int, int] = (64, 48)) -> np.ndarray:
    """Count events one after the other."""
    left, right, top, bottom = reduction.bounds(*size)
    side, window = reduction.bin or 1, reduction.window_us
    first = rows[0, 0] // window
    counts = np.zeros((rows[-1, 0] // window - first + 1, -(-(bottom - top) // side), -(-(right - left) // side)))
    for t, x, y, p in rows.tolist():
        if left <= x < right and top <= y < bottom and reduction.polarity in (None, "both", ("off", "on")[p]):
            counts[t // window - first, (y - top) // side, (x - left) // side] += 1
    return counts


@pytest.mark.parametrize("kind", ["evt2", "evt3", "dat2", "none", "lz4", "zstd"])
def test_what_faery_writes_is_read_back(kind: str, tmp_path: Path) -> None:
    rows = some_rows(9000, seed=3)
    ending = {"e": "raw", "d": "dat"}.get(kind[0], "aedat4")
    how = {"compression": None if kind == "none" else (kind, 1)} if ending == "aedat4" else {"version": kind}
    recording = taxel.open(write(tmp_path / f"a.{ending}", rows, **how))
    assert (rows_of(recording.events) == rows).all()
    assert (recording.array.shape, recording.kind) == ((48, 64), "event_camera")
    assert recording.events.intensity is None


@pytest.mark.parametrize(
    ("region", "side", "count_ms", "polarity"),
    [
        (None, None, 5, None),
        ("3:50,7:41", 1, 0.5, "both"),
        ("10:,:20", 4, 5, "on"),
        (None, 7, 1000, "off"),
    ],
)
def test_counts_are_those_of_events_one_after_the_other(
    region: str | None, side: int | None, count_ms: float, polarity: str | None, tmp_path: Path
) -> None:
    rows, reduction = some_rows(), Reduction(region, side, count_ms, polarity)
    path = write(tmp_path / "a.raw", rows)
    frames = taxel.open(path, region=region, bin=side, count_ms=count_ms, polarity=polarity).frames()
    assert (frames.values == counted(rows, reduction)).all()
    first = rows[0, 0] // reduction.window_us
    # The time of a frame is its begin: what is detected in it is known at its end.
    assert (frames.t == (first + np.arange(len(frames))) * reduction.window_us).all()
    chosen = {"on": "on ", "off": "off "}.get(polarity or "", "")
    assert frames.unit == f"{chosen}events/{count_ms:g} ms"
    assert frames.values.sum() == len(rows) or (region, polarity or "both") != (None, "both")


@pytest.mark.parametrize("count_ms", ["count_ms", "window_ms"])  # the second in older files
def test_the_layout_and_the_command_line_say_the_same(
    count_ms: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write(tmp_path / "a.raw", some_rows())
    given = taxel.open(path, region="0:32,0:32", bin=4, count_ms=5, polarity="on").frames()
    options = ["--region", "0:32,0:32", "--bin", "4", "--count-ms", "5", "--polarity", "on"]
    with pytest.raises(SystemExit, match="0"):
        main(["convert", str(path), str(tmp_path / "b.npz"), *options])
    (tmp_path / "a.layout.toml").write_text(
        f'[event_camera]\nregion = "0:32,0:32"\nbin = 4\n{count_ms} = 5\npolarity = "on"\n'
    )
    assert given == taxel.open(path).frames() == taxel.open(tmp_path / "b.npz").frames()
    # What is given comes before what the layout says.
    assert taxel.open(path, bin=8).array.shape == (4, 4)
    capsys.readouterr()


def test_a_table_named_dat_is_a_table(tmp_path: Path) -> None:
    path = tmp_path / "a.dat"
    path.write_text("% a comment of a table\n" + "".join(f"{k / 100:g} {k % 7} 0 0 0 0\n" for k in range(50)))
    assert not event_camera.knows(path)
    assert event_camera.knows(write(tmp_path / "b.dat", some_rows()))


def header(data: bytes) -> bytes:
    found = re.match(rb"(?:%[^\n]*\n)*", data)
    assert found is not None
    return found[0]


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("a.raw", lambda data: data.removeprefix(header(data))),
        ("a.dat", lambda data: data.removeprefix(header(data) + b"\x0c\x08")),
        ("a.raw", lambda data: b""),
        ("a.raw", header),
        ("a.raw", lambda data: header(data) + b"\x00\x80\x01\x60"),
        ("a.raw", lambda data: data.replace(b"64x48", b"").replace(b"EVT3;width=64;height=48", b"EVT3")),
        ("a.raw", lambda data: data.replace(b"64", b"16")),
    ],
)
def test_damage_is_named(name: str, change, tmp_path: Path) -> None:
    path = write(tmp_path / name, some_rows())
    path.write_bytes(change(path.read_bytes()))
    with pytest.raises(FormatError) as raised:
        taxel.open(path)
    assert str(path) in str(raised.value)
    assert "\n" not in str(raised.value)


def test_a_file_that_ends_anywhere_gives_whole_events_or_is_damaged(tmp_path: Path) -> None:
    rows = some_rows(9000)
    for path in (write(tmp_path / "a.aedat4", rows), write(tmp_path / "a.raw", rows)):
        data = path.read_bytes()
        for end in (0, 10, 16, 200, 700, 1000, len(data) // 2, len(data) - 1):
            path.write_bytes(data[:end])
            try:
                found = rows_of(taxel.open(path).events)
            except FormatError as error:
                assert str(path) in str(error)  # noqa: PT017
            else:
                assert (found == rows[: len(found)]).all()


def test_without_the_extra_one_line_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write(tmp_path / "a.raw", some_rows())
    monkeypatch.setitem(sys.modules, "faery", None)
    with pytest.raises(ImportError, match=r"needs faery, which is not installed: pip install 'taxel\[events\]'"):
        taxel.open(path)


def test_training_on_events_names_what_works_and_a_burst_is_learnt_from_counts(tmp_path: Path) -> None:
    rng, begins = np.random.default_rng(4), 1_000_000 + 400_000 * np.arange(12)
    noise = np.stack([rng.integers(0, 6_000_000, 600), *rng.integers(0, 48, (2, 600)), rng.integers(0, 2, 600)], 1)
    bursts = [
        np.stack([t + rng.integers(0, 15_000, 300), *rng.integers(10, 30, (2, 300)), rng.random(300) < 0.9], 1)
        for t in begins
    ]
    rows = np.concatenate([noise, *bursts]).astype(np.int64)
    path = write(tmp_path / "a.raw", rows[np.argsort(rows[:, 0], kind="stable")])
    labels = [{"contact": begins.tolist()}]
    with refused():
        taxel.train(taxel.open(path), labels)
    training = taxel.train(taxel.open(path, bin=4, count_ms=5), labels)
    assert training.score["contact"].found == 12
    assert any("recipe event_counts" in line for line in training.lines())
    frames = taxel.open(path, bin=4, count_ms=5).frames()
    assert len(taxel.detect.run(training.readout, frames, tare=taxel.Tare.take(frames, stop_us=500_000))) == 12
    with refused():
        taxel.detect.run(training.readout, taxel.open(path, bin=4, count_ms=2).frames())
    on = taxel.open(path, bin=4, count_ms=5, polarity="on").frames()
    for detector in (training.readout, taxel.detect.PlainRule("area", 2, unit="events/5 ms")):
        with refused():
            taxel.detect.run(detector, on, tare=taxel.Tare.take(on, stop_us=500_000))


def bursts(begins: np.ndarray, rates: np.ndarray, strengths: np.ndarray, seed: int) -> Frames:
    """Draw counts of these rates, and bursts of 4 frames at places that differ."""
    rng = np.random.default_rng(seed)
    for begin, strength in zip(begins, strengths, strict=True):
        row, column = rng.integers(2, 10, 2)
        rates[begin : begin + 4, row : row + 5, column : column + 5] += strength
    return Frames(rng.poisson(rates).astype(np.float32), np.arange(len(rates)) * 5000, unit="events/5 ms")


def trained(frames: Frames, begins: np.ndarray, folder: Path) -> Training:
    taxel.convert(frames, folder / "a.npz")
    return taxel.train(taxel.open(folder / "a.npz"), [{"jolt": (begins * 5000).tolist()}])


def test_weak_bursts_are_learnt_among_hot_pixels_and_noise_that_grows(tmp_path: Path) -> None:
    """Noise crossed levels of the area and sum of the whole array: 7 to 13 were found."""
    rates, begins = np.full((4000, 16, 20), 0.05) * np.linspace(1, 2, 4000)[:, None, None], np.arange(300, 3900, 150)
    rates[:, [1, 4, 7, 9, 12, 15], [3, 17, 9, 1, 12, 6]] += [7.0, 5.0, 3.0, 2.0, 1.0, 0.5]
    found = trained(bursts(begins, rates, np.full(24, 0.8), 5), begins, tmp_path).score["jolt"]
    assert found.found >= 22
    assert found.false <= 4


@pytest.mark.parametrize(
    ("argument", "options"),
    [
        ("region", {"region": "0:65,0:48"}),
        ("region", {"region": "1,2"}),
        ("bin", {"bin": 0}),
        ("bin", {"bin": 65}),
        ("bin", {"bin": 9, "region": "0:8,0:4"}),
        ("count_ms", {"count_ms": 0.0015}),
        ("count_ms", {"count_ms": 0}),
        ("polarity", {"polarity": "red"}),
    ],
)
def test_an_option_that_does_not_fit_is_refused_by_name(
    argument: str, options: dict[str, object], tmp_path: Path
) -> None:
    with refused(argument=argument):
        taxel.open(write(tmp_path / "a.raw", some_rows()), **options)


def test_the_options_are_of_events_without_intensities_alone(tmp_path: Path) -> None:
    taxel.convert(Frames(np.zeros((3, 2, 2)), [0, 10, 20]), tmp_path / "a.npz")
    one = {"array": taxel.Array(4, 4), "intensity": [7]}
    taxel.convert(Events([0], [0], [0], [True], **one), tmp_path / "b.npz")
    for place in (tmp_path / "a.npz", tmp_path, tmp_path / "b.npz"):
        with refused():
            taxel.open_all(place, bin=2)


@pytest.mark.parametrize("kind", ["table", "csv", "npz", "mcap"])
@pytest.mark.parametrize("count_ms", [None, 5])
def test_events_of_any_file_are_read_as_those_of_a_camera(kind: str, count_ms: float | None, tmp_path: Path) -> None:
    how = {"region": "3:50,7:41", "bin": 4, "count_ms": count_ms, "polarity": "on"}
    by_camera = taxel.open(write(tmp_path / "a.raw", some_rows()), **how)
    events = taxel.open(tmp_path / "a.raw").events
    if kind == "table":
        path = tmp_path / "b.csv"
        path.write_text("".join(f"{x},{y},{int(p)},{t}\n" for t, x, y, p, *_ in events))
        (tmp_path / "b.layout.toml").write_text(
            "rows = 48\ncolumns = 64\n[event_camera]\nbin = 7\n"
            '[table]\ncolumns = ["x", "y", "p", "t"]\ntime_column = "t"\ntime_unit = "us"\nevents = true\n'
        )
        assert taxel.open(path).array.shape == (7, 10), "the layout file says it too"
    else:
        path = tmp_path / f"b.{kind}"
        taxel.convert(events, path)
        how["array"] = None if kind == "mcap" else taxel.Array(48, 64)
    read = taxel.open(path, **how)
    if count_ms is None:
        assert (rows_of(read.events) == rows_of(by_camera.events)).all()
        assert read.array.shape == by_camera.array.shape
    else:
        frames, counts = read.frames(), by_camera.frames()
        assert (frames.values == counts.values).all()
        assert (frames.t == counts.t).all()
        assert frames.unit == counts.unit


def test_the_size_that_a_header_lacks_is_given_or_in_a_layout(tmp_path: Path) -> None:
    file = write(tmp_path / "a.raw", some_rows())
    whole = taxel.open(file).events
    data = file.read_bytes()
    lines = [line for line in header(data).splitlines(keepends=True) if b"eometry" not in line]
    bare = b"".join(line.split(b";")[0].rstrip() + b"\n" for line in lines)
    file.write_bytes(bare + data.removeprefix(header(data)))
    with refused(FormatError, argument="array", place=Place("a.raw")):
        taxel.open(file)
    assert taxel.open(file, array=taxel.Array(*whole.array.shape)).events.t.tolist() == whole.t.tolist()
    rows, columns = whole.array.shape
    (tmp_path / "a.layout.toml").write_text(f"rows = {rows}\ncolumns = {columns}\n")
    assert taxel.open(file).events.x.tolist() == whole.x.tolist()
