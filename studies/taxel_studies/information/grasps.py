"""Grasps of a robot's hand: which object, slice by slice."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from taxel.encode import ChangeEvents
from taxel.frames import Frames
from taxel.information import estimate, nested_predictions, zero_test
from taxel_studies.datasets import icub, trials
from taxel_studies.discriminants import GramLDA
from taxel_studies.study import Parameters, Statement, Summary, Table

__all__ = ["ASKS", "USES", "draw", "realise", "statements", "tables"]

ASKS = ("object",)
USES = ("slices", "draws", "shuffles", "most_trials")

#: A change of so much of the 8-bit value makes an event.
_FLOOR = 3.0
#: Ridge of the comparison of early grasps with late ones, in which no parameter is chosen.
_RIDGE = 1.0


def realise(params: dict[str, Any], seed: int, folder: Path) -> dict[str, Any]:
    """Estimate the bits of frames and events since the first slice, of that slice, and of the number of slices."""
    values, labels, order = [], [], []
    count: dict[str, int] = {}
    for trial in trials(icub, folder):
        name = str(trial.about["object"])
        count[name] = count.get(name, 0) + 1
        if not params["most_trials"] or count[name] <= params["most_trials"]:
            values.append(trial.frames.values.reshape(len(trial.frames), -1))
            labels.append(name)
            order.append(count[name])
    y, longest = np.array(labels), max(params["slices"])
    # A grasp that has ended keeps its last slice.
    held = np.stack([v[np.minimum(np.arange(longest + 1), len(v) - 1)] for v in values]).astype(np.float64)
    since = held[:, 1:] - held[:, :1]
    events = np.stack([_events(v) for v in held])
    lengths = np.array([len(v) for v in values], np.float64)
    result: dict[str, Any] = {"trials": len(y), "classes": len(set(labels)), "slices": params["slices"]}

    def bits(x: NDArray[Any]) -> dict[str, Any]:
        flat = x.reshape(len(x), -1).astype(np.float64)
        gram, features = flat @ flat.T, max(1, int(flat.any(0).sum()))
        folds = min(10, int(np.unique(y, return_counts=True)[1].min()))
        answers = [
            nested_predictions([gram], [features], y, count=folds, seed=seed + k).responses
            for k in range(params["draws"])
        ]
        return estimate(y, np.array(answers), seed=seed).to_dict()

    result["first"] = bits(held[:, 0] - held[:, 0].mean(0))
    result["length"] = bits((lengths - lengths.mean())[:, None])
    result["frames"] = [bits(since[:, :s]) for s in params["slices"]]
    result["events"] = [bits(events[:, :s]) for s in params["slices"]]
    flat = events[:, : params["slices"][-1]].reshape(len(y), -1)
    gram, features = flat @ flat.T, max(1, int(flat.any(0).sum()))
    zero = zero_test(
        lambda mixed: nested_predictions([gram], [features], mixed, count=5, seed=seed).responses,
        y,
        result["events"][-1]["bits"],
        shuffles=params["shuffles"],
        seed=seed,
    )
    result["zero"] = {"level": zero.level, "p": zero.p}
    result["drift"] = {
        "first": _early_and_late(held[:, 0], y, np.array(order), seed),
        "since": _early_and_late(since[:, : min(4, longest)], y, np.array(order), seed),
    }
    return result


def _events(values: NDArray[Any]) -> NDArray[np.float64]:
    """Return the change events of a grasp, slices x taxels."""
    frames = Frames(values[:, None, :], np.arange(len(values)) * 1000)
    trains = ChangeEvents(noise_floor=_FLOOR, period_ms=1.0).encode(frames)
    events = np.zeros((len(values) - 1, values.shape[1]))
    taxel = np.repeat(np.arange(len(trains)), trains.counts)
    assert trains.values is not None  # change events are signed
    events[np.rint(trains.times).astype(np.int64) - 1, taxel] = trains.values
    return events


def _early_and_late(x: NDArray[Any], y: NDArray[Any], order: NDArray[np.int64], seed: int) -> dict[str, float]:
    """Return the share classified right: late grasps after training on early ones, and random halves on the others."""
    flat = x.reshape(len(x), -1).astype(np.float64)
    flat = flat - flat.mean(0)
    gram, features = flat @ flat.T, max(1, int(flat.any(0).sum()))
    half = np.array([np.median(order[y == name]) for name in y])

    def right(train: NDArray[np.bool_]) -> float:
        model = GramLDA(features=features, ridge=_RIDGE).fit(gram[np.ix_(train, train)], y[train])
        return float(np.mean(model.predict(gram[np.ix_(~train, train)]) == y[~train]))

    random, shares = np.random.default_rng(seed), []
    for _ in range(20):
        train = np.zeros(len(y), bool)
        for name in np.unique(y):
            mine = random.permutation(np.flatnonzero(y == name))
            train[mine[: len(mine) // 2]] = True
        shares.append(right(train))
    return {"late by early": right(order < half), "halves": float(np.mean(shares)), "halves_sd": float(np.std(shares))}


def statements(p: Parameters, summary: Summary) -> list[Statement]:
    """Compare bits by slice with the earlier trial."""
    one, whole = summary["object"], p["most_trials"] == 0
    first = one["first"]
    judged = [
        Statement(
            "A warning: the first slice's pressure alone, before anything changed, names the object.",
            "3.27 of 3.32 bits",
            f"{first['bits']:.2f} of {first['most']:.2f} bits; late grasps by early ones "
            f"{100 * one['drift']['first']['late by early']:.0f} % right, random halves "
            f"{100 * one['drift']['first']['halves']:.0f} %",
            first["bits"] > 0.9 * first["most"] if whole else None,
            "probably the sensor's drift from session to session: so only changes since that slice are asked",
        )
    ]
    before = {"frames": {1: 1.85, 4: 2.91, 7: 3.12}, "events": {1: 1.16, 4: 2.36, 7: 2.62}}
    for name, values in before.items():
        ours = {s: b["bits"] for s, b in zip(one["slices"], one[name], strict=True) if s in values}
        judged.append(
            Statement(
                f"Which object, by slice, from changes since the first ({name}).",
                ", ".join(f"slice {s}: {values[s]:.2f}" for s in ours),
                ", ".join(f"slice {s}: {bits:.2f}" for s, bits in ours.items()),
                all(abs(bits - values[s]) <= 0.3 for s, bits in ours.items()) if whole and ours else None,
                "tried beforehand with other code; within .3 bit counts as the same",
            )
        )
    return judged


def tables(p: Parameters, summary: Summary) -> list[Table]:
    """Return bits by slice, as a table."""
    del p
    one = summary["object"]
    rows = [
        [f"to slice {s}", f"{a['bits']:.2f}", f"{b['bits']:.2f}", f"[{b['interval'][0]:.2f} {b['interval'][1]:.2f}]"]
        for s, a, b in zip(one["slices"], one["frames"], one["events"], strict=True)
    ]
    note = (
        f"{one['trials']} grasps of {one['classes']} objects; chance {one['zero']['level']:.2f} (labels shuffled, 95 % "
        f"below); slices alone {one['length']['bits']:.2f}; the first slice alone {one['first']['bits']:.2f}; "
        f"late grasps by early ones {100 * one['drift']['since']['late by early']:.0f} % right, random halves "
        f"{100 * one['drift']['since']['halves']:.0f} %"
    )
    return [Table("hand, object: bits", ["changes since the first slice", "frames", "events", "95 %"], rows, note)]


def draw(p: Parameters, summary: Summary) -> list[Figure]:
    """Draw bits over slices."""
    del p
    one = summary["object"]
    figure = Figure(figsize=(6, 4), layout="constrained")
    ax = figure.subplots()
    for name in ("frames", "events"):
        ax.plot(one["slices"], [b["bits"] for b in one[name]], marker="o", label=f"{name} since the first slice")
    ax.axhline(one["first"]["bits"], color="C3", ls=":", label="the first slice itself (a warning)")
    ax.axhline(one["length"]["bits"], color="0.6", ls=":", label="number of slices alone")
    ax.set(xlabel="slice", ylabel="bits", ylim=(0, one["first"]["most"] * 1.03), title="which object the hand holds")
    ax.legend(frameon=False)
    return [figure]
