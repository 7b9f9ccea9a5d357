"""Parts of messages: counts with their nouns, and errors of other libraries."""

from __future__ import annotations

__all__ = ["counted", "first_line"]


def counted(count: int, noun: str, plural: str | None = None) -> str:
    """Return a count with its noun, as "1 note" or "2 notes"; `plural` is for nouns whose plural is irregular."""
    return f"{count} {noun if count == 1 else plural or f'{noun}s'}"


def first_line(error: BaseException) -> str:
    """Return the first line of another library's error, at most 200 characters; its class if it has no text."""
    line = str(error).split("\n", maxsplit=1)[0] or type(error).__name__
    return line if len(line) <= 200 else f"{line[:197]}..."
