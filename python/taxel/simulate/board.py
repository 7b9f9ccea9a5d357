"""The emulated board at work: it feels acts as fast as it goes, or in real time and over UDP whatever it is given."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import IO, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel._arguments import callback, instance, mapping, number, parameters, several, shown, text, whole
from taxel._arguments import path as checked_path
from taxel._core import DeviceError, FormatError, ProblemError
from taxel.array import Array
from taxel.events import Events
from taxel.frames import Frames
from taxel.recording import Recording
from taxel.simulate.acts import Act, Contact, Pictures, Scene, Silence
from taxel.simulate.circuit import Circuit
from taxel.simulate.emulated import Version2, reading
from taxel.simulate.trouble import Faults, Flaws
from taxel.spikes import to_ms
from taxel.wire import Registers

__all__ = ["EmulatorReport", "Pipe", "Played", "Replay", "emulate", "play", "truth"]


#: Longer first lines of a pipe are none, bytes.
_LONGEST_LINE = 1 << 16

#: Lines that the thesis' presets are made for.
_THESIS_LINES = 64

_QUANTILES = {"p50": "median", "p99": "99 %", "max": "at most"}


class Played(NamedTuple):
    """What a host decoded of a board's datagrams."""

    events: Events
    """All of them: the tare's, then from the start marker on what the scenes made."""
    datagrams: int
    words: int
    """Of version 1 of the wire, of five bytes each; 0 on version 2."""
    bytes: int
    """Of all datagrams, without what the network puts around them."""


@dataclass(frozen=True)
class EmulatorReport:
    """What an emulated board has done so far."""

    frames: int
    began_ns: int
    """The host's clock at the board's time 0, ns since 1970: what the board does is due by it."""
    board_seconds: float
    """By the board's own clock."""
    seconds: float
    """By the host's: larger where the machine cannot hold the board's rate."""
    changes: int
    datagrams: int
    bytes: int
    dropped: int
    """Changes that found the board's queue full."""
    late_frames: int
    """Sent more than a frame after their end."""
    late_us: Mapping[str, float]
    """How long after its end a frame was sent: p50, p99, max; not measured where frames go as they come."""
    network: Mapping[str, int] | None = None
    """What the network did to datagrams, where asked to: given, delivered, and by fault."""
    resets: int = 0
    """How often the board was reset."""

    @property
    def wanted_hz(self) -> float:
        """Frames a second by the board's clock."""
        return self.frames / self.board_seconds if self.board_seconds else 0.0

    @property
    def reached_hz(self) -> float:
        """Frames a second by the host's clock."""
        return self.frames / self.seconds if self.seconds else 0.0

    @property
    def held(self) -> bool:
        """Whether the machine held the board's rate, to within half a per cent of the time."""
        return self.seconds <= 1.005 * self.board_seconds + 0.02

    @property
    def verdict(self) -> str:
        """One line: whether the rate was held, or by how much not, and how late frames were."""
        late = ", ".join(f"{to_ms(self.late_us[q]):.2f} ms ({said})" for q, said in _QUANTILES.items())
        late = f"late by {late}; {self.late_frames} of {self.frames} by a frame or more"
        if self.held:
            whole = "held" if self.late_frames <= 0.01 * self.frames else "held on the whole, but not frame by frame"
            return f"{self.wanted_hz:.0f} frames/s {whole}; frames were {late}"
        short = 100.0 * (1.0 - self.reached_hz / self.wanted_hz)
        return (
            f"this machine cannot hold {self.wanted_hz:.0f} frames/s: it reached {self.reached_hz:.0f}, "
            f"{short:.1f} % less; frames were {late}"
        )

    @classmethod
    def _from_json(cls, said: str) -> EmulatorReport:
        report = json.loads(said)
        board, sent, late = report["board"], report["sent"], report["late"]
        return cls(
            frames=board["frames"],
            began_ns=report["began_ns"],
            board_seconds=report["board_seconds"],
            seconds=report["seconds"],
            changes=board["changes"],
            datagrams=sent["datagrams"],
            bytes=sent["bytes"],
            dropped=board["dropped"],
            late_frames=report["late_frames"],
            late_us={name: late[f"{name}_us"] or 0.0 for name in ("p50", "p99", "max")},
            network=report["network"],
            resets=report["resets"],
        )


class Replay:
    """Let the board feel a recording again: its events as they were, or its pictures by the board's rules.

    Parameters
    ----------
    source : Recording, Events or Frames
    speed : float, above 0
        2 plays it in half the time.

    Raises
    ------
    ProblemError : neither of these, or nothing in it

    Notes
    -----
    The board's frames quantise time: what came within one is sent at its end, of several events of a taxel the last.
    Pictures that are not in ticks are scaled so that the largest value is the end of the ramp.
    """

    def __init__(self, source: Recording | Events | Frames, speed: float = 1.0) -> None:
        self.speed = number("speed", speed)
        if not 0 < self.speed < np.inf:
            raise ProblemError(f"speed is {shown(speed)}: must be above 0")
        self.recording = source if isinstance(source, Recording) else None
        if isinstance(source, Recording):
            source = source.events if source.has_events else source.frames()
        if not isinstance(source, Events | Frames):
            raise ProblemError(f"source is {shown(source)}: must be a Recording, Events or Frames")
        if not len(source):
            raise ProblemError("source: nothing to play in it")
        self.source: Events | Frames = source

    @property
    def array(self) -> Array:
        """The sensor."""
        return self.source.array

    def registers(self, preset: str | None) -> Registers:
        """Return what the board holds that plays it: as it was recorded where that is known, else a preset."""
        known = None if self.recording is None else self.recording.registers
        held = fitting(preset, self.array) if known is None else known.replace(record=False)
        values = self.source.intensity if isinstance(self.source, Events) else None
        most = 0 if values is None else int(values.max())
        # A converter sees nothing above its ramp: where that is a preset's and the sensor another, it is made longer.
        rate_hz = 1e6 / held.frame_us
        while most >= held.ramp:
            fields, halved = _core.registers_of_source(self.array._parts(), rate_hz, (most + 1).bit_length())
            rate_hz /= 2
            if not halved:
                longer = Registers._of(json.loads(fields), self.array)
                held = longer.replace(noise_floor=held.noise_floor, wire_version=held.wire_version)
        return held

    def _touch(self, registers: Registers) -> tuple[Any, ...]:
        if isinstance(self.source, Events):
            return self.source.sorted()._parts(), self.speed
        values = self.source.values
        if self.source.unit != "ticks":
            values = (values - min(0.0, float(values.min()))) * (registers.ramp / max(float(np.ptp(values)), 1e-30))
        ticks = np.clip(np.rint(values), 0, registers.ramp).astype(np.uint16).reshape(-1)
        return np.ascontiguousarray(self.source.t), np.ascontiguousarray(ticks), self.speed


class Pipe:
    """Let the board feel frames of any other sensor as they come: from a pipe, after a line that says what they are.

    The line is JSON: ``{"rows": 16, "columns": 8, "rate": 100, "bits": 12}``, and may name ``pitch_mm`` and ``name``.
    Behind it stand frames: uint16, little-endian, row by row. The board's clock is the pipe's: a frame is one over
    `rate` long.

    Parameters
    ----------
    source : binary file
        As ``sys.stdin.buffer``; must have a descriptor.
    noise_floor : int, ticks
        A change above it makes an event; a tick is one unit of the values, or more where so many bits are too many for
        so fast a scan (`shift` says how often a value is halved).

    Raises
    ------
    FormatError : another first line
    ProblemError : numbers in it that make no sense
    """

    def __init__(self, source: IO[bytes], noise_floor: int = 3) -> None:
        self._descriptor, self._ahead = source.fileno(), b""
        line = self._line()
        try:
            said = json.loads(line)
            rows, columns, rate, bits = (said[name] for name in ("rows", "columns", "rate", "bits"))
        except (ValueError, TypeError, KeyError) as error:
            wanted = '{"rows": 16, "columns": 8, "rate": 100, "bits": 12}'
            begin = line[:60].decode("utf-8", "replace")
            raise FormatError(f"standard input, line 1: {begin!r} ({error}); must be JSON like {wanted}") from None
        self.array = Array(rows, columns, pitch_mm=said.get("pitch_mm", 1.0), name=said.get("name", "pipe"))
        self.rate_hz, self._floor = number("rate", rate), whole("noise_floor", noise_floor, 0, 255)
        try:
            held, self.shift = _core.registers_of_source(self.array._parts(), self.rate_hz, whole("bits", bits, 1, 16))
        except DeviceError as error:
            raise ProblemError(f"standard input, line 1: {rows} x {columns} taxels: {error}") from None
        self._held = json.loads(held)

    def registers(self, preset: str | None) -> Registers:  # noqa: ARG002  the frames say how fast they are
        """Return what the board holds that scans such frames."""
        return Registers._of(self._held, self.array).replace(noise_floor=self._floor)

    def _line(self) -> bytes:
        while b"\n" not in self._ahead and len(self._ahead) < _LONGEST_LINE:
            more = os.read(self._descriptor, 4096)
            if not more:
                break
            self._ahead += more
        line, _, self._ahead = self._ahead.partition(b"\n")
        return line

    def _touch(self, registers: Registers) -> tuple[Any, ...]:
        return self._descriptor, list(self._ahead), self.shift, registers.ramp


def fitting(preset: str | None, array: Array) -> Registers:
    """Return a preset with as many of its lines as an array has; unnamed: "5.2 kHz", or what a larger board resets to.

    Raises
    ------
    ProblemError : no such preset for an array of that size
    DeviceError : the array has more lines than the preset reads
    """
    if preset is None:
        if max(array.shape) > _THESIS_LINES:
            return Registers(array=array)
        preset = "5.2 kHz"
    held = json.loads(_core.registers_preset(text("preset", preset), array._parts()))
    try:
        return Registers._of(held, array)
    except DeviceError as error:
        size = f"{array.rows} x {array.columns} taxels"
        raise DeviceError(f'preset "{preset}" does not read {size}: {error}') from None


def truth(
    acts: Sequence[Act], *, preset: str | None = None, array: Array | None = None
) -> tuple[list[Contact], NDArray[np.float32]]:
    """Return what really happens in acts: touches by the board's clock (us from its first frame), force (N) by frame.

    Parameters
    ----------
    acts : sequence of Scene, Silence, Pictures
    preset : str, optional
        The board's registers, one of `taxel.wire.PRESETS`, with as many lines as the array has; left out, "5.2 kHz", or
        what a board of more than 64 lines resets to.
    array : Array, optional
        The thesis' 64 x 64 taxels where it is left out.

    Raises
    ------
    SceneError : an act that cannot be played (names it)
    DeviceError : the array has more lines than the preset reads

    Examples
    --------
    >>> contacts, force = truth([Silence(100.0), Scene.draw(seed=1)])
    >>> round(contacts[0].start_us), float(force[:520].max())
    (427782, 0.0)
    """
    sensed = Array._of(array)
    held = json.dumps(fitting(preset, sensed)._held)
    contacts, force = _core.truth(sensed._parts(), held, _parts(acts, sensed))
    return [Contact(*contact) for contact in contacts], force


def play(
    acts: Sequence[Act],
    *,
    seed: int,
    preset: str | None = None,
    tare_ms: float = 50.0,
    array: Array | None = None,
    sensor: Mapping[str, float] | None = None,
    wire: Literal[1, 2] | None = None,
    circuit: Circuit | None = None,
    asynchronous: bool = False,
    watch: Callable[[float], object] = lambda _: None,
) -> Played:
    """Let an emulated board feel acts, as fast as it goes, and decode its datagrams.

    The board arms after its first frame, is tared with a noise floor of 0 for `tare_ms`, then takes the preset's floor
    and marks a start; before the last frame it marks a stop.

    Parameters
    ----------
    acts : sequence of Scene, Silence, Pictures
        The first should be a Silence longer than the tare.
    seed : int, 0 or more
        Draws the taxels' spread and the noise.
    preset, array
        As in `truth`.
    tare_ms : float, 0 to 60000
    sensor : mapping, optional
        What differs from the usual sensor: v_trans, feedback_kohm, rest_us, touch_us, exponent, side_mm, gain_spread,
        offset_mv, noise_ticks.
    wire : {1, 2}, optional
        The version of the wire that it speaks; left out, its registers', or 2 where it is asynchronous.
    circuit : Circuit, optional
        Lines that its taxels share, settling, comparators with hysteresis; left out, each taxel reads by itself. Its
        voltage and resistor must be the sensor's; the converter's times are the preset's.
    asynchronous : bool
        Each taxel compares by itself, as in `Board`; needs version 2, and no circuit.
    watch : function, optional
        Called with the share that is played, once a second of the board's time.

    Raises
    ------
    SceneError : an act or a sensor that makes no sense
    ProblemError : acts too short for the tare; a circuit of another voltage or resistor; asynchronous on version 1
    DeviceError : the array has more lines than the preset, or that version of the wire, reads

    Examples
    --------
    >>> played = play([Silence(60.0)], seed=1)
    >>> played.events.markers
    ((50300, True), (59900, False))
    """
    sensed = Array._of(array)
    parts, held = _parts(acts, sensed), fitting(preset, sensed)
    if wire is not None or asynchronous:
        held = held.replace(wire_version=2 if wire is None else whole("wire", wire, 1, 2))
    events, datagrams, words, taken = _core.play(
        sensed._parts(),
        json.dumps(held._held),
        parameters({} if sensor is None else mapping("sensor", sensor)),
        whole("seed", seed, 0),
        parts,
        number("tare_ms", tare_ms),
        parameters(reading(circuit, asynchronous)),
        callback("watch", watch),
    )
    return Played(Events._from_parts(events), datagrams, words, taken)


def emulate(
    to: str,
    touch: Iterable[Act] | Replay | Pipe,
    *,
    seed: int = 0,
    preset: str | None = None,
    registers: Registers | None = None,
    tare_ms: float = 50.0,
    array: Array | None = None,
    sensor: Mapping[str, float] | None = None,
    wire: Literal[1, 2] | None = None,
    previous: Literal["last_sent", "last_sample"] = "last_sent",
    intensity: Literal["value", "difference", "nothing"] = "value",
    version_2: Version2 | None = None,
    circuit: Circuit | None = None,
    asynchronous: bool = False,
    flaws: Flaws | None = None,
    faults: Faults | None = None,
    reset_every_s: float | None = None,
    drift_ppm: float = 0.0,
    control: str | None = None,
    line: str | os.PathLike[str] | None = None,
    baud: int = 115_200,
    sync: str | os.PathLike[str] | None = None,
    overwrite: bool = False,
    source_port: int = 0,
    begun: Callable[[str | None], None] = lambda _: None,
    watch: Callable[[EmulatorReport], None] = lambda _: None,
    touched: Callable[[list[Contact]], None] = lambda _: None,
) -> EmulatorReport:
    """Let an emulated board feel something in real time, and send its datagrams by UDP.

    Parameters
    ----------
    to : str
        Address and port, as "127.0.0.1:5208".
    touch : iterable of Scene, Silence, Pictures; Replay; or Pipe
        What it feels. Acts may be without an end: each is made ready while those before it are played. Of acts the
        board arms after the first frame, is tared with a noise floor of 0 for `tare_ms`, marks a start, and at the end
        a stop.
    seed, preset, tare_ms, array, sensor
        As in `play`; of a Replay or a Pipe the array is theirs.
    registers : Registers, optional
        What the board holds instead of the preset.
    wire : {1, 2}, optional
        The version of the wire that it speaks; left out, the registers'.
    previous, intensity
        As in `Board`.
    version_2 : Version2, optional
        How it speaks version 2.
    circuit : Circuit, optional
        Lines that its taxels share, settling, comparators with hysteresis; left out, each taxel reads by itself. Of
        acts its voltage and resistor must be the sensor's; the converter's times are the registers', and flaws come
        after it. How many frames a second one core then keeps is in the report.
    asynchronous : bool
        Each taxel compares by itself, as in `Board`; no circuit, and the registers must hold version 2 of the wire
        (``wire=2``).
    flaws : Flaws, optional
        What is wrong with its taxels.
    faults : Faults, optional
        What the network does to its datagrams.
    reset_every_s : float, s, optional
        The board is reset so often, by its own clock.
    drift_ppm : float, parts per million
        How much faster its clock runs than this machine's.
    control : str, optional
        Address and port where the board takes commands by TCP; port 0 finds a free one.
    line : path, optional
        A serial line: a link of this name to a pseudo-terminal, at `baud` and no faster.
    sync : path, optional
        A new file, or a pipe that is there: the sync line, a line an edge: board time (us), 1 or 0, host time (ns).
    overwrite : bool
        Whether an existing file `sync` may be replaced.
    source_port : int
        The UDP port that it sends from; 0 finds a free one.
    begun : function, optional
        Called with the address of `control` just before the first frame.
    watch : function, optional
        Called with a report ten times a second.
    touched : function, optional
        Called before `watch` with touches of acts that were made ready since; us of the board's clock.

    Returns
    -------
    EmulatorReport : also how late frames were, which is where a machine shows that it cannot hold the board's rate

    Raises
    ------
    As in `play`; OSError where a socket, line or file cannot be had.
    """
    felt: Any
    if isinstance(touch, Replay | Pipe):
        sensed, acts = touch.array, None
        held = touch.registers(preset) if registers is None else registers
        felt = touch._touch(instance("registers", held, Registers))
    else:
        sensed, acts = Array._of(array), _checked(touch, Array._of(array))
        held = fitting(preset, sensed) if registers is None else registers
        felt = acts
    held = instance("registers", held, Registers)
    if wire is not None:
        held = held.replace(wire_version=whole("wire", wire, 1, 2))
    options = {
        "registers": held._held,
        "tare_ms": None if acts is None else number("tare_ms", tare_ms),
        "previous": text("previous", previous, ("last_sent", "last_sample")),
        "intensity": text("intensity", intensity, ("value", "difference", "nothing")),
        "version_2": asdict(instance("version_2", version_2 or Version2(), Version2)),
        "control": None if control is None else text("control", control),
        "line": None if line is None else (str(Path(checked_path("line", line))), whole("baud", baud, 300, 4_000_000)),
        "sync": None if sync is None else (str(Path(checked_path("sync", sync))), bool(overwrite)),
        **reading(circuit, asynchronous),
        "flaws": None if flaws is None else instance("flaws", flaws, Flaws)._parts(),
        "faults": None if faults is None else instance("faults", faults, Faults)._parts(),
        "reset_every_s": None if reset_every_s is None else number("reset_every_s", reset_every_s),
        "drift_ppm": number("drift_ppm", drift_ppm),
        "source_port": whole("source_port", source_port, 0, 65_535),
    }

    def tell(said: str, contacts: list[Any]) -> None:
        if contacts:
            touched([Contact(*contact) for contact in contacts])
        watch(EmulatorReport._from_json(said))

    callback("watch", watch), callback("touched", touched)
    report = _core.emulate(
        text("to", to),
        sensed._parts(),
        parameters({} if sensor is None else mapping("sensor", sensor)),
        whole("seed", seed, 0),
        felt,
        parameters(options),
        callback("begun", begun),
        tell,
    )
    return EmulatorReport._from_json(report)


def _checked(acts: Iterable[Act], array: Array) -> Iterator[Any]:
    """Return the parts of acts, one after the other; what is wrong with one is said when it is its turn.

    Of a sequence that is said at once.
    """
    if isinstance(acts, Sequence):
        return iter(_parts(acts, array))
    try:
        return (_part(n, act, array) for n, act in enumerate(iter(acts)))
    except TypeError:
        raise ProblemError(f"touch is {shown(acts)}: must be acts, a Replay or a Pipe") from None


def _parts(acts: Sequence[Act], array: Array) -> list[Any]:
    return [_part(n, act, array) for n, act in enumerate(several("acts", acts))]


def _part(n: int, act: Act, array: Array) -> Any:
    if not isinstance(act, Silence | Scene | Pictures):
        raise ProblemError(f"act {n} is {shown(act)}: must be a Scene, Silence or Pictures")
    if isinstance(act, Pictures) and act.values.shape[1:] != array.shape:
        raise ProblemError(f"act {n}: pictures of shape {act.values.shape[1:]}, the array has {array.shape}")
    return act._part()
