"""How many times faster than real time the SA-2 afferents of 64 x 64 taxels are, beside the obvious NumPy.

Peer: the obvious NumPy. Unit: times real time, on one core. Goal: 20.
"""

from __future__ import annotations

from typing import Any

from _instructions import beside_avx2
from _receptor import benchmark

from taxel.encode import SA2


@beside_avx2
def run(*, quick: bool) -> dict[str, Any]:
    """Measure; return seconds, real-time factors and ratios."""
    return benchmark(__doc__, "SA-2", SA2(period_ms=0.192), quick=quick)
