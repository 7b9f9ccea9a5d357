//! Spikes to detections, and their score.
