//! What taxel computes, from bytes to timed decisions.
//!
//! The modules stand in the order that data takes them. Nothing here opens a socket or a file, looks at a clock or
//! knows of Python, so the same bytes give the same result on a machine, however often and in however many threads.
//!
//! Of the nouns only `Frames` is not here but as a view: pictures are read one by one where they lie (a file, NumPy), so
//! nothing here ever holds many.
//!
//! On another machine, decoding, the board and whatever adds and multiplies by [`vectors`]' plain loops give the same
//! bits too. What takes an exponential from the platform's library (neurons, smoothed metrics, scenes), and learners,
//! whose sums are fused and ordered as the machine's vectors are, can differ there in the last places of an `f64`; each
//! fit's proof is reckoned on the machine that made it and holds by itself.

pub mod allowed;
pub mod error;
pub mod parameters;
pub mod reading;
pub mod vectors;

pub mod array;
pub mod events;
pub mod frames;
pub mod held;
pub mod rest;
pub mod spikes;

pub mod circuit;

pub mod board;
pub mod contact;
pub mod wire;

pub mod encode;
pub mod neuron;

pub mod detect;
pub mod learn;
pub mod metrics;

pub use array::Array;
pub use error::{Error, Result, Stop};
pub use events::{Events, EventsView, Intensities, IntensitiesView, Marker};
pub use frames::FramesView;
pub use spikes::{Spike, SpikeTrains};
