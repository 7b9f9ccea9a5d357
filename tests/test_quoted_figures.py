"""Figures that README, roadmap, limits and the page of accuracy quote are those of the saved results, rounded."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

ROOT = Path(__file__).parent.parent

#: Page, the words around a figure, the result, and the way to it in that.
REST = ("results", "at rest")
AT_5_KHZ, BYTE = "64 x 64 at 5.2 kHz", ("callback_us_from", "last byte", "p50")
PER_GB = ("index", "wall_s_per_gb")
RUNNING = "taxel, local load, two running means, times real time"
STREAM = "decoded, {}, version 2 / version 1 as one stream"
QUOTED = [
    ("README.md", r"\(([\d.]+) ms at the median from", "latency", (*REST, AT_5_KHZ, *BYTE), 1e3),
    ("README.md", r"takes ([\d.]+) ms to be sure", "latency", (*REST, f"version 1, {AT_5_KHZ}", *BYTE), 1e3),
    ("README.md", r"([\d.]+) s on the thesis' time grid", "learn_cone_x", ("growth", "grid"), 1.0),
    ("README.md", r"([\d.]+) s in continuous time", "learn_cone_x", ("growth", "continuous"), 1.0),
    ("ROADMAP.md", r"second: ([\d.]+)e9 without values", "wire_decode", ("results", "taxel, clean, warm", "rate"), 1e9),
    # Two words an event.
    ("ROADMAP.md", r"values and ([\d.]+)e9 with", "wire_decode", ("results", "taxel, pairs, warm", "rate"), 2e9),
    ("ROADMAP.md", r"used before; ([\d.]+)e9 and", "wire_decode", ("results", "taxel, clean, fresh", "rate"), 1e9),
    ("ROADMAP.md", r"e9 and ([\d.]+)e9 into new", "wire_decode", ("results", "taxel, pairs, fresh", "rate"), 2e9),
    ("ROADMAP.md", r"version 2: (\d+) us from the last byte", "latency", (*REST, AT_5_KHZ, *BYTE), 1.0),
    ("ROADMAP.md", r"version 1: (\d+) us", "latency", (*REST, f"version 1, {AT_5_KHZ}", *BYTE), 1.0),
    ("ROADMAP.md", r"FA-1 (\d+) x", "encode_fa1", ("ratios", "taxel, FA-1, pressure, times real time"), 1.0),
    ("ROADMAP.md", r"skin (\d+) x", "encode_skin", ("ratios", "taxel, skin, noisy frames, times real time"), 1.0),
    (
        "ROADMAP.md",
        r"(\d+) x real time, with",
        "encode_local_load",
        ("ratios", "taxel, local load, times real time"),
        1.0,
    ),
    ("ROADMAP.md", r"with two running means (\d+) x", "encode_local_load", ("ratios", RUNNING), 1.0),
    ("ROADMAP.md", r"([\d.]+) GB a CPU second", "recording_write", ("results", "taxel, none", "rate"), 1e9),
    ("ROADMAP.md", r"bench capture_udp` \| (\d+) M", "capture_udp", ("worst_case", "sent_events_per_s"), 1e6),
    ("ROADMAP.md", r"a GB indexed in ([\d.]+) s", "panel", ("seeking", 0, *PER_GB), 1.0),
    ("ROADMAP.md", r"of version 2 in ([\d.]+) s", "panel", ("seeking", 1, *PER_GB), 1.0),
    ("ROADMAP.md", r"60 footfalls in ([\d.]+) s", "information", ("results", "footfalls", "wall_s"), 1.0),
    ("ROADMAP.md", r"([\d.]+) x real time \(a ball\)", "contact", ("ratios", "a ball, times real time"), 1.0),
    ("docs/information.md", r"take ([\d.]+) or [\d.]+ s", "information", ("results", "footfalls", "cpu_s"), 1.0),
    ("docs/information.md", r"take [\d.]+ or ([\d.]+) s", "information", ("results", "strides", "cpu_s"), 1.0),
    ("docs/limits.md", r"callback is (\d+) us with version 2", "latency", (*REST, AT_5_KHZ, *BYTE), 1.0),
    ("docs/limits.md", r"and (\d+) us with version 1", "latency", (*REST, f"version 1, {AT_5_KHZ}", *BYTE), 1.0),
    (
        "docs/limits.md",
        r"runs at (\d+) to \d+ times",
        "encode_fa1",
        ("ratios", "taxel, FA-1, pressure, times real time"),
        1.0,
    ),
    (
        "docs/limits.md",
        r"runs at \d+ to (\d+) times",
        "encode_fa1",
        ("ratios", "taxel, FA-1, ticks, times real time"),
        1.0,
    ),
    ("docs/limits.md", r"reaches ([\d.]+) to [\d.]+ of", "wire_v2", ("ratios", STREAM.format("drop")), 1.0),
    ("docs/limits.md", r"reaches [\d.]+ to ([\d.]+) of", "wire_v2", ("ratios", STREAM.format("footfall")), 1.0),
    ("docs/limits.md", r"of a full array ([\d.]+\d)", "wire_v2", ("ratios", STREAM.format("full array")), 1.0),
]


def both(*ways: tuple[str, ...]) -> Callable[[Any], list[float]]:
    """Return a function to the figures of neuron and rule at the end of each way."""
    return lambda result: [value(result, (*way, who, "wrong")) for way in ways for who in ("neuron", "rule")]


def sums(*names: str) -> Callable[[Any], list[float]]:
    return lambda result: [result["ratios"][name] for name in names]


def trained(result: Any, name: str) -> list[float]:
    """Return the median over the trainings for neuron and rule."""
    return [float(np.median([one[who][name] for one in result["trainings"]])) for who in ("neuron", "rule")]


def delays(result: Any, label: str) -> list[float]:
    """Return how many times the rule's delay the neuron's is, smallest and largest."""
    found = [1 / one for name, one in result["ratios"].items() if f"{label}: plain rule's delay" in name]
    return [min(found), max(found)]


def known(result: Any) -> list[float]:
    first = result["neuron"]["classes"]["first impact"]
    return [first[label]["known_ms"]["p50"] for label in ("contact", "lift")]


#: In docs/accuracy.md: the words around figures, the result, and the figures in it.
N = r"([\d.]*\d)"
ACCURATE: list[tuple[str, str, Callable[[Any], list[float]]]] = [
    (
        rf"found \(no fewer\) \| {N} \| {N} \| {N}",
        "training",
        lambda r: [
            sum(one["neuron"]["touches"] for one in r["trainings"]),
            *sums("as played, found, neuron", "as played, found, rule")(r),
        ],
    ),
    (
        rf"false \(no more\) \| \| {N} \| {N}",
        "training",
        sums("as played, false, neuron", "as played, false, rule"),
    ),
    (rf"within .1 ms\) \| \| {N} ms \| {N} ms", "training", lambda r: trained(r, "known at first impacts, ms")),
    (
        rf"the rule's \+ 10\) \| {N} \| {N} \| {N}",
        "training",
        sums("worn, touches", "worn, wrong, neuron", "worn, wrong, rule"),
    ),
    (
        rf"\(fewer\) \| {N} \| {N} \| {N}",
        "training",
        sums("an object stays, touches", "an object stays, wrong, neuron", "an object stays, wrong, rule"),
    ),
    (
        rf"ten scenes take {N} s of processor time, and ten minutes .* {N} s \({N} and {N} s on the clock",
        "training",
        lambda r: [r["time"][of][clock] for clock in ("cpu_s", "wall_s") for of in ("ten scenes", "ten minutes")],
    ),
    (rf"recording \({N} of {N}\)", "training", lambda r: [r["live"]["live"], r["live"]["recording"]]),
    (
        rf"training finds {N} %",
        "training",
        lambda r: [100 * r["ratios"]["as played, worst training found, of the rule's"]],
    ),
    (
        rf"\({N} wrong, the rule {N}\), then a noise of .6 ticks \({N} and {N}\)",
        "training",
        both(("conditions", "stale tare"), ("conditions", "noise .6")),
    ),
    (
        rf"\({N} and {N}, {N} and {N}, {N} and {N}, bad taxels {N} and {N}\)",
        "training",
        both(*(("conditions", name) for name in ("noise .3", "noise 1.2", "noise 2.4", "bad taxels"))),
    ),
    (
        rf"miss \({N} and {N} of {N}\)",
        "training",
        lambda r: [
            *(r["stays"][who]["lift, missed"] for who in ("neuron", "rule")),
            r["stays"]["neuron"]["lift, found"] + r["stays"]["neuron"]["lift, missed"],
        ],
    ),
    (
        rf"delay is {N} to {N} times the rule's at contacts and {N} to {N} times at lifts",
        "demo",
        lambda r: delays(r, "contact") + delays(r, "lift"),
    ),
    (rf"{N} ms after the contact and {N} ms after the lift, at the median", "demo", known),
]


def saved(result: str) -> Any:
    return json.loads((ROOT / "benchmarks" / "results" / f"{result}.json").read_text())


def value(result: Any, way: tuple[str, ...]) -> float:
    """Return a figure of a saved result; of growth that of a thousand trains and three hundred patterns."""
    if way[0] == "growth":
        table = result["growth"]["table"]
        [row] = [one for one in table if (one["time"], one["N"], one["p"]) == (way[1], 1000, 300)]
        return float(row["cpu_s"])
    for key in way:
        result = result[key]
    return float(result)


def quoted(page: str, words: str) -> list[str]:
    """Return the figures in a page that must be there once."""
    there = re.findall(words, " ".join((ROOT / page).read_text().split()))
    assert len(there) == 1, f"{page}: {words} is there {len(there)} times"
    return [there[0]] if isinstance(there[0], str) else list(there[0])


def rounded(figure: float, text: str) -> float:
    return round(figure, len(text.partition(".")[2]))


@pytest.mark.parametrize(("page", "words", "result", "way", "unit"), QUOTED)
def test_a_quoted_figure_is_that_of_the_saved_result(page, words, result, way, unit):
    [text] = quoted(page, words)
    assert rounded(value(saved(result), way) / unit, text) == float(text), f"{page}: {words}"


@pytest.mark.parametrize(("words", "result", "figures"), ACCURATE)
def test_a_figure_of_accuracy_is_that_of_the_saved_result(words, result, figures):
    texts, found = quoted("docs/accuracy.md", words), figures(saved(result))
    assert len(found) == len(texts)
    assert [rounded(one, text) for one, text in zip(found, texts, strict=True)] == [float(text) for text in texts]
