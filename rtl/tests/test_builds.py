"""Builds that the logic is not made for are refused when they are elaborated, with what would be right."""

import pytest

from logic import PACKAGES, QUIET, RTL, run


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"ROWS": 80}, "COLUMNS, ROWS: at most 128, and steps that are a power of two"),
        ({"CHANNELS": 32}, "CHANNELS: the converter has 16 or 64"),
        ({"LINK_BYTES": 2}, "LINK_BYTES: the link has 1 or 4"),
        ({"ANSWERS": 6}, "ANSWERS: a power of two, at least 2"),
        ({"ANSWERS": 1}, "ANSWERS: a power of two, at least 2"),
        ({"STATES_US": 1}, "STATES_US: 0, or 2 to 20000000"),
        ({"BAUD_CLOCKS": 3}, "CLOCKS: at least 4"),
    ],
)
def test_a_build_that_is_not_supported_is_refused(parameters, message):
    options = [f"-G{name}={value}" for name, value in parameters.items()]
    sources = [RTL / name for name in (*PACKAGES, "taxel_top.sv")]
    with pytest.raises(RuntimeError, match=message):
        run("verilator", "--lint-only", *QUIET, f"-I{RTL}", "--top-module", "taxel_top", *options, *sources)
