"""The demo: scenes on the emulated board, detected by the shipped readout, scored by the simulated truth."""

from __future__ import annotations

import json
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

import taxel
from taxel._base.child_process import ChildProcess
from taxel._base.messages import counted
from taxel._base.progress import Progress, reporting
from taxel._core import DeviceError
from taxel.demo.script import script
from taxel.detect import Example, Outcome, PlainRule, Readout, Score, run, score
from taxel.detections import Detection, Detections
from taxel.events import Events
from taxel.live import Live
from taxel.simulate import Act, play, truth
from taxel.tare import Tare
from taxel.wire import FRAME_US

__all__ = ["Demo", "evaluate", "play_live", "play_simulated", "shipped"]

#: Impacts come 30 ms apart: a wider window would pair a miss with its neighbour.
_IMPACT_MS, _PRESS_MS = 10.0, 50.0
#: How long the host goes on receiving after the board's process has ended, s.
_LISTEN_ON_S = 0.3


@dataclass(frozen=True)
class Demo:
    """One run: the detections of a readout, their score by the truth, that of the plain rule, and the first impact."""

    outcome: Outcome
    plain: Score
    first_us: tuple[float, float]
    verdicts: tuple[str, ...] = ()

    def lines(self) -> Iterator[str]:
        """Yield what people read of it."""
        for name, scored in (("trained neurons", self.outcome.score), ("plain rule, two loaded taxels", self.plain)):
            yield from ("", f"{name}:", *str(scored).splitlines())
        yield from ("", *self.verdicts)

    def to_dict(self) -> dict[str, Any]:
        """Return both scores and the verdicts of board and host as plain values."""
        assert self.outcome.score is not None  # the truth is known
        scores = {"neurons": self.outcome.score.to_dict(), "plain_rule": self.plain.to_dict()}
        return scores | {"verdicts": list(self.verdicts)}


def shipped() -> Readout:
    """Return the readout that `taxel demo` plays with, which tools/demo_readout.py trained on other scenes."""
    return Readout.from_json(files("taxel.demo").joinpath("readout.json").read_text(encoding="utf-8"))


def play_simulated(
    readout: Readout, recording: Path, *, seed: int, scenes: int, progress: Progress | None = None
) -> Demo:
    """Play scenes without waiting for the clock, write the events to a .mcap, and run the readout on them."""
    acts, step = script(seed, scenes), f"playing {counted(scenes, 'scene')} without the clock"

    def watch(share: float) -> None:
        reporting(progress)(f"{step}, {share:.0%}", 0, 0)

    events = play(acts, seed=seed, watch=watch).events
    taxel.convert(events, recording)
    return evaluate(events, acts, readout, name=str(recording))


def play_live(
    readout: Readout, recording: Path, *, seed: int, scenes: int, said: Callable[[Detection], object] = lambda _: None
) -> Demo:
    """Play scenes on a board that is a process of its own, in real time over UDP; record, and detect meanwhile.

    Parameters
    ----------
    readout : Readout
    recording : Path
        The .mcap to write.
    seed, scenes : int
    said : function of a Detection
        Called with each as soon as it is made.

    Raises
    ------
    DeviceError : the board's process ended with an error
    """
    detections: list[Detection] = []

    def take(wait_s: float) -> bool:
        detection = live.next(wait_s)
        if detection is None:
            return False
        detections.append(detection)
        said(detection)
        return True

    # The tare ends where the board marks its start, well before a second is over.
    with Live(0, host="127.0.0.1", readout=readout, tare=1.0, record=recording) as live:
        words = ["emulate", "--json", "--port", live.address[1], "--scenes", scenes, "--seed", seed]
        board = ChildProcess("taxel", words, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        try:
            ended = None
            while ended is None or time.monotonic() < ended + _LISTEN_ON_S:
                take(0.05)
                if ended is None and board.poll() is not None:
                    ended = time.monotonic()
            printed, complaint = board.communicate()
        finally:
            board.end()
        if board.returncode != 0:
            raise DeviceError(f"the board's process ended with code {board.returncode}: {complaint.strip()[-300:]}")
        while take(0.0):
            pass
        summary = live.stop()
    verdicts = [json.loads(printed)["verdict"], summary.verdict]
    if late := summary.counters["late"]:
        verdicts.append(f"{counted(late, 'event')} came too late for the readout: this machine was too busy")
    events = taxel.open(recording).events
    return evaluate(events, script(seed, scenes), readout, Detections.from_list(detections), verdicts, str(recording))


def evaluate(
    events: Events,
    acts: Sequence[Act],
    readout: Readout,
    found: Detections | None = None,
    verdicts: Sequence[str] = (),
    name: str = "the emulated board",
) -> Demo:
    """Score detections by what the acts simulate; without any, those of the readout in the events.

    The events are those of the tare too, which ends at the start marker: before it the board sends the rest of every
    taxel, which is no touch.
    """
    start = events.markers[0][0]
    tare = Tare.take(events, stop_us=start)
    contacts, _ = truth(acts)
    times = {"contact": [c.start_us for c in contacts], "lift": [c.stop_us for c in contacts]}
    labels = {label: np.rint(t).astype(np.int64) for label, t in times.items()}
    of_touches = [_IMPACT_MS if contact.kind in ("first", "bounce") else _PRESS_MS for contact in contacts]
    widths = dict.fromkeys(labels, of_touches)
    found = run(readout, events, frame_us=FRAME_US, tare=tare) if found is None else found
    by_rule = run(PlainRule("area", 2), events, frame_us=FRAME_US, tare=tare)
    found, by_rule = found[found.t >= start], by_rule[by_rule.t >= start]
    outcome = Outcome(name, Example(events, labels, tare), found, score(found, labels, widths))
    first = next(((c.start_us, c.stop_us) for c in contacts), (float(start), float(events.t[-1])))
    return Demo(outcome, score(by_rule, labels, widths), first, tuple(verdicts))
