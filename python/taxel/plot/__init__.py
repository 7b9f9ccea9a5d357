"""Pictures of the nouns: raster, pressure map, event picture, detections."""

from taxel.plot.nouns import detections, event_picture, pressure_map, raster

__all__ = ["detections", "event_picture", "pressure_map", "raster"]
