"""The names that errors print: classes as they are imported, words of `status_` as the docs list them."""

from __future__ import annotations

import importlib
import inspect
import re
from pathlib import Path
from typing import get_args

import taxel
from taxel.learn._learner import Status

ROOMS = ("", *(f".{room}" for room in ("detect", "encode", "learn", "metrics", "recording", "simulate", "wire")))
CLASSES = sorted(
    {
        kind
        for room in ROOMS
        for kind in vars(importlib.import_module(f"taxel{room}")).values()
        if inspect.isclass(kind)
        and kind.__module__.startswith("taxel.")
        and not kind.__name__.startswith("_")
        # A protocol has no instances to be refused.
        and not getattr(kind, "_is_protocol", False)
    },
    key=lambda kind: (kind.__module__, kind.__name__),
)


def test_the_words_of_status_are_one_list():
    page = (Path(__file__).parents[1] / "docs/tutorial-exact-times.md").read_text()
    section = page[page.index("## How a fit ended") :]
    listed = {row[0]: row[1] for row in re.findall(r"^\| `(\w+)` \|[^|]*\|([^|]*)\|$", section, re.MULTILINE)}
    listed.pop("status_")
    assert set(listed) == set(get_args(Status))
    for name in taxel.learn.__all__:
        learner = getattr(taxel.learn, name)
        stated = re.search(r"^    status_ : \{(.*)\}$", inspect.getdoc(learner) or "", re.MULTILINE) or re.search(
            r"^status_ : \{(.*)\}$", inspect.getdoc(learner) or "", re.MULTILINE
        )
        if stated is None:
            continue
        words = set(re.findall(r'"(\w+)"', stated[1]))
        assert words <= set(listed)
        for word in words & {"solved", "feasible", "infeasible"}:
            assert f"`{name}`" in listed[word]
