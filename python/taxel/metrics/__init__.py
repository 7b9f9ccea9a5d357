"""Distances between spike trains, and between patterns of many trains."""

from taxel.metrics.isi_distance import isi_distance
from taxel.metrics.pairwise import pairwise
from taxel.metrics.spike_distance import spike_distance
from taxel.metrics.van_rossum import van_rossum
from taxel.metrics.van_rossum_absolute import van_rossum_absolute
from taxel.metrics.van_rossum_spatial import van_rossum_spatial
from taxel.metrics.van_rossum_spatial_absolute import van_rossum_spatial_absolute
from taxel.metrics.victor_purpura import victor_purpura
from taxel.metrics.victor_purpura_multi_unit import victor_purpura_multi_unit

__all__ = [
    "isi_distance",
    "pairwise",
    "spike_distance",
    "van_rossum",
    "van_rossum_absolute",
    "van_rossum_spatial",
    "van_rossum_spatial_absolute",
    "victor_purpura",
    "victor_purpura_multi_unit",
]
