"""How many detections have an input outside the range that it had in training: whole, in pieces, saved, old files."""

import json
from pathlib import Path

import numpy as np
from plain_rules import tare
from shell import call

import taxel
from taxel import Array, Events, Readout, SpikeTrains
from taxel.detect import Example, Recipe, fit, load
from taxel.detect.readout import run_counting
from taxel.detect.seen import seen
from taxel.encode import ContactArea

ARRAY = Array(12, 12)
RECIPE = Recipe(
    ContactArea(levels=[2, 9, 25]),
    {"tau": 0.5, "refractory": 15.0, "after_spike": "reset", "lb": 0.0, "ub": 3.0, "delay_ms": 0.1, "step_ms": 0.1},
    {"on": {}},
    align=True,
)


def touches(sides) -> Example:
    """Touches of squares of these sides, one after the other, loaded for 20 ms."""
    rows, starts = [], 20_000 + 60_000 * np.arange(len(sides))
    for start, side in zip(starts, sides, strict=True):
        for t, value in ((start, 20), (start + 20_000, 0)):
            rows += [(t, 1 + k % side, 1 + k // side, value) for k in range(side * side)]
    t, x, y, ticks = np.array(rows).T
    events = Events(t, x, y, ticks > 0, array=ARRAY, intensity=ticks)
    return Example(events, {"on": starts}, tare(ARRAY, 0.0))


def test_detections_of_touches_unlike_those_of_training_are_counted(tmp_path: Path, capsys) -> None:
    trained, unseen = touches([2, 3, 4, 3, 2, 4]), touches([3, 5, 2, 6, 4])
    readout = fit([trained], RECIPE, by_rule=())
    for one, outside in ((trained, 0), (unseen, 2)):
        found, counted = run_counting(readout, one.source, tare=one.tare)
        assert np.abs(found.t - one.labels["on"]).max() <= 200
        assert counted == outside, "touches of 25 taxels and more reach a level that training never did"
    stream = readout.stream(ARRAY, tare=unseen.tare)
    for k in range(0, len(unseen.source), 7):
        stream.push(unseen.source[k : k + 7])
    stream.advance(int(unseen.source.t[-1]) + 100_000)
    assert stream.outside == 2
    again = load(readout.save(tmp_path / "r.json"))
    assert again == readout
    older = json.loads(readout.to_json())
    del older["seen"]
    assert run_counting(Readout.from_json(json.dumps(older)), unseen.source, tare=unseen.tare)[1] is None
    # The command and its report.
    (tmp_path / "old.json").write_text(json.dumps(older))
    taxel.convert(unseen.source, tmp_path / "unseen.npz")
    unseen.tare.save(tmp_path / "tare.json")
    for name, text in (("r", "2 of 5 (40%)"), ("old", "unknown, because the readout's file does not state the range")):
        asked = (
            "detect",
            tmp_path / "unseen.npz",
            "--readout",
            tmp_path / f"{name}.json",
            "--tare",
            tmp_path / "tare.json",
        )
        code, out, _ = call(capsys, *asked, "--report", tmp_path / name)
        assert code == 0
        assert f"detections with an input outside what was seen in training: {text}" in out
        assert text.partition(",")[0] in (tmp_path / name / "report.html").read_text()
        assert json.loads(call(capsys, *asked, "--json")[1])["outside"] == (2 if name == "r" else None)


def test_the_range_is_that_of_values_or_of_how_many_spikes_a_memory_holds() -> None:
    graded = [
        SpikeTrains([1.0, 2.0, 3.0], [0, 2, 3, 3], 0.0, 10.0, [0.5, -2.0, 3.0], kind="graded"),
        SpikeTrains([1.0], [0, 0, 1, 1], 0.0, 10.0, [1.0], kind="graded"),
    ]
    assert seen(graded, 5.0, graded=True) == {"least": [-2.0, 0.0, 0.0], "most": [0.5, 3.0, 0.0]}
    plain = [SpikeTrains.from_lists([[1.0, 2.0, 3.0, 9.0], [], [4.0]]), SpikeTrains.from_lists([[7.0], [], [1.0, 6.0]])]
    assert seen(plain, 1.0, graded=False) == {"most": [2, 0, 1]}
    assert seen(plain, 2.0, graded=False) == {"most": [3, 0, 1]}
    assert seen(plain, 5.0, graded=False) == {"most": [3, 0, 2]}
