"""What a function does with a field follows from the type of its section: it is kept, changed, or said to be lost."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest

import taxel
from taxel import Note
from taxel.recording.between import between
from taxel.recording.contents import BoardSource, Contents, Drawn, FrameSource, RecordedSource, Stream, sections_of
from taxel.recording.cut import region
from taxel.recording.frames import as_frames, calibrate
from taxel.recording.merge import merge_contents
from taxel.recording.on_clock import on_clock
from taxel.recording.once import known
from taxel.recording.raw import Samples
from taxel.recording.recording import with_notes
from taxel.recording.sections import SampleColumns, Timing
from taxel.recording.writers.stored import storable

from .sections import flat, holds, unsaid
from .test_chains import ARRAY, KINDS, write


def full(folder: Path, kind: type[RecordedSource]) -> Contents:
    """Return contents of a type of source with something in every field, beside another source."""
    (folder / "calibration.json").write_text(taxel.Calibration.law(ARRAY, date="2026-11-21").to_json())
    one = taxel.open(write(folder / "full.mcap"))._contents.main
    assert isinstance(one, BoardSource)
    losses = replace(
        one.losses,
        remarks=("by another's times",),
        truncated=True,
        rebuilt=known({"gaps": 1}),
        lost=known(("something",)),
    )
    wire = replace(
        one.wire,
        payload=np.arange(5, dtype=np.uint8),
        differences=True,
        origin_us=7,
        unmarked=(1,),
        version_2=known(True),
    )
    one = replace(one, sensor=replace(one.sensor, side="left", heel="top"), losses=losses, wire=wire)
    header = {name: getattr(one, name) for name in ("origin", "sensor", "settings", "marks", "timing", "losses")}
    drawn = as_frames(one, 100)
    readings, five = replace(drawn.frame_table, untimed=True, turned=255.0, frame_us=9000.0), np.arange(5)
    samples = Samples({}, five, five.astype(np.uint64), five, five[:, None] * 1.0)
    every: dict[type[RecordedSource], RecordedSource] = {
        BoardSource: one,
        Drawn: Drawn(frame_table=readings, wire=wire, **header),
        FrameSource: FrameSource(frame_table=readings, **header),
        Stream: Stream(
            frame_table=readings,
            stream=SampleColumns(tuple(f"c{k}" for k in range(10)), known(samples)),
            **header,
        ),
    }
    own = every[kind]
    return Contents(own, {"board": own, "other": replace(own, origin=replace(own.origin, label="other"))})


def marked(of: Contents) -> Contents:
    """Return contents that are a slice on another clock."""
    timing = Timing(of.main.timing.clock, "other", known((0, 300_000)))
    return Contents(replace(of.main, timing=timing), of.sources)


#: The functions: from the contents before to those after, and the fields that they set anew, which other tests check.
TABLE, TIMED = {"event_table.events", "frame_table.frames"}, {"marks.notes", "marks.detections", "marks.zeroings"}
NAMED = {"origin.path", "origin.name", "origin.kind", "origin.label", "origin.source"}
FUNCTIONS: dict[str, tuple[Callable[[Contents, Path], Contents], set[str]]] = {
    "between": (
        lambda of, _: between(of, 1000.0, 200_000.0),
        {*TABLE, *TIMED, "settings.held", "timing.interval", "stream.samples", "losses.verdict"},
    ),
    "region": (
        lambda of, _: region(of, slice(1, 5), slice(None)),
        {*TABLE, "sensor.array", "sensor.calibration", "settings.held", "marks.zeroings", "stream.columns"},
    ),
    "merge": (
        lambda of, _: merge_contents([of, of], gap=0 if isinstance(of.main, FrameSource) else None),
        {*TABLE, *TIMED, *NAMED, "losses.verdict", "timing.interval"},
    ),
    "on_clock": (
        lambda of, _: on_clock(of, "other"),
        {*TABLE, *TIMED, "marks.board_changes", "timing.clock", "timing.clock_of", "losses.verdict"},
    ),
    "with_notes": (lambda of, _: with_notes(of, known((Note("more", 5, 0),))), {"marks.notes"}),
    "as_frames": (lambda of, _: replace(of, main=as_frames(of.main)), {*TABLE, "settings.held"}),
    "calibrated": (
        lambda of, _: replace(of, main=calibrate(of.main)),
        {*TABLE, "settings.held", "sensor.calibration"},
    ),
    **{
        kind: (
            lambda of, folder, kind=kind: storable(of, folder / f"new{kind}"),
            {
                *TABLE,
                *NAMED,
                "timing.interval",
                "sensor.calibration",
                "wire.version_2",
                "wire.origin_us",
                "wire.unmarked",
            },
        )
        for kind in KINDS
    },
}


@pytest.mark.parametrize("kind", [BoardSource, FrameSource, Drawn, Stream])
@pytest.mark.parametrize("function", FUNCTIONS)
def test_each_function_carries_each_field_or_changes_it_or_says_that_it_is_lost(
    tmp_path: Path, function: str, kind: type[RecordedSource]
) -> None:
    of = full(tmp_path, kind)
    for name, value in flat(marked(of).main).items():
        assert holds(value), f"fill {name} too"
    if function not in ("between", "on_clock"):
        of = marked(of)
    work, anew = FUNCTIONS[function]
    if function == ".lsa" and kind is not BoardSource:
        return
    after = work(of, tmp_path)
    said = after.main.losses.lost()
    assert "something" in said
    assert unsaid(of.main, after.main, said, {*anew, "losses.lost"}) == []
    if function not in ("between", "on_clock", "with_notes", "as_frames", "calibrated"):
        assert "the source other" in said


@dataclass(frozen=True, eq=False)
class Coloured(BoardSource):
    """A board with a section that no function has a rule for."""

    colour: str = field(default="red", kw_only=True)


@pytest.mark.parametrize("function", ["between", "region", "on_clock", *KINDS])
def test_a_section_without_a_rule_is_refused_by_each_function(tmp_path: Path, function: str) -> None:
    of = full(tmp_path, BoardSource)
    one = Coloured(**sections_of(of.main if function in ("between", "on_clock") else marked(of).main))
    with pytest.raises((AssertionError, AttributeError), match=r"'red'|'str' object has no attribute 'losses'"):
        FUNCTIONS[function][0](Contents(one, {"board": one, "other": of.sources["other"]}), tmp_path)
