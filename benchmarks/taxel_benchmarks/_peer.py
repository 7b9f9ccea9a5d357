"""A peer in a process of its own, in turn with ours, stopped at a limit of CPU time."""

from __future__ import annotations

import importlib.util
import json
import os
import resource
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from taxel_benchmarks._rounds import measure, summary

#: Limits of a peer's CPU time, s: of a measurement, and of a quick run.
LIMIT_S, QUICK_S = 60, 3
#: CPU time up to which a peer runs in each round, s.
OFTEN_S = 3


#: The packages of modules that have another name.
PACKAGES = {"sklearn": "scikit-learn"}


def missing(peers: Mapping[str, str]) -> dict[str, str]:
    """Return the peers that cannot be measured here, and how to install them.

    Parameters
    ----------
    peers : by name, the modules that each needs, with spaces between them
    """
    lacks = {
        name: [module for module in modules.split() if importlib.util.find_spec(module) is None]
        for name, modules in peers.items()
    }
    return {
        name: f"{' and '.join(modules)} not installed: pip install {' '.join(PACKAGES.get(m, m) for m in modules)}"
        for name, modules in lacks.items()
        if modules
    }


def ask(script: str, *arguments: object, quick: bool) -> dict[str, Any]:
    """Run `script` in one thread; return the JSON of its last line of output, or how it ended.

    Parameters
    ----------
    script : str
        A benchmark, which runs one peer when it is started with arguments.
    *arguments : object
        Its arguments, passed as text.
    quick : bool
        Whether this is only a test, whose peers are stopped after 3 s of CPU and not after 60.
    """
    limit = QUICK_S if quick else LIMIT_S

    def cap() -> None:
        resource.setrlimit(resource.RLIMIT_CPU, (limit, limit))

    ran = subprocess.run(
        [sys.executable, "-P", script, *map(str, arguments)],
        preexec_fn=cap,
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "RAYON_NUM_THREADS"), "1"),
        cwd=Path(script).parent,
    )
    if ran.returncode == 0:
        found: dict[str, Any] = json.loads(ran.stdout.splitlines()[-1])
        return found
    if ran.returncode in (-9, -24):
        return {"stopped": f"after {limit} s of CPU, without a verdict", "limit_s": limit}
    return {"failed": ran.stderr.strip().splitlines()[-1:] or [f"exit status {ran.returncode}"]}


def in_turn(
    ours: Callable[[], Any], peers: Mapping[str, Callable[[], dict[str, Any]]], rounds: int
) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
    """Measure ours and each peer in turn; return ours, and what each peer found with `times`: its time over ours.

    A peer that takes above `OFTEN_S` or is stopped runs once, and its time is over our median; of the others `times` is
    the median over the rounds, `quartiles` theirs. One that failed has none.
    """
    mine: list[dict[str, Any]] = []
    found: dict[str, dict[str, Any]] = {}
    seconds: dict[str, list[float]] = {name: [] for name in peers}
    for turn in range(rounds):
        mine.append(measure({"ours": ours}, rounds=1, warm_up=not turn)["ours"])
        for name, run in peers.items():
            if not turn or found[name].get("cpu_s", LIMIT_S) <= OFTEN_S:
                found[name] = run()
                if "failed" not in found[name]:
                    seconds[name].append(found[name].get("cpu_s", found[name].get("limit_s")))
    cpu = [one["cpu_s"]["median"] for one in mine]
    for name, one in found.items():
        if not seconds[name]:
            continue
        over = cpu if len(seconds[name]) == rounds else [float(np.median(cpu))]
        low, one["times"], high = np.percentile(np.array(seconds[name][: len(over)]) / over, [25, 50, 75]).tolist()
        one |= {"rounds": len(over), "quartiles": [low, high]}
    return summary(cpu, [one["wall_s"]["median"] for one in mine]), found


def ratios_of(cases: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Return what a result says of peers: ratios, their quartiles, and those of stopped peers, which are larger.

    Those of peers with rows on demand, which do as ours does, come first.
    """
    rows = {f"{case}, {name}": one for case, all_of in cases.items() for name, one in all_of.items() if "times" in one}
    rows = dict(sorted(rows.items(), key=lambda row: not row[0].endswith("on demand")))
    return {
        "ratios": {name: one["times"] for name, one in rows.items()},
        "spread": {name: one["quartiles"] for name, one in rows.items() if one["rounds"] > 1},
        "larger": [name for name, one in rows.items() if "stopped" in one],
    }
