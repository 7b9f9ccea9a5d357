"""Measures a walk: from its recordings to a row for each step, its curve over stance, and its labels."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from cyclopts import Parameter

import taxel
from taxel import ProblemError, Recording
from taxel.cli.app import Limits
from taxel.options import Reading
from taxel_gait import kept
from taxel_gait.cohort import Entry
from taxel_gait.feet import Foot, feet_of
from taxel_gait.measures import curve_of, measures_of
from taxel_gait.stances import Definition, Stances, find_stances
from taxel_gait.walk import Step, steps_of

__all__ = ["Measured", "StepOptions", "measure"]

#: Columns that insoles have no value for, and why.
_OF_FOOTPRINTS = "is measured on footprints of a plate"
#: Times of `Step.times` that need both feet.
_OF_BOTH = (
    *("step_s", "single_support_s", "double_support_s"),
    *("double_support_initial_s", "double_support_terminal_s"),
)


@dataclass(frozen=True)
class StepOptions:
    """Hold how steps are found and measured.

    Parameters
    ----------
    definition
        Where contact and lift are: percent:CONTACT,LIFT of the way from the swing's load to the largest, for example
        percent:5,2.5; newton:CONTACT,LIFT in N of the foot's load, for example newton:50,25; or moticon (percent:6,10).
        Default: percent:5,2.5, of one sensor a foot percent:4,3.
    readout
        Take contacts and lifts (or foot_off) from this trained readout instead.
    side
        The foot of a recording that does not state it: left or right.
    same_clock
        The times of both files count from the same moment.
    above
        A taxel with a greater value is loaded, in the recording's unit.
    saturation
        The value at which the range of a taxel ends, in the recording's unit. Default: that which the file states.

    Raises
    ------
    ProblemError : no definition; another side; a definition beside a readout
    """

    definition: Annotated[str | None, Parameter(metavar="KIND:A,B")] = None
    readout: Annotated[Path | None, Parameter(metavar="FILE")] = None
    side: Annotated[str, Parameter(metavar="left|right")] = ""
    same_clock: bool = False
    above: Annotated[float, Parameter(validator=Limits(0.0))] = 0.0
    saturation: Annotated[float | None, Parameter(validator=Limits(0.0))] = None

    def __post_init__(self) -> None:
        if self.definition is not None:
            Definition.of(self.definition)
            if self.readout is not None:
                raise ProblemError("--definition and --readout are both given: give only one of them")
        if self.side not in ("", "left", "right"):
            raise ProblemError(f"--side {self.side}: must be left or right")

    def definition_of(self, foot: Foot) -> Definition:
        """Return the definition by which the steps of a foot are found.

        Raises
        ------
        ProblemError : one in N of a foot whose load is not known in N
        """
        if self.definition is None:
            return Definition.usual(is_channel=foot.is_channel)
        definition = Definition.of(self.definition)
        if definition.kind == "newton" and foot.unit != "N":
            raise ProblemError(
                f"--definition {definition}: the load is in {foot.unit}, not in N, as the area of a taxel, or a "
                "calibration, is not known: must be percent:CONTACT,LIFT"
            )
        return definition


@dataclass(frozen=True)
class Measured:
    """Hold what was measured of a recording, as plain values.

    Parameters
    ----------
    rows : list of dict
        One for each step, by the columns of `steps.csv`; None where there is no value.
    curves : list of (sequence of float, or None)
        The load over the stance of each row, at 0 to 100 %; None of a step that is cut.
    labels : list of list of Note
        The rows of the table of labels of each file.
    reasons : dict from str to str
        Why a column has no value.
    definitions : list of str
        How contact and lift are defined, in words.
    warnings : list of str
    """

    rows: list[dict[str, Any]] = field(default_factory=list)
    curves: list[Sequence[float] | None] = field(default_factory=list)
    labels: list[list[taxel.Note]] = field(default_factory=list)
    reasons: dict[str, str] = field(default_factory=dict)
    definitions: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain values for JSON."""
        return asdict(self)

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> Measured:
        """Return what `to_dict` gave, after JSON."""
        labels = [
            [taxel.Note(**row | {"others": tuple(map(tuple, row["others"]))}) for row in of_file]
            for of_file in values["labels"]
        ]
        # Numbers of NumPy take a tenth of the memory.
        curves = [None if curve is None else np.array(curve, np.float32) for curve in values["curves"]]
        return cls(**values | {"labels": labels, "curves": curves})


def measure(entry: Entry, options: StepOptions, reading: Reading, tables: Sequence[Path]) -> Measured:
    """Find and measure the steps of a recording.

    Parameters
    ----------
    entry : Entry
        The recording, or those of both feet.
    options : StepOptions
    reading : Reading
    tables : sequence of Path
        Of each file the table of labels of an earlier run, where there is one: what people changed there stays changed.

    Raises
    ------
    FormatError : a recording that cannot be read; no table of labels
    ProblemError : what is no walk: more than two sensors, two feet without a common clock ...
    """
    before, found = [kept.read(table) for table in tables], Measured(labels=[[] for _ in tables])
    walks = [reading.open_trials(path) for path in entry.paths]
    if len(walks) > 1 and any(len(trials) > 1 for trials in walks):
        raise ProblemError(f"{entry.name}: a file of several trials is given alone")
    # Of one file each trial is a walk; of two files both together are one.
    together: list[list[Recording]] = [[one[0] for one in walks]] if len(walks) > 1 else [[one] for one in walks[0]]
    doubts: dict[str, list[str]] = {}
    for recordings in together:
        trial = recordings[0].name if len(together) > 1 else ""
        for doubt in _measure(found, recordings, entry, trial, options, before):
            doubts.setdefault(doubt, []).append(trial or entry.name)
    for doubt, names in doubts.items():
        found.warnings.append(names[0] + f" and {len(names) - 1} more" * (len(names) > 1) + f": {doubt}")
    return found


def _measure(
    found: Measured,
    recordings: Sequence[Recording],
    entry: Entry,
    trial: str,
    options: StepOptions,
    before: Sequence[Sequence[taxel.Note]],
) -> Iterator[str]:
    """Add what is measured of one walk; yield what is doubtful about it."""
    feet = feet_of(recordings, entry.side or options.side, same_clock=options.same_clock)
    rough, stances, by_hand = [], [], []
    # Of two files each has its own table.
    table_of = [k if len(recordings) > 1 else 0 for k in range(len(feet))]
    for k, (foot, words, own) in enumerate(_stances(feet, recordings, options)):
        changed, out = kept.Kept.of(before[table_of[k]], foot.source, trial).apply(foot, own)
        rough.append(own)
        stances.append(changed)
        by_hand.append(out)
        if words not in found.definitions:
            found.definitions.append(words)
    steps = steps_of(feet, stances, by_hand)
    for k in range(len(feet)):
        found.labels[table_of[k]] += kept.keep(feet, steps, rough, k, trial)
    keys = {"recording": trial or entry.name, "person": entry.person, "condition": entry.condition}
    for step in steps:
        row, curve = _row(feet[step.foot], step, options, entry.weight_kg)
        found.rows.append(keys | row)
        found.curves.append(curve)
    found.reasons.update(_reasons(feet, options))
    yield from _doubts(feet, steps)


def _stances(
    feet: Sequence[Foot], recordings: Sequence[Recording], options: StepOptions
) -> Iterator[tuple[Foot, str, Stances]]:
    """Yield each foot with its stances, and how they are defined."""
    if options.readout is None:
        for foot in feet:
            definition = options.definition_of(foot)
            yield foot, definition.words, find_stances(foot.t, foot.force, definition, is_channel=foot.is_channel)
        return
    readout = taxel.Readout.load(options.readout)
    by_source = {sensor.label: sensor for one in recordings for sensor in one.sources.values()}
    for k, foot in enumerate(feet):
        sensor = recordings[k] if len(recordings) > 1 else by_source[foot.source]
        yield foot, f"contact and lift by the readout {options.readout.name}", _detected(foot, sensor, readout)


def _detected(foot: Foot, recording: Recording, readout: taxel.Readout) -> Stances:
    """Return the stances that a readout detects: from each contact to the lift before the next one."""
    detections = taxel.detect.run(readout, recording)
    labels = np.array(detections.label)
    contacts = detections.t[labels == "contact"]
    lifts = detections.t[np.isin(labels, ("lift", "foot_off"))]
    if not len(lifts) and "contact" not in labels:
        raise ProblemError(f"the readout detects no contact, lift or foot_off in {recording.title}")
    t, rows = foot.frames.t, []
    for begin, end in zip(contacts, [*contacts[1:], np.iinfo(np.int64).max], strict=True):
        between = lifts[(lifts > begin) & (lifts < end)]
        first, last = (int(np.searchsorted(t, one)) for one in (begin, between[0] if len(between) else end))
        if first < last:
            rows.append((first, last, False, not len(between)))
    return Stances.of(rows)


def _row(
    foot: Foot, step: Step, options: StepOptions, weight_kg: float | None
) -> tuple[dict[str, Any], list[float] | None]:
    """Return the cells of a step, and its curve."""
    cells: dict[str, Any] = {"foot": foot.side, "step": step.number, "bout": step.bout, "used": step.used}
    values = {"contact_s": step.contact_s, "lift_s": step.lift_s, **step.times}
    curve = None
    if not np.isnan(step.lift_s - step.contact_s):
        above = options.above
        saturation = foot.range_end if options.saturation is None else options.saturation
        values |= measures_of(foot, step, above=above, saturation=saturation, weight_kg=weight_kg)
        curve = [round(float(point), 3) for point in curve_of(foot, step)]
    return cells | {name: None if np.isnan(value) else float(value) for name, value in values.items()}, curve


def _reasons(feet: Sequence[Foot], options: StepOptions) -> dict[str, str]:
    """Return why columns have no value."""
    reasons = {"cpei_pct": _OF_FOOTPRINTS, "arch_index": _OF_FOOTPRINTS}
    if len(feet) < 2:
        reasons |= dict.fromkeys(_OF_BOTH, "needs both feet")
    for foot in feet:
        if foot.frames.array.area_mm2 is None:
            reasons["contact_area_cm2"] = "the area of a taxel is not known"
        if foot.frames.array.centre_unit is None:
            reasons["cop_length, cop_speed"] = "the places of the taxels are not known"
    if options.saturation is None and any(foot.range_end is None for foot in feet):
        reasons["saturated_cells"] = "the end of a taxel's range is not known: say --saturation VALUE"
    return reasons


def _doubts(feet: Sequence[Foot], steps: Sequence[Step]) -> Iterator[str]:
    """Yield what makes the steps of a walk doubtful."""
    support = np.array([step.times["double_support_s"] for step in steps if step.used == "yes"])
    flights = int(np.count_nonzero(support == 0))
    if 2 * flights > len(support):
        yield f"{flights} of {len(support)} steps have no double support: running was not tried"
    for k, foot in enumerate(feet):
        own = [step for step in steps if step.foot == k]
        name = foot.side or "foot"
        if not own:
            yield f"{name}: no step was found"
        elif all(step.used == "cut" for step in own):
            yield f"{name}: begins or ends loaded, so no step is whole (taxel footprint measures plates)"
