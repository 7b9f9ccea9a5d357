"""What is computed together is what the plain way gives: every fold trained anew, every table counted alone."""

from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import beta

import taxel
from taxel.encode import ChangeEvents
from taxel.information import (
    LabelledTrial,
    answer,
    estimate,
    folds,
    nested_predictions,
    panzeri_treves,
    plug_in,
)
from taxel.information.sampling import HeldValues, contacts, spikes_of
from taxel.information.wire_rate import kilobits_per_second

from .touches import ordered

RIDGES = (10.0, 1.0, 0.1)


def level(x, ridge):
    """Return a ridge in the unit of squares: of the mean variance over features and trials."""
    return ridge * ((x - x.mean(0)) ** 2).sum() / x.shape[1]


def discriminant(x, y, new, ridge):
    """Classify by a covariance within classes with a ridge on its diagonal."""
    classes = np.unique(y)
    means = np.array([x[y == k].mean(0) for k in classes])
    within = ridge * np.eye(x.shape[1])
    for row, label in zip(x, y, strict=True):
        apart = row - means[np.searchsorted(classes, label)]
        within += np.outer(apart, apart)
    weights = np.linalg.solve(within / len(y), means.T)
    prior = np.log([np.mean(y == k) for k in classes])
    return classes[(new @ weights - (means * weights.T).sum(1) / 2 + prior).argmax(1)]


def nested(tables, y, ways, *, groups, seed):
    """Choose among ways (table, classifier) in folds of each training set, by training anew each time."""
    fold = folds(y, count=10, groups=groups, seed=seed)
    said, chosen = np.empty_like(y), {}
    for name in range(fold.max() + 1):
        train, test = np.flatnonzero(fold != name), np.flatnonzero(fold == name)
        inner = folds(y[train], count=5, groups=None if groups is None else groups[train], seed=seed + 1)
        right = []
        for table, classify in ways:
            x = tables[table]
            right.append(0)
            for part in range(inner.max() + 1):
                fit, held = train[inner != part], train[inner == part]
                right[-1] += int((classify(x[fit], y[fit], x[held]) == y[held]).sum())
        chosen[name] = int(np.argmax(right))
        table, classify = ways[chosen[name]]
        said[test] = classify(tables[table][train], y[train], tables[table][test])
    return said, chosen


def cloud(trials, features, classes, seed):
    random = np.random.default_rng(seed)
    y = random.permutation(np.arange(trials) % classes)
    far = random.normal(size=(classes, features))[y] * (6 / features) ** 0.5
    return [far * apart + random.normal(size=(trials, features)) for apart in (0.4, 0.7)], y


@settings(deadline=None, max_examples=12)
@given(st.integers(40, 70), st.sampled_from([6, 90]), st.integers(2, 4), st.booleans(), st.integers(0, 9))
def test_nested_predictions_are_those_of_every_fold_trained_anew(trials, features, classes, grouped, seed):
    """Also of more features than trials."""
    tables, y = cloud(trials, features, classes, seed)
    groups = np.random.default_rng(seed).integers(0, 11, trials) if grouped else None
    if grouped and any(len(np.unique(groups[y == k])) < 8 for k in range(classes)):
        return
    grams, features = [x @ x.T for x in tables], [x.shape[1] for x in tables]
    found = nested_predictions(grams, features, y, groups=groups, seed=seed)
    ways = [(k, partial(discriminant, ridge=level(tables[k], ridge))) for k in range(2) for ridge in RIDGES]
    said, chosen = nested(tables, y, ways, groups=groups, seed=seed)
    assert found.chosen == {name: (way // 3, RIDGES[way % 3]) for name, way in chosen.items()}
    assert np.array_equal(found.responses, said)


def table_of(row, column, classes):
    table = np.zeros((classes, classes), int)
    for a, b in zip(row, column, strict=True):
        table[a, b] += 1
    return table


def entropy(p):
    return -sum(share * np.log2(share) for share in np.ravel(p) if share > 0)


def fano(prior, wrong, trials, confidence):
    """Return what an upper share of errors (Clopper and Pearson) costs, errors even over the other labels."""
    share = beta.ppf((1 + confidence) / 2, wrong + 1, trials - wrong)
    joint = np.array([[p * (1 - share if a == b else share / (len(prior) - 1)) for b in range(len(prior))]
                      for a, p in enumerate(prior)])  # fmt: skip
    return entropy(prior) - (entropy(prior) + entropy(joint.sum(0)) - entropy(joint))


@settings(deadline=None, max_examples=25)
@given(
    st.integers(2, 4), st.integers(8, 40), st.integers(1, 3), st.sampled_from([0.2, 0.7, 0.97, 1.0]), st.integers(0, 99)
)
def test_an_estimate_is_that_of_tables_counted_one_by_one(classes, trials, draws, right, seed):
    random = np.random.default_rng(seed)
    row = np.arange(trials) % classes
    said = np.where(random.random((draws, trials)) < right, row, random.integers(0, classes, (draws, trials)))
    found = estimate(row, said, redraws=30, seed=seed)
    tables = [table_of(row, one, classes) for one in said]
    assert found.counts.tolist() == [table.tolist() for table in tables]
    assert found.plug_in == pytest.approx(np.mean([plug_in(table) for table in tables]), abs=1e-9)
    if draws == 1:
        assert found.bits == panzeri_treves(tables[0])
        redraw, redrawn = np.random.default_rng(seed), []
        members = [np.flatnonzero(row == k) for k in range(classes)]
        drawn = [redraw.multinomial(len(mine), np.full(len(mine), 1 / len(mine)), size=30) for mine in members]
        for k in range(30):
            again = np.concatenate([np.repeat(mine, one[k]) for mine, one in zip(members, drawn, strict=True)])
            redrawn.append(float(panzeri_treves(table_of(row[again], said[0][again], classes))))
        low, high = np.quantile(redrawn, [0.025, 0.975]) - np.mean(redrawn)
        # A response stands for the label that most of its trials have.
        wrong = int((tables[0].argmax(0)[said[0]] != row).sum())
        if wrong <= classes:
            prior = np.bincount(row) / trials
            low = min(low, found.most - found.bits - fano(prior, wrong, trials, 0.95))
        assert found.interval[0] == pytest.approx(max(0, found.bits + min(low, 0)), abs=1e-9)
        assert found.interval[1] == pytest.approx(min(found.most, found.bits + max(high, 0)), abs=1e-9)


def trials_of(count):
    events, rows = ordered(count)
    return [LabelledTrial(events, label, start) for start, label in rows]


def test_rates_are_those_of_loops():
    random = np.random.default_rng(3)
    values = np.cumsum(random.integers(-9, 10, (40, 4, 5)), 0).astype(np.float32)
    frames = taxel.Frames(values, 1000 * np.arange(40), array=taxel.Array(4, 5))
    encoder = ChangeEvents(noise_floor=2.0)
    trials, held = [LabelledTrial(frames, "a", start, 39_000) for start in (1000, 3000)], [HeldValues(frames)] * 2
    at = contacts(trials, held, encoder, 1000, 30_000.0)
    drawn = np.random.default_rng(0)
    found = spikes_of(trials, held, encoder, random=drawn, period_us=2000, contact_us=at, window_us=30_000.0)
    sent = 0
    for trial, bins in enumerate(found.bins_to(30_000.0)):
        at_once = [int(((found.trial == trial) & (found.bin == b)).sum()) for b in range(bins)]
        sent += sum(16 * n + 192 * -(-2 * n // 1376) for n in at_once)
    assert kilobits_per_second(found, 30_000.0, values=False) == pytest.approx(sent / 60.0)


def test_shuffled_labels_are_answered_as_labels_of_their_own():
    """The labels' settings and the shuffled labels share matrices: of another question they are the same."""
    trials = trials_of(40)
    asked = {"window_ms": 20, "windows_ms": [5], "periods_ms": [1, 10], "taxels": [1], "draws": 2}
    found = answer(trials, shuffles=4, **asked)
    other = answer(trials, shuffles=2, **asked)
    assert found.zero.shuffled[:2] == other.zero.shuffled
    for ours, theirs in zip((*found.points, *found.taxels), (*other.points, *other.taxels), strict=True):
        assert ours.to_dict() == theirs.to_dict()
