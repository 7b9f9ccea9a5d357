"""``taxel bench``: ratios against peers."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

import psutil

import taxel_benchmarks
from taxel import ProblemError
from taxel.cli.app import App, JsonOption, say

__all__ = ["app", "bench", "benchmarks", "doubts_of"]

app = App(name="bench")

#: The order in which goals are listed.
_ORDER = ("not reached", "not measured", "reached")
#: Where results are saved.
RESULTS = Path("benchmarks/results")
#: The share of all cores that other programs may use while times are measured.
_BUSY = 0.1


@app.default
def bench(
    name: str | None = None,
    /,
    *,
    results: Path = RESULTS,
    quick: bool = False,
    goals: bool = False,
    as_json: JsonOption = False,
) -> int:
    """Compare the speed of taxel with other libraries, in one run; save the ratios.

    A new result is compared with the saved one: a ratio fell if it changed by more than the quartiles of its rounds are
    apart. Peers that are not installed are left out, with how to install them; a result that has them is then kept.
    Without NAME, the benchmarks are listed, with what each took last.

    Example: taxel bench wire_decode

    Parameters
    ----------
    name
        The name of a benchmark, or all; lists them if left out.
    results
        Folder of the saved results: of a checkout of taxel.
    quick
        Run few rounds, as a test; writes no result.
    goals
        List the goals of the saved results, and what speaks against times; exit code 1 where a goal is not reached or
        not measured.
    """
    from taxel_benchmarks._rounds import question_of  # noqa: PLC0415  the command line starts quickly
    from taxel_studies.commit import code_version  # noqa: PLC0415

    known = benchmarks()
    if name is None and not goals:
        for one, benchmark in known.items():
            took = _saved(results / f"{one}.json").get("took_s")
            say(f"{one:<28}{'no result' if took is None else f'{took:.0f} s':>9}  {question_of(benchmark)}")
        return 0
    if name not in (None, "all", *known):
        raise ProblemError(f"no benchmark {name!r}: there are {', '.join(known)} and all")
    wanted = {str(name): known[str(name)]} if name in known else known
    if not (quick or results.is_dir()):
        raise ProblemError(f"{results}: no such folder; run this in a checkout of taxel, or name it by --results")
    if goals:
        return 0 if _list_goals(results, wanted) else 1
    if not quick and "with local changes" in code_version("taxel", "taxel_benchmarks"):
        raise ProblemError("local changes since the last commit, which a result names: commit first, or give --quick")
    for one, benchmark in wanted.items():
        result, saved = _measured(one, quick=quick), _saved(results / f"{one}.json")
        if not quick:
            _save(result, results / f"{one}.json")
        if as_json:
            say(json.dumps(result))
            continue
        say(f"{one}: ratios to peers, other figures and goals, with quartiles of rounds; {result['took_s']:g} s")
        say(*_rows(benchmark, result, result.get("ratios", {})))
        say(*(f"  left out: {peer}: {why}" for peer, why in result.get("left out", {}).items()))
        say(*(f"  {doubt}" for doubt in doubts_of(result)))
        if saved and not quick:
            say(*_compared(benchmark, result, saved))
    return 0


def benchmarks() -> dict[str, Any]:
    """Return the benchmarks by name: the modules without an underscore, and what a module lists as ``BENCHMARKS``."""
    files = (path for folder in taxel_benchmarks.__path__ for path in sorted(Path(folder).glob("[!_]*.py")))
    modules = {path.stem: import_module(f"taxel_benchmarks.{path.stem}") for path in files}
    return {
        name: one
        for stem, module in modules.items()
        for name, one in getattr(module, "BENCHMARKS", {stem: module}).items()
    }


def _measured(name: str, *, quick: bool) -> dict[str, Any]:
    """Run a benchmark; add what it took, the date, and how many cores other programs used."""
    from taxel_benchmarks._rounds import alone  # noqa: PLC0415  the command line starts quickly

    begun, before = time.monotonic(), _others_s()
    result = alone(name, quick=quick)
    took = time.monotonic() - begun
    result |= {"took_s": round(took, 1), "date": time.strftime("%Y-%m-%d", time.gmtime())}
    result["machine"]["others"] = max(0.0, (_others_s() - before) / took)
    return result


def _others_s() -> float:
    """Return the CPU time of this computer less that of this process and its ended children, s."""
    times: dict[str, float] = psutil.cpu_times()._asdict()
    # A guest's time is in that of its user.
    return sum(times[name] for name in times.keys() - {"idle", "iowait", "guest", "guest_nice"}) - sum(os.times()[:4])


def _save(result: Mapping[str, Any], place: Path) -> None:
    """Save a result, unless the one that is there has peers that are left out."""
    from taxel.report import write_whole  # noqa: PLC0415  the command line starts quickly

    lost = sorted(result.get("left out", {}).keys() - _saved(place).get("left out", {}).keys())
    if lost and place.exists():
        how = "; ".join(f"{peer} ({result['left out'][peer]})" for peer in lost)
        raise ProblemError(f"{place}: not written, as it has peers that are left out here: {how}")
    text = json.dumps(result, indent=1) + "\n"
    write_whole(place, lambda file: file.write(text.encode()), overwrite=True)


def _saved(place: Path) -> dict[str, Any]:
    """Return a saved result, empty if there is none."""
    saved: dict[str, Any] = json.loads(place.read_text(encoding="utf-8")) if place.exists() else {}
    return saved


def doubts_of(result: Mapping[str, Any]) -> list[str]:
    """Return what speaks against the times of a result: other programs, times that vary."""
    machine = result.get("machine", {})
    others = machine.get("others")
    doubts = [_others(machine)] * (others is None or others > _BUSY * machine["cores"])
    return doubts + ["quartiles more than 15 % of the median apart"] * (result.get("stable") is False)


def _compared(benchmark: Any, result: Mapping[str, Any], saved: Mapping[str, Any]) -> list[str]:
    """Return which ratios fell, or rose where a goal wants less, by more than the quartiles of their rounds are apart.

    The wider of both results counts; a ratio without rounds may vary as much as times that are called stable.
    """
    from taxel_benchmarks._rounds import WIDEST  # noqa: PLC0415  the command line starts quickly

    shrinking = {goal.what for goal in benchmark.goals(result) if goal.at_most}
    fallen = []
    for name, was in saved.get("ratios", {}).items():
        if was is None or (now := result["ratios"].get(name)) is None:
            continue
        spreads = [
            high - low for low, high in (of["spread"][name] for of in (saved, result) if name in of.get("spread", {}))
        ]
        spread = max(spreads, default=WIDEST * abs(was))
        if (now - was if name in shrinking else was - now) > spread:
            fallen.append(f"    {name}: {was:.5g} before, {now:.5g} now, spread {spread:.3g}")
    about = [f"commit {saved.get('commit', 'unknown')}", saved.get("date"), saved.get("machine", {}).get("cpu")]
    worse = f"{len(fallen)} of {len(saved.get('ratios', {}))} ratios fell by more than their spread"
    return [f"  against the result before ({', '.join(filter(None, about))}): {worse}", *fallen]


def _others(machine: Mapping[str, Any]) -> str:
    """Return how much other programs ran during a measurement."""
    if machine.get("others") is None:
        return f"what other programs used was not measured, load {machine.get('load', float('nan')):.1f}"
    return f"other programs used {machine['others']:.1f} of {machine['cores']} cores"


def _list_goals(results: Path, wanted: Mapping[str, Any]) -> bool:
    """Print the goals, those first that are not reached; return whether all are reached."""
    verdicts: list[str] = []
    for name, benchmark in wanted.items():
        result = _saved(results / f"{name}.json")
        if not result:
            verdicts.append("not measured")
            say(f"{name}: no result", "")
            continue
        found = [goal.verdict for goal in benchmark.goals(result)]
        machine = result.get("machine", {})
        about = [machine.get("cpu", "unknown processor"), f"commit {result.get('commit', 'unknown')}"]
        about += [str(result.get("date", "")), _others(machine), *doubts_of(result)]
        say(f"{name}: {found.count('reached')} of {len(found)} goals reached")
        say(f"  {'; '.join(filter(None, dict.fromkeys(about)))}", *_rows(benchmark, result, {}), "")
        verdicts += found
    say(f"{len(verdicts)} goals: " + ", ".join(f"{verdicts.count(one)} {one}" for one in reversed(_ORDER)))
    return set(verdicts) <= {"reached"}


def _rows(benchmark: Any, result: Mapping[str, Any], figures: Mapping[str, Any]) -> list[str]:
    """Return a row for each goal and each other figure: verdict, figure, limit, name and the quartiles of rounds."""
    goals = sorted(benchmark.goals(result), key=lambda goal: _ORDER.index(goal.verdict))
    rows = [(g.verdict, g.what, g.figure, f"{'<=' if g.at_most else '>='} {g.limit:<10.5g}") for g in goals]
    rows += [("", name, figure, "") for name, figure in figures.items() if name not in {goal.what for goal in goals}]
    lines = []
    for verdict, name, value, limit in rows:
        shown = "" if value is None else f"{value:.5g}" if isinstance(value, float) else str(value)
        # The figure of a peer that was stopped is a bound.
        shown = "> " * (name in result.get("larger", ())) + shown
        spread = result.get("spread", {}).get(name)
        rounds = "" if spread is None else f" ({spread[0]:.3g} to {spread[1]:.3g})"
        lines.append(f"  {verdict:<13}{shown:>10} {limit:<13} {name}{rounds}")
    return lines
