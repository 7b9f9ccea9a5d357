"""What is not read of a file of arrays: values of other files, objects, and more than there is memory for."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from refusal import refused

import taxel
from taxel import FormatError
from taxel._base import limits
from taxel._base.arrays import datasets, hdf5, read_arrays, shapes
from taxel._base.errors import Place

from .making import record, some_events

LAYOUT = '[data]\narray = "run/pressure"\n'


def external_storage(h5: h5py.File, other: Path) -> str:
    h5.create_dataset("run/a", (4,), "f8", external=[(str(other), 0, 32)])
    return "run/a"


def virtual(h5: h5py.File, other: Path) -> str:
    layout = h5py.VirtualLayout((4,), "f8")
    layout[:] = h5py.VirtualSource(str(other), "secret", (4,))
    h5.create_virtual_dataset("run/b", layout)
    return "run/b"


def external_link(h5: h5py.File, other: Path) -> str:
    h5["run/c"] = h5py.ExternalLink(str(other), "secret")
    return "run/c"


def external_link_behind_a_soft_one(h5: h5py.File, other: Path) -> str:
    external_link(h5, other)
    h5["run/d"] = h5py.SoftLink("/run/c")
    return "run/c"


def foreign(path: Path) -> Callable[[Path], Any]:
    with h5py.File(path, "w") as h5:
        h5["run/pressure"] = np.ones((5, 2, 3))
    path.with_suffix(".layout.toml").write_text(LAYOUT)
    return taxel.open


def own(path: Path) -> Callable[[Path], Any]:
    taxel.convert(some_events(5), path)
    return taxel.open


@pytest.mark.parametrize("way", [external_storage, virtual, external_link, external_link_behind_a_soft_one])
@pytest.mark.parametrize("make", [foreign, own])
def test_a_file_that_refers_to_another_one_is_refused_by_name(
    make: Callable[[Path], Callable[[Path], Any]], way: Callable[[h5py.File, Path], str], tmp_path: Path
) -> None:
    path, other = tmp_path / "a.h5", tmp_path / "other.h5"
    with h5py.File(other, "w") as h5:
        h5["secret"] = np.arange(4.0)
    read = make(path)
    read(path)
    with h5py.File(path, "a") as h5:
        name = way(h5, other)
    with refused(FormatError, place=Place("a.h5")) as caught:
        read(path)
    assert caught.value.args[0].startswith(f"{name}: ")


def test_a_data_set_may_be_a_virtual_one_over_its_own_file_and_soft_links_lead_where_they_say(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as h5:
        h5["run/pressure"] = np.arange(4.0)
        layout = h5py.VirtualLayout((4,), "f8")
        layout[:] = h5py.VirtualSource(".", "run/pressure", (4,))
        h5.create_virtual_dataset("same", layout)
        h5["soft"] = h5py.SoftLink("/run/pressure")
        h5["nowhere"], h5["circle"] = h5py.SoftLink("/none"), h5py.SoftLink("/circle")
        h5["run/root"] = h5["/"]
    with hdf5(path) as h5:
        assert set(datasets(h5)) == {"run/pressure", "same", "soft"}
    for name, values in read_arrays(path, ["run/pressure", "same", "soft"]).items():
        assert np.array_equal(values, np.arange(4.0)), name


@pytest.mark.parametrize("values", [np.array([1, "x"], object), np.zeros(3, "M8[s]"), np.zeros(3, complex)])
@pytest.mark.parametrize("ending", [".npy", ".npz"])
def test_only_numbers_are_read_and_no_object_is_made(ending: str, values: Any, tmp_path: Path) -> None:
    path = tmp_path / f"a{ending}"
    save: Any = np.save if ending == ".npy" else np.savez
    save(path, values)
    with refused(FormatError, place=Place(path.name)):
        read_arrays(path, shapes(path) or ["", "arr_0"], {"": np.float32, "arr_0": np.float32})
    path.with_suffix(".layout.toml").write_text("rate_hz = 10\n")
    with pytest.raises(FormatError):
        taxel.open(path)


def huge_npz(path: Path) -> None:
    np.savez_compressed(path, pressure=np.zeros((1 << 18, 4, 4)))


def huge_h5(path: Path) -> None:
    with h5py.File(path, "w") as h5:
        h5.create_dataset("pressure", (1 << 40, 4, 4), "f8", chunks=(1024, 4, 4))


def huge_npy(path: Path) -> None:
    with path.open("wb") as file:
        shape = {"descr": "<f8", "fortran_order": False, "shape": (1 << 40, 4, 4)}
        np.lib.format.write_array_header_1_0(file, shape)


@pytest.mark.parametrize(("name", "write"), [("a.npz", huge_npz), ("a.h5", huge_h5), ("a.npy", huge_npy)])
def test_an_array_larger_than_the_memory_is_refused_with_both_sizes(
    name: str, write: Callable[[Path], None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(limits, "available", lambda: (1 << 24) + 1)
    write(tmp_path / name)
    (tmp_path / "layout.toml").write_text("rate_hz = 10\n")
    with refused(FormatError, place=Place(name)) as caught:
        taxel.open(tmp_path / name)
    size, there = map(int, re.findall(r"\d+", caught.value.args[0]))
    assert size > there == 16_777_217


@pytest.mark.parametrize("ending", [".mcap", ".lsa"])
def test_a_recording_larger_than_the_memory_is_refused_with_both_sizes(
    ending: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    record(tmp_path / "a.mcap", some_events(5000))
    path = tmp_path / f"a{ending}"
    if ending == ".lsa":
        taxel.convert(tmp_path / "a.mcap", path)
    for reader in ("mcap", "lsa"):
        monkeypatch.setattr(f"taxel.recording.readers.{reader}.available", lambda: 1000)
    with pytest.raises(FormatError) as caught:
        len(taxel.open(path).events)
    assert caught.value.place == Place(str(path))
    size, there = map(int, re.findall(r"\d+", caught.value.args[0]))
    assert size > there == 1000


def test_what_is_available_is_that_of_the_machine_and_of_the_control_group(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    machine = limits.psutil.virtual_memory().available
    assert 0 < limits.available() < 2 * machine
    texts = {"/proc/self/cgroup": "0::/one.scope\n", "/sys/fs/cgroup/one.scope/memory.max": "4096\n"}
    monkeypatch.setattr(limits.Path, "read_text", lambda path: texts[str(path)])
    assert limits.available() == 4096
    texts["/sys/fs/cgroup/one.scope/memory.max"] = "max\n"
    assert limits.available() > 4096


@pytest.mark.parametrize(
    ("column", "value"), [("t", 0.5), ("x", 65_536), ("y", -1), ("x", np.nan), ("p", 2), ("intensity", 1e300)]
)
@pytest.mark.parametrize("kind", ["npz", "h5"])
def test_a_value_that_a_column_of_events_does_not_hold_is_refused_with_its_place(
    column: str, value: float, kind: str, tmp_path: Path
) -> None:
    columns = {"t": np.arange(200.0), **{name: np.ones(200) for name in ("x", "y", "p", "intensity", "present")}}
    columns[column][149] = value
    path = tmp_path / f"a.{kind}"
    if kind == "npz":
        np.savez(path, **columns)
    else:
        with h5py.File(path, "w") as h5:
            h5.attrs["taxel"] = 1
            for name, values in columns.items():
                h5[name] = values
    with refused(FormatError, place=Place(path.name)) as caught:
        taxel.open(path)
    assert f"{column}[149]" in caught.value.args[0]
