"""The study of real touches, on grasps and postures made here."""

import numpy as np
import pytest
from tests.formats.making import write_icub, write_popu

from taxel_studies import load
from taxel_studies.information import grasps, postures


@pytest.fixture
def data(tmp_path):
    random = np.random.default_rng(1)
    hand, mat = tmp_path / "touch_icub_grasp", tmp_path / "mat_popu"
    hand.mkdir()
    mat.mkdir()
    for k, name in enumerate(("ball", "book", "bear")):
        trials = {}
        for number in range(10):
            raw = 240 + random.integers(-1, 2, (6, 60))
            raw[:, 30 + k] += 10  # the resting pressure, too, depends on the object: drift
            raw[2:, 12 * k : 12 * k + 6] -= 40  # from the second slice on the object presses its own finger
            trials[number] = raw
        write_icub(hand, name, trials)
    names, readings = [], []
    for k, posture in enumerate(("left", "prone", "right", "supine")):
        for pose in range(1, 5):
            for variant in (0, 1):
                look = np.zeros((2, 8, 6))
                look[:, 2 * k : 2 * k + 2] = 50 + random.integers(-5, 6, (2, 2, 6))
                names.append(f"{posture}{pose}_{variant}")
                readings.append(look)
    write_popu(mat, readings, names)
    return tmp_path


def test_what_is_known_comes_out(data):
    common = {"slices": [1, 4], "draws": 1, "shuffles": 3, "most_trials": 0}
    hand = grasps.realise({"ask": "object", **common}, 1, data / "touch_icub_grasp")
    assert hand["first"]["bits"] > 1.5  # as the study warns, drift alone reveals the object
    assert hand["events"][0]["bits"] < 0.4  # nothing has changed yet
    assert hand["events"][1]["bits"] > 1.5
    assert hand["length"]["bits"] < 0.1
    assert hand["drift"]["first"]["late by early"] > 0.9
    mat = postures.realise(
        {"ask": "posture", "mat_taxels": [1, 8], "draws": 2, "shuffles": 3, "most_trials": 0}, 1, data / "mat_popu"
    )
    assert mat["all"]["bits"] == pytest.approx(2.0)
    assert mat["random"][0]["bits"] < mat["random"][1]["bits"]
    assert mat["sum"]["bits"] < 0.5


def test_it_leaves_a_section_with_statements_tables_and_pictures(data, tmp_path):
    section = load("information").run(
        tmp_path / "report", size="toy", changes={"mat_taxels": [8]}, data=data, quiet=True
    )
    assert {s["holds"] for s in section["statements"]} == {None}  # toy size is never judged
    assert [t["title"].split(":")[0] for t in section["tables"]] == ["hand, object", "mat, posture"]
    assert sorted(p.name for p in (tmp_path / "report" / "information").glob("*.svg")) == [
        "figure-1.svg",
        "figure-2.svg",
    ]
