"""Write two pages from the kept results: python docs/measured.py.

docs/measured.md has all of them, and is built with the other pages; docs/results.md has those that other pages cite and
the missed goals, and is committed. The pages' texts are in measured.md.j2 and results.md.j2, with the few measurements
that have no kept result.
"""

from __future__ import annotations

import json
from pathlib import Path
from statistics import median
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined, Template

from taxel_benchmarks._command import benchmarks as known_benchmarks
from taxel_benchmarks._command import doubts_of
from taxel_studies import STUDIES
from taxel_studies.claims import CLAIMS, summed, verdicts

DOCS = Path(__file__).resolve().parent
BENCHMARKS = DOCS.parent / "benchmarks"
RESULTS = BENCHMARKS / "results"
VERDICTS = {True: "yes", False: "**no**", None: ""}
KNOWN_BENCHMARKS = known_benchmarks()
KNOWN = "known at first impacts, ms"
#: The array of the benchmark of latency that other pages cite.
ARRAY = "64 x 64 at 5.2 kHz"


def measured() -> str:
    """Return the text of the page of everything measured."""
    return _template("measured.md.j2").render(benchmarks=_benchmarks(), studies=_studies())


def results() -> str:
    """Return the text of the page of results that other pages cite."""
    every = _benchmarks()
    rows = [(one["name"], row) for one in every for row in one["rows"]]
    figures = {(name, row[0]): row[1] for name, row in rows}
    goals = [[name, row[0], row[1], row[3]] for name, row in rows if row[4]]
    missed = [[name, row[0], row[1], row[3]] for name, row in rows if row[4] == VERDICTS[False]]
    found = verdicts(judged for one in _studies() for judged in one["judgements"])
    return _template("results.md.j2").render(
        speed=_speed(figures),
        detections=_detections(figures),
        claims=summed(found),
        failing=[one.claim for one in found if one.main and one.main["holds"] is False and not one.claim.source],
        goals=len(goals),
        reached=len(goals) - len(missed),
        missed=missed,
        measured={one["name"]: f"{one['result']['date']}, {one['result']['commit']}" for one in every},
    )


def write() -> None:
    """Write the pages where they have changed."""
    for name, text in (("measured.md", measured()), ("results.md", results())):
        page = DOCS / name
        if not page.exists() or page.read_text(encoding="utf-8") != text:
            page.write_text(text, encoding="utf-8")


def _template(name: str) -> Template:
    environment = Environment(
        loader=FileSystemLoader(DOCS), undefined=StrictUndefined, trim_blocks=True, keep_trailing_newline=True
    )
    return environment.get_template(name)


def _benchmarks() -> list[dict[str, Any]]:
    return [benchmark(file) for file in sorted(RESULTS.glob("*.json"))]


def _studies() -> list[dict[str, Any]]:
    figures = [RESULTS / "figures" / f"{name}.json" for name in STUDIES]
    return [study(file) for file in figures if file.exists()]


def _speed(rows: dict[tuple[str, str], str]) -> list[tuple[str, str, str]]:
    """Return what takes how long, and the benchmark that measured it; rows are figures by benchmark and name."""
    kept = json.loads((RESULTS / "latency.json").read_text(encoding="utf-8"))["results"]["at rest"]
    others = json.loads((RESULTS / "training.json").read_text(encoding="utf-8"))["machine"]["others"]
    known = {array: f"{of['callback_us_from']['last byte']['p50'] / 1000:.2f} ms" for array, of in kept.items()}
    return [
        (
            "from a frame's last byte to the detection, median: version 2 of the wire; version 1",
            f"{known[ARRAY]}; {known[f'version 1, {ARRAY}']}",
            "latency",
        ),
        (
            f"a training of ten minutes, beside {others:.1f} busy cores of others",
            f"{rows['training', 'training of ten minutes, wall s']} s",
            "training",
        ),
        ("`taxel information` of 60 footfalls", f"{rows['information', 'footfalls, s']} s", "information"),
    ]


def _detections(rows: dict[tuple[str, str], str]) -> list[list[str]]:
    """Return what runs, neurons and tuned plain rules find and miss in the benchmark of training."""
    trainings = json.loads((RESULTS / "training.json").read_text(encoding="utf-8"))["trainings"]
    touches = sum(training["neuron"]["touches"] for training in trainings)
    kinds = {
        f"contacts and lifts of ten trainings: found, of {touches}": "as played, found",
        "the same: false": "as played, false",
        f"a worn sensor: wrong, of {rows['training', 'worn, touches']} contacts and lifts": "worn, wrong",
        f"an object stays: wrong, of {rows['training', 'an object stays, touches']}": "an object stays, wrong",
    }
    ways = "runs", "neuron", "rule"
    return [[what, *(rows["training", f"{of}, {who}"] for who in ways)] for what, of in kinds.items()]


def benchmark(file: Path) -> dict[str, Any]:
    """Return what the page shows of a benchmark's result: a row for each ratio and each goal."""
    result, name = json.loads(file.read_text(encoding="utf-8")), file.stem
    goals = {goal.what: goal for goal in KNOWN_BENCHMARKS[name].goals(result)} if name in KNOWN_BENCHMARKS else {}
    rows = []
    for what, figure in (result.get("ratios", {}) | {what: goal.figure for what, goal in goals.items()}).items():
        goal, spread = goals.get(what), result.get("spread", {}).get(what)
        bound = "> " * (what.removeprefix("AVX2: ") in result.get("larger", ()))
        quartiles = f"{number(spread[0])} to {number(spread[1])}" if spread else ""
        limit = f"{'at most ' if goal.at_most else 'at least '}{number(goal.limit)}" if goal else ""
        rows.append(
            [what, bound + number(figure), quartiles, limit, VERDICTS[goal.verdict == "reached" if goal else None]]
        )
    main = [("", ["figure", "value or median", "quartiles of rounds", "goal", "reached"], rows)] if rows else []
    reached = [goal.verdict == "reached" for goal in goals.values()]
    return {
        "name": name,
        "result": result,
        "question": result.get("question") or result.get("about", "").partition("\n")[0] or f"`{result['what']}`",
        "goals": f"{sum(reached)} of {len(reached)}" if reached else "none",
        "doubts": doubts_of(result) if isinstance(result["machine"], dict) else [],
        "rows": rows,
        "tables": [table(*part) for part in [*main, *MORE.get(name, lambda _: [])(result)]],
    }


def study(file: Path) -> dict[str, Any]:
    """Return what the page shows of a study: its judgements with our values."""
    section: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    judgements = section["judgements"]
    judged = [one["holds"] for one in judgements if one["holds"] is not None]
    rows = [[CLAIMS[j["claim"]].says, j["reading"], j["ours"], VERDICTS[j["holds"]]] for j in judgements]
    return section | {
        "holds": f"{sum(judged)} of {len(judged)}" if judged else "none judged",
        "table": table("", ["claim", "reading", "ours", "holds"], rows),
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
MORE = {"demo": demo, "gait-search": gait_search, "latency": latency, "training": training}


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
