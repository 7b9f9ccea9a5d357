"""A progress bar on stderr for work whose amount is known."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from taxel._base.messages import escaped


@contextmanager
def bar(quiet: bool) -> Iterator[Callable[[str, int, int], None]]:
    """Show a bar; the function takes what is done next, how much is done, and all of it (0 if unknown)."""
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn  # noqa: PLC0415

    from taxel.cli.console import Console  # noqa: PLC0415  the command line starts quickly

    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TimeElapsedColumn(),
        TextColumn("{task.fields[left]}"),
    )
    console = Console(stderr=True)
    with Progress(*columns, console=console, transient=True, disable=quiet or not console.is_terminal) as shown:
        task, begun = shown.add_task("", total=None, left=""), time.monotonic()

        def update(step: str, done: int, total: int) -> None:
            nonlocal begun
            begun = begun if done else time.monotonic()
            left = f"{duration((time.monotonic() - begun) * (total - done) / done)} left" if done else ""
            shown.update(task, description=escaped(step), completed=done, total=total or None, left=left)

        yield update


def duration(seconds: float) -> str:
    """Return a time in words, as "8 s", "3 min" or "2.5 h"."""
    if seconds < 100:
        return f"{max(1, round(seconds))} s"
    return f"{round(seconds / 60)} min" if seconds < 6000 else f"{seconds / 3600:.1f} h"
