"""Discriminants against scikit-learn's, from features and from sums by fold."""

import numpy as np
import pytest
from sklearn.discriminant_analysis import LinearDiscriminantAnalysis
from sklearn.neighbors import KNeighborsClassifier

from taxel.information import folds
from taxel_studies.discriminants import LDA, FoldSums
from taxel_studies.dropped import distances_of, named_by_neighbours


def clouds(trials, features, classes, seed, apart=1.0):
    random = np.random.default_rng(seed)
    y = random.integers(0, classes, trials)
    y[:classes] = np.arange(classes)
    y[classes : 2 * classes] = np.arange(classes)
    x = random.normal(size=(classes, features))[y] * apart + random.normal(size=(trials, features))
    return x @ (np.eye(features) + 0.3 * random.normal(size=(features, features))), y


def apart(ours, theirs):
    """How far two discriminants differ, but for what is common to all classes."""
    d = ours - theirs
    return np.abs(d - d[:, :1]).max()


@pytest.mark.parametrize(("trials", "features", "classes"), [(400, 30, 5), (60, 10, 3), (50, 200, 4), (31, 30, 3)])
def test_discriminants_are_scikit_learns_svd(trials, features, classes):
    x, y = clouds(trials, features, classes, 1)
    new = clouds(100, features, classes, 2)[0]
    ours, theirs = LDA().fit(x, y), LinearDiscriminantAnalysis(solver="svd").fit(x, y)
    assert apart(ours.decision_function(new), theirs.decision_function(new)) < 1e-5
    assert np.array_equal(ours.predict(new), theirs.predict(new))


@pytest.mark.parametrize("ridge", [0.01, 0.5, 20.0])
def test_a_ridge_is_scikit_learns_shrinkage(ridge):
    for trials, features in ((90, 12), (60, 300)):
        x, _ = clouds(trials, features, 3, 5)
        y = np.arange(trials) % 3  # equally many: shrinkage scales discriminants against priors
        x += np.eye(3, features)[y]
        new = clouds(40, features, 3, 6)[0]
        theirs = LinearDiscriminantAnalysis(solver="lsqr", shrinkage=ridge / (1 + ridge)).fit(x, y).predict(new)
        ours = LDA(ridge=ridge).fit(x, y)
        assert np.array_equal(ours.predict(new), theirs)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize(("noise", "within"), [(None, 1e-9), (8e-4, 5e-3)])
def test_directions_in_which_no_class_varies_are_left_out_as_by_scikit_learn(seed, noise, within):
    """Of spikes, their sums, and of features that tell each other but for the class; by pivots, or by eigenvectors
    where a feature is neither clearly told nor clearly not: there rounding grows by the noise's fourth power, and is
    the processor's (3e-4 at the worst of 100 seeds on one)."""
    random = np.random.default_rng(seed)
    y = np.arange(600) % 5
    spikes = random.random((600, 14)) < random.uniform(0.1, 0.5, (5, 14))[y]
    x = spikes * random.choice([1.0, -1.0, 40.0], 14)
    x = np.column_stack([x, x[:, :3] @ random.normal(size=(3, 4)), x[:, 3] - x[:, 4], x[:, 5] + 2.0 * y, y == 2])
    if noise is not None:
        x = np.column_stack([x, x[:, 0] + noise * x[:, 0].std() * random.normal(size=600)])
    ours = LDA().fit(x, y)
    assert ours.rank_ < x.shape[1]
    # Their cut is of the singular value, ours of its square.
    theirs = LinearDiscriminantAnalysis(tol=1e-5).fit(x, y)
    new = x + random.normal(size=x.shape)
    expected = theirs.decision_function(new)
    assert apart(ours.decision_function(new), expected) < within * np.abs(expected).max()
    assert np.array_equal(ours.predict(x), theirs.predict(x))


@pytest.mark.parametrize("dtype", [np.int8, np.float64])
def test_folds_from_sums_are_folds_trained_one_by_one(dtype, tmp_path):
    random = np.random.default_rng(8)
    y = random.integers(0, 6, 700)
    x = (random.random((700, 50)) < 0.1).astype(np.int8) - (random.random((700, 50)) < 0.1)
    x[:, :6] |= (y[:, None] == np.arange(6)) & (random.random((700, 6)) < 0.5)
    x[:, 49] = 0
    x = x.astype(dtype)
    fold = folds(y, count=7, seed=1)
    expected = np.empty_like(y)
    for k in range(7):
        model = LinearDiscriminantAnalysis().fit(x[fold != k].astype(float), y[fold != k])
        expected[fold == k] = model.predict(x[fold == k].astype(float))
    assert np.array_equal(FoldSums(x, y, fold).predictions(), expected)
    np.save(tmp_path / "x.npy", x)
    assert np.array_equal(FoldSums(np.load(tmp_path / "x.npy", mmap_mode="r"), y, fold).predictions(), expected)


@pytest.mark.parametrize("dtype", [np.int8, np.float64])
def test_one_set_of_sums_answers_for_coarser_labels_and_for_the_first_features(dtype):
    random = np.random.default_rng(9)
    y = random.integers(0, 6, 600)
    x = (random.random((600, 30)) < 0.1 + 0.1 * (np.arange(30) % 6 == y[:, None])).astype(dtype)
    fold = folds(y, count=5, seed=1)
    sums = FoldSums(x, y, fold)
    parity = {k: "even" if k % 2 == 0 else "odd" for k in range(6)}
    merged = [parity[k] for k in y.tolist()]
    assert np.array_equal(sums.predictions(merge=parity), FoldSums(x, merged, fold).predictions())
    assert np.array_equal(sums.predictions(features=12), FoldSums(x[:, :12], y, fold).predictions())
    both = sums.predictions(merge=parity, features=12)
    assert np.array_equal(both, FoldSums(x[:, :12], merged, fold).predictions())


def test_neighbours_are_scikit_learns():
    x, y = clouds(80, 4, 3, 12)
    own = distances_of(x @ x.T)
    assert np.allclose(own, np.sqrt(((x[:, None] - x) ** 2).sum(-1)), atol=1e-6)
    apart = own + np.where(np.eye(80) > 0, np.inf, 0)
    for k in (1, 3):
        ours = named_by_neighbours(own, y, k)
        # Scikit-learn leaves a pattern out of its own neighbours where it is fitted and not told the others.
        near = KNeighborsClassifier(k).fit(x, y).kneighbors(return_distance=False)
        votes = np.array([np.bincount(y[row], minlength=3) for row in near])
        ranked = np.sort(votes, axis=1)
        clear = ranked[:, -1] > ranked[:, -2]
        assert np.array_equal(ours[clear], votes.argmax(1)[clear])
        assert np.array_equal(ours[~clear], y[np.argmin(apart, axis=1)][~clear])
