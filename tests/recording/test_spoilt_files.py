"""A spoilt file of any kind gives an answer or one `taxel.Error` of one line."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from formats import bags
from formats import making as other
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.io import savemat

import taxel

from .making import record, some_events, some_frames

#: Numbers at the ends of their ranges, of which a damaged file may hold the first bytes.
EXTREMES = [b"\xff" * 8, b"\x7f" + b"\xff" * 7, b"\xff" * 7 + b"\x7f", bytes(8), b"\x80" + bytes(7)]
ARRAYS = {"pressure": np.ones((50, 4, 5)), "seconds": np.arange(50) / 100}
LAYOUT = '[data]\narray = "pressure"\ntime = "seconds"\n'


def converted(name: str) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        taxel.convert(some_frames() if "frames" in name else some_events(), folder / name)
        return folder / name

    return make


def of_arrays(name: str, write: Callable[[Path], object]) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        write(folder / name)
        (folder / "layout.toml").write_text(LAYOUT)
        return folder / name

    return make


def raw(folder: Path) -> Path:
    record(folder / "walk.mcap", some_events())
    taxel.convert(folder / "walk.mcap", folder / "walk.lsa")
    return folder / "walk.lsa"


def table(folder: Path) -> Path:
    rows = (f"{k / 100:g};{k % 7};{k % 5}\n" for k in range(50))
    (folder / "press.txt").write_text("time;thumb;index\n" + "".join(rows))
    (folder / "press.layout.toml").write_text('[table]\nseparator = ";"\ntime_column = "time"\n')
    return folder / "press.txt"


def bag(name: str) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        rng = np.random.default_rng(9)
        sent = [("/palm", bags.PALM, 10 * k + 2, 10 * k, bags.palm(rng.integers(0, 99, 768))) for k in range(12)]
        bags.write(folder / name, sent)
        (folder / "layout.toml").write_text('rows = 24\ncolumns = 32\n[ros]\ntopic = "/palm"\n')
        return folder / name

    return make


#: By kind of file, a function that writes a whole one into a folder.
KINDS: dict[str, Callable[[Path], Path]] = {
    **{name: converted(name) for name in ("a.mcap", "frames.mcap", "a.npz", "frames.npz", "a.csv", "frames.csv")},
    "lsa": raw,
    "arrays.npz": of_arrays("arrays.npz", lambda path: np.savez(path, **ARRAYS)),
    "table": table,
    **{name: bag(name) for name in ("a.bag", "a.db3", "bag.mcap")},
    # Files of event cameras are below.
    **{name: getattr(other, f"write_{name}") for name in ("moticon", "pedar", "emed", "tekscan")},
}
#: Those at which a library may crash: where they are damaged is the same in each run.
FIXED: dict[str, Callable[[Path], Path]] = {
    "a.h5": converted("a.h5"),
    "arrays.h5": of_arrays("arrays.h5", lambda path: write_h5(path, ARRAYS)),
    "arrays.mat": of_arrays("arrays.mat", lambda path: savemat(path, ARRAYS)),
    "event_camera": other.write_event_camera,
}


def write_h5(path: Path, arrays: dict[str, Any]) -> None:
    with h5py.File(path, "w") as file:
        for name, values in arrays.items():
            file[name] = values


def spoil_bytes(rng: np.random.Generator, data: bytes) -> bytes:
    """Flip, cut, put in, take out, repeat, or write an extreme number."""
    spoilt = bytearray(data)
    for _ in range(int(rng.integers(1, 5))):
        at, n = int(rng.integers(0, len(spoilt) + 1)), int(rng.integers(1, 64))
        way = rng.integers(0, 6)
        if way == 0 and at < len(spoilt):
            spoilt[at] ^= int(rng.integers(1, 256))
        elif way == 1:
            del spoilt[at:]
        elif way == 2:
            spoilt[at:at] = rng.integers(0, 256, n, dtype=np.uint8).tobytes()
        elif way == 3:
            del spoilt[at : at + n * int(rng.integers(1, 20))]
        elif way == 4:
            spoilt[at:at] = spoilt[at : at + n * 20]
        else:
            extreme = EXTREMES[int(rng.integers(len(EXTREMES)))][: int(rng.choice([1, 2, 4, 8]))]
            spoilt[at : at + len(extreme)] = extreme
    return bytes(spoilt)


def read(path: Path) -> None:
    """Read all that a file holds."""
    for recording in taxel.open_all(path):
        for source in recording._sources.values():
            assert len(source.table.t) >= 0
        assert recording.verdict
        assert list(recording.notes) is not None


def refusal(path: Path) -> str:
    """Return what an error says that reading a file ends with; "" if there is none, or it gives lines to copy."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            read(path)
    except taxel.Error as error:
        return str(error) if len(error.args) == 1 else ""
    return ""


@pytest.fixture(scope="module", params=KINDS)
def whole(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, bytes]:
    """A whole file, which is read, and its bytes."""
    path = KINDS[request.param](tmp_path_factory.mktemp("spoilt"))
    read(path)
    return path, path.read_bytes()


@settings(deadline=None)
@given(seed=st.integers(0, 1 << 32))
def test_a_spoilt_file_is_read_or_refused(whole: tuple[Path, bytes], seed: int) -> None:
    path, data = whole
    path.write_bytes(spoil_bytes(np.random.default_rng(seed), data))
    assert "\n" not in refusal(path)


@pytest.mark.parametrize("kind", FIXED)
def test_a_file_that_is_cut_or_begins_wrong_is_read_or_refused(kind: str, tmp_path: Path) -> None:
    if kind == "event_camera":
        pytest.importorskip("faery")
    path = FIXED[kind](tmp_path)
    data = path.read_bytes()
    read(path)
    for end in (0, 1, 7, len(data) // 4, len(data) // 2, len(data) - 1):
        path.write_bytes(data[:end])
        assert "\n" not in refusal(path)
    path.write_bytes(b"\0" * 64 + data[64:])
    assert "\n" not in refusal(path)
