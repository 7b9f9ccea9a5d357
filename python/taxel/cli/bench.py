"""``taxel bench``: ratios against peers."""

from __future__ import annotations

import ast
import importlib.util
import json
import os
import subprocess
import sys
import textwrap
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any, BinaryIO

import typer

from taxel._base.child_process import ChildProcess
from taxel._base.commit import checkout_of
from taxel._base.files import write_whole
from taxel._base.messages import counted
from taxel._core import ProblemError
from taxel.cli._app import app
from taxel.cli._say import say

__all__ = ["bench", "doubts_of", "goals_of"]

#: How the rows begin that were measured with AVX2 alone (benchmarks/_instructions.py).
_AVX2 = "AVX2: "
_VERDICTS = ("reached", "not reached", "not measured")
#: The order in which goals are listed.
_ORDER = (*_VERDICTS[1:], _VERDICTS[0])
#: The share of all cores that other programs may use while times are measured.
_BUSY = 0.1


@app.command()
def bench(
    name: Annotated[
        str | None,
        typer.Argument(help="The name of a file of benchmarks/ without .py, or all; lists them if left out."),
    ] = None,
    folder: Annotated[Path, typer.Option(help="The folder of the benchmarks, in a checkout of taxel.")] = Path(
        "benchmarks"
    ),
    quick: Annotated[bool, typer.Option(help="Run few rounds, as a test; writes no result.")] = False,
    goals: Annotated[
        bool,
        typer.Option(
            "--goals",
            help="List the goals of the saved results, and what speaks against times; exit code 1 where a goal is not "
            "reached or not measured.",
        ),
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
) -> None:
    """Compare the speed of taxel with other libraries, in one run; write the ratios to benchmarks/results/.

    Peers that are not installed are left out, and named; a result that has them is then kept. Without NAME, the
    benchmarks are listed, with what each took last.

    Example: taxel bench wire_decode
    """
    files = {path.stem: path for path in sorted(folder.glob("[!_]*.py"))}
    if not files:
        raise ProblemError(
            f"{folder}: holds no benchmark; run this in a checkout of taxel, or name its folder by --folder"
        )
    if name is None and not goals:
        say(*(line for stem, file in files.items() for line in _listed(folder, stem, file)))
        return
    if name not in (None, "all", *files):
        raise ProblemError(f"no benchmark {name!r}: there are {', '.join(files)} and all")
    names = [name] if name in files else list(files)
    # The modules that benchmarks share lie in the same folder; their names begin with an underscore.
    sys.path.insert(0, str(folder.resolve()))
    if goals:
        if not _list_goals(folder, files, names):
            raise typer.Exit(1)
        return
    checkout = None if quick else checkout_of(folder)
    if checkout is not None and (changed := checkout.changed):
        raise ProblemError(
            f"{', '.join(changed[:3])}{' ...' * (len(changed) > 3)}: changed since the last commit, "
            "which a result names; commit first, or give --quick"
        )
    for stem in names:
        begun, others, benchmark = time.monotonic(), _Others(), _load(files[stem])
        result = _run(files[stem], quick=quick)
        result["took_s"] = round(time.monotonic() - begun, 1)
        result["date"] = time.strftime("%Y-%m-%d", time.gmtime())
        result["machine"]["others"] = others.cores()
        if not quick:
            place = folder / "results" / f"{stem}.json"
            place.parent.mkdir(exist_ok=True)
            lost = sorted(result.get("left out", {}).keys() - _saved(place).get("left out", {}).keys())
            if lost and place.exists():
                raise ProblemError(
                    f"{place}: not written, as it has {', '.join(lost)}, which is left out here; "
                    "make bench installs peers"
                )
            text = json.dumps(result, indent=1) + "\n"
            write_whole(place, partial(_put, text), overwrite=True)
            if not as_json:
                say(f"{stem}: written to {place}")
        if as_json:
            say(json.dumps(result))
        else:
            say(*_table(stem, result, benchmark))


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
    return f"other programs used {machine['others']:.1f} of {counted(machine['cores'], 'core')}"


def _measured(part: Mapping[str, Any], name: str = "result") -> list[tuple[str, Mapping[str, Any]]]:
    """Return the measured rows within a result, by their names."""
    rows = [(name, part)] if "cpu_s" in part else []
    inner = ((key, one) for key, one in part.items() if isinstance(one, dict))
    return rows + [row for key, one in inner for row in _measured(one, key)]


def _listed(folder: Path, stem: str, file: Path) -> list[str]:
    """Return a benchmark's name, what its last run took, and its question."""
    took = _saved(folder / "results" / f"{stem}.json").get("took_s")
    about = (ast.get_docstring(ast.parse(file.read_bytes())) or "").partition("\n")[0]
    first = f"{stem:<28}{'no result' if took is None else f'{took:.0f} s':>9}  "
    return _wrapped(about, first, " " * len(first))


def _saved(place: Path) -> dict[str, Any]:
    """Return a saved result, empty if there is none."""
    saved: dict[str, Any] = json.loads(place.read_text(encoding="utf-8")) if place.exists() else {}
    return saved


def _list_goals(folder: Path, files: Mapping[str, Path], names: Sequence[str]) -> bool:
    """Print the goals, those first that are not reached; return whether all are reached."""
    verdicts: list[str] = []
    absent = 0
    for name in names:
        result = _saved(folder / "results" / f"{name}.json")
        if not result:
            absent += 1
            say(f"{name}: no result", "")
            continue
        goals = goals_of(_load(files[name]), result)
        goals.sort(key=lambda goal: _ORDER.index(_verdict(goal)))
        verdicts += [_verdict(goal) for goal in goals]
        machine = result.get("machine", {})
        commit = f"commit {result.get('commit', 'unknown')}" + f", {result.get('date')}" * ("date" in result)
        about = [machine.get("cpu", "unknown processor"), commit, _others(machine)]
        about += [doubt for doubt in doubts_of(result) if doubt not in about]
        reached = sum(goal.reached for goal in goals)
        say(f"{name}: {reached} of {counted(len(goals), 'goal')} reached")
        say(*_wrapped("; ".join(about)))
        say(*(line for goal in goals for line in _row(goal, result)), "")
    counts = [f"{verdicts.count(one)} {one}" for one in _VERDICTS]
    say(f"{counted(len(verdicts), 'goal')}: {', '.join(counts)}")
    return not absent and set(verdicts) <= {_VERDICTS[0]}


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
    """How many cores other programs use, from here on; on Linux, else None."""

    def __init__(self) -> None:
        self._begun, self._before = time.monotonic(), self._used()

    def cores(self) -> float | None:
        """Return the mean number since the beginning."""
        used = self._used()
        if used is None or self._before is None:
            return None
        return max(0.0, (used - self._before) / (time.monotonic() - self._begun))

    @staticmethod
    def _used() -> float | None:
        """Return the CPU time of this computer less that of this process and its ended children, s."""
        try:
            line = Path("/proc/stat").read_text(encoding="ascii").splitlines()[0]
        except OSError:
            return None
        # user, nice, system, -, -, interrupts, soft interrupts, stolen by another virtual machine: proc(5)
        busy = sum(int(line.split()[1 + k]) for k in (0, 1, 2, 5, 6, 7)) / os.sysconf("SC_CLK_TCK")
        return busy - sum(os.times()[:4])


def _run(file: Path, *, quick: bool) -> dict[str, Any]:
    """Run a benchmark in a process of its own."""
    program, size = file.resolve().with_name("_alone.py"), "quick" if quick else "whole"
    # The benchmark and its own processes import modules of its folder.
    path = os.pathsep.join([str(program.parent), os.environ.get("PYTHONPATH", "")])
    with ChildProcess(program, [file.stem, size], env={"PYTHONPATH": path}, stdout=subprocess.PIPE, text=True) as child:
        printed, _ = child.communicate()
    if child.returncode:
        raise ProblemError(f"{file.stem}: ended with status {child.returncode}, without a result")
    result: dict[str, Any] = json.loads(printed.splitlines()[-1])
    return result


def _put(text: str, file: BinaryIO) -> None:
    file.write(text.encode())


def _load(path: Path) -> Any:
    spec = importlib.util.spec_from_file_location(f"taxel_benchmark_{path.stem}", path)
    if spec is None or spec.loader is None:
        raise ProblemError(f"{path}: cannot be loaded as Python")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # as an import does: a dataclass looks its module up
    spec.loader.exec_module(module)
    for name, arguments in (("run", "quick=..."), ("goals", "result")):
        if not hasattr(module, name):
            raise ProblemError(f"{path}: defines no {name}({arguments})")
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
