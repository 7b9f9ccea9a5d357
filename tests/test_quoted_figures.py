"""Figures that README, roadmap and limits quote are those of the saved results, rounded."""

import json
import re
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parent.parent

#: Page, the words around a figure, the result, and the way to it in that.
REST = ("results", "at rest")
AT_5_KHZ, BYTE = "64 x 64 at 5.2 kHz", ("callback_us_from", "last byte", "p50")
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


def found(result: str, way: tuple[str, ...]) -> float:
    """Return a figure of a saved result; of growth that of a thousand trains and three hundred patterns."""
    value: Any = json.loads((ROOT / "benchmarks" / "results" / f"{result}.json").read_text())
    if way[0] == "growth":
        table = value["growth"]["table"]
        [row] = [one for one in table if (one["time"], one["N"], one["p"]) == (way[1], 1000, 300)]
        return float(row["cpu_s"])
    for key in way:
        value = value[key]
    return float(value)


@pytest.mark.parametrize(("page", "words", "result", "way", "unit"), QUOTED)
def test_a_quoted_figure_is_that_of_the_saved_result(page, words, result, way, unit):
    quoted = re.findall(words, " ".join((ROOT / page).read_text().split()))
    assert len(quoted) == 1, f"{page}: {words} is there {len(quoted)} times"
    digits = len(quoted[0].partition(".")[2])
    assert round(found(result, way) / unit, digits) == float(quoted[0]), f"{page}: {words}"
