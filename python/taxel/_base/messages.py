"""Parts of messages: counts with their nouns, numbers, control characters, errors of other libraries; warnings.

Names in files of strangers may hold control characters, which move a terminal's cursor, or reverse the order of what is
read. Files and JSON keep such names; what people read shows them escaped. The places where text leaves taxel escape it,
so that no message has to: `taxel.Error` (in `errors`), `warn` (here), `taxel.cli.say`, the `Console` of
`taxel.cli.console`, the pages of reports, and the page's `dom.js`. A `__repr__` that shows a text escapes it itself.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

#: C0, DEL and C1, the marks and overrides of direction, the separators of lines and paragraphs, and halves of surrogate
#: pairs, which represent bytes of file names that are not UTF-8. `python/taxel/panel/web/dom.js` has the same.
_CONTROL = re.compile("[\x00-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")


def escaped(text: object) -> str:
    r"""Return a text as one line without control characters: each is escaped as in a literal of Python.

    Examples
    --------
    >>> print(escaped("thumb\x1b[2J\nleft\u202e"))
    thumb\x1b[2J\nleft\u202e
    """
    return _CONTROL.sub(_escape, str(text))


def _escape(found: re.Match[str]) -> str:
    # TOML and JSON, whose lines may be copied from a message, know no \\x, but escape C0 themselves.
    return repr(found[0])[1:-1] if found[0] < "\x7f" else f"\\u{ord(found[0]):04x}"


def escaped_lines(text: object) -> str:
    """Return a text of several lines without control characters but its line breaks."""
    return "\n".join(map(escaped, str(text).split("\n")))


#: The warnings of the work that this thread does now, where they are collected.
_texts: ContextVar[list[str] | None] = ContextVar("texts", default=None)


@contextmanager
def collected() -> Iterator[list[str]]:
    """Collect the warnings of what this thread does as texts, each once; Python then issues none.

    The filters of Python's own module belong to the whole process, and a panel runs several threads.
    """
    texts: list[str] = []
    before = _texts.set(texts)
    try:
        yield texts
    finally:
        _texts.reset(before)


def warn(text: str, category: type[Warning] = UserWarning, *, stacklevel: int = 1) -> None:
    """Issue a warning of Python, without control characters; `stacklevel` counts as in `warnings.warn`.

    Within `collected` it is collected.
    """
    texts = _texts.get()
    if texts is not None and issubclass(category, UserWarning):
        texts += [] if escaped(text) in texts else [escaped(text)]
        return
    warnings.warn(escaped(text), category, stacklevel=stacklevel + 1)  # noqa: TID251  the place where it is allowed


def counted(count: int, noun: str, plural: str | None = None) -> str:
    """Return a count with its noun, as "1 note" or "2 notes"; `plural` is for nouns whose plural is irregular."""
    return f"{count} {noun if count == 1 else plural or f'{noun}s'}"


def are(count: int) -> str:
    """Return the verb of so many: "is" or "are"."""
    return "is" if count == 1 else "are"


def three_digits(value: float, sign: str = "") -> str:
    """Return a number with three digits, from 1000 to a million as a whole one; `sign`: "+" shows that of all.

    Examples
    --------
    >>> three_digits(0.12345), three_digits(999.6, "+"), three_digits(1004.2), three_digits(-2e6)
    ('0.123', '+1000', '1004', '-2e+06')
    """
    return f"{value:{sign}.0f}" if 999.5 <= abs(value) < 1e6 else f"{value:{sign}.3g}"


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


def plain(value: float, digits: int = 17) -> str:
    """Return a number as people write it: a whole one of up to 16 digits without decimals or exponent.

    It is rounded to `digits` significant digits; 17 change no number.

    Examples
    --------
    >>> plain(4e7), plain(2.5), plain(float("inf")), plain(1674.2, 3)
    ('40000000', '2.5', 'inf', '1670')
    """
    rounded = float(f"{value:.{digits}g}")
    return f"{rounded:.0f}" if rounded.is_integer() and abs(rounded) < 1e16 else f"{rounded:.15g}"
