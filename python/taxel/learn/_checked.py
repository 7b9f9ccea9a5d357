"""The examples of a check: those of a fit, or an error."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel._base.arguments import several, shown
from taxel._base.errors import refused
from taxel._base.messages import counted
from taxel._core import ProblemError
from taxel.learn._examples import examples, windows
from taxel.learn.cone_r import ConeR
from taxel.learn.cone_x import ConeX
from taxel.spikes import SpikeTrains


def fitted(cone: object) -> NDArray[np.float64]:
    """Return the weights of a fit; refuse what is none."""
    if not isinstance(cone, ConeX | ConeR):
        raise refused("cone", f" is {shown(cone)}: must be a taxel.learn.ConeX or taxel.learn.ConeR")
    return cone._fitted()


def checked_examples(
    cone: ConeX | ConeR,
    trains: int,
    patterns: Sequence[SpikeTrains],
    targets: Sequence[ArrayLike],
    silence: Sequence[ArrayLike | None] | None = None,
) -> tuple[list[SpikeTrains], list[NDArray[np.float64]], list[Any]]:
    """Return patterns, targets and windows; refuse others than those of a fit of this many weights."""
    _, times = examples(patterns, targets)
    cone._check()
    each = [None] * len(times) if silence is None else several("silence", silence)
    silences = [windows(f"silence of pattern {p}", silence) for p, silence in enumerate(each)]
    trained = several("patterns", patterns)
    if not len(trained) == len(times) == len(silences) or not trained:
        raise ProblemError(
            f"{counted(len(trained), 'pattern')}, {counted(len(times), 'list')} of targets"
            + f" and {len(silences)} of silence" * (silence is not None)
            + ": must be one of each per pattern, and one pattern or more"
        )
    for p, pattern in enumerate(trained):
        if len(pattern) != trains:
            raise ProblemError(f"pattern {p}: {counted(len(pattern), 'train')}; must be {trains}, as in the fit")
        if pattern.kind == "signed":
            raise ProblemError(f"pattern {p}: spikes are signed; split them into ON and OFF trains (split_by_sign)")
        for k in np.flatnonzero(~((pattern.start <= times[p]) & (times[p] <= pattern.stop)))[:1]:
            window = f"{pattern.start:g} to {pattern.stop:g} ms"
            raise ProblemError(
                f"pattern {p}, target {k}: {shown(times[p][k].item())} ms is outside the pattern's window {window}"
            )
        if (np.diff(times[p]) <= 0).any():
            raise ProblemError(f"targets of pattern {p}: must ascend")
    for name, bound in (("lb", cone.lb), ("ub", cone.ub)):
        if np.ndim(bound) and np.size(bound) != trains:
            raise refused(name, f": {np.size(bound)} bounds for {trains} trains; must be one per train, or one for all")
    horizon = np.asarray(0.0 if cone.horizon is None else cone.horizon)
    if horizon.ndim and horizon.size != len(trained):
        raise refused(
            "horizon",
            f": {horizon.size} values for {counted(len(trained), 'pattern')}; must be one per pattern, or one for all",
        )
    return trained, times, silences
