//! A sensor at rest, from which a tare is computed.

use taxel_core::detect::{Detector, FrameTime, ReadoutStream};
use taxel_core::encode::{Tare, TareBuilder};
use taxel_core::held::{Held, as_events};
use taxel_core::{Array, Events, FramesView, Result};

/// Gathers a tare from the first event on for an interval of the board's time, or until the board marks a start. For
/// any duration, it stores only the taxels' values.
pub(super) struct TareMeasurement {
    stretch_us: i64,
    readout: Box<Detector>,
    builder: TareBuilder,
    first: Option<i64>,
    held: Held,
    /// The time and the values of the last frame.
    frame: Option<(i64, Vec<f32>)>,
    array: Array,
}

impl TareMeasurement {
    pub(super) fn new(stretch_us: i64, readout: Box<Detector>, array: &Array) -> Self {
        let (builder, held) = (TareBuilder::new(array, None), Held::unknown(array.len()));
        Self { stretch_us, readout, builder, first: None, held, frame: None, array: array.clone() }
    }

    /// Processes the next events; once the interval is over, returns its end (us) and the number of these events that
    /// belong to it.
    pub(super) fn push(&mut self, events: &Events, quiet_until: Option<i64>) -> Result<Option<(i64, usize)>> {
        if self.first.is_none() {
            self.first = events.t.first().copied();
        }
        let Some(first) = self.first else { return Ok(None) };
        let marked = events.markers.iter().find(|m| m.start && m.t > first).map(|m| m.t);
        let stop = marked.unwrap_or(i64::MAX).min(first + self.stretch_us);
        let inside = events.t.iter().position(|&t| t >= stop).unwrap_or(events.len());
        let piece = events.view().piece(0..inside);
        if !piece.is_empty() {
            self.builder.push_events(piece)?;
            self.held.push(piece);
        }
        let over = inside < events.len() || marked.is_some() || quiet_until.is_some_and(|t| t >= stop);
        Ok(over.then_some((stop, inside)))
    }

    /// Processes the next frames, as [`TareMeasurement::push`].
    pub(super) fn push_frames(&mut self, frames: FramesView<'_>) -> Result<Option<(i64, usize)>> {
        for (k, (t, values)) in frames.iter().enumerate() {
            let stop = *self.first.get_or_insert(t) + self.stretch_us;
            if t >= stop {
                return Ok(Some((stop, k)));
            }
            self.builder.push_frame(t, values)?;
            self.frame = Some((t, values.to_vec()));
        }
        Ok(None)
    }

    /// The tare, and the readout that uses it and is initialised with the taxels' values at `stop` us.
    pub(super) fn finish(self, stop: i64, frames: FrameTime) -> Result<(Tare, ReadoutStream)> {
        let tare = self.builder.finish(stop, "taken live")?;
        let (mut stream, mut none) = (self.readout.stream(&self.array, frames, Some(&tare))?, vec![]);
        stream.begin_at(stop);
        if let Some((t, values)) = self.frame {
            stream.push_frame(t, &values, &mut none)?;
            return Ok((tare, stream));
        }
        // The board sent these values, so none is repaired.
        let held = as_events(self.held.values(), self.first.unwrap_or(stop), &self.array);
        stream.push_events(Events { repaired: None, ..held }.view(), &mut none)?;
        stream.advance(stop, &mut none)?;
        Ok((tare, stream))
    }
}
