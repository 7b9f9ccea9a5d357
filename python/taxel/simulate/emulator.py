"""The emulated board: plays acts as fast as possible, or any touch in real time over UDP."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel._base.arguments import callback, flag, instance, integer, mapping, number, parameters, several, shown, text
from taxel._base.errors import refused
from taxel._base.options import with_fields_of
from taxel._core import ProblemError
from taxel.array import Array
from taxel.events import Events
from taxel.simulate.acts import Act, Contact, FrameSequence, Scene, Silence
from taxel.simulate.board import fitting, lines_of
from taxel.simulate.circuit import Circuit
from taxel.simulate.emulator_report import EmulatorReport
from taxel.simulate.options import EmulateOptions
from taxel.simulate.replay import Replay
from taxel.wire import Registers

__all__ = ["EmulatorReport", "Played", "emulate", "play", "truth"]


class Played(NamedTuple):
    """Data that a host decoded from a board's datagrams.

    Attributes
    ----------
    events : Events
        All events: those of the tare, then, after the start marker, those of the scenes.
    datagrams : int, 0 or more
    words : int, 0 or more
        Words of version 1 of the wire, of five bytes each; 0 with version 2.
    bytes : int, 0 or more
        Bytes of all datagrams, without the headers of the network.
    """

    events: Events
    datagrams: int
    words: int
    bytes: int


def truth(
    acts: Sequence[Act], *, preset: str | None = None, array: Array | None = None
) -> tuple[list[Contact], NDArray[np.float32]]:
    """Return the truth of acts: touches by the board's clock (us from its first frame), and force (N) by frame.

    Parameters
    ----------
    acts : sequence of Scene, Silence, FrameSequence
    preset : str, optional
        The board's registers, one of `taxel.wire.PRESETS`, with as many lines as the array has. Default: "5.2 kHz", or
        the preset of a board of more than 64 lines at reset.
    array : Array, optional
        Default: the thesis' 64 x 64 taxels.

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
    sensed, acts = Array._of(array), several("acts", acts)
    registers = fitting(preset, sensed)._json()
    contacts, force, narrow = _core.truth(sensed, registers, _parts(acts, sensed))
    _warn(acts, narrow)
    return [Contact(**contact) for contact in contacts], force


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
    """Play acts to an emulated board, as fast as possible, and decode its datagrams.

    The board arms after its first frame, is tared with a noise floor of 0 for `tare_ms`, then takes the preset's floor
    and marks a start; before the last frame it marks a stop.

    Parameters
    ----------
    acts : sequence of Scene, Silence, FrameSequence
        The first should be a Silence longer than the tare.
    seed : int, 0 or more
        Draws the taxels' spread and the noise.
    preset : str, optional
        As in `truth`.
    tare_ms : float, ms, 0 to 60000
    array : Array, optional
        As in `truth`.
    sensor : mapping, optional
        Parameters that differ from the usual sensor: v_trans, feedback_kohm, rest_us, touch_us, exponent, side_mm,
        gain_spread, offset_mv, noise_ticks.
    wire : {1, 2}, optional
        Version of the wire. Default: that of the registers, or 2 if `asynchronous`.
    circuit : Circuit, optional
        Lines that its taxels share, settling, comparators with hysteresis. Default: each taxel is read by itself. Its
        voltage and resistor must be those of the sensor; the converter's times are those of the preset.
    asynchronous : bool
        Each taxel compares by itself, as in `Board`; needs version 2, and no circuit.
    watch : function, optional
        Called with the share that has been played, once in each second of the board's time.

    Raises
    ------
    SceneError : an act or a sensor that is invalid
    ProblemError : acts too short for the tare; a circuit of another voltage or resistor; asynchronous on version 1
    DeviceError : the array has more lines than the preset, or that version of the wire, reads

    Examples
    --------
    >>> played = play([Silence(60.0)], seed=1)
    >>> played.events.markers
    ((50300, True), (59900, False))
    """
    sensed, acts = Array._of(array), several("acts", acts)
    parts, registers = _parts(acts, sensed), fitting(preset, sensed)
    if wire is not None or flag("asynchronous", asynchronous):
        registers = registers.replace(wire_version=2 if wire is None else integer("wire", wire, 1, 2))
    played = _core.play(
        sensed,
        registers._json(),
        parameters({} if sensor is None else mapping("sensor", sensor)),
        integer("seed", seed, 0),
        parts,
        number("tare_ms", tare_ms),
        parameters({"circuit": lines_of(circuit, asynchronous), "asynchronous": asynchronous}),
        callback("watch", watch),
    )
    _warn(acts, played.narrow)
    return Played(Events._unchecked(**played.events, array=sensed), played.datagrams, played.words, played.bytes)


@with_fields_of(EmulateOptions)
def emulate(to: str, options: EmulateOptions) -> EmulatorReport:
    """Play a touch to an emulated board in real time, and send its datagrams by UDP.

    When acts are played, the board arms after the first frame, sets the noise floor to 0 for `tare_ms`, marks a start,
    and at the end a stop.

    Parameters
    ----------
    to : str
        Address and port to send to, for example "127.0.0.1:5208".
    touch : iterable of Scene, Silence, FrameSequence; or Replay
        The touch. An iterable of acts may be endless: each act is computed while those before it are played.
    seed : int, 0 or more
        Seed of the spread of the taxels and of the noise.
    preset : str, optional
        A preset of the registers. Default: those of a board of this array at reset.
    registers : Registers, optional
        The registers of the board, in place of a preset.
    tare_ms : float, ms, 0 to 60000
        Time for which the noise floor is 0 before the start marker, if acts are played.
    array : Array, optional
        The sensor; a Replay has its own sensor. Default: 64 x 64 taxels.
    sensor : mapping, optional
        Parameters that differ from the usual sensor, as in `play`.
    wire : {1, 2}, optional
        Version of the wire. Default: that of the registers.
    previous : {"last_sent", "last_sample"}
        As in `Board`.
    intensity : {"value", "difference", "nothing"}
        As in `Board`.
    version_2 : Version2, optional
        Options of version 2 of the wire.
    circuit : Circuit, optional
        Lines that the taxels share, settling, comparators with hysteresis; by default each taxel is read by itself.
        With acts, its voltage and resistor must be those of the sensor. The converter's times are those of the
        registers, and flaws are applied after it. The report has the frame rate that a single core reached.
    asynchronous : bool
        Each taxel compares by itself, as in `Board`; no circuit, and version 2 of the wire (``wire=2``).
    flaws : Flaws, optional
        Flaws of the taxels.
    faults : Faults, optional
        Faults of the network.
    reset_every_s : float, s, optional
        Interval between resets of the board, by its own clock. Default: none.
    drift_ppm : float, parts per million, from -100000 to 100000
        How much faster the board's clock runs than this machine's.
    control : str, optional
        Address and port where the board accepts commands by TCP; port 0 finds a free one.
    source_port : int, 0 to 65535
        The UDP port to send from; 0 finds a free one.
    begun : function, optional
        Called with the address of `control`, or None, just before the first frame.
    watch : function, optional
        Called with an `EmulatorReport` ten times a second.
    touched : function, optional
        Called before `watch` with the touches (`Contact`, us of the board's clock) of acts that were computed since.

    Returns
    -------
    EmulatorReport
        With the delays of the frames, from which it is known whether the machine can hold the board's rate.

    Raises
    ------
    SceneError : an act or a sensor that is invalid
    ProblemError : options that are invalid, or a circuit of another voltage or resistor
    DeviceError : the array has more lines than the preset, or that version of the wire, reads
    OSError : a socket cannot be opened

    Examples
    --------
    >>> report = emulate("127.0.0.1:9", [Silence(30.0)], tare_ms=10.0)
    >>> report.frames > 0, report.resets
    (True, 0)
    """
    options = options.completed()
    touch, sensed = options.touch, Array._of(options.array)
    registers = instance("registers", options.registers, Registers)
    felt: Any = touch._touch(registers) if isinstance(touch, Replay) else _checked(touch, sensed)

    def tell(state: dict[str, Any], contacts: list[Any]) -> None:
        if contacts:
            options.touched([Contact(**contact) for contact in contacts])
        options.watch(EmulatorReport._of(state))

    callback("watch", options.watch), callback("touched", options.touched)
    report = _core.emulate(
        text("to", to),
        sensed,
        parameters({} if options.sensor is None else mapping("sensor", options.sensor)),
        integer("seed", options.seed, 0),
        felt,
        parameters(options.for_rust()),
        callback("begun", options.begun),
        tell,
    )
    return EmulatorReport._of(report)


def _checked(acts: Iterable[Act], array: Array) -> Iterator[Any]:
    """Return the parts of acts, one after the other; an act that is invalid is refused when its turn comes.

    Of a sequence all are checked at once.
    """
    if isinstance(acts, Sequence):
        return iter(_parts(acts, array))
    try:
        return (_part(n, act, array) for n, act in enumerate(iter(acts)))
    except TypeError:
        raise refused("touch", f" is {shown(acts)}: must be acts or a Replay") from None


def _parts(acts: Sequence[Act], array: Array) -> list[Any]:
    return [_part(n, act, array) for n, act in enumerate(acts)]


def _warn(acts: Sequence[Act], narrow: list[tuple[int, str]]) -> None:
    """Warn of scenes, by number of the act, in which a touch is too narrow."""
    for n, problem in narrow:
        act = acts[n]
        if isinstance(act, Scene):
            act._warn(problem)


def _part(n: int, act: Act, array: Array) -> Any:
    instance(f"act {n}", act, Scene, Silence, FrameSequence)
    if isinstance(act, FrameSequence) and act.values.shape[1:] != array.shape:
        raise ProblemError(
            f"act {n}: the frames have shape {act.values.shape[1:]}; must be that of the array, {array.shape}"
        )
    return act._part()
