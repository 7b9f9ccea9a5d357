"""Distances between spike trains against elephant's matrices: the cost of a pair.

Trains of 1 s, Victor-Purpura at 50/s, van Rossum at 20 ms. Elephant is called for a whole matrix of trains
(``victor_purpura_distance``, ``van_rossum_distance``), as are we (``taxel.metrics.pairwise``); its calls on two trains
take 2 to 20 times as long a pair as its matrices. Ours are called several times in a round, so that the time can be
measured. One thread.

Peer: elephant. Unit: pairs per CPU second. Goal: Victor-Purpura 300 times, van Rossum 50 times elephant's speed, and
the same distances.
"""

import warnings

import numpy as np

from taxel import SpikeTrains
from taxel.metrics import pairwise
from taxel_benchmarks._goals import at_least, at_most
from taxel_benchmarks._rounds import compared, measure, missing

Q, TAU = 0.05, 20.0

#: The ratios to elephant, with their goals.
MEASURED = {"elephant victor_purpura": 300, "elephant van_rossum": 50}
#: The modules that the peer needs.
PEERS = {"elephant": "elephant neo quantities"}


def trains(random, count, spikes, stop=1000.0):
    return [np.sort(random.uniform(0, stop, spikes)) for _ in range(count)]


def off(ours, theirs):
    """Return the largest difference of two matrices."""
    return float(np.abs(ours - theirs).max())


def by_elephant(lists):
    """Return elephant's matrices of these trains."""
    import quantities as pq  # noqa: PLC0415  a peer need not be there
    from elephant.spike_train_dissimilarity import (  # noqa: PLC0415
        van_rossum_distance,
        victor_purpura_distance,
    )
    from neo import SpikeTrain  # noqa: PLC0415

    neo = [SpikeTrain(t, units="ms", t_start=0, t_stop=1000) for t in lists]
    return {
        "elephant victor_purpura": lambda: victor_purpura_distance(neo, Q / pq.ms),
        "elephant van_rossum": lambda: van_rossum_distance(neo, TAU * pq.ms),
    }


def against_elephant(spikes, absent, *, quick):
    """Measure ours and elephant on pairs of trains with this number of spikes."""
    random = np.random.default_rng(spikes)
    count = 10 if quick else 60
    lists = trains(random, count, spikes)
    ours = SpikeTrains.from_lists(lists, 0.0, 1000.0)
    pairs = count * (count - 1) / 2
    often = 5 if quick else 50
    ours_by = {
        "taxel victor_purpura": lambda: pairwise("victor_purpura", ours, q=Q, threads=1),
        "taxel van_rossum": lambda: pairwise("van_rossum", ours, tau=TAU, threads=1),
    }
    peers = {} if absent else by_elephant(lists)
    mine = {name: (lambda run=run: [run() for _ in range(often)]) for name, run in ours_by.items()}
    results = measure({**mine, **peers}, rounds=1 if quick else 5, work=pairs)
    for name in mine:
        results[name]["rate"] *= often
    couples = {name: (f"taxel {name.split()[1]}", name) for name in peers}
    ratios, spread = compared(results, {f"{name}, {spikes} spikes": couple for name, couple in couples.items()})
    return {
        "trains": count,
        "calls a round": often,
        "results": results,
        "ratios": ratios,
        "spread": spread,
        "largest difference": {name: off(ours_by[couple[0]](), peers[name]()) for name, couple in couples.items()},
    }


def goals(result):
    """Return the goals with what a result reached."""
    faster = {f"{name}, {spikes}": least for spikes in result["against peers"] for name, least in MEASURED.items()}
    apart = {
        f"difference, {name}, {spikes}": part["largest difference"].get(name)
        for spikes, part in result["against peers"].items()
        for name in MEASURED
    }
    return at_least(faster, result["ratios"]) + at_most(dict.fromkeys(apart, 1e-9), apart)


def run(*, quick):
    """Measure; quick: few trains, one round."""
    warnings.simplefilter("ignore")
    absent = missing(PEERS)
    small = {f"{spikes} spikes": against_elephant(spikes, absent, quick=quick) for spikes in (20, 200)}
    return {
        "against peers": small,
        **{of: {name: one for part in small.values() for name, one in part[of].items()} for of in ("ratios", "spread")},
        "stable": all(r["stable"] for part in small.values() for r in part["results"].values()),
    }
