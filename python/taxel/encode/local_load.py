"""Encoder of the local load: quantities of a touch in units of each taxel's own noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel._base.parameters import defaults
from taxel.encode._encoder import frames_of
from taxel.encode._tared import Tared
from taxel.events import Events
from taxel.frames import Frames
from taxel.recorded import Recorded, recorded
from taxel.tare import Tare

_DEFAULT = defaults("local_load")


@dataclass(kw_only=True, eq=False, repr=False)
class LocalLoad(Tared):
    """Give quantities of a touch in units of each taxel's own noise: graded spikes, log(1 + quantity), every sample.

    With u a value less its rest, sigma the taxel's standard deviation in the tare (at least `least_noise`) and
    s = sqrt(sigma^2 + noise_floor^2 / 4), the quantities are, in this order:

    1. *area*: the number of taxels with u of at least the larger of noise_floor + 0.5 and 3 sigma, and with such a
       neighbour among their 8; *largest*: the largest sum of u, clipped to +-3 s, over 3 x 3 taxels, divided by
       sqrt(sum of s^2), at least 0, so that a stuck taxel or two do not reach 4; *places*: the number of taxels around
       which this sum is above 4; *total*: the sum of all u of at least 5 sigma.
    2. For each running mean in `local_ms`, with u a value less its running mean: *area* (with 4 sigma), *largest*,
       *largest below* and *area below* (the same of -u), *total*, *total below*. They respond to changes next to an
       object that stays.
    3. The means of all these over the last 3 ms, then from 10 to 2 ms ago; the means of the four of 1 over the last 10
       and the last 50 ms.
    4. *clock*: 1.

    Without running means there are 21 quantities, with two running means 57. `quantities` names them, and `values`
    returns them. Each quantity has one graded train: for events a spike every `period_ms`, for frames a spike for each
    frame; none where the quantity is 0. A taxel that has been 0 since the first sample has no value yet and counts as
    at rest; a taxel without a value in the tare is left out. Computed in float32 above float64 baselines.

    With `levels` the trains are unsigned, and others: for each quantity *largest* or *largest below*, in the order
    above, one train per level, which fires when the quantity rises to it; then as many trains, in the same order, which
    fire when it falls below `release` x level. They are computed once for each stamp, after the last event with it, and
    as the rest moves; spikes have the time of the stamp. A stuck taxel or two do not reach a level of 4.

    Parameters
    ----------
    noise_floor : float, in the sensor's unit (ticks), 0 or more
        The noise floor of the board; 3 in its fast presets.
    least_noise : float, in the sensor's unit, from 1e-9 to 1e9
        Least noise of a taxel. 0.3 is the standard deviation within a tick; for another unit use 0.3 of the step
        between its values.
    rest : {"tracked", "tare"}
        "tare" is constant. "tracked" begins at the tare and follows each taxel's value: with a time constant of 1 s
        while abs(u) is less than the larger of noise_floor + 0.5 and 5 sigma, else of 20 s.
    local_ms : sequence of float, ms, above 0
        Time constants of running means, with six quantities each; (50, 300) for objects that stay.
    period_ms : float, ms, whole us
        Sampling period of events; the step of the wire's stamps is lossless. Levels are not sampled.
    levels : sequence of float, units of noise, ascending, above 0
        Levels of the largest sums, which are 9 at most, instead of graded quantities; none by default.
    release : float, from 0.01 to 1
        The share of a level below which the quantity leaves the level. Below 1, noise near a level does not cross it
        again and again.
    tare : Tare, or float, s, optional
        The taxels' rest and noise, or the duration of rest at the beginning of each recording. It is valid for one
        board on one day, so a saved readout has no tare; encoding requires one.

    Raises
    ------
    ProblemError : an invalid parameter; encoding without a tare, or with another array's

    Examples
    --------
    Four taxels; two are pressed, far above their noise of at most 0.3 ticks.

    >>> from taxel import Array
    >>> four = {"unit": "ticks", "array": Array(1, 4, pitch_mm=2.0)}
    >>> tare = Tare.take(Frames([[[50.0, 50, 50, 50]]] * 2, [0, 1000], **four))
    >>> frames = Frames([[[50.0, 50, 50, 50]], [[50.0, 58, 60, 50]]], [0, 1000], **four)
    >>> load = LocalLoad(tare=tare)
    >>> load.quantities[:4]
    ('area', 'largest', 'places', 'total')
    >>> load.values(frames)[:, :4].round(2)
    array([[ 0.  ,  0.  ,  0.  ,  0.  ],
           [ 2.  ,  3.46,  0.  , 18.  ]])

    With levels it fires when the largest sum rises to 2 and to 3; it never falls below them.

    >>> spikes = LocalLoad(levels=(2, 3), tare=tare).encode(frames)
    >>> [train.tolist() for train in spikes]
    [[1.0], [1.0], [], []]
    """

    name = "local_load"
    _needs_neighbours = True

    noise_floor: float = _DEFAULT.noise_floor
    least_noise: float = _DEFAULT.least_noise
    rest: Literal["tracked", "tare"] = _DEFAULT.rest
    local_ms: Sequence[float] = _DEFAULT.local_ms
    period_ms: float = _DEFAULT.period_ms
    levels: Sequence[float] = _DEFAULT.levels
    release: float = _DEFAULT.release
    tare: Tare | float | None = _DEFAULT.tare

    @property
    def quantities(self) -> tuple[str, ...]:
        """The names of the quantities, in the order of the columns of `values`, and, without `levels`, of the trains.

        Examples
        --------
        >>> names = LocalLoad(local_ms=(50, 300)).quantities
        >>> len(names), names[4], names[-2]
        (57, 'area, 50 ms', 'total, mean of 0 to 50 ms ago')
        """
        return tuple(_core.local_load_quantities(self._json()))

    def values(self, x: Events | Frames | Recorded) -> NDArray[np.float64]:
        """Return the quantities themselves, of which `encode` returns log(1 + quantity) as graded spikes.

        Parameters
        ----------
        x : Events, Frames or Recording
            As in `Encoder.encode`.

        Returns
        -------
        float64, shape (samples, quantities)
            A row for each frame; for events a row every `period_ms`, the first at the first stamp, the last at most one
            period after the last stamp. Totals are in the sensor's unit.

        Raises
        ------
        ProblemError : as `encode`

        Examples
        --------
        >>> from taxel import Array
        >>> two = {"unit": "ticks", "array": Array(1, 2, pitch_mm=2.0)}
        >>> tare = Tare.take(Frames([[[50.0, 50]]] * 2, [0, 1000], **two))
        >>> LocalLoad(tare=tare).values(Frames([[[50.0, 55]]], [0], **two)).shape
        (1, 21)
        """
        encoder, source = self._with_rest_of(recorded(x))
        sensed = source if isinstance(source, Events) else frames_of(source)
        values = _core.local_load_values(encoder._json(), sensed)
        return values.reshape(-1, len(self.quantities))
