"""Where published recordings are; tests on them are skipped where there are none."""

import os
from pathlib import Path

import pytest

SHARED = Path(os.environ.get("TAXEL_DATA", Path(__file__).parents[3] / "shared" / "data"))


@pytest.fixture
def published():
    """Return a function of a data set's name, that gives its folder."""

    def folder(name):
        if not (SHARED / name).is_dir():
            pytest.skip(f"no {name} in {SHARED}: set TAXEL_DATA")
        return SHARED / name

    return folder
