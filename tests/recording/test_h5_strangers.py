"""A .h5 of a stranger reads no other file, follows no link in circles, and takes no more memory than its arrays."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from refusal import refused_saying as refused

import taxel
from taxel import SpikeTrains
from taxel._base import h5_child, h5_file, limits
from taxel._base.h5_file import H5File
from taxel._core import FormatError

from .making import some_events, some_frames

ENCODER = taxel.encode.LevelCrossing(levels=(50.0,))


def own(path: Path) -> Callable[[Path], object]:
    taxel.convert(some_events(200), path, overwrite=True)
    return taxel.open


def own_frames(path: Path) -> Callable[[Path], object]:
    taxel.convert(some_frames(), path, overwrite=True)
    return taxel.open


def foreign(path: Path) -> Callable[[Path], object]:
    with h5py.File(path, "w") as h5:
        h5["run1/pressure"] = np.ones((20, 4, 3), np.float32)
    layout = path.with_suffix(".layout.toml")
    layout.write_text('rate_hz = 100.0\n[data]\narray = "run1/pressure"\n')
    return taxel.open


def units(path: Path) -> Callable[[Path], object]:
    pytest.importorskip("pynwb")
    SpikeTrains.from_lists([[1.0, 2.0], [3.0]], stop=9.0).to_nwb(path, overwrite=True)
    return SpikeTrains.from_nwb


#: A valid file of each kind, and the name of a data set in it whose values count.
READERS: dict[str, tuple[Callable[[Path], Callable[[Path], object]], str, str]] = {
    "own": (own, ".h5", "t"),
    "frames": (own_frames, ".h5", "values"),
    "foreign": (foreign, ".h5", "run1/pressure"),
    "nwb": (units, ".nwb", "units/spike_times"),
}


def external_storage(h5: h5py.File, name: str, secret: Path) -> str:
    before = h5[name]
    shape, dtype = before.shape, before.dtype
    del h5[name]
    h5.create_dataset(name, shape, dtype, external=[(str(secret), 0, h5py.h5f.UNLIMITED)])
    return name


def external_storage_elsewhere(h5: h5py.File, name: str, secret: Path) -> str:
    """Refused although nothing asks for these values."""
    h5.create_dataset("other/deep/x", (9,), "u1", external=[(str(secret), 0, 9)])
    return "other/deep/x"


def virtual(h5: h5py.File, name: str, secret: Path) -> str:
    shape, dtype = h5[name].shape, h5[name].dtype
    del h5[name]
    layout = h5py.VirtualLayout(shape, dtype)
    layout[...] = h5py.VirtualSource(str(secret), "x", shape)
    h5.create_virtual_dataset(name, layout)
    return name


def virtual_by_pattern(h5: h5py.File, name: str, secret: Path) -> str:
    """A name that the library completes by a number."""
    how = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    space = h5py.h5s.create_simple((4,), (h5py.h5s.UNLIMITED,))
    space.select_hyperslab((0,), (h5py.h5s.UNLIMITED,), block=(1,))
    source = h5py.h5s.create_simple((1,))
    how.set_virtual(space, str(secret.parent / "part-%b.h5").encode(), b"x", source)
    h5py.h5d.create(h5.id, b"pattern", h5py.h5t.NATIVE_INT8, h5py.h5s.create_simple((4,), (h5py.h5s.UNLIMITED,)), how)
    return "pattern"


def external_link(h5: h5py.File, name: str, secret: Path) -> str:
    del h5[name]
    h5[name] = h5py.ExternalLink(str(secret), "/x")
    return name


def external_link_behind_a_soft_one(h5: h5py.File, name: str, secret: Path) -> str:
    h5["away"] = h5py.ExternalLink(str(secret), "/")
    del h5[name]
    h5[name] = h5py.SoftLink("/away/x")
    return "away"


WAYS: dict[Callable[[h5py.File, str, Path], str], str] = {
    external_storage: "external storage",
    external_storage_elsewhere: "external storage",
    virtual: "a virtual data set",
    virtual_by_pattern: "a virtual data set",
    external_link: "an external link",
    external_link_behind_a_soft_one: "an external link",
}


def spoil(tmp_path: Path, reader: str, way: Callable[[h5py.File, str, Path], str]) -> tuple[Path, str, Any]:
    make, ending, name = READERS[reader]
    with h5py.File(tmp_path / "secret.h5", "w") as h5:
        h5["x"] = np.arange(1000.0)
    path = tmp_path / f"a{ending}"
    read = make(path)
    with h5py.File(path, "a") as h5:
        return path, way(h5, name, tmp_path / "secret.h5"), read


# Each in one kind of file, and those that need no other in all kinds.
@pytest.mark.parametrize(
    ("reader", "way"),
    [*(("foreign", way) for way in WAYS), *((r, w) for r in READERS if r != "foreign" for w in list(WAYS)[::4])],
    ids=lambda one: one if isinstance(one, str) else one.__name__,
)
def test_a_file_that_leads_to_another_one_is_refused_with_the_entry_and_its_kind(
    tmp_path: Path, reader: str, way: Callable[[h5py.File, str, Path], str]
) -> None:
    path, entry, read = spoil(tmp_path, reader, way)
    with refused(f"a{path.suffix}, '{entry}': .* another file .*{WAYS[way]}", FormatError):
        read(path)


@pytest.mark.parametrize("way", [external_storage, virtual, external_link], ids=lambda way: way.__name__)
def test_the_system_refuses_what_the_check_would_miss(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, way: Callable[[h5py.File, str, Path], str]
) -> None:
    """In the child no file can be opened, so nothing comes of another one."""
    path, _, _ = spoil(tmp_path, "foreign", way)
    code = Path(h5_child.__file__).read_text()
    for check in ("if kind == self.h5py.h5l.TYPE_EXTERNAL:", "if how.get_external_count():", "if any(how.get_virtual"):
        assert check in code
        code = code.replace(check, check.replace("if ", "if False and ", 1))
    (tmp_path / "child.py").write_text(code.replace("kind == self.h5py.h5l.TYPE_HARD", "kind != -1"))
    monkeypatch.setattr(h5_file, "_CHILD", tmp_path / "child.py")
    if way is virtual:
        # What is missing of a virtual data set is its fill value.
        assert not np.any(taxel.open(path).frames().values)
        return
    with pytest.raises(FormatError, match=r"unable to open|can.t open"):
        taxel.open(path)


def test_a_file_may_be_a_virtual_data_set_over_itself(tmp_path: Path) -> None:
    foreign(tmp_path / "a.h5")
    with h5py.File(tmp_path / "a.h5", "a") as h5:
        h5["parts/x"] = np.arange(24, dtype=np.float32).reshape(2, 4, 3)
        layout = h5py.VirtualLayout((2, 4, 3), "f4")
        layout[...] = h5py.VirtualSource(h5["parts/x"])
        del h5["run1/pressure"]
        h5.create_virtual_dataset("run1/pressure", layout)
    np.testing.assert_array_equal(taxel.open(tmp_path / "a.h5").frames().values.ravel(), np.arange(24))


@pytest.mark.parametrize(
    ("links", "why"),
    [
        ({"asked": "/nowhere/x"}, "component not found|doesn't exist"),
        ({"asked": "/asked"}, "too many links"),
        ({"asked": "/b", "b": "/c", "c": "/asked"}, "too many links"),
        ({"asked": "run1/pressure/deeper"}, ""),
    ],
)
def test_a_soft_link_that_leads_nowhere_is_refused_only_where_a_layout_asks_for_it(
    tmp_path: Path, links: dict[str, str], why: str
) -> None:
    read = foreign(tmp_path / "a.h5")
    with h5py.File(tmp_path / "a.h5", "a") as h5:
        for name, target in links.items():
            h5[name] = h5py.SoftLink(target)
    assert len(read(tmp_path / "a.h5").frames()) == 20  # type: ignore[attr-defined]
    layout = tmp_path / "a.layout.toml"
    layout.write_text(layout.read_text().replace("run1/pressure", "asked"))
    with refused(f"a.h5, asked: a soft link to '.*', which does not exist .({why})", FormatError):
        read(tmp_path / "a.h5")


def test_a_soft_link_is_the_data_set_that_it_leads_to(tmp_path: Path) -> None:
    read = foreign(tmp_path / "a.h5")
    with h5py.File(tmp_path / "a.h5", "a") as h5:
        h5["last"] = h5py.SoftLink("/run1")
        h5["asked"] = h5py.SoftLink("last/pressure")
    layout = tmp_path / "a.layout.toml"
    layout.write_text(layout.read_text().replace("run1/pressure", "asked"))
    assert len(read(tmp_path / "a.h5").frames()) == 20  # type: ignore[attr-defined]


def test_groups_linked_in_circles_and_deep_ones_are_listed_once(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as h5:
        group = h5
        for _ in range(200):
            group = group.create_group("a")
            group["top"] = h5["/"]
            group["back"] = group
        group["x"] = np.ones(3)
    with H5File(tmp_path / "a.h5") as file:
        assert len(file.entries) == 601
        assert file.entries["/".join(["a"] * 200 + ["x"])].shape == (3,)
    with h5py.File(tmp_path / "b.h5", "w", libver="latest") as h5:
        h5["x"] = np.ones(3)
        for k in range(1700):
            h5["l" * 10_000 + str(k)] = h5["x"]
    with pytest.raises(
        FormatError, match=f"too many names in this file: their paths have more than {h5_child.LISTED} bytes"
    ) as raised:
        H5File(tmp_path / "b.h5")
    assert len(str(raised.value)) < 400


def test_plug_ins_are_not_loaded_from_the_current_folder(tmp_path: Path) -> None:
    """A relative folder in HDF5_PLUGIN_PATH is one of the current folder; the library loads every file there."""
    foreign(tmp_path / "a.h5")
    listing = (
        "import os, sys; from taxel._base import h5_child; "
        "h5_child.orders = lambda: h5_child.send(path=os.environ.get('HDF5_PLUGIN_PATH')) or []; h5_child.main()"
    )
    for given, kept in ((".:here::", "null"), (f"here:{tmp_path}", f'"{tmp_path}"')):
        done = subprocess.run(
            [sys.executable, "-c", listing, tmp_path / "a.h5"], input=json.dumps(sys.path) + "\n", capture_output=True,
            text=True, check=True, env={**os.environ, "HDF5_PLUGIN_PATH": given}, cwd=tmp_path,
        )  # fmt: skip
        assert f'{{"path": {kept}}}' in done.stdout


#: Opens a data set and prints the bytes of the array, and the most memory of this process and of its child beside what
#: this one had before.
MEASURED = """
import pathlib, sys, threading, time
import numpy as np
from taxel._base.h5_file import H5File

def most(pid):
    lines = pathlib.Path(f"/proc/{pid}/status").read_text().splitlines()
    return next((1024 * int(line.split()[1]) for line in lines if line.startswith("VmHWM")), 0)

def watch(pid):
    while not done:
        seen.append(most(pid))
        time.sleep(0.002)

seen, done, before = [], [], most("self")
try:
    with H5File(sys.argv[1]) as file:
        watching = threading.Thread(target=watch, args=(file._child.pid,))
        watching.start()
        try:
            size = file.numbers("x").nbytes
        finally:
            done.append(True)
            watching.join()
    print(size, most("self") - before + max(seen))
except Exception as error:
    print(f"{type(error).__name__}: {error}")
"""


def measured(path: Path) -> str:
    return subprocess.run([sys.executable, "-c", MEASURED, path], capture_output=True, text=True, check=True).stdout


@pytest.mark.parametrize(
    "how",
    [
        {"shape": (1 << 22, 4), "chunks": (1024, 4), "fillvalue": 1},
        {"data": np.ones((1 << 17, 128), np.float32), "chunks": (1 << 17, 1), "compression": "gzip"},
        {"data": np.ones((1 << 20, 16), np.float32), "chunks": (1 << 19, 16), "compression": "gzip", "shuffle": True},
        {"data": np.ones((1 << 20, 16), np.float32), "chunks": (1 << 20, 16)},
    ],
    ids=["fill value", "columns", "large packed chunks", "one chunk"],
)
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="measured by /proc")
def test_parent_and_child_take_half_as_much_as_the_array_beside_it(tmp_path: Path, how: dict[str, Any]) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as h5:
        h5.create_dataset("x", dtype=np.float32, **how)
    size, most = map(int, measured(tmp_path / "a.h5").split())
    assert size == 1 << 26
    assert most <= 1.5 * size + (256 << 20)


def test_what_would_take_more_memory_is_refused_with_both_sizes(tmp_path: Path) -> None:
    for name, how, said in (
        ("chunk", {"shape": (1 << 24,), "chunks": (1 << 24,), "compression": "gzip"}, "67108864 bytes; at most 3355"),
        (
            "shape",
            {"shape": (1 << 40,), "chunks": (1024,)},
            "would take 4398046511104 bytes of memory; at most 4294967296",
        ),
    ):
        with h5py.File(tmp_path / f"{name}.h5", "w") as h5:
            h5.create_dataset("x", dtype=np.float32, **how)
        with H5File(tmp_path / f"{name}.h5") as file, refused(said, FormatError):
            file.numbers("x")
    with h5py.File(tmp_path / "text.h5", "w") as h5:
        h5.create_dataset("x", (), "S200000000")
    with H5File(tmp_path / "text.h5") as file, refused("has 200000000 bytes of text; at most 67108864", FormatError):
        file.text("x")


def test_data_sets_count_together(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as h5:
        for name in "ab":
            h5.create_dataset(name, (3,), "u1")
        h5.create_dataset("huge", (limits.UNPACKED - 5,), "u1", chunks=(1024,))
    with H5File(tmp_path / "a.h5") as file:
        assert len(file.numbers("a")) == len(file.numbers("b")) == 3
        said = r"a.h5: would take 4294967297 bytes of memory; at most 4294967296"
        for ask in (lambda: file.check_size(["a", "b", "huge"]), lambda: file.numbers("huge")):
            with refused(said, FormatError):
                ask()
