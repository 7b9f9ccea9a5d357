"""Figures 5.5, 5.6 and 5.8: how many bits of an indentation survive a sampling period (thesis 5.5.1 and 5.5.3)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from taxel.encode import FA1
from taxel_studies import indented, kept_bits
from taxel_studies.discriminants import FoldSums
from taxel_studies.fem import SamplingGrid
from taxel_studies.study import Judgement, Kept, Parameters, Row, Summary, Table, Task, listed

WHERE = "thesis 5.5.1 and 5.5.3, figures 5.5, 5.6 and 5.8"
PROTOCOL = (
    "The courses of the study contact, each condition sampled at random phases and places (figure 5.3); FA-1 with "
    "Table 5.3's constants, theta_0 from the largest pressure of all; linear discriminants on the rasters, ten "
    "folds; bits of their answers, corrected by Panzeri and Treves. Samples of a condition are shifts of one "
    "course, so what is measured is interpolation, as in the thesis. Alpha is searched over the thesis' 13 values "
    "at 2 ms and longer, below that around the best of those. A sample of rest comes before the first."
)

PARAMETERS: dict[str, Any] = {
    **indented.TABLE,
    "samples": 500,
    "periods_ms": [0.5, 1.0, 2.0, 5.0, 10.0, 20.0],
    "alphas": [round(0.1 * k, 1) for k in range(2, 15)],
    "search_from_ms": 2.0,
    "times_ms": [5.0, 10.0, 20.0, 40.0, 60.0, 80.0, 100.0],
    "even_ms": 1.0,
    "seed": 1,
}
TOY: dict[str, Any] = {
    **indented.TOY,
    "samples": 12,
    "periods_ms": [5.0, 10.0, 20.0],
    "alphas": [0.7, 1.0],
    "search_from_ms": 10.0,
    "times_ms": [20.0, 100.0],
}
SIZES = {"coarse": {**indented.COARSE, "samples": 100, "alphas": [0.3, 0.5, 0.7, 0.9, 1.1]}, "toy": TOY}
#: The parameters of a contact, in the words of figure 5.6.
VARIED = {"diameter_mm": "radius", "modulus_kpa": "hardness", "depth_mm": "depth", "angle_deg": "slant"}
#: Alpha of Table 5.3.
PRINTED_ALPHA = 0.7
#: Bits within 10 ms at a period of .5 ms, according to 5.5.3.
BITS_AT_10_MS = 6.0
#: Rates that count as around 100 Hz.
AROUND_100_HZ = (50.0, 200.0)


shared = indented.shared


def _one(p: Parameters, period_ms: float, alpha: float | None = None) -> Task:
    """Name the realisation of a period and alpha; without alpha, of the best."""
    return Task({**p, "period_ms": period_ms, "alpha": alpha})


def tasks(p: Parameters) -> list[Task]:
    """List the search over alpha at the longer periods; then one realisation a period."""
    search = [_one(p, period, alpha) for period in _long(p) for alpha in p["alphas"]]
    return [*search, *(_one(p, period) for period in sorted(p["periods_ms"]))]


def _long(p: Parameters) -> list[float]:
    return [period for period in sorted(p["periods_ms"]) if period >= p["search_from_ms"]]


def searched(p: Parameters, period_ms: float, bits: Callable[[float, float], float]) -> dict[float, float]:
    """Return the bits by alpha: by every one at the longer periods, below that by the best of those and its neighbours.

    `bits` gives them by period and alpha.
    """
    asked = p["alphas"]
    if period_ms not in _long(p):
        mean = {alpha: np.mean([bits(period, alpha) for period in _long(p)]) for alpha in asked}
        best = max(mean, key=lambda alpha: mean[alpha])
        beside = min(np.diff(sorted(asked)), default=0.0)
        asked = sorted({PRINTED_ALPHA, *(alpha for alpha in asked if abs(alpha - best) < 1.5 * beside)})
    return {alpha: bits(period_ms, alpha) for alpha in asked}


def realise(params: dict[str, Any], _seed: int, kept: Kept) -> dict[str, Any]:
    """Return the bits of the discriminants' answers at a period and alpha; without alpha, look at the best closely."""
    p, period = params, params["period_ms"]
    contacts = indented.contacts(p, kept)
    settings = {"range": contacts.range_kpa, "period_ms": period}

    def result(period_ms: float, alpha: float | None = None) -> dict[str, Any]:
        known: dict[str, Any] = kept.row(realise, {"kept": kept}, _one(p, period_ms, alpha)).result
        return known

    if p["alpha"] is not None:
        return indented.bits_of(indented.sampled(contacts, FA1(alpha=p["alpha"], **settings), p)[1], p["samples"])
    by_alpha = searched(p, period, lambda *at: float(result(*at)["bits"]))
    alpha = max(by_alpha, key=lambda one: by_alpha[one])
    encoder = FA1(alpha=alpha, **settings)
    even = FA1(alpha=alpha, a=encoder.a * p["even_ms"] / period, **settings)
    x, sums = indented.sampled(contacts, encoder, p)
    conditions, duration_ms = contacts.conditions, SamplingGrid().duration_ms
    spikes = np.count_nonzero(x.reshape(len(x), -1, SamplingGrid().taxels), axis=1)
    return {
        "period_ms": period,
        "alpha": alpha,
        "searched": sorted([a, b] for a, b in by_alpha.items()),
        "even_bits": indented.bits_of(indented.sampled(contacts, even, p)[1], p["samples"])["bits"],
        **indented.bits_of(sums, p["samples"]),
        "rate_hz": round(float(spikes.mean()) / duration_ms * 1000, 2),
        "most_rate_hz": round(float(spikes.reshape(len(conditions), -1).mean(1).max()) / duration_ms * 1000, 2),
        "by": {
            name: indented.bits_of(sums, p["samples"], {k: f"{getattr(c, name):g}" for k, c in enumerate(conditions)})
            for name in VARIED
            if len({getattr(c, name) for c in conditions}) > 1
        },
        "times": _by_time(x, sums, p),
    }


def _by_time(x: NDArray[Any], sums: FoldSums, p: Parameters) -> list[list[float]]:
    """Return the bits of what was there by each time."""
    varies, taxels, period = indented.varying(x, sums.folds), SamplingGrid().taxels, p["period_ms"]
    return [
        [t, indented.bits_of(sums, p["samples"], features=k)["bits"] if varies[:k].any() else 0.0]
        for t in p["times_ms"]
        if (k := round(t / period) * taxels) and abs(k * period - t * taxels) < 1e-6
    ]


def summarise(p: Parameters, rows: Sequence[Row], kept: Kept) -> Summary:
    """List the bits by period, alpha and question."""
    contacts = indented.contacts(p, kept)
    return {
        "lines": [row.result for row in rows if row.params["alpha"] is None],
        "conditions": len(contacts.conditions),
        "left_out": [[c.diameter_mm, c.modulus_kpa, c.depth_mm, c.angle_deg] for c in contacts.left_out],
    }


def judge(p: Parameters, summary: Summary) -> Iterator[Judgement]:
    """Judge what 5.5.1, 5.5.3 and Table 5.3 say: with the alpha of most bits over all periods, and with each period's.

    What was looked at closely has each period's own alpha: of one alpha it is known where that is the same.
    """
    lines = summary["lines"]
    periods = [line["period_ms"] for line in lines]
    size = f"{summary['conditions']} conditions, {p['samples']} samples each, mesh {p['mesh_mm']:g} mm"
    by_alpha = [dict(map(tuple, line["searched"])) for line in lines]
    common = set.intersection(*(set(bits) for bits in by_alpha))
    one = max(sorted(common), key=lambda alpha: sum(bits[alpha] for bits in by_alpha))
    alike = [line for line in lines if line["alpha"] == one]
    readings = {
        "one alpha for all periods": ([bits[one] for bits in by_alpha], alike, f"alpha {one:g}"),
        "an alpha a period": (
            [line["bits"] for line in lines],
            lines,
            f"alpha {', '.join(format(line['alpha'], 'g') for line in lines)}",
        ),
    }
    for reading, (bits, close, alpha) in readings.items():
        yield Judgement(
            29,
            f"{listed(bits, periods, place='{:g} ms')}",
            bool(all(b <= a + 0.02 for a, b in pairwise(bits)) and bits[0] - bits[-1] > 1),
            f"{alpha}; {size}",
            reading,
        )
        if periods[0] in (line["period_ms"] for line in close):
            yield _rate(close, reading)
        yield from _judged_by_time(close, f"{alpha}; {size}", reading)
        if len(close) == len(lines):
            yield from _by_parameter(close, f"{alpha}; {size}", reading)
    yield Judgement(
        203,
        listed([line["even_bits"] - line["bits"] for line in lines], periods, "+.2f", "{:g} ms")
        + f" bits with A T held at that of {p['even_ms']:g} ms",
        None,
        size,
    )


def _rate(lines: list[dict[str, Any]], reading: str) -> Judgement:
    return Judgement(
        28,
        ", ".join(
            f"{line['rate_hz']:.0f} ({line['most_rate_hz']:.0f}) Hz at {line['period_ms']:g} ms" for line in lines
        )
        + ": mean over all afferents (of the condition with most)",
        bool(AROUND_100_HZ[0] < max(line["most_rate_hz"] for line in lines) < AROUND_100_HZ[1]),
        "it falls with the period, as one spike raises the threshold by A T theta_0",
        reading,
    )


def _by_parameter(lines: list[dict[str, Any]], why: str, reading: str) -> Iterator[Judgement]:
    for taken in kept_bits.LOST:
        lost, words = kept_bits.lost(lines, VARIED, taken)
        if {"diameter_mm", "depth_mm"} <= set(lost):
            worst, least = max(lost, key=lambda n: lost[n]), min(lost, key=lambda n: lost[n])
            for claim, name, found in ((30, "diameter_mm", worst), (31, "depth_mm", least)):
                ends = f"{VARIED[worst]} loses most, {VARIED[least]} least; {why}"
                yield Judgement(claim, words, name == found, ends, f"{reading}, {taken}")


def _judged_by_time(lines: list[dict[str, Any]], why: str, reading: str) -> Iterator[Judgement]:
    by = {line["period_ms"]: dict(map(tuple, line["times"])) for line in lines}
    if 10.0 in by.get(0.5, {}):
        early = by[0.5][10.0]
        moved = f"{why}; a shallow contact has then moved by 50 um only"
        yield Judgement(34, f"{early:.2f} bits", early > BITS_AT_10_MS, moved, reading)
        slow = [t for t, bits in by.get(5.0, {}).items() if bits >= early]
        yield Judgement(
            35,
            f"{slow[0]:g} ms" if slow else "not within 100 ms",
            not slow or slow[0] >= 40,
            f"for the {early:.2f} bits that .5 ms has at 10 ms; {why}",
            reading,
        )


def tables(_p: Parameters, summary: Summary) -> Iterator[Table]:
    """Return the search over alpha, as a table."""
    alphas = sorted({a for line in summary["lines"] for a, _ in line["searched"]})
    known = [dict(map(tuple, line["searched"])) for line in summary["lines"]]
    rows = [[f"{a:g}", *(f"{bits[a]:.2f}" if a in bits else "-" for bits in known)] for a in alphas]
    yield Table(
        "bits by period and alpha",
        ["alpha", *(f"{line['period_ms']:g} ms" for line in summary["lines"])],
        rows,
        "below 2 ms only the best of the longer periods, its neighbours, and the printed 0.7 were tried",
    )


def draw(p: Parameters, summary: Summary) -> list[Figure]:
    """Draw 5.5, 5.6 and 5.8."""
    return kept_bits.by_period_parameter_and_time(
        summary,
        figures=("5.5", "5.6", "5.8"),
        curves={"bits": "A T as printed", "even_bits": f"A T of {p['even_ms']:g} ms"},
        named=VARIED,
        times_ms=p["times_ms"],
        since="contact",
    )
