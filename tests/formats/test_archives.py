"""One reader for all archives: whatever happens to a .npz, opening it is one clear error or works."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import taxel
from taxel._base.archive import read_arrays, stored_names
from taxel._core import FormatError


def spikes(path: Path) -> None:
    trains = [np.sort(np.random.default_rng(k).random(40)) for k in range(5)]
    taxel.SpikeTrains.from_lists(trains).save(path)


def poses(path: Path) -> None:
    readings = np.random.default_rng(1).integers(0, 200, (3, 2, 8, 6)).astype(np.uint8)
    np.savez_compressed(path, readings=readings, pose=np.array(["left1", "prone2_1", "right3"]))


def table(path: Path) -> None:
    draw = np.random.default_rng(2)
    t, x, y = np.sort(draw.integers(0, 9999, 300)), draw.integers(0, 8, 300), draw.integers(0, 8, 300)
    events = taxel.Events(t, x, y, draw.random(300) < 0.5, array=taxel.Array(8, 8), intensity=draw.integers(0, 9, 300))
    taxel.convert(events, path)


KINDS: dict[str, tuple[Callable[[Path], None], Callable[[Path], object]]] = {
    "spikes": (spikes, taxel.SpikeTrains.load),
    "poses": (poses, lambda path: [t.frames for t in taxel.formats.FORMATS["popu"].trials(path)]),
    "table": (table, lambda path: taxel.open(path).events),
}


@pytest.mark.parametrize("kind", KINDS)
def test_hundreds_of_damaged_archives_are_one_error_each_or_read(tmp_path: Path, kind: str) -> None:
    write, read = KINDS[kind]
    path = tmp_path / "a.npz"
    refused: list[str] = []
    write(path)
    read(path)
    whole, draw = path.read_bytes(), np.random.default_rng(7)
    # Compression methods, versions and flags stand behind each of these.
    heads = [k for magic in (b"PK\x01\x02", b"PK\x03\x04", b"PK\x05\x06") for k in places(whole, magic)]
    for k in range(800):
        data = bytearray(whole)
        for _ in range(int(draw.integers(1, 4))):
            near = int(draw.choice(heads)) + int(draw.integers(4, 30)) if k % 2 else int(draw.integers(0, len(data)))
            data[min(near, len(data) - 1)] = int(draw.integers(0, 256))
        if k % 5 == 0:
            data = data[: int(draw.integers(0, len(data)))]
        path.write_bytes(data)
        try:
            read(path)
        except FormatError as error:
            refused.append(str(error))
    assert len(refused) > 300
    assert not any("\n" in said for said in refused)


def places(data: bytes, what: bytes) -> list[int]:
    found, at = [], data.find(what)
    while at >= 0:
        found.append(at)
        at = data.find(what, at + 1)
    return found


def test_only_what_is_wanted_is_read_and_a_name_that_is_missing_is_left_out(tmp_path: Path) -> None:
    place = tmp_path / "two.npz"
    np.savez(place, t=[1, 2], strange=np.array([object()]))
    assert stored_names(place) == ("t", "strange")
    assert list(read_arrays(place, ["t", "y"])) == ["t"]
    with pytest.raises(FormatError, match="array strange: contains Python objects"):
        read_arrays(place, ["strange"])
    assert stored_names(tmp_path / "none.npz") == ()
    with pytest.raises(FileNotFoundError):
        read_arrays(tmp_path / "none.npz", ["t"])
