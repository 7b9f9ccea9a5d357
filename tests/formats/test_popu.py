"""Postures, from files made here."""

import numpy as np
import pytest

import taxel
from taxel import formats
from taxel.formats import popu

from .making import write_popu


def test_postures_have_their_pose_and_variant(tmp_path):
    readings = np.random.default_rng(1).integers(0, 90, (3, 4, 6, 5))
    write_popu(tmp_path, readings, ["left2_0", "left2_1", "empty1"])
    found = list(formats.trials(tmp_path))
    assert np.array_equal(np.stack([t.frames.values for t in found]), readings)
    assert [(t.about["posture"], t.about["pose"], t.about["variant"]) for t in found] == [
        ("left", "left2", "0"),
        ("left", "left2", "1"),
        ("empty", "empty1", ""),
    ]


def test_what_is_wrong_is_one_clear_error(tmp_path):
    lying = write_popu(tmp_path, np.zeros((1, 2, 3)), ["left1"])
    with pytest.raises(taxel.FormatError, match="poses x snapshots x rows x columns"):
        list(popu.trials(lying))
    write_popu(tmp_path, np.zeros((1, 2, 3, 3)), ["???"])
    with pytest.raises(taxel.FormatError, match="must have a name like supine3_1"):
        list(popu.trials(tmp_path))
    lying.write_bytes(lying.read_bytes()[:100])
    with pytest.raises(taxel.FormatError, match=r"no \.npz with readings"):
        list(popu.trials(tmp_path))
