"""Grasps, from files made here."""

import numpy as np
import pytest

import taxel
from taxel import formats
from taxel.formats import icub

from .making import write_icub


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


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ("\n1,1,", "\n1,3,", "ball.csv, line 3: slice is 3; must be 1"),
        (",0\n", ",x\n", "ball.csv, line 2: column 'little_12' is 'x', not a number"),
        (",0\n", ",\n", "ball.csv, line 2: column 'little_12' is empty"),
        (",0\n", "\n", "ball.csv, line 2: 75 cells; must have 76"),
        ("thumb_3", "thumb_x", "column 'thumb_3' is missing"),
        ("trial,slice", "slice,trial", "no table of grasps"),
    ],
)
def test_what_is_wrong_names_file_and_line(tmp_path, old, new, text):
    path = write_icub(tmp_path, "ball", {1: np.zeros((2, 60), int)}, packed=False)
    whole = path.read_text()
    assert old in whole
    path.write_text(whole.replace(old, new, 1))
    with pytest.raises(taxel.FormatError) as error:
        list(icub.trials(path))
    assert text in str(error.value)
    assert "\n" not in str(error.value)
