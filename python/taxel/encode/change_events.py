"""Change events with a noise floor and 1 to 10 bits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from taxel._base.parameters import defaults
from taxel.encode._encoder import Encoder

_DEFAULT = defaults("change_events")


@dataclass(kw_only=True, eq=False, repr=False)
class ChangeEvents(Encoder):
    """Encode each change of a taxel since its last event, in units of the noise floor; +-(2^bits - 1) at most.

    There is one signed train for each taxel. The first sample is the first reference value and causes no spike.
    Computed in float32.

    Parameters
    ----------
    noise_floor : float, in the sensor's unit, above 0
        The smallest change that causes an event; theta_0 of equation 5.7. 3 ticks in the board's fast presets.
    bits : int, from 1 to 10
        Bits of an event (figure 5.7); 1 is the polarity only.
    previous : {"last_sent", "last_sample"}
        The value with which a sample is compared: that of the last event, or the last sample, as in section 4.3.
    rounding : {"truncate", "floor"}
        "truncate": towards zero, with an event only if the change is above the noise floor. "floor": 5.7 as printed, by
        which every fall, however small, gives -1.
    period_ms : float, ms, whole us
        Sampling period of events; the step of the wire's stamps is lossless.

    Raises
    ------
    ProblemError : an invalid parameter

    Notes
    -----
    Thesis 5.5.2, equation 5.7.

    Examples
    --------
    >>> from taxel import Frames
    >>> frames = Frames([[[50.0]], [[58.0]], [[57.0]]], [0, 200, 400], unit="ticks")
    >>> spikes = ChangeEvents(bits=4).encode(frames)
    >>> spikes.times, spikes.values
    (array([0.2]), array([2.], dtype=float32))
    """

    name = "change_events"

    noise_floor: float = _DEFAULT.noise_floor
    bits: int = _DEFAULT.bits
    previous: Literal["last_sent", "last_sample"] = _DEFAULT.previous
    rounding: Literal["truncate", "floor"] = _DEFAULT.rounding
    period_ms: float = _DEFAULT.period_ms
