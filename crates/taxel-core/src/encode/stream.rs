//! The interface of a running encoder.

use crate::{EventsView, FramesView, Result, Spike, SpikeKind, Stop};

/// A running encoder: it reads events or frames in order of time and emits spikes as soon as they are certain.
///
/// A stamp is complete when a later one arrives or when the caller advances time with [`Stream::advance`]. Values that
/// depend on a whole stamp are computed then, and their spikes have the stamp's time. Therefore pieces and the whole
/// recording give the same spikes in the same order: by time, then by train.
pub trait Stream: Send {
    /// The number of the encoder's spike trains.
    fn trains(&self) -> usize;

    /// The meaning of the spikes' values. A graded spike with a value of 0 must not be emitted.
    fn kind(&self) -> SpikeKind;

    /// The latency that the encoder's own algorithm adds between a touch and its spike, ms.
    fn latency_ms(&self) -> f64;

    /// Encodes the next events. An event behind the current time counts as of that time; one far behind it also counts
    /// in [`Stream::late`].
    ///
    /// # Errors
    ///
    /// `Problem` if the encoder needs intensities that are not there, or the stream was begun with frames.
    fn push_events(&mut self, events: EventsView<'_>, out: &mut Vec<Spike>) -> Result<()>;

    /// The longest delay between an event that a state repaired and its spikes, ms; none for an encoder of changes,
    /// which moves its reference with such an event and emits no spike.
    fn repaired_span_ms(&self) -> Option<f64> {
        Some(self.latency_ms())
    }

    /// Sets the rest of a taxel, by index, from `t` us on. To be called after the events up to `t` and
    /// before later ones; an encoder that uses no tare ignores it.
    fn set_rest(&mut self, _t: i64, _place: usize, _rest: f64, _out: &mut Vec<Spike>) {}

    /// The rest of a taxel, by index; `None` if it is not known, or if the encoder uses no tare.
    fn rest(&self, _place: usize) -> Option<f64> {
        None
    }

    /// Encodes the next frame, row by row, at `t` us.
    ///
    /// # Errors
    ///
    /// `Problem` if the frame has another size, contains NaN or is out of order, or if the stream was begun with
    /// events.
    fn push_frame(&mut self, t: i64, values: &[f32], out: &mut Vec<Spike>) -> Result<()>;

    /// Advances the time: no input before `t` us (exclusive) will follow.
    fn advance(&mut self, t: i64, out: &mut Vec<Spike>);

    /// Ends the input: holds the latest values for one period and the latency, so that all spikes that are due are
    /// emitted. Returns the end of that time, ms, or `None` without any input.
    fn finish(&mut self, out: &mut Vec<Spike>) -> Option<f64>;

    /// An independent copy, to compute the spikes that would follow without further input.
    fn fork(&self) -> Box<dyn Stream>;

    /// Number of events more than [`FARTHEST_BACK_US`](crate::events::FARTHEST_BACK_US) behind the current time.
    fn late(&self) -> u64;
}

impl Clone for Box<dyn Stream> {
    fn clone(&self) -> Self {
        self.fork()
    }
}

/// Sorts the spikes from index `from` on by time, then by train.
pub(super) fn sort_from(out: &mut [Spike], from: usize) {
    out[from..].sort_by(|a, b| a.t.total_cmp(&b.t).then(a.train.cmp(&b.train)));
}

/// All spikes of a whole recording of events, and the end of their window, ms.
pub(super) fn spikes_of_events(
    stream: &mut dyn Stream,
    events: EventsView<'_>,
    stop: Stop<'_>,
) -> Result<(Vec<Spike>, Option<f64>)> {
    /// Events between two checks of `stop`.
    const PIECE: usize = 65_536;
    events.check()?;
    events.check_order()?;
    let mut out = vec![];
    for piece in events.pieces(PIECE) {
        stop.check()?;
        stream.push_events(piece, &mut out)?;
    }
    let end = stream.finish(&mut out);
    Ok((out, end))
}

/// All spikes of a whole recording of frames, and the end of their window, ms.
pub(super) fn spikes_of_frames(
    stream: &mut dyn Stream,
    frames: FramesView<'_>,
    stop: Stop<'_>,
) -> Result<(Vec<Spike>, Option<f64>)> {
    frames.check()?;
    let mut out = vec![];
    for (k, (t, frame)) in frames.iter().enumerate() {
        if k % 64 == 0 {
            stop.check()?;
        }
        stream.push_frame(t, frame, &mut out)?;
    }
    let end = stream.finish(&mut out);
    Ok((out, end))
}
