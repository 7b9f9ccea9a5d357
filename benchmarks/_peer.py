"""A peer in a process of its own, stopped where it takes too long."""

from __future__ import annotations

import importlib.util
import json
import os
import resource
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any


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


def ask(script: str, *arguments: object, limit: int) -> dict[str, Any]:
    """Run `script` in one thread; return what it says as JSON in its last line, or how it ended.

    Parameters
    ----------
    script : str
        A benchmark that is a program of its own where it is given arguments.
    *arguments : object
        As text.
    limit : int
        Seconds of CPU after which it is stopped.
    """

    def cap() -> None:
        resource.setrlimit(resource.RLIMIT_CPU, (limit, limit))

    said = subprocess.run(
        [sys.executable, script, *map(str, arguments)],
        preexec_fn=cap,
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "RAYON_NUM_THREADS"), "1"),
        cwd=Path(script).parent,
    )
    if said.returncode == 0:
        found: dict[str, Any] = json.loads(said.stdout.splitlines()[-1])
        return found
    if said.returncode in (-9, -24):
        return {"stopped": f"after {limit} s of CPU, without a verdict"}
    return {"failed": said.stderr.strip().splitlines()[-1:] or [f"exit status {said.returncode}"]}
