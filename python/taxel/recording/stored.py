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
    Board,
    Contents,
    Drawn,
    FrameSource,
    Source,
    Stream,
    apply_rule,
    sections_of,
    several,
    share_clock,
    source_from,
    with_losses,
)
from taxel.recording.kinds import ENDINGS, verdict_of
from taxel.recording.once import known
from taxel.recording.sidecars import calibration_beside
from taxel.recording.write_csv import array_in_csv
from taxel.recording.write_mcap import cut_raw, encode_events
from taxel.wire import decode as wire_decode

#: The unit of the stamps of wire version 1, us.
STAMP_US = 100

#: The most numbers of repaired events in the description of a .mcap, which is limited to 16 MiB.
_MOST = 1_000_000

#: What a file can hold, and a line for each kind of information that it cannot.
_Kept = tuple[Source, list[str]]


def storable(of: Contents, place: Path) -> Contents:
    """Return the contents that a file can hold of a recording; the kind of file is the ending of its path.

    Raises
    ------
    ProblemError : contents that the kind of file cannot hold at all (frames in a .lsa)
    """
    ending, main = place.suffix.lower(), of.main
    if of.is_several and ending == ".mcap" and share_clock(of.sources):
        sources = {name: _storable(source, ending, place) for name, source in of.sources.items()}
        sources = {name: _rename(source, f"{place.name} {name}", name) for name, source in sources.items()}
        return Contents(several(sources), sources)
    if of.is_several:
        # Reading the events raises the error that lists the sources.
        _ = main.table
    source = _storable(main, ending, place)
    if not isinstance(main, FrameSource) or ending != ".mcap":
        source = _rename(source, place.name, "board")
    return Contents.single(with_losses(source, of.others))


def _rename(of: Source, name: str, label: str) -> Source:
    return replace(of, origin=replace(of.origin, name=name, label=label))


def _storable(of: Source, ending: str, place: Path) -> Source:
    """Return what a file can hold of a source."""
    source, lines = {".mcap": _mcap, ".lsa": _lsa, ".csv": _csv, ".npz": _table, ".h5": _table}[ending](of, place)
    beside = calibration_beside(place, of)
    source = replace(
        source,
        origin=replace(source.origin, path=place, name=place.name, kind=ENDINGS[ending]),
        sensor=replace(source.sensor, calibration=beside),
        # A part that is written to a file becomes a recording of its own.
        timing=replace(source.timing, stretch=None),
    )
    alone = of.sensor.calibration.holds() and not beside.holds()
    return with_losses(
        source, lambda: [*lines, *["the calibration, a file of its own: lay a copy beside the new one"] * alone]
    )


def is_made(of: Source) -> bool:
    """Return whether a file's bytes must be made of the events, as no datagrams contain exactly these events."""
    has_bytes = bool(of.section(sections.Wire).losses())
    return of.timing.interval is not None or of.timing.clock_of is not None or not has_bytes


def _sensor(array: Array) -> str:
    """Return the line of `lost` for a sensor."""
    some = "" if array.exists is None else f", {array.taxels} exist"
    return f'the sensor ({array.rows} x {array.columns} taxels{some}, {array._apart()}, "{array.name}")'


def _arrivals(of: Source) -> list[str]:
    """Return what is lost without arrival times, which datagrams have too."""
    return ["arrival times"] * (of.timing.clock.holds() and not of.section(sections.Wire).datagrams.holds())


def _table(of: Source, _: Path) -> _Kept:
    """Return what a .npz or a .h5 holds: all but the raw datagrams."""
    wire, stream = of.section(sections.Wire), of.section(sections.Columns)

    def rule(part: sections.Section) -> sections.Section | None:
        match part:
            case sections.Origin():
                return replace(part, source=part.source or part.name)
            case (
                sections.Sensor()
                | sections.Settings()
                | sections.Marks()
                | sections.Losses()
                | sections.EventTable()
                | sections.FrameTable()
            ):
                return part
            case sections.Wire():
                return sections.Wire()
            case sections.Columns():
                return sections.Columns(part.columns)
            case sections.Timing():
                return None
            case _:
                assert_never(part)

    return apply_rule(of, rule), [*_arrivals(of), *wire.losses(with_times=True), *stream.received()]


def _bare(of: Source, table: Events | Frames, wire: Iterable[str]) -> _Kept:
    """Return a table alone, and what is lost of each of the other parts; of the bytes it is given."""
    others = (part for part in sections_of(of).values() if not isinstance(part, sections.Wire))
    return source_from(table, losses=sections.Losses(lost=of.losses.lost)), [
        *(line for part in others for line in part.losses()),
        *_arrivals(of),
        *wire,
    ]


def _csv(of: Source, place: Path) -> _Kept:
    """Return what a .csv holds: events without markers, or frames without their unit."""
    beside, is_turned = Layout.beside(place), isinstance(of, FrameSource) and of.frame_table.turned is not None
    if is_turned and beside is not None and Layout.read(beside).turned is not None:
        raise ProblemError(
            f"{place}: the readings were turned already, which a .csv cannot state, and {beside} beside it would turn "
            "them again; write it to another folder, or as a .npz, .h5 or .mcap"
        )
    whole, stated = of.table, of.sensor.array
    array = array_in_csv(whole)
    same = replace(stated, name=array.name, names=None) == array
    lost = [f'the name of the sensor ("{stated.name}")' if same else _sensor(stated)]
    lost += ["the names of the taxels"] * (stated.names is not None)
    if isinstance(whole, Events):
        lost += [f"{counted(len(whole.markers), 'marker')} of start and stop"] * bool(whole.markers)
        events = whole[:]
        events.markers, events.array = (), array
        table: Events | Frames = events
    else:
        lost += [f"the unit ({whole.unit})"] * (whole.unit != "counts")
        table = Frames(whole.values[:, : array.rows, : array.columns], whole.t, array=array)
    source, lines = _bare(of, table, of.section(sections.Wire).losses(with_times=True))
    return source, [*lines, *lost]


def _lsa(of: Source, place: Path) -> _Kept:
    """Return what a .lsa holds: the board's bytes as received, or made of the events."""
    board = _board(of, place)
    events, wire, stated = board.table, board.wire, of.sensor.array
    datagrams, made = wire.datagrams(), is_made(of)
    payload = wire.payload if datagrams is None else datagrams.payload
    if made or wire.version_2():
        of_wire = wire.losses(with_times=True)
    else:
        of_wire = ["arrival times, and where datagrams begin"] * wire.datagrams.holds()
    of_wire += ["that intensities are differences"] * wire.differences
    lost = [_sensor(stated)] * (stated != Array.thesis())
    if payload is None or made or wire.version_2():
        times = np.concatenate([events.t, np.array([at for at, _ in events.markers], np.int64)])
        lost += ["times finer than 100 us"] * bool((times % STAMP_US).any())
        lost += ["which events are repaired"] * (events.repaired is not None)
        payload = np.frombuffer(_core.wire_encode(events._parts()), np.uint8)
    again = wire_decode(payload, array=stated, differences=wire.differences and not made)
    if len(again) != len(events):
        lost.append(f"the pairing of intensities ({counted(len(again), 'event')} when paired directly)")
    elif (again.t != events.t // STAMP_US * STAMP_US).any():
        lost.append("whole turns of 6.5536 s in times")
    source, lines = _bare(of, events, of_wire)
    assert isinstance(source, Board)  # of events
    return replace(source, wire=sections.Wire(payload=payload)), [*lines, *lost]


def _mcap(of: Source, place: Path) -> _Kept:
    """Return what a .mcap holds: all; events without datagrams of exactly these events get new datagrams."""
    is_file, lines = of.origin.kind != "events", of.losses.damage()
    # Of what recordings were merged stands in `source`.
    converted = [f"converted from {of.origin.name}"] if is_file and of.origin.kind != "merged" else []
    samples = of.stream.samples() if isinstance(of, Stream) else None
    events = None if isinstance(of, FrameSource) else known(_board(of, place).table)
    clock = of.timing.usable()
    wire = _wire(of, clock, lines) if isinstance(of, Board) else sections.Wire()
    if samples is not None:
        bad = of.losses.counts().get("lines_that_could_not_be_read", 0)
        lines += [f"{bad} lines that could not be read"] * bool(bad)
        lines += ["arrival times of lines outside the part"] * (
            clock is not None and len(clock.board_us) > len(samples)
        )
    elif isinstance(of, FrameSource):
        # Frames have the times of the board alone.
        clock = None
        lines += _arrivals(of)
        lines += of.wire.losses(with_times=True) if isinstance(of, Drawn) else []

    def rule(part: sections.Section) -> sections.Section:
        match part:
            case sections.Origin():
                return replace(part, source=part.source or part.name or ("events" if of.has_events else "frames"))
            case sections.Sensor() | sections.Settings() | sections.Marks() | sections.FrameTable() | sections.Columns():
                return part
            case sections.EventTable():
                return sections.EventTable(events or part.events)
            case sections.Timing():
                lines.extend(part.losses())
                return sections.Timing(known(clock))
            case sections.Wire():
                return wire
            case sections.Losses():
                return sections.Losses(
                    counts=part.counts,
                    verdict=known(verdict_of(of) if is_file else None),
                    remarks=tuple(dict.fromkeys((*part.remarks, *converted))),
                    lost=part.lost,
                )
            case _:
                assert_never(part)

    return apply_rule(of, rule), lines


def _wire(of: Board, clock: Clock | None, lost: list[str]) -> sections.Wire:
    """Return the datagrams of a new .mcap: those received, or new ones made of the events."""
    wire = of.wire
    if not is_made(of):
        datagrams = wire.datagrams
        if wire.payload is not None and datagrams() is None:
            datagrams = known(cut_raw(wire.payload))
        return replace(wire, datagrams=datagrams, payload=None)
    lost += wire.losses()
    origin_us, made, unmarked = encode_events(of.table, of.settings.held(), clock)
    lost += [f"that {len(unmarked) - _MOST} of the events are repaired"] * (len(unmarked) > _MOST)
    return sections.Wire(
        known(made), version_2=known(True), origin_us=origin_us, unmarked=tuple(unmarked[:_MOST].tolist())
    )


def _board(of: Source, place: Path) -> Board:
    if not isinstance(of, Board):
        raise ProblemError(
            f"{place}: a {place.suffix.lower()} holds events and no frames; write those to .mcap, .npz, .csv or .h5"
        )
    return of
