"""Linear discriminants of ten folds: against scikit-learn's (`svd`), and at the size of figure 5.5.

15 000 trials of 1000 ternary features, 300 classes: our ten folds, beside scikit-learn's ``svd`` of one fold (it trains
each anew, so ten cost ten times that). Predictions of that fold are compared, trial by trial. Then 150 000 x 5000, ten
folds, once, with the time and the largest memory. CPU time of the process: both use all cores.
"""

import resource
import sys
import time

import numpy as np
from _rounds import measure, ratio, stamp
from sklearn.discriminant_analysis import LinearDiscriminantAnalysis

from taxel.information import fold_predictions, folds

FOLDS = 10


def rasters(trials, features, classes, seed, rows=5000):
    """Return spikes of -1, 0 and 1, 2 % of them, from a mean a class, and the labels."""
    random = np.random.default_rng(seed)
    labels = np.arange(trials) % classes
    rate = random.gamma(0.5, 0.04, (classes, features)).astype(np.float32)
    sign = random.random((classes, features)) < 0.5
    x = np.empty((trials, features), np.int8)
    for first in range(0, trials, rows):
        mine = slice(first, min(first + rows, trials))
        fires = random.random((mine.stop - first, features), dtype=np.float32) < rate[labels[mine]]
        x[mine] = np.where(sign[labels[mine]], 1, -1) * fires
    return x, labels


def against_scikit_learn(quick):
    """Compare ten folds of ours with one of scikit-learn's."""
    trials, features, classes = (3000, 200, 60) if quick else (15_000, 1000, 300)
    x, y = rasters(trials, features, classes, 1)
    fold = folds(y, count=FOLDS, seed=1)
    train, test = fold != 0, fold == 0
    values = x.astype(np.float64)
    said = {}

    def ours():
        said["ours"] = fold_predictions(x, y, fold)

    def theirs():
        said["theirs"] = LinearDiscriminantAnalysis(solver="svd").fit(values[train], y[train]).predict(values[test])

    results = measure(
        {"taxel, ten folds": ours, "scikit-learn svd, one fold": theirs},
        rounds=1 if quick else 3,
        clock=time.CLOCK_PROCESS_CPUTIME_ID,
    )
    return {
        "size": [trials, features, classes],
        "results": results,
        "ratio of ten folds": FOLDS * ratio(results, "taxel, ten folds", "scikit-learn svd, one fold"),
        "equal predictions": float(np.mean(said["ours"][test] == said["theirs"])),
        "right": float(np.mean(said["ours"] == y)),
    }


def full_size(share, features=5000):
    """Run figure 5.5's size once."""
    trials, classes = int(150_000 * share), 300
    x, y = rasters(trials, features, classes, 2)
    fold = folds(y, count=FOLDS, seed=1)
    wall, cpu = time.perf_counter(), time.process_time()
    said = fold_predictions(
        x, y, fold, progress=lambda done, of: print(f"step {done} of {of}", file=sys.stderr, flush=True)
    )
    return {
        "size": [trials, features, classes],
        "share": share,
        "wall_s": time.perf_counter() - wall,
        "cpu_s": time.process_time() - cpu,
        "largest_memory_gb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6,
        "right": float(np.mean(said == y)),
    }


def run(*, quick, share=1.0):
    """Measure; quick: small tables, one round. `share`: of the trials of figure 5.5, where the machine is too busy."""
    large = full_size(0.02, 500) if quick else full_size(share)
    peer = against_scikit_learn(quick)
    return {
        "question": __doc__.splitlines()[0],
        **stamp("scikit-learn"),
        "full size": large,
        "against scikit-learn": peer,
        "ratios": {"scikit-learn svd, ten folds": peer["ratio of ten folds"]},
        "stable": all(result["stable"] for result in peer["results"].values()),
    }
