"""From a board's datagrams to detections, as they arrive."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel import _core
from taxel._base.arguments import checked_path, finite, flag, integer, numbers, shown, text
from taxel._base.errors import refused
from taxel._base.limits import VALUE
from taxel._base.messages import counted, escaped
from taxel._base.options import with_fields_of
from taxel._core import ProblemError
from taxel.array import Array
from taxel.detections import Detection
from taxel.live.lines import Lines
from taxel.live.lsl import LslOutlet
from taxel.live.options import LiveOptions
from taxel.live.sources import Sources
from taxel.live.summary import Summary, summary_of
from taxel.reading import Zeroing
from taxel.tare import Tare

#: Prefix of the destinations of the lab streaming layer.
_LSL = "lsl:"

#: How long an iteration waits at a time, s.
_WAIT_S = 0.5


class Live(contextlib.AbstractContextManager["Live"]):
    """Receive a board's datagrams; record and read them out as they arrive.

    It is a context manager, and an iterator of detections that ends after `stop` was called. It works in separate
    threads: one receives, decodes and records, one encodes and reads out, and while it records a third receives. A
    queue that is full drops data, and counts it.

    Parameters
    ----------
    port : int, 0 to 65535, optional
        The UDP port that the board sends to. Default: 5208, unless --source names what to receive. 0 finds a free one,
        see `address`.
    host : str, optional
        The address of this machine to listen on for a board; 0.0.0.0: all.
    array : Array, optional
        Rows, columns and pitch of the sensor. Default: those of the readout, else 64x64x2.67.
    registers : str or Registers, optional
        The board's registers, by a preset: one of `taxel.wire.PRESETS`. Default: those of a board of this array at
        reset. Or their contents. A smaller array drives fewer lines of a preset.
    differences : bool
        The board sends intensity differences. The panel's "delta intensity".
    readout : Readout or PlainRule, optional
        A trained readout or a plain rule; without one nothing is detected.
    use : {"better", "rule", "neuron"}
        What detects each label: better (the better one in training), rule (its plain rule) or neuron. A label with no
        rule is not detected by rule.
    tare : Tare or float, optional
        Rest of the taxels: a saved tare, or the seconds at rest at the beginning, from which a fresh tare is taken. For
        a plain rule, or a readout whose encoder needs one: a tare, or how long to take a fresh one from the first event
        on, s, which ends early where the board marks a start. The board must be at rest then, with its noise floor at
        0.
    absorb_s : float, s, 0 to 1800, optional
        After how many seconds a load that stays becomes rest, in frames of numbers, whose rest follows drift; 0: the
        rest stays as it was measured. Default: as in the training.
    record : path, optional
        Record in a new .mcap file.
    record_later : bool
        Let `record` and `end_recording` begin and end recordings while the `Live` runs. Then none begins when the
        `Live` begins; `sources` are recorded while a recording runs.
    name : str
        The board's name among the sources of the recording.
    sources : mapping of str to str or str or sequence of str, optional
        The source to receive: [NAME=]KIND:PLACE and, after commas, KEY=VALUE; for example lines:-,array=16x16 or
        serial:COM3,array=16x16. It sends frames of numbers, is a board (board:HOST:PORT), or is a further source of a
        recording. "board:HOST:PORT" is a board that sends to that address of this machine (array=ROWSxCOLUMNS,
        preset=NAME). Lines of numbers come from "serial:PLACE" (baud=), "lines:PATH" (a pipe, or a file that grows; "-"
        is the standard input), "lines+tcp:HOST:PORT" (connects), "lines+udp:HOST:PORT" (listens) and "given", what a
        program passes to `sample`. They are read as tables are (commas, brackets, ``NAME:``, JSON, hex). Those of the
        first source, and with ``array=``, are frames: a line each, or ``frame_lines=16``, or up to an empty
        line (``frame_end=blank``), or from a line of text on (``frame_begin=Frame``, and ``frame_time=ms``
        where it states the time); without ``array=`` the shape is that of the readout, if it fits, or guessed
        (`read_as`). ``time=COLUMN:ms`` is the column of the time (by name, or by number from 1; ``time=A+B``
        adds seconds and nanoseconds; without it the time of arrival), ``columns=A:B:C`` names the columns,
        ``leave_out=A:B`` are those without values, ``unit=``, ``falls=`` (true, or the number that readings are
        subtracted from) and ``rate=`` (frames a second; default: measured). Lines without an array of further
        sources, as of an IMU, are recorded with the first source. "lsl:NAME" is a stream of the lab streaming
        layer.
    first_line_s : float, 0 or more
        How long each source of lines may be silent before its first line, s. A source of which the array, the columns
        and the rate are stated may be silent longer: it starts without a line.
    compression : str
        Compression of a .mcap: none, lz4 or zstd.
    overwrite : bool
        Replace output files that exist already.
    guard_frames : float, 0 or more, optional
        How far, in frames, a readout stays behind the host's clock while no events arrive. Default: 3; 5 of a source of
        numbers.
    lines : bool
        Print one line of JSON for each detection, and nothing else.
    send : str or sequence of str
        Send each detection as a line of JSON to serial:PLACE, lines:PATH (a named pipe), lines+tcp:HOST:PORT or
        lines+udp:HOST:PORT. UDP sends a datagram each, TCP connects; the named pipe must exist; ``,baud=`` may follow a
        serial port; "lsl:NAME" sends the label in a stream of markers of the lab streaming layer. Up to 1024 lines wait
        for a slow reader; lines without room, or without a reader, are lost and counted. Without a readout nothing is
        sent until one is chosen on the page.
    say : callable, optional
        Called with each `Detection` in the thread that detected it, one at a time; an exception ends the pipeline and
        is raised by `next`. The function must not call `stop`. Where it takes longer than 2 ms another thread continues
        to receive; up to 16 384 detections wait for it.

    Raises
    ------
    OSError : the port is taken; the file cannot be created, or is being recorded by another program
    FileExistsError : the file is there already and `overwrite` is false
    ProblemError : arguments that are invalid; a readout that needs a tare and has none
    DeviceError : registers that break a rule

    Notes
    -----
    `t` and `known` of a detection are the same live and from the recording; `reported` is the time of its output. The
    offset and drift of the clocks are estimated from arrivals: a delay is never negative, so the lower envelope of
    arrival time minus board time is the offset.

    Examples
    --------
    >>> from taxel.live import send
    >>> with Live(0, host="127.0.0.1") as live:
    ...     sent = send([bytes.fromhex("c000050304")], *live.address, seconds=0.01)
    >>> live.stop().counters["wire"]["changes"] == sent["datagrams"]
    True
    >>> live
    Live(ended; nothing lost after arrival (version 1 of the wire cannot show losses before arrival))
    """

    @with_fields_of(LiveOptions)
    def __init__(self, options: LiveOptions) -> None:
        self._begin(options, ())

    def _begin(self, options: LiveOptions, kept: Sequence[Lines]) -> None:
        """Begin with these options, and with places of lines that are open already."""
        #: Whether the registers were stated; the panel shows no frame rate that is only assumed.
        self._registers_stated = options.registers is not None
        options = options.completed()
        say = options.say
        destinations = options.destinations()
        outlets = [LslOutlet(to.removeprefix(_LSL)) for to in destinations if to.startswith(_LSL)]
        self._sources = sources = Sources(options, kept)
        options = sources.options
        receivers: list[Callable[[Detection], object]] = [*outlets, *([] if say is None else [say])]
        self._summary: Summary | None = None
        with sources.abandoned_on_error():
            self._core = _core.Live(
                sources.for_rust([to for to in destinations if not to.startswith(_LSL)]),
                None if options.record is None else checked_path("record", options.record),
                None if not receivers else lambda values: [receive(Detection(**values)) for receive in receivers],
            )
        array, name = self._core.sensor()
        self.array = Array._from_geometry(array)
        #: The name of the source that is read out.
        self.name = name
        layout = self._core.frame_layout()
        #: The unit of the values.
        self.unit: str = "ticks" if layout is None else layout[0]
        #: The length of frames of numbers, us; None of a board.
        self.frame_us: float | None = None if layout is None else layout[1]
        #: Whether the source states that unit, as a board does; else it is the readout's.
        self._states_unit = sources.states_unit
        #: To begin another one on another address.
        self._options = replace(options, array=self.array)
        #: How the lines that are read out were understood, if what they are was not stated; else "".
        self.read_as = sources.read_as
        self._place = self._core.place()
        #: Where a board is received; nowhere of a source of frames.
        self._listened_on = self._core.address() if self.frame_us is None else (None, None)
        sources.begin(self._core)

    def _again(self, **changed: Any) -> Live:
        """Return another `Live` that works alike, with other options; by default it receives from the same place.

        After `_pause` it goes on to read the places of lines, which stayed open.
        """
        host, port = self._listened_on
        same = {"host": host, "port": port} | ({} if self._registers_stated else {"registers": None})
        again = Live.__new__(Live)
        again._begin(replace(self._options, **{**same, **changed}), self._sources.lines)
        # What it has begun with is no longer closed here.
        self._sources.lines = []
        return again

    def _pause(self) -> None:
        """End as `stop` does, but keep the places of lines open for `_again`."""
        self._sources.pause()
        self._end()

    @property
    def address(self) -> tuple[str, int]:
        """Host and port on which it listens."""
        return self._core.address()

    @property
    def place(self) -> str:
        """The origin of the datagrams: "UDP 127.0.0.1:5208", or the place of frames of numbers."""
        return self._place

    @property
    def is_over(self) -> bool:
        """Whether it has ended, by `stop` or an error."""
        return self._core.is_over()

    def next(self, timeout: float = 1.0) -> Detection | None:
        """Return the next detection, or None after `timeout` without one, or at once after the end.

        Parameters
        ----------
        timeout : float, s, 0 or more

        Raises
        ------
        OSError : the disk is full, the socket failed
        ProblemError : the encoder cannot read the events

        Examples
        --------
        >>> with Live(0, host="127.0.0.1") as live:
        ...     live.next(0.0) is None
        True
        """
        values = self._core.next(finite("timeout", timeout, least=0.0, most=1e9))
        return None if values is None else Detection(**values)

    def __iter__(self) -> Iterator[Detection]:
        """Yield detections as they come, until `stop` is called."""
        while True:
            over = self.is_over
            detection = self.next(0.0 if over else _WAIT_S)
            if detection is not None:
                yield detection
            elif over:
                return

    @property
    def counters(self) -> dict[str, Any]:
        """Counts of what was received, decoded and lost so far, by place.

        Keys: `capture` (messages, datagrams, bytes, dropped_by_kernel, dropped_by_queue, waiting, ...;
        dropped_by_kernel is None where the system does not count it), `decoded` (datagrams),
        `wire` (bytes, words, skipped, changes, ... by cause), `wire_version`, `wire_v2` (as
        `taxel.wire.Counts`), `wire_refused` (bytes of version 1 while the board speaks version 2), `wire_changes`,
        `wire_late` (events of version 2 that arrived after time had passed theirs), `wire_jumps` (of the times of
        version 1 ahead of this computer's clock), `wire_repeated` (datagrams of version 1 that came again),
        `wire_empty` (those without bytes), `wire_overtaken` and `wire_far_behind` (events of version 2 before an
        earlier one's time, by 0.1 s or less and by more), `wire_steps_back` (how often times stepped back),
        `arrived_ns` (when the latest datagram arrived, ns since 1970, or None),
        `heartbeat_us` (the longest interval between heartbeats of a board of version 2, or None), `arrival` (state:
        "nothing", "arriving", "quiet" or "lost"; since_ns, silent_s, heartbeat_us; not of one that has ended),
        `verdict` (status, lost, damaged, ...: that of a recording of all so far; not of one that has ended),
        `events`, `read_out`, `events_dropped`,
        `late` (events out of order), `detections`, `wrong` (those output in a
        silence that an event then interrupted, later than the guard), `detections_dropped`, `sources` (these counts of
        each other source), `lines` (of a board None; else lines, strange, bytes_in_no_line, bytes_of_unfinished_lines,
        trouble, and unread: by kind the lines in no frame, with the first), `frames`, `sent` (of each destination: to,
        sent, lost, waiting, trouble), `decode_latency` and
        `report_latency` (count, p50_us, p99_us, max_us; None where nothing was measured, as where the
        kernel does not stamp arrivals), `offset` (board_us, host_ns,
        drift_ppm, or None), `pace` (drift_ppm, delay: as a latency, beyond the shortest; doubt: why they cannot be, or
        None; None at first), `board_us`, `markers`, `marked_start`, `seconds`, `taring`,
        `left_floor` (of frames whose rest has left the noise floor of the training: since_us, and how many taxels'
        at most; else None).

        Sums: messages at the socket = messages + dropped_by_kernel (a message is a datagram, or a train of them that
        the kernel joined); datagrams = decoded + dropped_by_queue + waiting; bytes = 5 words + skipped; events =
        read_out + events_dropped; detections = sent + lost + waiting of each destination.
        """
        if self._summary is not None:
            return self._summary.counters
        return self._sources.with_unread(self._core.counters())

    @property
    def frame(self) -> NDArray[np.uint16] | NDArray[np.float32]:
        """Values that the taxels hold, in `unit`, shape (rows, columns), ten times a second.

        For a board, a taxel without any event so far is 0; for frames of numbers, values are NaN before the first
        frame.
        """
        if self.frame_us is None:
            return self._core.frame().reshape(self.array.shape)
        values = self._core.values()
        return (values if len(values) else np.full(self.array.taxels, np.nan, np.float32)).reshape(self.array.shape)

    @property
    def tare(self) -> Tare | None:
        """The fresh tare, once it is complete."""
        if self._summary is not None:
            return self._summary.tare
        text_of_tare = self._core.tare()
        return None if text_of_tare is None else Tare.from_json(text_of_tare)

    def take_markers(self) -> list[tuple[int, bool]]:
        """Return the markers that were received since the last call: (t us, start)."""
        return self._core.take_markers()

    def expect_version(self, version: int) -> None:
        """Announce that the board was set to this version of the wire: it is decoded at once, not after a second.

        Parameters
        ----------
        version : int, from 1 to 2

        Raises
        ------
        ProblemError : no such version

        Examples
        --------
        >>> with Live(0, host="127.0.0.1") as live:
        ...     live.expect_version(2)
        """
        self._core.expect_version(integer("version", version, 1, 2))

    def source_address(self, name: str) -> tuple[str, int]:
        """Return host and port that another board of the recording sends to.

        Parameters
        ----------
        name : str
            Name of the source, as in `sources`.

        Raises
        ------
        ProblemError : no further board of this recording has that name

        Examples
        --------
        >>> with Live(0, host="127.0.0.1") as live:
        ...     live.source_address("left")
        Traceback (most recent call last):
        taxel.ProblemError: source 'left': this recording has no further board of that name
        """
        address = self._core.source_address(text("name", name))
        if address is None:
            raise ProblemError(f"source {name!r}: this recording has no further board of that name")
        return address

    def sample(self, name: str, values: ArrayLike, arrived_ns: int | None = None) -> None:
        """Record numbers of a source whose values a program passes.

        For a source with an array, they are those of a line of a frame.

        Parameters
        ----------
        name : str
            Name of the source, as in `sources`.
        values : float, shape (columns,), each in the unit of its column (s, m/s2 ...)
            One for each column, with its own time stamp; NaN where a value is missing.
        arrived_ns : int, ns since 1970, optional
            Time of their arrival. Default: now.

        Raises
        ------
        ProblemError : no such source, or other columns
        OSError : the disk is full
        """
        arrival = None if arrived_ns is None else integer("arrived_ns", arrived_ns, 0)
        row = numbers("values", values, np.float64).reshape(-1)
        for k in np.flatnonzero(np.abs(row) > VALUE)[:1]:
            raise refused("values", f"[{k}] is {shown(row[k].item())}: must fit 32 bits, or be NaN if it is missing")
        self._sources.sample(text("name", name), row.tolist(), arrival)

    def zero(self, x: ArrayLike, y: ArrayLike) -> tuple[Zeroing, ...]:
        """Use the present values of taxels as their rest from this time: for taxels that drift.

        The new rest of a taxel of frames, which are noisy, is the median of its last second. An encoder with a tare
        reads the taxels above that rest; the recording contains the zeroing, with the rests before and after, and
        `taxel.detect.run` applies it. Only done on request: done automatically, it would use a standing load as the
        rest.

        Parameters
        ----------
        x, y : int, or shape (n,), 0 or more
            Columns and rows.

        Raises
        ------
        ProblemError : a taxel that does not exist or has had no event so far (names it; then none is zeroed), or a tare
            that is being taken
        OSError : the disk is full
        """
        columns, rows = (numbers(name, value, np.uint16).reshape(-1) for name, value in (("x", x), ("y", y)))
        if len(columns) != len(rows):
            counts = f"{counted(len(columns), 'column')}, but y has {counted(len(rows), 'row')}"
            raise refused("x", f" has {counts}: must be as many rows as columns")
        return tuple(
            Zeroing(**zeroing) for zeroing in self._core.zero(list(zip(columns.tolist(), rows.tolist(), strict=True)))
        )

    @property
    def zeroed(self) -> tuple[Zeroing, ...]:
        """The latest zeroing of each taxel that was zeroed, by `zero` or a panel."""
        return tuple(Zeroing(**zeroing) for zeroing in self._core.zeroed())

    def note(self, message: str) -> None:
        """Write a note into the recording, with the current time.

        Parameters
        ----------
        message : str
            The text.

        Raises
        ------
        ProblemError : nothing is recorded

        Examples
        --------
        >>> import tempfile, taxel
        >>> path = f"{tempfile.mkdtemp()}/walk.mcap"
        >>> with Live(0, host="127.0.0.1", record=path) as live:
        ...     live.note("heel strike")
        >>> taxel.open(path).notes[0].text
        'heel strike'
        """
        self._core.note(text("note", message))

    def record(
        self, path: str | os.PathLike[str], *, compression: str = "none", overwrite: bool = False
    ) -> Summary | None:
        """Record what arrives after this call, from all sources, beginning with the registers and the held values.

        The previous recording ends with the data that arrived before: each datagram, and each line, belongs to one of
        the two.

        Parameters
        ----------
        path : path
            A new file, as `record` of the constructor.
        compression : {"none", "lz4", "zstd"}
            Compression of a `.mcap`.
        overwrite : bool
            Whether an existing file may be replaced.

        Returns
        -------
        Summary or None : of the previous recording, with the counts since its beginning (latencies are of all)

        Raises
        ------
        FileExistsError : the file is there already and `overwrite` is false; the previous recording continues
        OSError : the file cannot be created; the disk was full before the end of the previous one
        ProblemError : `record_later` was not given
        """
        file = checked_path("path", path)
        ended = self._core.record(file, text("compression", compression), flag("overwrite", overwrite))
        return None if ended is None else summary_of(ended)

    def record_again(self) -> bool:
        """Restart the recording, if no source has sent anything yet; return whether that was so."""
        return self._core.record_again()

    def end_recording(self) -> Summary:
        """End the recording that `record` began; a file without any data is removed.

        Raises
        ------
        OSError : the disk was full before its end; what was written before stays readable
        ProblemError : nothing is recorded
        """
        return summary_of(self._core.end_recording())

    @property
    def records(self) -> bool:
        """Whether a recording that `record` began runs; false where an error ended it, which `end_recording` raises."""
        return self._core.records()

    def stop(self) -> Summary:
        """Process what has arrived, close the file, and return a summary; every call returns the same one.

        Raises
        ------
        OSError : the disk is full, and what was written before stays readable
        ProblemError : called by `say`, or after an end by an error
        """
        self._sources.close()
        return self._end()

    def _end(self) -> Summary:
        if self._summary is None:
            self._summary = summary_of(self._core.stop())
            self._sources.with_unread(self._summary.counters)
        return self._summary

    def __exit__(self, _kind: object, error: object, _trace: object) -> None:
        if error is None:
            self.stop()
        elif self._summary is None:
            # The first error is the one to report.
            with contextlib.suppress(OSError, _core.Error):
                self.stop()

    def __repr__(self) -> str:
        if self._summary is not None:
            return escaped(f"Live(ended; {self._summary.verdict})")
        return escaped(f"Live({self.place}, {self.array.rows} x {self.array.columns} taxels)")
