"""The registry of metrics: each has its file in every place, its defaults are the core's, and the laws run over all."""

import inspect
from pathlib import Path

import numpy as np
import pytest
from refusal import refused

from taxel import Array, SpikeTrains, _core, metrics
from taxel._base.parameters import described

ROOT = Path(__file__).parents[2]
NAMES = _core.metric_names()
ARRAY = Array(2, 2, pitch_mm=2.0)
#: Metrics with required parameters.
GIVEN = {"q": 0.2, "tau": 3.0, "array": ARRAY}
each_metric = pytest.mark.parametrize("name", NAMES)
#: Modules of the package that are not metrics.
OTHERS = {"matching", "pairwise"}


def given(name):
    return {key: GIVEN[key] for key in described(name)["required"]}


def patterns(seed, shift=0.0):
    """Three patterns of four trains, some empty, within a window of their own."""
    random = np.random.default_rng(seed)
    drawn = [[np.sort(random.uniform(0, 50, random.integers(0, 5))) for _ in range(4)] for _ in range(3)]
    return [SpikeTrains.from_lists([t + shift for t in one], start=shift, stop=50.0 + shift) for one in drawn]


def test_a_metric_has_a_file_in_each_place_and_nothing_is_left_out():
    python = {f.stem for f in (ROOT / "python/taxel/metrics").glob("*.py") if not f.stem.startswith("_")}
    assert python - OTHERS == set(NAMES), "python/taxel/metrics/NAME.py, a line in crates/taxel-core/src/metrics.rs"
    for name in NAMES:
        assert (ROOT / f"crates/taxel-core/src/metrics/{name}.rs").exists(), f"metrics/{name}.rs in taxel-core"
        assert name in metrics.__all__, "a line in python/taxel/metrics/__init__.py"


@each_metric
def test_its_function_shows_the_core_s_parameters_and_defaults(name):
    known = described(name)
    shown = {
        p.name: p.default
        for p in inspect.signature(getattr(metrics, name)).parameters.values()
        if p.kind is inspect.Parameter.KEYWORD_ONLY
    }
    assert set(shown) == {*known["defaults"], *known["required"]}
    for key, default in known["defaults"].items():
        assert shown[key] == default, key
    for key in known["required"]:
        assert shown[key] is inspect.Parameter.empty
    text = inspect.getdoc(getattr(metrics, name))
    for key, rules in known["ranges"].items():
        assert f"{key} : float" in text, key
        if rules["must_be"] != "finite":
            line = next(line for line in text.splitlines() if line.startswith(f"{key} : "))
            assert rules["must_be"].removesuffix(" and finite") in line


@each_metric
def test_the_same_either_way_and_0_of_itself(name):
    some, others, value = patterns(1), patterns(3)[:2], getattr(metrics, name)
    matrix = metrics.pairwise(name, some, **given(name))
    assert np.allclose(matrix, matrix.T)
    assert not np.diag(matrix).any()
    assert (matrix >= 0).all()
    assert matrix.any()
    across = metrics.pairwise(name, some, others, **given(name))
    for found, of in ((matrix, some), (across, others)):
        each = [[value(a, b, **given(name)) for b in of] for a in some]
        np.testing.assert_allclose(found, each, rtol=1e-9, atol=1e-12)


@each_metric
def test_moved_in_time_it_is_the_same(name):
    here = metrics.pairwise(name, patterns(2), **given(name))
    for shift, rounding in ((1000.0, 1e-9), (1e9, 1e-4)):
        there = metrics.pairwise(name, patterns(2, shift), **given(name))
        assert there == pytest.approx(here, rel=1e-6, abs=rounding)


@each_metric
def test_graded_trains_are_refused_by_name(name):
    plain = patterns(1)
    graded = [SpikeTrains(p.times, p.offsets, p.start, p.stop, np.ones(len(p.times)), kind="graded") for p in plain]
    for call in (
        lambda: getattr(metrics, name)(graded[0], plain[0], **given(name)),
        lambda: getattr(metrics, name)(plain[0], graded[0], **given(name)),
        lambda: metrics.pairwise(name, graded, **given(name)),
        lambda: metrics.pairwise(name, plain, graded, **given(name)),
        lambda: metrics.pairwise(name, graded[0], **given(name)),
    ):
        with refused():
            call()
