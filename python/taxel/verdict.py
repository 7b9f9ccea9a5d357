"""The verdict of a recording: what was lost or damaged at which stage, as one line and as data."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import Any, Literal, Self, get_args

from taxel import _core
from taxel._core import ProblemError

Status = Literal["complete", "complete after arrival", "unknown", "damaged", "unfinished", "nothing arrived", "lost"]

#: All statuses, from the best to the worst.
STATUSES: tuple[Status, ...] = get_args(Status)


def in_words(counts: Mapping[str, int]) -> str:
    """Return numbers by cause in the words of a verdict.

    Examples
    --------
    >>> in_words({"bytes_skipped": 1, "dropped_by_queue": 1200, "short_events": 0})
    "1,200 datagrams dropped by taxel's queue, 1 byte skipped"
    """
    causes = [(counts.get(key, 0), words) for key, _, words, _ in _core.causes()]
    return ", ".join(f"{n:,} {words[n != 1]}" for n, words in causes if n)


class Verdict(str):
    """State what a recording lost: a line of text with a status, and numbers by cause.

    The page *What the output means* lists the wordings. Made by `taxel.open`.

    Attributes
    ----------
    status : {"complete", "complete after arrival", "unknown", "damaged", "unfinished", "nothing arrived", "lost"}
        Listed from the best to the worst; for several parts, the worst. "complete": version 2 of the wire counted;
        "damaged": unusable bytes or doubtful times; "lost": perhaps also unfinished.
    lost : dict of int
        Losses by cause; for several parts, the sum.
    damaged : dict of int
        Data that could not be used, of the received bytes and of the file, by cause; damage of a file of several
        sources counts once.
    noted : dict of int
        Events that are not losses: repeated datagrams, repaired values, resets of the board and others.
    doubtful_after_us : int, us, or None
        The time after which times are doubtful; for several parts, the earliest.
    steps_back : list of dict of int
        Steps back of times in the order of arrival, at most the 256 largest: "after_us", the latest time before the
        step; "by_us", the distance of the earliest event before that time; "events", the number of events before it.
    parts : dict of Verdict
        For several sources or merged recordings, the verdict of each, by name; else empty.

    Raises
    ------
    ProblemError : the class is called; a verdict comes from `taxel.open`

    Notes
    -----
    The page *What the output means* lists all causes with their words, of which the text of a verdict is made.

    Examples
    --------
    >>> import pathlib, tempfile, taxel
    >>> place = pathlib.Path(tempfile.mkdtemp()) / "one.mcap"
    >>> _ = taxel.convert(taxel.Events([0], [3], [5], [True], array=taxel.Array(8, 8)), place)
    >>> verdict = taxel.open(place).verdict
    >>> verdict, verdict.status, verdict.lost
    ('nothing lost', 'complete', {})
    """

    _held: Mapping[str, Any]

    def __new__(cls, *_: object) -> Self:
        """Refuse a verdict built by hand."""
        raise ProblemError("Verdict: take the verdict of a recording")

    def __reduce__(self) -> tuple[Any, ...]:
        return Verdict._from, (self._held,)

    @classmethod
    def _of(cls, basis: Mapping[str, Any]) -> Self:
        """Return the verdict on what is known of a recording, which the compiled part gives."""
        return cls._from(_core.recording_verdict(json.dumps(basis)))

    @classmethod
    def _from(cls, held: Mapping[str, Any]) -> Self:
        """Return the verdict that the compiled part states."""
        verdict = str.__new__(cls, _core.verdict_text(json.dumps(held)))
        verdict._held = held
        return verdict

    @classmethod
    def _together(cls, named: Iterable[tuple[str, Verdict]]) -> Self:
        """Return the verdict on several recordings or sources, each with its name."""
        return cls._of({"together": [(name, verdict._held) for name, verdict in named]})

    @classmethod
    def _of_sources(cls, named: Iterable[tuple[str, Verdict]]) -> Self:
        """Return the verdict on the sources of one file, each with its name; damage of the file counts once."""
        return cls._of({"sources": [(name, verdict._held) for name, verdict in named]})

    def _later(self, shift: int) -> Self:
        """Return the verdict on the recording whose times are later by so many us."""
        return self._from(_later(self._held, shift)) if shift else self

    def _noting(self, texts: Iterable[str], noted: Mapping[str, int]) -> Self:
        """Return the same verdict with more texts on what is known, and more events that are not losses."""
        known = "; ".join([self._held["known"], *texts])
        return self._from({**self._held, "known": known, "noted": {**self._held["noted"], **noted}})

    @property
    def status(self) -> Status:
        """How much of the recording is there."""
        return self._held["status"]  # type: ignore[no-any-return]

    @property
    def lost(self) -> dict[str, int]:
        """Losses by cause."""
        return dict(self._held["lost"])

    @property
    def damaged(self) -> dict[str, int]:
        """Data that could not be used, by cause."""
        return dict(self._held["damaged"])

    @property
    def noted(self) -> dict[str, int]:
        """Events that are not losses, by cause."""
        return dict(self._held["noted"])

    @property
    def doubtful_after_us(self) -> int | None:
        """The time after which times are doubtful, us."""
        return self._held["doubtful_after_us"]  # type: ignore[no-any-return]

    @property
    def steps_back(self) -> list[dict[str, int]]:
        """Where times step back, in the order of arrival."""
        return [dict(step) for step in self._held["steps_back"]]

    @property
    def parts(self) -> dict[str, Verdict]:
        """The verdicts of the sources or merged recordings, by name."""
        return {name: Verdict._from(verdict) for name, verdict in self._held["parts"]}

    def to_dict(self) -> dict[str, Any]:
        """Return text, status and numbers, ready for JSON."""
        numbers = {"lost": self.lost, "damaged": self.damaged, "noted": self.noted}
        parts = {name: verdict.to_dict() for name, verdict in self.parts.items()}
        about = {"status": self.status, "text": str(self), **numbers}
        rest = {"doubtful_after_us": self.doubtful_after_us, "steps_back": self.steps_back}
        return about | rest | {"parts": parts}


def _later(held: Mapping[str, Any], shift: int) -> dict[str, Any]:
    """Return what is known of the recording whose times are later by so many us."""
    after = held["doubtful_after_us"]
    return {
        **held,
        "doubtful_after_us": None if after is None else after + shift,
        "steps_back": [{**step, "after_us": step["after_us"] + shift} for step in held["steps_back"]],
        "parts": [(name, _later(part, shift)) for name, part in held["parts"]],
    }
