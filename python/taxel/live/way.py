"""From a board's datagrams to detections, while they come."""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel import _core
from taxel._base.arguments import flag, instance, number, numbers, parameters, several, shown, text, whole
from taxel._base.arguments import path as checked_path
from taxel._core import ProblemError
from taxel.array import Array
from taxel.detect import Readout
from taxel.detections import Detections
from taxel.live.lsl import LslInlet, LslOutlet
from taxel.live.remote import Remote
from taxel.live.sending import PORT
from taxel.recording.remarks import Zeroing
from taxel.tare import Tare
from taxel.wire import Registers

__all__ = ["Live", "Said", "Summary", "delays", "heard"]

#: How what goes to, or comes from, the lab streaming layer begins.
_LSL = "lsl:"

#: The largest column or row of any taxel.
_MOST_PLACE = 2**16 - 1

#: How long an iteration waits at a time.
_WAIT_S = 0.5


class Said(NamedTuple):
    """Say what was detected, and when: all times but the last in us of the board's clock.

    Attributes
    ----------
    label : str
    t : int, us
        When the event was: the crossing less the encoder's latency and the trained delay.
    known : int, us
        When it could first be said: the end of the board's frame in which the potential crosses.
    slope : float, mV/ms
        How steeply the potential crossed its threshold, as a measure of how sure.
    said : int, us
        When it was said, by the host's clock less the estimated offset between the clocks.
    said_ns : int, ns since 1970
        The same by the host's clock.
    repaired : bool
        Whether it may rest on values that states of wire version 2 repaired after a loss.
    """

    label: str
    t: int
    known: int
    slope: float
    said: int
    said_ns: int
    repaired: bool = False


@dataclass(frozen=True)
class Summary:
    """Say how a `Live` ended.

    Attributes
    ----------
    counters : dict
        As `Live.counters`; its sums are closed.
    verdict : str
        One line: nothing lost after arrival, what was lost where, or that nothing came.
    path : Path or None
        The recording; none where nothing came: then an empty one is not kept, and an earlier one is not replaced.
    tare : Tare or None
        The fresh tare, where one was completed.
    """

    counters: dict[str, Any]
    verdict: str
    path: Path | None
    tare: Tare | None

    @property
    def lost(self) -> int:
        """How much was lost after it had arrived: messages in the kernel, datagrams in our queue; 0 is nothing.

        Of a board of another computer also what was lost there and between the two.
        """
        boards = [self.counters, *(one for one in self.counters["sources"].values() if "capture" in one)]
        lost = sum(int(one["capture"]["dropped_by_kernel"] + one["capture"]["dropped_by_queue"]) for one in boards)
        bridged = self.counters["bridged"] or {}
        return lost + sum(int(bridged.get(cause, 0)) for cause in ("missing", "dropped", "dropped_by_kernel"))

    @property
    def nothing_came(self) -> bool:
        """Whether not even a datagram that was lost has come."""
        capture = self.counters["capture"]
        return not capture["messages"] + capture["dropped_by_kernel"]


class Live:
    """Receive a board's datagrams, record them, read them out, while they come.

    A context manager, and an iterator of detections that ends when `stop` was called. The work is done in threads of
    its own: receive, decode and record; encode and read out; while it records, a third receives. What is too slow loses
    data where it is counted.

    Parameters
    ----------
    port : int
        UDP; 0 finds a free one, see `address`.
    host : str
        The address of this machine on which to listen: every one of its addresses by default.
    remote : Remote, optional
        A board of another computer, in place of `port` and `host`. End this before that.
    array : Array
        The sensor; by default the remote board's or the readout's own, or the thesis' 64 x 64.
    registers : str or taxel.wire.Registers
        What the board's registers hold: themselves, or a preset's name, "5.2 kHz", "2 kHz" or "20.8 kHz", of
        which a smaller array drives fewer lines. Left out: as a board of this array is at reset, up to 64 x 64 at
        5.2 kHz; a remote board says what they hold.
    differences : bool
        Whether the board sends differences for intensities (the panel's "delta intensity").
    readout : Readout, optional
        What listens. Left out, nothing is detected.
    tare : Tare or float (s), optional
        For a readout whose encoder needs one: a tare, or how long to take a fresh one from the first event on, which
        ends early where the board marks a start. The board must be at rest then, with its noise floor at 0.
    record : path, optional
        A new file: `.mcap` keeps all that is known, `.lsa` the manual's raw bytes.
    record_later : bool
        Whether recordings are begun and ended while all is heard (`record`, `end_recording`); then none is begun here,
        and `sources` are kept where one runs.
    name : str
        What the board is called in the recording.
    sources : mapping of str to str, optional
        What else the recording (`.mcap`) holds, by name, each with its own clock:
        "udp:HOST:PORT,array=16x16,preset=2 kHz" another board, which sends to that address of this machine;
        "serial:PATH@BAUD" or "pipe:PATH" lines of numbers, as an IMU's ("-" is the standard input); "given" numbers
        that a program gives (`sample`). Of numbers ``columns=t_us:ax:ay`` says what a line holds (else its first line
        is waited for), and ``time=NAME:UNIT`` which column is its clock, where not one called `t_us`,
        `time_ms` ... is; "lsl:NAME" is a stream of the lab streaming layer. Without a clock, a line's time is when it
        came.
    compression : {"none", "lz4", "zstd"}
        Of `.mcap`.
    overwrite : bool
        Whether an existing file may be replaced.
    guard_frames : float, 0 or more
        In silence the readout's time moves on by the host's clock, so many frames behind it.
    gap_frames : float, 0 or more
        At a gap in the sequence of wire version 2 time waits so many frames for what may only be late.
    say : callable, optional
        Called with each `Said` in the thread that made it, one at a time; what it raises ends the way and is raised by
        `next`. Where it takes longer than 2 ms another thread goes on receiving; up to 16 384 detections wait for it.
    lines : bool
        Write each detection to the standard output as one line of JSON, from the thread that made it.
    send : str or sequence of str
        Send each detection as such a line to "udp:HOST:PORT" (a datagram a line), "pipe:PATH" (a named pipe that is
        there) or "serial:PATH@BAUD", from the thread that made it; "lsl:NAME" says its label in a stream of markers of
        the lab streaming layer. Up to 1024 lines wait for who reads slowly; what
        finds no room, or nobody who reads, is lost and counted, and nothing waits for it.
    kernel_buffer_bytes, queue_bytes, readout_events : int, optional
        How much may wait in the kernel, before the decoder and before the readout.
    gro : bool, optional
        Let the kernel hand over trains of datagrams in one piece (`UDP_GRO`). It then counts its drops in trains.

    Raises
    ------
    OSError : the port is taken, the file cannot be created
    FileExistsError : the file is there already and `overwrite` is false
    ProblemError : arguments that make no sense; a readout that needs a tare and has none
    DeviceError : registers that break a rule

    Notes
    -----
    `t` and `known` of a detection are the same here and from the recording; `said` is when it was said in fact. The
    clocks' offset and drift are estimated from arrivals: nothing comes early, so the lower envelope of arrival less
    board time is the offset.

    Examples
    --------
    >>> from taxel.live import send
    >>> with Live(0, host="127.0.0.1") as live:
    ...     sent = send([bytes.fromhex("c000050304")], *live.address, seconds=0.01)
    >>> live.stop().counters["wire"]["changes"] == sent["datagrams"]
    True
    >>> live
    Live(ended; nothing lost after arrival (version 1 of the wire cannot show what was lost before it))
    """

    def __init__(
        self,
        port: int = PORT,
        *,
        host: str = "0.0.0.0",
        remote: Remote | None = None,
        array: Array | None = None,
        registers: str | Registers | None = None,
        differences: bool = False,
        readout: Readout | None = None,
        tare: Tare | float | None = None,
        record: str | os.PathLike[str] | None = None,
        record_later: bool = False,
        name: str = "board",
        sources: Mapping[str, str] | None = None,
        compression: str = "none",
        overwrite: bool = False,
        guard_frames: float = 5.0,
        gap_frames: float = 1.0,
        say: Callable[[Said], object] | None = None,
        lines: bool = False,
        send: str | Sequence[str] = (),
        kernel_buffer_bytes: int | None = None,
        queue_bytes: int | None = None,
        readout_events: int | None = None,
        gro: bool | None = None,
    ) -> None:
        if readout is not None:
            instance("readout", readout, Readout)
        if remote is not None:
            instance("remote", remote, Remote)
            array = remote.array if array is None else array
            registers = Registers._of(remote.registers, remote.array) if registers is None else registers
            differences = flag("differences", differences) or remote.differences
        if array is None and readout is not None:
            array = readout.array
        self.array = Array._of(array)
        goes = [text("send", to) for to in ([send] if isinstance(send, str) else several("send", send))]
        heard_of = _sources(sources)
        outlets = [LslOutlet(to.removeprefix(_LSL)) for to in goes if to.startswith(_LSL)]
        inlets = {what: LslInlet(how.removeprefix(_LSL)) for what, how in heard_of if how.startswith(_LSL)}
        self._inlets = list(inlets.values())
        registers = Registers(array=self.array) if registers is None else registers
        sizes = {
            "kernel_buffer_bytes": kernel_buffer_bytes,
            "queue_bytes": queue_bytes,
            "readout_events": readout_events,
        }
        options = {
            "registers": _held(registers),
            "differences": flag("differences", differences),
            "guard_frames": number("guard_frames", guard_frames),
            "gap_frames": number("gap_frames", gap_frames),
            "gro": None if gro is None else flag("gro", gro),
            "send": [to for to in goes if not to.startswith(_LSL)],
            "name": text("name", name),
            "record_later": flag("record_later", record_later),
            "sources": [(what, _given(inlets[what]) if what in inlets else how) for what, how in heard_of],
            **{what: None if size is None else whole(what, size, 0, 2**31 - 1) for what, size in sizes.items()},
        }
        #: What is needed to begin again on another address.
        self._how: dict[str, Any] = {
            "array": self.array, "registers": registers, "differences": differences, "readout": readout, "tare": tare,
            "record": record, "record_later": record_later, "name": name, "sources": sources,
            "compression": compression, "overwrite": overwrite, "guard_frames": guard_frames,
            "gap_frames": gap_frames, "say": say, "lines": lines, "send": send,
            "kernel_buffer_bytes": kernel_buffer_bytes, "queue_bytes": queue_bytes, "readout_events": readout_events,
            "gro": gro,
        }  # fmt: skip
        self._labels = None if readout is None else list(json.loads(readout.to_json())["neurons"])
        if say is not None and not callable(say):
            raise ProblemError(f"say is {shown(say)}: must be a function of a Said")
        listeners: list[Callable[[Said], object]] = [*outlets, *([] if say is None else [say])]
        if readout is None and tare is not None:
            raise ProblemError("tare without a readout: nothing would use it")
        recording = None
        if record is not None:
            recording = (checked_path("record", record), text("compression", compression), flag("overwrite", overwrite))
        self._summary: Summary | None = None
        feed = None if remote is None else remote._fed(queue_bytes)
        self._core = _core.Live(
            text("host", host),
            whole("port", port, 0, 65_535),
            self.array._parts(),
            parameters(options),
            recording,
            None if readout is None else readout.to_json(),
            tare.to_json() if isinstance(tare, Tare) else None,
            None if tare is None or isinstance(tare, Tare) else _stretch_us(tare),
            None if not listeners else lambda *said: [hear(Said(*said)) for hear in listeners],
            flag("lines", lines),
            feed,
        )
        self._remote, self._place = remote, self._core.place()
        if remote is not None and feed is not None:
            remote._begin(feed)
        for what, inlet in inlets.items():
            inlet.begin(partial(self._core.sample, what))

    @property
    def address(self) -> tuple[str, int]:
        """Host and port that it listens on.

        Raises
        ------
        ProblemError : the board is another computer's
        """
        if self._remote is not None:
            raise ProblemError(f"live: hears {self.place}, and listens on no address of this computer")
        return self._core.address()

    @property
    def place(self) -> str:
        """Where datagrams come from, in words: "UDP 127.0.0.1:5208", or a remote board's address."""
        return self._place

    def next(self, timeout: float = 1.0) -> Said | None:
        """Return the next detection, or None after `timeout` s without one, or at once after the end.

        Raises
        ------
        OSError : the disk is full, the socket failed
        ProblemError : the encoder cannot use what comes
        """
        said = self._core.next(number("timeout", timeout))
        return None if said is None else Said(*said)

    def __iter__(self) -> Iterator[Said]:
        """Yield detections as they come, until `stop` is called."""
        while True:
            over = self._core.is_over()
            said = self.next(0.0 if over else _WAIT_S)
            if said is not None:
                yield said
            elif over:
                return

    @property
    def counters(self) -> dict[str, Any]:
        """What came, what became of it and what was lost where, up to now.

        Keys: `capture` (messages, datagrams, bytes, dropped_by_kernel, dropped_by_queue, waiting, ...), `decoded`
        (datagrams), `wire` (bytes, words, skipped, changes, ... by cause), `wire_version`, `wire_v2` (as
        `taxel.wire_v2.Counts`), `wire_refused` (bytes of version 1 while the board speaks version 2), `wire_changes`,
        `wire_late` (events of version 2 that came when time had gone on without them), `bridged` (None, or of a board
        of another computer: parcels, missing, dropped, dropped_by_kernel, repeated, refused, restarts, silences, heard,
        ended, and clock: here_ns, ahead_ns, drift_ppm, within_ns), `events`, `read_out`, `events_dropped`,
        `late` (events out of order, or more than 0.1 s after a silence), `detections`, `wrong` (those said in a silence
        that was none, because events came later than the guard), `detections_dropped`, `sources` (what came of
        each other source), `sent` (of each destination: to,
        sent, lost, waiting, trouble), `decode_latency` and
        `said_latency` (count, p50_us, p99_us, max_us; None where nothing was measured), `offset` (board_us, host_ns,
        drift_ppm, or None), `board_us`, `markers`, `marked_start`, `seconds`, `taring`.

        Sums: messages at the socket = messages + dropped_by_kernel (a message is a datagram, or a train of them with
        `gro`); datagrams = decoded + dropped_by_queue + waiting; bytes = 5 words + skipped; events = read_out +
        events_dropped; detections = sent + lost + waiting of each destination.
        """
        if self._summary is not None:
            return self._summary.counters
        counters: dict[str, Any] = json.loads(self._core.counters())
        return counters

    @property
    def picture(self) -> NDArray[np.uint16]:
        """What the taxels hold, ticks, shape (rows, columns), ten times a second; 0 until a taxel was heard of."""
        return self._core.picture().reshape(self.array.shape)

    @property
    def tare(self) -> Tare | None:
        """The fresh tare, once it is complete."""
        if self._summary is not None:
            return self._summary.tare
        taken = self._core.tare()
        return None if taken is None else Tare.from_json(taken)

    def take_markers(self) -> list[tuple[int, bool]]:
        """Return the markers that came since this was asked last: (t us, start)."""
        return self._core.take_markers()

    def expect_version(self, version: int) -> None:
        """Say that the board was told to speak this version of the wire: it is believed at once, not after a second.

        Raises
        ------
        ProblemError : no such version
        """
        self._core.expect_version(whole("version", version, 1, 2))

    def source_address(self, name: str) -> tuple[str, int]:
        """Return host and port that another board of the recording is listened to on.

        Raises
        ------
        ProblemError : no other board of that name
        """
        address = self._core.source_address(text("name", name))
        if address is None:
            raise ProblemError(f"source {name!r}: no other board has that name")
        return address

    def sample(self, name: str, values: ArrayLike, arrived_ns: int | None = None) -> None:
        """Keep numbers of a source that is given.

        Parameters
        ----------
        name : str
        values : float, one for each column of the source, its own stamp among them
        arrived_ns : int, ns since 1970, optional
            When they came; now, where it is left out.

        Raises
        ------
        ProblemError : no such source, or other columns
        OSError : the disk is full
        """
        came = None if arrived_ns is None else whole("arrived_ns", arrived_ns, 0)
        self._core.sample(text("name", name), numbers("values", values, np.float64).reshape(-1).tolist(), came)

    def zero(self, x: ArrayLike, y: ArrayLike) -> tuple[Zeroing, ...]:
        """Take what taxels hold now for their rest from now on: for taxels that drift.

        The readout's encoder hears them above that rest, where it reads a tare; the recording keeps the command, with
        the rests before and after, and `taxel.detect.run` applies it. Never done but when asked for: what stands on
        a taxel then would be taken for rest.

        Parameters
        ----------
        x, y : int, or shape (n,)
            Columns and rows.

        Raises
        ------
        ProblemError : a taxel that does not exist or was not heard of yet (names it; then none is zeroed), a tare that
            is being taken, or a `.lsa` that is recorded, which could not keep it
        OSError : the disk is full
        """
        columns, rows = (numbers(name, given, np.int64).reshape(-1) for name, given in (("x", x), ("y", y)))
        if len(columns) != len(rows):
            raise ProblemError(f"x has {len(columns)} columns, y {len(rows)} rows: must be as many")
        for name, given in (("x", columns), ("y", rows)):
            if len(given) and (given.min() < 0 or given.max() > _MOST_PLACE):
                raise ProblemError(
                    f"{name}: holds {given.min() if given.min() < 0 else given.max()}, must be a taxel's"
                )
        return tuple(Zeroing(*one) for one in self._core.zero(list(zip(columns.tolist(), rows.tolist(), strict=True))))

    @property
    def zeroed(self) -> tuple[Zeroing, ...]:
        """What was zeroed last at each taxel that was, by `zero` or a panel."""
        return tuple(Zeroing(*one) for one in self._core.zeroed())

    def note(self, said: str) -> None:
        """Write something down in the recording, with the time of now.

        Raises
        ------
        ProblemError : nothing is recorded, or to a `.lsa`, which holds bytes only
        """
        self._core.note(text("note", said))

    def record(
        self, path: str | os.PathLike[str], *, compression: str = "none", overwrite: bool = False
    ) -> Summary | None:
        """Record what comes from here on, of all sources, beginning with what the taxels hold and the registers.

        A recording that runs ends with what came before: each datagram, and each line, belongs to one of the two.

        Parameters
        ----------
        path : path
            As `record` of the constructor; so are the others.
        compression : {"none", "lz4", "zstd"}
        overwrite : bool

        Returns
        -------
        Summary or None : how the recording that ran ended, with what came while it ran (latencies are of all)

        Raises
        ------
        FileExistsError : the file is there already and `overwrite` is false; the recording that runs goes on
        OSError : the file cannot be created; the disk was full before the end of the one that ran
        ProblemError : `record_later` was not said
        """
        place = checked_path("path", path)
        ended = self._core.record(place, text("compression", compression), flag("overwrite", overwrite))
        return None if ended is None else _summary(ended)

    def record_again(self) -> bool:
        """Have the recording that runs begin anew, where nothing came into it of any source; return whether it does."""
        return self._core.record_again()

    def end_recording(self) -> Summary:
        """End the recording that `record` began; a file to which nothing came is not kept.

        Raises
        ------
        OSError : the disk was full before its end; what was written before stays readable
        ProblemError : nothing is recorded
        """
        return _summary(self._core.end_recording())

    @property
    def records(self) -> bool:
        """Whether a recording that `record` began runs; false where an error ended it, which `end_recording` raises."""
        return self._core.records()

    def stop(self) -> Summary:
        """Work through what came, close the file, and say what was lost; once ended, say it again.

        Raises
        ------
        OSError : the disk is full; what was written before stays readable
        """
        while self._inlets:
            self._inlets.pop().close()
        said = self._core.stop()
        if said is not None:
            self._summary = _summary(said)
        if self._summary is None:
            raise ProblemError("live: ended by an error, which was raised then")
        return self._summary

    def __enter__(self) -> Live:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is None:
            self.stop()
        elif self._summary is None:
            # The first error is the one to hear of.
            with contextlib.suppress(OSError, _core.Error):
                self.stop()

    def __repr__(self) -> str:
        if self._summary is not None:
            return f"Live(ended; {self._summary.verdict})"
        return f"Live({self.place}, {self.array.rows} x {self.array.columns} taxels)"


def _summary(said: str) -> Summary:
    values = json.loads(said)
    path = None if values["path"] is None else Path(values["path"])
    taken = None if values["tare"] is None else Tare.from_json(json.dumps(values["tare"]))
    return Summary(values["counters"], values["verdict"], path, taken)


def _sources(sources: Mapping[str, str] | None) -> list[tuple[str, str]]:
    if sources is None:
        return []
    if not isinstance(sources, Mapping):
        raise ProblemError(f'sources is {shown(sources)}: must be a mapping, as {{"imu": "serial:/dev/ttyACM0"}}')
    return [(text("name of a source", name), text(f"source {name}", what)) for name, what in sources.items()]


def _given(inlet: LslInlet) -> str:
    return f"given,columns={':'.join(inlet.columns)}"


def _held(registers: str | Registers) -> object:
    return json.loads(registers._json()) if isinstance(registers, Registers) else text("registers", registers)


def _stretch_us(seconds: float) -> int:
    stretch = number("tare", seconds)
    if not 1e-6 <= stretch <= 3600:
        raise ProblemError(f"tare is {stretch} s: must lie between 1 us and an hour, or be a taxel.Tare")
    return round(stretch * 1e6)


def delays(measured: dict[str, Any]) -> str:
    """Return median and 99 % of a latency of `Live.counters` in words, or that nothing was measured.

    Examples
    --------
    >>> delays({"count": 5, "p50_us": 41.2, "p99_us": 1300.0, "max_us": 1300.0})
    'p50 41 us, p99 1,300 us'
    >>> delays({"count": 0, "p50_us": None, "p99_us": None, "max_us": None})
    'nothing measured'
    """
    if not measured["count"]:
        return "nothing measured"
    return f"p50 {measured['p50_us']:,.0f} us, p99 {measured['p99_us']:,.0f} us"


def heard(said: Sequence[Said]) -> Detections:
    """Return what was said live as `Detections`."""
    return Detections._of(
        [s.label for s in said],
        [s.t for s in said],
        [s.known for s in said],
        [s.slope for s in said],
        [s.said for s in said],
        [s.repaired for s in said],
    )
