"""Encoder of the moments of a touch: contact area, total, peak, and displacement of the centre."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from taxel._base.parameters import defaults
from taxel.encode._tared import Tared
from taxel.tare import Tare

_DEFAULT = defaults("moments")


@dataclass(kw_only=True, eq=False, repr=False)
class Moments(Tared):
    """Fire when the area, total, peak or displacement of the centre of a touch crosses levels in geometric steps.

    The moments of the loaded taxels (as in `ContactArea`; a channel as a single taxel there) are their number (area),
    the sum and the largest of their values above rest (total, peak), and the displacement to the right and downwards of
    their centre, weighted by these values, since the present touch began. A touch begins when area rises above 0 and
    ends when it is 0; between touches all moments are 0. Each level of the displacement applies on both sides of 0. The
    moments do not depend on the position of the touch on the array, so weights that are learnt at one position apply to
    others; `centre` adds it.

    Trains are unsigned, one for each level in the order area, total, peak, x right, x left, y down, y up, levels
    ascending: first the trains of levels reached, then those of levels left, then (with `tonic_ms`) those that fire
    while beyond the level. The first sample is not a crossing. Computed in float64.

    With `graded` all trains are graded. Those of the levels, whose spikes have the value 1, are followed by one train
    for each moment in the order area, total, peak, x, y. During a touch it fires at every sample with the value log(1 +
    moment), for a displacement log(1 + its size) with its sign; where the value is 0 there is no spike. With `centre`
    four more follow: the column of the centre, from -1 for the first to 1 for the last, its square, its row and the
    row's square, as they are. With `ages_ms` there is one more train for each age, at the end. During a touch, one of
    them fires at every sample: the train of the largest age that the touch has reached. Age is counted from the
    encoder's own onset, the first sample at which area is above 0. A sample is a frame; for events it is the state
    every `period_ms` from the first stamp.

    Parameters
    ----------
    noise_floor : float, in the sensor's unit (ticks), 0 or more
        The noise floor of the board; 3 in its fast presets.
    levels : int, from 0 to 1000
        Number of levels of each moment, for a displacement on each side of 0. With 0 there are no trains of levels, and
        the least and largest levels only choose the moments; then `graded` or `ages_ms` is needed.
    area : (float, float), taxels, above 0, optional
        Least and largest level; None excludes the moment.
    total, peak : (float, float), in the sensor's unit, above 0, optional
        The same for the sum and for the largest value above rest.
    displacement_mm : (float, float), mm, above 0, optional
        The same for the displacement of the centre, for x and for y.
    tonic_ms : float, ms, whole us, optional
        Adds tonic spikes: one when a level is reached, then one every `tonic_ms` while beyond it. None: crossings only.
    graded : bool
        Whether the moments themselves are encoded too, as graded spikes.
    centre : bool
        Whether the place of the centre is encoded too, as graded spikes; needs `graded`.
    ages_ms : float sequence, ms, 0 or more, ascending, optional
        Ages of a touch, each with a train that fires from that age to the next one, the last to the end of the touch.
        Each is rounded to a whole us. A neuron that learns to fire at an age needs an age there: training refuses a
        `delay_ms` that is not one of them.
    period_ms : float, ms, whole us
        Sampling period of events; the step of the wire's stamps is lossless. With `graded` or `ages_ms` each sample of
        a touch gives spikes, so a longer period gives fewer.
    tare : Tare, or float, s, optional
        The taxels' rest, or the duration of rest at the beginning of each recording. It is valid for one board on one
        day, so a saved readout has no tare; encoding requires one.

    Raises
    ------
    ProblemError : an invalid parameter; encoding without a tare, or with another array's; the centre, or its
        displacement, of channels, which have no places

    Examples
    --------
    A touch of two taxels, then of three; nothing reaches the largest level, 4.

    >>> from taxel import Array, Frames
    >>> three = {"unit": "ticks", "array": Array(1, 3, pitch_mm=1.0)}
    >>> rest = Frames([[[50.0, 50.0, 50.0]]] * 2, [0, 1000], **three)
    >>> frames = Frames([[[50.0, 50, 50]], [[58.0, 58, 50]], [[58.0, 58, 58]]], [0, 200, 400], **three)
    >>> encoder = Moments(levels=3, area=(1, 4), total=None, peak=None, displacement_mm=(0.3, 5), tonic_ms=None)
    >>> [reached.tolist() for reached in encoder.with_tare(Tare.take(rest)).encode(frames)][:4]
    [[0.2], [0.2], [], [0.4]]

    The logarithm of the area at each frame, and which of two ages has been reached.

    >>> encoder = Moments(levels=0, total=None, peak=None, displacement_mm=None, graded=True, ages_ms=[0.0, 0.2])
    >>> spikes = encoder.with_tare(Tare.take(rest)).encode(frames)
    >>> [train.tolist() for train in spikes], spikes.values.round(2)
    ([[0.2, 0.4], [0.2], [0.4]], array([1.1 , 1.39, 1.  , 1.  ], dtype=float32))
    """

    name = "moments"

    noise_floor: float = _DEFAULT.noise_floor
    levels: int = _DEFAULT.levels
    area: tuple[float, float] | None = _DEFAULT.area
    total: tuple[float, float] | None = _DEFAULT.total
    peak: tuple[float, float] | None = _DEFAULT.peak
    displacement_mm: tuple[float, float] | None = _DEFAULT.displacement_mm
    tonic_ms: float | None = _DEFAULT.tonic_ms
    graded: bool = _DEFAULT.graded
    centre: bool = _DEFAULT.centre
    ages_ms: Sequence[float] | None = _DEFAULT.ages_ms
    period_ms: float = _DEFAULT.period_ms
    tare: Tare | float | None = _DEFAULT.tare

    @property
    def _needs_neighbours(self) -> bool:  # type: ignore[override]
        return self.centre or self.displacement_mm is not None
