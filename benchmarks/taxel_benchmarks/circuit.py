"""One frame's exact network of 64 x 64 taxels: against NumPy's dense solves.

Peers: ``numpy.linalg.solve`` of all 128 lines' balances with a right-hand side a read column,
and of the 64 that are left when the read columns' lines, which only taxels join, are eliminated. Voltages
are compared. All in one thread.

Peer: `numpy.linalg.solve`, of all lines and of half. Unit: CPU seconds a frame. Goal: not slower
than any, and the same voltages.
"""

import numpy as np

from taxel.simulate.circuit import Fabric, VirtualGround
from taxel_benchmarks._goals import at_most, not_slower
from taxel_benchmarks._rounds import measured

#: By the ratio's name, ours and the peer.
PAIRS = {
    "numpy.linalg.solve": ("taxel", "numpy.linalg.solve"),
    "numpy.linalg.solve, half the lines": ("taxel", "numpy.linalg.solve, half the lines"),
}


def pressed(size):
    """Return conductances under a ball, uS: a footprint of some 12 mm; all other taxels are at rest."""
    y, x = np.mgrid[:size, :size]
    away = np.hypot(x - 0.4 * size, y - 0.55 * size) / (0.15 * size)
    return Fabric().conductance(0.3 * np.clip(1 - away**2, 0, None) ** 1.5)


def ends(lines):
    """Return the source's voltage, its conductance and that of a switch: V, S, S."""
    feedback = 1e-3 / lines.feedback_kohm
    return lines.v_trans * lines.gain / (1 + lines.gain), (1 + lines.gain) * feedback, 1 / lines.switch_ohm


def dense(lines, g_us):
    """Return the outputs by NumPy alone."""
    n, m = g_us.shape
    g = 1e-6 * g_us
    source, sense, switch = ends(lines)
    a = np.zeros((n + m, n + m))
    a[:n, n:], a[n:, :n] = -g, -g.T
    np.fill_diagonal(a, np.r_[g.sum(1) + sense, g.sum(0) + switch])
    b = np.zeros((n + m, m))
    b[:n], b[n:] = sense * source, switch * lines.v_trans * (1 - np.eye(m))
    inputs = np.linalg.solve(a, b)[:n]
    return np.clip(lines.gain * (lines.v_trans - inputs), 0, lines.rail_v)


def eliminated(lines, g_us):
    """Return the outputs by NumPy alone, the balances of the read columns solved by hand."""
    m = g_us.shape[1]
    g = 1e-6 * g_us
    source, sense, switch = ends(lines)
    share = g / (g.sum(0) + switch)
    a = -share @ g.T
    a[np.diag_indices_from(a)] += g.sum(1) + sense
    inputs = np.linalg.solve(a, sense * source + share @ (switch * lines.v_trans * (1 - np.eye(m))))
    return np.clip(lines.gain * (lines.v_trans - inputs), 0, lines.rail_v)


def goals(result):
    """Return the goals with what a result reached."""
    apart = {f"{name}: largest difference, V": one for name, one in result["largest difference, V"].items()}
    return not_slower(result, *PAIRS) + at_most(dict.fromkeys(apart, 1e-8), apart)


def run(*, quick):
    """Measure; quick: 16 x 16, few rounds."""
    size, rounds = (16, 3) if quick else (64, 25)
    g = pressed(size)
    plain = VirtualGround()
    apart = {
        "all lines": float(np.abs(plain.volts(g) - dense(plain, g)).max()),
        "half the lines": float(np.abs(plain.volts(g) - eliminated(plain, g)).max()),
    }
    found = measured(
        {
            "taxel": lambda: plain.volts(g),
            "numpy.linalg.solve": lambda: dense(plain, g),
            "numpy.linalg.solve, half the lines": lambda: eliminated(plain, g),
        },
        PAIRS,
        rounds=rounds,
    )
    return found | {"size": [size, size], "largest difference, V": apart}
