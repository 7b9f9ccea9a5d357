//! A stream of what is computed from the loaded taxels once per stamp, after its last event, or once per frame.
//!
//! Reading: what changes without events, as a rest that is tracked does, is computed between stamps too: 10 ms after the
//! last one, and from 80 ms on after each further eighth of the time since it.

use super::blocks::{BLOCK, Block, NextFrame, blocks, in_blocks};
use super::channels::Channels;
use super::loaded::Loaded;
use super::sampled::StreamInput;
use super::stream::Stream;
use crate::held::Held;
use crate::spikes::ms;
use crate::{Array, EventsView, Result, Spike, SpikeKind, problem};

/// The time after the last stamp at which a measure that drifts is computed again, us.
const AGAIN_US: i64 = 10_000;

/// The part of the time since the last stamp after which it is computed again, once that is longer.
const AGAIN_PART: i64 = 8;

/// What is computed at the end of each stamp.
pub(super) trait Measure: Clone + Send + 'static {
    /// The number of its spike trains.
    fn trains(&self) -> usize;

    /// What its spikes are.
    fn kind(&self) -> SpikeKind {
        SpikeKind::Unsigned
    }

    /// Whether it changes while the values hold, so that it is computed between stamps too.
    fn drifts(&self) -> bool {
        false
    }

    /// Sets the rest of a taxel from now on.
    fn set_rest(&mut self, _place: usize, _rest: f64) {}

    /// Ends the stamp, or the frame, at `t` us: emits its spikes, given the loaded taxels and all current values.
    fn emit(&mut self, t: i64, loaded: &Loaded, held: &[Block], out: &mut Vec<Spike>);
}

/// Passes a measure the loaded taxels and the current values of all taxels, by stamp or by frame.
#[derive(Clone)]
pub(super) struct ByStamp<M> {
    measure: M,
    loaded: Loaded,
    held: Held<f32>,
    changed: Vec<bool>,
    channels: Channels,
    source: StreamInput,
    /// Whether a value or a rest changed that was not computed with.
    fresh: bool,
    /// The last stamp that was computed, us.
    stamp: i64,
    /// The time after it at which a measure that drifts is computed next, us; `None` before the first stamp.
    again: Option<i64>,
}

impl<M: Measure> ByStamp<M> {
    pub(super) fn new(measure: M, loaded: Loaded, array: &Array) -> Self {
        Self {
            measure,
            loaded,
            held: Held::all(blocks(array.len()) * BLOCK, 0.0),
            changed: vec![false; blocks(array.len())],
            // Channels are all taxels here; `loaded` defines which taxels exist.
            channels: Channels::new(&Array { exists: None, ..array.clone() }),
            source: StreamInput::Unknown,
            fresh: false,
            stamp: 0,
            again: None,
        }
    }

    fn emit(&mut self, t: i64, out: &mut Vec<Spike>) {
        self.measure.emit(t, &self.loaded, in_blocks(self.held.values()), out);
    }

    /// Computes what is due before `t` us, given the latest stamp.
    fn pass(&mut self, stamp: i64, t: i64, out: &mut Vec<Spike>) {
        if t <= stamp {
            return;
        }
        if std::mem::take(&mut self.fresh) {
            self.emit(stamp, out);
            (self.stamp, self.again) = (stamp, self.measure.drifts().then_some(stamp + AGAIN_US));
        }
        while let Some(at) = self.again.filter(|&at| at < t) {
            self.emit(at, out);
            self.again = Some(at + AGAIN_US.max((at - self.stamp) / AGAIN_PART));
        }
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
        self.measure.kind()
    }

    fn latency_ms(&self) -> f64 {
        0.0
    }

    fn push_events(&mut self, events: EventsView<'_>, out: &mut Vec<Spike>) -> Result<()> {
        self.channels.check(events)?;
        let Some(intensity) = &events.intensity else {
            return Err(problem!("events without intensities: this encoder needs intensities, so record them"));
        };
        let Some(mut present) = self.source.events(events.t)? else { return Ok(()) };
        for k in 0..events.len() {
            if events.t[k] > present {
                self.pass(present, events.t[k], out);
                present = events.t[k];
            }
            let taxel = events.array.index(events.x[k], events.y[k]);
            if !events.array.has(taxel) {
                continue;
            }
            self.fresh = true;
            if intensity.present[k] {
                let value = f32::from(intensity.ticks[k]);
                self.held.set(taxel, value);
                self.loaded.take(taxel, value);
            }
        }
        Ok(())
    }

    fn set_rest(&mut self, t: i64, taxel: usize, rest: f64, out: &mut Vec<Spike>) {
        self.advance(t, out);
        self.loaded.set_rest(taxel, rest);
        self.measure.set_rest(taxel, rest);
        self.fresh = true;
        match self.source {
            // Marks the block as changed, so that it is computed with the new rest in the next frame.
            StreamInput::Frames { .. } => self.changed[taxel / BLOCK] = true,
            _ => self.loaded.take(taxel, self.held.values()[taxel]),
        }
    }

    fn rest(&self, taxel: usize) -> Option<f64> {
        self.loaded.rest(taxel)
    }

    fn push_frame(&mut self, t: i64, values: &[f32], out: &mut Vec<Spike>) -> Result<()> {
        self.source.frame(t)?;
        self.channels.load(t, values, &mut self.held, &mut self.changed, &mut NextFrame::after(values))?;
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
            StreamInput::Unknown => {}
            StreamInput::Frames { open } => *open = t.max(*open),
            StreamInput::Events { present, .. } => {
                let stamp = *present;
                *present = t.max(stamp);
                self.pass(stamp, t, out);
            }
        }
    }

    fn finish(&mut self, out: &mut Vec<Spike>) -> Option<f64> {
        let end = match self.source {
            StreamInput::Unknown => return None,
            StreamInput::Events { present, .. } => present,
            StreamInput::Frames { open } => open - 1,
        };
        self.advance(end + 1, out);
        Some(ms(end))
    }
}
