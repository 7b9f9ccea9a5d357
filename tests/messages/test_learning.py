"""What encoders, neurons, learners and metrics say that is wrong in them, or in what they are given."""

import numpy as np
import pytest
from refusal import messages

from taxel import Array, Events, Frames, Neuron, SpikeTrains, metrics
from taxel.encode import FA1, Composite, ContactArea, Encoder, LevelCrossing, LocalLoad, Moments, Peak, RunningRange
from taxel.learn import ConeR, ConeX, OnlineConeR, check_gap, check_solution

ARRAY = Array(3, 4)
TRAINS = SpikeTrains.from_lists([[5.0], [12.0]], stop=60.0)
SIGNED = SpikeTrains.from_lists([[1.0], []], stop=5.0, values=[[1.0], []])
BARE = Events([5], [0], [0], [1], array=ARRAY)
HEARD = Events([5], [0], [0], [1], array=ARRAY, intensity=[5])


PART = '{"name": "composite", "parts": {"area": {"name": "contact_area", "noise_floor": -1.0}}}'


def after(first: Events | Frames, second: Events | Frames) -> object:
    """Hear one piece after another."""
    stream = FA1().stream(ARRAY)
    stream.push(first)
    return stream.push(second)


CALLS = {
    "parameter": lambda _: FA1(alpha=0.0),
    "no number": lambda _: FA1(alpha="soon"),
    "choice": lambda _: FA1(decay="s"),
    "levels": lambda _: LevelCrossing([]),
    "release share": lambda _: LevelCrossing([-1.0, 1.0], release_share=0.7),
    "two releases": lambda _: LevelCrossing([1.0], release_by=1, release_share=1),
    "tonic level alone": lambda _: LevelCrossing([1.0], tonic_level=1.0),
    "no tonic level": lambda _: LevelCrossing([1.0], tonic_ms=5, tonic_level=2.0),
    "running range": lambda _: LevelCrossing([1.0], running_range=RunningRange(low=95, high=10)),
    "baseline beyond the range": lambda _: FA1(range=1, theta_0=1),
    "levels of an area": lambda _: ContactArea(levels=[2, 2]),
    "half a level": lambda _: ContactArea(levels=[2.5]),
    "no quantity": lambda _: Moments(area=None, total=None, peak=None, displacement_mm=None),
    "range of a quantity": lambda _: Moments(total=(5, 5)),
    "ages": lambda _: Moments(ages_ms=[1.0, 1.0001]).to_json(),
    "number of levels": lambda _: Moments(levels=1001),
    "local and slow": lambda _: LocalLoad(local_ms=(50, 0)),
    "levels of a load": lambda _: LocalLoad(levels=(0, 4)),
    "no part": lambda _: Composite({}),
    "name of a part": lambda _: Composite({" ": FA1()}),
    "part in a part": lambda _: Composite({"a": Composite({"b": FA1()})}),
    "parameter of a part": lambda _: Encoder.from_json(PART),
    "part that is not there": lambda _: Composite({"a": FA1()}).only(["b"]),
    "part twice": lambda _: Composite({"a": FA1()}).only(["a", "a"]),
    "taxels": lambda _: FA1().stream(ARRAY).push(Events([5], [0], [0], [1], array=Array(4, 3), intensity=[5])),
    "parameter of another": lambda _: Encoder.from_json('{"name": "fa1", "tau": 5}'),
    "no levels": lambda _: Encoder.from_json('{"name": "level_crossing"}'),
    "no JSON": lambda _: Encoder.from_json("{"),
    "time of a stream": lambda _: FA1().stream().advance(2**62),
    "another tare": lambda _: FA1().with_tare(5),
    "levels that fall": lambda _: Peak(levels=(2.0, 1.0)),
    "whole us": lambda _: LevelCrossing([1.0], period_ms=0.0005),
    "unknown parameter": lambda _: FA1().set_params(wings=2),
    "no encoder": lambda _: Encoder.from_json("{}"),
    "unknown encoder": lambda _: Encoder.from_json('{"name": "sa3"}'),
    "no tare": lambda _: ContactArea().encode(HEARD),
    "no tare of a part": lambda _: Composite({"a": ContactArea()}).encode(HEARD),
    "without intensities": lambda _: FA1().encode(BARE),
    "frames after events": lambda _: after(HEARD, Frames(np.zeros((1, 3, 4)), [10], array=ARRAY)),
    "another array": lambda _: FA1().stream(ARRAY).push(Frames(np.zeros((1, 4, 4)), [0])),
    "tau": lambda _: Neuron(tau=-1.0),
    "after a spike": lambda _: Neuron(after_spike="forget"),
    "refractory": lambda _: Neuron(refractory=0.0),
    "kernel": lambda _: Neuron(kernel="exponential", time="continuous"),
    "weights": lambda _: Neuron().run([1.0], TRAINS),
    "times that fall": lambda _: Neuron().potential([1.0, 1.0], TRAINS, [2.0, 1.0]),
    "spikes that fall": lambda _: Neuron().potential([1.0, 1.0], TRAINS, [1.0], spikes=[5.0, 3.0]),
    "a weight too few for each": lambda _: Neuron().run_many([[1.0, 2.0, 3.0]], TRAINS),
    "no weight for each": lambda _: Neuron().run_many([[1.0, 2.0], [1.0, np.nan]], TRAINS),
    "infinite weight": lambda _: Neuron().run([np.inf, 1.0], TRAINS),
    "signed": lambda _: Neuron().run([1.0, 1.0], SIGNED),
    "threshold": lambda _: Neuron().run([1.0, 1.0], TRAINS, threshold=0),
    "not fitted": lambda _: ConeX().predict([TRAINS]),
    "not fitted, checked": lambda _: check_solution(ConeX(), [TRAINS], [[20.0]]),
    "kappa": lambda _: ConeX(kappa=0.0).fit([TRAINS], [[20.0]]),
    "bounds": lambda _: ConeR(lb=1.0, ub=0.0).fit([TRAINS], [[20.0]]),
    "bounds of some trains": lambda _: ConeR(lb=[-1.0, 0.6], ub=0.5),
    "numbers of bounds": lambda _: ConeR(lb=[-1.0], ub=[1.0, 1.0]),
    "bounds of trains": lambda _: ConeR(ub=[1.0]).fit([TRAINS], [[20.0]]),
    "no patterns": lambda _: ConeX().fit([], []),
    "targets": lambda _: ConeX().fit([TRAINS], []),
    "trains of patterns": lambda _: ConeX().fit([TRAINS, TRAINS.select([0])], [[20.0], [20.0]]),
    "no target": lambda _: ConeX().fit([TRAINS], [[np.nan]]),
    "target behind the horizon": lambda _: ConeX(horizon=10.0).fit([TRAINS], [[20.0]]),
    "horizons": lambda _: ConeX(horizon=[90.0, 90.0]).fit([TRAINS], [[20.0]]),
    "slope on a grid": lambda _: ConeX(neuron=Neuron(time="grid"), slope=0.1).fit([TRAINS], [[20.0]]),
    "lambdas": lambda _: ConeX(lambdas=(1, 2)),
    "lambdas of 0": lambda _: ConeR(lambdas=(0, 0, 0, 0, 0)),
    "norm": lambda _: ConeX(norm=2),
    "late target": lambda _: ConeX().fit([TRAINS], [[70.0]]),
    "targets that fall": lambda _: ConeX().fit([TRAINS], [[30.0, 20.0]]),
    "refractory targets": lambda _: ConeX().fit([TRAINS], [[20.0, 20.5]]),
    "no spike": lambda _: ConeX().fit([SpikeTrains.from_lists([[]], stop=60.0)], [[20.0]]),
    "grid": lambda _: ConeR(neuron=Neuron(time="grid", step_ms=1e-9)).fit([TRAINS], [[20.0]]),
    "silence": lambda _: ConeR().fit([TRAINS], [[20.0]], silence=[[(9.0, 3.0)]]),
    "start of another size": lambda _: ConeR().fit([TRAINS], [[20.0]], start=[1.0, 2.0, 3.0]),
    "horizon before a target": lambda _: ConeR(horizon=10.0).fit([TRAINS], [[20.0]]),
    "negative spikes": lambda _: ConeR().fit([SIGNED], [[3.0]]),
    "start": lambda _: ConeR().fit([TRAINS], [[20.0]], start=ConeR()),
    "window": lambda _: OnlineConeR(window=0),
    "no learner": lambda _: check_gap(Neuron(), [TRAINS], [[20.0]]),
    "metric": lambda _: metrics.pairwise("nonsense", [TRAINS]),
    "parameter of a metric": lambda _: metrics.van_rossum([1.0], [2.0], tau=0.0),
    "parameter left out": lambda _: metrics.pairwise("van_rossum", [TRAINS]),
    "order of spikes": lambda _: metrics.van_rossum([2.0, 1.0], [], tau=1.0),
    "trains of each": lambda _: metrics.pairwise("van_rossum", [TRAINS, TRAINS.select([0])], tau=1.0),
    "graded": lambda _: metrics.van_rossum(
        SpikeTrains.from_lists([[1.0]], values=[[2.0]], kind="graded"), TRAINS.select([0]), tau=1.0
    ),
}


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_messages(tmp_path, snapshot):
    assert messages(CALLS, tmp_path) == snapshot
