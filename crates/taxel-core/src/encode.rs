//! Events or frames to spikes, live or whole: the same spikes either way.

use crate::{Events, Result, Spike};

/// An encoder at work: takes what comes, in order of time, and hands on spikes as soon as they are certain.
///
/// A stamp is over when a later one comes or when the caller moves time on with [`Stream::advance`]; what depends on a
/// whole stamp is reckoned then, and its spikes have the stamp's time. So pieces and the whole give the same spikes.
pub trait Stream: Send {
    /// How many trains the encoder speaks on.
    fn trains(&self) -> usize;

    /// Whether spikes carry a signed value (polarity, bits), to be split into ON and OFF for a neuron.
    fn signed(&self) -> bool;

    /// How much later than the touch itself a spike comes, ms: what the encoder's own rule costs.
    fn latency_ms(&self) -> f64;

    /// Takes the next events.
    ///
    /// # Errors
    ///
    /// `Problem` where the encoder needs intensities that are not there, or reads frames only.
    fn push_events(&mut self, events: &Events, out: &mut Vec<Spike>) -> Result<()>;

    /// Takes the next picture, row by row, at `t` us.
    ///
    /// # Errors
    ///
    /// `Problem` where the picture has another size, comes out of order, or the encoder reads events only.
    fn push_frame(&mut self, t: i64, values: &[f32], out: &mut Vec<Spike>) -> Result<()>;

    /// Says that nothing will come any more before `t` us (exclusive).
    fn advance(&mut self, t: i64, out: &mut Vec<Spike>);
}
