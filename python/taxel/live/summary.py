"""How a `Live`, or one of its recordings, ended."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from taxel import _core
from taxel.recording import open_one
from taxel.recording.files.mcap import DOUBTS, STEPS
from taxel.tare import Tare
from taxel.verdict import Verdict


@dataclass(frozen=True)
class Summary:
    """Report how a `Live`, or a recording of one, ended.

    Parameters
    ----------
    counters : dict
        As `Live.counters`, at the end.
    verdict : Verdict
        Whether data were lost after arrival, and where, or that nothing arrived: a line of text with a status and
        numbers by cause (`taxel.Verdict`).
    path : Path or None
        The recording; None if nothing arrived: then a new file is removed, and an earlier one stays.
    tare : Tare or None
        The fresh tare, if it was completed.

    Examples
    --------
    >>> from taxel.live import Live
    >>> live = Live(0, host="127.0.0.1")
    >>> summary = live.stop()
    >>> summary.lost, summary.nothing_came
    (0, True)
    """

    counters: dict[str, Any]
    verdict: Verdict
    path: Path | None
    tare: Tare | None

    @property
    def lost(self) -> int:
        """Number of losses after arrival: messages in the kernel if it counts them, datagrams in the queue."""
        return sum(self.verdict.lost.get(cause, 0) for cause in ("dropped_by_kernel", "dropped_by_queue"))

    @property
    def nothing_came(self) -> bool:
        """Whether no datagram has arrived, lost ones included."""
        capture = self.counters["capture"]
        return not capture["messages"] + (capture["dropped_by_kernel"] or 0)


def summary_of(ended: _core.Ended) -> Summary:
    """Return the summary of what Rust returns."""
    path = ended.path
    tare = None if ended.tare is None else Tare.from_json(ended.tare)
    verdict = Verdict._from(ended.verdict)
    # The file has its own times of these.
    if {*DOUBTS, *STEPS} & {*verdict.damaged, *verdict.noted} and path is not None and path.suffix == ".mcap":
        verdict = open_one(path).verdict
    return Summary(ended.counters, verdict, path, tare)


def delays(measured: dict[str, Any]) -> str:
    """Return median and 99 % of a latency of `Live.counters` as text.

    Examples
    --------
    >>> delays({"count": 5, "p50_us": 41.2, "p99_us": 1300.0, "max_us": 1300.0})
    'p50 41 us, p99 1,300 us'
    >>> delays({"count": 0, "p50_us": None, "p99_us": None, "max_us": None})
    'nothing measured'
    """
    if not measured["count"]:
        return "nothing measured"
    return f"p50 {measured['p50_us']:,.0f} us, p99 {measured['p99_us']:,.0f} us"
