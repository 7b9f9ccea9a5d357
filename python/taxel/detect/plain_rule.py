"""A detector without training: a load above a threshold for some frames."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from math import ceil
from typing import Any

from taxel import _core
from taxel._base.arguments import flag, floats, instance, integer, number, parameters, several, shown, text
from taxel._base.errors import refused
from taxel._base.messages import escaped, plain
from taxel.array import Array
from taxel.detect.detector import _Detector
from taxel.tare import Tare

#: The labels of onset and end where none are given.
_USUAL = ("contact", "lift")


class PlainRule(_Detector):
    """Detect when the load on a sensor rises to a threshold, and when it is gone: what any training is held against.

    The sensor is loaded from the first of `frames` frames in a row in which the quantity is `threshold` or more, until
    the first of `frames` frames in a row in which it is below `release` x `threshold`. Before the first input it is not
    loaded. A detection's `t` is the time of the first of these frames, and it is `known` at the end of the last.

    With `age_ms` it decides once a touch between two kinds, by the quantity at that age. A touch begins with the first
    frame in which 2 taxels or more are loaded, or one channel, and ends with the first in which none is; `t` is its
    begin, and `known` the end of the frame that holds at the age. A touch that is over by then is decided by what the
    quantity is then. With the age "end" it decides when the touch ends, by the quantity "duration"; `known` is the end
    of the frame in which it ends. A touch that has not ended is not decided.

    Parameters
    ----------
    quantity : {"area", "total", "local_load", "local_rise", "local_fall", "peak", "count", "range_count", \
"begin_area", "duration"}
        The number of loaded taxels, as `taxel.encode.ContactArea` counts them, each channel alone; the sum of their
        values above rest in the sensor's unit, as `taxel.encode.Moments` adds them; the largest sum over 3 x 3 taxels
        above a rest that follows the sensor, in units of its noise, as of `taxel.encode.LocalLoad` ("largest"), or
        above ("local_rise") or below ("local_fall") their running mean of 50 ms; the largest value of a taxel above
        such a rest, in units of that taxel's noise, with what several add, as of `taxel.encode.Peak`; how many taxels
        are above a level, added up over `levels` above rest in the sensor's unit, or ("range_count") over `levels` in
        parts of each taxel's running range (`taxel.encode.RunningRange`), which needs no rest; how many of the loaded
        taxels have been so since a touch began, or since less than a level after it, added up over `levels` in ms: none
        once it has left the place where it began, as that of a foot whose heel lifts; or how long a touch lasts, with
        the age "end". In single precision.
    threshold : float, above 0
        Number of taxels, the sensor's unit, units of noise, or ms.
    release : float, above 0, at most 1
        The part of the threshold below which the load ends. 1 with `age_ms`.
    frames : int, from 1 to 1 000 000
        How many frames in a row decide. 1 with `age_ms`.
    age_ms : float, ms, from 0 to 60 000, or "end", optional
        The age of a touch at which it decides.
    levels : sequence of float, above 0, ascending
        The levels of a count and of the begin area, and of no other quantity. A taxel is above a level of a count until
        it is below seven tenths of it.
    dated_at : float, in the unit of the threshold, from release x threshold to it, optional
        `t` is when the quantity last rose to it before an onset, or fell below it before an end. `known` stays.
    of_largest : bool
        Whether `release` is a part of the largest value since the load began. Threshold and largest value are then
        above a rest: 0 at first, where the quantity was as a load ended, and its least value since.
    labels : (str or None, str or None), optional
        Names of onset and end, default "contact" and "lift"; with `age_ms` of the kinds below the threshold and not
        below it. None: those are not reported.
    noise_floor : float, 0 or more, in the sensor's unit (ticks)
        The board's: a taxel is loaded above its rest by more than this and half a tick, or half of a floor below 1.
    unit : str, optional
        The unit of the values that it was tuned on ("ticks" of a board's events); it then accepts no other.
    tare : Tare, optional
        The taxels' rest. It belongs to a board and a day and may be given later.

    Raises
    ------
    ProblemError : parameters that are invalid or do not fit together (names the parameter); when it runs by local load,
        channels, of which no taxel is known to have neighbours

    Notes
    -----
    A frame of events is the board's; its quantity is that after its last event, and its time the stamp with which the
    quantity passed the threshold. Silent frames count: taxels hold their values. Each of a `Frames` is one frame.
    The local load also changes while nothing comes, with its rest: it is computed 10 ms after the last stamp too, and
    after the first 80 ms again after each further eighth of the time since it. Detections have no slope (NaN).

    Examples
    --------
    >>> from taxel import Frames, Tare
    >>> from taxel.detect import run
    >>> frames = Frames([[[v, v], [0.0, 0.0]] for v in (0.0, 0.0, 9.0, 9.0, 9.0, 0.0, 0.0)], range(0, 70_000, 10_000))
    >>> rule = PlainRule("area", 2, frames=2)
    >>> found = run(rule, frames, tare=Tare.take(frames, stop_us=20_000))
    >>> found
    Detections(2: contact 1, lift 1; 20000 to 50000 us)
    >>> found.known
    array([40000, 70000])

    A count that rises to 2 after it was at most 0, dated at 1:

    >>> PlainRule("count", 2, 0.25, levels=[5.0, 10.0], dated_at=1.0, labels=("contact", None))
    PlainRule(contact: count rises to 2 after at most 0, dated at 1; levels 5, 10)
    """

    _WHAT = "plain rule"

    def __init__(
        self,
        quantity: str,
        threshold: float,
        release: float = 1.0,
        frames: int = 1,
        age_ms: float | str | None = None,
        *,
        levels: Sequence[float] = (),
        dated_at: float | None = None,
        of_largest: bool = False,
        labels: Sequence[str | None] | None = None,
        noise_floor: float = 3.0,
        unit: str | None = None,
        tare: Tare | None = None,
    ) -> None:
        is_end = isinstance(age_ms, str) and age_ms == "end"
        age = age_ms if age_ms is None or is_end else number("age_ms", age_ms)
        self._hold(
            _core.make_plain_rule(
                parameters(
                    {
                        "quantity": text("quantity", quantity),
                        "threshold": number("threshold", threshold),
                        "release": number("release", release),
                        "frames": integer("frames", frames, 1, 2**31 - 1),
                        "levels": floats("levels", levels),
                        "dated_at": None if dated_at is None else number("dated_at", dated_at),
                        "of_largest": flag("of_largest", of_largest),
                        "age_ms": age,
                        "labels": _labels(labels, age),
                        "noise_floor": number("noise_floor", noise_floor),
                        "unit": None if unit is None else text("unit", unit),
                    }
                    | ({} if tare is None else {"tare": json.loads(instance("tare", tare, Tare).to_json())})
                )
            )
        )

    @staticmethod
    def _check(text: str) -> str:
        return _core.check_plain_rule(text)

    @classmethod
    def _from_parts(cls, parts: Mapping[str, Any]) -> PlainRule:
        """Return the rule of checked parts."""
        rule = cls.__new__(cls)
        rule._hold(_core.make_plain_rule(parameters(parts)))
        return rule

    @property
    def quantity(self) -> str:
        """The quantity that is compared with the threshold."""
        return str(self._parts["quantity"])

    @property
    def threshold(self) -> float:
        """The threshold: number of taxels, the sensor's unit, units of noise, or ms."""
        return float(self._parts["threshold"])

    @property
    def release(self) -> float:
        """The part of the threshold below which the load ends."""
        return float(self._parts["release"])

    @property
    def frames(self) -> int:
        """How many frames in a row decide."""
        return int(self._parts["frames"])

    @property
    def levels(self) -> tuple[float, ...]:
        """The levels of a count; none of other quantities."""
        return tuple(self._parts.get("levels", ()))

    @property
    def dated_at(self) -> float | None:
        """The value at which `t` is dated, or None where that is the threshold, and release times the threshold."""
        at = self._parts.get("dated_at")
        return None if at is None else float(at)

    @property
    def of_largest(self) -> bool:
        """Whether `release` is a part of the largest value since the load began."""
        return bool(self._parts.get("of_largest", False))

    @property
    def age_ms(self) -> float | str | None:
        """The age of a touch at which it decides, ms, or "end"; None where it reports onset and end."""
        age: float | str | None = self._parts["age_ms"]
        return age

    @property
    def labels(self) -> tuple[str, ...]:
        """The labels that it detects."""
        return tuple(label for label in self._parts["labels"] if label is not None)

    @property
    def noise_floor(self) -> float:
        """The board's noise floor, in the sensor's unit."""
        return float(self._parts["noise_floor"])

    @property
    def tare(self) -> Tare | None:
        """The taxels' rest, if the rule holds one."""
        tare = self._parts.get("tare")
        return None if tare is None else Tare.from_json(json.dumps(tare))

    @property
    def _needs_tare(self) -> bool:
        return self.tare is None and self.quantity != "range_count"

    @property
    def array(self) -> Array | None:
        """The sensor of the tare that it holds, or None where any will do."""
        tare = self.tare
        return None if tare is None else tare.array

    def _accepts(self, array: Array) -> bool:
        """Whether it can detect in the frames of a sensor."""
        return self.array is None or self.array.fits(array)

    def __repr__(self) -> str:
        return escaped(f"PlainRule({', '.join(self.labels)}: {self._compared()})")

    @property
    def _framed(self) -> str:
        return "1 frame" if self.frames == 1 else f"{self.frames} frames"

    def _counted(self, *, rises: bool) -> str:
        """Return what a rule of a quantity with levels compares, at onsets or at ends."""
        n, most = ceil(self.threshold), ceil(self.release * self.threshold) - 1
        how = f"rises to {n} after at most {most}" if rises else f"falls to {most} after at least {n}"
        dated = self.dated_at
        at = "" if dated is None else f", dated at {ceil(dated) - (not rises)}"
        frames = "" if self.frames == 1 else f", {self._framed}"
        units = {"range_count": " of the range", "begin_area": " ms"}
        unit = units.get(self.quantity, f" {escaped(self.unit)}" * (self.unit is not None))
        levels = ", ".join(f"{level:g}" for level in self.levels)
        name = "begin area" if self.quantity == "begin_area" else "count"
        return f"{name} {how}{at}{frames}; levels {levels}{unit}"

    @property
    def _named_quantity(self) -> str:
        """The quantity, with the unit of its threshold where that is not a number of taxels."""
        noise = "units of noise"
        units = {"total": self.unit, "peak": noise, "duration": "ms"}
        units |= dict.fromkeys(("local_load", "local_rise", "local_fall"), noise)
        unit = units.get(self.quantity)
        return self.quantity if unit is None else f"{self.quantity} ({escaped(unit)})"

    def _compared(self) -> str:
        """Return what the rule compares, without its labels; of two kinds, which of them is below."""
        if self.age_ms is not None:
            below, above = (label or "nothing" for label in self._parts["labels"])
            kinds = f"below {plain(self.threshold, 3)} {below}, otherwise {above}"
            when = "of the touch, when it ends" if self.age_ms == "end" else f"{self.age_ms:g} ms after the onset"
            return f"one rule for both kinds, the {self._named_quantity} {when}: {kinds}"
        is_end = self._parts["labels"][0] is None
        if self.levels:
            return self._counted(rises=not is_end)
        if is_end:
            after = f"{plain(self.threshold, 3)} or more"
            below = f"below {plain(self.release * self.threshold, 3)} after {after}"
            if self.of_largest:
                below = f"below {self.release:g} of its largest after {after} above a rest that follows"
            return f"{self._named_quantity} falls {below}, {self._framed}"
        largest = " of the largest" * self.of_largest
        return (
            f"{self._named_quantity} >= {plain(self.threshold, 6)}, release {self.release:g}{largest}, {self._framed}"
        )


def _labels(labels: object, age: float | str | None) -> list[str | None]:
    """Return the two labels, of which either may be None."""
    if labels is None:
        if age is not None:
            raise refused(
                "labels",
                " are missing: with age_ms, give two kinds, the first below the threshold and the second above it",
            )
        return list(_USUAL)
    pair = several("labels", labels) if not isinstance(labels, str) else []
    if len(pair) != 2:
        raise refused("labels", f" is {shown(labels)}: must be two names, and one of them may be None")
    return [None if label is None else text("labels", label) for label in pair]
