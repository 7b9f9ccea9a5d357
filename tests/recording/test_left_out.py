"""A file of a folder that cannot be read is left out, with one line that names it; the others are used."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

import taxel
from taxel import FormatError

from .making import some_events


def cut(file: Path) -> None:
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])


def empty(file: Path) -> None:
    file.write_bytes(b"")


DAMAGE: dict[str, tuple[str, Callable[[Path], None], str]] = {
    "a cut .npz": (".npz", cut, r"b\.npz: the \.npz file is damaged"),
    "a cut .h5": (".h5", cut, r"b\.h5: the HDF5 file is damaged"),
    **{
        f"an empty {end}": (end, empty, rf"b\{end}.* (is empty|damaged)|b\{end}, line 1: ")
        for end in (".npz", ".h5", ".csv")
    },
    "an empty .mcap": (".mcap", empty, r"b\.mcap"),
}


@pytest.mark.parametrize("name", DAMAGE)
def test_a_damaged_file_is_left_out_and_the_others_open(tmp_path: Path, name: str) -> None:
    ending, damage, why = DAMAGE[name]
    for k, stem in enumerate("abc"):
        taxel.convert(some_events(40, seed=k), tmp_path / f"{stem}{ending}")
    damage(tmp_path / f"b{ending}")
    (tmp_path / "labels.csv").write_text("recording,label,t_us\na,heel,100\nb,heel,100\n")
    with pytest.warns(UserWarning, match=f"^left out, because it cannot be read: .*{why}") as said:
        opened = taxel.open_all(tmp_path)
    assert len(said) == 1
    assert "\n" not in str(said[0].message)
    assert [(each.path.stem, len(each.notes)) for each in opened] == [("a", 1), ("c", 0)]


def test_labels_without_a_recording_are_not_given_to_the_only_one_that_is_left(tmp_path: Path) -> None:
    for stem in "ab":
        taxel.convert(some_events(40), tmp_path / f"{stem}.npz")
    cut(tmp_path / "b.npz")
    (tmp_path / "labels.csv").write_text("label,t_us\nheel,100\n")
    with (
        pytest.warns(UserWarning, match="left out"),
        pytest.raises(FormatError, match="does not state the recording of each label, but there are 2 recordings"),
    ):
        taxel.open_all(tmp_path)


def test_what_concerns_all_files_stays_an_error(tmp_path: Path) -> None:
    for stem in "ab":
        taxel.convert(some_events(4000), tmp_path / f"{stem}.npz")
    (tmp_path / "b.layout.toml").write_text("rows = 'eight'\n")
    with pytest.raises(FormatError, match=r"b\.layout\.toml"):
        taxel.open_all(tmp_path)
