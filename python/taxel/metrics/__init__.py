"""Distances between spike trains, and between patterns of many trains; spikes matched with targets."""

from taxel.metrics.matching import Matching as Matching
from taxel.metrics.matching import f1 as f1
from taxel.metrics.matching import matching as matching
from taxel.metrics.pairwise import pairwise as pairwise
from taxel.metrics.van_rossum import van_rossum as van_rossum
from taxel.metrics.van_rossum_spatial import van_rossum_spatial as van_rossum_spatial
from taxel.metrics.victor_purpura import victor_purpura as victor_purpura

# The imports above are the registry of metrics.
__all__ = [name for name, value in sorted(globals().items()) if callable(value)]
