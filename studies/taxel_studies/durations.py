"""How long studies take, known before they begin: by what the runs of the kept figures took."""

from __future__ import annotations

from collections.abc import Iterable

__all__ = ["CPU_SECONDS", "LONG_S", "forecast", "forecast_all"]

#: The size of the kept run of each study that took a minute or more, and its seconds of CPU, on one core of an AMD EPYC
#: or an Intel Xeon; `studies/tests/test_durations.py` compares them with the kept figures.
CPU_SECONDS = {
    "contact": ("full", 3421),
    "asynchronous": ("full", 200),
    "drops": ("full", 294),
    "fa1": ("full", 94),
    "fig5.5": ("full", 5152),
    "fig5.7": ("full", 1257),
    "fig5.11": ("full", 728),
    "fig6.7": ("full", 2340),
    "fig6.9": ("full", 99),
    "fig6.10": ("full", 151),
    "fig6.15": ("full", 339),
    "gait": ("full", 457),
    "rivals": ("full", 2437),
    "stdp": ("full", 2520),
    "tempotron": ("full", 329),
    "touch": ("full", 795),
}
#: Work that takes longer says so before it begins, s.
LONG_S = 60.0


def forecast(name: str, size: str, share: float, jobs: int) -> str:
    """Return about how long a share of a study takes, and how that is known; "" below a minute and where it is not.

    Examples
    --------
    >>> forecast("gait", "full", 0.5, 1)
    'about 4 min in 1 process: the kept run took 457 s of CPU, and 50 % of it is to be computed'
    """
    kept_size, cpu_s = CPU_SECONDS.get(name, ("", 0))
    seconds = share * cpu_s / jobs
    if size != kept_size or seconds < LONG_S:
        return ""
    left = f"{100 * share:.0f} % of it is to be computed"
    return f"about {_duration(seconds)} in {_processes(jobs)}: the kept run took {cpu_s} s of CPU, and {left}"


def forecast_all(names: Iterable[str], size: str, jobs: int) -> str:
    """Return about how long several studies take at most, and how that is known; "" below a minute."""
    kept = [CPU_SECONDS[name][1] for name in names if CPU_SECONDS.get(name, ("", 0))[0] == size]
    seconds = sum(kept) / jobs
    if seconds < LONG_S:
        return ""
    return (
        f"about {_duration(seconds)} in {_processes(jobs)}, less what is there: the kept runs of {len(kept)} of them "
        f"took {sum(kept)} s of CPU; the others take less than a minute each, or are not known"
    )


def _duration(seconds: float) -> str:
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"


def _processes(jobs: int) -> str:
    return "1 process" if jobs == 1 else f"{jobs} processes"
