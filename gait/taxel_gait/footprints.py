"""Measures the footprints of a person: one mask, found on the person's mean footprint, is laid on each footfall."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
from cyclopts import Parameter

import taxel
from taxel import ProblemError, Recording, Region
from taxel.cli.app import Limits
from taxel.options import Reading
from taxel.recording.opening import sensors
from taxel_gait.boxes import write_box
from taxel_gait.cohort import Entry
from taxel_gait.feet import SIDES, Foot, feet_of
from taxel_gait.loads import balances, curves_of, loads_of, of_print, of_region
from taxel_gait.masks import MASKS, Picture, find_mask, laid_on, mean_picture
from taxel_gait.prints import BOX, Placed, Print, place
from taxel_gait.running import why
from taxel_gait.stances import Definition, find_stances
from taxel_gait.walk import steps_of

__all__ = ["FootprintOptions", "Footprints", "Person", "mask_file", "measure_person", "people_of"]

#: Which sensors of insoles belong together, by the kind of file.
INSOLES = Path(__file__).parent / "insoles"
#: Regions whose names begin so are toes.
_TOES = ("hallux", "toe")
_NO_GRID = "empty: areas, what is divided by them, path, cpei_pct, arch_index: insoles of few sensors have no grid"
#: A path over stance has so many points.
_POINTS = 101


@dataclass(frozen=True)
class FootprintOptions:
    """Hold how footprints are measured.

    Parameters
    ----------
    mask
        The regions: nine (heel, midfoot, metatarsals 1 to 5, hallux, toes), seven (metatarsals 2-3 and 4-5 pooled),
        pedar (nine of its own), footscan (ten), or thirds of the length.
    sensors
        For insoles of few sensors a file of regions that says which sensors belong together. Default: that of the
        maker, which comes with this command (gaitpdb, moticon, pedar).
    boxes
        Write each print to boxes/NAME.npz for taxel train, with boxes/labels.csv: turned, and its box resized to 15 x 7
        cells, so that one readout holds many people.
    own_mask
        Find the regions of each print on itself instead of on the person's mean footprint.
    definition
        Contact and lift of recordings of several steps, as of taxel steps.
    side
        The foot: left or right. Default: by the print, seen from above.
    above
        A cell with a greater value is loaded, in the recording's unit. Default: 1 % of the print's largest value.
    saturation
        The value at which the range of a cell ends, in the recording's unit. Default: that which the file states.

    Raises
    ------
    ProblemError : no such mask or side; no definition
    """

    mask: str = "nine"
    sensors: Annotated[Path | None, Parameter(metavar="FILE")] = None
    boxes: bool = False
    own_mask: bool = False
    definition: Annotated[str | None, Parameter(metavar="KIND:A,B")] = None
    side: Annotated[str, Parameter(metavar="left|right")] = ""
    above: Annotated[float | None, Parameter(validator=Limits(0.0))] = None
    saturation: Annotated[float | None, Parameter(validator=Limits(0.0))] = None

    def __post_init__(self) -> None:
        if self.mask not in MASKS:
            raise ProblemError(f"--mask {self.mask}: must be one of {', '.join(MASKS)}")
        if self.side not in ("", "left", "right"):
            raise ProblemError(f"--side {self.side}: must be left or right")
        if self.definition is not None:
            Definition.of(self.definition)

    def definition_of(self, foot: Foot) -> Definition:
        """Return the definition by which the steps of an insole are found."""
        given = self.definition
        return Definition.usual(is_channel=foot.is_channel) if given is None else Definition.of(given)


@dataclass(frozen=True)
class Person:
    """Name a person, with all recordings that are theirs.

    Parameters
    ----------
    name : str
    entries : tuple of Entry
    """

    name: str
    entries: tuple[Entry, ...]


@dataclass(frozen=True)
class Footprints:
    """Hold what was measured of a person, as plain values.

    Parameters
    ----------
    rows, regions : list of dict
        One for each print, and for each region of each print, by column; None where there is no value.
    curves : list of dict
        The load over stance of the whole and of each region, of each row of `rows`.
    feet : dict from side to dict
        What the report shows: the mean footprint, the largest values, the regions, the mean path.
    failed : dict from str to str
        Why a recording was not measured.
    warnings : list of str
    about : list of str
        What the tables say of the regions.
    labels : list of str
        The rows of the table of labels of boxes.
    """

    rows: list[dict[str, Any]] = field(default_factory=list)
    regions: list[dict[str, Any]] = field(default_factory=list)
    curves: list[dict[str, list[float]]] = field(default_factory=list)
    feet: dict[str, Any] = field(default_factory=dict)
    failed: dict[str, str] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)
    about: list[str] = field(default_factory=list)
    labels: list[str] = field(default_factory=list)


def people_of(entries: Sequence[Entry]) -> list[Person]:
    """Return the people of a cohort, each with their recordings."""
    by_name: dict[str, list[Entry]] = {}
    for entry in entries:
        by_name.setdefault(entry.person, []).append(entry)
    return [Person(name, tuple(own)) for name, own in by_name.items()]


def mask_file(folder: Path, person: str, side: str, mask: str) -> Path:
    """Return where the regions of a person's foot are, in the foot's own mm."""
    return folder / f"{person}-{side}.{mask}.regions.json"


class _Footfall(NamedTuple):
    """A print, and what its row begins with."""

    keys: dict[str, Any]
    one: Print
    #: None of an insole of few sensors, whose regions follow.
    placed: Placed | None
    used: str
    weight_kg: float | None
    saturation: float | None
    regions: tuple[Region, ...] = ()


def measure_person(person: Person, options: FootprintOptions, reading: Reading, folder: Path) -> Footprints:
    """Measure all footprints of a person.

    Parameters
    ----------
    person : Person
    options : FootprintOptions
    reading : Reading
    folder : Path
        Where masks of an earlier run are, which people may have edited (`mask_file`).
    """
    found, footfalls = Footprints(), list[_Footfall]()
    for entry in person.entries:
        try:
            footfalls += _footfalls(entry, options, reading, found.about)
        except (taxel.Error, OSError) as error:
            found.failed[entry.name] = why(error)
    whole = [one for one in footfalls if one.used == "yes" and one.placed is not None]
    sides = sorted({one.keys["foot"] for one in whole})
    for side in sides:
        own = [one for one in whole if one.keys["foot"] == side]
        found.feet[side] = _foot(person, side, own, options, folder)
    for one in footfalls:
        _measure(found, one, options)
        if options.boxes and one.used == "yes" and one.placed is not None:
            name = f"{one.keys['recording']}-{one.keys['step']}"
            found.labels.extend(write_box(folder / "boxes", name, one.one, one.placed))
    if len(sides) == 1 and not options.side and len(whole) > 1 and not any(e.side for e in person.entries):
        found.warnings.append(
            f"{person.name}: all prints are {sides[0]} feet, seen from above; say --side if that is wrong"
        )
    return found


def _footfalls(entry: Entry, options: FootprintOptions, reading: Reading, about: list[str]) -> Iterator[_Footfall]:
    """Yield the footfalls of a recording; `about` gets what is to be said of regions that a file states."""
    sides = SIDES if len(entry.paths) > 1 else (entry.side,)
    for path, own in zip(entry.paths, sides, strict=True):
        trials, side = reading.open_trials(path), options.side or own
        for trial in trials:
            name = trial.name if len(trials) > 1 else entry.name
            keys = {"recording": name, "person": entry.person, "condition": entry.condition}
            if all(sensor.array.pitch_mm is None and sensor.array.name != BOX for sensor in sensors(trial)):
                for footfall in _of_insoles(trial, side, options, about):
                    yield footfall._replace(keys=keys | footfall.keys, weight_kg=entry.weight_kg)
                continue
            for sensor in sensors(trial):
                for number, used, one in _prints(sensor, options):
                    placed = place(one, side or sensor.side)
                    doubts = "; ".join(placed.doubts)
                    foot = {"step": number, "foot": placed.side}
                    end = sensor.range_end if sensor.calibration is None else None
                    yield _Footfall(keys | foot, one, placed, doubts or used, entry.weight_kg, end)


def _of_insoles(trial: Recording, side: str, options: FootprintOptions, about: list[str]) -> Iterator[_Footfall]:
    """Yield the steps of insoles of few sensors, whose regions a file states.

    Raises
    ------
    ProblemError : no such file for the maker, and none given
    """
    file = INSOLES / f"{trial.kind}.regions.json" if options.sensors is None else options.sensors
    if options.sensors is None and not file.exists():
        known = ", ".join(sorted(one.name.partition(".")[0] for one in INSOLES.glob("*.json")))
        raise ProblemError(
            f"{trial.title}: no pitch is known, and no regions of its sensors (known: {known}): give a layout file "
            "with the pitch, or --sensors FILE"
        )
    regions = taxel.read_regions(file)
    stated = f"sensors of regions: {file.name}: {json.loads(file.read_text('utf-8')).get('about', '')}".rstrip(": ")
    about += [line for line in (stated, _NO_GRID) if line not in about]
    feet = feet_of([trial], side)
    stances = [
        find_stances(foot.t, foot.force, options.definition_of(foot), is_channel=foot.is_channel) for foot in feet
    ]
    for step in steps_of(feet, stances, [np.zeros(len(one.contact), bool) for one in stances]):
        foot = feet[step.foot]
        if step.used != "cut":
            one = Print(foot.frames[step.first : step.end], options.above or 0.0)
            keys = {"step": step.number, "foot": foot.side}
            yield _Footfall(keys, one, None, step.used, None, foot.range_end, regions)


def _prints(recording: Recording, options: FootprintOptions) -> Iterator[tuple[int, str, Print]]:
    """Yield the number of each footfall of a recording, whether it counts, and its print.

    A recording with a contact and a lift after it, as of an insole, holds the steps that `taxel steps` finds; any other
    holds one footfall.
    """
    foot = Foot.of(recording)
    stances = find_stances(foot.t, foot.force, options.definition_of(foot), is_channel=foot.is_channel)
    whole = np.count_nonzero(~stances.cut_at_contact & ~stances.cut_at_lift)
    if whole < 2:
        yield 1, "yes", Print.of(foot.frames, options.above)
        return
    for step in steps_of([foot], [stances], [np.zeros(len(stances.contact), bool)]):
        if step.used != "cut":
            yield step.number, step.used, Print.of(foot.frames[step.first : step.end], options.above)


def _foot(
    person: Person, side: str, own: Sequence[_Footfall], options: FootprintOptions, folder: Path
) -> dict[str, Any]:
    """Return a foot's mean footprint and its regions: those that a person left in a file, or those that are found."""
    pictures = [Picture.of(one.one, one.placed) for one in own if one.placed is not None]
    mean = mean_picture(pictures)
    file = mask_file(folder, person.name, side, options.mask)
    kept = file.exists()
    regions = list(taxel.read_regions(file)) if kept else find_mask(mean).regions(options.mask)
    paths = [_over_stance(one.one, one.placed) for one in own if one.placed is not None]
    return {
        "mean": mean.values.round(3).tolist(),
        "most": np.max([one.values for one in pictures], axis=0).round(3).tolist(),
        "regions": [one.to_json() for one in regions],
        "path": np.mean(paths, axis=0).round(2).tolist(),
        "prints": len(own),
        "kept": str(file) if kept else "",
    }


def _over_stance(one: Print, placed: Placed) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Return the path of the centre at 0 to 100 % of the time in which it is known, in the foot's own mm."""
    path = placed.in_foot(one.path)
    known = np.isfinite(path[:, 0])
    t = one.t[known]
    at = np.linspace(t[0], t[-1], _POINTS)
    return np.stack([np.interp(at, t, path[known, k]) for k in (0, 1)], axis=1)


def _measure(found: Footprints, footfall: _Footfall, options: FootprintOptions) -> None:
    """Add what is measured of a footfall; one that is doubtful has no regions."""
    keys, one, placed, used, weight_kg, stated, _ = footfall
    saturation = stated if options.saturation is None else options.saturation
    keys = keys | {"used": used, "contact_s": float(one.frames.t[0]) / 1e6}
    regions = _regions(found, footfall, options)
    loads = loads_of(one, regions)
    toes = [region for region in regions if region.name.startswith(_TOES)]
    cells = of_print(one, placed, loads, toes, saturation, weight_kg)
    if options.mask == "footscan" and regions:
        cells |= balances(loads, one.t)
    found.rows.append(keys | _plain(cells))
    found.curves.append(curves_of(one, loads))
    total = sum(float(np.trapezoid(own.force, one.t)) for name, own in loads.items() if name != "whole")
    for region in regions:
        own = loads.get(region.name)
        measured = {} if own is None else of_region(one, own, total, saturation)
        found.regions.append(keys | {"region": region.name} | _plain(measured))


def _regions(found: Footprints, footfall: _Footfall, options: FootprintOptions) -> list[Region]:
    """Return the regions on a print."""
    placed = footfall.placed
    if placed is None:
        return list(footfall.regions)
    if placed.doubts or placed.side not in found.feet:
        return []
    if options.own_mask:
        own = find_mask(Picture.of(footfall.one, placed)).regions(options.mask)
    else:
        own = [Region(one["name"], one["polygon"]) for one in found.feet[placed.side]["regions"]]
    return laid_on(own, placed)


def _plain(cells: Mapping[str, float]) -> dict[str, float | None]:
    return {name: None if np.isnan(value) else float(value) for name, value in cells.items()}
