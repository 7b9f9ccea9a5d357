"""``taxel bench``: ratios against peers."""

from __future__ import annotations

import ast
import json
import os
import subprocess
import sys
import textwrap
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any, BinaryIO

import psutil

import taxel_benchmarks
from taxel import ProblemError
from taxel.cli.app import App, JsonOption, say

__all__ = ["app", "bench", "doubts_of", "goals_of", "load"]

app = App(name="bench")

#: How the rows begin that were measured with AVX2 alone (`_instructions`).
_AVX2 = "AVX2: "
_VERDICTS = ("reached", "not reached", "not measured")
#: The order in which goals are listed.
_ORDER = (*_VERDICTS[1:], _VERDICTS[0])
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

    Peers that are not installed are left out, and named; a result that has them is then kept. Without NAME, the
    benchmarks are listed, with what each took last.

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
    from taxel.report import write_whole  # noqa: PLC0415  the command line starts quickly
    from taxel_studies.commit import code_version  # noqa: PLC0415

    # The modules that benchmarks share have names that begin with an underscore.
    files = {path.stem: path for folder in taxel_benchmarks.__path__ for path in sorted(Path(folder).glob("[!_]*.py"))}
    if name is None and not goals:
        say(*(line for stem, file in files.items() for line in _listed(results, stem, file)))
        return 0
    if name not in (None, "all", *files):
        raise ProblemError(f"no benchmark {name!r}: there are {', '.join(files)} and all")
    names = [str(name)] if name in files else list(files)
    if not (quick or results.is_dir()):
        raise ProblemError(f"{results}: no such folder; run this in a checkout of taxel, or name it by --results")
    if goals:
        return 0 if _list_goals(results, names) else 1
    if not quick and "with local changes" in code_version("taxel", "taxel_benchmarks"):
        raise ProblemError("local changes since the last commit, which a result names: commit first, or give --quick")
    for stem in names:
        begun, others, benchmark = time.monotonic(), _Others(), load(stem)
        result = _run(stem, quick=quick)
        result["took_s"] = round(time.monotonic() - begun, 1)
        result["date"] = time.strftime("%Y-%m-%d", time.gmtime())
        result["machine"]["others"] = others.cores()
        if not quick:
            place = results / f"{stem}.json"
            lost = sorted(result.get("left out", {}).keys() - _saved(place).get("left out", {}).keys())
            if lost and place.exists():
                raise ProblemError(
                    f"{place}: not written, as it has {', '.join(lost)}, which is left out here; "
                    "make bench installs peers"
                )
            write_whole(place, partial(_put, json.dumps(result, indent=1) + "\n"), overwrite=True)
            if not as_json:
                say(f"{stem}: written to {place}")
        if as_json:
            say(json.dumps(result))
        else:
            say(*_table(stem, result, benchmark))
    return 0


def goals_of(benchmark: Any, result: Mapping[str, Any]) -> list[Any]:
    """Return the goals with what a result reached, and those of AVX2 alone where it was measured beside the best."""
    best = list(benchmark.goals(result))
    if "avx2" not in result:
        return best
    ratios = result["ratios"]
    capped = {name.removeprefix(_AVX2): value for name, value in ratios.items() if name.startswith(_AVX2)}
    alone = benchmark.goals({**result, "ratios": ratios | capped})
    # A figure that does not depend on the instructions is listed once.
    return best + [replace(goal, what=_AVX2 + goal.what) for goal in alone if goal not in best]


def doubts_of(result: Mapping[str, Any]) -> list[str]:
    """Return what speaks against the times of a result: other programs, times that vary."""
    machine = result.get("machine", {})
    others = machine.get("others")
    doubts = [_others(machine)] * (others is None or others > _BUSY * machine["cores"])
    # With AVX2 alone a row has the same name.
    vary = list(dict.fromkeys(name for name, one in _measured(result) if one.get("stable") is False))
    doubts += ["not stable by its own judgement"] * (not vary and result.get("stable") is False)
    more = f" and {len(vary) - 2} more" * (len(vary) > 2)
    return doubts + [f"quartiles more than 15 % of the median apart: {'; '.join(vary[:2])}{more}"] * bool(vary)


def _others(machine: Mapping[str, Any]) -> str:
    """Return how much other programs ran during a measurement."""
    if machine.get("others") is None:
        return f"what other programs used was not measured, load {machine.get('load', float('nan')):.1f}"
    return f"other programs used {machine['others']:.1f} of {machine['cores']} cores"


def _measured(part: Mapping[str, Any], name: str = "result") -> list[tuple[str, Mapping[str, Any]]]:
    """Return the measured rows within a result, by their names."""
    rows = [(name, part)] if "cpu_s" in part else []
    inner = ((key, one) for key, one in part.items() if isinstance(one, dict))
    return rows + [row for key, one in inner for row in _measured(one, key)]


def _listed(results: Path, stem: str, file: Path) -> list[str]:
    """Return a benchmark's name, what its last run took, and its question."""
    took = _saved(results / f"{stem}.json").get("took_s")
    about = (ast.get_docstring(ast.parse(file.read_bytes())) or "").partition("\n")[0]
    first = f"{stem:<28}{'no result' if took is None else f'{took:.0f} s':>9}  "
    return _wrapped(about, first, " " * len(first))


def _saved(place: Path) -> dict[str, Any]:
    """Return a saved result, empty if there is none."""
    saved: dict[str, Any] = json.loads(place.read_text(encoding="utf-8")) if place.exists() else {}
    return saved


def _list_goals(results: Path, names: Sequence[str]) -> bool:
    """Print the goals, those first that are not reached; return whether all are reached."""
    verdicts: list[str] = []
    absent = 0
    for name in names:
        result = _saved(results / f"{name}.json")
        if not result:
            absent += 1
            say(f"{name}: no result", "")
            continue
        goals = goals_of(load(name), result)
        goals.sort(key=lambda goal: _ORDER.index(_verdict(goal)))
        verdicts += [_verdict(goal) for goal in goals]
        machine = result.get("machine", {})
        commit = f"commit {result.get('commit', 'unknown')}" + f", {result.get('date')}" * ("date" in result)
        about = [machine.get("cpu", "unknown processor"), commit, _others(machine)]
        about += [doubt for doubt in doubts_of(result) if doubt not in about]
        reached = sum(goal.reached for goal in goals)
        say(f"{name}: {reached} of {_goals(len(goals))} reached")
        say(*_wrapped("; ".join(about)))
        say(*(line for goal in goals for line in _row(goal, result)), "")
    counts = [f"{verdicts.count(one)} {one}" for one in _VERDICTS]
    say(f"{_goals(len(verdicts))}: {', '.join(counts)}")
    return not absent and set(verdicts) <= {_VERDICTS[0]}


def _goals(count: int) -> str:
    return f"{count} goal{'s' * (count != 1)}"


def _wrapped(text: str, first: str = "  ", later: str = "  ") -> list[str]:
    return textwrap.wrap(text, 80, initial_indent=first, subsequent_indent=later, break_on_hyphens=False)


def _verdict(goal: Any) -> str:
    reached, lacks, unknown = _VERDICTS
    return unknown if goal.figure is None else reached if goal.reached else lacks


def _row(goal: Any, result: Mapping[str, Any]) -> list[str]:
    """Return a goal as a row: whether it is reached, the figure, the limit, the name, and the quartiles of rounds."""
    figure = "" if goal.figure is None else _figure(goal.what, goal.figure, result, 5)
    first = f"  {_verdict(goal):<13}{figure:>10} {'<=' if goal.at_most else '>='} {goal.limit:<10.5g} "
    spread = result.get("spread", {}).get(goal.what)
    rounds = "" if spread is None else f" ({spread[0]:.3g} to {spread[1]:.3g})"
    return _wrapped(goal.what + rounds, first, " " * len(first))


class _Others:
    """How many cores other programs use, from here on."""

    def __init__(self) -> None:
        self._begun, self._before = time.monotonic(), self._used()

    def cores(self) -> float:
        """Return the mean number since the beginning."""
        return max(0.0, (self._used() - self._before) / (time.monotonic() - self._begun))

    @staticmethod
    def _used() -> float:
        """Return the CPU time of this computer less that of this process and its ended children, s."""
        times: dict[str, float] = psutil.cpu_times()._asdict()
        # A guest's time is in that of its user.
        busy = sum(times[name] for name in times.keys() - {"idle", "iowait", "guest", "guest_nice"})
        return busy - sum(os.times()[:4])


def _run(name: str, *, quick: bool) -> dict[str, Any]:
    """Run a benchmark in a process of its own."""
    command = [sys.executable, "-P", "-m", "taxel_benchmarks._alone", name, "quick" if quick else "whole"]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=False)
    if done.returncode:
        raise ProblemError(f"{name}: ended with status {done.returncode}, without a result")
    result: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return result


def _put(text: str, file: BinaryIO) -> None:
    file.write(text.encode())


def load(name: str) -> Any:
    """Return the module of a benchmark.

    Raises
    ------
    ProblemError : a module without the functions of a benchmark
    """
    module = import_module(f"taxel_benchmarks.{name}")
    for function, arguments in (("run", "quick=..."), ("goals", "result")):
        if not hasattr(module, function):
            raise ProblemError(f"{module.__file__}: defines no {function}({arguments})")
    return module


def _figure(name: str, value: Any, result: Mapping[str, Any], digits: int) -> str:
    """Return a figure as text; one of a peer that was stopped is a bound."""
    larger = "> " * (name.removeprefix(_AVX2) in result.get("larger", ()))
    return larger + (f"{value:.{digits}g}" if isinstance(value, float) else str(value))


def _better(name: str, benchmark: Any) -> str:
    """Return which figures of this name are better, by the words that the benchmark states."""
    if any(word in name for word in getattr(benchmark, "COUNTS", ())):
        return "counts"
    return (
        "smaller is better" if any(word in name for word in getattr(benchmark, "SMALLER", ())) else "larger is better"
    )


def _table(stem: str, result: Mapping[str, Any], benchmark: Any) -> list[str]:
    groups: dict[str, list[str]] = {}
    for name, one in result.get("ratios", {}).items():
        rounds = result.get("spread", {}).get(name)
        spread = "" if rounds is None else f" ({rounds[0]:.3g} to {rounds[1]:.3g})"
        groups.setdefault(_better(name, benchmark), []).append(f"    {name}: {_figure(name, one, result, 3)}{spread}")
    rows = [row for better, of in groups.items() for row in (f"  {better}:", *of)]
    left_out = [f"  left out: {peer}: {why}" for peer, why in result.get("left out", {}).items()]
    head = f"{stem}: ratios to peers and other figures, with quartiles of rounds; {result['took_s']:g} s"
    lacks = [line for goal in goals_of(benchmark, result) if not goal.reached for line in _row(goal, result)]
    doubts = [f"  {doubt}" for doubt in doubts_of(result)]
    return [head, *rows, *left_out, *lacks, *doubts]
