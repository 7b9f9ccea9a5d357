"""XDF of the Lab Streaming Layer: each stream of numbers as a source, each stream of texts as labels; by pyxdf."""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from taxel import Array, Frames
from taxel.formats.layout import Layout
from taxel.formats.roles import FIRST, Role
from taxel.formats.times import repaired
from taxel.labels import Note, source_of
from taxel.reading import Facts, InMemory, Marks, unreadable


def knows(path: Path) -> bool:
    """Return whether a file is of this kind, by its first bytes."""
    if not path.is_file() or path.suffix.lower() not in (".xdf", ".xdfz"):
        return False
    with path.open("rb") as file:
        return file.read(4) == b"XDF:" or path.suffix.lower() == ".xdfz"


def read(path: Path, layout: Layout | None = None) -> list[InMemory]:
    """Return a reader of each stream of numbers with channels; `[data] array` of a layout chooses one by its name.

    Times are those of the recorder's clock, in us; each sample of a stream of texts is a note of all sources.

    Raises
    ------
    ImportError : pyxdf is not installed (``pip install 'taxel[lsl]'``)
    FormatError : damaged, or no such stream of numbers
    """
    try:
        import pyxdf  # noqa: PLC0415  an extra
    except ImportError:
        text = "to read a .xdf, taxel needs pyxdf, which is not installed: pip install 'taxel[lsl]'"
        raise ImportError(f"{path}: {text}") from None
    try:
        streams, _ = pyxdf.load_xdf(path, verbose=False)
    except Exception as error:  # of pyxdf's parts: of struct, of XML
        why = str(error).partition("\n")[0] or type(error).__name__
        raise unreadable(f"the .xdf is damaged or not complete ({why}); copy or write it again", path) from None
    of_numbers = {_name(each): each for each in streams if isinstance(each["time_series"], np.ndarray)}
    of_numbers = {name: each for name, each in of_numbers.items() if len(each["time_stamps"])}
    texts = [each for each in streams if not isinstance(each["time_series"], np.ndarray)]
    chosen = None if layout is None or layout.data is None else layout.data.array
    if not of_numbers or (chosen is not None and chosen not in of_numbers):
        there = ", ".join(of_numbers) or "none"
        raise unreadable(f"contains no stream of numbers{f' {chosen}' * bool(chosen)}; its streams are {there}", path)
    notes = tuple(
        Note(str(sample[0]), round(at * 1e6), 0)
        for stream in texts
        for at, sample in zip(stream["time_stamps"], stream["time_series"], strict=True)
    )
    return [_reader(path, name, stream, notes) for name, stream in of_numbers.items() if chosen in (None, name)]


def _name(stream: dict[str, Any]) -> str:
    return str(stream["info"]["name"][0])


def _reader(path: Path, name: str, stream: dict[str, Any], notes: tuple[Note, ...]) -> InMemory:
    """Return the frames of a stream: a taxel a channel, with its name and unit where the stream states them."""
    values = np.ascontiguousarray(stream["time_series"], np.float32)
    if np.isinf(values).any():
        raise unreadable(f"stream {name} has a value that does not fit 32 bits", path)
    t = np.rint(np.asarray(stream["time_stamps"], np.float64) * 1e6).astype(np.int64)
    found = repaired(t)
    values = values if found.order is None else values[found.order]
    channels = _channels(stream)
    names = [str((channel.get("label") or [""])[0] or "") for channel in channels]
    units = {str((channel.get("unit") or [""])[0] or "") for channel in channels}
    is_named = len(names) == values.shape[1] and any(names)
    array = Array(1, values.shape[1], name=name, names=names if is_named else None)
    unit = units.pop() if len(units) == 1 else ""
    frames = Frames(values[:, None], found.t, unit=unit or "as sent", array=array)
    remarks = tuple(f"{len(t)} times: {said}" for said in found.said)
    facts = Facts(path=path, array=array, kind="xdf", label=source_of(name), source=name, remarks=remarks)
    first = [[f"{value:g}" for value in column] for column in values[:FIRST].T.tolist()]
    own = names if is_named else [f"channel {k + 1}" for k in range(len(first))]
    roles = [Role(own[k], column, unit=unit, source=name) for k, column in enumerate(first)]
    facts = replace(facts, roles=tuple(map(asdict, [Role("time_stamps", role="time"), *roles])))
    return InMemory(facts, frames, Marks(notes=notes))


def _channels(stream: dict[str, Any]) -> list[dict[str, Any]]:
    """Return what a stream says of its channels; none if it says nothing."""
    try:
        found: list[dict[str, Any]] = stream["info"]["desc"][0]["channels"][0]["channel"]
    except (KeyError, IndexError, TypeError):
        return []
    return found
