"""Grasps and postures, from files made here."""

import numpy as np
import pytest

import taxel
from taxel import formats
from taxel.formats import icub, popu

from .making import write_icub, write_popu


def test_grasps_rise_with_pressure_and_count_slices(tmp_path):
    raw = np.arange(120).reshape(2, 60)
    write_icub(tmp_path, "ball", {1: raw, 4: raw[:1]})
    write_icub(tmp_path, "edge", {1: raw}, packed=False)
    found = list(formats.trials(tmp_path))
    assert [t.name for t in found] == ["ball/1", "ball/4", "edge/1"]
    assert np.array_equal(found[0].frames.values, 255 - raw.reshape(2, 5, 12))
    assert found[0].frames.t.tolist() == [0, 1]
    assert found[0].series["joint7"].tolist() == [1.5, 1.5]
    assert [t.about["object"] for t in found] == ["ball", "ball", "edge"]


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


def test_what_is_wrong_names_file_and_line(tmp_path):
    raw = np.zeros((2, 60), int)
    path = write_icub(tmp_path, "ball", {1: raw}, packed=False)
    whole = path.read_text()
    path.write_text(whole.replace("\n1,1,", "\n1,3,"))
    with pytest.raises(taxel.FormatError, match=r"ball.csv, line 3: slice is 3, must be 1"):
        list(icub.trials(path))
    path.write_text(whole.replace("0\n", "x\n", 1))
    with pytest.raises(taxel.FormatError, match=r"ball.csv, line 2: little_12 is 'x', not a number"):
        list(icub.trials(path))
    path.write_text(whole.replace("thumb_3", "thumb_x"))
    with pytest.raises(taxel.FormatError, match="no column 'thumb_3'"):
        list(icub.trials(path))
    path.unlink()
    with pytest.raises(taxel.FormatError, match="no table of grasps"):
        list(icub.trials(tmp_path))
    lying = write_popu(tmp_path, np.zeros((1, 2, 3)), ["left1"])
    with pytest.raises(taxel.FormatError, match="poses x snapshots x rows x columns"):
        list(popu.trials(lying))
    write_popu(tmp_path, np.zeros((1, 2, 3, 3)), ["???"])
    with pytest.raises(taxel.FormatError, match="must be named like supine3_1"):
        list(popu.trials(tmp_path))
    lying.write_bytes(lying.read_bytes()[:100])
    with pytest.raises(taxel.FormatError, match=r"no \.npz with readings"):
        list(popu.trials(tmp_path))
