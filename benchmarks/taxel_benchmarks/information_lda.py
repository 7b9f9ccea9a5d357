"""Linear discriminants of ten folds: against scikit-learn's (`svd` and `lsqr`), and at the size of figure 5.5.

15 000 trials of 1000 ternary features, 300 classes, once of spikes drawn independently, whose scatter has full rank,
and once of rasters as of an array, in which features determine each other exactly. *One fold*: both train on nine
tenths of the same table (ours as int8, scikit-learn as float32, with which it is fastest) and predict the rest, with
one BLAS thread. *Ten folds*: ours, whose folds share what they sum, beside ten times one of scikit-learn, which
trains each from nothing. Predictions are compared, trial by trial. Then 150 000 x 5000, ten folds, once, with the
time and the largest memory; there BLAS has all cores.

Peer: scikit-learn's `svd` and `lsqr`. Unit: CPU seconds of one fold and of ten. Goal: not slower than either,
and the same predictions.
"""

import resource
import time
from functools import partial

import numpy as np

from taxel import Array, Frames
from taxel.encode import FA1
from taxel.information import folds
from taxel_benchmarks._goals import at_least, not_slower
from taxel_benchmarks._peer import missing
from taxel_benchmarks._rounds import compared, measure, stamp
from taxel_studies.discriminants import LDA, fold_predictions

FOLDS = 10
PARTS = "against scikit-learn"
HOW = ("one fold", "ten folds")
SOLVERS = ("svd", "lsqr")
PEERS = {"scikit-learn svd": "sklearn", "scikit-learn lsqr": "sklearn"}
#: Rows and columns of taxels of the simulated touches.
ROWS, COLUMNS = 5, 8


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


def touches(trials, features, classes, seed):
    """Return FA-1's spikes of touches, sampled every 2 ms, and the labels.

    A class is a place, width, depth and rise of pressure; a trial begins within a sample, up to a tenth more or less
    deep. The pressure is symmetric about the second column, so the first and the third are equal.
    """
    random = np.random.default_rng(seed)
    labels, samples = np.arange(trials) % classes, features // (ROWS * COLUMNS)
    place, width, depth, rise = (
        random.uniform(*limits, classes)[labels, None] for limits in ((0, ROWS - 1), (1, 3), (10, 60), (5, 40))
    )
    y, x = np.mgrid[:ROWS, -1 : COLUMNS - 1].reshape(2, 1, -1)
    pressure = random.uniform(0.9, 1.1, (trials, 1)) * depth * np.exp(-(x**2 + (y - place) ** 2) / (2 * width**2))
    t = 2.0 * np.arange(samples + 1)
    course = np.clip((t - 2 - random.uniform(0, 2, (trials, 1))) / rise, 0, 1)
    frames = (course.T[:, :, None] * pressure).astype(np.float32)
    spikes = FA1(period_ms=2.0).encode(Frames(frames, (1000 * t).astype(int), array=Array(trials, ROWS * COLUMNS)))
    at, taxel = spikes.to_numpy()
    table = np.zeros((trials * ROWS * COLUMNS, samples), np.int8)
    table[taxel, np.rint(at / 2).astype(int) - 1] = spikes.values
    return table.reshape(trials, features), labels


def against_scikit_learn(table, absent, quick):
    """Compare ten folds of ours with one of scikit-learn's, if it is installed, on tables that a function makes."""
    trials, features, classes = (3000, 200, 60) if quick else (15_000, 1000, 300)
    x, y = table(trials, features, classes, 1)
    fold = folds(y, count=FOLDS, seed=1)
    train, test = fold != 0, fold == 0
    small = x.astype(np.float32)
    predicted = {}

    def ours():
        predicted["ours"] = LDA().fit(x[train], y[train]).predict(x[test])

    def ten():
        predicted["ten"] = fold_predictions(x, y, fold)

    def theirs(solver):
        from sklearn.discriminant_analysis import LinearDiscriminantAnalysis  # noqa: PLC0415  a peer need not be there

        discriminant = LinearDiscriminantAnalysis(solver=solver).fit(small[train], y[train])
        predicted[solver] = discriminant.predict(small[test])

    peers = {} if absent else {f"scikit-learn {solver}, one fold": partial(theirs, solver) for solver in SOLVERS}
    results = measure(
        {"taxel, one fold": ours, **peers, "taxel, ten folds": ten}, rounds=1 if quick else 3, warm_up=quick
    )
    rank = LDA().fit(x[train], y[train]).rank_
    found = {
        "size": [trials, features, classes],
        "features that fire": int(np.count_nonzero(x[train].any(0))),
        "rank": rank,
        "results": results,
        "right": float(np.mean(predicted["ten"] == y)),
    }
    if not absent:
        pairs = {(how, of): (f"taxel, {how}", f"scikit-learn {of}, one fold") for how in HOW for of in SOLVERS}
        found["ratios"], found["spread"] = {}, {}
        for (how, of), pair in pairs.items():
            ratio, spread = compared(results, {"": pair})
            times, name = FOLDS if how == "ten folds" else 1, f"scikit-learn {of}, {how}"
            found["ratios"][name], found["spread"][name] = times * ratio[""], [times * one for one in spread[""]]
        found["equal predictions"] = {
            of: float(min(np.mean(own == predicted[of]) for own in (predicted["ours"], predicted["ten"][test])))
            for of in SOLVERS
        }
    return found


def full_size(share, features=5000):
    """Run figure 5.5's size once."""
    trials, classes = int(150_000 * share), 300
    x, y = rasters(trials, features, classes, 2)
    fold = folds(y, count=FOLDS, seed=1)
    wall, cpu = time.perf_counter(), time.process_time()
    predicted = fold_predictions(x, y, fold)
    return {
        "size": [trials, features, classes],
        "share": share,
        "wall_s": time.perf_counter() - wall,
        "cpu_s": time.process_time() - cpu,
        "largest_memory_gb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6,
        "right": float(np.mean(predicted == y)),
    }


def goals(result):
    """Return the goals with what a result reached."""
    names = [f"scikit-learn {of}, {how}, {name}" for how in HOW for of in SOLVERS for name in result[PARTS]]
    same = {
        f"equal predictions, {of}, {name}": one["equal predictions"][of]
        for name, one in result[PARTS].items()
        if isinstance(one.get("equal predictions"), dict)
        for of in SOLVERS
    }
    return not_slower(result, *names) + at_least(dict.fromkeys(same, 1.0), same)


def run(*, quick, share=1.0):
    """Measure; quick: small tables, one round. `share`: of the trials of figure 5.5, for a busy machine."""
    large = full_size(0.02, 500) if quick else full_size(share)
    absent = missing(PEERS)
    peers = {
        "drawn spikes": against_scikit_learn(rasters, absent, quick),
        "rasters of an array": against_scikit_learn(touches, absent, quick),
    }
    return {
        "question": __doc__.splitlines()[0],
        **stamp("scikit-learn"),
        "full size": large,
        PARTS: peers,
        "left out": absent,
        **{
            of: {f"{what}, {name}": figure for name, one in peers.items() for what, figure in one.get(of, {}).items()}
            for of in ("ratios", "spread")
        },
        "stable": all(result["stable"] for found in peers.values() for result in found["results"].values()),
    }
