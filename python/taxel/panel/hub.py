"""What all clients of a panel share: the live source, the board's registers, the folder, labels, the recorder."""

from __future__ import annotations

import asyncio
import contextlib
import json
import threading
from collections.abc import Callable, Coroutine, Iterator
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from msgspec.json import encode

from taxel import _core
from taxel._base.errors import refused
from taxel._core import ProblemError
from taxel.detect import PlainRule, Readout, load
from taxel.detect.board import differences
from taxel.device import Cable
from taxel.frames import Frames
from taxel.live import Live
from taxel.panel.board import Board
from taxel.panel.client import Client
from taxel.panel.folder import Folder
from taxel.panel.labels import LabelTables
from taxel.panel.recorder import Recorder
from taxel.panel.shown_files import Opening
from taxel.panel.threads import in_thread
from taxel.panel.training import Training
from taxel.tare import Tare
from taxel.wire.registers import Registers, fields_of_registers, fitting_presets, preset_of

_T = TypeVar("_T")

#: How often counters are sent, tables of labels are looked at, and registers are read, s.
_COUNT_S, _FOLLOW_S, _READ_S = 0.25, 0.3, 2.0


class Hub:
    """Hold what all clients share. All methods but `live` and `close` are called in the server's thread.

    Parameters
    ----------
    live : Live or None
    folder : Path
        That of the recordings.
    opening : Opening
        How recordings are opened, and which first.
    cable : Cable or None
        The board's serial line, which `close` closes.
    """

    def __init__(self, live: Live | None, folder: Path, opening: Opening, cable: Cable | None) -> None:
        self.sessions: list[Client] = []
        self._tasks: set[asyncio.Task[None]] = set()
        self.opened = opening.first
        #: Whether somebody stated the board's registers.
        self.registers_stated = live is not None and live._registers_stated
        self.recorder = Recorder(self.say, self._mark)
        self.folder = Folder(folder, opening, lambda: self.records)
        self.labels = LabelTables(self.folder, opening)
        self.training = Training(opening, self.folder.files)
        self.board, self._on_board = Board(cable), asyncio.Lock()
        #: The live sources that views have shown, by name; the first is read out.
        self._sources: dict[str, _core.PanelLive] = {}
        #: In what the board was said to differ from that of the readout's training.
        self._differing = ""
        # Locked while one `Live` replaces another.
        self._restarting = threading.Lock()
        self._live = self._first = live
        if live is not None:
            self._show_live(live)

    @property
    def source(self) -> _core.PanelLive | None:
        """The live source that is read out, as views see it."""
        return next(iter(self._sources.values()), None)

    @property
    def live(self) -> Live | None:
        """The live source; waits while another one begins."""
        with self._restarting:
            return self._live

    def close(self) -> None:
        """Close the serial line, and end a `Live` that was begun here."""
        self.board.close()
        if self._live is not None and self._live is not self._first:
            self._live.stop()

    async def end(self) -> None:
        """End a training, which no request may wait for."""
        self.training.close()

    def keep(self, task: asyncio.Task[None]) -> None:
        """Let a task go on when who began it has left."""
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    def works(self) -> Iterator[Coroutine[Any, Any, None]]:
        """Yield what is done beside the clients until the server ends."""
        yield self._count()
        yield self._follow_labels()
        yield self._follow_registers()
        yield self._read_first()

    # ---------------------------------------------------------------------------------------------- clients

    def join(self, session: Client) -> None:
        """Count another client."""
        self.sessions.append(session)
        self._watch()

    def leave(self, session: Client) -> None:
        """Count one client less."""
        self.sessions.remove(session)
        self._watch()

    def _watch(self) -> None:
        for source in self._sources.values():
            source.watch(bool(self.sessions))

    async def say(self, message: dict[str, Any] | str, source: _core.PanelLive | None = None) -> None:
        """Send a message to all clients, or to those that follow a source."""
        text = message if isinstance(message, str) else encode(message).decode()
        for session in list(self.sessions):
            if source is None or session.follows is source:
                await session.say(text)

    async def warn(self, reason: object) -> None:
        """Tell all clients what went wrong."""
        await self.say({"type": "warning", "text": str(reason)})

    async def tell(self) -> None:
        """Send what has happened at the live sources."""
        for source in [*self._sources.values()]:
            if (news := source.news()) is None:
                continue
            detections, was_reset, zeroed, about = news
            for text in detections:
                await self.say(text)
            if was_reset and source is self.source:
                await self.forget_registers()
            if zeroed:
                await self.say(self.zeroed(source), source)
            if about:
                await self.say(self.hello(source), source)

    # ---------------------------------------------------------------------------------------------- the live source

    def needed_live(self) -> Live:
        """Return the live source; a ProblemError says that there is none."""
        if self._live is None:
            raise ProblemError("no board is connected")
        return self._live

    def needed_source(self) -> _core.PanelLive:
        """Return the live source as the views see it; a ProblemError says that there is none."""
        if self.source is None:
            raise ProblemError("no board is connected")
        return self.source

    def source_of(self, name: str) -> _core.PanelLive:
        """Return one of the live sources as views see it; a ProblemError says that there is none of that name."""
        if name not in self._sources:
            self._sources[name] = self.needed_source().of_source(name)
            self._watch()
        return self._sources[name]

    def _show_live(self, live: Live) -> None:
        """Show another live source from now on."""
        # It may be the board whose registers were read: then the other source begins with them.
        source = _core.PanelLive(live._core, json.dumps(self.board.registers) if self.board.known else None)
        if not self.board.known:
            self.board.registers = source.registers()
        self._live, self._sources = live, {live.name: source}
        self._watch()

    async def restart(self, change: Callable[[Live], dict[str, Any]], *, keeps_places: bool = False) -> None:
        """Show another `Live` with the options that a function of the one before changes.

        Raises
        ------
        ProblemError : a recording runs, or the panel shows recordings only; what the function raises
        """
        if self.recorder.is_busy:
            raise ProblemError("a recording runs: stop it first")
        if self._live is None:
            raise ProblemError("this panel shows recordings only: start it by taxel live --panel")
        if self._live._options.record is not None:
            raise ProblemError("a recording from this address is running; end it first")

        def replace() -> None:
            with self._restarting:
                assert self._live is not None
                before, changed = self._live, change(self._live)
                # A serial line has one reader at a time.
                before._pause() if keeps_places else before.stop()
                try:
                    self._show_live(before._again(**changed))
                except Exception:
                    self._show_live(_in_sight(before))
                    raise

        await in_thread(replace)
        for session in self.sessions:
            session.follow(self.source)
        await self.say(self.hello(self.source))
        await self.say(self.registers())
        await self.say(self.zeroed(self.source))

    async def read_source(self, source: str) -> None:
        """Receive another source, as `sources` of `taxel.live.Live` names it, with all other options unchanged.

        A tare is one board's: a readout that reads with one ends, unless the tare is taken afresh.
        """

        def change(before: Live) -> dict[str, Any]:
            own = {"readout": None, "tare": None} if isinstance(before._options.tare, Tare) else {}
            return {"port": None, "host": None, "sources": source, **own}

        await self.restart(change)

    async def read_nothing(self) -> None:
        """Receive nothing any more."""
        await self.read_source(_nothing_like(self.needed_live()))

    async def read_out(self, readout: Path, use: str) -> None:
        """Read the live source out with another readout: time, values and the past begin again.

        A readout that needs a tare uses that of the board, if there is one; else the present values of the taxels are
        their rest, so the sensor must be unloaded.
        """
        await self._begin_readout(lambda: load(readout), use=use)
        await self._agree()

    async def _begin_readout(self, loaded: Callable[[], Readout | PlainRule], **changed: Any) -> None:
        def change(before: Live) -> dict[str, Any]:
            readout = loaded()
            tare = before.tare or (before._options.tare if before._options.readout is not None else None)
            if tare is None:
                tare = _rest_of_held(before)
            held = {"registers": Registers._of(self.board.registers, before.array)} if self.board.known else {}
            return {"readout": readout, "tare": tare, **held, **changed}

        await self.restart(change, keeps_places=True)

    async def _agree(self) -> None:
        """Say once in what the board differs from the training's; read out above a raised noise floor."""
        readout = None if self._live is None else self._live._options.readout
        if self._live is None or readout is None or not self.board.known:
            return
        registers = Registers._of(self.board.registers, self._live.array)
        differing = differences(readout._parts.get("training") or {}, registers)
        if differing and differing != self._differing:
            await self.warn(differing)
        self._differing = differing
        if readout._with_floor(float(registers.noise_floor)) is readout:
            return
        if self.recorder.is_busy:
            await self.warn("the readout knows the raised noise floor after the recording, when it is chosen again")
        else:
            await self._begin_readout(lambda: readout)

    # ---------------------------------------------------------------------------------------------- recording

    @property
    def records(self) -> bool:
        """Whether any recording of the live source runs, also one that the page did not begin."""
        return self.recorder.is_busy or (self.source is not None and self.source.is_recording())

    async def record(self, name: str, label: str | None, length_s: float | None) -> None:
        """Begin a recording, which ends by itself after `length_s`, and goes on without clients.

        Raises
        ------
        ProblemError : a recording runs; there is no live source; the file exists
        OSError : it cannot be written
        """
        if self.records:
            raise ProblemError("a recording runs already: stop it first")
        live, source = self.needed_live(), self.needed_source()
        path = self.folder.file(f"{name}.mcap")
        if path.exists():
            raise refused("name", f": {path.name} exists already; choose another name")
        await self.recorder.begin(source, path, label, length_s)

        async def run() -> None:
            await self.recorder.run(live, source)
            await self.say(await self.recordings())
            await self.say(self.recorder.message())

        self.keep(asyncio.create_task(run()))

    async def _mark(self, on: bool) -> bool:
        if self.board.is_connected:
            try:
                await self.on_board(lambda: self.board.record(on))
            except (OSError, _core.Error) as error:
                await self.warn(f"register record: {error}")
        return self.board.is_connected

    # ---------------------------------------------------------------------------------------------- the board

    async def connect(self, cable: Cable) -> None:
        """Use the board's serial line from now on."""
        self.board.connect(cable)
        for session in self.sessions:
            await session.say(self.hello(session.follows))
        await self.prepare()

    async def prepare(self) -> None:
        """Read the registers that are not known; where the board does not answer now, they stay unknown."""
        if self.board.is_connected and not self.board.known:
            try:
                await self.on_board(self.board.read)
            except (OSError, _core.Error):
                return

    async def on_board(self, work: Callable[[], _T]) -> _T:
        """Work on the board in a thread of its own, and tell all clients what it holds then."""
        async with self._on_board:
            before = dict(self.board.registers), self.board.known
            try:
                return await in_thread(work)
            finally:
                if before != (self.board.registers, self.board.known):
                    if self.source is not None:
                        self.source.announce(json.dumps(self.board.registers))
                    await self.say(self.registers())
                    if before[0]["channels"] != self.board.registers["channels"]:
                        # Other presets fit it.
                        await self.say(self.presets())
                    await self._agree()

    async def forget_registers(self) -> None:
        """After a reset the board holds other registers than were read."""
        if self.board.known:
            self.board.known = False
            await self.say(self.registers())
        await self.prepare()

    # ---------------------------------------------------------------------------------------------- works

    async def _count(self) -> None:
        """Send the counters, and read the board's line, whose greetings report resets."""
        while True:
            await asyncio.sleep(_COUNT_S)
            if not self.sessions:
                continue
            for source in [*self._sources.values()]:
                certain = source is self.source and (self.registers_stated or self.board.known)
                frame_us = _core.registers_words(json.dumps(self.board.registers))[1] if certain else None
                counters = source.counters(frame_us)
                await self.say(f'{counters[:-1]},"viewers":{len(self.sessions)}}}', source)
            if self.board.is_connected and await in_thread(self.board.was_reset):
                await self.forget_registers()

    async def _follow_labels(self) -> None:
        """Read tables of labels again that other programs have changed."""
        while True:
            await asyncio.sleep(_FOLLOW_S)
            try:
                for name in await self.labels.changed():
                    await self.say_labels(name)
            except (OSError, _core.Error) as error:
                await self.warn(error)

    async def _follow_registers(self) -> None:
        """Read the board's registers again, which another program may have written."""
        while True:
            await asyncio.sleep(_READ_S)
            if self.sessions and self.board.is_due:
                with contextlib.suppress(OSError, _core.Error):
                    await self.on_board(partial(self.board.read, again=True))

    async def say_labels(self, name: str) -> None:
        """Send the labels of a recording to the clients that show it."""
        text = encode(self.labels.message(name)).decode()
        for session in list(self.sessions):
            if (self.recorder.file if session.shown is None else session.shown.name) == name:
                await session.say(text)

    async def _read_first(self) -> None:
        """Read the recording to show first while the browser starts; who opens it gets the error."""
        if self.opened is not None:
            try:
                await self.folder.open(self.opened, None)
            except (OSError, _core.Error):
                return

    # ---------------------------------------------------------------------------------------------- messages

    def hello(self, source: _core.PanelLive | None) -> dict[str, Any]:
        """Return what a client that follows a source is shown, sent again when any of it changes."""
        live: dict[str, Any] = dict.fromkeys(("array", "udp", "lines", "source", "sensor", "frames", "readout"))
        live["sources"] = []
        if source is not None:
            of_all = self.needed_source().about()
            live = source.about() | {key: of_all[key] for key in ("sources", "readout")}
        return {
            "type": "hello",
            "protocol": 1,
            "live": source is not None,
            "control": self.board.place,
            "folder": str(self.folder.path),
            "open": self.opened,
            **live,
            **_core.panel_limits(),
        }

    def registers(self) -> dict[str, Any]:
        """Return the registers that the board holds, or is assumed to hold; sent after every change."""
        held, array = self.board.registers, None if self._live is None else self._live.array
        values = json.dumps(held)
        return {
            "type": "registers",
            "known": self.board.known,
            "stated": self.registers_stated,
            "values": held,
            "preset": preset_of(held, array),
            "frame_us": _core.registers_words(values)[1],
            "warnings": _core.registers_warnings(values),
        }

    def presets(self) -> dict[str, Any]:
        """Return the names of the presets that the board can hold, and the fields of its registers."""
        array = None if self._live is None else self._live.array
        fitting = list(fitting_presets(self.board.registers, array))
        return {"type": "presets", "built_in": fitting, "fields": fields_of_registers()}

    def zeroed(self, source: _core.PanelLive | None) -> dict[str, Any]:
        """Return the taxels of a live source that were zeroed, each as it was last; sent when that has changed."""
        zeroings = () if self._live is None or source is not self.source else self._live.zeroed
        return {
            "type": "zeroed",
            "taxels": [{"taxel": (z.x, z.y), "t_us": z.t, "rest": z.rest, "before": z.before} for z in zeroings],
        }

    async def recordings(self) -> dict[str, Any]:
        """Return the recordings of the folder, newest first, and its readouts; sent when any was changed."""
        files, readouts = await in_thread(self.folder.listed)
        counts = {name: self.labels.count(name) for name, _, _ in files}
        return {
            "type": "recordings",
            "folder": str(self.folder.path),
            "files": [
                {"name": name, "bytes": size, "modified_ns": at_ns, "labels": counts[name]}
                for name, size, at_ns in files
            ],
            "readouts": readouts,
        }


def _in_sight(before: Live) -> Live:
    """Return a `Live` like one that has ended, so that its sensor stays in sight where another is refused."""
    try:
        return before._again()
    except (OSError, _core.Error):
        # It is not there any more.
        before.stop()
        return before._again(port=None, host=None, sources=_nothing_like(before), readout=None, tare=None)


def _nothing_like(live: Live) -> str:
    """Return the source that gives nothing, with the sensor of another one."""
    rows, columns = live.array.shape
    return f"{live.name}=given,array={rows}x{columns},rate=1"


def _rest_of_held(live: Live) -> Tare:
    """Return the values that the taxels hold now as their rest."""
    values = live.frame.astype(float)
    if not np.nan_to_num(values).any():
        raise ProblemError(
            "read_out: no values of taxels have arrived yet, so their rest is unknown; wait for the board"
        )
    return Tare.take(
        Frames([values, values], [0, 1], unit=live.unit, array=live.array), note="the values when the readout began"
    )
