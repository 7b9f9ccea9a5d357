"""The interval, the test of zero, the warnings, and the verdicts."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from taxel.information import estimate, folds, keeps, zero_test

from .channels import channel


def answers(p, trials, random):
    labels = np.repeat(np.arange(len(p)), trials)
    return labels, np.array([random.choice(len(p), p=p[label]) for label in labels])


def test_the_interval_holds_the_truth_about_as_often_as_is_said_from_a_hundred_trials_on():
    p, true = channel(3, 0.8)
    random = np.random.default_rng(7)
    held = 0
    for k in range(80):
        low, high = estimate(*answers(p, 100, random), redraws=150, seed=k).interval
        held += low <= true <= high
    assert 0.86 <= held / 80 <= 1.0  # 95 % is said; below a hundred trials a label it holds less often


@settings(deadline=None, max_examples=60)
@given(st.integers(2, 5), st.integers(2, 30), st.integers(1, 4), st.floats(0, 1), st.booleans(), st.integers(0, 999))
def test_bits_lie_within_zero_and_the_labels_entropy_and_in_their_interval(
    classes, trials, draws, right, grouped, seed
):
    random = np.random.default_rng(seed)
    labels = np.concatenate([[0, 1], random.integers(0, classes, trials)])
    said = np.where(
        random.random((draws, len(labels))) < right, labels, random.integers(0, classes, (draws, len(labels)))
    )
    groups = random.integers(0, 4, len(labels)) if grouped else None
    found = estimate(labels, said, groups=groups, redraws=20, seed=seed)
    assert 0 <= found.bits <= found.most
    assert found.bits == np.clip(found.corrected, 0, found.most)
    assert 0 <= found.interval[0] <= found.bits <= found.interval[1] <= found.most
    listed = found.to_dict()
    assert listed["interval"][0] <= listed["bits"] <= listed["interval"][1] <= listed["most"]
    assert listed["corrected"] == round(found.corrected, 4)


def test_shuffling_tells_something_from_nothing():
    random = np.random.default_rng(3)
    x = random.normal(size=(60, 4))
    labels = np.repeat([0, 1], 30)
    fold = folds(labels, count=5)

    def nearest_mean(values):
        def answer(y):
            said = np.empty(60, int)
            for k in range(5):
                means = [values[(fold != k) & (y == c)].mean(0) for c in (0, 1)]
                far = [((values[fold == k] - m) ** 2).sum(1) for m in means]
                said[fold == k] = np.argmin(far, axis=0)
            return said

        return answer

    for shift, there in ((0.0, False), (2.0, True)):
        answer = nearest_mean(x + shift * labels[:, None])
        found = estimate(labels, answer(labels)).bits
        test = zero_test(answer, labels, found, shuffles=40, seed=1)
        assert (test.p < 0.05) is there
        assert (found > test.level) is there


def test_whole_groups_are_shuffled_where_each_has_one_label():
    groups = np.repeat(np.arange(8), 5)
    labels = (groups % 2).astype(int)
    seen = []
    zero_test(lambda y: seen.append(y) or y, labels, 1.0, groups=groups, shuffles=5)
    for y in seen:
        assert all(len(set(y[groups == g])) == 1 for g in range(8))
    within = []
    mixed = np.tile([0, 1, 0, 1, 1], 8)
    zero_test(lambda y: within.append(y) or y, mixed, 1.0, groups=groups, shuffles=5)
    for y in within:
        assert all(y[groups == g].sum() == 3 for g in range(8))


def test_verdicts_are_of_the_same_trials():
    random = np.random.default_rng(5)
    labels, dear = answers(channel(4, 0.9)[0], 150, random)
    worse = np.where(random.random(len(labels)) < 0.4, random.integers(0, 4, len(labels)), dear)
    a, b, c = (estimate(labels, said, redraws=2) for said in (dear, worse, np.roll(dear, 0)))
    assert keeps(c, a).says == "keeps"
    assert keeps(b, a).says == "loses"
    near = np.where(np.arange(len(labels)) % 60 == 0, (labels + 1) % 4, dear)
    verdict = keeps(estimate(labels, near, redraws=2), a, share=0.95)
    assert verdict.says in ("keeps", "open")
    edge = np.where(np.arange(len(labels)) % 21 == 0, (labels + 1) % 4, dear)
    open_ = keeps(estimate(labels, edge, redraws=2), a, share=0.9)
    assert open_.says == "open"
    by_group = keeps(estimate(labels, edge, redraws=2), a, share=0.9, groups=np.arange(len(labels)) % 5)
    assert by_group.margin == open_.margin
    assert by_group.error != open_.error


def test_of_responses_that_tell_nothing_there_is_nothing_to_keep():
    said = []
    for seed in range(40):
        random = np.random.default_rng([11, seed])
        labels = np.repeat(np.arange(4), 20)
        a, b = (estimate(labels, random.integers(0, 4, len(labels)), redraws=2) for _ in range(2))
        groups = np.arange(len(labels)) // 4 if seed % 2 else None
        said.append(keeps(b, a, groups=groups).says)
    # The information is tested against 0 one-sided at 90 %.
    assert said.count("nothing") >= 32
    assert str(keeps(a, a)) == "nothing to keep"
    # A single group gives no estimate of the uncertainty.
    labels, dear = answers(channel(4, 0.9)[0], 50, np.random.default_rng(5))
    told = estimate(labels, dear, redraws=2)
    assert keeps(told, told, groups=np.zeros(len(labels), int)).says == "open"


def test_folds_are_even_and_groups_stay_whole():
    random = np.random.default_rng(2)
    labels = random.integers(0, 4, 203)
    fold = folds(labels, count=10, seed=4)
    assert np.ptp(np.bincount(fold)) <= 1
    assert all(np.ptp(np.bincount(fold[labels == k], minlength=10)) <= 1 for k in range(4))
    groups = random.integers(0, 23, 203)
    whole = folds(labels, count=10, groups=groups, seed=4)
    assert all(len(set(whole[groups == g])) == 1 for g in np.unique(groups))
    assert len(set(whole)) == 10
    assert np.array_equal(whole, folds(labels, count=10, groups=groups, seed=4))
