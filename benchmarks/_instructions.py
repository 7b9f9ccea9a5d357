"""A kernel's benchmark repeated with AVX2 alone, the widest instructions of most laboratory computers."""

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


def beside_avx2(run: Callable[..., dict[str, Any]]) -> Callable[..., dict[str, Any]]:
    """Add to a benchmark's result the measurements of a process whose dispatch is capped at AVX2.

    The capped process measures the peers too, so that its ratios are of one run. A machine without wider instructions
    measures once.
    """

    @wraps(run)
    def both(*, quick: bool) -> dict[str, Any]:
        result = run(quick=quick) | {"instructions": _core.instructions()}
        if result["instructions"] in ("plain", "avx2"):
            return result
        path = Path(run.__code__.co_filename)
        done = subprocess.run(
            [sys.executable, path.with_name("_alone.py"), path.stem, "quick" if quick else "whole"],
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
