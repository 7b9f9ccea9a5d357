"""Judgements of the thesis on gait events (6.5.1 to 6.5.3) beside our results; all rows as tables."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from taxel_studies.gait import insole, search
from taxel_studies.gait.outcomes import EVENTS
from taxel_studies.gait.protocols import ROWS
from taxel_studies.study import Judgement, Parameters, Summary, Table

#: The experiments that sources stand for: 6.5.2 has one person's footfalls, 6.5.3 recordings cut by time.
STANDS_FOR = {
    "plate": ("own footfalls", "6.5.2"),
    "gaitpdb": ("people left out", "6.5.3"),
    "gaitpdb by speed": ("four folds", "6.5.3"),
    "gaitndd": ("time within a person", "6.5.3"),
}
#: By event the claim of 6.5.2, and neuron less reference, ms: mean and standard deviation.
PUBLISHED = {"contact": (92, -2.0, 6.7), "foot_off": (93, -8.0, 17.0)}
#: By event the claims of 6.5.3: found, and to 10 ms.
WALKED = {"contact": (94, 96), "heel_off": (110, 111), "foot_off": (95, 97)}
#: A share found is not judged where more false detections than this come for each event.
FALSE_SHARE = 0.05
STAND = {"chosen": "chosen inside the folds", "printed": "Table 6.2 as printed", "squared": ROWS["squared"]}


def stand_for(summary: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the rows that stand for 6.5.2 and 6.5.3, with the numbers that judgements and picture need."""
    return [
        {
            "source": s["source"],
            "protocol": p["protocol"],
            "event": row["event"],
            "row": row["row"],
            **{
                name: row["figures"][name]
                for name in (
                    "events",
                    "missed",
                    "false",
                    "false_near",
                    "found_percent",
                    "within_10_ms_percent",
                    "error_ms",
                )
            },
            "by_scope": {scope: of["found_percent"] for scope, of in row["by_scope"].items()},
        }
        for s in summary["sources"]
        for p in s["protocols"]
        for row in p["rows"]
        if row["row"] in STAND and p["protocol"] == STANDS_FOR.get(s["source"], ("",))[0]
    ]


def judge(_p: Parameters, summary: Summary) -> Iterator[Judgement]:
    """Judge what 6.5.1 to 6.5.3 say, with chosen parameters and with those printed."""
    yield Judgement(
        91,
        f"{insole.TAXELS} taxels, {2 * insole.TAXELS} inputs with one level a taxel",
        insole.TAXELS == 92,
        "a plate's footfalls cut to the outline of an insole; other recordings have sensors of their own",
    )
    for row in stand_for(summary):
        source = row["source"]
        reading = f"{source}, {STANDS_FOR[source][0]}, {STAND[row['row']]}"
        counts = f"{row['missed']} missed and {row['false']} false of {row['events']}"
        if source == "plate":
            if row["event"] not in PUBLISHED:
                continue
            claim, mean, sd = PUBLISHED[row["event"]]
            error = row["error_ms"]
            ours = f"{error['mean']:+.1f} ± {error['sd']:.1f} ms, " if error else ""
            near = error and abs(error["mean"]) <= abs(mean) + 1 and error["sd"] <= sd
            for counted, which in (("false_near", "false within 50 ms"), ("false", "all false")):
                clean = row["missed"] == 0 and row[counted] == 0
                shown = f"{ours}{row['missed']} missed and {row[counted]} false of {row['events']}"
                yield Judgement(claim, shown, bool(clean and near), reading=f"{reading}, {which}")
            continue
        found, within = WALKED[row["event"]]
        yield Judgement(
            found,
            f"{row['found_percent']:.1f} %{_by_speed(row)}; {counts}",
            row["found_percent"] > 95 and row["false"] <= FALSE_SHARE * row["events"],
            f"with more than {100 * FALSE_SHARE:g} % of false it would not hold",
            reading,
        )
        yield Judgement(
            within,
            f"{row['within_10_ms_percent']:.0f} % of those found" if row["error_ms"] else "none found",
            bool(row["error_ms"] and row["within_10_ms_percent"] > 50),
            reading=reading,
        )


def _by_speed(row: Mapping[str, Any]) -> str:
    """Return the share found in each class of speed, in words."""
    if row["source"] != "gaitpdb by speed":
        return ""
    return f" ({', '.join(f'{percent:.1f} {speed}' for speed, percent in row['by_scope'].items())})"


#: How a table of figures is headed; "false a minute" only where there are minutes of walking.
_HEAD = ("events", "% found", "missed", "false", "% in 10 ms", "error of t, ms", "95 %", "known, ms")
_BY_MINUTE = "false/min/foot"
_FLATTERED = (
    "The lists for foot-off (plate, gaitpdb) were changed once after results on the shared people had been seen, so "
    "those two rows are flattered a little on them"
)


def tables(_p: Parameters, summary: Summary) -> Iterator[Table]:
    """List every row by event; ``summary.json`` has them by person, and what was chosen inside."""
    yield Table("What was run", ("", ""), _about(summary))
    for source in summary["sources"]:
        for protocol in source["protocols"]:
            yield from _of_protocol(source, protocol)
    yield from search.tables(summary["searched"])


def _about(summary: Summary) -> list[list[str]]:
    points = "; ".join(f"{s} {', '.join(map(str, events.values()))}" for s, events in summary["search_points"].items())
    return [
        ["target", "reference + encoder's latency + delay of at most 12 ms; t takes both off again, known does not"],
        *([name, about] for name, about in ROWS.items()),
        ["points to choose from, by event", f"{points}. {_FLATTERED}"],
        ["not here, so skipped", ", ".join(summary["skipped"]) or "none"],
    ]


def _of_protocol(source: Mapping[str, Any], protocol: Mapping[str, Any]) -> Iterator[Table]:
    by_minute, place = source["by_minute"], f"{source['source']}, {protocol['protocol']}"
    size = {"count": "footfalls a person", "seconds": "s a foot"}
    train, inside = (", ".join(f"{v} {size[k]}" for k, v in protocol[part].items()) for part in ("train", "search"))
    note = (
        f"{source['title']}; {protocol['title']}. Trains on at most {train}, inside the folds {inside}. "
        f"Truth: {source['truth']} It shows {source['shows'][0].lower()}{source['shows'][1:]}"
    )
    head = ("row", *_HEAD[:4], *([_BY_MINUTE] if by_minute else []), *_HEAD[4:])
    for event in dict.fromkeys(row["event"] for row in protocol["rows"]):
        rows = [[row["row"], *_cells(row["figures"], by_minute)] for row in protocol["rows"] if row["event"] == event]
        yield Table(f"{place}: {EVENTS[event]}", head, rows, note)
        note = ""


def _cells(f: Mapping[str, Any], by_minute: bool) -> list[str]:
    spread = f["error_ms"]
    low_high = f"{spread['low']:.0f} … {spread['high']:.0f}" if spread else "–"
    counts = [str(f["events"]), _some(f["found_percent"]), str(f["missed"]), str(f["false"])]
    rate = [_some(f["false_per_minute"], 2)] if by_minute else []
    return [*counts, *rate, _some(f["within_10_ms_percent"]), _ms(spread), low_high, _ms(f["known_ms"])]


def _some(value: float | None, digits: int = 1) -> str:
    return "–" if value is None else f"{value:.{digits}f}"


def _ms(spread: Mapping[str, float] | None) -> str:
    return f"{spread['mean']:+.1f} ± {spread['sd']:.1f}" if spread else "–"
