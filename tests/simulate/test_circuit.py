"""The array's circuit: closed forms, Kirchhoff's laws, a nodal solve of our own in NumPy, and ngspice."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from taxel.simulate.circuit import Circuit, Converter, Divider, Fabric, VirtualGround


def solved(
    g_us: np.ndarray,
    read: int,
    *,
    ground: VirtualGround | None = None,
    divider: Divider | None = None,
) -> Any:
    """What the sense lines give, by the plainest nodal analysis: one unknown a node, no structure used.

    Nodes: each line, and of each sense line the amplifier's output.
    """
    rows, columns = g_us.shape
    of = ground or divider
    ends = np.arange(rows)
    outputs, switches = ends + rows, np.arange(columns) + 2 * rows
    count = 2 * rows + columns
    a, b = np.zeros((count, count)), np.zeros(count)

    def tie(p: int, q: int, conductance: float) -> None:
        for m, n in ((p, q), (q, p)):
            a[m, m] += conductance
            a[m, n] -= conductance

    for i, k in np.ndindex(rows, columns):
        tie(ends[i], switches[k], 1e-6 * g_us[i, k])
    idle, there = (ground.v_trans, 0.0) if ground is not None else (0.0, divider.supply_v)
    for k in range(columns):
        volts = there if k == read else idle
        if of.switch_ohm:
            a[switches[k], switches[k]] += 1 / of.switch_ohm
            b[switches[k]] += volts / of.switch_ohm
        else:
            a[switches[k]] = np.eye(count)[switches[k]]
            b[switches[k]] = volts
    for i in range(rows):
        if divider is not None:
            a[ends[i], ends[i]] += 1e-3 / divider.resistor_kohm
            a[outputs[i], outputs[i]] = 1.0
            continue
        tie(ends[i], outputs[i], 1e-3 / ground.feedback_kohm)
        # The output's own equation instead of its current: gain (V_trans - input).
        a[outputs[i]] = 0.0
        a[outputs[i], outputs[i]], a[outputs[i], ends[i]] = 0.0 if ground.gain is None else 1 / ground.gain, 1.0
        b[outputs[i]] = ground.v_trans
    return np.linalg.solve(a, b)[ends if divider is not None else outputs]


def every(g_us: np.ndarray, **of: Any) -> np.ndarray:
    return np.stack([solved(g_us, read, **of) for read in range(g_us.shape[1])], axis=1)


def drawn(seed: int, rows: int, columns: int) -> np.ndarray:
    """Conductances from none to a short circuit's 10 mS, most of them at rest."""
    random = np.random.default_rng(seed)
    g = 0.1 * np.exp(random.normal(0, 0.3, (rows, columns)))
    loaded = random.random((rows, columns)) < 0.3
    return np.where(loaded, 10.0 ** random.uniform(-1, 4, (rows, columns)), g) * (random.random((rows, columns)) < 0.95)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize(("rows", "columns"), [(1, 1), (5, 3), (4, 7)])
def test_virtual_ground_equals_a_plain_nodal_solve(seed, rows, columns):
    random, g = np.random.default_rng(seed), drawn(seed, rows, columns)
    lines = VirtualGround(
        v_trans=random.uniform(0.2, 2.5),
        gain=10.0 ** random.uniform(1, 6) if seed % 3 else None,
        switch_ohm=random.choice([0.0, 2.5, 300.0]),
        rail_v=1e9,
    )
    wanted = every(g, ground=lines)
    assert lines.volts(g) == pytest.approx(np.clip(wanted, 0, None), rel=2e-6, abs=1e-9)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize(("rows", "columns"), [(1, 1), (5, 3), (4, 7)])
def test_dividers_equal_a_plain_nodal_solve(seed, rows, columns):
    random, g = np.random.default_rng(seed), drawn(seed, rows, columns) + 1e-3
    lines = Divider(
        resistor_kohm=10.0 ** random.uniform(-1, 3),
        switch_ohm=random.choice([0.0, 20.0]),
    )
    assert lines.volts(g) == pytest.approx(every(g, divider=lines), rel=2e-6, abs=1e-9)


@pytest.mark.skipif(shutil.which("ngspice") is None, reason="ngspice is not installed")
def test_ngspice_agrees_on_eight_by_eight(tmp_path: Path):
    g = drawn(8, 8, 8) + 1e-3
    lines = VirtualGround(gain=2e3, switch_ohm=30.0, rail_v=1e9)
    read = 5
    parts = ["* eight rows under virtual ground, column 5 read", f"VT t 0 {lines.v_trans}"]
    number = iter(range(10_000))

    def resistor(p: str, q: str, ohm: float) -> None:
        parts.append(f"R{next(number)} {p} {q} {ohm:.12g}")

    for i in range(8):
        parts.append(f"E{i} o{i} 0 t r{i}x {lines.gain}")
        resistor(f"o{i}", f"r{i}x", 1e3 * lines.feedback_kohm)
        for k in range(8):
            resistor(f"r{i}x", f"c{k}", 1e6 / g[i, k])
    for k in range(8):
        resistor(f"c{k}", "0" if k == read else "t", lines.switch_ohm)
    wanted = " ".join(f"v(o{i})" for i in range(8))
    parts += [".op", ".control", "set numdgt=10", "run", f"print {wanted}", "quit", ".endc", ".end"]
    deck = tmp_path / "array.cir"
    deck.write_text("\n".join(parts) + "\n")
    run = subprocess.run(["ngspice", "-b", str(deck)], capture_output=True, text=True, check=False, timeout=60)
    said = [line.split("=")[1] for line in run.stdout.splitlines() if line.startswith("v(o")]
    assert len(said) == 8, run.stdout + run.stderr
    assert lines.volts(g)[:, read] == pytest.approx(np.array(said, float), rel=1e-5)


def test_the_circuit_reads_what_the_simulated_sensor_reads():
    """The scenes' sensor is this circuit with ideal lines, no hysteresis, all settled."""
    force = np.array([[0.0, 0.02, 0.1, 0.5, 1.0, 3.0]])
    plain = Circuit(
        readout=VirtualGround().ideal(), converter=Converter(hysteresis_v=0.0, settle_us=0.0, discharge_us=0.0)
    )
    # V = V_trans (1 + R_f G), and a ramp that charges to 3 of 5 V in 150 ticks, where it ends.
    conductance = 0.1e-6 + 1.64e-6 * (force / 0.02) ** 0.7
    volts = np.minimum(1.3 * (1 + 47e3 * conductance), 3.0)
    assert plain.ticks(Fabric().conductance(force)) == pytest.approx(
        150 / np.log(2.5) * np.log(5 / (5 - volts)), abs=1e-4
    )
