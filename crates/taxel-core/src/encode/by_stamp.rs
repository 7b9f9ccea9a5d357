//! A stream of what is computed from the loaded taxels once per stamp, after its last event, or once per picture.

use super::blocks::{BLOCK, Block, Next, blocks, in_blocks};
use super::channels::Channels;
use super::loaded::Loaded;
use super::sampled::Source;
use super::stream::Stream;
use crate::held::Held;
use crate::spikes::ms;
use crate::{Array, EventsView, Result, Spike, SpikeKind, problem};

/// What is computed at the end of each stamp.
pub(super) trait Measure: Clone + Send + 'static {
    /// The number of its spike trains.
    fn trains(&self) -> usize;

    /// Ends the stamp, or the picture, at `t` us: emits its spikes, given the loaded taxels and all current values.
    fn emit(&mut self, t: i64, loaded: &Loaded, held: &[Block], out: &mut Vec<Spike>);
}

/// Passes a measure the loaded taxels and the current values of all places, by stamp or by picture.
#[derive(Clone)]
pub(super) struct ByStamp<M> {
    measure: M,
    loaded: Loaded,
    held: Held<f32>,
    changed: Vec<bool>,
    channels: Channels,
    source: Source,
}

impl<M: Measure> ByStamp<M> {
    pub(super) fn new(measure: M, loaded: Loaded, array: &Array) -> Self {
        Self {
            measure,
            loaded,
            held: Held::all(blocks(array.len()) * BLOCK, 0.0),
            changed: vec![false; blocks(array.len())],
            // Channels are all places here; `loaded` defines which taxels exist.
            channels: Channels::new(&Array { exists: None, ..array.clone() }),
            source: Source::Unknown,
        }
    }

    fn emit(&mut self, t: i64, out: &mut Vec<Spike>) {
        self.measure.emit(t, &self.loaded, in_blocks(self.held.values()), out);
    }
}

impl<M: Measure> Stream for ByStamp<M> {
    fn fork(&self) -> Box<dyn Stream> {
        Box::new(self.clone())
    }

    fn late(&self) -> u64 {
        self.source.late()
    }

    fn trains(&self) -> usize {
        self.measure.trains()
    }

    fn kind(&self) -> SpikeKind {
        SpikeKind::Unsigned
    }

    fn latency_ms(&self) -> f64 {
        0.0
    }

    fn push_events(&mut self, events: EventsView<'_>, out: &mut Vec<Spike>) -> Result<()> {
        self.channels.check(events)?;
        let Some(intensity) = &events.intensity else {
            return Err(problem!("events without intensities: this encoder reads held values, so record intensities"));
        };
        let Some(mut present) = self.source.events(events.t)? else { return Ok(()) };
        for k in 0..events.len() {
            if events.t[k] > present {
                self.emit(present, out);
                present = events.t[k];
            }
            if intensity.present[k] {
                let place = events.array.index(events.x[k], events.y[k]);
                let value = f32::from(intensity.ticks[k]);
                self.held.set(place, value);
                self.loaded.take(place, value);
            }
        }
        Ok(())
    }

    fn set_rest(&mut self, t: i64, place: usize, rest: f64, out: &mut Vec<Spike>) {
        self.advance(t, out);
        self.loaded.set_rest(place, rest);
        match self.source {
            // Marks the block as changed, so that it is computed with the new rest in the next frame.
            Source::Frames { .. } => self.changed[place / BLOCK] = true,
            _ => self.loaded.take(place, self.held.values()[place]),
        }
    }

    fn rest(&self, place: usize) -> Option<f64> {
        self.loaded.rest(place)
    }

    fn push_frame(&mut self, t: i64, values: &[f32], out: &mut Vec<Spike>) -> Result<()> {
        self.source.frame(t)?;
        self.channels.load(t, values, &mut self.held, &mut self.changed, &mut Next::after(values))?;
        for (block, values) in in_blocks(self.held.values()).iter().enumerate() {
            if std::mem::take(&mut self.changed[block]) {
                self.loaded.take_block(block, values);
            }
        }
        self.emit(t, out);
        Ok(())
    }

    fn advance(&mut self, t: i64, out: &mut Vec<Spike>) {
        match &mut self.source {
            Source::Unknown => {}
            Source::Frames { open } => *open = t.max(*open),
            Source::Events { present, .. } => {
                let stamp = *present;
                if t > stamp {
                    *present = t;
                    self.emit(stamp, out);
                }
            }
        }
    }

    fn finish(&mut self, out: &mut Vec<Spike>) -> Option<f64> {
        let end = match self.source {
            Source::Unknown => return None,
            Source::Events { present, .. } => present,
            Source::Frames { open } => open - 1,
        };
        self.advance(end + 1, out);
        Some(ms(end))
    }
}
