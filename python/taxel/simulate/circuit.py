"""The array's circuit: fabric, lines with their crosstalk, multiplexer, ramp and comparators, from force to ticks.

A `Fabric` turns force into conductance. `VirtualGround` (the thesis' array) or a `Divider` (its first, of 8 x 8) turns
the conductances of a whole array into the voltages that their shared lines really give; a `Converter` turns those into
ticks, an `AdaptiveRamp` by a ramp as steep as the signal asks for. `Circuit` is lines and converter as an emulated
board can have them. Arrays are ``(rows, columns)``, or frames of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel import _core
from taxel._base.arguments import finite_numbers, floats, number
from taxel._base.errors import refused
from taxel._base.parameters import Value, defaults

__all__ = ["AdaptiveRamp", "Circuit", "Converted", "Converter", "Divider", "Fabric", "Trace", "VirtualGround"]

Values = NDArray[np.float64]

#: The largest voltage that a comparator is asked about, V.
_MOST_V = 1e6
_FABRIC = defaults("fabric")
_GROUND = defaults("virtual_ground")
_DIVIDER = defaults("divider")
_CONVERTER = defaults("converter")
_CIRCUIT = defaults("circuit")
_ADAPTIVE = defaults("adaptive_ramp")


@dataclass(kw_only=True, eq=False, repr=False)
class Fabric(Value):
    """Model a fabric taxel's conductance under a force: ``rest_us + touch_us (F / 0.02 N)^exponent``.

    Parameters
    ----------
    rest_us : float, uS, 0 or more
        Conductance at rest.
    touch_us : float, uS, above 0
        Conductance that 0.02 N adds; the default makes 0.1 V at 1.3 V and 47 kOhm.
    exponent : float, from 0.5 to 1

    Raises
    ------
    ProblemError : a parameter that is invalid

    Notes
    -----
    All three defaults are guesses around one figure of the thesis (0.02 N are seen at 1.3 V, 4.4.1): no maker's curve
    of the fabric was found. They are those of the simulated scenes.

    Examples
    --------
    >>> Fabric().conductance([0.0, 0.02])
    array([0.1 , 1.74])
    """

    rest_us: float = _FABRIC.rest_us
    touch_us: float = _FABRIC.touch_us
    exponent: float = _FABRIC.exponent

    _kind = "fabric"

    def conductance(self, force_n: ArrayLike) -> Values:
        """Return conductances in uS of forces in N, of the same shape; a force below 0 counts as 0.

        Parameters
        ----------
        force_n : float64, N, any shape

        Returns
        -------
        float64, uS, of the same shape

        Raises
        ------
        ProblemError : forces that are not finite

        Examples
        --------
        >>> Fabric().conductance([0.0]) == Fabric().rest_us
        array([ True])
        """
        checked = finite_numbers("force_n", force_n)
        return _core.fabric(self._json(), checked.ravel(), False).reshape(checked.shape)

    def force(self, conductance_us: ArrayLike) -> Values:
        """Return forces in N of conductances in uS, of the same shape: the inverse; 0 at rest and below.

        Parameters
        ----------
        conductance_us : float64, uS, any shape

        Returns
        -------
        float64, N, of the same shape

        Raises
        ------
        ProblemError : conductances that are not finite

        Examples
        --------
        >>> fabric = Fabric()
        >>> fabric.force(fabric.conductance([0.0, 2.0])).round(6)
        array([0., 2.])
        """
        checked = finite_numbers("conductance_us", conductance_us)
        return _core.fabric(self._json(), checked.ravel(), True).reshape(checked.shape)


class _Lines(Value):
    """Share what both ways to hold lines have: voltages of a whole array, and of taxels by themselves."""

    def volts(self, conductance_us: ArrayLike) -> Values:
        """Return each sense line's voltage while each driven line is read, V, by the exact network.

        Parameters
        ----------
        conductance_us : float64, uS, (rows, columns) or (n, rows, columns), 0 to 1e9
            Rows are sense lines, columns are driven.

        Returns
        -------
        float64, V, of the same shape

        Raises
        ------
        ProblemError : an invalid conductance (names the taxel), or another shape
        """
        checked = _frames("conductance_us", conductance_us)
        shape: tuple[int, int] = checked.shape[-2:]
        return _core.circuit_volts(self._kind, self._json(), shape, checked.ravel()).reshape(checked.shape)

    def volts_alone(self, conductance_us: ArrayLike) -> Values:
        """Return the voltages of taxels on ideal lines without crosstalk, V, of the same shape.

        Parameters
        ----------
        conductance_us : float64, uS, of any shape

        Returns
        -------
        float64, V, of the same shape

        Raises
        ------
        ProblemError : conductances that are not finite
        """
        checked = finite_numbers("conductance_us", conductance_us)
        return _core.circuit_volts_alone(self._kind, self._json(), checked.ravel()).reshape(checked.shape)


@dataclass(kw_only=True, eq=False, repr=False)
class VirtualGround(_Lines):
    """Hold rows by transimpedance amplifiers and columns by switches, all at one voltage; the read column is grounded.

    With ideal parts, each taxel gives ``v_trans (1 + feedback_kohm G)`` by itself. Switches and amplifiers that are
    not ideal make taxels influence each other: `volts` solves that network exactly. Lines have no resistance.

    Parameters
    ----------
    v_trans : float, V, above 0, at most 1000
        Voltage of the lines (thesis 4.4.1).
    feedback_kohm : float, kOhm, above 0, at most 1000000
        Feedback resistor (thesis 4.3.2).
    gain : float, 1 or more, optional
        Open-loop gain of the amplifiers (a guess); None: without bound.
    offset_mv : float, mV, from 0 to 1000000
        Standard deviation of the amplifiers' offsets.
    switch_ohm : float, ohm, from 0 to 1e9
        Resistance of a column's switch; default: that of an ADG734.
    rail_v : float, V, above 0
        Voltage at which amplifiers saturate; they also saturate at 0 V. The line of one that does counts as held.
    seed : int, 0 or more
        Seed of the offsets.

    Raises
    ------
    ProblemError : a parameter that is invalid

    Notes
    -----
    Thesis 4.3.2, figure 4.1. The solution takes one dense factor with as many unknowns as rows. The gain is that of
    slow signals: within 3 us an amplifier has less.

    Examples
    --------
    >>> import numpy as np
    >>> lines = VirtualGround()
    >>> alone = np.zeros((4, 4)); alone[1, 2] = 20.0
    >>> lines.volts(alone)[1].round(3)
    array([1.3  , 1.3  , 2.522, 1.3  ])
    """

    v_trans: float = _GROUND.v_trans
    feedback_kohm: float = _GROUND.feedback_kohm
    gain: float | None = _GROUND.gain
    offset_mv: float = _GROUND.offset_mv
    switch_ohm: float = _GROUND.switch_ohm
    rail_v: float = _GROUND.rail_v
    seed: int = _GROUND.seed

    _kind = "virtual_ground"

    def ideal(self) -> Self:
        """Return the same circuit with ideal amplifiers and switches: no crosstalk."""
        return type(self)(**{**self._values(), "gain": None, "offset_mv": 0.0, "switch_ohm": 0.0})


@dataclass(kw_only=True, eq=False, repr=False)
class Divider(_Lines):
    """Pull rows to ground by resistors; put the supply on one driven line, and ground on the others: no amplifier.

    Currents also flow through other taxels, so a taxel reads less, or more, than it would by itself.

    Parameters
    ----------
    supply_v : float, V, above 0, at most 1000
        Voltage of the driven line (thesis 3.4.2).
    resistor_kohm : float, kOhm, above 0, at most 1000000
        The other half of the divider (a guess).
    switch_ohm : float, ohm, from 0 to 1e9
        Resistance of a driven line's switch.

    Raises
    ------
    ProblemError : a parameter that is invalid

    Notes
    -----
    Thesis 3.4.2 and Appendix 1, figure 1.1. There rows are driven and columns are read, so its array is this array
    turned.

    Examples
    --------
    >>> Divider().volts([[100.0]])
    array([[2.5]])
    """

    supply_v: float = _DIVIDER.supply_v
    resistor_kohm: float = _DIVIDER.resistor_kohm
    switch_ohm: float = _DIVIDER.switch_ohm

    _kind = "divider"


class Trace(NamedTuple):
    """Hold the signals of one comparator, as an oscilloscope would show them: arrays of one length.

    Attributes
    ----------
    t_us : float64, shape (n,), us
    line_v : float64, shape (n,), V
        Voltage of the sense line that the multiplexer has chosen.
    input_v : float64, shape (n,), V
        Voltage of the comparator's input, which settles towards the sense line.
    ramp_v : float64, shape (n,), V
        The ramp.
    high : bool, shape (n,)
        The comparator's output: whether the ramp has passed.
    """

    t_us: Values
    line_v: Values
    input_v: Values
    ramp_v: Values
    high: NDArray[np.bool_]


@dataclass(kw_only=True, eq=False, repr=False)
class Converter(Value):
    """Multiplex sense lines onto comparators, wait for the ramp to pass, count ticks.

    Parameters
    ----------
    shape : {"rc", "linear"}
        Shape of the ramp: charging towards 5 V, or straight; both end at 3 V.
    ramp : int, ticks, from 1 to 65534
        Time that the ramp rises, in 1/300 us; a line above 3 V reads this value.
    hysteresis_v : float, V, 0 or more
        Distance between a comparator's two thresholds (thesis 4.3.2).
    settle_us : float, us, from 0 to 1000000
        Time constant of a comparator's input: the default settles to 2 % in 0.2 us (thesis 4.4.1).
    amplifier_us : float, us, from 0 to 1000000
        Time constant of the amplifiers, by which a column affects the next; 0: none. 0.705 if the board's 15 pF are
        across its 47 kOhm, which no text states.
    discharge_us : float, us, from 0 to 1000000
        Time constant with which the ramp falls back (a guess).
    wait_us : float, us, from 0 to 1000000
        Time from a step's beginning to the ramp's beginning.
    step_us : float, us, above 0, at most 1000000
        Time from one sense line of a channel to its next.
    line_us : float, us, above 0, at most 1000000
        Time from one column to the next.
    steps : int, from 1 to 65535
        Number of sense lines of a channel.

    Raises
    ------
    ProblemError : a parameter that is invalid, a step too short for its ramp, a column too short for its steps

    Notes
    -----
    Thesis 4.3.2, figures 4.3 and 4.7. Channel c reads rows ``steps * c`` and following. The times are those of the
    preset "5.2 kHz".

    Examples
    --------
    >>> Converter().ticks([[1.3], [1.4], [2.0], [4.0]]).round(1)
    array([[ 51.5],
           [ 56.1],
           [ 86.4],
           [150. ]])
    """

    shape: Literal["rc", "linear"] = _CONVERTER.shape
    ramp: int = _CONVERTER.ramp
    hysteresis_v: float = _CONVERTER.hysteresis_v
    settle_us: float = _CONVERTER.settle_us
    amplifier_us: float = _CONVERTER.amplifier_us
    discharge_us: float = _CONVERTER.discharge_us
    wait_us: float = _CONVERTER.wait_us
    step_us: float = _CONVERTER.step_us
    line_us: float = _CONVERTER.line_us
    steps: int = _CONVERTER.steps

    _kind = "converter"

    def ticks(self, volts: ArrayLike) -> Values:
        """Return the time at which each comparator trips, in ticks with their fraction.

        A counter shows the whole ticks below. The frames are scanned one after the other, columns from the first; the
        first frame finds everything settled.

        Parameters
        ----------
        volts : float64, V, (rows, columns) or (n, rows, columns), from -1e6 to 1e6

        Returns
        -------
        float64, ticks, of the same shape
            `ramp` where the ramp never passed; not a number where a comparator had not returned when its ramp began.

        Raises
        ------
        ProblemError : voltages that are not finite, or another shape
        """
        checked = _frames("volts", volts)
        if (np.abs(checked) > _MOST_V).any():
            raise refused("volts", f": must be from -{_MOST_V:g} to {_MOST_V:g} V")
        shape: tuple[int, int] = checked.shape[-2:]
        return _core.converter_ticks(self._json(), shape, checked.ravel()).reshape(checked.shape)

    def ramp_volts(self, ticks: ArrayLike) -> Values:
        """Return the voltage of the ramp after so many ticks.

        Parameters
        ----------
        ticks : float64, ticks, any shape

        Returns
        -------
        float64, V, of the same shape

        Raises
        ------
        ProblemError : ticks that are not finite

        Examples
        --------
        >>> converter = Converter()
        >>> converter.ramp_ticks(converter.ramp_volts([50.0])).round(6)
        array([50.])
        """
        checked = finite_numbers("ticks", ticks)
        return _core.converter_ramp(self._json(), checked.ravel(), False).reshape(checked.shape)

    def ramp_ticks(self, volts: ArrayLike) -> Values:
        """Return the time at which the ramp passes a voltage: the inverse of `ramp_volts`.

        Parameters
        ----------
        volts : float64, V, any shape

        Returns
        -------
        float64, ticks, of the same shape
            `ramp` at 3 V and above.

        Raises
        ------
        ProblemError : voltages that are not finite
        """
        checked = finite_numbers("volts", volts)
        return _core.converter_ramp(self._json(), checked.ravel(), True).reshape(checked.shape)

    def trace(self, line_v: Sequence[float], *, every_us: float = 0.01, stop_us: float = 3.0) -> Trace:
        """Return the signals of one comparator while its lines are read, again and again.

        Parameters
        ----------
        line_v : sequence of float, V, one per step
            The sense lines, settled.
        every_us : float, us, above 0 and finite
            Time between two points.
        stop_us : float, us, 0 or more

        Returns
        -------
        Trace

        Raises
        ------
        ProblemError : not one voltage for each step, or more than 1e7 points or steps

        Examples
        --------
        >>> trace = Converter().trace([1.4, 1.5, 2.0, 2.5], every_us=0.01, stop_us=3.0)
        >>> len(trace.t_us), round(float(trace.ramp_v.max()), 2)
        (301, 3.0)
        """
        lines = floats("line_v", line_v).tolist()
        period, stop = number("every_us", every_us), number("stop_us", stop_us)
        return Trace(**_core.converter_trace(self._json(), lines, period, stop))


class Converted(NamedTuple):
    """Hold frames that were converted one after the other, each with a separate ramp.

    Attributes
    ----------
    t_us : float64, shape (frames,), us
        Time at which each frame began; a column is read with the voltages at the time when it is converted.
    ramp : uint32, shape (frames,), ticks
        Duration of its ramp.
    ticks : float64, shape (frames, rows, columns), ticks
        Times at which the comparators tripped, as from `Converter.ticks`.
    volts : float64, shape (frames, rows, columns), V
        The voltages of the whole ticks that a counter shows: halfway to the next tick, 3 V at the end.
    """

    t_us: Values
    ramp: NDArray[np.uint32]
    ticks: Values
    volts: Values


@dataclass(kw_only=True, eq=False, repr=False)
class AdaptiveRamp(Value):
    """Convert by a ramp that is steep while the signal moves fast and gentle while it hardly does (thesis 4.3.2).

    After a frame, the taxel that moved farthest sets the length of the next ramp: it moves by `moves_ticks` of that
    ramp within the frame, so that the error of a reading by its age is about its error by coarse ticks. If no taxel
    moves, the ramp takes twice its time, up to the gentlest. The time that a step and a column take beside their ramp
    stays the same.

    Parameters
    ----------
    converter : Converter, optional
        Its times, those of a step and a column with the ramp that it holds. None: the defaults.
    steepest : int, ticks, from 1 to 65534
        The shortest time of the ramp.
    gentlest : int, ticks, from 1 to 65534
        The longest; the default is that of the preset "2 kHz".
    moves_ticks : float, ticks, above 0
        Largest move of the fastest taxel in a frame.
    noise_ticks : float, ticks, 0 or more
        Largest change that does not count as a move, in ticks of the coarser of two ramps.

    Raises
    ------
    ProblemError : a parameter that is invalid, or `steepest` above `gentlest`

    Notes
    -----
    The thesis calls for a steep slope during gross movements and a gentle one during fine control, and states no rule:
    this rule is ours. ``taxel study adaptive_ramp`` shows what it gains.

    Examples
    --------
    >>> still = np.full((2000, 4, 8), 1.7)
    >>> AdaptiveRamp().convert(still, period_us=1.0).ramp[:4].tolist()
    [510, 510, 510, 510]
    """

    converter: Converter | None = _ADAPTIVE.converter
    steepest: int = _ADAPTIVE.steepest
    gentlest: int = _ADAPTIVE.gentlest
    moves_ticks: float = _ADAPTIVE.moves_ticks
    noise_ticks: float = _ADAPTIVE.noise_ticks

    _kind = "adaptive_ramp"
    _nested: ClassVar[dict[str, type[Any]]] = {"converter": Converter}

    def convert(self, volts: ArrayLike, *, period_us: float) -> Converted:
        """Convert voltages of lines, frame after frame until the voltages end.

        Parameters
        ----------
        volts : float64, V, (n, rows, columns)
            Voltages of the lines at even times, with linear interpolation.
        period_us : float, us, above 0
            Time from one of these voltages to the next.

        Raises
        ------
        ProblemError : voltages that are not finite, another shape, or so many that more than 2e8 readings could come
        """
        checked = _frames("volts", volts)
        frames = checked if checked.ndim == 3 else checked[None]
        shape: tuple[int, int] = frames.shape[1:]
        period = number("period_us", period_us)
        read = _core.adaptive_convert(self._json(), shape, frames.ravel(), period)
        return Converted(read.t_us, read.ramp, read.ticks.reshape(-1, *shape), read.volts.reshape(-1, *shape))


@dataclass(kw_only=True, eq=False, repr=False)
class Circuit(Value):
    """Combine lines and converter for an emulated board.

    Parameters
    ----------
    readout : VirtualGround, optional
        None: the defaults.
    converter : Converter, optional
        None: the defaults.

    Raises
    ------
    ProblemError : a part of another kind

    Examples
    --------
    >>> Circuit().ticks([[0.1, 1.74]]).round(1)
    array([[51.8, 56.4]])
    """

    readout: VirtualGround | None = _CIRCUIT.readout
    converter: Converter | None = _CIRCUIT.converter

    _kind = "circuit"
    _nested: ClassVar[dict[str, type[Any]]] = {"readout": VirtualGround, "converter": Converter}

    def ticks(self, conductance_us: ArrayLike) -> Values:
        """Return ticks of conductances in uS: `VirtualGround.volts`, then `Converter.ticks`.

        Parameters
        ----------
        conductance_us : float64, shape (rows, columns) or (n, rows, columns), uS

        Returns
        -------
        float64, ticks, of the same shape

        Raises
        ------
        ProblemError : as these
        """
        volts = (self.readout or VirtualGround()).volts(conductance_us)
        return (self.converter or Converter()).ticks(volts)


def _frames(name: str, values: ArrayLike) -> Values:
    checked = finite_numbers(name, values)
    if checked.ndim not in (2, 3) or 0 in checked.shape[-2:]:
        raise refused(name, f" has shape {checked.shape}: must be (rows, columns) or (n, rows, columns)")
    return checked
