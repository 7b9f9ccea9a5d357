"""The requests of a client: methods, whose annotated signatures declare them and whose docstrings document them."""

from __future__ import annotations

import asyncio
import math
from typing import Annotated, Any, TypeAlias

from msgspec import Meta, Struct

from taxel import _core
from taxel._base.errors import refused
from taxel._core import ProblemError
from taxel.device import ports
from taxel.labels import Note
from taxel.panel.declared import Time, line, long_request, requests_of, whole
from taxel.panel.folder import Shown
from taxel.panel.label_file import Edit
from taxel.panel.refusals import at_field, reason
from taxel.panel.regions import Drawn, Measure, Picture, RegionLoads, read_beside, regions_beside, write_beside
from taxel.panel.session import Session
from taxel.panel.shown_files import judged
from taxel.panel.threads import in_thread

#: Frames on their way, and labels of a request.
_MOST_CREDITS, _MOST_LABELS = 8, 5000
#: Regions of a recording, and columns of their curves.
_MOST_REGIONS, _MOST_COLUMNS = 200, 2048
#: How long the lines of a sensor are looked at, s.
_LOOK_S = 2.0

_Index: TypeAlias = Annotated[int, whole(0, 65_535)]
_Taxel: TypeAlias = tuple[_Index, _Index]
_Name: TypeAlias = Annotated[str, line(110)]
_NewName: TypeAlias = Annotated[str, line(100)]
_Text: TypeAlias = Annotated[str, line(200)]
_LayoutText: TypeAlias = Annotated[str, Meta(max_length=500_000)]
_Length: TypeAlias = Annotated[float, Meta(ge=0.01, le=86_400)]
_Width: TypeAlias = Annotated[int, whole(1, 2**40)]
_Column: TypeAlias = Annotated[int, whole(-(2**52), 2**52)]
_Count: TypeAlias = Annotated[int, whole(1, _MOST_COLUMNS)]
_Regions: TypeAlias = Annotated[list[Drawn], Meta(max_length=_MOST_REGIONS)]
_SomeRegions: TypeAlias = Annotated[_Regions, Meta(min_length=1)]


class Row(Struct, forbid_unknown_fields=True):
    """Hold a label as the page has it."""

    label: Annotated[str, line(200, least=0)]
    t_us: Time
    source: Annotated[str, line(64, least=0)]
    trial: Annotated[str, line(255, least=0)]
    replaces_us: Time | None = None


class Change(Struct, forbid_unknown_fields=True):
    """Hold a change of labels: `new` in the place of `old`; without `old` a new label, without `new` a deletion."""

    old: Row | None = None
    new: Row | None = None


class Requests(Session):
    """Carry out the requests of a client: those are its public methods."""

    # ------------------------------------------------------------------------------------------ requests: the view

    async def credit(self, n: Annotated[int, whole(1, _MOST_CREDITS)]) -> None:
        """Give credits for `n` more frames."""
        self.credits = min(_MOST_CREDITS, self.credits + n)

    async def watch(self, taxel: _Taxel | None) -> None:
        """Send the history of this taxel; null for none."""
        await in_thread(self.view.watch, taxel)

    async def zoom(self, column_us: _Width, end_us: Time | None = None) -> None:
        """Send columns of time of this width, for this view: 125 us times a power of two; 4 ms or more if it follows.

        With `end_us`, in a view that does not follow the newest, the columns end there, wherever the view's time is,
        and stay until the next `zoom`; a view that plays beyond takes them along. Without it they end at the view's
        time.
        """
        await in_thread(self.view.zoom, column_us, end_us)

    async def seek(self, t_us: Time) -> None:
        """Show this time: of the recording, or while live within the reach; stops playing."""
        await in_thread(self.view.seek, t_us)
        await self.say_transport()

    async def play(self, speed: Annotated[float, Meta(ge=0.001, le=100)] | None = None) -> None:
        """Play from here at this speed (board time over real time; the last one where left out)."""
        await in_thread(self.view.play, speed)
        await self.say_transport()

    async def pause(self) -> None:
        """Pause the view. Acquisition continues."""
        await in_thread(self.view.pause)
        await self.say_transport()

    async def step(self, frames: Annotated[int, whole(-1000, 1000)]) -> None:
        """Go forward or back (negative) by this number of time stamps with events; stops playing."""
        await in_thread(self.view.step, frames)
        await self.say_transport()

    async def live(self) -> None:
        """Follow the live source; leaves a recording."""
        await in_thread(self.view.follow)
        self.shown = None
        await self.say_transport()

    async def sensor(self, name: _Text) -> None:
        """Show this one of the live sources, as `hello` names them, in this view; `hello` of it follows.

        Only the first is read out, and can be zeroed.
        """
        source = self._hub.source_of(name)
        await in_thread(self.follow, source)
        await self.say(self._hub.hello(source))
        await self.say(self._hub.zeroed(source))

    async def open(self, name: _Name, trial: Annotated[str, line(255)] | None = None) -> None:
        """Show a recording of the folder at its beginning, paused: any file that `taxel.open` reads.

        Of a file with several trials the one that `trial` names, or the first. `opened`, `labels` and `transport`
        follow.
        """
        with at_field("name"):
            shown = await self._hub.folder.open(name, trial)
            await self._show(shown)

    @long_request
    async def look(
        self, name: Annotated[str, line(300)], text: _LayoutText | None = None, changes: dict[str, Any] | None = None
    ) -> None:
        """Send `look` and `seen`: what the columns or axes of a file of another program are, and a picture of it.

        By a layout as `text`, as `look` has it, or else by that of the file, with the `changes` that `look` offers.
        """
        with at_field("name"):
            message, whole = await in_thread(self._hub.folder.look, name, text, changes or {})
        await self.say(message)
        if whole is not None:
            await self.say(await in_thread(self._hub.folder.seen, name, whole))

    async def lay(self, name: _Name, text: _LayoutText, folder: bool = False, replace: bool = False) -> None:
        """Write a layout to NAME.layout.toml beside a file of another program, or to layout.toml for its folder.

        Refused at `replace` if that file is there, unless `replace` is true.
        """
        await in_thread(self._hub.folder.lay, name, text, folder=folder, replace=replace)

    async def _show(self, shown: Shown) -> None:
        trouble = None
        try:
            if await self._hub.labels.read(shown):
                await self._hub.say_labels(shown.name)
        except (OSError, _core.Error) as error:
            trouble = reason(error)
        await in_thread(self.view.show, shown.recording)
        self.shown = shown
        opened = {
            "type": "opened",
            "name": shown.name,
            "bytes": shown.state.size,
            **shown.contents,
        }
        await self.say(opened)
        await self.say(self._hub.labels.message(shown.name))
        await self.say_transport()
        if trouble is not None:
            await self.say({"type": "warning", "text": trouble})

    @long_request
    async def values(self, t_us: Time) -> None:
        """Send `values`: the sums, areas and centres at this time of what this view shows, and of the watched taxel."""
        await self.say(await in_thread(self.view.values, t_us))

    async def overview(self) -> None:
        """Send `overview` of what this view shows: events and the greatest force over time, for the strip."""
        source = self._source()
        name = [] if self.shown is None else [self.shown.name]
        await self.say(await in_thread(source.overview, *name))

    @long_request
    async def health(self) -> None:
        """Send `health` of what this view shows, by the rules of `taxel info`."""
        shown = self.shown
        activity = await in_thread(self._source().activity)
        if activity is None and shown is not None:
            found = await in_thread(self._hub.folder.files.judge, shown.path, shown.asked)
        else:
            found = await in_thread(judged, activity)
        await self.say({"type": "health", "source": None if shown is None else shown.name, **found})

    def _source(self) -> Any:
        """Return the live source or the recording that this view shows."""
        source = self.follows if self.shown is None else self.shown.recording
        if source is None:
            raise ProblemError("nothing is shown: open a recording first")
        return source

    # ------------------------------------------------------------------------------------------ requests: the board

    async def zero(self, taxels: Annotated[list[_Taxel], Meta(min_length=1, max_length=1 << 16)]) -> None:
        """Take the present values of these taxels as their rest from now on, also for the readout; all or none.

        The recording notes the time and the rests before and after. `zeroed` follows.
        """
        if self.follows is not self._hub.source:
            raise ProblemError("zero: only the sensor that is read out can be zeroed, the first of them: show it")
        columns, rows = zip(*taxels, strict=True)
        await in_thread(self._hub.needed_live().zero, columns, rows)

    async def set_(self, values: dict[str, Any]) -> None:
        """Write registers, by taxel's names or the manual's, in the registers' own units; all or none."""
        array = self._hub.needed_live().array
        await self._hub.on_board(lambda: self._hub.board.set(values, array))

    async def read(self) -> None:
        """Read all registers back from the board."""
        await self._hub.on_board(self._hub.board.read)

    async def preset_apply(self, name: Annotated[str, line(60)]) -> None:
        """Write the registers of one of the manual's presets, which does not change the version of the wire."""
        array = self._hub.needed_live().array
        await self._hub.on_board(lambda: self._hub.board.apply(name, array))

    async def ports(self) -> None:
        """Send `ports`: the serial ports that the system knows, USB devices first."""
        found = await in_thread(ports)
        texts = [", ".join(filter(None, (port.product, port.maker, port.serial))) for port in found]
        listed = [{"place": port.place, "about": about} for port, about in zip(found, texts, strict=True)]
        await self.say({"type": "ports", "ports": listed})

    @long_request
    async def guess(self, place: Annotated[str, line(255)], baud: Annotated[int, whole(*_core.BAUDS)]) -> None:
        """Send `look` and `seen` of the first lines that arrive within two seconds; their name is the source.

        `place` is a serial port or server (HOST:PORT), a file of the folder, a pipe, or as ``lines+udp:HOST:PORT``.
        """
        with at_field("place"):
            source = await in_thread(self._hub.folder.hear, place, baud, _LOOK_S)
        await self.look(source)

    async def connect(self, source: Annotated[str, line(1024)], text: _LayoutText | None = None) -> None:
        """Receive the lines of numbers of a sensor instead, for all clients; refused while recording.

        What of them is what says a layout as `text`, as `look` has it, if the source was looked at, or else `source`.
        """
        if text is None and not source.startswith("serial:"):
            raise refused("source", ": must begin with serial:, or be one that was looked at")
        with at_field("source"):
            whole = source if text is None else await in_thread(self._hub.folder.looks.source, source, text)
            await self._hub.read_source(whole)

    async def disconnect(self) -> None:
        """Receive nothing any more, for all clients: the port is free for other programs."""
        await self._hub.read_nothing()

    # ------------------------------------------------------------------------------------------ requests: recordings

    async def recordings(self) -> None:
        """Send `recordings`: those of the folder, and its readouts."""
        await self.say(await self._hub.recordings())

    async def record(
        self,
        name: _NewName,
        label: _Text | None = None,
        length_s: Annotated[float, Meta(ge=0.01, le=86_400)] | None = None,
    ) -> None:
        """Record to NAME.mcap, for `length_s`, or else until `stop`.

        `label` is written into the recording as a note without a time: it is about the whole, and is not an event.
        """
        await self._hub.record(name, label, length_s)

    async def stop(self) -> None:
        """End the recording."""
        self._hub.recorder.end()

    async def note(self, text: _Text) -> None:
        """Write a note into the recording that runs, with the time of now."""
        await in_thread(self._hub.needed_live().note, text)

    @long_request
    async def cut(self, start_us: Time, stop_us: Time, name: _NewName) -> None:
        """Write a stretch of the recording shown to a new file of the folder: what `taxel cut` does."""
        shown, out = self._needed("cut"), self._hub.folder.file(name)
        if start_us >= stop_us:
            raise refused("stop_us", ": must be after start_us")
        if out.exists():
            raise refused("name", f": {name} exists already; choose another name")
        # The first frame from the start on, and the first after the end.
        begin, end = (math.ceil(t_us / shown.us) for t_us in (start_us, stop_us))
        lost = await in_thread(self._hub.folder.files.cut, shown.path, shown.asked, out, begin, end)
        await self._hub.say(await self._hub.recordings())
        await self.say({"type": "cut", "name": name, "lost": lost})

    # ------------------------------------------------------------------------------------------ requests: regions

    @long_request
    async def regions(self) -> None:
        """Send `regions`: those of the file beside the recording shown, NAME.regions.json."""
        shown, loads = await self._loads()
        found = loads.drawn(await in_thread(read_beside, shown.path))
        file = regions_beside(shown.path).name
        await self.say({"type": "regions", "source": shown.name, "file": file, "units": loads.units, "regions": found})

    @long_request
    async def loads(
        self, regions: _Regions, measure: Measure, first: _Column, count: _Count, column_us: _Width
    ) -> None:
        """Send `loads`: least and greatest of a measure of each region in columns of time; the first is `first`.

        Column k begins at k times its width. The load is the force, or the sum of the values where no force is known.
        """
        shown, loads = await self._loads()
        curves = await in_thread(loads.curves, regions, measure, first, count, column_us)
        begin = {"type": "loads", "source": shown.name, "first": first, "count": count, "column_us": column_us}
        await self.say(begin | {"measure": measure, "curves": curves})

    @long_request
    async def picture(self, kind: Picture, start_us: Time, stop_us: Time) -> None:
        """Send `picture`: the largest or the mean values of a time, isobars, and the path of the centre."""
        shown, loads = await self._loads()
        found = await in_thread(loads.picture, kind, start_us, stop_us)
        begin = {"type": "picture", "source": shown.name, "kind": kind, "start_us": start_us, "stop_us": stop_us}
        await self.say(begin | found)

    async def write_regions(self, regions: _SomeRegions, replace: bool = False) -> None:
        """Write the regions to NAME.regions.json beside the recording shown.

        Refused at `replace` if that file is there, unless `replace` is true.
        """
        shown, loads = await self._loads()
        await in_thread(write_beside, shown.path, loads.regions(regions), replace=replace)

    async def _loads(self) -> tuple[Shown, RegionLoads]:
        shown = self._needed("regions")
        return shown, await in_thread(self._hub.folder.files.loads, shown.path, shown.asked, shown.us)

    # ------------------------------------------------------------------------------------------ requests: labels

    async def change(self, changes: Annotated[list[Change], Meta(min_length=1, max_length=_MOST_LABELS)]) -> None:
        """Change labels of the recording shown, or of the one that runs; all or none.

        `old` is a label as `labels` has it. A label with `replaces_us` replaces the recording's own note of that time,
        which counts no more; if it is deleted, the note does not count again until a label replaces it. Refused for a
        time outside the recording, and where another window or program has changed the label since.
        """
        trial = "" if self.shown is None else self.shown.trial
        if any(one.new is not None and not one.new.label.strip() for one in changes):
            raise refused("label", ": must be a text of 1 to 200 characters")
        edits = [(_note(one.old, None), _note(one.new, trial)) for one in changes]
        await self._change(edits)

    async def _change(self, edits: list[Edit]) -> None:
        name = self._labelled()
        inverse = await self._hub.labels.change(name, self.shown, edits)
        if inverse:
            self._changes.append((name, inverse))
        await self._hub.say_labels(name)

    async def undo(self) -> None:
        """Take back the last change of labels that this client made in the recording that it shows or that runs."""
        name = self._labelled()
        made = next((change for change in reversed(self._changes) if change[0] == name), None)
        if made is None:
            raise ProblemError("nothing to undo: no label of this recording was changed in this window")
        self._changes.remove(made)
        await self._hub.labels.take_back(name, made[1])
        await self._hub.say_labels(name)

    def _labelled(self) -> str:
        """Return the recording whose labels are changed."""
        name = self._hub.recorder.file if self.shown is None else self.shown.name
        if name is None:
            raise ProblemError("a label needs a recording: open a recording, or start one")
        return name

    # ------------------------------------------------------------------------------------------ requests: readouts

    @long_request
    async def train(self) -> None:
        """Train a readout on the labels of the recording shown, as `taxel train --labels notes` does.

        The readout replaces NAME.readout.json beside the recording. `training` comes at each step, `trained` before
        the answer, when the training has ended. One training runs at a time.
        """
        shown = self._needed("train")
        readout, us = readout_of(shown.name), shown.us
        loop = asyncio.get_running_loop()

        def progress(text: str) -> None:
            asyncio.run_coroutine_threadsafe(self.say({"type": "training", "text": text}), loop)

        trained = await in_thread(self._hub.training.train, shown.path, self._hub.folder.file(readout), progress)
        mistakes = [mistake | {"t_us": mistake["t_us"] * us} for mistake in trained.pop("mistakes")]
        await self._hub.say(await self._hub.recordings())
        await self.say({"type": "trained", "name": shown.name, "readout": readout, "mistakes": mistakes, **trained})

    async def train_stop(self) -> None:
        """End the training that runs: it is refused, and writes nothing."""
        await in_thread(self._hub.training.end)

    @long_request
    async def read_out(self, readout: _Name, use: Annotated[str, line(10)] = "better") -> None:
        """Read what this view shows with a readout or a plain rule of the folder.

        A recording: `detections` follows. The live source: from now on, for all clients; it begins again. A readout
        that needs a tare uses that of the command, else what the taxels hold now. `use`: better, rule or neuron.
        """
        with at_field("readout"):
            path = self._hub.folder.file(readout)
        shown = self.shown
        if shown is None:
            return await self._hub.read_out(path, use)
        labels, found = await in_thread(self._hub.training.detect, shown.path, shown.asked, path, use)
        message = {"type": "detections", "source": shown.name, "readout": readout, "labels": labels}
        await self.say(message | {"detections": found})
        return None

    def _needed(self, action: str) -> Shown:
        if self.shown is None:
            raise ProblemError(f"{action}: open a recording first")
        return self.shown


Requests.requests = requests_of(Requests)


def readout_of(recording: str) -> str:
    """Return the name of the readout that is trained on a recording."""
    return f"{recording.rpartition('.')[0] or recording}.readout.json"


def _note(row: Row | None, trial: str | None) -> Note | None:
    """Return a label of the page as a table holds it; a new one without a trial is of the one that is shown."""
    if row is None:
        return None
    of_trial = row.trial or trial or ""
    return Note(row.label.strip(), row.t_us, 0, of_trial, row.source, row.replaces_us)
