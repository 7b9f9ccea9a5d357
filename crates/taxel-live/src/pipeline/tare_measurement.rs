//! A sensor at rest, from which a tare is computed.

use taxel_core::detect::{Detector, FrameTime, ReadoutStream};
use taxel_core::encode::{Tare, TareBuilder};
use taxel_core::{Events, FramesView, Intensities, Result};

/// Gathers a tare from the first event on for an interval of the board's time, or until the board marks a start. For
/// any duration, it stores only the last event of each taxel, that is, the taxel's value.
pub(super) struct TareMeasurement {
    stretch_us: i64,
    readout: Box<Detector>,
    builder: TareBuilder,
    first: Option<i64>,
    last: Vec<Option<LastEvent>>,
    /// The time and the values of the last frame.
    frame: Option<(i64, Vec<f32>)>,
    array: taxel_core::Array,
}

#[derive(Clone, Copy)]
struct LastEvent {
    t: i64,
    p: bool,
    ticks: u16,
}

impl TareMeasurement {
    pub(super) fn new(stretch_us: i64, readout: Box<Detector>, array: &taxel_core::Array) -> Self {
        let builder = TareBuilder::new(array, None);
        Self {
            stretch_us,
            readout,
            builder,
            first: None,
            last: vec![None; array.len()],
            frame: None,
            array: array.clone(),
        }
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
        }
        if let Some(intensity) = piece.intensity {
            for k in (0..inside).filter(|&k| intensity.present[k]) {
                let last = LastEvent { t: piece.t[k], p: piece.p[k], ticks: intensity.ticks[k] };
                self.last[self.array.index(piece.x[k], piece.y[k])] = Some(last);
            }
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
        let mut stream = self.readout.stream(&self.array, frames, Some(&tare))?;
        if let Some((t, values)) = self.frame {
            stream.begin_at(stop);
            stream.push_frame(t, &values, &mut vec![])?;
            return Ok((tare, stream));
        }
        let mut held: Vec<(usize, LastEvent)> =
            self.last.iter().enumerate().filter_map(|(taxel, last)| last.map(|last| (taxel, last))).collect();
        held.sort_by_key(|(_, last)| last.t);
        let columns = usize::from(self.array.columns);
        // A taxel's index is on the array, so its row and column fit.
        #[allow(clippy::cast_possible_truncation)]
        let events = Events {
            t: held.iter().map(|(_, last)| last.t).collect(),
            x: held.iter().map(|(taxel, _)| (taxel % columns) as u16).collect(),
            y: held.iter().map(|(taxel, _)| (taxel / columns) as u16).collect(),
            p: held.iter().map(|(_, last)| last.p).collect(),
            intensity: Some(Intensities {
                ticks: held.iter().map(|(_, last)| last.ticks).collect(),
                present: vec![true; held.len()],
            }),
            ..Events::empty(self.array)
        };
        stream.begin_at(stop);
        let mut none = vec![];
        stream.push_events(events.view(), &mut none)?;
        stream.advance(stop, &mut none)?;
        Ok((tare, stream))
    }
}
