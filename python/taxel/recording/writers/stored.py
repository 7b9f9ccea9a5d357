"""The contents that a file of each kind can hold: the fields that a reader will return, and what is lost."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import assert_never

import numpy as np

from taxel import _core
from taxel._base.messages import counted
from taxel._core import ProblemError
from taxel.array import Array
from taxel.clock import Clock
from taxel.events import Events
from taxel.formats.layout import Layout
from taxel.frames import Frames
from taxel.recording import sections
from taxel.recording.contents import (
    BoardSource,
    Contents,
    Drawn,
    FrameSource,
    RecordedSource,
    Stream,
    apply_rule,
    refuse_several,
    sections_of,
    several,
    share_clock,
    source_from,
    with_losses,
)
from taxel.recording.kinds import ENDINGS, verdict_of
from taxel.recording.once import known
from taxel.recording.sidecars import calibration_beside
from taxel.recording.writers.csv import array_in_csv
from taxel.recording.writers.mcap import cut_raw, encode_events
from taxel.wire import decode as wire_decode

#: The unit of the stamps of wire version 1, us.
STAMP_US = 100

#: The most numbers of repaired events in the description of a .mcap, which is limited to 16 MiB.
_MOST = 1_000_000

#: What a file can hold, and a line for each kind of information that it cannot.
_Kept = tuple[RecordedSource, list[str]]


def storable(contents: Contents, path: Path) -> Contents:
    """Return the contents that a file can hold of a recording; the kind of file is the ending of its path.

    Raises
    ------
    ProblemError : contents that the kind of file cannot hold at all (frames in a .lsa)
    """
    ending, main = path.suffix.lower(), contents.main
    if contents.is_several and ending == ".mcap" and share_clock(contents.sources):
        sources = {name: _storable(source, ending, path) for name, source in contents.sources.items()}
        sources = {name: _rename(source, f"{path.name} {name}", name) for name, source in sources.items()}
        return Contents(several(sources), sources)
    refuse_several(main)
    source = _storable(main, ending, path)
    if not isinstance(main, FrameSource) or ending != ".mcap":
        source = _rename(source, path.name, "board")
    return Contents.single(with_losses(source, contents.others))


def _rename(source: RecordedSource, name: str, label: str) -> RecordedSource:
    return replace(source, origin=replace(source.origin, name=name, label=label))


def _storable(source: RecordedSource, ending: str, path: Path) -> RecordedSource:
    """Return what a file can hold of a source."""
    stored, lines = {".mcap": _mcap, ".lsa": _lsa, ".csv": _csv, ".npz": _table, ".h5": _table}[ending](source, path)
    beside = calibration_beside(path, source)
    stored = replace(
        stored,
        origin=replace(stored.origin, path=path, name=path.name, kind=ENDINGS[ending]),
        sensor=replace(stored.sensor, calibration=beside),
        # A slice that is written to a file becomes a separate recording.
        timing=replace(stored.timing, interval=None),
    )
    alone = source.sensor.calibration.holds() and not beside.holds()
    return with_losses(
        stored, lambda: [*lines, *["the calibration, which is a separate file: put a copy beside the new file"] * alone]
    )


def needs_new_bytes(source: RecordedSource) -> bool:
    """Return whether a file's bytes must be made of the events, as no datagrams contain exactly these events."""
    has_bytes = bool(source.section(sections.Wire).losses())
    return source.timing.interval is not None or source.timing.clock_of is not None or not has_bytes


def _sensor(array: Array) -> str:
    """Return the line of `lost` for a sensor."""
    some = "" if array.exists is None else f", {array.taxels} exist"
    return f'the sensor ({array.rows} x {array.columns} taxels{some}, {array._apart()}, "{array.name}")'


def _arrivals(source: RecordedSource) -> list[str]:
    """Return what is lost without arrival times, which datagrams have too."""
    return ["arrival times"] * (source.timing.clock.holds() and not source.section(sections.Wire).datagrams.holds())


def _table(source: RecordedSource, _: Path) -> _Kept:
    """Return what a .npz or a .h5 holds: all but the raw datagrams."""
    wire, stream = source.section(sections.Wire), source.section(sections.SampleColumns)

    def rule(section: sections.Section) -> sections.Section | None:
        match section:
            case sections.Origin():
                return replace(section, source=section.source or section.name)
            case (
                sections.Sensor()
                | sections.Settings()
                | sections.Marks()
                | sections.Losses()
                | sections.EventTable()
                | sections.FrameTable()
            ):
                return section
            case sections.Wire():
                return sections.Wire()
            case sections.SampleColumns():
                return sections.SampleColumns(section.columns)
            case sections.Timing():
                return None
            case _:
                assert_never(section)

    return apply_rule(source, rule), [*_arrivals(source), *wire.losses(with_times=True), *stream.received()]


def _bare(source: RecordedSource, table: Events | Frames, wire: Iterable[str]) -> _Kept:
    """Return a table alone, and what is lost of each of the other parts; of the bytes it is given."""
    kept_sections = (section for section in sections_of(source).values() if not isinstance(section, sections.Wire))
    return source_from(table, losses=sections.Losses(lost=source.losses.lost)), [
        *(line for section in kept_sections for line in section.losses()),
        *_arrivals(source),
        *wire,
    ]


def _csv(source: RecordedSource, path: Path) -> _Kept:
    """Return what a .csv holds: events without markers, or frames without their unit."""
    beside, is_turned = Layout.beside(path), isinstance(source, FrameSource) and source.frame_table.turned is not None
    if is_turned and beside is not None and Layout.read(beside).turned is not None:
        raise ProblemError(
            f"{path}: the readings were inverted already, which a .csv cannot state, and {beside} beside it would "
            "invert them again; write the recording to another folder, or as a .npz, .h5 or .mcap"
        )
    original, stated = source.table, source.sensor.array
    array = array_in_csv(original)
    same = replace(stated, name=array.name, names=None) == array
    lost = [f'the name of the sensor ("{stated.name}")' if same else _sensor(stated)]
    lost += ["the names of the taxels"] * (stated.names is not None)
    if isinstance(original, Events):
        lost += [f"{counted(len(original.markers), 'marker')} of start and stop"] * bool(original.markers)
        events = original[:]
        events.markers, events.array = (), array
        table: Events | Frames = events
    else:
        lost += [f"the unit ({original.unit})"] * (original.unit != "counts")
        table = Frames(original.values[:, : array.rows, : array.columns], original.t, array=array)
    stored, lines = _bare(source, table, source.section(sections.Wire).losses(with_times=True))
    return stored, [*lines, *lost]


def _lsa(source: RecordedSource, path: Path) -> _Kept:
    """Return what a .lsa holds: the board's bytes as received, or made of the events."""
    board = _board(source, path)
    events, wire, stated = board.table, board.wire, source.sensor.array
    datagrams, is_new = wire.datagrams(), needs_new_bytes(source)
    payload = wire.payload if datagrams is None else datagrams.payload
    if is_new or wire.version_2():
        of_wire = wire.losses(with_times=True)
    else:
        of_wire = ["arrival times, and where datagrams begin"] * wire.datagrams.holds()
    of_wire += ["the fact that intensities are differences"] * wire.differences
    lost = [_sensor(stated)] * (stated != Array.thesis())
    if payload is None or is_new or wire.version_2():
        times = np.concatenate([events.t, np.array([at for at, _ in events.markers], np.int64)])
        lost += ["times finer than 100 us"] * bool((times % STAMP_US).any())
        lost += ["which events are repaired"] * (events.repaired is not None)
        payload = np.frombuffer(_core.wire_encode(events._parts()), np.uint8)
    again = wire_decode(payload, array=stated, differences=wire.differences and not is_new)
    if len(again) != len(events):
        lost.append(f"the pairing of intensities ({counted(len(again), 'event')} when paired directly)")
    elif (again.t != events.t // STAMP_US * STAMP_US).any():
        lost.append("whole turns of 6.5536 s in times")
    stored, lines = _bare(source, events, of_wire)
    assert isinstance(stored, BoardSource)  # of events
    return replace(stored, wire=sections.Wire(payload=payload)), [*lines, *lost]


def _mcap(source: RecordedSource, path: Path) -> _Kept:
    """Return what a .mcap holds: all; events without datagrams of exactly these events get new datagrams."""
    is_file, lines = source.origin.kind != "events", source.losses.damage()
    # `source` names the recordings that were merged.
    converted = [f"converted from {source.origin.name}"] if is_file and source.origin.kind != "merged" else []
    samples = source.stream.samples() if isinstance(source, Stream) else None
    events = None if isinstance(source, FrameSource) else known(_board(source, path).table)
    clock = source.timing.usable()
    wire = _wire(source, clock, lines) if isinstance(source, BoardSource) else sections.Wire()
    if samples is not None:
        bad = source.losses.counts().get("lines_that_could_not_be_read", 0)
        lines += [f"{bad} lines that could not be read"] * bool(bad)
        lines += ["arrival times of lines that are not in this part of the recording"] * (
            clock is not None and len(clock.board_us) > len(samples)
        )
    elif isinstance(source, FrameSource):
        # Frames have the times of the board alone.
        clock = None
        lines += _arrivals(source)
        lines += source.wire.losses(with_times=True) if isinstance(source, Drawn) else []

    def rule(section: sections.Section) -> sections.Section:
        match section:
            case sections.Origin():
                return replace(
                    section, source=section.source or section.name or ("events" if source.has_events else "frames")
                )
            case (
                sections.Sensor()
                | sections.Settings()
                | sections.Marks()
                | sections.FrameTable()
                | sections.SampleColumns()
            ):
                return section
            case sections.EventTable():
                return sections.EventTable(events or section.events)
            case sections.Timing():
                lines.extend(section.losses())
                return sections.Timing(known(clock))
            case sections.Wire():
                return wire
            case sections.Losses():
                return sections.Losses(
                    counts=section.counts,
                    verdict=known(verdict_of(source) if is_file else None),
                    remarks=tuple(dict.fromkeys((*section.remarks, *converted))),
                    lost=section.lost,
                )
            case _:
                assert_never(section)

    return apply_rule(source, rule), lines


def _wire(board: BoardSource, clock: Clock | None, lost: list[str]) -> sections.Wire:
    """Return the datagrams of a new .mcap: those received, or new ones made of the events."""
    wire = board.wire
    if not needs_new_bytes(board):
        datagrams = wire.datagrams
        if wire.payload is not None and datagrams() is None:
            datagrams = known(cut_raw(wire.payload))
        return replace(wire, datagrams=datagrams, payload=None)
    lost += wire.losses()
    origin_us, encoded, unmarked = encode_events(board.table, board.settings.held(), clock)
    lost += [f"the fact that {len(unmarked) - _MOST} of the events are repaired"] * (len(unmarked) > _MOST)
    return sections.Wire(
        known(encoded), version_2=known(True), origin_us=origin_us, unmarked=tuple(unmarked[:_MOST].tolist())
    )


def _board(source: RecordedSource, path: Path) -> BoardSource:
    if not isinstance(source, BoardSource):
        raise ProblemError(
            f"{path}: a {path.suffix.lower()} can contain only events; write frames to .mcap, .npz, .csv or .h5"
        )
    return source
