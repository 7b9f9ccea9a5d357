"""The scan: each clock of frames with random registers, and what is said of each step that is read."""

import random
from types import SimpleNamespace

import cocotb
import pytest
from cocotb.triggers import FallingEdge

from drivers import begin, reset, settled
from models import Chain, Lines
from structs import pack, unpack

#: Clocks from where the registers are taken to the frame's edge.
EARLY = 16


def drawn(columns, steps):
    """Return registers that obey the rules."""
    step = random.randrange(26, 70)
    line_read = steps * step + random.choice([0, 0, random.randrange(50)])
    read = step - random.choice([0, random.randrange(step - 4)])
    return {
        "random_lines": random.getrandbits(1), "mechanoreceptor": random.getrandbits(1),
        "invert_comparator": random.getrandbits(1), "frame_sync": random.getrandbits(1),
        "wire_version": random.getrandbits(1), "threshold_jump": random.getrandbits(16),
        "threshold_rest": random.getrandbits(16), "threshold_decay": random.getrandbits(8),
        "noise_floor": random.getrandbits(8), "pattern": random.getrandbits(1),
        "line_period": line_read + random.choice([0, random.randrange(40)]), "line_read": line_read,
        "step_period": step, "step_read": read, "ramp": random.choice([150, 255, 256, 60]),
        "lines": random.randrange(columns), "record": random.getrandbits(1),
    }  # fmt: skip


def form(r):
    """Return how a frame with these registers is sent."""
    wide = r["mechanoreceptor"] or r["ramp"] > 255
    return {
        "version_2": r["wire_version"],
        "wide_values": wide,
        "frame_sync": r["frame_sync"],
        "spikes": r["mechanoreceptor"],
    }


@cocotb.test()
async def every_clock_of_the_scan(dut):
    columns, steps, hold, half = (int(dut[name].value) for name in ("COLUMNS", "STEPS", "HOLD", "CSEL_CLOCKS"))
    held = drawn(columns, steps)
    inputs = {"stamp": 16, "micros": 48, "ended_micros": 31, "line_due": 1, "totals_due": 1}
    await begin(dut, written=pack("registers_t", **held), markers=0, starts=0)
    model, chain = Lines(), Chain([1] * columns)
    committed = r = ended = expected_read = None
    taken_at = 0
    frame, t, order = -1, 0, []
    frames = settled_reads = level = selected = driven = 0
    reset_at = 0
    for clock in range(15_000):
        if random.random() < 0.0003:
            await reset(dut)
            model, committed, r, frame, expected_read = Lines(), None, None, -1, None
            selected, reset_at = 0, clock
        if random.random() < 0.01:
            held = drawn(columns, steps)
            dut.written.value = pack("registers_t", **held)
        markers, starts = random.randrange(5), random.randrange(16)
        dut.markers.value, dut.starts.value = markers, starts
        values = {name: random.getrandbits(bits) for name, bits in inputs.items()}
        for name, value in values.items():
            dut[name].value = value
        await settled()
        rises = int(dut.csel_clk.value) and not level
        level = int(dut.csel_clk.value)
        chain.follow(level, int(dut.csel_din.value))
        if int(dut.frame_start.value):
            assert committed is not None
            assert clock - taken_at == EARLY
            # The chain is empty as the first frame begins.
            assert r is not None or clock - reset_at >= 2 * half * columns
            assert r is not None or chain.places == [0] * columns
            assert r is None or t == (r["lines"] + 1) * r["line_period"]
            ended, (r, waiting) = r, committed
            frame, t, order = frame + 1, 0, model.order(r["lines"] + 1, r["random_lines"])
            active = pack("registers_t", **r)
            frames += 1
        if r is not None:
            assert int(dut.frame_start.value) == (t == 0)
            k, u = divmod(t, r["line_period"])
            step, v = divmod(u, r["step_period"])
            starts_now = step < steps and v == 0
            assert int(dut.zero.value) == (t == 0 and frame == 1)
            assert int(dut.step_start.value) == starts_now
            assert int(dut.read_start.value) == (step < steps and v == r["step_period"] - r["step_read"] + 1) or t == 0
            # A step ends where the next one would begin; the last one of a frame in the next frame.
            before = ended if t == 0 and ended else r
            gone = before["line_period"] if u == 0 else u
            if frame > 0 or t > 0:
                assert int(dut.step_end.value) == (
                    gone in range(before["step_period"], steps * before["step_period"] + 1, before["step_period"])
                ), (t, u)
            if t > 1:
                line_read = r["line_read"]
                assert int(dut.reading.value) == (0 < u <= line_read or (u == 0 and line_read == r["line_period"]))
                if step < steps and v > 1:
                    assert int(dut.converting.value) == (v > r["step_period"] - r["step_read"] + 1)
            if expected_read is not None and (v == 1 or starts_now or random.random() < 0.02):
                read = unpack("read_t", dut.read.value)
                wrong = {name: value for name, value in expected_read.items() if getattr(read, name) != value}
                assert not wrong, (wrong, read)
            assert int(dut.active.value) == active
            # What is selected stands for the read before, then follows.
            if step < steps and v == hold:
                selected = step
            assert int(dut.rsel.value) == selected
            if u == 0:
                driven = 0
            if rises and not driven:
                driven = u
                before = order[k - 1] if k else None
                assert u == (hold if before is not None and before < order[k] else max(hold, half - 4)), u
            if starts_now:
                expected_read = {
                    "initial_frame": frame == 0, "frame_first": t == 0,
                    "frame_last": k == r["lines"] and step == steps - 1, "line": order[k], "step": step,
                    "stamp": values["stamp"], "micros": values["micros"],
                    "format": unpack("format_t", pack("format_t", **form(r))), "ramp": r["ramp"],
                    "pattern": r["pattern"] and frame > 0,
                    "noise_floor": r["noise_floor"], "markers": waiting[0], "starts": waiting[1],
                    "threshold": SimpleNamespace(
                        rest=r["threshold_rest"], jump=r["threshold_jump"], decay=r["threshold_decay"]
                    ),
                }  # fmt: skip
                if t == 0 and ended:
                    said = {"initial_frame": frame == 1, "format": form(ended), "micros": values["ended_micros"],
                            "lines": ended["lines"], "changed": ended != r, "line_due": values["line_due"],
                            "totals_due": values["totals_due"]}  # fmt: skip
                    expected_read["ended"] = unpack("ended_t", pack("ended_t", **said))
            # After the pulses that it takes at most a single line is driven.
            if int(dut.read_start.value) and u > hold + 2 * half * columns:
                assert chain.driven(r["lines"] + 1) == [order[k]]
                settled_reads += 1
            t += 1
        if int(dut.markers_taken.value):
            committed, taken_at = (dict(held), (markers, starts)), clock
        await FallingEdge(dut.clk)
    assert frames > 20
    assert settled_reads > 20


@pytest.mark.parametrize(
    "build",
    [
        "COLUMNS=5 STEPS=2 CSEL_CLOCKS=1",
        "COLUMNS=3 STEPS=1 HOLD=6 CSEL_CLOCKS=2",
        "COLUMNS=3 STEPS=4",
    ],
)
def test_mux_ctrl(simulate, build):
    simulate(build)
