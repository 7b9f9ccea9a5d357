//! What taxel computes, from bytes to timed decisions.
//!
//! The modules stand in the order that data takes them. Nothing here opens a socket or a file, looks at a clock or
//! knows of Python, so the same bytes give the same result everywhere.

pub mod allowed;
pub mod error;
pub mod parameters;

pub mod array;
pub mod events;
pub mod frames;
pub mod spikes;

pub mod board;
pub mod contact;
pub mod wire;

pub mod encode;
pub mod neuron;

pub mod detect;
pub mod learn;
pub mod metrics;

mod wide;

pub use array::Array;
pub use error::{Error, Result, Stop};
pub use events::{Events, Intensities, Marker};
pub use frames::Frames;
pub use spikes::{Spike, SpikeTrains};
