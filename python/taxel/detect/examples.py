"""The labelled example, on which a readout is trained and scored, and the outcome of one.

A neighbour that differs: `taxel.information.LabelledTrial` is a stretch of time with one label as a whole, which a
classifier tells from others.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import column, instance, shown, text
from taxel._base.errors import refused
from taxel._base.times import beginning_us
from taxel._core import ProblemError
from taxel.array import Array
from taxel.detect.scoring import Score, spans_of
from taxel.detections import Detections
from taxel.events import Events
from taxel.frames import Frames
from taxel.recorded import Recorded, recorded
from taxel.recorded import unit_of as recorded_unit
from taxel.recording.frames import value_us
from taxel.spikes import SpikeTrains, to_ms, to_us
from taxel.tare import Tare

#: So many labels that are all in the first such share of a recording may be in another unit of time.
_SEVERAL, _FIRST = 4, 0.01


class Example(NamedTuple):
    """A labelled recording, or a labelled part of one.

    Attributes
    ----------
    source : Events, Frames, Recording or SpikeTrains
        The signal. Spike trains are those that the recipe's encoder makes of it, with any tare already applied.
    labels : mapping of str to int, shape (events,), us
        The times of the labelled events, by label, by the clock of the source (spike trains count it in ms).
    tare : Tare, optional
        The rest of the taxels, where the encoder needs it.
    group : str
        Examples of one group, as the two feet of a walk, share a fold; "": the example is alone.
    name : str
        What errors call it; "": a recording's title, else its number ("example 3").
    labels_of : str
        The quantity whose thresholds the labels are, as "total" where a data set derived them from it: a rule of that
        quantity is the labels' own, and stands apart. "" where there is none.
    held_with : str
        Examples of one value, as the person, object or sensor that they are of, share a fold, where `group` is part of
        one; "": their groups alone.
    spans : mapping of str to int, shape (events, 2), us
        Begin and end of the labels that have an end: what is detected again before the end is not false.

    Raises
    ------
    ProblemError : values that are invalid, when `fit`, `judge` or `choose` gets it

    Examples
    --------
    >>> spikes = SpikeTrains.from_lists([[10.0], [12.0]], stop=50.0)
    >>> Example(spikes, {"contact": [10_000]}).labels
    {'contact': [10000]}
    """

    source: Events | Frames | Recorded | SpikeTrains
    labels: Mapping[str, Any]
    tare: Tare | None = None
    group: str = ""
    name: str = ""
    labels_of: str = ""
    held_with: str = ""
    spans: Mapping[str, Any] = MappingProxyType({})

    def _since(self, t_us: float) -> Example:
        """Return the example without its labels before a time, us."""
        return self._replace(labels={label: times[times >= t_us] for label, times in self.labels.items()})


def name_of(k: int, example: Example) -> str:
    """Return what errors call the example k."""
    return example.name or f"example {k}"


class Outcome(NamedTuple):
    """The detections of a readout in an example, and their score if its labels are known.

    Attributes
    ----------
    name : str
        Of the recording, for reports.
    example : Example
        Without labels where the truth is not known.
    found : Detections
    score : Score, optional
        None of an example without labels.
    """

    name: str
    example: Example
    found: Detections
    score: Score | None = None

    @property
    def compared(self) -> Detections:
        """The detections of the labels of which it is known when they happened."""
        return self.found[np.array([label in self.example.labels for label in self.found.label], np.bool_)]

    @property
    def begin_us(self) -> int:
        """The time that text counts its times from, us: its first if they count from 1970, else 0."""
        source = recorded(self.example.source, hold=False)
        return beginning_us(np.array([int(to_us(source.start))]) if isinstance(source, SpikeTrains) else source.t)


def check_examples(examples: Sequence[Example]) -> list[Example]:
    """Return the examples with their sources read and their labels as columns of whole us; refuse anything else.

    Raises
    ------
    ProblemError : no example at all, or one that is invalid (names its place)
    """
    if not isinstance(examples, Sequence) or not len(examples):
        raise refused("examples", f" is {shown(examples)}: must be one Example or more")
    sound = []
    for k, example in enumerate(examples):
        is_example = isinstance(example, tuple) and len(example) in range(2, 9)
        source = recorded(example[0]) if is_example else None
        if not isinstance(source, Events | Frames | SpikeTrains):
            raise ProblemError(
                f"example {k} is {shown(example)}: must be an Example of a Recording, Events, Frames or SpikeTrains, "
                "and labels"
            )
        _, labels, *rest = example
        optional: list[Any] = [None, "", "", "", "", {}]
        optional[: len(rest)] = rest
        tare, group, name, labels_of, held_with, spans = optional
        name = text(f"example {k}: name", name) or str(getattr(example[0], "title", f"example {k}"))
        if not isinstance(labels, Mapping):
            raise ProblemError(f"{name}: labels is {shown(labels)}: must be times (us) by label")
        times = {text("label", label): column(f"labels[{label!r}]", t, np.int64) for label, t in labels.items()}
        tare = None if tare is None else instance(f"{name}: tare", tare, Tare)
        group, labels_of = text(f"{name}: group", group), text(f"{name}: labels_of", labels_of)
        held_with = text(f"{name}: held_with", held_with)
        ends = spans_of(f"{name}: spans", spans)
        sound.append(Example(source, times, tare, group, name, labels_of, held_with, ends))
    return _padded(sound)


def sizes_of(examples: Sequence[Example]) -> list[tuple[int, int]]:
    """Return the rows and columns of frames of grids of several sizes, ascending; none where they cannot be padded."""
    sources = [recorded(example.source) for example in examples]
    if not all(isinstance(source, Frames) and source.array._is_whole_grid for source in sources):
        return []
    shapes = sorted({source.array.shape for source in sources})  # type: ignore[union-attr]
    return shapes if len(shapes) > 1 else []


def _padded(examples: list[Example]) -> list[Example]:
    """Return examples of grids of several sizes padded at their far edges to the largest; all others as they are."""
    shapes = sizes_of(examples)
    if not shapes:
        return examples
    rows, columns = (max(sizes) for sizes in zip(*shapes, strict=True))
    padded = []
    for example in examples:
        assert isinstance(example.source, Frames)
        source, tare = padded_to(example.source, example.tare, (rows, columns))
        padded.append(example._replace(source=source, tare=tare))
    return padded


def padded_to(frames: Frames, tare: Tare | None, shape: tuple[int, int]) -> tuple[Frames, Tare | None]:
    """Return frames of a grid, and their tare, padded at the far edges to a larger grid.

    A taxel beyond an edge reads 0, and has no rest in a tare, so that it counts nowhere.
    """
    array = frames.array._padded(shape)
    beyond = [(0, most - size) for size, most in zip(frames.array.shape, shape, strict=True)]
    values = Frames(np.pad(frames.values, [(0, 0), *beyond]), frames.t, unit=frames.unit, array=array)
    if tare is None:
        return values, None
    rest, noise = (np.pad(each, beyond, constant_values=np.nan) for each in (tare.rest, tare.noise))
    return values, tare._with(array, rest=rest, noise=noise)


def array_of(examples: Sequence[Example]) -> Array | None:
    """Return the array that all (checked) examples are of; None of spike trains, which do not state theirs.

    Raises
    ------
    ProblemError : examples of different arrays (names their places)
    """
    arrays = [None if isinstance(example.source, SpikeTrains) else example.source.array for example in examples]  # type: ignore[union-attr]
    first = arrays[0]
    sources: dict[str, Array] = {}
    for k, array in enumerate(arrays):
        if (array is None) != (first is None) or (array is not None and first is not None and not first.fits(array)):
            difference = f"{name_of(k, examples[k])} is of {array!r}, {name_of(0, examples[0])} of {first!r}"
            raise ProblemError(f"{difference}: must have the same taxels")
    # The sources of a recording, as two feet, are different sensors; each is compared with the same one of others, and
    # one line stands for all.
    for example, array in zip(examples, arrays, strict=True):
        source = example.name.removeprefix(example.group) if example.group else ""
        if array is not None and sources.setdefault(source, array)._warn_apart(array, "examples", stacklevel=3):
            break
    return first


def unit_of(examples: Sequence[Example]) -> str | None:
    """Return the unit that the values of all (checked) examples are in; None of spike trains, which do not state it.

    Raises
    ------
    ProblemError : examples in different units (names two of them)
    """
    units = [None if isinstance(example.source, SpikeTrains) else recorded_unit(example.source) for example in examples]  # type: ignore[arg-type]
    for k, unit in enumerate(units):
        if unit != units[0]:
            difference = f"{name_of(k, examples[k])} is in {unit}, {name_of(0, examples[0])} in {units[0]}"
            raise ProblemError(f"{difference}: must be in one unit, because a readout learns values of one unit only")
    return units[0]


def frame_ms(source: object) -> float:
    """Return the median distance of frames with new values, ms; 0 of what are no frames, or fewer than two."""
    return to_ms(value_us(source)) if isinstance(source, Frames) else 0.0


def unreliable(label: str, scored: Score, labels: str, on: str = "this readout") -> str:
    """Return that a score of a label is too bad to rely on; "" where it is not.

    Parameters
    ----------
    label : str
    scored : Score
    labels : str
        What its events are called.
    on : str
        What is not to be relied on.
    """
    if (
        not scored.events
        or not scored.rank[0]
        or (scored.rank[0] < scored.events and 2 * scored.missed <= scored.events)
    ):
        return ""
    worth = ", no better than to detect nothing" if scored.rank[0] >= scored.events else ""
    return (
        f"{label}: do not rely on {on}: {scored.found} of {scored.events} {labels} found, {scored.false} false{worth}"
    )


def early(labels: Mapping[str, NDArray[np.int64]], first_us: int, last_us: int) -> str:
    """Return that all labels of a recording are in its first hundredth, as times in another unit are; else "".

    Examples
    --------
    >>> early({"contact": np.array([1200, 2400, 3100, 4000])}, 0, 5_000_000)
    'are in the first 0.004 s of 5 s: are their times in us?'
    """
    times = np.concatenate([*labels.values(), np.empty(0, np.int64)])
    lasts = last_us - first_us
    latest = int(times.max(initial=first_us)) - first_us
    if len(times) < _SEVERAL or not 0 < latest < _FIRST * lasts:
        return ""
    return f"are in the first {latest / 1e6:.3g} s of {lasts / 1e6:.3g} s: are their times in us?"
