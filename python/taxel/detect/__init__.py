"""Spikes to detections, live and from recordings, and their score."""

from taxel.detect.scoring import Score, Spread, score

__all__ = ["Score", "Spread", "score"]
