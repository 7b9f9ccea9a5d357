"""What a readout keeps of the data of its training, and in what a board or sensor of another time differs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from taxel._base.messages import plain, three_digits
from taxel.detect.examples import Example, frame_ms
from taxel.detect.scoring import Score
from taxel.recorded import recorded
from taxel.recording.recording import Recording
from taxel.spikes import to_us
from taxel.wire.registers import Registers, preset_of

#: A rate differs that is not within this ratio of another.
_OTHER_RATE = 1.1


def noise_floor(source: object) -> float:
    """Return the highest noise floor of the board while it was recorded, ticks; 0 where it is not known."""
    if not isinstance(source, Recording) or not source.has_events or source.registers is None:
        return 0.0
    held = [source.registers, *(registers for _, registers in source.register_changes)]
    return float(max(registers.noise_floor for registers in held))


def of_training(examples: Sequence[Example], scored: Score, noise_floor: float) -> dict[str, Any]:
    """Return what a readout's file keeps of the data of its training.

    Its ``noise_floor``; ``error_ms``, by how much detections of each label are late at the median; the ``board`` that
    sent them, where it is known and always the same; ``period_us`` of frames; ``sides``, where all are stated.

    Parameters
    ----------
    examples : sequence of Example
    scored : Score
        Of the detector in its training data, or of folds of them.
    noise_floor : float, in the sensor's unit
    """
    sources = [example.source for example in examples if isinstance(example.source, Recording)]
    boards = [summary(source.registers) for source in sources if source.has_events and source.registers is not None]
    is_one = len(boards) == len(examples) and all(board == boards[0] for board in boards)
    periods = [period for source in sources if (period := _period_us(source))]
    sides = {source.side for source in sources}
    return {
        "noise_floor": noise_floor,
        "error_ms": {label: float(part.error.median) for label, part in scored.by_label.items() if part.found},
        "board": boards[0] if boards and is_one else None,
        "period_us": float(np.median(periods)) if periods else None,
        "sides": [] if "" in sides else sorted(sides),
    }


def summary(registers: Registers) -> dict[str, Any]:
    """Return the registers that a detection depends on: noise floor (ticks), length of a frame (us), preset."""
    return {
        "noise_floor": int(registers.noise_floor),
        "frame_us": registers.frame_us,
        "preset": preset_of(registers._held, registers.array),
    }


def differences(training: Mapping[str, Any], registers: Registers) -> str:
    """Return in what a board differs from that of a training, in words; "" where it does not, or is not known.

    Parameters
    ----------
    training : mapping
        The part of a readout's file that says what its training was like.
    registers : Registers
        Those that the board holds.
    """
    then, now = training.get("board"), summary(registers)
    if then is None:
        return ""

    def words(board: Mapping[str, Any]) -> dict[str, str]:
        return {
            "preset": board["preset"] or "none",
            "noise floor": f"{board['noise_floor']} ticks",
            "frames of": f"{plain(board['frame_us'], 6)} us",
        }

    pairs = zip(words(now).items(), words(then).values(), strict=True)
    differing = [f"{name} {here}, in training {there}" for (name, here), there in pairs if here != there]
    return f"the board differs from that of the training: {'; '.join(differing)}" if differing else ""


def other_frames(training: Mapping[str, Any], recording: Recording) -> str:
    """Return in what frames of a recording differ from those of the training, in words: their rate, their side.

    "" where they do not, or nothing is known.

    Parameters
    ----------
    training : mapping
        As of `differences`.
    recording : Recording
    """
    here, then, sides = _period_us(recording), training.get("period_us"), training.get("sides", [])
    differing = []
    if here and then and max(here, then) > _OTHER_RATE * min(here, then):
        now, before = (three_digits(1e6 / period_us) for period_us in (here, then))
        differing.append(f"{now} frames a second, in training {before}")
    if sides and recording.side and recording.side not in sides:
        differing.append(f"{recording.side} side, in training {' and '.join(sides)}")
    return f"{recording.title} differs from the training: {'; '.join(differing)}" if differing else ""


def _period_us(recording: Recording) -> float:
    """Return the median time from one frame to the next, us; 0 of events."""
    return 0.0 if recording.has_events else float(to_us(frame_ms(recorded(recording, hold=False))))
