"""A kernel's benchmark repeated with AVX2 alone, the widest instructions of most laboratory computers."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from functools import wraps
from typing import Any


def widest() -> str:
    """Return the widest vector instructions that taxel uses here: it refuses to load with any that are wider."""
    named = os.environ.get("TAXEL_INSTRUCTIONS")
    return named or next(name for name in ("avx512", "avx2", "plain") if _is_there(name))


def _is_there(instructions: str) -> bool:
    environment = os.environ | {"TAXEL_INSTRUCTIONS": instructions}
    load = [sys.executable, "-P", "-c", "import taxel"]
    return subprocess.run(load, env=environment, capture_output=True, check=False).returncode == 0


def beside_avx2(run: Callable[..., dict[str, Any]]) -> Callable[..., dict[str, Any]]:
    """Add to a benchmark's result the measurements of a process whose dispatch is capped at AVX2.

    The capped process measures the peers too, so that its ratios are of one run. A machine without wider instructions
    measures once.
    """

    @wraps(run)
    def both(*, quick: bool) -> dict[str, Any]:
        result = run(quick=quick) | {"instructions": widest()}
        if result["instructions"] in ("plain", "avx2"):
            return result
        name, size = run.__module__.rpartition(".")[2], "quick" if quick else "whole"
        done = subprocess.run(
            [sys.executable, "-P", "-m", "taxel_benchmarks._alone", name, size],
            env=os.environ | {"TAXEL_INSTRUCTIONS": "avx2"},
            stdout=subprocess.PIPE,
            text=True,
            check=True,
        )
        capped = json.loads(done.stdout.splitlines()[-1])
        result["avx2"] = {part: capped[part] for part in ("results", "stable") if part in capped}
        # Results that do not depend on the instructions (bytes an event) are equal in both, and are listed once.
        for of in ("ratios", "spread"):
            best = result[of]
            result[of] = best | {f"AVX2: {name}": one for name, one in capped[of].items() if one != best.get(name)}
        return result

    return both
