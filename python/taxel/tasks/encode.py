"""Encode a recording as spike trains."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

import numpy as np

from taxel._base.arguments import instance
from taxel._base.messages import collected, counted
from taxel._base.progress import Progress, reporting
from taxel.encode import Encoder
from taxel.options import EncodeOptions
from taxel.recording import Recording
from taxel.recording.analysis.rest import is_stated, rest
from taxel.spikes import SpikeTrains

__all__ = ["Encoded", "encode"]


@dataclass(frozen=True, eq=False)
class Encoded:
    """Hold the spike trains of a recording.

    Attributes
    ----------
    trains : SpikeTrains
    encoder : Encoder
        With the tare that was taken.
    warnings : tuple of str
    """

    trains: SpikeTrains
    encoder: Encoder
    warnings: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return what was encoded, but the spikes themselves, as plain values for JSON."""
        trains, counts = self.trains, self.trains.counts
        return {
            "encoder": {key: value for key, value in json.loads(self.encoder.to_json()).items() if key != "tare"},
            "latency_ms": self.encoder.latency_ms,
            "trains": len(trains),
            "kind": trains.kind,
            "signed": trains.signed,
            "spikes": int(counts.sum()),
            "silent_trains": int(np.count_nonzero(counts == 0)),
            "start_ms": trains.start,
            "stop_ms": trains.stop,
            "warnings": list(self.warnings),
        }


def encode(recording: Recording, options: EncodeOptions, *, progress: Progress | None = None) -> Encoded:
    """Encode a recording as spike trains.

    ``taxel encode`` calls this function.

    Parameters
    ----------
    recording : Recording
    options : EncodeOptions
    progress : function of (step, done, all), optional

    Raises
    ------
    ProblemError : an encoder that is unknown or invalid, or that needs a tare; a tare that does not fit
    FormatError : a file that is not a tare

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import taxel
    >>> frames = taxel.Frames([[[0.0]], [[9.0]], [[0.0]]], [0, 10_000, 20_000], unit="N")
    >>> place = pathlib.Path(tempfile.mkdtemp()) / "press.npz"
    >>> _ = taxel.convert(frames, place)
    >>> encode(taxel.open(place), EncodeOptions("level_crossing", {"levels": [5.0]})).trains.counts
    array([2])
    """
    show = reporting(progress)
    options = instance("options", options, EncodeOptions)
    instance("recording", recording, Recording)
    with collected() as warnings:
        encoder = options._chosen()
        if is_stated(recording, options.tare):
            encoder = encoder.with_tare(rest(recording, options.tare)._needed(recording))
        events = recording.has_events
        count = len(recording.events) if events else len(recording.frames())
        show(f"encoding {counted(count, 'event' if events else 'frame')}", 0, 0)
        trains = encoder.encode(recording)
    return Encoded(trains, encoder, tuple(warnings))
