"""A recording as the touch of an emulated board."""

from __future__ import annotations

from typing import Any

import numpy as np

from taxel._base.arguments import number, shown
from taxel._base.errors import refused
from taxel.array import Array
from taxel.events import Events
from taxel.frames import Frames
from taxel.recording import Recording
from taxel.simulate.board import fitting
from taxel.wire import Registers

__all__ = ["Replay"]


class Replay:
    """Replay a recording to an emulated board: its events as they were, or its frames by the board's rules.

    Parameters
    ----------
    source : Recording, Events or Frames
    speed : float, above 0
        Speed of the replay; 2 plays it in half the time.

    Raises
    ------
    ProblemError : another kind of source, or an empty source

    Notes
    -----
    The board's frames quantise time: events within a frame are sent at its end; if a taxel has several, the last is
    sent. Frames that are not in ticks are scaled so that the largest value is the end of the ramp.
    """

    def __init__(self, source: Recording | Events | Frames, speed: float = 1.0) -> None:
        self.speed = number("speed", speed)
        if not 0 < self.speed < np.inf:
            raise refused("speed", f" is {shown(speed)}: must be above 0")
        self.recording = source if isinstance(source, Recording) else None
        if isinstance(source, Recording):
            source = source.events if source.has_events else source.frames()
        if not isinstance(source, Events | Frames):
            raise refused("source", f" is {shown(source)}: must be a taxel.Recording, taxel.Events or taxel.Frames")
        if not len(source):
            raise refused("source", " is empty: must contain events or frames")
        self.source: Events | Frames = source

    @property
    def array(self) -> Array:
        """The sensor."""
        return self.source.array

    def registers(self, preset: str | None) -> Registers:
        """Return the registers of the board that plays it: those of the recording, if known, else a preset.

        Parameters
        ----------
        preset : str or None
            The registers if the recording has none.

        Raises
        ------
        ProblemError : no such preset
        """
        known = None if self.recording is None else self.recording.registers
        if known is not None and not known.array.fits(self.array):
            # A region of a sensor is played as a separate board, at the frame rate of the whole sensor.
            registers, _ = Registers._of_source(self.array, 1e6 / known.frame_us, int(known.ramp).bit_length())
            registers = registers.replace(noise_floor=known.noise_floor, wire_version=known.wire_version)
        else:
            registers = fitting(preset, self.array) if known is None else known.replace(record=False)
        values = self.source.intensity if isinstance(self.source, Events) else None
        most = 0 if values is None else int(values.max())
        # A converter reads nothing above its ramp, so a preset's ramp is lengthened until the largest value fits.
        rate_hz = 1e6 / registers.frame_us
        while most >= registers.ramp:
            longer, halved = Registers._of_source(self.array, rate_hz, (most + 1).bit_length())
            rate_hz /= 2
            if not halved:
                registers = longer.replace(noise_floor=registers.noise_floor, wire_version=registers.wire_version)
        return registers

    def _touch(self, registers: Registers) -> tuple[Any, ...]:
        if isinstance(self.source, Events):
            return self.source.sorted(), self.speed
        values = self.source.values
        if self.source.unit != "ticks":
            values = (values - min(0.0, float(values.min()))) * (registers.ramp / max(float(np.ptp(values)), 1e-30))
        ticks = np.clip(np.rint(values), 0, registers.ramp).astype(np.uint16).reshape(-1)
        return np.ascontiguousarray(self.source.t), np.ascontiguousarray(ticks), self.speed
