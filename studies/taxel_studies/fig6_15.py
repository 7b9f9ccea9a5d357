"""Figure 6.15: SKIM against CONE on the gait recordings, in the same folds (thesis 6.5.4)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from taxel_studies.gait import fits, outcomes, protocols, sources
from taxel_studies.gait.judgement import STANDS_FOR
from taxel_studies.gait.outcomes import EVENTS
from taxel_studies.gait.recipes import PRINTED, RECIPE
from taxel_studies.gait.sources import SOURCES
from taxel_studies.study import Judgement, Parameters, Row, Summary, Task, subplots

WHERE = "thesis 6.5.4, figure 6.15"
PROTOCOL = (
    "The folds of the gait study. SKIM: alpha kernel with the neuron's tau, least squares on a pulse from each target "
    "on, whose width and height are searched too (6.6.3 names both); each ms at or above the threshold is a spike, as "
    "its output may span several units (6.6.3), beside it upward crossings alone; thresholds .1 to .9. The setting "
    "that finds most events within 50 ms on the tested recordings is shown (the best detection accuracy, 6.5.4), of "
    "equal ones that with the fewest false: it flatters SKIM, as it did in 6.5.4. "
    "CONE-R: the same inputs, targets, tau and training parts. Window ±50 ms, one to one; every further spike is "
    "false."
)
DATA = tuple(SOURCES[name].folder for name in STANDS_FOR)

PARAMETERS: dict[str, Any] = {
    "sources": list(STANDS_FOR),
    "recipes": ["printed", "notes"],
    "pulses_ms": [1.0, 3.0, 10.0, 30.0],
    "heights": [1.0, 3.0, 10.0],
    "scopes": 0,
    "folds": 0,
}
TOY: dict[str, Any] = {"sources": ["gaitndd", "gaitpdb"], "recipes": ["printed"], "scopes": 1, "folds": 1}
SIZES = {"toy": TOY}
RECIPES = {"printed": ("Table 6.2 as printed", PRINTED), "notes": ("our recipe", RECIPE)}
LEARNERS = {"neuron": "CONE", "units": "SKIM", "crossings": "SKIM, upward crossings"}
#: The claims of 6.5.4 by event: more errors, most of them false positives, times that deviate more.
CLAIMS_OF = {"contact": (98, 101, 104), "heel_off": (99, 102, 105), "foot_off": (100, 103, 106)}
#: The lowest of SKIM's thresholds in 6.5.4.
LOWEST = 0.1


def tasks(p: Parameters, *, data: Path) -> list[Task]:
    """List a fit of each learner a source, recipe, event and fold; 0 scopes or folds stand for all of them."""
    listed = []
    for source, folder in sources.present(data, p["sources"]).items():
        all_of = list(outcomes.folds(folder, source, protocols.of(source, STANDS_FOR[source][0])))
        scopes = list(dict.fromkeys(fold["scope"] for fold in all_of))[: p["scopes"] or None]
        chosen = [f for f in all_of if f["scope"] in scopes and (not p["folds"] or f["left_out"] < p["folds"])]
        skim = {name: p[name] for name in ("pulses_ms", "heights")}
        for recipe in p["recipes"]:
            for event, point in RECIPES[recipe][1][source].items():
                for fold in chosen:
                    both = fold | {"recipe": recipe, "event": event}
                    listed.append(Task(both | {"kind": "neuron", "points": [point]}, 1))
                    listed.append(Task(both | {"kind": "skim", "point": point, "skim": skim}, 1))
    return listed


realise = fits.realise


def summarise(p: Parameters, rows: Sequence[Row], *, data: Path) -> Summary:
    """Add up the folds; of SKIM's settings that which finds most over all of them, as 6.5.4."""
    del p, data
    summary: Summary = {"rows": []}
    keys = dict.fromkeys((r.params["source"], r.params["recipe"], r.params["event"]) for r in rows)
    for source, recipe, event in keys:
        for kind in LEARNERS:
            here = [
                r
                for r in rows
                if (r.params["source"], r.params["recipe"], r.params["event"], r.params["kind"])
                == (source, recipe, event, "neuron" if kind == "neuron" else "skim")
            ]
            if kind != "neuron":
                named = [name for name in here[0].result["by_setting"] if name.startswith(kind)]
                added = {name: _added([r.result["by_setting"][name] for r in here]) for name in named}
                setting = min(added, key=lambda name: (added[name]["missed"], added[name]["false"]))
                best = added[setting] | {"setting": setting.removeprefix(f"{kind}, ")}
            else:
                best = _added([r.result["tested"] for r in here])
            summary["rows"].append({"source": source, "recipe": recipe, "event": event, "learner": kind, **best})
    return summary


def _added(tested: Sequence[dict[str, Any]]) -> dict[str, Any]:
    units = [unit for units in tested for unit in units.values()]
    events, false = sum(u["events"] for u in units), sum(u["false"] for u in units)
    errors = np.array([e for u in units for e in u["errors"]])
    return {
        "events": events,
        "missed": events - len(errors),
        "false": false,
        "found_percent": round(100 * len(errors) / events, 2) if events else None,
        "mean_ms": round(float(errors.mean()), 2) if len(errors) else None,
        "sd_ms": round(float(errors.std()), 2) if len(errors) else None,
        "rms_ms": round(float(np.sqrt(np.mean(errors**2))), 2) if len(errors) else None,
    }


def judge(_p: Parameters, summary: Summary) -> Iterator[Judgement]:
    """Judge what 6.5.4 says, in each recipe and source, of all units above the threshold and of crossings alone."""
    rows = {(r["recipe"], r["source"], r["event"], r["learner"]): r for r in summary["rows"]}
    for (recipe, source, event, learner), skim in rows.items():
        if learner == "neuron":
            continue
        cone = rows[recipe, source, event, "neuron"]
        wrong, ours = (r["missed"] + r["false"] for r in (skim, cone))
        reading = f"{source}, {STANDS_FOR[source][0]}, {RECIPES[recipe][0]}" + ", crossings" * (learner == "crossings")
        more, positive, deviate = CLAIMS_OF[event]
        shown = f"missed and false of {cone['events']}: {wrong} SKIM ({skim['setting']}), {ours} CONE"
        yield Judgement(more, shown, wrong > ours, "pulse and threshold in brackets", reading)
        most = skim["false"] > skim["missed"] if wrong else None
        yield Judgement(positive, f"{skim['false']} false, {skim['missed']} missed", most, reading=reading)
        found = [(name, r["rms_ms"]) for name, r in (("SKIM", skim), ("CONE", cone))]
        yield Judgement(
            deviate,
            ", ".join(f"{name} found none" if rms is None else f"rms error {rms} ms {name}" for name, rms in found),
            skim["rms_ms"] > cone["rms_ms"] if None not in (skim["rms_ms"], cone["rms_ms"]) else None,
            reading=reading,
        )


def draw(p: Parameters, summary: Summary) -> Figure:
    """Draw 6.15: top what was found, below it what was false, bottom the error; a column a recipe."""
    figure, axes = subplots(6.5 * len(p["recipes"]), 7.5, 3, len(p["recipes"]), sharex="col", squeeze=False)
    for column, recipe in enumerate(p["recipes"]):
        rows = [r for r in summary["rows"] if r["recipe"] == recipe]
        groups = list(dict.fromkeys((r["source"], r["event"]) for r in rows))
        for row in rows:
            group = groups.index((row["source"], row["event"]))
            aside, colour = {"units": (-0.27, "C0"), "crossings": (0.0, "C9"), "neuron": (0.27, "C3")}[row["learner"]]
            x, first = group + aside, group == 0
            style: dict[str, Any] = {"width": 0.25, "color": colour}
            axes[0, column].bar(x, row["found_percent"], label=LEARNERS[row["learner"]] if first else None, **style)
            axes[1, column].bar(x, 100 * row["false"] / row["events"], **style)
            if row["mean_ms"] is not None:
                axes[2, column].bar(x, row["mean_ms"], yerr=row["sd_ms"], capsize=3, ecolor="0.3", **style)
        axes[0, column].set(title=RECIPES[recipe][0], ylim=(0, 103))
        axes[1, column].set_yscale("symlog", linthresh=1)
        axes[2, column].axhline(0, color="0.5", lw=0.8)
        axes[2, column].set_xticks(range(len(groups)), [f"{s}\n{EVENTS[e]}" for s, e in groups], fontsize="small")
    for ax, text in zip(axes[:, 0], ("% found", "false, % of events", "learner less reference, ms"), strict=True):
        ax.set_ylabel(text)
    figure.legend(*axes[0, 0].get_legend_handles_labels(), fontsize="small", loc="outside upper center", ncols=3)
    return figure
