"""How many times faster than real time the SA-2 afferents of 64 x 64 taxels are, beside the obvious NumPy.

Peer: the obvious NumPy. Unit: times real time, on one core. Goal: 20.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from taxel.encode import SA2
from taxel_benchmarks._goals import Goal, times_real_time
from taxel_benchmarks._instructions import beside_avx2
from taxel_benchmarks._receptor import benchmark


def goals(result: Mapping[str, Any]) -> list[Goal]:
    """Return the goals with what a result reached."""
    return times_real_time({"SA-2, noisy frames": 20, "SA-2, events": 20}, result)


@beside_avx2
def run(*, quick: bool) -> dict[str, Any]:
    """Measure; return seconds, real-time factors and ratios."""
    return benchmark(__doc__, "SA-2", SA2(period_ms=0.192), quick=quick)
