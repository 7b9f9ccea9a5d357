"""A sensor at rest that drifts: how its rest follows, and when it has left the noise floor of the training."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from taxel import _core
from taxel._base.messages import three_digits
from taxel.detect.detector import _Detector
from taxel.detect.examples import Example
from taxel.formats.event_camera import are_counts
from taxel.frames import Frames
from taxel.recording.analysis.rest import FORCE_UNITS

#: After so long a load that stays is rest, s. It is stated and not learnt: five times the longest press of a training
#: swallowed 33 of 349 presses and lifts of half a minute.
ABSORB_S = 60.0


def rest_of(examples: Sequence[Example], noise_floor: float, absorb_s: float | None) -> dict[str, float] | None:
    """Return how the rest of (checked) examples follows, as a part of a readout's file; None where it cannot.

    It stays by default in units with a true zero: force, pressure, counts of events. That of a board does, whose held
    values are no samples, and that of spike trains and of sensors without a tare.

    Parameters
    ----------
    examples : sequence of Example, checked
    noise_floor : float, in the sensor's unit
    absorb_s : float, s, optional
        How long a load may stay until it becomes rest; 0: the rest stays.
    """
    sources = [example.source for example in examples if example.tare is not None]
    frames = [source for source in sources if isinstance(source, Frames) and source.unit != "ticks"]
    if len(frames) < len(examples):
        return None
    has_zero = any(source.unit in FORCE_UNITS or are_counts(source.unit) for source in frames)
    usual = 0.0 if has_zero else ABSORB_S
    return {"noise_floor": noise_floor, "absorb_s": usual if absorb_s is None else absorb_s}


def followed(example: Example, rest: Mapping[str, float] | None) -> Example:
    """Return a (checked) example of frames less what their rest moved since the tare, as a stream of a readout does."""
    frames, tare = example.source, example.tare
    if rest is None or not rest["absorb_s"] or not isinstance(frames, Frames) or tare is None:
        return example
    values = _core.follow_rest(frames, tare.to_json(), rest["noise_floor"], rest["absorb_s"])
    return example._replace(
        source=Frames(values.reshape(frames.values.shape), frames.t, unit=frames.unit, array=frames.array)
    )


def left_line(readout: _Detector, since_us: int, taxels: int, begin_us: int = 0) -> str:
    """Return that taxels at rest have left the noise floor of the training, since when, and what follows from it.

    Parameters
    ----------
    readout : Readout or PlainRule
        Whose rest follows, or is watched.
    since_us : int, us
    taxels : int
        How many have, at most.
    begin_us : int, us
        The time that text counts from.
    """
    rest = readout._parts["rest"]
    floor = f"{three_digits(rest['noise_floor'])} {readout.unit or ''}".rstrip()
    since = f"since {(since_us - begin_us) / 1e6:.1f} s"
    then = (
        "their rest follows them"
        if rest["absorb_s"]
        else "their rest stays, so detections may be missed or false: take a tare anew, or give --absorb-s "
        f"{ABSORB_S:g}, so that the rest follows"
    )
    return f"at rest, {taxels} taxels have left the noise floor of the training ({floor}) {since}; {then}"
