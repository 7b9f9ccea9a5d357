"""What the registers of a board were in a training, and in what those of another time differ."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from taxel._base.messages import plain
from taxel.detect.examples import Example
from taxel.recording.recording import Recording
from taxel.wire.registers import Registers, preset_of


def noise_floor(source: object) -> float:
    """Return the highest noise floor of the board while it was recorded, ticks; 0 where it is not known."""
    if not isinstance(source, Recording) or not source.has_events or source.registers is None:
        return 0.0
    held = [source.registers, *(registers for _, registers in source.register_changes)]
    return float(max(registers.noise_floor for registers in held))


def of_training(examples: Sequence[Example]) -> dict[str, Any] | None:
    """Return what a readout's file keeps of the board of its training; None where it is not known, or not the same."""
    each = [
        summary(source.registers)
        for source in (example.source for example in examples)
        if isinstance(source, Recording) and source.has_events and source.registers is not None
    ]
    return each[0] if each and len(each) == len(examples) and all(board == each[0] for board in each) else None


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
