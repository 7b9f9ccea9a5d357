"""Plots of the data classes: raster, pressure map, event picture, detections, recordings."""

from taxel.plot.nouns import detections, event_picture, pressure_map, raster
from taxel.plot.recordings import health_map, overview

__all__ = ["detections", "event_picture", "health_map", "overview", "pressure_map", "raster"]
