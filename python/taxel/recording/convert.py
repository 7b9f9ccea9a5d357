"""Conversion between kinds of recordings; information that the target cannot hold is reported."""

from __future__ import annotations

import errno
import json
import os
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from taxel import _core
from taxel._base.arguments import checked_path, flag, shown, text
from taxel._base.errors import refused
from taxel._base.files import whole_file, write_whole
from taxel._base.messages import counted
from taxel._core import ProblemError
from taxel.events import Events
from taxel.frames import Frames
from taxel.recording.contents import BoardSource, Contents, RecordedSource, Stream, alone, share_clock, source_from
from taxel.recording.frames import as_frames, period_us
from taxel.recording.kinds import ENDINGS
from taxel.recording.opening import open_one
from taxel.recording.recording import Recording
from taxel.recording.sections import Wire
from taxel.recording.writers.csv import write_csv
from taxel.recording.writers.h5 import write_h5
from taxel.recording.writers.mcap import write_mcap
from taxel.recording.writers.npz import write_npz
from taxel.recording.writers.stored import needs_new_bytes, storable

__all__ = ["KINDS", "convert"]

#: The kinds of files that can be written.
KINDS = tuple(ENDINGS)


def convert(
    source: Recording | Events | Frames | str | os.PathLike[str],
    target: str | os.PathLike[str],
    *,
    frames_hz: float | None = None,
    compression: str = "none",
    overwrite: bool = False,
) -> list[str]:
    """Write a recording as the kind of file that the target's ending names.

    Parameters
    ----------
    source : Recording, Events, Frames or path
    target : path ending in .mcap, .lsa, .npz, .csv or .h5
    frames_hz : float, Hz, optional
        Write frames at this rate (.mcap, .npz, .csv, .h5) instead of events.
    compression : {"none", "lz4", "zstd"}
        Compression of a .mcap.
    overwrite : bool
        Whether an existing file may be replaced.

    Returns
    -------
    list of str
        A line for each kind of information that was lost: `Recording.lost` of the source, and the information that the
        target cannot hold; empty if nothing is lost.

    Raises
    ------
    ProblemError : another ending, or something that the target cannot hold at all (frames in a .lsa)
    FormatError : a source that is not a recording
    OSError : a target that exists, a folder that does not, a full disk ...

    Examples
    --------
    >>> import pathlib, tempfile, taxel
    >>> folder = pathlib.Path(tempfile.mkdtemp())
    >>> events = taxel.Events([0, 192], [3, 4], [5, 5], [True, False], array=taxel.Array(8, 8))
    >>> taxel.convert(events, folder / "two.npz")
    []
    >>> taxel.convert(folder / "two.npz", folder / "two.csv")
    ['the sensor (8 x 8 taxels, of unknown pitch, "array")']
    >>> taxel.convert(folder / "two.npz", folder / "two.lsa")
    ['the sensor (8 x 8 taxels, of unknown pitch, "array")', 'times finer than 100 us']
    """
    path = Path(checked_path("target", target))
    kind = path.suffix.lower()
    if kind not in KINDS:
        raise ProblemError(f"{path}: ends in {kind or 'nothing'!r}; must end in one of {', '.join(KINDS)}")
    text("compression", compression, ("none", "lz4", "zstd"))
    if not flag("overwrite", overwrite) and os.path.lexists(path):
        raise FileExistsError(errno.EEXIST, "exists already; give overwrite=True to replace it", str(path))
    if frames_hz is not None:
        period_us("frames_hz", frames_hz)
    contents = _contents(source)
    if frames_hz is not None:
        if isinstance(source, Frames):
            raise refused(
                "frames_hz",
                ": the times of frames are not changed; to resample frames, open the file and call frames(rate_hz)",
            )
        if contents.is_several and share_clock(contents.sources):
            contents = alone(
                {name: as_frames(source, frames_hz, name="frames_hz") for name, source in contents.sources.items()}
            )
        else:
            contents = Contents(as_frames(contents.main, frames_hz, name="frames_hz"), contents.sources)
    written = storable(contents, path)
    main, lost = written.main, list(written.main.losses.lost())
    match kind:
        case ".lsa":
            _write_lsa(path, main, overwrite)
        case ".npz":
            write_whole(path, lambda file: write_npz(file, main), overwrite=overwrite)
        case ".csv":
            write_whole(path, lambda file: write_csv(file, main.table), overwrite=overwrite)
        case ".h5":
            write_h5(path, main, overwrite=overwrite)
        case _:
            with whole_file(path, overwrite=overwrite) as temporary:
                sources_before = contents.sources if written.is_several else {main.origin.label: contents.main}
                counts = {name: _counts(sources_before[name], source) for name, source in written.sources.items()}
                write_mcap(temporary, written, compression, counts)
                lost += _read_otherwise(temporary, contents.main)
    return lost


def _write_lsa(path: Path, source: RecordedSource, overwrite: bool) -> None:
    """Write a `.lsa` and its `.lss` whole; until then an older pair stays as it is."""
    marker = path.with_suffix(".lss")
    if not overwrite and os.path.lexists(marker):
        raise FileExistsError(errno.EEXIST, "exists already; give overwrite=True to replace it", str(marker))
    with (
        whole_file(path, overwrite=overwrite) as temporary,
        tempfile.TemporaryDirectory(dir=path.parent, prefix=f".{path.name}.") as folder,
    ):
        new = Path(folder) / "made.lsa"
        payload = source.section(Wire).payload
        assert payload is not None  # `storable` sets it
        _core.write_lsa(new, payload.tobytes())
        os.replace(new, temporary)
    write_whole(marker, lambda _: None, overwrite=True)


def _contents(source: object) -> Contents:
    if isinstance(source, str | os.PathLike):
        source = open_one(checked_path("source", source))
    if isinstance(source, Recording):
        return source._contents
    if not isinstance(source, Events | Frames):
        raise refused("source", f" is {shown(source)}: must be a taxel.Recording, taxel.Events, taxel.Frames or a path")
    return Contents.single(source_from(source))


def _counts(source: RecordedSource, written: RecordedSource) -> dict[str, Any]:
    """Return the counts of a recording under the names of the live format."""
    samples = source.stream.samples() if isinstance(source, Stream) else None
    if samples is not None:
        return {"received": len(samples)}
    received = len(written.wire.datagrams() or ()) if isinstance(written, BoardSource) else len(written.table)
    if source.origin.kind == "events":
        # Nothing is missing of what was made here.
        return {"received": received, "missing": 0}
    if not isinstance(written, BoardSource):
        return {"received": received}
    counts = source.losses.counts()
    known = {name: counts.get(name) or 0 for name in ("dropped_by_queue", "received")}
    by_kernel = counts.get("dropped_by_kernel")
    # Where it is not counted it is unknown; a file without its end says nothing of it.
    known["dropped_by_kernel"] = by_kernel if known["received"] else by_kernel or 0
    decoder = counts.get("decoder")
    damage = _core.recording_damage(json.dumps(decoder)) if decoder else {}
    return {**known, "decoder": damage}


def _read_otherwise(path: Path, source: RecordedSource) -> list[str]:
    """Return a line if copied datagrams decode to other events than the recording's."""
    if not isinstance(source, BoardSource) or needs_new_bytes(source):
        return []
    events = source.table
    again = Events._from_parts(_core.RecordingReader(path).decode("direct").events, events.array)
    if (len(again), again.intensity is None) != (len(events), events.intensity is None):
        return [f"the pairing of intensities ({counted(len(again), 'event')} when paired directly)"]
    return ["the order of times that step back by more than 0.1 s"] * (not np.array_equal(again.t, events.t))
