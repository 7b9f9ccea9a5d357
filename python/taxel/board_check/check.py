"""A check of a board, from the first datagram to the noise at rest."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator

import numpy as np

from taxel import _core
from taxel._base.arguments import callback, integer, number, text
from taxel._base.errors import refused
from taxel._base.interfaces import interfaces
from taxel._base.messages import counted
from taxel._core import FIREWALL, DeviceError, ProblemError
from taxel.array import Array
from taxel.board_check.pattern import compared, numbered, period_of
from taxel.board_check.received import DecodedValues, Receiver, decoded
from taxel.board_check.rest import lines_of, rest_of
from taxel.board_check.results import BoardCheck, Finding, PatternCheck, RestCheck
from taxel.device import Device
from taxel.live.sending import PORT
from taxel.wire import PRESETS, Registers

#: Where the board of `rtl/boards` sends to: no address is resolved, so a host must have this one.
HOST = "192.168.52.1"

#: How long the first datagram may take, s.
_PATIENCE_S = 10.0
#: How long a board may take to answer on its serial line, s: a simulated one is slow.
_ANSWER_S = 30.0
#: An assumption about the frames' number must explain this share of the values.
_EXPLAINED = 0.5


def _nothing(port: int, seconds: float) -> str:
    """Return why no datagram may have come."""
    found = interfaces()
    there = ", ".join(f"{name} {address}" for name, address, _, _ in found)
    begin = f"none arrived at port {port} within {seconds:g} s{FIREWALL}. "
    for name, address, up, speed in found:
        if address == HOST:
            if not up:
                return (
                    f"{begin}The board of rtl/boards sends to {HOST}. The interface {name} has this address, but is "
                    "down: is the cable plugged in?"
                )
            slow = f" at {speed} Mbit/s, not at 1000" if 0 < speed < 1000 else ""
            return (
                f"{begin}The interface {name} has {HOST} and is up{slow}: is the board's cable in this interface, and "
                "does a firewall let UDP in?"
            )
    return (
        f"{begin}The board of rtl/boards sends to {HOST}, but no interface of this machine has this address "
        f"(found: {there})"
    )


class _Check:
    """One check while it runs."""

    def __init__(self, say: Callable[[Finding], object] | None) -> None:
        self.say, self.findings = say, list[Finding]()

    def tell(self, name: str, good: bool | None, words: str) -> None:
        """Note a finding, and pass it on."""
        self.findings.append(Finding(name, good, words))
        if self.say is not None:
            self.say(self.findings[-1])

    def pattern(
        self,
        receiver: Receiver,
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
        values = decoded(capture, array)
        size = sum(map(len, capture.datagrams))
        self.tell(
            "datagrams", True, f"{len(capture.datagrams)}, {counted(size, 'byte')}, {counted(len(values.t), 'event')}"
        )
        said = {registers.wire_version for registers in given} if device is not None else {values.version}
        more = (
            ""
            if values.version in said
            else f", but the registers state version {said.pop()}: does another program send to this port, too?"
        )
        self.tell("version", not more, f"version {values.version} of the wire{more}")
        self.losses(values, before, device)
        if len(values.t) < 32:
            why = "is the board's register pattern set, and does the board send intensities?"
            self.tell("values", False, f"{len(values.t)} values are too few to find the ball: {why}")
            return None
        fits = [(registers, *numbered(values, array, registers)) for registers in given]
        registers, frames, share = max(fits, key=lambda fit: fit[2])
        if share < _EXPLAINED:
            why = (
                "a frame does not last as long as the registers say"
                if device is not None
                else "the board does not send the test pattern, or its registers match no preset: "
                "give its serial port, for example taxel device check /dev/ttyACM0"
            )
            self.tell("values", False, f"only {share:.0%} of the values fit the pattern: {why}")
        found = compared(values, len(capture.datagrams), array, registers, frames, device is not None)
        if share >= _EXPLAINED:
            self.values(found)
        self.tell("frames", None, self.covered(found, array, device is None))
        return found

    def losses(self, values: DecodedValues, before: dict[str, int], device: Device | None) -> None:
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
            "none detected: datagrams of version 1 have no numbers, so taxel cannot count lost datagrams"
            if unnumbered
            else "none: no number is missing"
        )
        self.tell("losses", not named, named or none)

    def values(self, found: PatternCheck) -> None:
        """Tell whether all values are the pattern's."""
        first, behind = found.first, counted(found.behind, "taxel")
        if first is None:
            self.tell("values", True, f"all {found.events} values match the pattern")
            return
        self.tell(
            "values",
            False,
            f"{found.wrong} of {found.events} values differ from the pattern, and {behind} kept an old value; "
            f"the first difference: taxel ({first.x}, {first.y}) at {first.t} us, frame {first.frame}, has "
            f"{first.value} and must have {first.expected}: {first.meaning}",
        )

    def covered(self, found: PatternCheck, array: Array, guessed: bool) -> str:
        """Return how much of the pattern was seen."""
        registers, speed = found.registers, found.speed
        pace = ""
        if speed < 0.5:
            pace = f"; a second of the board's clock lasts {1 / speed:.0f} s here, as with a simulated board"
        period = period_of(array) * registers.frame_us / 1e6
        rest = (
            ""
            if found.taxels == array.rows * array.columns
            else f" (the ball reaches all taxels within {period:.2g} s)"
        )
        whose = " (guessed: no serial line)" if guessed else ""
        return (
            f"{found.frames} time stamps with events, {1e6 / registers.frame_us:.0f} frames/s{whose}; {found.taxels} of"
            f" {array.rows * array.columns} taxels had an event{rest}{pace}"
        )

    def rest(self, receiver: Receiver, seconds: float, array: Array, device: Device, speed: float) -> RestCheck:
        """Look at the comparators' own values."""
        registers = device.registers
        # With a ramp of a tick all taxels hold 0 or 1; then each that reads more gives its value.
        device.set(pattern=False, mechanoreceptor=False, noise_floor=0, ramp=1)
        receiver.drain(self.frames_s(registers, speed))
        faults = dict(device.faults)
        device.set(ramp=registers.ramp)
        capture = receiver.take(seconds, max(seconds, self.frames_s(registers, speed)))
        count = device.faults.get("comparator", 0) - faults.get("comparator", 0)
        found = rest_of(capture, array, registers, count)
        self.at_rest(found)
        return found

    @staticmethod
    def frames_s(registers: Registers, speed: float) -> float:
        """Return the host's time of ten frames, s."""
        return max(0.05, 10e-6 * registers.frame_us / (speed if speed > 0 else 1.0))

    def at_rest(self, found: RestCheck) -> None:
        """Tell what the comparators do."""
        driven = found.silent[:, : found.registers.lines]
        quiet = lines_of(driven)
        where = (
            f"; look at the comparators and the current of {quiet}, where all taxels stay at 0 or 1" if quiet else ""
        )
        words = f"comparators had not returned when their ramp began ({counted(found.faults, 'time')}){where}"
        self.tell(
            "comparators", found.faults == 0, words if found.faults else "all had returned when their ramps began"
        )
        full = found.full[:, : found.registers.lines]
        end = f"{counted(int(full.sum()), 'taxel')} stay at the ramp's end, {found.registers.ramp} ticks"
        why = "no comparator is connected there, or the ramp does not reach the voltage there"
        lines = lines_of(full)
        self.tell(
            "ramp end",
            not full.any(),
            f"{end}{f' ({lines})' if lines else ''}: {why}" if full.any() else "no taxel stays at the ramp's end",
        )
        zero = int(driven.sum())
        why = (
            "this is right if nothing presses on the sensor and the circuit has no offset; otherwise no current "
            "arrives there"
        )
        self.tell(
            "zero",
            None,
            f"{counted(zero, 'taxel')} stay at 0 or 1{f' ({quiet})' if quiet else ''}: {why}"
            if zero
            else "no taxel stays at 0 or 1",
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
                f"standard deviation {median:.2f} ticks (median), at most {largest:.2f} ticks ({place}); for {above}, "
                f"three "
                f"standard deviations are above the noise floor of {floor} ticks",
            )


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

    With the serial line, the check switches the pattern on and compares all data that arrive with it. Then it checks
    the values of the comparators, while nothing may touch the sensor. At the end the registers are as before. Without
    the serial line, only the link is checked, and the board must already make the pattern, as the Colorlight i9 does
    after its button was held for two seconds.

    Parameters
    ----------
    place : str, optional
        The board's serial port ("COM3", "/dev/ttyACM0"), or host:port of an emulated board.
    port : int, 1 to 65535
        The UDP port that the board sends to.
    host : str
        The address of this machine to listen on; "0.0.0.0": all.
    array : Array, optional
        The sensor. Default: the size that the board reports; without a serial line 64 x 64.
    preset : str, optional
        Without a serial line: the preset that the board holds. Default: the preset that explains the values best.
    seconds : float, s, 0.1 to 3600
        Duration of each of the two checks. For a simulated board, which is slow, some frames are enough.
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
    if preset is not None:
        text("preset", preset, PRESETS)
    if preset is not None and place is not None:
        raise refused("preset", ": must be left out with a serial line, because the board then states its registers")
    check = _Check(None if say is None else callback("say", say))
    receiver = Receiver(text("host", host), where)
    with contextlib.closing(receiver.socket):
        if place is None:
            sensor = Array._of(array)
            found = check.pattern(receiver, where, seconds, sensor, _presets(sensor, preset), None)
            check.tell("rest", None, "not checked: this needs the board's serial line")
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
