"""Drops on the emulated board: the cut against the board's own events, the quick distances against taxel.metrics."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from taxel import Array, SpikeTrains
from taxel.metrics import pairwise
from taxel.spikes import to_ms
from taxel.wire import FRAME_US
from taxel_studies import dropped, fig4_9, fig5_11, foam, load
from taxel_studies.dropped import FRAMES, REGION, Condition
from taxel_studies.runner import Kept

FEW, TENNIS_FEW = {**dropped.TABLE, "drops": 4, "seed": 1}, {**dropped.TENNIS_TABLE, "drops": 3, "seed": 1}
SIDE, PERIOD_MS = 4, 0.5


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return Kept(tmp_path_factory.mktemp("drops"), "0123abc")


@pytest.fixture(scope="module")
def fallen(folder):
    return dropped.played(FEW, Condition(50.0, 100.0, 0.0), folder)


def patterns(seed=1, count=7, samples=12, layers=2):
    """Return random patterns, as an array of spikes and as trains of spikes at the samples' times."""
    spikes = (np.random.default_rng(seed).random((count, samples, layers, SIDE * SIDE)) < 0.06).astype(np.uint8)
    spikes[0] = 0
    trains = []
    for one in spikes:
        times = [PERIOD_MS * np.flatnonzero(one[:, layer, n]) for layer in range(layers) for n in range(SIDE * SIDE)]
        trains.append(SpikeTrains.from_lists(times, start=0.0, stop=samples * PERIOD_MS))
    return spikes, trains


@pytest.mark.parametrize(("tau", "sigma"), [(0.1, 1.0), (0.4, 2.0), (2.0, 5.0)])
def test_inner_products_give_the_distances_of_metrics(tau, sigma):
    spikes, trains = patterns()
    array = Array(SIDE, SIDE, pitch_mm=2.67)
    kernel = dropped.smoothed(SIDE, array.pitch_mm, sigma)
    gram = dropped.spatial_grams(spikes, PERIOD_MS, tau, [kernel], [spikes.shape[1]])[0][0]
    wanted = pairwise("van_rossum_spatial", trains, array=array, tau=tau, sigma=sigma, normalisation="none")
    np.testing.assert_allclose(dropped.distances_of(gram), wanted, atol=2e-3 * wanted.max())


def test_at_every_frame_the_events_are_the_boards(fallen):
    """The encoder on the readings that the host holds gives the events that the board sent, one by one."""
    assert fallen.ticks.shape == (4, 1 + FRAMES, REGION * REGION)
    spikes = dropped.sampled(fallen.ticks, to_ms(FRAME_US), np.zeros(4))
    np.testing.assert_array_equal(spikes.sum((1, 2, 3)), fallen.events)
    moved = np.diff(fallen.ticks.astype(int), axis=1)
    np.testing.assert_array_equal(spikes[:, :FRAMES, 0], (moved > 0)[:, : spikes.shape[1]])
    assert (np.abs(moved[moved != 0]) > dropped.NOISE_FLOOR).all()
    assert (fallen.lasted_us < 50_000).all()
    assert (fallen.lasted_us > 15_000).all()  # an impact on this foam lasts that long


def test_a_ball_glances_off_along_the_rows_of_a_tilted_array_and_off_a_level_one_straight_up(folder, fallen):
    """By some 19 mm, 7 taxels, in a contact of 27 ms: friction leaves five sevenths of 1 m/s."""
    slanted = dropped.played(FEW, Condition(50.0, 200.0, 30.0), folder)
    column, row = np.arange(REGION * REGION) % REGION, np.arange(REGION * REGION) // REGION

    def moved(drops, places):
        above = drops.ticks.astype(float) - drops.ticks[:, :1]
        early, late = (above[:, frames].sum(1) for frames in (slice(5, 25), slice(100, 130)))
        return [np.average(places, weights=b) - np.average(places, weights=a) for a, b in zip(early, late, strict=True)]

    assert min(moved(slanted, column)) > 1.5
    assert max(np.abs(moved(slanted, row))) < 0.7
    assert max(np.abs(moved(fallen, column))) < 0.7


def test_norms_summed_over_trains_are_those_of_one_train_each():
    spikes, _ = patterns(layers=1)
    kernel = dropped.smoothed(SIDE, 2.67, 2.0)
    one_by_one = [
        dropped.distances_of(
            dropped.spatial_grams(spikes, PERIOD_MS, 0.4, [kernel * (np.arange(SIDE**2) == n)], [12])[0][0]
        )
        for n in range(SIDE**2)
    ]
    found, _ = dropped.as_printed(spikes, PERIOD_MS, 0.4, kernel)
    # Inner products there are in ms; the factor tau / 2 is left out here.
    np.testing.assert_allclose(found, np.sum(one_by_one, axis=0) / np.sqrt(0.2), atol=1e-2 * found.max())


def test_a_sum_over_time_is_the_integral_of_what_is_apart():
    spikes, _ = patterns(layers=1)
    kernel, step = dropped.smoothed(SIDE, 2.67, 2.0), PERIOD_MS / 200
    trains = np.zeros((len(spikes), spikes.shape[1] * 200 + 2000, SIDE**2))
    trains[:, : spikes.shape[1] * 200 : 200] = spikes[:, :, 0]
    decay = np.exp(-step / 0.4)
    for k in range(1, trains.shape[1]):
        trains[:, k] += decay * trains[:, k - 1]
    smooth = trains @ kernel
    apart = [[step * np.abs(a - b).sum() for b in smooth[:5]] for a in smooth[:5]]
    _, found = dropped.as_printed(spikes, PERIOD_MS, 0.4, kernel)
    np.testing.assert_allclose(found[:5, :5], apart, rtol=0.02)


def test_search_first_then_a_look_at_the_best_pair_of_all_periods_and_of_each(tmp_path):
    p = load("fig5.11").set("toy")
    tasks = fig5_11.tasks(p)
    assert [t.params.get("tau_ms") for t in tasks] == [0.4, 1.0, 0.4, 1.0, None, None]
    kept = Kept(tmp_path, "0123abc")
    found = [fig5_11.realise(task.params, task.seed, kept) for task in tasks[-2:]]
    bits = [{tau: at for tau, _, at in one["searched"]} for one in found]
    most = max(max(one.values()) for one in bits)
    for one, known in zip(found, bits, strict=True):
        assert list(known) == [0.4, 1.0]
        own, shared = one["looks"][fig5_11.EACH], one["looks"][fig5_11.ONE]
        assert own["bits"] == known[own["tau_ms"]] == max(known.values())
        assert shared["bits"] == known[shared["tau_ms"]]
    assert any(known[one["looks"][fig5_11.ONE]["tau_ms"]] == most for one, known in zip(found, bits, strict=True))


def test_own_neighbours_are_those_of_scikit_learn():
    from sklearn.neighbors import NearestNeighbors

    rng = np.random.default_rng(3)
    y = np.repeat([0, 1, 2], 20)
    places = rng.normal(size=(60, 2)) + 1.5 * y[:, None]
    near = NearestNeighbors(n_neighbors=fig4_9.NEIGHBOURS).fit(places).kneighbors(return_distance=False)
    assert fig4_9.own_neighbours(places, y) == pytest.approx(np.mean(y[near] == y[:, None]))


def test_drops_fall_on_the_foam_that_the_kept_search_found():
    file = Path(__file__).parents[2] / "benchmarks" / "results" / "figures" / "foam.json"
    best = json.loads(file.read_text())["said"]["lines"][0]
    assert {name: best[name] for name in dropped.FOAM} == dropped.FOAM
    assert best["ball_n_mm"] == dropped.TENNIS_N_MM
    assert foam.residuals(best) == best["residuals"]
