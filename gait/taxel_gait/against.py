"""The rule of steps against contacts and foot-offs that others found: ``python -m taxel_gait.against FOLDER...``.

The first table has the rule at its fixed settings. The second has levels that are chosen, in folds by person, on the
other folds, from a grid that is printed; with ``--readout``, a readout that is trained in the same folds too.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import taxel
from taxel import Recording
from taxel.cli.app import App, say
from taxel.metrics import matching
from taxel.recording.opening import sensors
from taxel_gait.cohort import Cohort
from taxel_gait.feet import Foot
from taxel_gait.stances import DEFINITIONS, Definition, find_stances

app = App(name="python -m taxel_gait.against")

#: The names of the events, and of the labels that are the truth.
EVENTS = {"contact": ("contact",), "foot-off": ("foot_off", "lift")}
#: Events count as found within this distance, ms; a level is chosen by how many are within the second one.
_WINDOW_MS, _CLOSE_MS = 50.0, 10.0
#: Scored is from this time before the first label of a foot to this time after its last one, s.
_MARGIN_S = 0.1
#: The levels, %, from which are chosen: of contact and of foot-off.
GRID = {"contact": (2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0), "foot-off": (1.0, 2.0, 2.5, 3.0, 4.0, 6.0, 8.0, 10.0)}
_FOLDS = 4


@dataclass(frozen=True, eq=False)
class Labelled:
    """Hold a foot with the times that others found.

    Parameters
    ----------
    person : str
    foot : Foot
    recording : Recording
        Of this foot alone.
    truth : dict from event to float64, s
        Ascending.
    source : str
        Who found them.
    """

    person: str
    foot: Foot
    recording: Recording
    truth: Mapping[str, NDArray[np.float64]]
    source: str

    @property
    def scored(self) -> tuple[float, float]:
        """The interval that is scored, s."""
        times = np.concatenate([*self.truth.values()])
        return float(times.min()) - _MARGIN_S, float(times.max()) + _MARGIN_S


class Tally(NamedTuple):
    """Count how detections fit events."""

    events: int = 0
    false: int = 0
    minutes: float = 0.0
    errors_ms: NDArray[np.float64] = np.empty(0)

    @classmethod
    def of(cls, found: NDArray[np.float64], labelled: Labelled, event: str) -> Tally:
        """Return the tally of the times (s) that were found of an event of a foot."""
        begin, end = labelled.scored
        found = found[(found >= begin) & (found <= end)]
        matched = matching([1e3 * found], [1e3 * labelled.truth[event]], window_ms=_WINDOW_MS)
        return cls(len(labelled.truth[event]), matched.false, (end - begin) / 60, matched.errors_ms)

    @classmethod
    def summed(cls, tallies: Iterable[Tally]) -> Tally:
        """Return the tally of several."""
        some = list(tallies)
        errors = np.concatenate([np.empty(0), *(one.errors_ms for one in some)])
        return cls(sum(o.events for o in some), sum(o.false for o in some), sum(o.minutes for o in some), errors)

    @property
    def close(self) -> int:
        """How many events have a detection near."""
        # Times are whole us; the sample before is not farther than a sample.
        return int(np.count_nonzero(np.abs(self.errors_ms) <= _CLOSE_MS + 1e-3))

    def cells(self) -> list[str]:
        """Return what the tables show."""
        found = len(self.errors_ms)
        off = np.abs(self.errors_ms) if found else np.array([np.nan])
        return [
            str(self.events),
            f"{100 * found / max(self.events, 1):.1f}",
            f"{self.false / self.minutes if self.minutes else np.nan:.2f}",
            f"{100 * self.close / max(found, 1):.1f}",
            f"{np.median(self.errors_ms) if found else np.nan:.1f}",
            f"{np.percentile(off, 95):.1f}",
        ]


_HEAD = ["", "event", "settings", "n", "found %", "false/min/foot", "within 10 ms %", "median ms", "95 % ms"]


@app.default
def against(folders: list[Path], /, *, readout: bool = False) -> None:
    """Print the rule of taxel steps against the contacts and foot-offs that recordings hold.

    Example: python -m taxel_gait.against insole_gaitpdb insole_gaitndd insole_moticon

    Parameters
    ----------
    folders
        Recordings with labels contact and foot_off: the published data sets, where taxel_studies is installed.
    readout
        Train a readout in each fold too, for minutes.
    """
    sets = {folder.name: list(labelled_in(folder)) for folder in folders}
    say("the rule at its fixed settings; the truth is of the insoles themselves, by")
    say(*(f"  {name}: {next((one.source for one in feet), 'no labels')}" for name, feet in sets.items()))
    say(*_table([_HEAD, *(row for name, feet in sets.items() for row in fixed(name, feet))]), "")
    grid = "; ".join(f"{event} {', '.join(f'{level:g}' for level in levels)} %" for event, levels in GRID.items())
    say(f"settings chosen in {_FOLDS} folds by person, by most events within {_CLOSE_MS:g} ms and fewest false: {grid}")
    several = {name: feet for name, feet in sets.items() if len({one.person for one in feet}) >= _FOLDS}
    rows = [row for name, feet in several.items() for row in chosen(name, feet)]
    if readout:
        rows += [row for name, feet in several.items() for row in trained(name, feet)]
    say(*_table([_HEAD, *rows]))


def labelled_in(folder: Path) -> Iterator[Labelled]:
    """Yield the feet of a folder of recordings that have labels."""
    for entry in Cohort.of([folder]).entries:
        for recording in taxel.open_all(entry.paths[0]):
            for sensor in sensors(recording):
                notes = [(note.text, note.t) for note in sensor.notes if note.t is not None]
                truth = {
                    event: np.array(sorted(t for text, t in notes if text in names)) / 1e6
                    for event, names in EVENTS.items()
                }
                if all(map(len, truth.values())):
                    yield Labelled(entry.person, Foot.of(sensor), sensor, truth, sensor.source)


def found_by(labelled: Labelled, definition: Definition) -> dict[str, NDArray[np.float64]]:
    """Return the times of contacts and foot-offs by the rule, s."""
    foot = labelled.foot
    stances = find_stances(foot.t, foot.force, definition, is_channel=foot.is_channel)
    return {
        "contact": foot.t[stances.contact[~stances.cut_at_contact]],
        "foot-off": foot.t[stances.lift[~stances.cut_at_lift]],
    }


def fixed(name: str, feet: Sequence[Labelled]) -> Iterator[list[str]]:
    """Yield the rows of the first table: the definition of the sensor, and of Moticon's insoles that of Moticon too."""
    definitions = {"usual": Definition.usual(is_channel=feet[0].foot.is_channel)} if feet else {}
    if feet and feet[0].recording.kind == "moticon":
        definitions["moticon"] = DEFINITIONS["moticon"]
    for definition in definitions.values():
        found = [found_by(one, definition) for one in feet]
        for event in EVENTS:
            tally = Tally.summed(Tally.of(times[event], one, event) for times, one in zip(found, feet, strict=True))
            yield [name, event, str(definition), *tally.cells()]


def folds_of(feet: Sequence[Labelled]) -> list[list[int]]:
    """Return the feet of each fold: each person is in one."""
    people = list(dict.fromkeys(one.person for one in feet))
    return [[k for k, one in enumerate(feet) if people.index(one.person) % _FOLDS == fold] for fold in range(_FOLDS)]


def _with(definition: Definition, event: str, level: float) -> Definition:
    """Return a definition with another level of an event."""
    return replace(definition, contact=level) if event == "contact" else replace(definition, lift=level)


def chosen(name: str, feet: Sequence[Labelled]) -> Iterator[list[str]]:
    """Yield the rows of the rule whose levels are chosen on the people of the other folds."""
    usual = Definition.usual(is_channel=feet[0].foot.is_channel)
    folds = folds_of(feet)
    for event, levels in GRID.items():
        by_level = {
            level: [Tally.of(found_by(one, _with(usual, event, level))[event], one, event) for one in feet]
            for level in levels
        }
        picked, tallies = [], []
        for fold in folds:
            others = [k for k in range(len(feet)) if k not in fold]

            def good(level: float, others: list[int] = others, by_level: dict[float, list[Tally]] = by_level) -> int:
                return sum(by_level[level][k].close - by_level[level][k].false for k in others)

            best = max(levels, key=good)
            picked.append(best)
            tallies += [by_level[best][k] for k in fold]
        settings = "rule, " + ", ".join(f"{level:g}" for level in picked) + " %"
        yield [name, event, settings, *Tally.summed(tallies).cells()]


def trained(name: str, feet: Sequence[Labelled]) -> Iterator[list[str]]:
    """Yield the rows of readouts that are trained on the people of the other folds."""
    tallies: dict[str, list[Tally]] = {event: [] for event in EVENTS}
    for fold in folds_of(feet):
        others = [feet[k].recording for k in range(len(feet)) if k not in fold]
        readout = taxel.train(others, "notes", taxel.tasks.TrainOptions(folds=0)).readout
        for k in fold:
            detections = taxel.detect.run(readout, feet[k].recording)
            labels = np.array(detections.label)
            for event, names in EVENTS.items():
                times = np.sort(detections.t[np.isin(labels, names)]) / 1e6
                tallies[event].append(Tally.of(times, feet[k], event))
    for event, some in tallies.items():
        yield [name, event, "readout of taxel train", *Tally.summed(some).cells()]


def _table(rows: Sequence[Sequence[str]]) -> list[str]:
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]


if __name__ == "__main__":
    app()
