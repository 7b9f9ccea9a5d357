"""Where the rest of other people's recordings is known from."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

import taxel
from taxel.recording.pressure import readings

from .making import SHARED

#: Where the rest of each shared recording is known from. The plate's footfalls begin at contact and end at foot-off;
#: of gaitndd's single channels, which have an offset, some stood still without a load first.
EXPECTED = {
    "plate": {"none": 360},
    "insole_gaitpdb": {"unit": 48},
    "insole_moticon": {"unit": 4},
    "insole_fscan": {"unit": 1},
    "pressure_formats/pedar_example.asc": {"unit": 2},
    "pressure_formats/emed_test.lst": {"unit": 1},
    "pressure_formats/iscan_test.csv": {"quiet": 1},
    "touch_icub_grasp": {"none": 131},
    "mat_popu": {"none": 57},
}
#: Channels of gaitndd that begin quiet and without a load; all others begin standing.
UNLOADED = {"als6 left", "als9 right", "hunt1 right", "hunt13 left", "hunt13 right", "park8 left"}


def _each(name: str) -> list[taxel.Recording]:
    place = SHARED / name
    if not place.exists():
        pytest.skip(f"no {name} in {SHARED}: set TAXEL_DATA")
    endings = (".h5", ".txt", ".asf")
    files = sorted(one for one in place.iterdir() if one.suffix in endings) if place.is_dir() else []
    opened = [taxel.open(one) for one in files or [place]]
    return [one for some in opened for one in (some if isinstance(some, list) else [some])]


@pytest.mark.parametrize("name", EXPECTED)
def test_the_rest_of_each_shared_recording_is_known_from_where_it_can_be(name: str) -> None:
    found = Counter()
    for recording in _each(name):
        read = readings(recording)
        assert read is not None
        found[read[1].source] += 1
    assert found == EXPECTED[name]


def test_a_channel_that_begins_with_somebody_standing_on_it_has_no_rest() -> None:
    sources = {}
    for recording in _each("insole_gaitndd"):
        read = readings(recording)
        assert read is not None
        frames, rest, _ = read
        sources[recording.name] = rest.source
        if rest.source == "quiet":
            # Nearly nothing reads less than a rest.
            scale = 150 / float(np.ptp(frames.values))
            assert np.mean((frames.values - rest.values[0]) * scale < -8) <= 0.1
    assert {name for name, source in sources.items() if source == "quiet"} == UNLOADED
    assert len(sources) == 24
