"""Spike trains, the unit of their times, and their exchange with other tools."""

from taxel.spikes.trains import SpikeTrains
from taxel.spikes.units import to_ms, to_us

__all__ = ["SpikeTrains", "to_ms", "to_us"]
