"""The demo while it runs: the board in a separate process, the host here."""

from __future__ import annotations

import json
import subprocess
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import taxel
from taxel._base.child_process import ChildProcess
from taxel._base.messages import counted
from taxel._core import DeviceError
from taxel.demo.evaluation import Evaluation, evaluate_events
from taxel.demo.screen import Screen
from taxel.demo.script import script
from taxel.detect import Readout, run
from taxel.detections import Detection, Detections
from taxel.live import Live
from taxel.simulate import Contact, truth
from taxel.wire import FRAME_US

__all__ = ["Playing", "play_live"]

#: Interval at which the screen is drawn, s.
_DRAW_EVERY_S = 0.1

#: How long the host goes on receiving after the board's process has ended, s.
_LISTEN_ON_S = 0.3


@dataclass(frozen=True)
class Playing:
    """A run in real time, and its counters."""

    evaluation: Evaluation
    counters: dict[str, Any]
    emulator: dict[str, Any]
    verdicts: list[str]
    recording: Path
    agrees: bool
    """Whether the recording, read again, gives the detections that were made live."""


def play_live(
    readout: Readout,
    folder: Path,
    *,
    seed: int,
    scenes: int,
    screen: Callable[[list[Contact], float], Screen],
) -> Playing:
    """Start the board, capture, record, encode, detect, until it stops.

    Parameters
    ----------
    readout : Readout
    folder : Path
        Where the recording goes.
    seed, scenes : int
    screen : function of the touches to come and the play's length in s
        Makes what is drawn while it runs.

    Raises
    ------
    DeviceError : the board's process ended with an error
    """
    acts = script(seed, scenes)
    contacts, force = truth(acts)
    shown = screen(contacts, len(force) * FRAME_US * 1e-6)
    recording = folder / "recording.mcap"
    detections: list[Detection] = []
    # The tare ends where the board marks its start, well before a second is over.
    with Live(0, host="127.0.0.1", readout=readout, tare=1.0, record=recording) as live:
        words = ["emulate", "--json", "--port", live.address[1], "--scenes", scenes, "--seed", seed]
        board = ChildProcess("taxel", words, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        try:
            ended = None
            drawn = 0.0
            while ended is None or time.monotonic() < ended + _LISTEN_ON_S:
                detection = live.next(0.05)
                if detection is not None:
                    detections.append(detection)
                if ended is None and board.poll() is not None:
                    ended = time.monotonic()
                if time.monotonic() > drawn + _DRAW_EVERY_S:
                    drawn = time.monotonic()
                    shown.draw(live.counters, live.frame, detections)
            printed, complaint = board.communicate()
        finally:
            board.end()
        if board.returncode != 0:
            raise DeviceError(f"the board's process ended with code {board.returncode}: {complaint.strip()[-300:]}")
        while (detection := live.next(0.0)) is not None:
            detections.append(detection)
        tare = live.tare
        summary = live.stop()
    emulator = json.loads(printed)
    reported = Detections.from_list(detections)
    events = taxel.open(recording).events
    again = run(readout, events, frame_us=FRAME_US, tare=tare)
    evaluation = evaluate_events(events, acts, readout, reported)
    again = again[again.t >= evaluation.start_us]
    recorded = evaluation.detections
    agrees = len(again) == len(recorded) and bool(
        (again.t == recorded.t).all()
        and (again.known == recorded.known).all()
        and (again.label == recorded.label).all()
    )
    verdicts = [emulator["verdict"], summary.verdict]
    if summary.counters["late"]:
        verdicts.append(
            f"{counted(summary.counters['late'], 'event')} arrived more than 5 frames late, so the readout had "
            "continued without them: this machine was too busy. Detections of these events are late, at wrong times or "
            "missing. The recording contains all events. --no-clock simulates without the clock"
        )
    return Playing(evaluation, summary.counters, emulator, verdicts, recording, agrees)
