"""FP-learning against its definition."""

import numpy as np
import pytest
from rule_examples import kernel, patterns, summed

from taxel_rules import FP

GIVEN = {"eta": 1.0, "initial": (0.0, 1.0), "epochs": 1, "updates": "batch", "tau": 10.0, "tau_s": 5.0, "theta_0": 15.0}


def first_error(fired, targets, window):
    """By the clock: whichever comes first, a spike in no open window or a window that closes without a spike."""
    events = [(t + window, "closes", k) for k, t in enumerate(targets)] + [(f, "spike", None) for f in fired]
    met = set()
    for t, kind, k in sorted(events, key=lambda e: (e[0], e[1] == "closes")):
        if kind == "closes":
            if k not in met:
                return t, 1.0
            continue
        open_ones = [j for j, target in enumerate(targets) if abs(target - t) <= window and j not in met]
        if not open_ones:
            return t, -1.0
        met.add(open_ones[0])
    return None


@pytest.mark.parametrize("after_spike", ["reset", "subtract"])
@pytest.mark.parametrize("seed", range(8))
def test_only_the_first_error_changes_weights(after_spike, seed):
    (pattern,), (wanted,) = patterns(seed, trains=60, count=1, targets=3, spikes=3)
    weights = np.random.default_rng(seed).uniform(-1, 3, 60)
    learner = FP(window_ms=4.0, after_spike=after_spike, **GIVEN)
    fired = learner.change(weights, pattern, wanted)[1]
    if seed % 2 and len(fired):  # so that later errors come first, too
        wanted = np.sort(np.concatenate([fired[:1] + 1.0, wanted[wanted > fired[0] + 20]]))
    change, _ = learner.change(weights, pattern, wanted)
    found = first_error(fired, wanted, 4.0)
    expected = np.zeros(60)
    if found is not None:
        t, sign = found
        before = fired[fired < t]
        after = before[-1] if len(before) and after_spike == "reset" else -np.inf
        expected = sign * summed(pattern, t, lambda s: kernel(s, 10.0, 5.0), after)
    assert change == pytest.approx(expected, rel=1e-9, abs=1e-12)
