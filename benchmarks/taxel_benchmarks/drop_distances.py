"""Figure 5.11's distances: 1800 x 1800 drops at a period of 1 ms, all 100 pairs of tau and sigma.

The spatial van Rossum distance is an inner product, so one table of states a tau serves every sigma. Patterns of 256
taxels, rises and falls apart, with as many spikes as the drops of the study `drops` have. Beside it
`taxel.metrics.pairwise`, which does not use the samples' grid, on some of the patterns at one tau and sigma: the
distances are equal, and the cost of a pair is compared, in turn, one thread both.

Peer: `taxel.metrics.pairwise`. Unit: CPU seconds; for all distances, minutes. Goal: a pair cheaper than the peer's,
equal to rounding.
"""

import time

import numpy as np

from taxel import Array, SpikeTrains
from taxel.metrics import pairwise
from taxel_benchmarks._goals import at_most, not_slower
from taxel_benchmarks._rounds import measured
from taxel_studies.dropped import REGION, distances_of, smoothed, spatial_grams

PERIOD_MS, SAMPLES, SPIKES = 1.0, 50, 740
TAUS_MS = [round(0.1 * k, 1) for k in range(1, 21)]
SIGMAS_MM = [1.0, 2.0, 3.0, 4.0, 5.0]
PITCH_MM = 2.67


def patterns(count, seed):
    """Return patterns with as many spikes as a drop has."""
    share = SPIKES / (SAMPLES * 2 * REGION**2)
    return (np.random.default_rng(seed).random((count, SAMPLES, 2, REGION**2), np.float32) < share).astype(np.uint8)


def trains(spikes):
    """Return patterns as spike trains at the samples' times."""
    found = []
    for one in spikes:
        times = [PERIOD_MS * np.flatnonzero(column) for column in one.reshape(SAMPLES, -1).T]
        found.append(SpikeTrains.from_lists(times, start=0.0, stop=SAMPLES * PERIOD_MS))
    return found


def all_of_them(count, taus):
    """Compute the distances of all patterns at every tau and sigma, once."""
    spikes = patterns(count, 1)
    kernels = [smoothed(REGION, PITCH_MM, sigma) for sigma in SIGMAS_MM]
    wall, cpu = time.perf_counter(), time.process_time()
    matrices = 0
    for tau in taus:
        for gram in spatial_grams(spikes, PERIOD_MS, tau, kernels, [SAMPLES]):
            matrices += len(distances_of(gram[0])) == count
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    searched = len(TAUS_MS) * len(SIGMAS_MM)
    return {
        "patterns": count,
        "matrices": matrices,
        "of": searched,
        "wall_s": wall,
        "cpu_s": cpu,
        "cpu_s of all": cpu * searched / matrices,
    }


def beside_metrics(count, rounds):
    """Compare the distances of a few patterns, and the cost of a pair."""
    spikes = patterns(count, 2)
    as_trains, kernel, array = trains(spikes), smoothed(REGION, PITCH_MM, 2.0), Array(REGION, REGION, pitch_mm=PITCH_MM)
    distances = {}

    def ours():
        distances["ours"] = distances_of(spatial_grams(spikes, PERIOD_MS, 0.4, [kernel], [SAMPLES])[0][0])

    def theirs():
        distances["theirs"] = pairwise(
            "van_rossum_spatial", as_trains, array=array, tau=0.4, sigma=2.0, normalisation="none", threads=1
        )

    runs = {"by samples": ours, "taxel.metrics.pairwise": theirs}
    found = measured(runs, {"taxel.metrics.pairwise": ("by samples", "taxel.metrics.pairwise")}, rounds=rounds)
    off = np.abs(distances["ours"] - distances["theirs"]).max() / distances["theirs"].max()
    return found | {"patterns": count, "largest difference": float(off)}


def goals(result):
    """Return the goals with what a result reached."""
    apart = {"largest relative difference": result["beside taxel.metrics"]["largest difference"]}
    return not_slower(result, "taxel.metrics.pairwise") + at_most(dict.fromkeys(apart, 1e-6), apart)


def run(*, quick, share=1.0):
    """Measure; quick: few patterns. `share`: of the taus, for a busy machine."""
    taus = TAUS_MS[:: max(1, round(1 / share))]
    whole = all_of_them(90, TAUS_MS[:2]) if quick else all_of_them(1800, taus)
    peer = beside_metrics(20, 1) if quick else beside_metrics(300, 5)
    return peer | {"all distances": whole, "beside taxel.metrics": peer}
