"""Figures 5.11 to 5.13: how many bits of a drop survive a sampling period (thesis 5.6.3 and 5.6.4)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from taxel.array import Array
from taxel.spikes import to_ms
from taxel.wire import FRAME_US
from taxel_studies import dropped, kept_bits
from taxel_studies.dropped import LENGTH_MS, REGION, distances_of
from taxel_studies.study import Judgement, Kept, Parameters, Row, Summary, Task, grid, listed

WHERE = "thesis 5.6.3 and 5.6.4, figures 5.11 to 5.13"
PROTOCOL = (
    "The drops of the study drops. What the host holds is looked at every so often from the impact's first frame "
    "on; a change above the board's noise floor since the last one that was sent is an event, rises and falls "
    "apart. Trains are smoothed in time (5.8) and over taxels (5.11, a train counting twice at its own taxel, as "
    "printed), and compared by the Euclidean norm over taxels and time that 5.12's left side names; each drop is "
    "named by most of its 5 nearest others (the thesis gives no number). Bits of these answers, corrected by "
    "Panzeri and Treves. Tau and sigma are searched on the same drops, as in the thesis: the pair of most bits at any "
    "period serves all; beside it each period's own, sampling begun at any phase, Euclidean norms summed over trains, "
    "as 5.12 prints it, and the sum over time too that 5.10 prints."
)

PARAMETERS: dict[str, Any] = {
    **dropped.TABLE,
    "periods_ms": [to_ms(FRAME_US), 0.5, 1.0, 2.0, 5.0, 10.0, 20.0],
    "taus_ms": [round(0.1 * k, 1) for k in range(1, 21)],
    "sigmas_mm": [1.0, 2.0, 3.0, 4.0, 5.0],
    "neighbours": 5,
    "times_ms": [0.5, 1.0, 2.0, 3.0, 5.0, 7.0, 10.0, 15.0, 20.0, 30.0, 50.0],
    "seed": 1,
}
#: A fifth of the drops and of the search, none at every frame: about a minute of one core.
COARSE: dict[str, Any] = {
    "drops": 20,
    "periods_ms": [0.5, 1.0, 2.0, 5.0, 10.0, 20.0],
    "taus_ms": [0.2, 0.4, 1.0, 2.0],
    "sigmas_mm": [1.0, 2.0, 3.0, 5.0],
}
TOY: dict[str, Any] = {
    **dropped.TOY,
    "periods_ms": [1.0, 20.0],
    "taus_ms": [0.4, 1.0],
    "sigmas_mm": [2.0],
    "neighbours": 3,
    "times_ms": [5.0, 50.0],
}
SIZES = {"coarse": COARSE, "toy": TOY}
#: The parameters of a drop, in the words of figure 5.12.
VARIED = {"ball_mm": "ball", "height_mm": "height", "slant_deg": "slant"}
#: What 5.6.3 found best: period, tau (ms), sigma (mm).
PRINTED = {"period_ms": 1.0, "tau_ms": 0.4, "sigma_mm": 2.0}
#: What counts as the plateau of figure 5.13, and until when it should be reached at periods up to 2 ms.
PLATEAU, PLATEAU_MS, FAST_MS = 0.9, 10.0, 2.0
#: The readings of how tau and sigma are chosen.
ONE, EACH = "one pair for all periods", "a pair a period"
#: The readings of the distance as it is printed.
AS_PRINTED = ("norms summed over trains (5.12)", "summed over trains and time (5.10)")
#: Above this period the loss should be marked.
MARKED_MS = 5.0
#: Bits, and shares of the largest possible bits, that differ by less are alike: one drop of a class of 100 is some .01.
ALIKE = 0.02


shared = dropped.shared


def tasks(p: Parameters) -> list[Task]:
    """List the search, one realisation a period and tau; then one a period, which looks at two pairs closely."""
    return [*_search(p), *grid({**p, "over_ms": p["periods_ms"]}, period_ms="periods_ms")]


def _search(p: Parameters) -> list[Task]:
    return grid(p, period_ms="periods_ms", tau_ms="taus_ms")


def realise(params: dict[str, Any], _seed: int, kept: Kept) -> Any:
    """Compare all drops at a period: return the bits of neighbours' answers by sigma; without a tau, of two pairs.

    These are the pair of most bits at any period, and at this one.
    """
    period, sigmas, pitch = params["period_ms"], params["sigmas_mm"], Array.thesis().column_mm
    spikes, y = _spikes(params, kept, aligned=True)
    if "tau_ms" in params:
        kernels = [dropped.smoothed(REGION, pitch, sigma) for sigma in sigmas]
        grams = dropped.spatial_grams(spikes, period, params["tau_ms"], kernels, [spikes.shape[1]])
        return [_bits(distances_of(gram[0]), y, params)["bits"] for gram in grams]
    shared = {name: value for name, value in params.items() if name not in ("period_ms", "over_ms")}
    found = {
        (task.params["period_ms"], task.params["tau_ms"], sigma): bits
        for task in _search({**shared, "periods_ms": params["over_ms"]})
        for sigma, bits in zip(sigmas, kept.row(realise, {"kept": kept}, task).result, strict=True)
    }
    here = {at[1:]: bits for at, bits in found.items() if at[0] == period}
    pairs = {ONE: max(found, key=lambda at: found[at])[1:], EACH: max(here, key=lambda at: here[at])}
    late = _spikes(params, kept, aligned=False)[0]
    looks = {pair: _look(spikes, late, y, params, *pair) for pair in dict.fromkeys(pairs.values())}
    kernel = dropped.smoothed(REGION, pitch, pairs[ONE][1])
    summed = zip(AS_PRINTED, dropped.as_printed(spikes, period, pairs[ONE][0], kernel), strict=True)
    return {
        "period_ms": period,
        "searched": [[*pair, bits] for pair, bits in here.items()],
        "looks": {reading: looks[pair] for reading, pair in pairs.items()},
        "summed_bits": {reading: _bits(distances, y, params)["bits"] for reading, distances in summed},
        "events": round(float(spikes.sum()) / len(spikes), 1),
    }


def _look(
    spikes: NDArray[np.uint8],
    late: NDArray[np.uint8],
    y: NDArray[np.int64],
    params: dict[str, Any],
    tau: float,
    sigma: float,
) -> dict[str, Any]:
    """Return the bits at a period and pair: of all, by parameter, by time since impact, and begun at any phase."""
    period, whole = params["period_ms"], spikes.shape[1]
    kernel = dropped.smoothed(REGION, Array.thesis().column_mm, sigma)
    any_phase = dropped.spatial_grams(late, period, tau, [kernel], [whole])[0][0]
    ends = [_samples_before(t, period, whole) for t in params["times_ms"]]
    every = sorted({*ends, whole})
    by_end = dict(zip(every, dropped.spatial_grams(spikes, period, tau, [kernel], every)[0], strict=True))
    times = {end: _bits(distances_of(gram), y, params)["bits"] for end, gram in by_end.items()}
    return {
        "period_ms": period,
        "tau_ms": tau,
        "sigma_mm": sigma,
        "any_phase_bits": _bits(distances_of(any_phase), y, params)["bits"],
        **_bits(distances_of(by_end[whole]), y, params, by=True),
        "times": [[t, times[end]] for t, end in zip(params["times_ms"], ends, strict=True)],
    }


def _samples_before(time_ms: float, period_ms: float, most: int) -> int:
    """Return the number of samples up to a time after the impact, the first one at the impact."""
    return min(max(1, int(np.ceil(time_ms / period_ms - 1e-9))), most)


def _spikes(params: dict[str, Any], kept: Kept, *, aligned: bool) -> tuple[NDArray[np.uint8], NDArray[np.int64]]:
    """Return all drops' change events at a period, and the number of each one's condition."""
    parts = []
    rng = np.random.default_rng([params["seed"], 511])
    for condition in dropped.conditions(params):
        ticks = dropped.played(params, condition, kept).ticks
        late = np.zeros(len(ticks)) if aligned else rng.uniform(0, params["period_ms"], len(ticks))
        parts.append(dropped.sampled(ticks, params["period_ms"], late))
    return np.concatenate(parts), np.repeat(np.arange(len(parts)), [len(part) for part in parts])


def _bits(
    distances: NDArray[np.float64], y: NDArray[np.int64], params: dict[str, Any], *, by: bool = False
) -> dict[str, Any]:
    """Return the information of the neighbours' answers, and of each parameter in them."""
    answers = dropped.named_by_neighbours(distances, y, params["neighbours"])
    bits: dict[str, Any] = kept_bits.information(y, answers, "bits", "right")
    if by:
        all_of_them = dropped.conditions(params)
        bits["by"] = {}
        for name in VARIED:
            values = np.array([f"{getattr(one, name):g}" for one in all_of_them])
            if len(set(values.tolist())) > 1:
                bits["by"][name] = kept_bits.information(values[y], values[answers], "bits", "most")
    return bits


def summarise(p: Parameters, rows: Sequence[Row]) -> Summary:
    """List the bits by period, of each reading."""
    found = sorted((row.result for row in rows if "tau_ms" not in row.params), key=lambda one: one["period_ms"])
    return {
        "readings": {reading: [one["looks"][reading] for one in found] for reading in (ONE, EACH)},
        "summed_bits": {reading: [one["summed_bits"][reading] for one in found] for reading in AS_PRINTED},
        "searched": [[one["period_ms"], one["searched"]] for one in found],
        "conditions": len(dropped.conditions(p)),
    }


def judge(p: Parameters, summary: Summary) -> Iterator[Judgement]:
    """Judge what 5.6.4 and 5.8 say: with the pair of most bits at any period for all of them, and with each its own."""
    size = f"{summary['conditions']} conditions, {p['drops']} drops each, {p['neighbours']} neighbours"
    lines = summary["readings"][ONE]
    periods = [line["period_ms"] for line in lines]
    best = max(lines, key=lambda line: line["bits"])
    pair = best["tau_ms"], best["sigma_mm"]
    searched = "searched on the same drops, as in the thesis; our places and noise are not its"
    if pair[1] == max(p["sigmas_mm"]):
        searched = f"the best sigma is the widest that was searched; {searched}"
    printed = PRINTED["tau_ms"], PRINTED["sigma_mm"]
    there = {tuple(one[:2]): one[2] for one in dict(map(tuple, summary["searched"]))[best["period_ms"]]}
    ours = f"{pair[0]:g} ms, {pair[1]:g} mm at {_ms(best['period_ms'])}"
    if printed in there:
        ours += f"; the printed point has {best['bits'] - there[printed]:.2f} bits less there"
    yield Judgement(36, ours, pair == printed, searched, ONE)
    for reading, bits in summary["summed_bits"].items():
        yield from _by_period(periods, bits, size, f"{ONE}, {reading}")
    for reading, here in summary["readings"].items():
        yield from _by_period(periods, [line["bits"] for line in here], size, reading)
        yield Judgement(
            44,
            listed([line["bits"] - line["any_phase_bits"] for line in here], periods, "+.2f", "{:g} ms")
            + " bits more than with sampling begun at any time",
            bool(here[-1]["bits"] > here[-1]["any_phase_bits"]),
            size,
            reading,
        )
        yield from _by_parameter(here, size, reading)
        yield from _by_time(here, size, reading)


def _by_period(periods: list[float], bits: list[float], size: str, reading: str) -> Iterator[Judgement]:
    shown = f"{listed(bits, periods, place='{:g} ms')} bits"
    best = periods[int(np.argmax(bits))]
    shorter = [b for period, b in zip(periods, bits, strict=True) if period < PRINTED["period_ms"]]
    less = max(bits) - max(shorter, default=float("nan"))
    yield Judgement(
        37,
        f"most at {_ms(best)}: {shown}; "
        + (f"{less:.3f} less at a shorter period" if shorter else "no shorter period was asked"),
        bool(best == PRINTED["period_ms"] and less >= ALIKE) if shorter else None,
        f"below {ALIKE:g} bits are no loss; {size}; simulated drops vary less than drops by hand, which the thesis "
        "takes as the reason for its loss below 1 ms",
        reading,
    )
    if MARKED_MS in periods and periods[-1] > MARKED_MS:
        at = bits[periods.index(MARKED_MS)]
        before, after = max(bits) - at, at - bits[-1]
        yield Judgement(
            38,
            f"{before:.2f} bits lost from the best period to 5 ms, {after:.2f} more from there to {_ms(periods[-1])}",
            bool(after > before and after > 0.5),
            f"marked: half a bit or more, and more than up to 5 ms; {size}",
            reading,
        )


def _ms(period: float) -> str:
    return f"{period:g} ms"


def _by_parameter(lines: list[dict[str, Any]], size: str, reading: str) -> Iterator[Judgement]:
    for taken in kept_bits.LOST:
        lost, words = kept_bits.lost(lines, VARIED, taken)
        if len(lost) < len(VARIED):
            return
        worst, other = sorted(lost, key=lambda n: -lost[n])[:2]
        clear = lost[worst] - lost[other] >= ALIKE
        yield Judgement(
            39,
            words,
            bool(worst == "ball_mm" and clear),
            f"{VARIED[worst]} loses most{'' if clear else f', {VARIED[other]} as much within {ALIKE:g}'}; {size}",
            f"{reading}, {taken}",
        )


def _by_time(lines: list[dict[str, Any]], size: str, reading: str) -> Iterator[Judgement]:
    fast = [line for line in lines if line["period_ms"] <= FAST_MS]
    slow = [line for line in lines if line["period_ms"] > FAST_MS]
    if not fast or not slow:
        return
    wanted = PLATEAU * max(line["bits"] for line in fast)
    never = float("inf")
    reached = {line["period_ms"]: next((t for t, bits in line["times"] if bits >= wanted), never) for line in lines}
    latest = max(reached[line["period_ms"]] for line in fast)
    words = "; ".join(f"{_ms(t)}: {'never' if at == never else f'{at:g} ms'}" for t, at in reached.items())
    why = f"{PLATEAU:.0%} of the most that periods up to 2 ms reach in {LENGTH_MS:g} ms; {size}"
    yield Judgement(40, f"{words} for {wanted:.2f} bits", bool(latest <= PLATEAU_MS), why, reading)
    twice = all(reached[line["period_ms"]] >= 2 * latest for line in slow)
    yield Judgement(41, f"{words} for {wanted:.2f} bits", twice, why, reading)


def draw(p: Parameters, summary: Summary) -> list[Figure]:
    """Draw 5.11, 5.12 and 5.13."""
    return kept_bits.by_period_parameter_and_time(
        {**summary, "lines": summary["readings"][ONE]},
        figures=("5.11", "5.12", "5.13"),
        curves={"bits": "sampled from the impact on", "any_phase_bits": "at any phase"},
        named=VARIED,
        times_ms=p["times_ms"],
        since="impact",
    )
