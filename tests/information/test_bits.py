"""Estimators against channels whose information is known."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sklearn.metrics import confusion_matrix as peer_matrix
from sklearn.metrics import mutual_info_score

from taxel.information import (
    confusion_matrix,
    local_information,
    panzeri_treves,
    plug_in,
)

from .channels import channel

TABLES = st.integers(2, 5).flatmap(
    lambda k: st.lists(st.lists(st.integers(0, 30), min_size=k, max_size=k), min_size=2, max_size=5)
)


def draws(p, trials, seed, count=1):
    random = np.random.default_rng(seed)
    return np.array([[random.multinomial(trials, row) for row in p] for _ in range(count)])


@given(TABLES)
def test_as_counted_it_is_scikit_learns(rows):
    table = np.array(rows)
    if not table.sum():
        return
    labels, responses = (np.repeat(index, table.ravel()) for index in np.indices(table.shape).reshape(2, -1))
    assert plug_in(table) == pytest.approx(mutual_info_score(labels, responses) / np.log(2), abs=1e-9)
    local = local_information(table)
    assert (local * table).sum() / table.sum() == pytest.approx(float(plug_in(table)), abs=1e-9)


@pytest.mark.parametrize(
    ("classes", "trials", "right", "near", "counted", "corrected"),
    [  # errors in bits, from other code and seeds: 300 labels x 500 trials once, 18 x 100 the mean of many
        (300, 500, 0.9, False, 0.275, 0.090),
        (300, 500, 0.3, False, 0.503, 0.073),
        (300, 500, 0.6, True, 0.005, 0.001),
        (18, 100, 0.9, False, 0.112, -0.001),
    ],
)
def test_known_channels_before_and_after_the_correction(classes, trials, right, near, counted, corrected):
    p, true = channel(classes, right, near)
    tables = draws(p, trials, 11, 1 if classes == 300 else 60)
    found = {
        "counted": np.mean(plug_in(tables)),
        "corrected": np.mean(panzeri_treves(tables)),
    }
    # What a correction takes off does not depend on the draw; a table of 18 x 100 alone is off by some .03 either way.
    assert found["counted"] - found["corrected"] == pytest.approx(counted - corrected, abs=0.02)
    assert found["counted"] - true == pytest.approx(counted, abs=0.02 if classes == 300 else 0.06)
    assert abs(found["corrected"] - true) < 0.1


def test_the_matrix_is_scikit_learns():
    random = np.random.default_rng(1)
    names = np.array(["heel", "toe", "ball"])
    truth, said = names[random.integers(0, 3, 50)], names[random.integers(0, 3, 50)]
    counts, classes = confusion_matrix(truth, said)
    assert np.array_equal(counts, peer_matrix(truth, said))
    assert classes.tolist() == sorted(names)
    turned, order = confusion_matrix(truth, said, names)
    assert order.tolist() == names.tolist()
    assert np.array_equal(turned, peer_matrix(truth, said, labels=names))
