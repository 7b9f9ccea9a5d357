"""The gait study's part of the page of all studies: figures 6.12 to 6.14."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from taxel import _arguments as arguments
from taxel._core import ProblemError
from taxel.studies.gait import insole, sources
from taxel.studies.gait.plans import study
from taxel.studies.gait.recipes import NOTES
from taxel.studies.gait.report import EVENTS
from taxel.studies.gait.sources import SOURCES
from taxel.studies.runner import HERE, Workers
from taxel.studies.study import Section, Statement, machine, write_section

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["GaitStudy"]

#: What each source stands for: 6.5.2 has one person's footfalls, 6.5.3 recordings cut by time.
STANDS_FOR = {
    "plate": ("own footfalls", "6.5.2"),
    "gaitpdb": ("people left out", "6.5.3"),
    "gaitndd": ("time within a person", "6.5.3"),
}
#: Thesis 6.5.2, ms: neuron less reference, mean and standard deviation.
PUBLISHED = {"contact": (-2.0, 6.7), "foot_off": (-8.0, 17.0)}
#: Found counts for nothing where so many detections, by events, are false.
FALSE_SHARE = 0.05
ROWS = {"chosen": "chosen inside the folds", "printed": "Table 6.2 as printed"}


class GaitStudy:
    """Run `taxel.studies.gait.study` as one of the studies of the page."""

    name = "gait"
    title = "gait events by one neuron an event, on published walking recordings"
    parameters: Mapping[str, Any] = {}
    sizes: Mapping[str, Mapping[str, Any]] = {"toy": {}}
    data = tuple(source.folder for source in SOURCES.values())

    def run(
        self,
        report: Path,
        *,
        size: str = "full",
        changes: Mapping[str, Any] | None = None,
        data: Path | None = None,
        workers: Workers = HERE,
        strict: bool = False,
        quiet: bool = False,
    ) -> Section:
        """Run it into ``report/gait``; leave its own page there too.

        Parameters
        ----------
        report, size, changes, data, workers, strict, quiet
            As in `taxel.studies.study.Study.run`; nothing can be changed.

        Returns
        -------
        dict

        Raises
        ------
        FormatError : `data` holds no recordings
        ProblemError : a size or parameter that is none
        """
        if changes:
            raise ProblemError(f"{self.name} has no parameter {next(iter(changes))!r}: its points are in its recipes")
        folder = report / self.name
        data = Path(arguments.path("data", data))
        said = study(data, size=size, workers=workers, report=folder, strict=strict, quiet=quiet)
        section = {
            "name": self.name,
            "title": self.title,
            "where": "thesis 6.5, figures 6.12 to 6.14, Table 6.2",
            "protocol": (
                "The protocols of 6.5.2 and 6.5.3 on recordings of other people, as far as each recording's truth "
                "allows. Errors are neuron minus reference (negative: early), window ±50 ms, one to one; every further "
                "spike counts as false. All rows, plain rules and encoders beside the neuron stand on the study's own "
                "page, gait.html, in its folder."
            ),
            "size": size,
            "parameters": {"skipped": said["skipped"], "search_points": said["search_points"]},
            "unread": said["unread"],
            "realisations": sum(len(p["rows"]) for s in said["sources"] for p in s["protocols"]),
            "statements": [asdict(s) for s in statements(said)],
            "said": {"rows": _rows(said)},
            "cpu_seconds": said["cpu_seconds"],
            "code": "see gait/results.jsonl",
            **machine(),
        }
        pictures = [_bars(_rows(said))]
        plate = data / SOURCES["plate"].folder
        if plate.is_dir():
            pictures.insert(0, _conversion(plate))
        write_section(folder, section, pictures)
        return section


def _rows(said: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the rows that stand for 6.5.2 and 6.5.3, with the numbers that the picture needs."""
    return [
        {
            "source": s["source"],
            "protocol": p["protocol"],
            "event": row["event"],
            "row": row["row"],
            **{
                name: row["figures"][name]
                for name in ("events", "missed", "false", "found_percent", "within_10_ms_percent", "error_ms")
            },
        }
        for s in said["sources"]
        for p in s["protocols"]
        for row in p["rows"]
        if row["row"] in ROWS and p["protocol"] == STANDS_FOR.get(s["source"], ("",))[0]
    ]


def statements(said: Mapping[str, Any]) -> list[Statement]:
    """Judge what 6.5.1 to 6.5.3 say, with chosen parameters and with those printed."""
    found = [
        Statement(
            "The insole has 92 taxels and makes 184 input neurons: each signal and its inverse.",
            "92, 184",
            f"{insole.TAXELS} taxels, {2 * insole.TAXELS} inputs with one level a taxel",
            insole.TAXELS == 92,
            "a plate's footfalls cut to the outline of an insole; other recordings have sensors of their own",
        )
    ]
    for row in _rows(said):
        source, event = row["source"], EVENTS[row["event"]]
        why = f"{source}, {STANDS_FOR[source][0]}; {ROWS[row['row']]}"
        counts = f"{row['missed']} missed and {row['false']} false of {row['events']}"
        if source == "plate":
            if row["event"] not in PUBLISHED:
                continue
            mean, sd = PUBLISHED[row["event"]]
            error = row["error_ms"]
            ours = f"{error['mean']:+.1f} ± {error['sd']:.1f} ms, " if error else ""
            clean = row["missed"] == 0 and row["false"] == 0
            found.append(
                Statement(
                    f"One neuron finds {event} on a force plate, none missed, none false.",
                    f"{mean:+.1f} ± {sd:.1f} ms",
                    f"{ours}{counts}",
                    bool(clean and error and abs(error["mean"]) <= abs(mean) + 1 and error["sd"] <= sd),
                    why,
                )
            )
            continue
        found += [
            Statement(
                f"On walking recordings it finds more than 95 % of {event}.",
                "over 95 %",
                f"{row['found_percent']:.1f} %; {counts}",
                row["found_percent"] > 95 and row["false"] <= FALSE_SHARE * row["events"],
                f"{why}; with more than {100 * FALSE_SHARE:g} % of false it would not hold",
            ),
            Statement(
                f"In most cases to 10 ms ({event}).",
                "most within 10 ms",
                f"{row['within_10_ms_percent']:.0f} % of those found" if row["error_ms"] else "none found",
                bool(row["error_ms"] and row["within_10_ms_percent"] > 50),
                why,
            ),
        ]
    return found


def _bars(rows: Sequence[Mapping[str, Any]]) -> Figure:
    """Draw 6.14: top found, bottom error, a group a source and event."""
    from matplotlib.figure import Figure  # noqa: PLC0415  loads slowly

    figure = Figure(figsize=(11, 6.5), layout="constrained")
    top, bottom = figure.subplots(2, 1, sharex=True)
    groups = list(dict.fromkeys((r["source"], r["event"]) for r in rows))
    for number, (name, label) in enumerate(ROWS.items()):
        for at, (source, event) in enumerate(groups):
            row = next((r for r in rows if (r["source"], r["event"], r["row"]) == (source, event, name)), None)
            if row is None:
                continue
            x, style = at + 0.36 * (number - 0.5), {"width": 0.34, "color": f"C{3 - 3 * number}"}
            top.bar(x, row["found_percent"], label=label if at == 0 else None, **style)
            top.annotate(f"{row['false']}", (x, 2), ha="center", fontsize=7, color="white")
            if row["error_ms"]:
                bottom.bar(x, row["error_ms"]["mean"], yerr=row["error_ms"]["sd"], ecolor="0.3", capsize=3, **style)
    top.axhline(95, color="0.5", ls=":", lw=0.9)
    top.set(ylabel="% found (in the bars: false)", ylim=(0, 103))
    figure.legend(fontsize="small", loc="outside upper center", ncols=2)
    bottom.axhline(0, color="0.5", lw=0.8)
    for y in (-10, 10):
        bottom.axhline(y, color="0.5", ls=":", lw=0.9)
    bottom.set_ylabel("neuron less reference, ms (mean, sd)")
    bottom.set_xticks(range(len(groups)), [f"{s}\n{EVENTS[e]}" for s, e in groups])
    return figure


def _conversion(plate: Path) -> Figure:
    """Draw 6.12 and 6.13: the insole, what three taxels feel, and the spikes of all inputs over one footfall."""
    from matplotlib.colors import Normalize  # noqa: PLC0415  loads slowly
    from matplotlib.figure import Figure  # noqa: PLC0415

    encoder = NOTES["plate"]["contact"]["encoder"]
    pieces = sources.encoded(plate, "plate", encoder).pieces
    cut = sources.cuts(plate, "plate", "own")[0]
    piece = pieces[cut.name]
    figure = Figure(figsize=(13, 4.6), layout="constrained")
    foot, analog, raster = figure.subplots(1, 3, width_ratios=[1, 2, 3])
    peak = cut.values.max(axis=0)
    first = np.concatenate([[0], np.cumsum(insole.CELLS)])
    at = [(c - (n - 1) / 2, r) for r, n in enumerate(insole.CELLS) for c in range(n)]
    foot.scatter(*zip(*at, strict=True), c=peak, norm=Normalize(0), cmap="viridis", marker="s", s=90)
    foot.set(
        title=f"{insole.TAXELS} taxels, heel at the foot\n(colour: peak load)", xticks=[], yticks=[], aspect="equal"
    )
    begins = float(piece.truth["contact"][0])
    frame_ms = 2.0
    t = np.arange(len(cut.values)) * frame_ms
    for row, name in ((1, "heel"), (8, "ball"), (13, "toes")):
        n = int(first[row] + np.argmax(peak[first[row] : first[row + 1]]))
        analog.plot(t, cut.values[:, n], label=name)
    analog.axhline(encoder["levels"][0], color="k", ls="--", lw=0.9, label="threshold")
    analog.set(xlabel="ms since contact", ylabel="counts", title="what three taxels feel")
    analog.legend(fontsize="small")
    raster.eventplot([train - begins for train in piece.spikes], colors="k", linewidths=1.4, linelengths=2.0)
    for event, times in piece.truth.items():
        for time in times:
            raster.axvline(time - begins, color={"contact": "C3", "heel_off": "C2", "foot_off": "C0"}[event], lw=1.1)
    raster.set(xlabel="ms since contact", ylabel="input neuron", xlim=(-40, t[-1] + 90))
    raster.set_title(f"spikes of {len(piece.spikes)} inputs; lines: {', '.join(EVENTS[e] for e in piece.truth)}")
    return figure
