"""A peer in a process of its own, stopped at a limit of CPU time; times of minutes are saved.

A peer has a minute of CPU. One that needs more is stopped, unless ``taxel bench --peers`` (`PATIENT`) waits for it:
then its time is saved in ``results/peers.json`` with the date, the processor, and a digest of the benchmark's
code with the peer's version. It is valid on that processor alone, until one of them changes.
"""

from __future__ import annotations

import importlib.util
import json
import os
import resource
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from _rounds import measure, processor, summary, version

from taxel.report import Sources, write_whole

#: Environment variable: set if the benchmarks wait for peers that need minutes.
PATIENT = "TAXEL_BENCH_PEERS"
#: Limits of a peer's CPU time without waiting, and in a quick run, s; longer times than the first are saved.
LONG_S, QUICK_S = 60, 3
#: CPU time up to which a peer runs in each round, s.
OFTEN_S = 3
KEPT = Path(__file__).parent / "results" / "peers.json"


def missing(peers: Mapping[str, str]) -> dict[str, str]:
    """Return the peers that cannot be measured here, and why.

    Parameters
    ----------
    peers : by name, the modules that each needs, with spaces between them
    """
    lacks = {
        name: [module for module in modules.split() if importlib.util.find_spec(module) is None]
        for name, modules in peers.items()
    }
    return {name: f"{' and '.join(modules)} not installed" for name, modules in lacks.items() if modules}


def ask(script: str, *arguments: object, packages: str, limit: int, quick: bool) -> dict[str, Any]:
    """Run `script` in one thread; return the JSON of its last line of output, or how it ended.

    Parameters
    ----------
    script : str
        A benchmark, which runs one peer when it is started with arguments.
    *arguments : object
        Its arguments, passed as text.
    packages : str
        The peer's packages, with spaces between them; a saved time is valid for their versions.
    limit : int
        CPU time after which the peer is stopped if the benchmark waits for it, s.
    quick : bool
        Whether this is only a test: saved times are neither read nor written.

    Returns
    -------
    dict
        With ``kept``, date and processor, if it was not measured in this run.
    """
    name = " ".join([Path(script).stem, *map(str, arguments)])
    key = {"cpu": processor(), "digest": _digest(script, packages)}
    kept = {} if quick or not KEPT.exists() else json.loads(KEPT.read_text())
    if name in kept and {part: kept[name][part] for part in key} == key:
        return kept[name]["found"] | {"kept": f"{kept[name]['date']}, {key['cpu']}"}
    patient = bool(os.environ.get(PATIENT)) and not quick
    found = _run(script, arguments, limit if patient else QUICK_S if quick else LONG_S)
    if patient and ("stopped" in found or found.get("cpu_s", 0.0) > LONG_S):
        kept[name] = key | {"date": time.strftime("%Y-%m-%d", time.gmtime()), "found": found}
        text = json.dumps(kept, indent=1, sort_keys=True) + "\n"
        write_whole(KEPT, lambda file: file.write(text.encode()), overwrite=True)
    return found


def in_turn(
    ours: Callable[[], Any], peers: Mapping[str, Callable[[], dict[str, Any]]], rounds: int
) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
    """Measure ours and each peer in turn; return ours, and what each peer found with `times`: its time over ours.

    A peer that takes above `OFTEN_S`, is stopped or has a saved time runs once, and its time is over our median; of the
    others `times` is the median over the rounds, `quartiles` theirs. One that failed has none.
    """
    mine: list[dict[str, Any]] = []
    found: dict[str, dict[str, Any]] = {}
    seconds: dict[str, list[float]] = {name: [] for name in peers}
    for turn in range(rounds):
        mine.append(measure({"ours": ours}, rounds=1, warm_up=not turn)["ours"])
        for name, run in peers.items():
            if not turn or ("kept" not in found[name] and found[name].get("cpu_s", LONG_S) <= OFTEN_S):
                found[name] = run()
                if "failed" not in found[name]:
                    seconds[name].append(found[name].get("cpu_s", found[name].get("limit_s", LONG_S)))
    cpu = [one["cpu_s"]["median"] for one in mine]
    for name, one in found.items():
        if not seconds[name]:
            continue
        over = cpu if len(seconds[name]) == rounds else [float(np.median(cpu))]
        low, one["times"], high = np.percentile(np.array(seconds[name][: len(over)]) / over, [25, 50, 75]).tolist()
        one |= {"rounds": len(over), "quartiles": [low, high]}
    return summary(cpu, [one["wall_s"]["median"] for one in mine]), found


def kept_of(cases: Mapping[str, Mapping[str, Any]]) -> dict[str, str]:
    """Return date and processor of the times that were not measured in this run, by case and peer."""
    return {
        f"{case}, {name}": found["kept"]
        for case, all_of in cases.items()
        for name, found in all_of.items()
        if isinstance(found, dict) and "kept" in found
    }


def _digest(script: str, packages: str) -> str:
    """Return a digest of the benchmark's own code and of the versions of a peer's packages."""
    own = Sources({Path(script).stem: Path(script)}, {}, without=("goals", "_goals")).digest(Path(script).stem)
    return " ".join([own, *(version(package) for package in packages.split())])


def _run(script: str, arguments: tuple[object, ...], limit: int) -> dict[str, Any]:
    def cap() -> None:
        resource.setrlimit(resource.RLIMIT_CPU, (limit, limit))

    ran = subprocess.run(
        [sys.executable, script, *map(str, arguments)],
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
