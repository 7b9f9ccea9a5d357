"""The scenes by which faults are looked for find none in the sources."""

import pytest

from scenes import SCENES
from verilated import SOURCES


@pytest.mark.parametrize("scene", SCENES)
def test_the_sources_are_not_taken_for_a_fault(scene):
    assert not SCENES[scene](SOURCES)
