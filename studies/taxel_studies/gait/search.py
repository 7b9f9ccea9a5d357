"""The search of 6.5.2 (T1771) around Table 6.2: tau, kappa, and lambda_1 to lambda_2."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from taxel_studies.gait.recipes import PRINTED, Point
from taxel_studies.study import Row, Table, subplots

#: The thesis' grid; lambda_1 and lambda_2 add up to 4.
GRID = {
    "tau": [10.0 + 30 * k for k in range(8)],
    "kappa": [round(1.05 + 0.05 * k, 2) for k in range(6)],
    "lambda_2": [round(0.4 * k, 1) for k in range(11)],
}
SOURCE = "plate"
EVENTS = ("contact", "foot_off")
#: On the plateau at most this share of the events more is missed or false than at the best. No line says it.
PLATEAU_PERCENT = 1.0


def points(grid: Mapping[str, Sequence[float]], event: str) -> Iterator[list[Point]]:
    """Give the settings of the grid, those of one tau together; all else is Table 6.2's."""
    printed = PRINTED[SOURCE][event]
    _, _, *others = printed["learner"]["lambdas"]
    for tau in grid["tau"]:
        yield [
            printed
            | {
                "learner": printed["learner"]
                | {"tau": tau, "kappa": kappa, "lambdas": [round(4 - lambda_2, 1), lambda_2, *others]}
            }
            for kappa in grid["kappa"]
            for lambda_2 in grid["lambda_2"]
        ]


def summarise(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Add up the folds: by event and setting what was missed, false, and false within 50 ms of an event."""
    counts: dict[tuple[str, float, float, float], Counter[str]] = {}
    for row in rows:
        for point, counted in zip(row.params["points"], row.result["searched"], strict=True):
            learner = point["learner"]
            key = row.params["event"], learner["tau"], learner["kappa"], learner["lambdas"][1]
            counts.setdefault(key, Counter()).update(counted)
    names = ("event", "tau", "kappa", "lambda_2")
    return [dict(zip(names, key, strict=True)) | dict(counted) for key, counted in counts.items()]


def wrong(one: Mapping[str, Any]) -> int:
    """Count as the thesis does: missed, and false within 50 ms of an event."""
    return int(one["missed"] + one["false_near"])


def tables(searched: Sequence[Mapping[str, Any]]) -> Iterator[Table]:
    """Say where Table 6.2 lies among the settings, by the thesis' count and by all that is false."""
    rows = []
    for event, here in _by_event(searched):
        learner = PRINTED[SOURCE][event]["learner"]
        of_table = [learner["tau"], learner["kappa"], learner["lambdas"][1]]
        for said, count in (("false within 50 ms", wrong), ("all false", lambda one: one["missed"] + one["false"])):
            counted = np.array([count(one) for one in here])
            at = [n for n, one in enumerate(here) if [one["tau"], one["kappa"], one["lambda_2"]] == of_table]
            printed = counted[at[0]] if at else None
            allowed = counted.min() + PLATEAU_PERCENT / 100 * here[0]["events"]
            best = here[int(counted.argmin())]
            rows.append(
                [
                    f"{event}, {said}",
                    str(here[0]["events"]),
                    "–" if printed is None else str(printed),
                    f"{counted.min()} (tau {best['tau']:g} ms, kappa {best['kappa']:g}, lambda_2 {best['lambda_2']:g})",
                    f"{np.count_nonzero(counted <= allowed)} of {len(counted)}",
                    "–" if printed is None else ("yes" if printed <= allowed else "no"),
                ]
            )
    if rows:
        head = ("event", "events", "Table 6.2: missed + false", "fewest", "settings on the plateau", "Table 6.2 is")
        note = (
            f"On the plateau: at most {PLATEAU_PERCENT:g} % of the events more than the fewest; ours, no line says it."
        )
        yield Table("The search of 6.5.2 (T1771), own footfalls of the plate", head, rows, note)


def draw(searched: Sequence[Mapping[str, Any]]) -> Iterator[Figure]:
    """Draw missed + false over tau and lambda_2, of the kappas the best; a cross is Table 6.2."""
    listed = list(_by_event(searched))
    if not listed:
        return
    figure, axes = subplots(4.6 * len(listed), 3.8, 1, len(listed), squeeze=False)
    for ax, (event, here) in zip(axes[0], listed, strict=True):
        taus, lambdas = (sorted({one[name] for one in here}) for name in ("tau", "lambda_2"))
        least = [
            [min(wrong(one) for one in here if (one["tau"], one["lambda_2"]) == (tau, l2)) for tau in taus]
            for l2 in lambdas
        ]
        image = ax.pcolormesh(taus, lambdas, np.log10(1 + np.array(least)), shading="nearest", cmap="viridis_r")
        for l2, line in zip(lambdas, least, strict=True):
            for tau, count in zip(taus, line, strict=True):
                ax.annotate(str(count), (tau, l2), ha="center", va="center", fontsize=6)
        learner = PRINTED[SOURCE][event]["learner"]
        ax.plot(learner["tau"], learner["lambdas"][1], "x", color="C3", ms=11)
        ax.set(title=event.replace("_", "-"), xlabel="tau, ms", ylabel="lambda_2 (lambda_1 = 4 less it)")
        figure.colorbar(image, ax=ax, label="log10(1 + missed + false within 50 ms)")
    yield figure


def _by_event(searched: Sequence[Mapping[str, Any]]) -> Iterator[tuple[str, list[Mapping[str, Any]]]]:
    for event in EVENTS:
        if here := [one for one in searched if one["event"] == event]:
            yield event, here
