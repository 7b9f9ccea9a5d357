"""Parts of messages: counts with their nouns, numbers, and errors of other libraries."""

from __future__ import annotations

__all__ = ["counted", "first_line", "installing", "plain"]


def counted(count: int, noun: str, plural: str | None = None) -> str:
    """Return a count with its noun, as "1 note" or "2 notes"; `plural` is for nouns whose plural is irregular."""
    return f"{count} {noun if count == 1 else plural or f'{noun}s'}"


def first_line(error: BaseException) -> str:
    """Return the first line of another library's error, at most 200 characters; its class if it has no text."""
    line = str(error).split("\n", maxsplit=1)[0] or type(error).__name__
    return line if len(line) <= 200 else f"{line[:197]}..."


def installing(extra: str) -> str:
    """Return the command that installs an extra, quoted, as shells read brackets as a pattern.

    Examples
    --------
    >>> installing("ros")
    "pip install 'taxel[ros]'"
    """
    return f"pip install 'taxel[{extra}]'"


def plain(value: float) -> str:
    """Return a number as people write it: a whole one of up to 16 digits without decimals or exponent.

    Examples
    --------
    >>> plain(4e7), plain(2.5), plain(float("inf"))
    ('40000000', '2.5', 'inf')
    """
    return f"{value:.0f}" if float(value).is_integer() and abs(value) < 1e16 else f"{value:.15g}"
