"""Contents of a recording: for each source a common header, and a board's events, frames, or a stream of numbers."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, NoReturn, TypeVar

from taxel._core import ProblemError
from taxel.events import Events
from taxel.frames import Frames
from taxel.recording import sections
from taxel.recording.once import Once, known
from taxel.recording.verdict import Verdict

__all__ = [
    "BoardSource",
    "Contents",
    "Drawn",
    "FrameSource",
    "RecordedSource",
    "S",
    "Several",
    "Stream",
    "alone",
    "apply_rule",
    "name_remarks",
    "refuse_several",
    "sections_of",
    "several",
    "share_clock",
    "source_from",
    "with_losses",
]  # fmt: skip

P = TypeVar("P", sections.Wire, sections.SampleColumns)
S = TypeVar("S", bound="RecordedSource")


@dataclass(frozen=True, eq=False)
class RecordedSource(ABC):
    """Hold what all sources have: the header of a board, of frames, and of a stream of numbers."""

    origin: sections.Origin
    sensor: sections.Sensor
    settings: sections.Settings = field(default_factory=sections.Settings, kw_only=True)
    marks: sections.Marks = field(default_factory=sections.Marks, kw_only=True)
    timing: sections.Timing = field(default_factory=sections.Timing, kw_only=True)
    losses: sections.Losses = field(default_factory=sections.Losses, kw_only=True)

    @property
    def has_events(self) -> bool:
        """Whether it holds events (else frames)."""
        return isinstance(self, BoardSource)

    @property
    @abstractmethod
    def table(self) -> Events | Frames:
        """The events or the frames."""

    def section(self, kind: type[P]) -> P:
        """Return its section of a type; an empty one where it has none."""
        return next((found for found in sections_of(self).values() if isinstance(found, kind)), None) or kind()

    @property
    def columns(self) -> tuple[str, ...] | None:
        """The names of the columns of a stream of numbers; None for a sensor."""
        return self.stream.columns if isinstance(self, Stream) else None

    @property
    def untimed(self) -> bool:
        """Whether its frames are numbered."""
        return isinstance(self, FrameSource) and self.frame_table.untimed


@dataclass(frozen=True, eq=False)
class BoardSource(RecordedSource):
    """Hold what a board sent."""

    event_table: sections.EventTable
    wire: sections.Wire = field(default_factory=sections.Wire)

    @property
    def table(self) -> Events:
        """The events."""
        return self.event_table.events()


@dataclass(frozen=True, eq=False)
class FrameSource(RecordedSource):
    """Hold frames."""

    frame_table: sections.FrameTable

    @property
    def table(self) -> Frames:
        """The frames."""
        return self.frame_table.frames()


@dataclass(frozen=True, eq=False)
class Drawn(FrameSource):
    """Hold frames that were drawn of a board's events, whose bytes are still there."""

    wire: sections.Wire = field(default_factory=sections.Wire)


@dataclass(frozen=True, eq=False)
class Stream(FrameSource):
    """Hold a stream of numbers, whose lines are frames of one row."""

    stream: sections.SampleColumns


@dataclass(frozen=True, eq=False)
class Several(RecordedSource):
    """Hold what a file of several sensors says as a whole; all that is of a single one refuses to be read."""

    refuse: Callable[[], NoReturn] = field(metadata={"is_section": False})
    first: RecordedSource = field(metadata={"is_section": False})
    are_frames: bool = field(metadata={"is_section": False})

    @property
    def has_events(self) -> bool:
        """Whether its sources are not all of frames by one clock."""
        return not self.are_frames

    @property
    def untimed(self) -> bool:
        """Whether its frames are numbered."""
        return self.first.untimed

    @property
    def table(self) -> NoReturn:
        """Refuse to return a table."""
        self.refuse()


def refuse_several(source: RecordedSource) -> None:
    """Refuse a file of several sensors as a whole, by an error that lists its sources."""
    if isinstance(source, Several):
        source.refuse()


def sections_of(source: RecordedSource) -> dict[str, sections.Section]:
    """Return the sections of a source by the names of its fields."""
    return {
        field.name: getattr(source, field.name) for field in fields(source) if field.metadata.get("is_section", True)
    }


def apply_rule(
    source: S, rule: Callable[[sections.Section], sections.Section | None], losses: Callable[[], Iterable[str]] = tuple
) -> S:
    """Return a source with a rule applied to each of its sections.

    Parameters
    ----------
    source : Source
    rule : function
        Returns the section's successor, of the same type, or None if it is lost, which `Losses.lost` then says.
    losses : function that returns lines, optional
        What else is lost.
    """
    sections_before = sections_of(source)
    after = {name: rule(section) for name, section in sections_before.items()}
    left_out = [sections_before[name] for name, section in after.items() if section is None]
    # Only a section whose fields have defaults may be lost.
    none: Callable[[str], Any] = lambda name: type(sections_before[name])()  # type: ignore[call-arg]  # noqa: E731
    changed: dict[str, Any] = {name: none(name) if section is None else section for name, section in after.items()}
    return with_losses(
        replace(source, **changed), lambda: [*(line for section in left_out for line in section.losses()), *losses()]
    )


def with_losses(source: S, lines: Callable[[], Iterable[str]]) -> S:
    """Return a source with further lines of what is lost, without duplicates."""
    lost = Once(lambda: tuple(dict.fromkeys((*source.losses.lost(), *lines()))))
    return replace(source, losses=replace(source.losses, lost=lost))


def source_from(
    table: Events | Frames,
    origin: sections.Origin | None = None,
    *,
    untimed: bool = False,
    turned: float | None = None,
    frame_us: float | None = None,
    columns: Sequence[str] = (),
    **header: Any,
) -> BoardSource | FrameSource:
    """Return a source of a table.

    Parameters
    ----------
    table : Events or Frames
    origin : Origin, optional
    untimed, turned, frame_us : bool, float, float
        As of `FrameTable`.
    columns : sequence of str
        Columns of a stream of numbers, as those of `SampleColumns`.
    **header
        Its other sections; default: a sensor of the table's array alone.
    """
    origin = sections.Origin() if origin is None else origin
    sensor = header.pop("sensor", None) or sections.Sensor(table.array)
    if isinstance(table, Events):
        return BoardSource(origin, sensor, sections.EventTable(known(table)), **header)
    frame_table = sections.FrameTable(known(table), untimed, turned, frame_us)
    if columns:
        return Stream(origin, sensor, frame_table, sections.SampleColumns(tuple(columns)), **header)
    return FrameSource(origin, sensor, frame_table, **header)


@dataclass(frozen=True, eq=False)
class Contents:
    """Hold what an opened recording holds.

    Parameters
    ----------
    main : Source
        Its only source, the chosen one, the only board beside streams of numbers, or `Several`.
    sources : mapping from str to Source
        All sources of the file by their names.
    """

    main: RecordedSource
    sources: Mapping[str, RecordedSource]

    @classmethod
    def single(cls, source: RecordedSource) -> Contents:
        """Return a recording of one source."""
        return cls(source, {source.origin.label: source})

    def others(self) -> list[str]:
        """Return what is lost without the other sources."""
        return [f"the source {name}" for name in self.sources if name != self.main.origin.label]

    @property
    def is_several(self) -> bool:
        """Whether these are the contents of a file of several boards as a whole."""
        return isinstance(self.main, Several)


def alone(sources: Mapping[str, RecordedSource]) -> Contents:
    """Return the contents of a file: those of its only source or its only sensor; else those of `several`.

    The verdict is that of all sources.
    """
    boards = [source for source in sources.values() if not isinstance(source, Stream)]
    if len(sources) == 1:
        return Contents(next(iter(sources.values())), sources)
    if len(boards) != 1:
        return Contents(several(sources), sources)
    losses = replace(boards[0].losses, verdict=Once(lambda: _verdict(sources)))
    return Contents(replace(boards[0], losses=losses), sources)


def several(sources: Mapping[str, RecordedSource]) -> Several:
    """Return the contents of a file of several sensors as a whole; sections of a single one raise an error."""
    first = next(iter(sources.values()))
    path, names = first.origin.path, ", ".join(sources)

    def refuse() -> NoReturn:
        raise ProblemError(
            f"{path}: contains {len(sources)} sources ({names}); choose one with recording.sources["
            f"{next(iter(sources))!r}], or write one to a separate file with taxel convert --source NAME"
        )

    refused: Once[Any] = Once(refuse)
    losses_of_each = [source.losses for source in sources.values()]
    return Several(
        # A source is named after its file and itself.
        replace(first.origin, name=first.origin.name.removesuffix(f" {first.origin.label}"), label=""),
        sections.Sensor(first.sensor.array, calibration=refused),
        refuse,
        first,
        are_frames=share_clock(sources),
        settings=sections.Settings(held=refused, registers=refused, register_changes=refused),
        marks=replace(first.marks, board_changes=refused, zeroings=refused),
        timing=sections.Timing(refused, first.timing.clock_of),
        losses=sections.Losses(
            counts=Once(lambda: {name: source.losses.counts() for name, source in sources.items()}),
            verdict=Once(lambda: _verdict(sources)),
            remarks=name_remarks([(name, source.losses.remarks) for name, source in sources.items()]),
            truncated=any(losses.truncated for losses in losses_of_each),
            lost=Once(lambda: tuple(dict.fromkeys(line for losses in losses_of_each for line in losses.lost()))),
        ),
    )


def _verdict(sources: Mapping[str, RecordedSource]) -> Verdict | None:
    """Return what several sources lost, as far as they say it."""
    verdicts = [(name, source.losses.verdict()) for name, source in sources.items()]
    known_verdicts = [(name, verdict) for name, verdict in verdicts if verdict is not None]
    return Verdict._of_sources(known_verdicts) if known_verdicts else None


def name_remarks(remarks: Sequence[tuple[str, tuple[str, ...]]]) -> tuple[str, ...]:
    """Return the remarks of several recordings as those of one: each with its recording's name if they differ."""
    if len({lines for _, lines in remarks}) == 1:
        return remarks[0][1]
    return tuple(dict.fromkeys(f"{name}: {line}" for name, lines in remarks for line in lines))


def share_clock(sources: Mapping[str, RecordedSource]) -> bool:
    """Return whether sources share one clock: frames without arrival times, as those of two feet."""
    return all(
        not source.has_events
        and not (isinstance(source, Stream) and source.stream.samples.holds())
        and not source.timing.clock.holds()
        for source in sources.values()
    )
