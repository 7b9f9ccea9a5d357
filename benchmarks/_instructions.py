"""A kernel's benchmark once more with AVX2 alone, which is what most laboratory computers have."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any

from taxel import _core

#: Runs the benchmark of a name and prints its result as JSON.
_ALONE = """
import importlib, json, sys
sys.path.insert(0, sys.argv[1])
print(json.dumps(importlib.import_module(sys.argv[2]).run(quick=sys.argv[3] == "quick")))
"""


def beside_avx2(run: Callable[..., dict[str, Any]]) -> Callable[..., dict[str, Any]]:
    """Add to a benchmark's result what a process of its own measures with the dispatch capped at AVX2.

    The capped process measures the peers again too: its ratios are of one run. A machine without wider instructions
    measures once.
    """

    @wraps(run)
    def both(*, quick: bool) -> dict[str, Any]:
        result = run(quick=quick) | {"instructions": _core.instructions()}
        if result["instructions"] in ("plain", "avx2"):
            return result
        path = Path(run.__code__.co_filename)
        done = subprocess.run(
            [sys.executable, "-c", _ALONE, path.parent, path.stem, "quick" if quick else "whole"],
            env=os.environ | {"TAXEL_INSTRUCTIONS": "avx2"},
            stdout=subprocess.PIPE,
            text=True,
            check=True,
        )
        capped = json.loads(done.stdout.splitlines()[-1])
        result["avx2"] = {part: capped[part] for part in ("results", "stable") if part in capped}
        best = result["ratios"]
        # What does not depend on the instructions (bytes an event) is the same in both, and stands once.
        result["ratios"] = best | {f"AVX2: {key}": v for key, v in capped["ratios"].items() if v != best.get(key)}
        return result

    return both
