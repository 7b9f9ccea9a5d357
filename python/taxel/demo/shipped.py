"""The readout that comes with the demo."""

from __future__ import annotations

from importlib.resources import files

from taxel.detect import Readout

__all__ = ["described", "shipped"]


def shipped() -> Readout:
    """Return the readout that `taxel demo` plays with, as ``taxel demo --train`` wrote it."""
    return Readout.from_json(files("taxel.demo").joinpath("readout.json").read_text(encoding="utf-8"))


def described(readout: Readout) -> str:
    """Return the weights of contact area's trains that are not 0, one line a neuron."""
    levels = readout.encoder.get_params()["levels"]
    names = [f"rise to {n}" for n in levels] + [f"fall below {n}" for n in levels]
    return "\n".join(
        f"{label}: " + ", ".join(f"{name} {w:.3f} mV" for name, w in zip(names, one.weights, strict=True) if w > 5e-4)
        for label, one in readout.neurons.items()
    )
