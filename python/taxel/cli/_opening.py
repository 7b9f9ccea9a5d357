"""The options that say how files are opened, one home for all commands that read files, and the opening."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from taxel._core import ProblemError
from taxel.cli._array import geometry

if TYPE_CHECKING:
    from taxel.array import Array
    from taxel.recording import Recording

__all__ = ["FileOptions", "with_file_options"]


@dataclass(frozen=True)
class FileOptions:
    """Hold the options that say of files what they do not hold themselves."""

    array: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ROWSxCOLUMNS[xMM]",
            help="Rows, columns and pitch (mm) of the sensor, as 24x20x5, for files without them (.csv, .lsa, ROS "
            "bags), and for pictures of a row of as many channels. Default: 64x64x2.67, or a larger array if events "
            "lie outside it; of a bag as its messages say. "
            "Without mm the pitch is 2.67 for events of the board, else unknown.",
        ),
    ] = None
    layout: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="What a file lacks: sensor, unit, rate, how to read a table. Default: NAME.layout.toml or layout.toml "
            "beside it.",
        ),
    ] = None
    topic: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="Open this topic of a ROS bag as pictures; taxel info lists them. Repeated, with --field and --array "
            "once or as often: each is a source.",
        ),
    ] = None
    field: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="The topic's field, as left.taxels. Default: the only one with numbers."),
    ] = None
    types: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="A folder of .msg or .idl files, for a ROS bag that lacks definitions."),
    ] = None
    ros: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="The release of ROS, as humble, whose messages a bag holds undefined."),
    ] = None
    rate_hz: Annotated[
        float | None,
        typer.Option(help="Pictures a second, for recordings without times, whose pictures are numbered."),
    ] = None
    limit: Annotated[
        int | None,
        typer.Option(
            metavar="BYTES",
            help="How much of a recording may be read into memory. Default: 3/4 of what is available, and at most the "
            "sizes that taxel's docs state (files.md).",
        ),
    ] = None

    def open(self, path: Path) -> list[Recording]:
        """Open a file or a folder; of a folder, or of another maker's file, all trials in it.

        Raises
        ------
        ProblemError : an ``--array`` that differs from the sensor that a file holds; a ``--rate-hz`` of one with times
        """
        from taxel.recording import open_all  # noqa: PLC0415  the command line starts quickly

        arrays = [geometry(size, of_wire=False) for size in self.array or ()]
        opened = open_all(
            path,
            array=arrays if len(arrays) > 1 else arrays[0] if arrays else None,
            layout=self.layout or self._instead_of_layout(path),
            topic=self.topic,
            field=self.field,
            types=self.types,
            ros=self.ros,
            limit=self.limit,
        )
        return [self._timed(self._on_array(one)) for one in opened]

    def words(self) -> list[str]:
        """Return the options as words of a command line."""
        words: list[str] = []
        for one in fields(self):
            value = getattr(self, one.name)
            for each in value if isinstance(value, list) else [] if value is None else [value]:
                words += [f"--{one.name.replace('_', '-')}", str(each)]
        return words

    def names_topic(self, bag: Path) -> bool:
        """Return whether these options, or the layout file of a ROS bag, say which topic to open."""
        from taxel.formats.layout import Layout  # noqa: PLC0415  the command line starts quickly

        place = self.layout or Layout.beside(bag)
        return bool(self.topic) or (place is not None and "topic" in Layout.read(place).ros)

    def _instead_of_layout(self, path: Path) -> Any:
        """Return an empty layout for an array without one, whose rate ``--rate-hz`` says; else None."""
        if self.rate_hz is None:
            return None
        from taxel.formats.layout import Layout  # noqa: PLC0415  the command line starts quickly
        from taxel.recording.read_foreign import is_lone_array  # noqa: PLC0415

        return Layout(path) if Layout.beside(path) is None and is_lone_array(path) else None

    def _on_array(self, recording: Recording) -> Recording:
        """Return a recording on the sensor of ``--array``; refuse one that holds a sensor that differs from it."""
        # A bag holds no sensor, so that its messages are of the given one or are left out.
        if not self.array or recording.kind == "ros":
            return recording
        from taxel.array import Array  # noqa: PLC0415  the command line starts quickly

        own, given = recording.array, geometry(self.array[0], of_wire=False)
        if _is_row_of(recording, given):
            return _laid_on(recording, given)
        differs = given.pitch_mm is not None and (own.pitch_mm, own.places) != (given.pitch_mm, None)
        if own.shape != given.shape or differs:
            sizes = ", ".join(self.array)
            raise ProblemError(f"--array {sizes}: {recording.path} holds its own sensor, {own!r}; leave it out")
        # A .mcap holds its sensor, whose pitch may be unknown.
        if not recording.has_events or own._is_measured or recording.kind == "mcap":
            return recording
        # A size without a pitch says nothing of it, and events without one are of the board's wire.
        wire = geometry(self.array[0])
        return _laid_on(recording, Array(*own.shape, wire.pitch_mm, own.exists, wire.name))

    def joined(self, path: Path) -> list[Recording]:
        """Open a file or a folder, with the feet of each trial joined as its sources."""
        from taxel.recording.opening import joined  # noqa: PLC0415  the command line starts quickly

        return joined(self.open(path))

    def all(self, paths: Sequence[Path]) -> list[Recording]:
        """Open recordings one after the other; of a folder, or of another maker's file, all trials in it.

        Each sensor of a file with several is a recording of its own (`Recording.title`).
        """
        from taxel.recording.opening import sensors  # noqa: PLC0415  the command line starts quickly

        return [one for path in paths for each in self.open(path) for one in sensors(each)]

    def _timed(self, recording: Recording) -> Recording:
        return recording if self.rate_hz is None else recording.at_rate(self.rate_hz)

    def one(self, path: Path) -> Recording:
        """Open a file that holds one recording, with its feet joined.

        Raises
        ------
        ProblemError : it holds several
        """
        every = self.joined(path)
        if len(every) != 1:
            some = ", ".join(one.name for one in every[:3]) + ", ..." * (len(every) > 3)
            raise ProblemError(f"{path}: holds {len(every)} recordings ({some}); must be one")
        return every[0]


def _laid_on(recording: Recording, array: Array) -> Recording:
    """Return a recording on another description of its sensor."""
    from taxel.recording.contents import Contents  # noqa: PLC0415  the command line starts quickly
    from taxel.recording.layout import on_array  # noqa: PLC0415

    own = recording._contents
    return type(recording)(Contents(on_array(own.one, array), own.sources))


def _is_row_of(recording: Recording, given: Array) -> bool:
    """Return whether pictures are a row of as many channels as a sensor has taxels, as tables and arrays may be."""
    own, is_one = recording.array, len(recording.sources) < 2
    row = own.shape == (1, given.rows * given.columns) and given.rows > 1 and own.taxels == own.columns
    return is_one and row and not own._is_measured and not recording.has_events and not recording.is_stream


def with_file_options(work: Callable[..., None]) -> Callable[..., None]:
    """Give a command the options of `FileOptions` in place of its argument `files`, which holds them."""
    options = inspect.signature(FileOptions, eval_str=True).parameters
    own = inspect.signature(work, eval_str=True).parameters.values()

    def command(**typed: Any) -> None:
        work(files=FileOptions(**{name: typed.pop(name) for name in options}), **typed)

    functools.update_wrapper(command, work)
    parameters = [one for each in own for one in (options.values() if each.name == "files" else [each])]
    # The options have defaults, and may stand before arguments without one.
    keywords = [one.replace(kind=inspect.Parameter.KEYWORD_ONLY) for one in parameters]
    command.__signature__ = inspect.Signature(keywords)  # type: ignore[attr-defined]
    return command
