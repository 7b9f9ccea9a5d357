//! Distances between spike trains.

mod victor_purpura;

pub use victor_purpura::victor_purpura;
