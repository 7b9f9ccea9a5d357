"""registers.toml is the one source: what is made from it is up to date, and its rules agree wherever they are read."""

import json
import random
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import taxel
from taxel.wire import PRESETS, Registers

ROOT = Path(__file__).parents[2]
MADE = (
    "crates/taxel-core/src/wire/registers/table.rs",
    "crates/taxel-core/src/wire/registers/presets.rs",
    "crates/taxel-core/src/wire/registers/rules.rs",
    "crates/taxel-core/src/wire/registers/power_law.rs",
    "crates/taxel-live/src/recording/schemas/Registers.json",
)


def test_what_is_made_from_the_source_is_up_to_date(tmp_path):
    if shutil.which("rustfmt") is None:
        pytest.skip("no rustfmt on this machine to write the table as the formatter has it")
    shutil.copy(ROOT / "registers.toml", tmp_path)
    subprocess.run([sys.executable, ROOT / "tools/registers.py", tmp_path], check=True)
    for name in MADE:
        assert (tmp_path / name).read_text() == (ROOT / name).read_text(), f"{name}: say `make registers`"


def settings(draw):
    """Draw settings on both sides of every rule, for arrays on both sides of 64 lines."""

    def edge(value):
        return max(0, value + draw.choice([-1, 0, 0, 0, 1, 5, 40]))

    channels = draw.choice([16, 64])
    rows, columns = draw.choice([1, 8, 63, 64, 65, 128, 200]), draw.choice([1, 8, 64, 65, 128, 256])
    steps = -(-max(rows, 64) // channels)
    step_read = edge(draw.choice([4, 20, 55, 175, 370]))
    step_period = edge(draw.choice([step_read, step_read + 20, 26, 74, 75]))
    line_read = edge(steps * step_period)
    values = {
        "random_lines": draw.choice([False, True]),
        "line_period": edge(draw.choice([line_read, 10 * line_read, 16 * min(columns, 256)])),
        "line_read": line_read,
        "step_period": step_period,
        "step_read": step_read,
        "ramp": edge(3 * step_read - 4),
        "noise_floor": draw.randrange(256),
        "lines": max(1, edge(columns)) if columns < 256 else 256,
        "wire_version": draw.choice([1, 2]),
        "channels": channels,
    }
    if draw.random() < 0.2:
        values["noise_floor"] = min(255, values["ramp"])
    if draw.random() < 0.2:
        values["step_period"] = edge(step_read + 16 * values["lines"] + 20)
    return rows, columns, values


def by_rust(rows, columns, values):
    array = taxel.Array(rows, columns)
    base = taxel._core.registers_preset(PRESETS[0]) | values
    try:
        given = list(values.items())
        taxel._core.registers_with(json.dumps(base), [(n, v) for n, v in given if n != "channels"], array)
    except taxel.DeviceError as error:
        return str(error)
    return None


@pytest.mark.parametrize("seed", [1, 2])
def test_the_rules_are_those_of_the_source(seed):
    source = tomllib.loads((ROOT / "registers.toml").read_text())
    draw = random.Random(seed)
    seen = set()
    for rows, columns, values in (settings(draw) for _ in range(2000)):
        held = Registers()._held | values
        names = held | {"steps": -(-max(rows, 64) // values["channels"]), "driven_lines": columns, "sense_lines": rows}
        fields = taxel._core.registers_fields()
        outside = [4 for f in fields if not f["least"] <= held[f["name"]] <= f["greatest"]]
        broken = {False: [], True: []}
        for rule in source["rule"]:
            if not eval(rule["holds"], {}, names):
                broken[rule.get("warns", False)].append(rule["number"])
        refused = [*outside, *broken[False]]
        error = by_rust(rows, columns, values)
        assert rule_numbers(error or "") == refused[:1], (rows, columns, values)
        if error is None:
            assert rule_numbers(" ".join(_warnings(values))) == broken[True]
        seen |= {*refused[:1], *broken[True]}
    assert seen == set(range(1, 9)), "every rule was tried on both sides"


def rule_numbers(text):
    return [int(number) for number in re.findall(r"\(rule (\d)\)", text)]


def _warnings(values):
    held = taxel._core.registers_preset(PRESETS[0]) | values
    return taxel._core.registers_warnings(json.dumps(held))
