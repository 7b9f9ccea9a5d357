"""Pictures of the nouns: raster, pressure map, event picture."""

from taxel.plot.nouns import event_picture, pressure_map, raster

__all__ = ["event_picture", "pressure_map", "raster"]
