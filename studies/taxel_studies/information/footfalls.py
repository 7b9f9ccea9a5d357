"""Footfalls on a plate: who walked, and how fast."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from taxel.array import Array
from taxel.encode import ChangeEvents
from taxel.frames import Frames
from taxel.information import LabelledTrial, answer
from taxel_studies.datasets import Trial, plate, trials
from taxel_studies.study import Parameters, Statement, Summary, Table

__all__ = ["ASKS", "USES", "draw", "footfalls", "realise", "statements", "tables"]

#: Person: trials left out. Condition (slow, normal, fast): people left out.
ASKS = ("person", "condition")
USES = (
    "periods_ms",
    "windows_ms",
    "window_ms",
    "floor_counts",
    "taxels",
    "draws",
    "shuffles",
    "most_trials",
)

#: Rows and columns of sensors that hold every footfall, its heel in the middle.
_ROWS, _COLUMNS = 44, 49


def footfalls(folder: Path, ask: str, most: int = 0) -> list[LabelledTrial]:
    """Return the footfalls as labelled trials: heels in the middle, a frame of rest before each.

    Parameters
    ----------
    folder : Path
    ask : {"person", "condition"}
    most : int
        Of each person; all where it is 0.
    """
    labelled, count = [], dict[str, int]()
    for trial in trials(plate, folder):
        count[trial.person] = count.get(trial.person, 0) + 1
        if most and count[trial.person] > most:
            continue
        condition = str(trial.about.get("condition", ""))
        label = trial.person if ask == "person" else condition
        group = "" if ask == "person" else trial.person
        frames, contact = _placed(trial)
        labelled.append(LabelledTrial(frames, label, contact, int(trial.truth["foot_off"][0]), group, trial.name))
    return labelled


def _placed(trial: Trial) -> tuple[Frames, int]:
    """Return the frames with the first touched place in the middle column, after one of rest."""
    frames = trial.frames
    contact = int(trial.truth["contact"][0])
    first = frames.values[int(np.searchsorted(frames.t, contact))]
    columns = np.arange(first.shape[1])
    middle = round(float((first.sum(0) * columns).sum() / max(first.sum(), 1.0)))
    values = np.zeros((len(frames) + 1, _ROWS, _COLUMNS), np.float32)
    to = columns + _COLUMNS // 2 - middle
    kept = (to >= 0) & (to < _COLUMNS)
    rows = min(_ROWS, first.shape[0])
    values[1:, :rows, to[kept]] = frames.values[:, :rows, columns[kept]]
    t = np.concatenate([[frames.t[0] - plate.FRAME_US], frames.t])
    return Frames(values, t, unit=frames.unit, array=Array(_ROWS, _COLUMNS, plate.COLUMN_MM, name="plate")), contact


def realise(params: dict[str, Any], seed: int, folder: Path) -> dict[str, Any]:
    """Estimate the bits of the footfalls on one question."""
    return answer(
        footfalls(folder, params["ask"], params["most_trials"]),
        encoder=ChangeEvents(noise_floor=params["floor_counts"]),
        window_ms=params["window_ms"],
        windows_ms=params["windows_ms"],
        periods_ms=params["periods_ms"],
        taxels=params["taxels"],
        draws=params["draws"],
        shuffles=params["shuffles"],
        seed=seed,
    ).to_dict()


def _bits(summary: dict[str, Any], period: float, window: float) -> float | None:
    return next((p["bits"] for p in summary["points"] if (p["period_ms"], p["window_ms"]) == (period, window)), None)


def statements(p: Parameters, summary: Summary) -> list[Statement]:
    """Compare bits by period and time with the earlier trial."""
    judged = []
    whole = p["most_trials"] == 0
    if "person" in summary:
        person = summary["person"]
        before = {(2.0, 50.0): 2.40, (10.0, 50.0): 2.10, (20.0, 50.0): 1.56, (50.0, 50.0): 0.60}
        before |= {(2.0, 10.0): 1.47, (2.0, 20.0): 1.90, (2.0, 400.0): 2.53, (50.0, 400.0): 2.49}
        ours = {key: _bits(person, *key) for key in before}
        there = {key: bits for key, bits in ours.items() if bits is not None}
        judged.append(
            Statement(
                "Who walked: bits by sampling period and time since contact.",
                ", ".join(f"{a:g} ms to {b:g}: {before[a, b]:.2f}" for a, b in there),
                ", ".join(f"{a:g} ms to {b:g}: {bits:.2f}" for (a, b), bits in there.items()),
                all(abs(bits - before[key]) <= 0.2 for key, bits in there.items()) if whole and there else None,
                "tried beforehand with other code; within .2 bit counts as the same",
            )
        )
        fast, slow = _bits(person, p["periods_ms"][0], 50.0), _bits(person, p["periods_ms"][-1], 50.0)
        if fast is not None and slow is not None:
            late = [q["bits"] for q in person["points"] if q["window_ms"] == p["window_ms"]]
            judged.append(
                Statement(
                    "A fast period has more bits early, and none has more in the end (5.8, 5.13).",
                    "figures 5.8 and 5.13",
                    f"to 50 ms {fast:.2f} against {slow:.2f} bits; to {p['window_ms']:g} ms {min(late):.2f} to "
                    f"{max(late):.2f}",
                    (fast > slow + 0.2 and max(late) - min(late) < 0.2) if whole else None,
                )
            )
    if "condition" in summary:
        condition = summary["condition"]
        length, full = condition["length"]["bits"], condition["full"]["bits"]
        judged.append(
            Statement(
                "How fast a person not trained on walked: the length of the stance has more bits than the events.",
                "length .89; events to 400 ms .47",
                f"length {length:.2f}; events {full:.2f}",
                length > full if whole else None,
                "people left out; six people carry no curve",
            )
        )
    return judged


def tables(p: Parameters, summary: Summary) -> list[Table]:
    """Return bits by period and time, and those of simpler measurements."""
    listed = []
    for ask, one in summary.items():
        windows = sorted({q["window_ms"] for q in one["points"]})
        rows = []
        for period in p["periods_ms"]:
            cells = {q["window_ms"]: q for q in one["points"] if q["period_ms"] == period}
            last = cells[windows[-1]]
            verdict = "" if last["verdict"] is None else last["verdict"]["says"]
            rows.append(
                [f"{period:g} ms", *(f"{cells[w]['bits']:.2f}" for w in windows), f"{last['kbps']:.3g}", verdict]
            )
        beside = [f"chance {one['zero']['level']:.2f} (labels shuffled, 95 % below)"]
        beside.append(f"length {one['length']['bits']:.2f}")
        beside += [f"{q['taxels']} taxels {q['bits']:.2f}" for q in one["taxels"]]
        low, high = one["full"]["interval"]
        beside.append(f"full [{low:.2f} {high:.2f}] of {one['full']['most']:.2f}")
        head = [ask, *(f"to {w:g} ms" for w in windows), "kbit/s", "keeps 95 %?"]
        listed.append(Table(f"plate, {ask}: bits", head, rows, "; ".join(beside)))
    return listed


def draw(p: Parameters, summary: Summary) -> list[Figure]:
    """Draw bits over time, a line a period, and the confusion of the full setting."""
    figure = Figure(figsize=(11, 4.2), layout="constrained")
    axes = figure.subplots(1, len(summary), squeeze=False)[0]
    for ax, (ask, one) in zip(axes, summary.items(), strict=True):
        for period in p["periods_ms"]:
            line = [q for q in one["points"] if q["period_ms"] == period]
            ax.plot([q["window_ms"] for q in line], [q["bits"] for q in line], marker="o", ms=3, label=f"{period:g} ms")
        length = one["length"]["bits"]
        ax.axhline(length, color="0.6", lw=1, ls=":")
        ax.text(p["window_ms"], length, "length", ha="right", va="bottom", fontsize=8, color="0.4")
        ax.set(
            xscale="log",
            ylim=(0, one["full"]["most"] * 1.03),
            xlabel="time since contact, ms",
            ylabel="bits",
            title=ask,
        )
    axes[0].legend(frameon=False)
    return [figure]
