"""A detector without training: a load at a level."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

from taxel import _core
from taxel._base.arguments import floats, instance, number, parameters, several, shown, text
from taxel._base.errors import refused
from taxel._base.messages import escaped, plain
from taxel.array import Array
from taxel.detect.detector import _Detector
from taxel.tare import Tare

#: The labels of onset and end where none are given.
_USUAL = ("contact", "lift")


class PlainRule(_Detector):
    """Detect when the load on a sensor comes to a level, and when it is gone: what any training is held against.

    The sensor is loaded from the first frame in which the quantity is `level` or more, until it has been below
    `release` x `level` for `quiet_ms`; the first values show whether it is loaded at first. A detection's `t` is when
    the quantity came to the level, or below `release` x `level`, less `constant_ms`; it is `known` at the end of the
    frame in which the load begins, or that holds at the end of the quiet time.

    With `age_ms` it decides once a touch between two kinds, by the quantity at that age. A touch begins with the first
    frame in which 2 taxels or more are loaded, or one channel, and ends with the first in which none is; `t` is its
    begin, and `known` the end of the frame that holds at the age. A touch that is over by then is decided by what the
    quantity is then. With the age "end" it decides when the touch ends, by the quantity "duration"; `known` is the end
    of the frame in which it ends. A touch that has not ended is not decided.

    Parameters
    ----------
    quantity : {"load", "load_without_largest", "range_load", "count", "area", "begin_area", "moved", "rise", "fall", \
"shear_rise", "shear_fall", "local_load", "local_rise", "local_fall", "duration"}
        The sum of what taxels read above rest, in the sensor's unit, each loaded alone above the noise floor and six
        times its noise; that without the largest of them, which may be a bad taxel; the sum of what channels read in
        parts of their running ranges (`taxel.encode.RunningRange`), which needs no rest; how many taxels are above a
        level, added up over `levels` above rest in the sensor's unit; the number of loaded taxels, as
        `taxel.encode.ContactArea` counts them; how many of these have been loaded since a touch began, or since less
        than a level after it, added up over `levels` in ms: none once it has left the place where it began, as that of
        a foot whose heel lifts; the smaller of what all taxels gain and what they lose against their running means of
        100 ms, as an object that slides; how much the sum of all is above or below its running mean of 100 ms; by how
        much the shear, the sum as a vector of channels whose names end in _x and _y, smoothed over 20 ms, differs from
        its running mean of 100 ms, while it is longer ("shear_rise") or shorter ("shear_fall") than that; the largest
        sum over 3 x 3 taxels above a rest that follows the sensor, in units of its noise, as of
        `taxel.encode.LocalLoad`, or above ("local_rise") or below ("local_fall") their running means of 50 ms; or how
        long a touch lasts, with the age "end". In single precision. Of channels that are axes of taxels, as their names
        say, all but the shear are those of z.
    level : float, above 0
        The sensor's unit, parts of ranges, number of taxels, units of noise, or ms.
    release : float, above 0, at most 1
        The part of the level below which the load ends. 1 with `age_ms`.
    quiet_ms : float, ms, from 0 to 60 000
        For how long it is below that until the load has ended. 0 with `age_ms`.
    age_ms : float, ms, from 0 to 60 000, or "end", optional
        The age of a touch at which it decides.
    date : float, from release to 1, optional
        `t` is when the quantity last rose to this part of the level before an onset, or fell below it before an end.
        `known` stays.
    constant_ms : float, ms
        By how much labels are earlier than that at the median.
    touched_ms : float, ms, from 0 to 60 000, optional
        How long the sensor must have been touched (an area of 1 or more): before, and while nothing is, the quantity is
        0, so that only what happens within a touch counts, and not its begin. Not with `age_ms`.
    levels : sequence of float, above 0, ascending
        The levels of a count and of the begin area, and of no other quantity. A taxel is above a level of a count until
        it is below seven tenths of it.
    labels : (str or None, str or None), optional
        Names of onset and end, default "contact" and "lift"; with `age_ms` of the kinds below the level and not
        below it. None: those are not reported.
    noise_floor : float, 0 or more, in the sensor's unit (ticks)
        The board's: a taxel is loaded above its rest by more than this and half a tick, or half of a floor below 1.
    unit : str, optional
        The unit of the values that it was tuned on ("ticks" of a board's events); it then accepts no other.
    tare : Tare, optional
        The taxels' rest. It belongs to a board and a day and may be given later.

    Raises
    ------
    ProblemError : parameters that are invalid or do not fit together (names the parameter); when it runs by a local
        load, channels, of which no taxel is known to have neighbours

    Notes
    -----
    A frame of events is the board's; its quantity is that after its last event, and its time the stamp with which the
    quantity passed the level. Silent frames count: taxels hold their values, and are at rest before the first. Each of
    a `Frames` is one frame. What is measured from running means, or while touched, also changes while nothing comes: it
    is computed 10 ms after the last stamp too, and after the first 80 ms again after each further eighth of the time
    since it. Detections have no slope (NaN).

    Examples
    --------
    >>> from taxel import Frames, Tare
    >>> from taxel.detect import run
    >>> frames = Frames([[[v, v], [0.0, 0.0]] for v in (0.0, 0.0, 9.0, 9.0, 0.0, 0.0, 0.0)], range(0, 70_000, 10_000))
    >>> rule = PlainRule("load", 10.0, quiet_ms=5.0)
    >>> found = run(rule, frames, tare=Tare.take(frames, stop_us=20_000))
    >>> found
    Detections(2: contact 1, lift 1; 20000 to 40000 us)
    >>> found.known
    array([30000, 50000])

    A count that rises to 2 after it was at most 0, dated at 1:

    >>> PlainRule("count", 2, 0.25, date=0.5, levels=[5.0, 10.0], labels=("contact", None))
    PlainRule(contact: count >= 2, release 0.25, dated at 0.5; levels 5, 10)
    """

    _WHAT = "plain rule"

    def __init__(
        self,
        quantity: str,
        level: float,
        release: float = 1.0,
        quiet_ms: float = 0.0,
        age_ms: float | str | None = None,
        *,
        date: float | None = None,
        constant_ms: float = 0.0,
        touched_ms: float | None = None,
        levels: Sequence[float] = (),
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
                        "level": number("level", level),
                        "release": number("release", release),
                        "quiet_ms": number("quiet_ms", quiet_ms),
                        "date": None if date is None else number("date", date),
                        "constant_ms": number("constant_ms", constant_ms),
                        "touched_ms": None if touched_ms is None else number("touched_ms", touched_ms),
                        "levels": floats("levels", levels),
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
    def level(self) -> float:
        """The level: the sensor's unit, parts of ranges, number of taxels, units of noise, or ms."""
        return float(self._parts["level"])

    @property
    def release(self) -> float:
        """The part of the level below which the load ends."""
        return float(self._parts["release"])

    @property
    def quiet_ms(self) -> float:
        """For how long it is below that until the load has ended, ms."""
        return float(self._parts["quiet_ms"])

    @property
    def date(self) -> float | None:
        """The part of the level at which `t` is dated, or None where that is the level, and the release."""
        date = self._parts.get("date")
        return None if date is None else float(date)

    @property
    def constant_ms(self) -> float:
        """What is taken off `t`, ms."""
        return float(self._parts["constant_ms"])

    @property
    def touched_ms(self) -> float | None:
        """How long the sensor must have been touched, ms; None where the quantity counts always."""
        touched = self._parts.get("touched_ms")
        return None if touched is None else float(touched)

    @property
    def levels(self) -> tuple[float, ...]:
        """The levels of a count; none of other quantities."""
        return tuple(self._parts.get("levels", ()))

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
        return self.tare is None and (self.quantity != "range_load" or self.touched_ms is not None)

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
    def _named_quantity(self) -> str:
        """The quantity, with the unit of its level where that is not a number of taxels."""
        sums = ("load", "load_without_largest", "moved", "rise", "fall", "shear_rise", "shear_fall")
        units = dict.fromkeys(sums, self.unit)
        units |= dict.fromkeys(("local_load", "local_rise", "local_fall"), "units of noise")
        units |= {"range_load": "parts of ranges", "duration": "ms"}
        unit, name = units.get(self.quantity), self.quantity.replace("_", " ")
        return name if unit is None else f"{name} ({escaped(unit)})"

    def _compared(self) -> str:
        """Return what the rule compares, without its labels; of two kinds, which of them is below."""
        level = plain(self.level, 3)
        if self.age_ms is not None:
            below, above = (label or "nothing" for label in self._parts["labels"])
            when = "of the touch, when it ends" if self.age_ms == "end" else f"{self.age_ms:g} ms after the onset"
            kinds = f"below {level} {below}, otherwise {above}"
            return f"one rule for both kinds, the {self._named_quantity} {when}: {kinds}"
        how = f"{self._named_quantity} >= {level}, release {self.release:g}"
        if self._parts["labels"][0] is None:
            how = f"{self._named_quantity} falls below {plain(self.release * self.level, 3)} after {level} or more"
        if self.touched_ms is not None:
            how += f", {self.touched_ms:g} ms after a touch began"
        if self.quiet_ms:
            how += f", for {self.quiet_ms:g} ms"
        if self.date is not None:
            how += f", dated at {self.date:.2g}"
        if self.constant_ms:
            how += f", less {self.constant_ms:.3g} ms"
        return how + (f"; levels {', '.join(f'{level:g}' for level in self.levels)}" if self.levels else "")


def _labels(labels: object, age: float | str | None) -> list[str | None]:
    """Return the two labels, of which either may be None."""
    if labels is None:
        if age is not None:
            raise refused(
                "labels",
                " are missing: with age_ms, give two kinds, the first below the level and the second above it",
            )
        return list(_USUAL)
    pair = several("labels", labels) if not isinstance(labels, str) else []
    if len(pair) != 2:
        raise refused("labels", f" is {shown(labels)}: must be two names, and one of them may be None")
    return [None if label is None else text("labels", label) for label in pair]
