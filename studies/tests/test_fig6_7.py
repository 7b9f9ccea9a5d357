"""Figure 6.7: every search is listed once, and its result comes to its own place in the curves."""

from __future__ import annotations

import itertools

from taxel_studies import fig6_7, load
from taxel_studies.study import Row


def test_each_line_holds_the_loads_of_its_own_searches_in_the_order_of_inputs() -> None:
    p = load("fig6.7").set("toy", inputs=[20, 50], classes=[2, 3])
    tasks = fig6_7.tasks(p)
    keys = [tuple(t.params[k] for k in ("after_spike", "time", "classes", "inputs")) for t in tasks]
    assert sorted(keys) == sorted(itertools.product(p["readings"], p["times"], p["classes"], p["inputs"]))
    rows = [Row(t.params, t.seed, {"p": k, "load": k / 100, "solves": 1}) for k, t in enumerate(tasks)]
    for line in fig6_7.summarise(p, rows)["lines"]:
        for inputs, found in zip(p["inputs"], line["p"], strict=True):
            assert keys[found] == (line["after_spike"], line["time"], line["classes"], inputs)
