//! An encoder that returns its spikes as trains, a piece at a time.

use super::{Encoder, Stream};
use crate::spikes::ms;
use crate::{Array, EventsView, FramesView, Result, Spike, SpikeTrains, problem};

/// Encodes a recording piece by piece; each call returns the spikes that are certain by then, in a window that begins
/// where the previous one ended.
pub struct Pieces {
    array: Array,
    stream: Box<dyn Stream>,
    /// End of the last window, ms.
    known: Option<f64>,
}

impl Pieces {
    /// Starts to encode the input of an array.
    ///
    /// # Errors
    ///
    /// As [`Encoder::stream`].
    pub fn new(encoder: &Encoder, array: Array) -> Result<Self> {
        Ok(Self { stream: encoder.stream(&array)?, array, known: None })
    }

    /// Encodes the next events.
    ///
    /// # Errors
    ///
    /// As [`Stream::push_events`].
    pub fn push_events(&mut self, events: EventsView<'_>) -> Result<SpikeTrains> {
        let mut out = vec![];
        self.stream.push_events(events, &mut out)?;
        self.piece(&out, events.t.first().copied(), events.t.iter().max().map(|&t| ms(t)))
    }

    /// Encodes the next frames.
    ///
    /// # Errors
    ///
    /// As [`FramesView::check`] and [`Stream::push_frame`]; `Problem` if they are another array's.
    pub fn push_frames(&mut self, frames: FramesView<'_>) -> Result<SpikeTrains> {
        let (expected, received) = ((self.array.rows, self.array.columns), (frames.array.rows, frames.array.columns));
        if received != expected {
            return Err(problem!(
                "frames of {} x {} taxels: this stream was begun for {} x {} taxels",
                received.0,
                received.1,
                expected.0,
                expected.1
            ));
        }
        frames.check()?;
        let mut out = vec![];
        for (t, frame) in frames.iter() {
            self.stream.push_frame(t, frame, &mut out)?;
        }
        self.piece(&out, frames.t.first().copied(), frames.t.last().map(|&t| ms(t)))
    }

    /// Advances the time: no input before `t` us (exclusive) will follow.
    ///
    /// # Errors
    ///
    /// Those of pushing input.
    pub fn advance(&mut self, t: i64) -> Result<SpikeTrains> {
        let mut out = vec![];
        self.stream.advance(t, &mut out);
        self.piece(&out, None, Some(ms(t)))
    }

    /// Ends the input, as [`Stream::finish`].
    ///
    /// # Errors
    ///
    /// Those of pushing input.
    pub fn finish(&mut self) -> Result<SpikeTrains> {
        let mut out = vec![];
        let end = self.stream.finish(&mut out);
        self.piece(&out, None, end)
    }

    /// Number of events that were too far behind the stream's time.
    #[must_use]
    pub fn late(&self) -> u64 {
        self.stream.late()
    }

    /// The spikes of a piece, in the window from the end of the last piece to `until` ms.
    fn piece(&mut self, out: &[Spike], first: Option<i64>, until: Option<f64>) -> Result<SpikeTrains> {
        let start = self.known.or(first.map(ms)).unwrap_or(0.0);
        let stop = until.map_or(start, |until| until.max(start));
        if first.is_some() || self.known.is_some() {
            self.known = Some(stop);
        }
        let earliest = out.first().map_or(start, |s| s.t.min(start));
        SpikeTrains::from_spikes(out, self.stream.trains(), self.stream.kind(), earliest, stop)
    }
}
