"""Write the page of everything measured, docs/measured.md, from the kept results: python docs/measured.py.

The page's text is in measured.md.j2, with the few measurements that have no kept result.
"""

from __future__ import annotations

import importlib
import json
from pathlib import Path
from statistics import median
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from taxel_benchmarks._command import doubts_of, goals_of
from taxel_studies import STUDIES

DOCS = Path(__file__).resolve().parent
PAGE = DOCS / "measured.md"
BENCHMARKS = DOCS.parent / "benchmarks"
RESULTS = BENCHMARKS / "results"
VERDICTS = {True: "yes", False: "**no**", None: ""}
KNOWN = "known at first impacts, ms"


def page() -> str:
    """Return the page's text."""
    figures = [RESULTS / "figures" / f"{name}.json" for name in STUDIES]
    template = Environment(
        loader=FileSystemLoader(DOCS), undefined=StrictUndefined, trim_blocks=True, keep_trailing_newline=True
    ).get_template("measured.md.j2")
    return template.render(
        benchmarks=[benchmark(file) for file in sorted(RESULTS.glob("*.json"))],
        studies=[study(file) for file in figures if file.exists()],
    )


def write() -> None:
    """Write the page where it has changed."""
    text = page()
    if not PAGE.exists() or PAGE.read_text(encoding="utf-8") != text:
        PAGE.write_text(text, encoding="utf-8")


def benchmark(file: Path) -> dict[str, Any]:
    """Return what the page shows of a benchmark's result: a row for each ratio and each goal."""
    result, name = json.loads(file.read_text(encoding="utf-8")), file.stem
    goals = {}
    if (BENCHMARKS / "taxel_benchmarks" / f"{name}.py").exists():
        goals = {goal.what: goal for goal in goals_of(importlib.import_module(f"taxel_benchmarks.{name}"), result)}
    rows = []
    for what, figure in (result.get("ratios", {}) | {what: goal.figure for what, goal in goals.items()}).items():
        goal, spread = goals.get(what), result.get("spread", {}).get(what)
        bound = "> " * (what.removeprefix("AVX2: ") in result.get("larger", ()))
        quartiles = f"{number(spread[0])} to {number(spread[1])}" if spread else ""
        limit = f"{'at most ' if goal.at_most else 'at least '}{number(goal.limit)}" if goal else ""
        rows.append([what, bound + number(figure), quartiles, limit, VERDICTS[goal.reached if goal else None]])
    main = [("", ["figure", "value or median", "quartiles of rounds", "goal", "reached"], rows)] if rows else []
    reached = [goal.reached for goal in goals.values()]
    return {
        "name": name,
        "result": result,
        "question": result.get("question") or result.get("about", "").partition("\n")[0] or f"`{result['what']}`",
        "goals": f"{sum(reached)} of {len(reached)}" if reached else "none",
        "doubts": doubts_of(result) if isinstance(result["machine"], dict) else [],
        "tables": [table(*part) for part in [*main, *MORE.get(name, lambda _: [])(result)]],
    }


def study(file: Path) -> dict[str, Any]:
    """Return what the page shows of a study: its statements with our values."""
    section: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    judged = [one["holds"] for one in section["statements"] if one["holds"] is not None]
    rows = [[one["says"], one["ours"], VERDICTS[one["holds"]]] for one in section["statements"]]
    return section | {
        "holds": f"{sum(judged)} of {len(judged)}" if judged else "none judged",
        "table": table("", ["statement", "ours", "holds"], rows),
    }


#: A table: its title, the names of its columns, and its rows.
Table = tuple[str, list[str], list[list[str]]]


def latency(result: dict[str, Any]) -> list[Table]:
    """Return the latency of all arrays, at rest and under load."""
    states = [result["results"][state] for state in ("at rest", "loaded")]
    quantiles = ("p50", "p99", "max")
    rows = [
        [name, *(number(state[name]["callback_us_from"]["last byte"][q]) for state in states for q in quantiles)]
        for name in states[0]
    ]
    head = ["array", "at rest: median", "99 %", "largest", "loaded: median", "99 %", "largest"]
    return [("From the last byte of a frame to the callback, us", head, rows)]


def growth(result: dict[str, Any]) -> list[Table]:
    """Return the cost of CONE-X by the number of input trains and patterns."""
    head = ["time", "input trains", "patterns", "CPU time, s", "status"]
    of = ("time", "N", "p", "cpu_s", "status")
    return [("Growth of the cost", head, [[number(row[key]) for key in of] for row in result["growth"]["table"]])]


def training(result: dict[str, Any]) -> list[Table]:
    """Return what neurons and tuned plain rules find, by how the sensor is worn."""
    runs = result["trainings"]
    played = {
        who: {key: sum(run[who][key] for run in runs) for key in runs[0][who]}
        | {KNOWN: median(run[who][KNOWN] for run in runs)}
        for who in ("neuron", "rule")
    }
    kinds = {"as played, ten trainings": played, **result["conditions"], "an object stays": result["stays"]}
    keys = ["touches", *(f"{label}, {what}" for label in ("contact", "lift") for what in ("missed", "false")), KNOWN]
    rows = [
        [kind, who, *(number(of[who][key]) for key in keys)]
        for kind, of in kinds.items()
        for who in of
        if who in played
    ]
    head = ["sensor", "by", "contacts and lifts", *keys[1:-1], "known after first impacts, median, ms"]
    times = [[name, number(of["cpu_s"]), number(of["wall_s"])] for name, of in result["time"].items()]
    return [
        ("Contacts and lifts within 50 ms of the truth", head, rows),
        ("Time of one training", ["recordings", "CPU time, s", "wall time, s"], times),
    ]


def demo(result: dict[str, Any]) -> list[Table]:
    """Return what the demo's neuron and its plain rule find, by kind of touch."""
    rows = [
        [kind, label, who.replace("_", " "), *map(number, (of["touches"], of["found"]))]
        + [number(of[error] and of[error][middle]) for error, middle in (("error_ms", "median"), ("known_ms", "p50"))]
        for who in ("neuron", "plain_rule")
        for kind, labels in result[who]["classes"].items()
        for label, of in labels.items()
    ]
    head = ["touch", "event", "by", "touches", "found", "t - true, median, ms", "known - true, median, ms"]
    return [("By kind of touch", head, rows)]


def gait_search(result: dict[str, Any]) -> list[Table]:
    """Return what the searched parameters miss."""
    rows = [[name, number(of["missed"]), number(of["false"])] for name, of in result["of 360 footfalls"].items()]
    return [("Of 360 footfalls", ["event, other parameters", "missed", "false"], rows)]


#: Tables of a benchmark beside its ratios and goals.
MORE = {"demo": demo, "gait-search": gait_search, "latency": latency, "learn_cone_x": growth, "training": training}


def number(value: Any) -> str:
    """Return a figure with three digits, an integer whole, a text as it is."""
    if value is None or isinstance(value, bool):
        return {None: "not measured", True: "yes", False: "no"}[value]
    if isinstance(value, str):
        return value
    return f"{value:.0f}" if isinstance(value, int) or abs(value) >= 100 else f"{value:.3g}"


def table(title: str, head: list[str], rows: list[list[str]]) -> str:
    """Return a table in Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    cells = [[" ".join(cell.split()).replace("|", r"\|").replace("<", r"\<") for cell in line] for line in lines]
    return f"{title}:\n\n" * bool(title) + "\n".join(f"| {' | '.join(line)} |" for line in cells)


if __name__ == "__main__":
    write()
