"""OnlineConeR against a fit from nothing to the same window of 200 footfalls, at the last footfalls of a stream.

The stream: footfalls of the plate's people (TAXEL_DATA, or ../shared/data beside the checkout), as an insole measures
them, by the recipes of the trials for contact and foot-off; without recordings drawn footfalls. CPU time.

Peer: `ConeR` on the same window, from nothing. Unit: CPU seconds a footfall. Goal: cheaper than the fit from nothing,
with the same objective.
"""

import os
import time
import warnings
from pathlib import Path

import numpy as np

from taxel import SpikeTrains
from taxel.detect.recipe import learner_from
from taxel.learn import ConeR, OnlineConeR
from taxel.neuron import Neuron
from taxel_benchmarks._goals import at_most
from taxel_studies.gait.recipes import RECIPE
from taxel_studies.gait.sources import encoded

WINDOW = 200
#: Goals at most: our share of the time of a fit from nothing, and how far the objectives may differ.
GOALS = {"ratio, median": 1.0, "objectives differ by at most": 1e-6}


def recorded(event):
    """Return the recipe and the footfalls of the shared people, in random order, or none."""
    folder = Path(os.environ.get("TAXEL_DATA") or Path(__file__).resolve().parents[3] / "shared" / "data") / "plate"
    if not folder.is_dir():
        return None
    point = RECIPE["plate"][event]
    data = encoded(folder, "plate", point["encoder"])
    cone, delay_ms = learner_from("point", point["learner"])
    later = data.latency_ms + delay_ms
    pieces = [p for p in data.pieces if len(p.spikes.times) and len(p.truth[event])]
    order = np.random.default_rng(0).permutation(len(pieces))
    return cone.get_params(deep=False), [(pieces[k].spikes, pieces[k].truth[event] + later) for k in order]


def drawn():
    """Return a recipe and 300 drawn footfalls of 92 taxels, one ON and one OFF spike a taxel."""
    random = np.random.default_rng(0)
    place = np.linspace(0, 1, 92)
    footfalls = []
    for _ in range(300):
        t, stance = random.uniform(300, 900), random.normal(640, 60)
        on = t + 0.55 * place**1.3 * stance + random.normal(0, 6, 92).clip(-12, 12) + 12
        off = np.minimum(t + (0.35 + 0.65 * place**0.7) * stance + random.normal(0, 8, 92), t + stance)
        spikes = [[x] for x in on] + [[max(x, y + 2)] for x, y in zip(off, on, strict=True)]
        footfalls.append((SpikeTrains.from_lists(spikes, stop=t + stance + 300), np.array([t + 24])))
    return {"neuron": Neuron(tau=70.0, after_spike="reset"), "divide_b_by": "targets"}, footfalls


def cpu(call):
    """Return the result of a call and its CPU time."""
    begun = time.process_time()
    value = call()
    return value, time.process_time() - begun


def compared(parameters, footfalls, steps):
    """Stream the footfalls; at each of the last steps, fit from nothing too."""
    parameters = {**parameters, "tolerance": 5e-7}
    online = OnlineConeR(window=WINDOW, **parameters)
    rows = []
    first = len(footfalls) - steps
    start = max(0, first - WINDOW)
    online.fit(*zip(*footfalls[start:first], strict=True))
    kept = footfalls[start:first]
    for footfall in footfalls[first:]:
        kept = [*kept, footfall][-WINDOW:]
        _, mine = cpu(lambda f=footfall: online.partial_fit(*f))
        window = list(zip(*kept, strict=True))
        prepared, laid_out = cpu(lambda w=window: ConeR(**parameters).prepare(*w))
        cold, theirs = cpu(lambda p=prepared: p.fit(ConeR(**parameters)))
        rows.append((mine, theirs, theirs + laid_out, abs(online.objective_ / cold.objective_ - 1)))
    mine, solve, whole, off = np.array(rows).T
    return {
        "footfalls in the window": len(kept),
        "inputs": len(kept[0][0]),
        "silent rows": online.silent_rows_,
        "steps": steps,
        "online_s": {"median": float(np.median(mine)), "largest": float(mine.max())},
        "from nothing_s": {"median": float(np.median(whole)), "solving alone": float(np.median(solve))},
        "ratio, median": float(np.median(mine / whole)),
        "times": np.percentile(whole / mine, [25, 50, 75]).tolist(),
        "ratio to solving alone, median": float(np.median(mine / solve)),
        "objectives differ by at most": float(off.max()),
    }


def goals(result):
    """Return the goals with what a result reached."""
    figures = {f"{event}, {what}": one[what] for event, one in result["results"].items() for what in GOALS}
    return at_most({name: GOALS[name.partition(", ")[2]] for name in figures}, figures)


def run(*, quick):
    """Measure; quick: few steps."""
    warnings.simplefilter("ignore")
    steps = 5 if quick else 40
    results = {}
    for event in ("contact", "foot_off"):
        found = recorded(event)
        if found is not None:
            results[event] = compared(*found, steps)
    if not results:
        results["drawn"] = compared(*drawn(), steps)
    times = {f"{event}, from nothing over OnlineConeR": one["times"] for event, one in results.items()}
    return {
        "results": results,
        "ratios": {name: middle for name, (_, middle, _) in times.items()},
        "spread": {name: [low, high] for name, (low, _, high) in times.items()},
    }
