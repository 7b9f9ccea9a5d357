"""The panel's page: what the extension hands out."""

from __future__ import annotations

from pathlib import Path

import pytest

import taxel
from taxel import _core

WEB = Path(__file__).resolve().parents[2] / "crates/taxel-live/web"


@pytest.mark.parametrize("name", ["registers.js", "vendor/uPlot.js", "vendor/uPlot.css", "vendor/uPlot.LICENSE"])
def test_a_file_is_handed_out_as_it_lies_in_the_folder(name: str) -> None:
    assert _core.page_file(name) == (WEB / name).read_bytes()


@pytest.mark.parametrize("name", ["", "uPlot.js", "vendor", "vendor/../registers.js", "../Cargo.toml"])
def test_no_other_name_is_known(name: str) -> None:
    with pytest.raises(taxel.ProblemError, match=r"no file of the panel: must be one of .*vendor/uPlot\.js"):
        _core.page_file(name)
