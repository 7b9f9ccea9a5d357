//! An encoder at work, piece by piece.

use crate::{EventsView, Result, Spike};

/// An encoder that runs: it reads events or frames in order of time and passes spikes on as soon as they are certain.
///
/// A stamp is over when a later one comes or when the caller moves time on with [`Stream::advance`]; what depends on a
/// whole stamp is computed then, and its spikes have the stamp's time. So pieces and the whole give the same spikes,
/// in the same order: by time, then by train.
pub trait Stream: Send {
    /// The number of the encoder's spike trains.
    fn trains(&self) -> usize;

    /// Whether spikes carry a signed value (polarity, bits), to be split into ON and OFF for a neuron.
    fn signed(&self) -> bool;

    /// How much later than the touch itself a spike comes, ms: what the encoder's own rule costs.
    fn latency_ms(&self) -> f64;

    /// Encodes the next events; one behind the time come to counts as of that time, far behind it also as [`Stream::late`].
    ///
    /// # Errors
    ///
    /// `Problem` if the encoder needs intensities that are not there, or the stream was begun with frames.
    fn push_events(&mut self, events: EventsView<'_>, out: &mut Vec<Spike>) -> Result<()>;

    /// How long after an event that a state repaired its spikes come at the latest, ms; none of an encoder of changes, which
    /// moves its reference with such an event and emits no spike.
    fn hears_repaired_ms(&self) -> Option<f64> {
        Some(self.latency_ms())
    }

    /// From `t` us on the taxel at `place` (row by row) rests at `rest`. Comes after the events up to `t` and before later
    /// ones; an encoder that reads no tare ignores it.
    fn set_rest(&mut self, _t: i64, _place: usize, _rest: f64, _out: &mut Vec<Spike>) {}

    /// The rest of the taxel at `place`; `None` where that is not known, or the encoder reads no tare.
    fn rest(&self, _place: usize) -> Option<f64> {
        None
    }

    /// Encodes the next picture, row by row, at `t` us.
    ///
    /// # Errors
    ///
    /// `Problem` if the picture has another size, holds NaN, comes out of order, or the stream was begun with events.
    fn push_frame(&mut self, t: i64, values: &[f32], out: &mut Vec<Spike>) -> Result<()>;

    /// Ends the input before `t` us (exclusive): nothing will come any more up to then.
    fn advance(&mut self, t: i64, out: &mut Vec<Spike>);

    /// Ends the input: holds the latest values for one period and the latency, so that all spikes that are due come out.
    /// Returns the end of that, ms, or `None` without any input.
    fn finish(&mut self, out: &mut Vec<Spike>) -> Option<f64>;

    /// A copy that goes on by itself, to compute the spikes that would follow without further input.
    fn fork(&self) -> Box<dyn Stream>;

    /// How many events came farther than [`FARTHEST_BACK_US`](crate::events::FARTHEST_BACK_US) behind the time come to.
    fn late(&self) -> u64;
}

impl Clone for Box<dyn Stream> {
    fn clone(&self) -> Self {
        self.fork()
    }
}

/// Spikes from place `from` on by time, then by train.
pub(super) fn sort_from(out: &mut [Spike], from: usize) {
    out[from..].sort_by(|a, b| a.t.total_cmp(&b.t).then(a.train.cmp(&b.train)));
}
