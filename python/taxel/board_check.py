"""A check of a board: what is lost, which taxels send, whether its pattern is right, and its noise at rest."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel._base.arguments import callback, integer, number, text
from taxel._base.errors import refused
from taxel._base.messages import counted
from taxel._core import FIREWALL
from taxel.array import Array
from taxel.device import Device
from taxel.events import Events
from taxel.live import Live, Summary
from taxel.live.sending import PORT
from taxel.recording.opening import open_one
from taxel.recording.recording import Recording
from taxel.wire import Registers

__all__ = ["BoardCheck", "Finding", "check_board"]

#: How long the first datagram may take, s, and how long a board may take to answer: a simulated one is slow.
_PATIENCE_S, _ANSWER_S = 10.0, 30.0
#: Interval at which it is looked whether a datagram has come, s.
_LOOK_S = 0.02
#: Number of frames after which the numbers of the pattern's frames begin again.
_FRAMES = 65_536
#: Frames that may be of the registers before.
_AHEAD = 64
#: Fewer values than this cannot show which frame of the pattern they are of; so many are compared to find it.
_FEWEST, _COMPARED = 32, 64
#: Frames from which the noise is measured.
_LAST = 2000


@dataclass(frozen=True)
class Finding:
    """The result of one check.

    Parameters
    ----------
    name : {"losses", "taxels", "pattern", "rest"}
    good : bool or None
        Whether it is as it must be; None where it is only reported.
    text : str
        A sentence.

    Examples
    --------
    >>> print(Finding("losses", True, "no number is missing"))
    ok    losses: no number is missing
    """

    name: str
    good: bool | None
    text: str

    def __str__(self) -> str:
        return f"{ {True: 'ok', False: 'FAULT', None: 'note'}[self.good]:5} {self.name}: {self.text}"


@dataclass(frozen=True)
class BoardCheck:
    """What a check of a board found.

    Parameters
    ----------
    findings : tuple of Finding
        Results in the order of the checks.
    noise : float, shape (rows, columns), ticks, or None
        The standard deviation of each taxel at rest; None where nothing arrived.

    Examples
    --------
    >>> BoardCheck((Finding("losses", False, "nothing arrived"),), None).good
    False
    """

    findings: tuple[Finding, ...]
    noise: NDArray[np.float64] | None

    @property
    def good(self) -> bool:
        """Whether no fault was found."""
        return all(finding.good is not False for finding in self.findings)


def check_board(
    place: str,
    *,
    port: int = PORT,
    host: str = "0.0.0.0",
    seconds: float = 4.0,
    say: Callable[[Finding], object] | None = None,
) -> BoardCheck:
    """Check a board by the pattern that it makes itself, and then its converter at rest, while nothing touches it.

    The board sends version 2 of the wire meanwhile; afterwards its registers are as before.

    Parameters
    ----------
    place : str
        The board's serial port ("COM3", "/dev/ttyACM0"), or host:port of an emulated board.
    port : int, 1 to 65535
        The UDP port that the board sends to.
    host : str
        The address of this machine to listen on; "0.0.0.0": all.
    seconds : float, s, 0.1 to 3600
        Duration of each of the two parts.
    say : callable, optional
        Called with each `Finding` as it is made.

    Returns
    -------
    BoardCheck

    Raises
    ------
    OSError : the port is taken, or the serial line cannot be opened
    DeviceError : the board does not answer, or refuses
    ProblemError : invalid arguments

    Notes
    -----
    The pattern's formula is in *Registers*, *The pattern*.

    Examples
    --------
    >>> check_board("COM3", port=0)
    Traceback (most recent call last):
    taxel.ProblemError: port ...
    """
    where = integer("port", port, 1, 65_535)
    if not 0.1 <= number("seconds", seconds) <= 3600:
        raise refused("seconds", f" is {seconds:g}: must be from 0.1 to 3600")
    told = None if say is None else callback("say", say)
    findings: list[Finding] = []

    def tell(*found: Finding) -> None:
        findings.extend(found)
        for finding in found:
            if told is not None:
                told(finding)

    def received(file: Path) -> Live:
        return Live(where, host=text("host", host), array=device.array, registers=registers, record=file)

    noise = None
    with Device(place, timeout=_ANSWER_S) as device, tempfile.TemporaryDirectory() as folder:
        before = device.registers
        try:
            registers = device.set(wire_version=2, pattern=True, mechanoreceptor=False, frame_sync=True)
            queue = device.faults.get("queue", 0)
            with received(Path(folder, "pattern.mcap")) as live:
                summary = _receive(live, seconds)
            if summary.path is None:
                tell(Finding("losses", False, f"nothing arrived at port {where} within {_PATIENCE_S:g} s{FIREWALL}"))
            else:
                events = open_one(summary.path).events
                tell(_losses(summary, device.faults.get("queue", 0) - queue), _taxels(events, registers))
                tell(_pattern(events, device.array, registers))
                # With a ramp of a tick all taxels hold 0 or 1; then each that reads more sends its value.
                device.set(pattern=False, noise_floor=0, ramp=1)
                late = device.faults.get("comparator", 0)
                with received(Path(folder, "rest.mcap")) as live:
                    device.set(ramp=registers.ramp)
                    rest = _receive(live, seconds)
                late = device.faults.get("comparator", 0) - late
                values = (
                    np.zeros((1, *device.array.shape))
                    if rest.path is None
                    else _at_rest(open_one(rest.path), registers)
                )
                noise = values.std(axis=0)
                tell(_rest(values.mean(axis=0), noise, registers, late))
        finally:
            device.apply(before)
    return BoardCheck(tuple(findings), noise)


def _receive(live: Live, seconds: float) -> Summary:
    """Record for so long from the first datagram on; end where none comes."""
    until = time.monotonic() + _PATIENCE_S
    while not live.counters["capture"]["messages"] and time.monotonic() < until:
        time.sleep(_LOOK_S)
    if live.counters["capture"]["messages"]:
        time.sleep(seconds)
    return live.stop()


def _losses(summary: Summary, dropped: int) -> Finding:
    """Tell what the recording and the board count."""
    words = [] if summary.verdict.status == "complete" else [str(summary.verdict)]
    if dropped:
        words.append(f"the board dropped {counted(dropped, 'event')} (fault queue)")
    return Finding("losses", not words, "; ".join(words) or "no number is missing")


def _taxels(events: Events, registers: Registers) -> Finding:
    """Tell which taxels the pattern, which reaches all of them, has reached."""
    array = events.array
    seen = _sent(events)
    period = max(256 << (array.columns - 1).bit_length(), 32 << (array.rows - 1).bit_length())
    frames = events.duration_us / registers.frame_us
    words = f"{int(seen.sum())} of {seen.size} taxels sent an event in {counted(int(frames), 'frame')}"
    if seen.all():
        return Finding("taxels", True, words)
    if frames < period:
        return Finding("taxels", None, f"{words}; the pattern reaches all within {period}")
    missing = _lines_of(~seen)
    return Finding("taxels", False, f"{words}{f': look at {missing}' if missing else ''}")


def _pattern(events: Events, array: Array, registers: Registers) -> Finding:
    """Compare each value with the pattern's; which of its frames is the first is found by the values."""
    frame = np.rint((events.t - events.t[:1]) / registers.frame_us).astype(np.int64)
    given = frame >= _AHEAD
    for flags, is_given in ((events.present, True), (events.repaired, False)):
        if flags is not None:
            given &= flags == is_given
    if events.intensity is None or given.sum() < _FEWEST:
        words = f"{int(given.sum())} values are too few to find the pattern: does the board send intensities?"
        return Finding("pattern", False, words)
    x, y, frame, value = events.x[given], events.y[given], frame[given], events.intensity[given]

    def expected(at: NDArray[np.int64], begin: NDArray[np.int64]) -> NDArray[np.uint16]:
        numbers = (frame[at] + begin[:, None]) % _FRAMES
        shape = numbers.shape
        rows, lines = (np.broadcast_to(column[at], shape).ravel() for column in (y, x))
        values = _core.pattern_values(
            array,
            lines.astype(np.uint16),
            rows.astype(np.uint16),
            numbers.ravel().astype(np.uint16),
            registers.ramp,
        )
        return values.reshape(shape)

    some = np.unique(np.linspace(0, len(value) - 1, _COMPARED).astype(np.int64))
    begins = np.arange(_FRAMES)
    begin = begins[int((expected(some, begins) == value[some]).sum(axis=1).argmax())]
    right = expected(np.arange(len(value)), begin[None])[0]
    wrong = np.flatnonzero(right != value)
    if not len(wrong):
        return Finding("pattern", True, f"all {len(value)} values are those of the pattern")
    k = wrong[0]
    is_bit = int(right[k] ^ value[k]).bit_count() == 1
    bit = ": one bit differs, so the link is disturbed, or its clock does not suit the PHY" if is_bit else ""
    words = f"{len(wrong)} of {len(value)} values are not those of the pattern; the first is {value[k]} of taxel"
    return Finding("pattern", False, f"{words} ({x[k]}, {y[k]}), and must be {right[k]}{bit}")


def _sent(events: Events) -> NDArray[np.bool_]:
    """Return which taxels sent a value, not only the board's refresh: a comparator that never returns has none."""
    own = np.ones(len(events), bool) if events.repaired is None else ~events.repaired
    sent = np.zeros(events.array.shape, bool)
    sent[events.y[own], events.x[own]] = True
    return sent


def _at_rest(recording: Recording, registers: Registers) -> NDArray[np.float64]:
    """Return what taxels read at last, in ticks, shape (n, rows, columns), once the ramp was set; 0 where none came."""
    first, last = (int(t) for t in recording.events.t[[0, -1]])
    # A board that answers slowly is given its ramp while it records: its last quarter is after that.
    begin = last - min(_LAST * registers.frame_us, (last - first) / 4)
    values = recording.between(begin, last + 1).frames(1e6 / registers.frame_us).values.astype(np.float64)
    return np.where(_sent(recording.events), values, 0.0)


def _rest(mean: NDArray[np.float64], noise: NDArray[np.float64], registers: Registers, late: int) -> Finding:
    """Tell what the comparators read while nothing touches the sensor."""
    read = np.zeros(mean.shape, bool)
    read[:, : registers.lines] = True
    faults = []
    if late:
        faults.append(f"comparators had not returned when their ramp began ({counted(late, 'time')})")
    full = read & (mean >= registers.ramp)
    if full.any():
        words = f"{counted(int(full.sum()), 'taxel')} stay at the ramp's end, {registers.ramp} ticks"
        faults.append(f"{words}: is no comparator connected there ({_lines_of(full) or 'no whole line'})?")
    zero = read & (mean <= 1)
    silent = f"{counted(int(zero.sum()), 'taxel')} stay at 0 or 1 ({_lines_of(zero) or 'no whole line'})"
    row, column = np.unravel_index(noise.argmax(), noise.shape)
    spread = f"the standard deviation is {np.median(noise[read]):.2f} ticks (median), at most {noise.max():.2f}"
    words = f"{spread} at taxel ({column}, {row}), with a noise floor of {registers.noise_floor} ticks"
    return Finding("rest", not faults, "; ".join([*faults, *([silent] if zero.any() else []), words]))


def _lines_of(taxels: NDArray[np.bool_]) -> str:
    """Name the lines of which all taxels are meant, where not all lines are."""
    rows, columns = np.flatnonzero(taxels.all(axis=1)), np.flatnonzero(taxels.all(axis=0))
    named = []
    for name, lines, count in (("sense line", rows, taxels.shape[0]), ("driven line", columns, taxels.shape[1])):
        if 0 < len(lines) < count:
            named.append(f"{name}{'s' * (len(lines) > 1)} {', '.join(map(str, lines))}")
    return " and ".join(named)
