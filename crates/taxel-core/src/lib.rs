//! The computations of taxel, from bytes to timed detections.
//!
//! The modules are listed in the order of processing. No module opens a socket or a file, reads a clock or depends on
//! Python, so the same bytes give the same result on a machine, however often they are processed and in however many
//! threads.
//!
//! `Frames` exists here as a view only: frames are read one by one from memory of the caller (a file, NumPy), so this
//! crate never holds many.
//!
//! On another machine, the decoder, the board and everything that adds and multiplies in [`vectors`]' plain loops give
//! the same bits too. Computations that use an exponential of the platform's library (neurons, smoothed metrics,
//! scenes), and learners, whose sums are fused and ordered by the machine's vector width, can differ there in the last
//! digits of an `f64`. The certificate of each fit is computed on the machine that made the fit and is valid by itself.

pub mod allowed;
pub mod error;
pub mod parameters;
pub mod reading;
pub mod vectors;

pub mod array;
pub mod events;
pub mod frames;
pub mod health;
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
pub use error::{Error, Hint, Place, Reason, Result, Stop};
pub use events::{Events, EventsView, Intensities, IntensitiesView, Marker};
pub use frames::FramesView;
pub use spikes::{Spike, SpikeKind, SpikeTrains};
