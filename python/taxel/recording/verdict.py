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

#: The whole numbers of a verdict, each a mapping from cause to number.
_NUMBERS = ("lost", "damaged", "noted")


class Verdict(str):
    """State what a recording lost: a line of text with a status, and numbers by cause.

    The page *What the output means* lists the wordings. Made by `taxel.open`, or by `from_dict`.

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
    stretch_of : str or None
        For a stretch of a recording, a name of the whole recording, to which the losses belong: `merge` counts them
        once.
    parts : dict of Verdict
        For several sources or merged recordings, the verdict of each, by name; else empty.

    Raises
    ------
    ProblemError : the class is called; a verdict comes from `taxel.open` or `from_dict`

    Notes
    -----
    The causes; the text of the verdict uses the same words, or those in quotes.

    Causes in `lost`:

    - ``dropped_by_board`` ("times that the board dropped events"), ``events_dropped_by_board``: the same losses, by
      flags and by the board's totals.
    - ``dropped_by_kernel``: messages; with ``UDP_GRO`` several datagrams each.
    - ``dropped_by_queue`` ("dropped by taxel's queue"), ``not_recorded`` ("received but not recorded").
    - ``dropped_or_left_out``: arrival numbers that an unfinished file lacks.
    - ``bytes_in_no_line``: after 65 536 bytes of a line; before the first line, bytes that are not text.
    - ``lost_on_the_way``, ``lost_on_the_way_or_dropped``: lost or damaged. The second: perhaps counted above too, or
      dropped by a kernel that does not count.
    - ``lost_in_file``: datagrams, lines or frames. ``notes_lost_in_file`` (also zeroed taxels), ``detections_...``,
      ``registers_...``, ``changes_...`` (also resets), ``markers_...``, ``held_values_...`` (those at the beginning).

    Causes in `damaged`:

    - ``datagrams_damaged``, ``bytes_skipped`` and others: unusable; datagrams also count as lost on the way.
    - ``datagrams_of_another_board``: version 2: another board's number, or other contents under the same session and
      number.
    - ``datagrams_too_late``: by more than 65 536 numbers.
    - ``datagrams_decoded_again``: version 1: their events are there twice. Without values, only those with several
      times count.
    - ``changes_between_senders``: two boards use one port; the real number is larger.
    - ``events_out_of_order``: version 1: by up to 0.1 s; version 2: by more.
    - ``jumps_of_time``, ``jumps_of_time_before_it``: version 1: ahead by 1 s or more, after a damaged stamp (6.5536 s
      late) or a reset; the second: before this trial. Streams of numbers: ahead of arrival by more than a second and a
      hundredth of the pause.
    - ``stamps_out_of_order``, ``drifts_from_arrival``: streams: stamps step back, by less than a second; the clock was
      off by more than a second and a hundredth of the time.
    - ``bad_chunks``, ``large_chunks``, ``skipped_bytes``, ``torn_bytes``, ``repeated_in_file``, ``no_final_counts``:
      damage in the file; messages there twice are read twice.
    - ``bytes_after_end`` ("bytes after the end of the recording not read"): something was appended, as by
      ``cat``: use `taxel.merge`.
    - ``changed_since_recorded`` ("the content was changed after recording"): checksums differ.
    - ``no_summary`` ("the summary at the end is missing or damaged"): cut after all data; other programs may refuse the
      file.

    Causes in `noted`:

    - ``datagrams_repeated``: version 2: each counts once.
    - ``events_repaired`` ("values repaired from the board's refresh"): they differed from the board's.
    - ``events_overtaken``: version 2: by 0.1 s or less, in the network; times are right.
    - ``resets`` (of the board), ``changes_of_address``: new address or port, the same or another board.
    - ``bytes_of_unfinished_lines``: the beginning or the end did not arrive.
    - ``clock_began_anew`` ("restarts of its clock"), ``missing_values``: streams: back by more than a second, then
      times by arrival; ``nan``.
    - ``silences`` ("no frame arrived for a second or more"), ``silent_ms``: of sources of frames.
    - ``gaps``, ``gaps_us``: number and sum.

    Examples
    --------
    >>> verdict = Verdict.from_dict(
    ...     {"status": "lost", "text": "LOST: 2 datagrams lost or damaged on the way", "lost": {"lost_on_the_way": 2}}
    ... )
    >>> verdict.status, verdict.lost, "LOST" in verdict
    ('lost', {'lost_on_the_way': 2}, True)
    """

    _held: Mapping[str, Any]

    def __new__(cls, *_: object) -> Self:
        """Refuse a verdict built by hand."""
        raise ProblemError("Verdict: take the verdict of a recording, or make one by Verdict.from_dict")

    def __reduce__(self) -> tuple[Any, ...]:
        return Verdict._from, (self._held,)

    @classmethod
    def _of(cls, basis: Mapping[str, Any]) -> Self:
        """Return the verdict on what is known of a recording, which the compiled part gives."""
        return cls._from(_core.recording_verdict(json.dumps(basis)))

    @classmethod
    def _from(cls, held: Mapping[str, Any]) -> Self:
        """Return the verdict that the compiled part states."""
        verdict = str.__new__(cls, held["text"])
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

    @classmethod
    def _of_stretches(cls, named: Iterable[tuple[str, Verdict]]) -> Self:
        """Return the verdict on slices of one recording, each with its name; what the whole lost counts once."""
        return cls._of({"stretches": [(name, verdict._held) for name, verdict in named]})

    def _as_stretch_of(self, name: str) -> Self:
        """Return the same verdict as that of a stretch of the recording of this name."""
        return self._from({**self._held, "stretch_of": name})

    def _later(self, shift: int) -> Self:
        """Return the verdict on the recording whose times are later by so many us."""
        return self._of({"later": [shift, self._held]})

    def _noting(self, texts: Iterable[str], noted: Mapping[str, int]) -> Self:
        """Return the same verdict with more texts at its end, and more events that are not losses."""
        return self._from(
            {**self._held, "text": "; ".join([str(self), *texts]), "noted": {**self._held["noted"], **noted}}
        )

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
    def stretch_of(self) -> str | None:
        """The name of the whole recording, of a stretch of one."""
        return self._held["stretch_of"]  # type: ignore[no-any-return]

    @property
    def parts(self) -> dict[str, Verdict]:
        """The verdicts of the sources or merged recordings, by name."""
        return {name: Verdict._from(verdict) for name, verdict in self._held["parts"]}

    def to_dict(self) -> dict[str, Any]:
        """Return text, status and numbers, ready for JSON.

        Returns
        -------
        dict
            By the names of the attributes, and the line as "text"; each of "parts" is such a dict.

        Examples
        --------
        >>> Verdict.from_dict({"status": "complete", "text": "nothing lost"}).to_dict()["lost"]
        {}
        """
        numbers = {name: dict(self._held[name]) for name in _NUMBERS}
        parts = {name: verdict.to_dict() for name, verdict in self.parts.items()}
        about = {"status": self.status, "text": str(self), **numbers}
        rest = {"doubtful_after_us": self.doubtful_after_us, "steps_back": self.steps_back}
        return about | rest | {"stretch_of": self.stretch_of, "parts": parts}

    @classmethod
    def from_dict(cls, held: Mapping[str, Any]) -> Self:
        """Return the verdict that `to_dict` gave.

        Parameters
        ----------
        held : dict
            As from `to_dict`, also by way of JSON; all but "status" and "text" may be missing.

        Raises
        ------
        ProblemError : not such a dict

        Examples
        --------
        >>> verdict = Verdict.from_dict({"status": "complete", "text": "nothing lost"})
        >>> verdict, Verdict.from_dict(verdict.to_dict()) == verdict
        ('nothing lost', True)
        """
        return cls._from(_check(held))


def _are_steps(steps: Any) -> bool:
    """Return whether these are steps back as `to_dict` gives them."""
    least = {"after_us": -(2**63), "by_us": 1, "events": 1}
    return isinstance(steps, list | tuple) and all(
        isinstance(step, Mapping)
        and step.keys() == least.keys()
        and all(type(step[name]) is int and low <= step[name] < 2**63 for name, low in least.items())
        for step in steps
    )


def _check(held: Any) -> dict[str, Any]:
    """Return a verdict from `to_dict` as the compiled part states it."""
    values = held if isinstance(held, Mapping) else {}
    numbers, parts = [*(values.get(name, {}) for name in _NUMBERS)], values.get("parts", {})
    doubtful = "doubtful_after_us"
    counts = [count for each in numbers if isinstance(each, Mapping) for count in each.values()]
    if (
        values.get("status") not in STATUSES
        or not isinstance(values.get("text"), str)
        or not all(isinstance(each, Mapping) for each in (*numbers, parts))
        or not all(type(count) is int and 0 <= count < 2**64 for count in counts)
        or type(values.get(doubtful, None)) not in (int, type(None))
        or not isinstance(values.get("stretch_of"), str | None)
        or not _are_steps(values.get("steps_back", []))
    ):
        raise ProblemError("verdict: must be a dict of status, text, lost and others, as to_dict returns it")
    for name, least in (("lost", "lost"), ("damaged", "damaged")):
        if STATUSES.index(values["status"]) < STATUSES.index(least) and any(values.get(name, {}).values()):
            raise ProblemError(
                f"verdict: status is {values['status']}; must be {least!r} or worse, because {name} is not empty"
            )
    if STATUSES.index(values["status"]) < STATUSES.index("damaged") and values.get(doubtful) is not None:
        raise ProblemError(
            f"verdict: status is {values['status']}; must be 'damaged' or worse, because the times of the "
            "recording are doubtful"
        )
    stated = {str(name): _check(part) for name, part in parts.items()}
    for name, part in stated.items():
        inner = part["status"]
        if STATUSES.index(inner) > STATUSES.index(values["status"]):
            raise ProblemError(
                f"verdict: status is {values['status']}; must not be better than that of its part {name}, {inner}"
            )
    for name, totals in zip(_NUMBERS, numbers, strict=True):
        for cause in {cause for part in stated.values() for cause in part[name]}:
            # Not their sum: damage of a file is that of each of its sources.
            least = max(part[name].get(cause, 0) for part in stated.values())
            if totals.get(cause, 0) < least:
                raise ProblemError(
                    f"verdict: {name} states {totals.get(cause, 0)} of {cause}; must be at least {least}, as in a part"
                )
    fields = {"status": values["status"], "text": values["text"], doubtful: values.get(doubtful)}
    fields |= {"steps_back": [dict(step) for step in values.get("steps_back", [])]}
    fields |= {"stretch_of": values.get("stretch_of")}
    fields |= {name: dict(each) for name, each in zip(_NUMBERS, numbers, strict=True)}
    return fields | {"parts": list(stated.items())}
