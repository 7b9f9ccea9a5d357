//! Encoders of pressure: they read each frame, or current intensities sampled at a fixed period.
//!
//! A [`Rule`] implements one encoder and does not depend on events or pieces; [`Sampled`] passes it the samples and
//! marks the blocks that did not change since the last sample, which a rule can skip.

use super::blocks::{BLOCK, Block, NextFrame, blocks, in_blocks};
use super::channels::{Channels, FARTHEST};
use super::encoding::Encoding;
use super::periods::micros;
use super::stream::Stream;
use super::tare::Tare;
use crate::events::FARTHEST_BACK_US;
use crate::held::Held;
use crate::rest::Rest;
use crate::spikes::{ms, us};
use crate::vectors::wide;
use crate::{Array, EventsView, Hint, Result, Spike, SpikeKind, problem};

/// How an encoder processes samples; `sample` and `pass` are `#[inline(always)]`, so that they are compiled for wider
/// vectors.
///
/// Channels are the existing taxels in the order of their index. Padding channels of the last block always read 0 and
/// must never spike.
pub(super) trait Rule: Send + Clone + 'static {
    /// Processes the first sample: the state is that of a constant input equal to it.
    fn begin(&mut self, t: i64, held: &[Block], out: &mut Vec<Spike>);

    /// Processes a later sample; only blocks that `changed` differ from the last one. `pass` was called up to `t`.
    fn sample(&mut self, t: i64, held: &[Block], changed: &[bool], next: &mut NextFrame, out: &mut Vec<Spike>);

    /// Whether a block takes so long to compute that the rule prefetches parts of the `next` frame between blocks.
    const PREFETCHES: bool = false;

    /// Emits the spikes that are due before `t` (exclusive) while the last sample holds.
    fn pass(&mut self, _t: i64, _out: &mut Vec<Spike>) {}

    /// Whether a value that a state repaired causes spikes. A rule that encodes changes sets it to false, because the
    /// time of the change is not known: its reference then moves with the value ([`Rule::repair`]).
    const SPIKES_OF_REPAIRED: bool = true;

    /// Notes that a state reports the value `to` for a channel whose value was `from`, with the change in the past;
    /// causes no spike.
    fn repair(&mut self, _channel: usize, _from: f32, _to: f32) {}

    /// Sets a channel's rest from now on; the channel's block counts as changed in the next sample.
    fn set_rest(&mut self, _channel: usize, _rest: f64) {}

    /// The rest of a channel; `None` if it is not known, or if the rule uses no tare.
    fn rest(&self, _channel: usize) -> Option<f64> {
        None
    }

    /// Whether the last sample causes no further spikes while it holds, so that unchanged samples can be skipped.
    fn idle(&self) -> bool;
}

wide! {
    fn take_sample<R: Rule>(
        rule: &mut R,
        t: i64,
        held: &[Block],
        changed: &[bool],
        next: &mut NextFrame,
        out: &mut Vec<Spike>,
    ) {
        rule.pass(t, out);
        rule.sample(t, held, changed, next, out);
        while next.fetch() {}
    }
}

wide! {
    fn pass<R: Rule>(rule: &mut R, t: i64, out: &mut Vec<Spike>) {
        rule.pass(t, out);
    }
}

/// The input of a stream: events or frames, never both.
#[derive(Clone)]
pub(super) enum StreamInput {
    Unknown,
    Events {
        /// Current time of the stream: later input counts as of this time or later.
        present: i64,
        /// Number of events that were too far behind the current time.
        late: u64,
    },
    Frames {
        /// The earliest time that the next frame may have.
        open: i64,
    },
}

impl StreamInput {
    /// Advances the time by events; returns the time before them, `None` if there is no event.
    pub(super) fn events(&mut self, times: &[i64]) -> Result<Option<i64>> {
        let Some(&first) = times.first() else { return Ok(None) };
        let (before, mut late) = match *self {
            StreamInput::Frames { .. } => {
                return Err(problem!(
                    "event at {first} us: this stream was begun with frames, so it accepts only frames"
                ));
            }
            StreamInput::Events { present, late } => (present, late),
            StreamInput::Unknown => (first, 0),
        };
        let mut present = before;
        for &t in times {
            present = present.max(t);
            late += u64::from(present - t > FARTHEST_BACK_US);
        }
        *self = StreamInput::Events { present, late };
        Ok(Some(before))
    }

    /// Number of events that were too far behind the current time.
    pub(super) fn late(&self) -> u64 {
        if let StreamInput::Events { late, .. } = self { *late } else { 0 }
    }

    /// Advances the time by a frame.
    pub(super) fn frame(&mut self, t: i64) -> Result<()> {
        match *self {
            StreamInput::Events { .. } => {
                return Err(problem!("frame at {t} us: this stream was begun with events, so it accepts only events"));
            }
            StreamInput::Frames { open } if t < open => {
                return Err(problem!("frame at {t} us: must be at {open} us or later, because times must ascend"));
            }
            _ if t.unsigned_abs() > FARTHEST => return Err(problem!("frame at {t} us: the time is too far from 0")),
            _ => {}
        }
        *self = StreamInput::Frames { open: t + 1 };
        Ok(())
    }
}

/// Feeds a rule with samples: each frame is one; events are sampled as current intensities every `period`.
///
/// Samples of events are at the first stamp plus whole periods, and each includes the events up to and at its time. A
/// taxel reads 0 until its first event. An event behind the latest stamp (reordered datagrams) counts as of that stamp.
#[derive(Clone)]
pub(super) struct Sampled<R> {
    rule: R,
    channels: Channels,
    period: i64,
    trains: usize,
    kind: SpikeKind,
    latency_ms: f64,
    held: Held<f32>,
    changed: Vec<bool>,
    quiet: bool,
    source: StreamInput,
    /// The time of the next sample of events.
    next: i64,
    /// The time of the last sample, once begun.
    last: i64,
    begun: bool,
    steady: bool,
    above: Option<Above>,
}

/// Values above rest, for a rule that encodes sustained pressure: 0 if a taxel's value is below its rest, or if the
/// rest is not known.
#[derive(Clone)]
struct Above {
    rest: Rest<f64>,
    /// The current value of each taxel.
    held: Held<f32>,
    /// A frame of the values above rest.
    frame: Vec<f32>,
}

impl Above {
    fn value(&self, taxel: usize) -> f32 {
        self.rest.above(taxel, f64::from(self.held.values()[taxel])) as f32
    }
}

impl<R: Rule> Sampled<R> {
    /// Feeds a rule with samples; `encoding` defines the number of trains, their kind, and the latency.
    pub(super) fn new(encoding: &impl Encoding, rule: R, array: &Array, period_ms: f64) -> Result<Self> {
        let channels = Channels::new(array);
        let n = blocks(channels.len());
        Ok(Self {
            rule,
            channels,
            period: micros("period_ms", period_ms)?,
            trains: encoding.trains(array),
            kind: encoding.kind(),
            latency_ms: encoding.latency_ms(),
            held: Held::all(n * BLOCK, 0.0),
            changed: vec![false; n],
            quiet: true,
            source: StreamInput::Unknown,
            next: 0,
            last: 0,
            begun: false,
            steady: false,
            above: None,
        })
    }

    /// Passes the rule values above rest, if there is a tare.
    pub(super) fn above(mut self, tare: Option<&Tare>, array: &Array) -> Result<Self> {
        if let Some(tare) = tare {
            let (rest, n) = (tare.rest_of(array)?, array.len());
            self.above = Some(Above { rest, held: Held::all(n, 0.0), frame: vec![0.0; n] });
        }
        Ok(self)
    }

    /// Requires frames to arrive at the period, within half of it.
    pub(super) fn steady(mut self) -> Self {
        self.steady = true;
        self
    }

    fn sample(&mut self, t: i64, mut next: NextFrame, out: &mut Vec<Spike>) {
        let held = in_blocks(self.held.values());
        if self.begun {
            take_sample(&mut self.rule, t, held, &self.changed, &mut next, out);
        } else {
            self.rule.begin(t, held, out);
            self.begun = true;
        }
        self.last = t;
        self.changed.fill(false);
        self.quiet = true;
    }

    /// Processes all samples of events before `t`.
    fn sample_until(&mut self, t: i64, out: &mut Vec<Spike>) {
        while self.next < t {
            if self.quiet && self.begun && self.rule.idle() {
                let left = t.abs_diff(self.next).div_ceil(self.period.unsigned_abs());
                self.next = self.next.saturating_add_unsigned(left.saturating_mul(self.period.unsigned_abs()));
                return;
            }
            self.sample(self.next, NextFrame::unknown(), out);
            self.next += self.period;
        }
    }
}

impl<R: Rule> Stream for Sampled<R> {
    fn fork(&self) -> Box<dyn Stream> {
        Box::new(self.clone())
    }

    fn late(&self) -> u64 {
        self.source.late()
    }

    fn trains(&self) -> usize {
        self.trains
    }

    fn kind(&self) -> SpikeKind {
        self.kind
    }

    fn latency_ms(&self) -> f64 {
        self.latency_ms
    }

    fn push_events(&mut self, events: EventsView<'_>, out: &mut Vec<Spike>) -> Result<()> {
        self.channels.check(events)?;
        let Some(intensity) = &events.intensity else {
            return Err(problem!("events without intensities: this encoder needs intensities, so record them"));
        };
        let fresh = matches!(self.source, StreamInput::Unknown);
        let Some(mut present) = self.source.events(events.t)? else { return Ok(()) };
        if fresh {
            self.next = present;
        }
        for k in 0..events.len() {
            if events.t[k] > present {
                present = events.t[k];
                if present > self.next {
                    self.sample_until(present, out);
                }
            }
            let taxel = self.channels.taxel(events.x[k], events.y[k]);
            if intensity.present[k]
                && let Some(channel) = self.channels.of_taxel(taxel)
            {
                let read = f32::from(intensity.ticks[k]);
                let value = self.above.as_mut().map_or(read, |above| {
                    above.held.set(taxel, read);
                    above.value(taxel)
                });
                let before = self.held.set(channel, value);
                if self.begun && events.is_repaired(k) {
                    self.rule.repair(channel, before, value);
                }
                self.changed[channel / BLOCK] = true;
                self.quiet = false;
            }
        }
        if self.begun {
            pass(&mut self.rule, present, out);
        }
        Ok(())
    }

    fn repaired_span_ms(&self) -> Option<f64> {
        R::SPIKES_OF_REPAIRED.then(|| ms(self.period) + self.latency_ms)
    }

    fn set_rest(&mut self, t: i64, taxel: usize, rest: f64, out: &mut Vec<Spike>) {
        let Some(channel) = self.channels.of_taxel(taxel) else { return };
        if let StreamInput::Events { present, .. } = &mut self.source {
            *present = t.max(*present);
            self.sample_until(t, out);
        }
        if self.begun {
            pass(&mut self.rule, t, out);
        }
        self.rule.set_rest(channel, rest);
        if let Some(above) = &mut self.above {
            above.rest.set(taxel, rest);
            self.held.set(channel, above.value(taxel));
        }
        self.changed[channel / BLOCK] = true;
        self.quiet = false;
    }

    fn rest(&self, taxel: usize) -> Option<f64> {
        let channel = self.channels.of_taxel(taxel)?;
        let above = self.above.as_ref().map(|above| above.rest.values()[taxel]).filter(|rest| rest.is_finite());
        above.or_else(|| self.rule.rest(channel))
    }

    fn push_frame(&mut self, t: i64, values: &[f32], out: &mut Vec<Spike>) -> Result<()> {
        self.source.frame(t)?;
        if self.steady && self.begun && 2 * (t - self.last - self.period).abs() > self.period {
            let (since, period) = (ms(t - self.last), ms(self.period));
            return Err(problem!(
                "frame at {t} us is {since} ms after the previous frame: frames must come every {period} ms"
            )
            .with_hint("period_ms", Hint::Give));
        }
        let (now, later) = (NextFrame::after(values), NextFrame::unknown());
        let (mut now, later) = if R::PREFETCHES { (later, now) } else { (now, later) };
        let values = match &mut self.above {
            Some(above) if values.len() == above.frame.len() => {
                above.held.values_mut().copy_from_slice(values);
                for (taxel, &read) in values.iter().enumerate() {
                    // Infinite values and NaN stay, so that they are refused below.
                    above.frame[taxel] = if read.is_finite() { above.value(taxel) } else { read };
                }
                &above.frame
            }
            _ => values,
        };
        self.channels.load(t, values, &mut self.held, &mut self.changed, &mut now)?;
        self.sample(t, later, out);
        Ok(())
    }

    fn advance(&mut self, t: i64, out: &mut Vec<Spike>) {
        let t = t.clamp(-(FARTHEST as i64), FARTHEST as i64);
        match &mut self.source {
            StreamInput::Unknown => return,
            StreamInput::Events { present, .. } => {
                *present = t.max(*present);
                self.sample_until(t, out);
            }
            StreamInput::Frames { open } => *open = t.max(*open),
        }
        if self.begun {
            pass(&mut self.rule, t, out);
        }
    }

    fn finish(&mut self, out: &mut Vec<Spike>) -> Option<f64> {
        // Rounded up, to include a spike that is due exactly after the latency.
        let latency = us(self.latency_ms).ceil() as i64;
        let end = match self.source {
            StreamInput::Unknown => return None,
            StreamInput::Events { present, .. } => present + self.period + latency,
            StreamInput::Frames { open } => open - 1 + latency,
        };
        self.advance(end + 1, out);
        Some(ms(end))
    }
}
