//! Distances between spike trains.
