"""Whether a board works: its link by the pattern that it makes itself, then its converter at rest."""

from __future__ import annotations

import contextlib
import ipaddress
import math
import socket
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import psutil
from numpy.typing import NDArray

from taxel import _core
from taxel._base.arguments import callback, integer, number, text
from taxel._base.errors import refused
from taxel._base.messages import counted
from taxel._core import DeviceError, ProblemError
from taxel.array import Array
from taxel.device import Device
from taxel.live.sending import PORT
from taxel.wire import PRESETS, Counts, Decoder, Registers

__all__ = ["BoardCheck", "Difference", "Finding", "PatternCheck", "RestCheck", "check_board"]

#: Where the board of `rtl/boards` sends to: no address is resolved, so a host must have this one.
HOST = "192.168.52.1"

#: The first byte of a datagram of version 2 (docs/wire-v2.md).
_MAGIC = 0x54
#: What the kernel is asked to hold, bytes; the largest datagram.
_WAITING, _LARGEST = 1 << 25, 65_535
#: How long the first datagram may take, s.
_PATIENCE_S = 10.0
#: How long it may take to read what the kernel holds, s.
_DRAINED_S = 5.0
#: How long a board may take to answer on its serial line, s: a simulated one is slow.
_ANSWER_S = 30.0
#: After which the numbers of the pattern's frames begin anew.
_FRAMES = 65_536
#: Frames that may be of the comparators still as the pattern is switched on.
_AHEAD = 64
#: Of the values, the share that an assumption about the frames' number must explain.
_EXPLAINED = 0.5
#: Resolution of a stamp of version 1, us.
_STAMP_US = 100.0


@dataclass(frozen=True)
class Finding:
    """Hold one thing that was looked at.

    Parameters
    ----------
    name : str
        As "address" or "values".
    good : bool or None
        Whether it is as it must be; None where it is only told.
    text : str
        A sentence.

    Examples
    --------
    >>> print(Finding("version", True, "the datagrams are of version 2"))
    ok    version: the datagrams are of version 2
    """

    name: str
    good: bool | None
    text: str

    def __str__(self) -> str:
        return f"{ {True: 'ok', False: 'FAULT', None: 'note'}[self.good]:5} {self.name}: {self.text}"


@dataclass(frozen=True)
class Difference:
    """Hold a value that is not the pattern's.

    Parameters
    ----------
    t : int, us
        The board's time.
    x, y : int, 0 or more
        Column and row of the taxel.
    frame : int, 0 or more
        The number of the pattern's frame.
    expected, value : int, ticks
    meaning : str
        What it may mean.

    Examples
    --------
    >>> Difference(192, 3, 4, 1, expected=60, value=61, meaning="one bit differs").expected
    60
    """

    t: int
    x: int
    y: int
    frame: int
    expected: int
    value: int
    meaning: str


@dataclass(frozen=True)
class PatternCheck:
    """Hold what arrived while a board made its pattern.

    Parameters
    ----------
    registers : Registers
        Those of the board, or, without its serial line, the preset that explains the values best.
    version : int, 1 or more
        Of the wire.
    datagrams, events, frames : int, 0 or more
        How many arrived, and how many stamps have an event.
    counts : Counts
        What the decoder found missing or damaged.
    taxels : int, 0 or more
        How many taxels had an event.
    wrong : int, 0 or more
        Events whose value is not the pattern's.
    behind : int, 0 or more
        Taxels that, at the end of some frame, hold a value further from the pattern's than the noise floor.
    first : Difference or None
        The first of either.
    speed : float
        The board's time that passes in a second of the host's, s; of a simulated board far below 1.

    Examples
    --------
    `check_board` makes it.
    """

    registers: Registers
    version: int
    datagrams: int
    events: int
    frames: int
    counts: Counts
    taxels: int
    wrong: int
    behind: int
    first: Difference | None
    speed: float


@dataclass(frozen=True)
class RestCheck:
    """Hold what a board reads at rest, with a noise floor of 0.

    Parameters
    ----------
    registers : Registers
    faults : int, 0 or more
        How often a comparator had not returned when its ramp began.
    values : float, shape (rows, columns), ticks
        The mean of each taxel; nan where it gave no value, which one that stays at 0 or 1 does.
    noise : float, shape (rows, columns), ticks
        The standard deviation of each taxel, nan likewise.
    silent, full : bool, shape (rows, columns)
        Taxels that gave no value; and those that stay at the ramp's end.

    Examples
    --------
    `check_board` makes it.
    """

    registers: Registers
    faults: int
    values: NDArray[np.float64]
    noise: NDArray[np.float64]
    silent: NDArray[np.bool_]
    full: NDArray[np.bool_]


@dataclass(frozen=True)
class BoardCheck:
    """Hold what a check of a board found.

    Parameters
    ----------
    findings : tuple of Finding
        In the order in which they were looked at.
    pattern : PatternCheck or None
        None where nothing arrived that could be compared.
    rest : RestCheck or None
        None where it was not looked at: without the serial line, or where no datagram arrived.

    Examples
    --------
    >>> BoardCheck((Finding("datagrams", False, "none within 10 s"),), None, None).good
    False
    """

    findings: tuple[Finding, ...]
    pattern: PatternCheck | None
    rest: RestCheck | None

    @property
    def good(self) -> bool:
        """Whether nothing was found that must not be."""
        return all(finding.good is not False for finding in self.findings)


@dataclass
class _Capture:
    """What arrived, and where."""

    datagrams: list[bytes] = field(default_factory=list)
    arrived_us: list[int] = field(default_factory=list)
    sender: str = ""
    interface: str = ""
    destination: str = ""


class _Receiver:
    """The port that a board sends to."""

    def __init__(self, host: str, port: int) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _WAITING)
            # Linux tells by which interface a datagram came, and to which address.
            self.socket.setsockopt(socket.IPPROTO_IP, getattr(socket, "IP_PKTINFO", 8), 1)
            self.socket.bind((host, port))
        except BaseException:
            self.socket.close()
            raise

    def take(self, seconds: float, patience: float) -> _Capture:
        """Receive for so long from the first datagram on, which may take up to `patience` s."""
        capture, until = _Capture(), time.monotonic() + patience
        while (left := until - time.monotonic()) > 0:
            self.socket.settimeout(left)
            try:
                data, ancillary, _, (host, port) = self.socket.recvmsg(_LARGEST, 64)
            except TimeoutError:
                break
            if not capture.datagrams:
                until = time.monotonic() + seconds
                capture.sender = f"{host}:{port}"
                for level, _, info in ancillary:
                    if level == socket.IPPROTO_IP and len(info) >= 12:
                        with contextlib.suppress(OSError):
                            capture.interface = socket.if_indextoname(int.from_bytes(info[:4], "little"))
                        capture.destination = str(ipaddress.IPv4Address(info[8:12]))
            capture.datagrams.append(data)
            capture.arrived_us.append(round(time.monotonic() * 1e6))
        return capture

    def drain(self, seconds: float) -> None:
        """Let pass what has arrived, and what arrives within so long; then what waits."""
        begun = time.monotonic()
        while (passed := time.monotonic() - begun) < seconds + _DRAINED_S:
            self.socket.settimeout(max(seconds - passed, 0.0))
            try:
                self.socket.recv(_LARGEST)
            except (TimeoutError, BlockingIOError):
                if passed >= seconds:
                    return


@dataclass(frozen=True)
class _Values:
    """The values of events as they were decoded, without those repaired by a state."""

    version: int
    counts: Counts
    t: NDArray[np.int64]
    x: NDArray[np.uint16]
    y: NDArray[np.uint16]
    value: NDArray[np.uint16]
    speed: float

    @property
    def resolution_us(self) -> float:
        return _STAMP_US if self.version == 1 else 1.0


def _decoded(capture: _Capture, array: Array) -> _Values:
    """Decode all datagrams."""
    version = 2 if capture.datagrams[0][:1] == bytes([_MAGIC]) else 1
    decoder, parts, times = Decoder(2 if version == 2 else 1, array=array), [], []
    for datagram, arrived in zip(capture.datagrams, capture.arrived_us, strict=True):
        for events in (decoder.push(datagram, arrived), decoder.end_of_datagram()):
            if not len(events):
                continue
            times.append((int(events.t[-1]), arrived))
            if events.intensity is None:
                continue
            here = np.ones(len(events), bool) if events.present is None else events.present
            if events.repaired is not None:
                here = here & ~events.repaired
            parts.append((events.t[here], events.x[here], events.y[here], events.intensity[here]))
    columns = [np.concatenate(column) for column in zip(*parts, strict=True)] if parts else [np.empty(0, np.int64)] * 4
    t, x, y, value = columns[0], *(column.astype(np.uint16) for column in columns[1:])
    passed = times[-1][1] - times[0][1] if times else 0
    speed = (times[-1][0] - times[0][0]) / passed if passed > 0 else math.nan
    return _Values(version, decoder.counts, t, x, y, value, speed)


class _Frames:
    """Which frames of the pattern events may be of, by their times.

    A stamp is the start of a frame, rounded down to the resolution of the version of the wire. So an event is of one of
    `several` frames, which are more than one where several have the same stamp.
    """

    def __init__(self, registers: Registers, anchor_us: int, resolution_us: float) -> None:
        self.frame_us, self.anchor_us, self.resolution_us = registers.frame_us, anchor_us, resolution_us
        self.several = max(math.ceil(resolution_us / self.frame_us), 1)
        self.number, self.after_us = 0, resolution_us / 2

    def first(self, t: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the first frame that each time may be of."""
        since = (t - self.anchor_us - self.after_us) / self.frame_us
        return self.number + np.ceil(np.round(since, 6)).astype(np.int64)


def _period(array: Array) -> int:
    """Return the number of frames after which the pattern repeats itself."""
    return max(256 << (array.columns - 1).bit_length(), 32 << (array.rows - 1).bit_length())


def _expected(array: Array, registers: Registers, x: Any, y: Any, frames: NDArray[np.int64]) -> NDArray[np.uint16]:
    """Return the pattern's values of taxels in frames."""
    x, y, n = np.broadcast_arrays(x, y, (frames % _FRAMES).astype(np.uint16))
    x, y, n = (np.ascontiguousarray(column.ravel(), np.uint16) for column in (x, y, n))
    return _core.pattern_values(array._parts(), x, y, n, registers.ramp).reshape(frames.shape)


def _right(values: _Values, chosen: Any, array: Array, registers: Registers, frames: _Frames) -> NDArray[np.bool_]:
    """Return which of these values are those of a frame that they may be of."""
    first = frames.first(values.t[chosen])
    right = np.zeros(first.shape, bool)
    for k in range(frames.several):
        right |= _expected(array, registers, values.x[chosen], values.y[chosen], first + k) == values.value[chosen]
    return right


def _numbered(values: _Values, array: Array, registers: Registers) -> tuple[_Frames, float]:
    """Return the numbers of frames that explain most values, and the share that they explain."""
    # Behind the middle nothing is left of what was before the pattern.
    later = np.arange(len(values.t) // 2, len(values.t))
    some = later[np.unique(np.linspace(0, len(later) - 1, 64).astype(int))]
    frames = _Frames(registers, int(values.t[some[0]]), values.resolution_us)
    # A frame more or less moves the ball by a sixteenth of a taxel, a tick.
    k, best, number = frames.first(values.t[some]), -1, 0
    for start in range(0, _FRAMES, 4096):
        numbers = np.arange(start, start + 4096)
        expected = _expected(array, registers, values.x[some], values.y[some], numbers[:, None] + k)
        near = (np.abs(expected.astype(np.int32) - values.value[some]) <= 2).sum(axis=1)
        if near.max() > best:
            best, number = int(near.max()), int(numbers[near.argmax()])
    more = later[np.unique(np.linspace(0, len(later) - 1, 2000).astype(int))]
    tries = []
    for after in range(16):
        for off in range(-6, 7):
            frames.number, frames.after_us = number + off, after / 16 * values.resolution_us
            tries.append(
                (_right(values, more, array, registers, frames).mean(), -abs(off), frames.number, frames.after_us)
            )
    share, _, frames.number, frames.after_us = max(tries)
    return frames, float(share)


def _meaning(values: _Values, at: int, frame: int, expected: int, array: Array, registers: Registers) -> str:
    """Return what may have made a value differ."""
    x, y, value = int(values.x[at]), int(values.y[at]), int(values.value[at])
    exchanged = x != y and x < array.rows and y < array.columns
    if exchanged and int(_expected(array, registers, y, x, np.array([frame]))[0]) == value:
        return "it is the value of the taxel with row and column exchanged: lines and steps are mixed up"
    near = np.arange(frame - 32, frame + 33)
    off = near[_expected(array, registers, x, y, near) == value] - frame
    if len(off) and value not in (0, expected):
        k = int(off[np.abs(off).argmin()])
        when = f"{counted(abs(k), 'frame')} {'later' if k > 0 else 'before'}"
        return (
            f"it is this taxel's value {when}: frames do not take the time that the registers say, or one was left out"
        )
    if (value ^ expected).bit_count() == 1:
        return "one bit differs: a disturbed link, or its clock does not suit the PHY"
    return "no value of the pattern is near: a comparator's, where the register pattern is off; else it was damaged"


def _compared(
    values: _Values, datagrams: int, array: Array, registers: Registers, frames: _Frames, begun: bool
) -> PatternCheck:
    """Compare each value, and what every taxel holds, with the pattern."""
    everything = np.arange(len(values.t))
    right, number = _right(values, everything, array, registers, frames), frames.first(values.t)
    # Where the pattern was switched on just before, the first events may be the comparators'.
    of_pattern = np.ones(right.shape, bool)
    if begun:
        period = _period(array)
        turns = (int(number.min()) + _AHEAD) // period * period
        frames.number -= turns
        number = number - turns
        of_pattern = number >= 0
    wrong = np.flatnonzero(~right & of_pattern)
    order = np.argsort(values.t, kind="stable")
    order = order[of_pattern[order]]
    stamps, starts = np.unique(values.t[order], return_index=True)
    ends = np.append(starts[1:], len(order))
    held, behind, first_behind = np.full(array.shape, -1, np.int64), np.zeros(array.shape, bool), None
    y, x = np.indices(array.shape)
    # Of several frames with one stamp the last one is not known.
    floor = registers.noise_floor + (4 if frames.several > 1 else 0)
    each = max(len(stamps) // 500, 1)
    for k in range(len(stamps) - 1):
        now = order[starts[k] : ends[k]]
        held[values.y[now], values.x[now]] = values.value[now]
        if k % each:
            continue
        n = int(frames.first(stamps[k : k + 1])[0]) + frames.several - 1
        expected = _expected(array, registers, x, y, np.full(array.shape, n)).astype(np.int64)
        off = (held >= 0) & (np.abs(expected - held) > floor)
        if off.any() and first_behind is None:
            row, column = np.argwhere(off)[0]
            first_behind = Difference(
                *(
                    int(stamps[k]),
                    int(column),
                    int(row),
                    n % _FRAMES,
                    int(expected[row, column]),
                    int(held[row, column]),
                ),
                meaning="the event of a change is missing: dropped by the board (fault queue), or lost on the way",
            )
        behind |= off
    first = first_behind
    if len(wrong):
        at = wrong[values.t[wrong].argmin()]
        several = number[at] + np.arange(frames.several)
        expected_values = _expected(array, registers, values.x[at], values.y[at], several)
        # Of several frames that it may be of, that from which it differs in the fewest bits.
        nearest = int(np.bitwise_count(expected_values ^ values.value[at]).argmin())
        n, expected_value = int(several[nearest]), int(expected_values[nearest])
        if first is None or values.t[at] <= first.t:
            first = Difference(
                *(int(values.t[at]), int(values.x[at]), int(values.y[at]), n % _FRAMES),
                *(expected_value, int(values.value[at])),
                meaning=_meaning(values, int(at), n, expected_value, array, registers),
            )
    taxels = len(np.unique(values.y.astype(np.int64) * array.columns + values.x))
    return PatternCheck(
        *(registers, values.version, datagrams, len(values.t), len(stamps), values.counts, taxels),
        *(len(wrong), int(behind.sum()), first, values.speed),
    )


def _interfaces() -> list[tuple[str, str, bool, int]]:
    """Return name, IPv4 address, whether it is up and speed (Mbit/s) of this machine's interfaces."""
    states = psutil.net_if_stats()
    return [
        (name, address.address, states[name].isup, states[name].speed)
        for name, addresses in psutil.net_if_addrs().items()
        for address in addresses
        if address.family == socket.AF_INET and name in states
    ]


def _nothing(port: int, seconds: float) -> str:
    """Return why no datagram may have come."""
    interfaces = _interfaces()
    there = ", ".join(f"{name} {address}" for name, address, _, _ in interfaces)
    begin = f"none came to port {port} within {seconds:g} s. "
    for name, address, up, speed in interfaces:
        if address == HOST:
            if not up:
                return (
                    f"{begin}{name} has {HOST}, to which the board of rtl/boards sends, but is down: is the cable in?"
                )
            slow = f" at {speed} Mbit/s, not at 1000" if 0 < speed < 1000 else ""
            return f"{begin}{name} has {HOST} and is up{slow}: is it the board's cable, and does a firewall let UDP in?"
    return (
        f"{begin}The board of rtl/boards sends to {HOST}, and no interface of this machine has that address ({there})"
    )


class _Check:
    """One check, as it goes on."""

    def __init__(self, say: Callable[[Finding], object] | None) -> None:
        self.say, self.findings = say, list[Finding]()

    def tell(self, name: str, good: bool | None, words: str) -> None:
        """Note a finding, and pass it on."""
        self.findings.append(Finding(name, good, words))
        if self.say is not None:
            self.say(self.findings[-1])

    def pattern(
        self,
        receiver: _Receiver,
        port: int,
        seconds: float,
        array: Array,
        given: list[Registers],
        device: Device | None,
    ) -> PatternCheck | None:
        """Compare what arrives with the pattern."""
        patience = max(seconds, _PATIENCE_S)
        before = {} if device is None else dict(device.faults)
        capture = receiver.take(seconds, patience)
        if not capture.datagrams:
            self.tell("datagrams", False, _nothing(port, patience))
            return None
        at = f" at {capture.destination} on {capture.interface}" if capture.interface else ""
        self.tell("address", True, f"datagrams of {capture.sender} arrive{at}")
        values = _decoded(capture, array)
        size = sum(map(len, capture.datagrams))
        self.tell(
            "datagrams", True, f"{len(capture.datagrams)}, {counted(size, 'byte')}, {counted(len(values.t), 'event')}"
        )
        said = {registers.wire_version for registers in given} if device is not None else {values.version}
        more = (
            "" if values.version in said else f", and the registers say {said.pop()}: another program sends here, too?"
        )
        self.tell("version", not more, f"version {values.version} of the wire{more}")
        self.losses(values, before, device)
        if len(values.t) < 32:
            why = "is its register pattern set, and intensity not left out?"
            self.tell("values", False, f"{len(values.t)} values are too few to find the ball: {why}")
            return None
        fits = [(registers, *_numbered(values, array, registers)) for registers in given]
        registers, frames, share = max(fits, key=lambda fit: fit[2])
        if share < _EXPLAINED:
            why = (
                "their frame takes another time than the registers say"
                if device is not None
                else "the pattern is off, or the registers are not those of a preset: name the serial line"
            )
            self.tell("values", False, f"only {share:.0%} of the values can be the ball's: {why}")
        found = _compared(values, len(capture.datagrams), array, registers, frames, device is not None)
        if share >= _EXPLAINED:
            self.values(found)
        self.tell("frames", None, self.covered(found, array, device is None))
        return found

    def losses(self, values: _Values, before: dict[str, int], device: Device | None) -> None:
        """Tell what the decoder and the board count."""
        counts = values.counts
        causes = ("missing", "checksum", "short", "malformed", "skipped", "outside", "unpaired", "contradictory")
        lost = {cause: getattr(counts, cause) for cause in causes if getattr(counts, cause)}
        if device is not None:
            now = device.faults
            lost |= {f"fault {name}": now[name] - before.get(name, 0) for name in ("queue", "command") if name in now}
        named = ", ".join(f"{name} {count}" for name, count in lost.items() if count)
        unnumbered = values.version == 1
        none = (
            "none that bytes show; datagrams of version 1 have no numbers"
            if unnumbered
            else "none: no number is missing"
        )
        self.tell("losses", not named, named or none)

    def values(self, found: PatternCheck) -> None:
        """Tell whether all values are the pattern's."""
        first, lagged = found.first, counted(found.behind, "taxel")
        if first is None:
            self.tell("values", True, f"all {found.events} values are the pattern's")
            return
        self.tell(
            "values",
            False,
            f"{found.wrong} of {found.events} values are not the pattern's, and {lagged} lagged;"
            f" the first: taxel ({first.x}, {first.y}) at {first.t} us, frame {first.frame}, has {first.value} and must"
            f" have {first.expected}: {first.meaning}",
        )

    def covered(self, found: PatternCheck, array: Array, guessed: bool) -> str:
        """Return how much of the pattern was seen."""
        registers, speed = found.registers, found.speed
        pace = ""
        if speed < 0.5:
            pace = f"; the board's clock takes {1 / speed:.0f} s for a second, as a simulated board's does"
        period = _period(array) * registers.frame_us / 1e6
        rest = (
            ""
            if found.taxels == array.rows * array.columns
            else f" (the ball has been everywhere after {period:.2g} s)"
        )
        whose = " (guessed: no serial line)" if guessed else ""
        return (
            f"{found.frames} stamps with events, {1e6 / registers.frame_us:.0f} frames/s{whose}; {found.taxels} of"
            f" {array.rows * array.columns} taxels had one{rest}{pace}"
        )

    def rest(self, receiver: _Receiver, seconds: float, array: Array, device: Device, speed: float) -> RestCheck:
        """Look at the comparators' own values."""
        registers = device.registers
        # With a ramp of a tick all taxels hold 0 or 1; then each that reads more gives its value.
        device.set(pattern=False, mechanoreceptor=False, noise_floor=0, ramp=1)
        receiver.drain(self.frames_s(registers, speed))
        faults = dict(device.faults)
        device.set(ramp=registers.ramp)
        capture = receiver.take(seconds, max(seconds, self.frames_s(registers, speed)))
        count = device.faults.get("comparator", 0) - faults.get("comparator", 0)
        found = _at_rest(capture, array, registers, count)
        self.at_rest(found)
        return found

    @staticmethod
    def frames_s(registers: Registers, speed: float) -> float:
        """Return the host's time of ten frames, s."""
        return max(0.05, 10e-6 * registers.frame_us / (speed if speed > 0 else 1.0))

    def at_rest(self, found: RestCheck) -> None:
        """Tell what the comparators do."""
        driven = found.silent[:, : found.registers.lines]
        quiet = _lines(driven)
        where = f"; {quiet}: their comparators, if no current flows there" if quiet else ""
        words = f"comparators had not returned as their ramp began, {counted(found.faults, 'time')}{where}"
        self.tell("comparators", found.faults == 0, words if found.faults else "all had returned as their ramps began")
        full = found.full[:, : found.registers.lines]
        end = f"{counted(int(full.sum()), 'taxel')} stay at the ramp's end, {found.registers.ramp} ticks"
        why = "no comparator is connected there, or the ramp does not reach its voltage"
        lines = _lines(full)
        self.tell(
            "ramp end",
            not full.any(),
            f"{end}{f' ({lines})' if lines else ''}: {why}" if full.any() else "no taxel stays there",
        )
        zero = int(driven.sum())
        why = "right where nothing presses and the circuit has no offset; else no current arrives"
        self.tell(
            "zero",
            None,
            f"{counted(zero, 'taxel')} stay at 0 or 1{f' ({quiet})' if quiet else ''}: {why}"
            if zero
            else "no taxel stays there",
        )
        if np.isfinite(found.noise).any():
            row, column = np.unravel_index(np.nanargmax(found.noise), found.noise.shape)
            largest, floor = found.noise[row, column], found.registers.noise_floor
            # Of normal noise one value in 370 is further than three standard deviations.
            above = counted(int((found.noise > floor / 3).sum()), "taxel")
            median, place = np.nanmedian(found.noise), f"taxel ({column}, {row})"
            self.tell(
                "noise",
                None,
                f"standard deviation {median:.2f} ticks (the median), at most {largest:.2f} ({place}); three of"
                f" them are above the noise floor, {floor}, for {above}",
            )


def _lines(taxels: NDArray[np.bool_]) -> str:
    """Name the lines of which all taxels are meant, where not all lines are."""
    rows, columns = np.flatnonzero(taxels.all(axis=1)), np.flatnonzero(taxels.all(axis=0))
    named = []
    for name, lines, count in (("sense line", rows, taxels.shape[0]), ("driven line", columns, taxels.shape[1])):
        if 0 < len(lines) < count:
            named.append(f"{name}{'s' * (len(lines) > 1)} {', '.join(map(str, lines))}")
    return " and ".join(named)


def _at_rest(capture: _Capture, array: Array, registers: Registers, faults: int) -> RestCheck:
    """Work out what each taxel read: its values hold until the next one."""
    mean, noise = np.full(array.shape, np.nan), np.full(array.shape, np.nan)
    full = np.zeros(array.shape, bool)
    if capture.datagrams:
        values = _decoded(capture, array)
        taxel = values.y.astype(np.int64) * array.columns + values.x
        order = np.lexsort((values.t, taxel))
        taxel, t, value = taxel[order], values.t[order], values.value[order].astype(np.float64)
        last = np.append(taxel[1:] != taxel[:-1], True) if len(taxel) else np.empty(0, bool)
        end = (t.max() if len(t) else 0) + registers.frame_us
        weight = np.where(last, end, np.append(t[1:], end)[: len(t)]) - t
        size = mean.size
        total = np.bincount(taxel, weight, size)
        seen = total > 0
        first = np.divide(np.bincount(taxel, weight * value, size), total, where=seen, out=np.full(size, np.nan))
        square = np.bincount(taxel, weight * (value - first[taxel]) ** 2, size)
        mean = first.reshape(array.shape)
        noise = np.sqrt(np.divide(square, total, where=seen, out=np.full(size, np.nan))).reshape(array.shape)
        full = mean >= registers.ramp
    return RestCheck(registers, faults, mean, noise, np.isnan(mean), full)


@contextlib.contextmanager
def _with_pattern(device: Device) -> Iterator[Registers]:
    """Set the pattern within a context; the registers before are restored at its end."""
    before = device.registers
    try:
        yield device.set(pattern=True, mechanoreceptor=False, frame_sync=True)
    finally:
        device.apply(before)


def check_board(
    place: str | None = None,
    *,
    port: int = PORT,
    host: str = "0.0.0.0",
    array: Array | None = None,
    preset: str | None = None,
    seconds: float = 4.0,
    say: Callable[[Finding], object] | None = None,
) -> BoardCheck:
    """Check a board: its link by the pattern that it makes itself, then its converter at rest.

    With the serial line the pattern is switched on, everything that arrives is compared with it, and then the
    comparators' own values are looked at, for which nothing may touch the sensor; afterwards the registers are as
    before. Without it the board must make the pattern already, as the Colorlight i9 does after its button was held for
    two seconds, and only the link is checked.

    Parameters
    ----------
    place : str, optional
        The board's serial port ("COM3", "/dev/ttyACM0"), or host:port of an emulated board.
    port : int, 1 to 65535
        The UDP port that the board sends to.
    host : str
        The address of this machine to listen on; "0.0.0.0": all.
    array : Array, optional
        The sensor. Default: of the size that the board reports; without a serial line 64 x 64.
    preset : str, optional
        Without a serial line: the preset that the board holds. Default: the one that explains the values best.
    seconds : float, s, 0.1 to 3600
        For how long each of the two is received. A simulated board is slow: some frames are enough.
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
    The pattern's formula is in *Registers*, *The pattern*. Boards that send differences, or no intensities, cannot be
    checked.

    Examples
    --------
    >>> check_board(port=0)
    Traceback (most recent call last):
    taxel.ProblemError: port ...
    """
    where = integer("port", port, 1, 65_535)
    if not 0.1 <= number("seconds", seconds) <= 3600:
        raise refused("seconds", f" is {seconds:g}: must be from 0.1 to 3600")
    if preset is not None and text("preset", preset) not in PRESETS:
        raise ProblemError(f"preset {preset!r}: there are {', '.join(map(repr, PRESETS))}")
    if preset is not None and place is not None:
        raise refused("preset", ": the board on the serial line says what it holds: leave it out")
    check = _Check(None if say is None else callback("say", say))
    receiver = _Receiver(text("host", host), where)
    with contextlib.closing(receiver.socket):
        if place is None:
            sensor = Array._of(array)
            found = check.pattern(receiver, where, seconds, sensor, _presets(sensor, preset), None)
            check.tell("rest", None, "not looked at: that needs the board's serial line")
            return BoardCheck(tuple(check.findings), found, None)
        with Device(place, array=array, timeout=_ANSWER_S) as device:
            rest = None
            with _with_pattern(device) as registers:
                receiver.drain(0.05)
                found = check.pattern(receiver, where, seconds, device.array, [registers], device)
                if found is not None:
                    rest = check.rest(receiver, seconds, device.array, device, found.speed)
            return BoardCheck(tuple(check.findings), found, rest)


def _presets(array: Array, preset: str | None) -> list[Registers]:
    """Return what a board without a serial line may hold: the preset that is named, or each that fits the array."""
    if preset is not None:
        return [Registers._of(_core.registers_preset(preset, array._parts()), array)]
    found = []
    for name in PRESETS:
        with contextlib.suppress(DeviceError, ProblemError):
            found.append(Registers._of(_core.registers_preset(name, array._parts()), array))
    return [registers for registers in found if not registers.mechanoreceptor]
