"""How much each choice that the thesis leaves open moves the information of an indentation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from matplotlib.figure import Figure

from taxel.encode import FA1
from taxel_studies import indented
from taxel_studies.fem import DRAGON_SKIN_10, Indentation, SamplingGrid, Yeoh
from taxel_studies.runner import SharedFolder, Task
from taxel_studies.study import Parameters, Row, Statement, Summary, Table, logarithmic

__all__ = ["CHOICES", "courses_under"]

WHERE = "beside thesis 5.4 and 5.5"
PROTOCOL = (
    "As fig5.5 on part of Table 5.1 (diameters 2, 3, 4 mm; moduli 50, 250 kPa; all depths; 0, 10, 20 degrees), "
    "with Table 5.3's alpha, one choice changed at a time; theta_0 follows each choice's own largest pressure."
)
COURSES = True

#: What is changed: of the indentation, of the sampling grid, of the encoder. The first changes nothing.
CHOICES: dict[str, dict[str, dict[str, Any]]] = {
    "as it is": {},
    "block 4 mm high": {"press": {"height_mm": 4.0}},
    "block 8 mm high": {"press": {"height_mm": 8.0}},
    "block 24 mm wide": {"press": {"width_mm": 24.0}},
    "friction 0.3": {"press": {"friction": 0.3}},
    "silicone 7 times stiffer": {"press": {"silicone": 7.0}},
    "true stress": {"grid": {"quantity": "cauchy"}},
    "mean stress": {"grid": {"quantity": "mean"}},
    "grid shifted by twice as much": {"grid": {"shift_mm": 0.4}},
    "grid not shifted": {"grid": {"shift_mm": 0.0}},
    "B by the ms": {"encoder": {"decay": "ms"}},
    "theta_0 twice as large": {"scale": {"theta_0": 2.0}},
}
PARAMETERS: dict[str, Any] = {
    **indented.TABLE,
    "diameters_mm": [2.0, 3.0, 4.0],
    "moduli_kpa": [50.0, 250.0],
    "angles_deg": [0.0, 10.0, 20.0],
    "choices": list(CHOICES),
    "samples": 100,
    "periods_ms": [1.0, 2.0, 5.0, 10.0, 20.0],
    "alpha": 0.7,
    "seed": 1,
}
TOY: dict[str, Any] = {
    **indented.TOY,
    "choices": ["as it is", "block 4 mm high", "mean stress", "B by the ms", "theta_0 twice as large"],
    "samples": 12,
    "periods_ms": [10.0, 20.0],
}
SIZES = {"coarse": indented.COARSE, "toy": TOY}


def courses_under(p: Parameters, choice: str) -> dict[tuple[float, float, float], Indentation]:
    """Return the indentations of a choice, by diameter, modulus and angle."""
    changed = dict(CHOICES[choice].get("press", {}))
    if "silicone" in changed:
        stiffer, law = changed["silicone"], DRAGON_SKIN_10
        changed["silicone"] = Yeoh(stiffer * law.c10_pa, stiffer * law.c20_pa, stiffer * law.c30_pa)
    return indented.courses_of(p, **changed)


def tasks(p: Parameters) -> list[Task]:
    """List the courses of every choice, those that several share once."""
    asked = {i: None for choice in p["choices"] for i in courses_under(p, choice).values()}
    return indented.course_tasks(list(asked))


def then(p: Parameters, rows: Sequence[Row]) -> list[Task]:
    """List one realisation a choice and period."""
    listed = []
    for choice in p["choices"]:
        own = [i.to_dict() for i in courses_under(p, choice).values()]
        shared = indented.shared(p, [row for row in rows if row.params.get("course") in own])
        listed += [
            Task({**shared, "choice": choice, "period_ms": t, "alpha": p["alpha"], "samples": p["samples"]}, p["seed"])
            for t in sorted(p["periods_ms"])
        ]
    return listed


def realise(params: dict[str, Any], seed: int, courses: SharedFolder) -> dict[str, Any]:
    """Press once; or sample all contacts under one choice, and return the bits of the discriminants' answers."""
    course = indented.make(params, courses)
    if course is not None:
        return indented.course_summary(course)
    choice = CHOICES[params["choice"]]
    conditions, samples = indented.reached(params), params["samples"]
    asked = courses_under(params, params["choice"])
    grid = SamplingGrid(**choice.get("grid", {}))
    largest = indented.largest_kpa(list(asked.values()), courses, grid)
    encoder = FA1(
        alpha=params["alpha"],
        theta_0=choice.get("scale", {}).get("theta_0", 1.0) * largest ** params["alpha"] / 1024,
        period_ms=params["period_ms"],
        **choice.get("encoder", {}),
    )
    x = indented.rasters(conditions, asked, courses, grid=grid, encoder=encoder, samples=samples, seed=seed)
    return indented.bits_of(indented.summed(x, len(conditions), samples, seed), samples)


def summarise(p: Parameters, rows: Sequence[Row], courses: SharedFolder) -> Summary:
    """List the bits by choice and period."""
    del courses
    bits = {(r.params["choice"], r.params["period_ms"]): r.result["bits"] for r in rows if "choice" in r.params}
    periods = sorted(p["periods_ms"])
    return {
        "periods_ms": periods,
        "lines": [{"choice": c, "bits": [bits[c, t] for t in periods]} for c in p["choices"]],
        "conditions": len(indented.table_of(p).conditions()),
    }


def statements(p: Parameters, summary: Summary) -> list[Statement]:
    """Say which choice moves most, and whether the thesis' claim stands under each."""
    of_each = f"{p['samples']} samples each, alpha {p['alpha']:g}, mesh {p['mesh_mm']:g} mm"
    size = f"{summary['conditions']} conditions, {of_each}"
    first, *others = summary["lines"]
    moved = {
        line["choice"]: max((b - a for a, b in zip(first["bits"], line["bits"], strict=True)), key=abs)
        for line in others
    }
    falls = [line["choice"] for line in summary["lines"] if line["bits"][-1] < line["bits"][0]]
    most = max(moved, key=lambda c: abs(moved[c]))
    return [
        Statement(
            "What the thesis does not state moves the bits (ours, not the thesis').",
            "none",
            f"most: {most}, {moved[most]:+.2f} bits; {sum(abs(v) < 0.1 for v in moved.values())} of {len(moved)} "
            "choices move them by less than 0.1 at every period",
            None,
            size,
        ),
        Statement(
            "Under every choice the information falls from the shortest to the longest period (figure 5.5).",
            "falls",
            f"under {len(falls)} of {len(summary['lines'])}",
            len(falls) == len(summary["lines"]),
            size,
        ),
    ]


def tables(p: Parameters, summary: Summary) -> list[Table]:
    """Return each choice's bits less those of the first."""
    del p
    first, *others = summary["lines"]
    rows = [
        [first["choice"], *(f"{b:.2f}" for b in first["bits"])],
        *(
            [line["choice"], *(f"{b - a:+.2f}" for a, b in zip(first["bits"], line["bits"], strict=True))]
            for line in others
        ),
    ]
    return [
        Table("bits, and what each choice changes", ["choice", *(f"{t:g} ms" for t in summary["periods_ms"])], rows)
    ]


def draw(p: Parameters, summary: Summary) -> Figure:
    """Draw the curve of 5.5 under each choice."""
    del p
    figure = Figure(figsize=(8, 4.5), layout="constrained")
    ax = figure.subplots()
    for k, line in enumerate(summary["lines"]):
        ax.plot(
            summary["periods_ms"],
            line["bits"],
            marker=".",
            lw=2 if k == 0 else 1,
            color="k" if k == 0 else f"C{k % 10}",
            ls="-" if k <= 10 else "--",
            label=line["choice"],
        )
    logarithmic(ax, x=summary["periods_ms"])
    ax.set_xlabel("sampling period, ms")
    ax.set_ylabel("bits")
    ax.legend(fontsize="x-small", loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure
