"""The registers: every command is answered, and one that breaks a rule of registers.toml changes nothing."""

import random
import tomllib
from pathlib import Path

import cocotb
import pytest
from cocotb.triggers import FallingEdge

from drivers import begin, reset
from structs import NUMBERS, pack, unpack

TABLE = tomllib.loads((Path(__file__).parents[3] / "registers.toml").read_text())
FIELDS = [field for field in TABLE["field"] if "register" in field]
GREETING, OK, BAD, STATUS = (NUMBERS[f"ANSWER_{name}"] for name in ("GREETING", "OK", "BAD", "STATUS"))


def word(held, number):
    """Return what a register holds."""
    return sum(held[f["name"]] << f["low"] for f in FIELDS if f["register"] == number)


def written(held, number, value):
    """Return the registers after a write, whatever the rules say, and whether it sets reserved bits."""
    changed = dict(held)
    left = value
    for f in FIELDS:
        if f["register"] == number:
            changed[f["name"]] = value >> f["low"] & (1 << f["bits"]) - 1
            left &= ~((1 << f["bits"]) - 1 << f["low"])
    return changed, left != 0


def broken(held, build):
    """Return the number of the rule that refuses these registers; 0: none."""
    values = {f["name"]: held[f["name"]] + f.get("offset", 0) for f in FIELDS} | build
    for f in FIELDS:
        most = f.get("greatest", (1 << f["bits"]) - 1 + f.get("offset", 0))
        if not f.get("least", 0) <= values[f["name"]] <= most:
            return 4
    rules = [rule for rule in TABLE["rule"] if not rule.get("warns")]
    for rule in sorted(rules, key=lambda rule: (rule["number"] != 4, rule["number"])):
        if not eval(rule["holds"], {}, values):
            return rule["number"]
    return 0


def attempt(held, build):
    """Return a write that is near what is allowed: number and value."""
    if random.random() < 0.2:
        # Each number of a query; the two that are no registers, and what no query has, more often.
        return 6, random.choice([*range(12), 8, 9, 10, random.getrandbits(32)])
    f = random.choice(FIELDS)
    # Where a rule is just kept, and one beside that.
    edges = {
        "lines": random.choice([build["driven_lines"] - 1, held["line_period"] // 16 - 1]),
        "line_read": random.choice([held["line_period"], build["steps"] * held["step_period"]]),
        "line_period": random.choice([held["line_read"], 16 * held["lines"] + 16]),
        "step_period": random.choice([held["step_read"], held["line_read"] // build["steps"], build["channels"] + 10]),
        "step_read": random.choice([held["step_period"], (held["ramp"] + 5 + 2) // 3, 4]),
        "ramp": 3 * held["step_read"] - 5,
    }
    near = [
        edges.get(f["name"], 0) + random.choice([-1, 0, 1]),
        held[f["name"]] + random.choice([-1, 0, 1]),
        random.choice([0, 1, 2, 3, 15, 26, 75, 255, 300]),
    ]
    bits = (1 << f["bits"]) - 1
    changed = held | {f["name"]: random.choice([*near, random.getrandbits(f["bits"]), bits]) & bits}
    value = word(changed, f["register"])
    if random.random() < 0.1:
        value ^= 1 << random.randrange(32)
    return f["register"], value


@cocotb.test()
async def every_command_is_answered_and_rules_are_kept(dut):
    columns, rows, channels, steps = (int(dut[n].value) for n in ("COLUMNS", "ROWS", "CHANNELS", "STEPS"))
    build = {"channels": channels, "driven_lines": columns, "sense_lines": rows, "steps": steps}
    first = vars(unpack("registers_t", dut.AT_RESET.value))
    assert not broken(first, build)
    kinds, waiting, refusals = dict.fromkeys((GREETING, OK, BAD, STATUS), 0), [], 0
    first["pattern"] = random.getrandbits(1)
    held = dict(first)
    await begin(dut, command=0, room=1, markers_taken=0, pattern=first["pattern"])

    async def clock():
        """One clock; the scan may take markers in it."""
        dut.markers_taken.value = taken = int(random.random() < 0.1)
        await FallingEdge(dut.clk)
        dut.command.value = 0
        if taken:
            waiting.clear()

    for k in range(1500):
        if k % 500 == 499:
            first["pattern"] = random.getrandbits(1)
            await reset(dut, command=0, markers_taken=0, pattern=first["pattern"])
            held = dict(first)
            waiting.clear()
        number, value = attempt(held, build)
        room = random.random() < 0.9
        dut.command.value, dut.number.value, dut.value.value, dut.room.value = 1, number, value, int(room)
        await clock()
        dut.room.value, dut.number.value, dut.value.value = random.getrandbits(1), random.randrange(8), 0
        assert int(dut.refused_full.value) == (not room)
        for _ in range(2):
            await clock()
            assert not int(dut.answer.value)
            assert int(dut.markers.value) == len(waiting)
            assert not int(dut.marker_lost.value)
        await clock()
        # The registers and the answer, four clocks after the command.
        assert int(dut.answer.value) == room
        lost = False
        if room:
            answered = unpack("answer_t", dut.answered.value)
            changed, reserved = written(held, number, value)
            rule = 4 if reserved else broken(changed, build)
            if number == 6 and value <= 9:
                kind = {8: GREETING, 9: STATUS}.get(value, OK)
                expected = (value, word(held, value)) if kind == OK else None
            elif rule:
                kind, expected = BAD, (number, rule)
            else:
                kind, expected = OK, (number, value)
                if changed["record"] != held["record"]:
                    lost = len(waiting) == NUMBERS["MARKERS"]
                    waiting += [] if lost else [changed["record"]]
                held = changed
            kinds[kind] += 1
            assert answered.kind == kind
            assert expected is None or (answered.number, answered.value) == expected
        assert int(dut.marker_lost.value) == lost
        assert int(dut.written.value) == pack("registers_t", **held)
        assert int(dut.markers.value) == len(waiting)
        starts = int(dut.starts.value)
        assert [starts >> place & 1 for place in range(len(waiting))] == waiting
        refusals += not room
        for _ in range(random.choice([0, 0, 1, 7])):
            await clock()
    assert all(kinds.values())
    assert refusals > 50


def held(**fields):
    """Return the parameter that sets what registers hold at reset: what obeys the rules, but for the fields given."""
    times = {"line_period": 300, "line_read": 300, "step_period": 75, "step_read": 55, "ramp": 150, "noise_floor": 3}
    return f"AT_RESET=176'h{pack('registers_t', frame_sync=1, **times, **fields):x}"


@pytest.mark.parametrize(
    "build",
    [
        f"COLUMNS=8 {held(lines=7)}",
        f"COLUMNS=128 ROWS=128 CHANNELS=64 STEPS=2 {held(lines=127, wire_version=1)}",
    ],
    ids=["COLUMNS=8", "COLUMNS=128"],
)
def test_register_file(simulate, build):
    simulate(build)
