//! The stream behind every encoder: it holds the current values and hands them to a rule, at each frame, and for events
//! periodically or at each stamp.
//!
//! Samples of events at a period are at the first stamp plus whole periods, and each includes the events up to and at its
//! time; those at each stamp follow its last event. A taxel reads 0 until its first event. An event behind the latest
//! stamp (reordered datagrams) counts as of that stamp.
//!
//! Reading: what changes without events, as a rest that is tracked does, is computed between stamps too: 10 ms after the
//! last one, and from 80 ms on after each further eighth of the time since it.

use super::blocks::{BLOCK, Block, blocks, in_blocks};
use super::channels::{Channels, FARTHEST};
use super::stream::{Stream, sort_from};
use crate::events::FARTHEST_BACK_US;
use crate::held::Held;
use crate::spikes::{ms, us};
use crate::vectors::wide;
use crate::{EventsView, Hint, Result, Spike, SpikeKind, problem};

/// The time after the last stamp at which a rule that drifts computes again, us.
const AGAIN_US: i64 = 10_000;

/// The part of the time since the last stamp after which it computes again, once that is longer.
const AGAIN_PART: i64 = 8;

/// The current values at a time.
#[derive(Clone, Copy)]
pub(super) struct Sample<'a> {
    /// Time, us.
    pub(super) t: i64,
    /// The values of the channels; padding channels of the last block always read 0 and must never spike.
    pub(super) held: &'a [Block],
    /// The blocks of which a value or a rest changed since the last sample.
    pub(super) changed: &'a [bool],
    /// Whether these are the values of a frame; those of events passed [`Rule::read`] one by one.
    pub(super) of_frame: bool,
}

/// How an encoder processes samples; it does not depend on events or pieces. `sample` and `pass` are
/// `#[inline(always)]` where they are to be compiled for wider vectors. The spikes of one call may come in any order.
pub(super) trait Rule: Send + Clone + 'static {
    /// Processes the first sample; by default as any other.
    fn begin(&mut self, now: Sample<'_>, out: &mut Vec<Spike>) {
        self.sample(now, out);
    }

    /// Processes a sample; `pass` was called up to its time.
    fn sample(&mut self, now: Sample<'_>, out: &mut Vec<Spike>);

    /// Emits the spikes that are due before `t` (exclusive) while the last sample holds.
    fn pass(&mut self, _t: i64, _out: &mut Vec<Spike>) {}

    /// Whether a value that a state repaired causes spikes. A rule that encodes changes sets it to false, because the
    /// time of the change is not known: its reference then moves with the value ([`Rule::read`]).
    const SPIKES_OF_REPAIRED: bool = true;

    /// Reads an event: a channel's value was `from` and is `to`. If it was `repaired` after the first sample, the change
    /// was in the past.
    #[inline(always)]
    fn read(&mut self, _channel: usize, _from: f32, _to: f32, _repaired: bool) {}

    /// Sets a channel's rest from now on.
    fn set_rest(&mut self, _channel: usize, _rest: f64) {}

    /// The rest of a channel; `None` if it is not known, or if the rule uses no tare.
    fn rest(&self, _channel: usize) -> Option<f64> {
        None
    }

    /// Whether the last sample causes no further spikes while it holds, so that unchanged samples can be skipped.
    fn idle(&self) -> bool {
        false
    }
}

wide! {
    fn take_sample<R: Rule>(rule: &mut R, now: Sample<'_>, out: &mut Vec<Spike>) {
        rule.pass(now.t, out);
        rule.sample(now, out);
    }
}

wide! {
    fn pass<R: Rule>(rule: &mut R, t: i64, out: &mut Vec<Spike>) {
        rule.pass(t, out);
    }
}

/// When the values of events are a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Clock {
    /// Every so many us.
    Period(i64),
    /// At each stamp, and, for a rule that `drifts` while the values hold, between stamps.
    Stamps { drifts: bool },
}

/// The trains of a stream.
#[derive(Debug, Clone, Copy)]
pub(super) struct Trains {
    pub(super) number: usize,
    pub(super) kind: SpikeKind,
    pub(super) latency_ms: f64,
}

/// The input of a stream, never both.
#[derive(Clone, Copy, PartialEq)]
enum Input {
    Unknown,
    Events,
    Frames,
}

/// Hands the current values to a rule.
#[derive(Clone)]
pub(super) struct Driver<R> {
    rule: R,
    channels: Channels,
    trains: Trains,
    clock: Clock,
    /// Whether frames must arrive at the clock's period, within half of it.
    steady: bool,
    held: Held<f32>,
    changed: Vec<bool>,
    /// Whether an event or a rest came after the last sample.
    fresh: bool,
    input: Input,
    /// Of events the current time, us: later ones count as of this time or later. Of frames the earliest of the next.
    present: i64,
    /// Number of events that were too far behind the current time.
    late: u64,
    /// The time of the next sample of events without a fresh one, us.
    next: i64,
    /// The time of the last sample of something fresh, us.
    last: i64,
    begun: bool,
}

impl<R: Rule> Driver<R> {
    pub(super) fn new(rule: R, channels: Channels, trains: Trains, clock: Clock) -> Self {
        let n = blocks(channels.len());
        Self {
            rule,
            channels,
            trains,
            clock,
            steady: false,
            held: Held::all(n * BLOCK, 0.0),
            changed: vec![false; n],
            fresh: false,
            input: Input::Unknown,
            present: 0,
            late: 0,
            next: i64::MAX,
            last: 0,
            begun: false,
        }
    }

    /// Requires frames to arrive at the period, within half of it.
    pub(super) fn steady(self) -> Self {
        Self { steady: true, ..self }
    }

    /// The period of samples, us; 0 at each stamp.
    fn period(&self) -> i64 {
        if let Clock::Period(period) = self.clock { period } else { 0 }
    }

    fn sample(&mut self, t: i64, out: &mut Vec<Spike>) {
        let from = out.len();
        let (held, of_frame) = (in_blocks(self.held.values()), self.input == Input::Frames);
        let now = Sample { t, held, changed: &self.changed, of_frame };
        if self.begun {
            take_sample(&mut self.rule, now, out);
        } else {
            self.rule.begin(now, out);
        }
        sort_from(out, from);
        self.next = match self.clock {
            Clock::Period(period) => t + period,
            Clock::Stamps { drifts: false } => i64::MAX,
            Clock::Stamps { .. } if self.fresh => t + AGAIN_US,
            Clock::Stamps { .. } => t + AGAIN_US.max((t - self.last) / AGAIN_PART),
        };
        if self.fresh {
            self.last = t;
        }
        self.changed.fill(false);
        (self.begun, self.fresh) = (true, false);
    }

    /// Processes all samples of events before `t`.
    fn sample_until(&mut self, t: i64, out: &mut Vec<Spike>) {
        loop {
            let at = if self.fresh && self.period() == 0 { self.present } else { self.next };
            if at >= t {
                return;
            }
            if let Clock::Period(period) = self.clock
                && self.begun
                && !self.fresh
                && self.rule.idle()
            {
                let left = t.abs_diff(at).div_ceil(period.unsigned_abs());
                self.next = at.saturating_add_unsigned(left.saturating_mul(period.unsigned_abs()));
                return;
            }
            self.sample(at, out);
        }
    }

    fn pass(&mut self, t: i64, out: &mut Vec<Spike>) {
        if self.begun {
            let from = out.len();
            pass(&mut self.rule, t, out);
            sort_from(out, from);
        }
    }
}

impl<R: Rule> Stream for Driver<R> {
    fn fork(&self) -> Box<dyn Stream> {
        Box::new(self.clone())
    }

    fn late(&self) -> u64 {
        self.late
    }

    fn trains(&self) -> usize {
        self.trains.number
    }

    fn kind(&self) -> SpikeKind {
        self.trains.kind
    }

    fn latency_ms(&self) -> f64 {
        self.trains.latency_ms
    }

    fn push_events(&mut self, events: EventsView<'_>, out: &mut Vec<Spike>) -> Result<()> {
        self.channels.check(events)?;
        let Some(intensity) = &events.intensity else {
            return Err(problem!("events without intensities: this encoder needs intensities, so record them"));
        };
        let Some(&first) = events.t.first() else { return Ok(()) };
        match self.input {
            Input::Frames => {
                return Err(problem!(
                    "event at {first} us: this stream was begun with frames, so it accepts only frames"
                ));
            }
            Input::Events => {}
            Input::Unknown => {
                (self.input, self.present) = (Input::Events, first);
                if self.period() > 0 {
                    self.next = first;
                }
            }
        }
        for (k, &t) in events.t.iter().enumerate() {
            if t > self.present {
                self.sample_until(t, out);
                self.present = t;
            }
            self.late += u64::from(self.present - t > FARTHEST_BACK_US);
            let taxel = self.channels.taxel(events.x[k], events.y[k]);
            let Some(channel) = self.channels.of_taxel(taxel) else { continue };
            self.fresh = true;
            if intensity.present[k] {
                let value = f32::from(intensity.ticks[k]);
                let before = self.held.set(channel, value);
                self.rule.read(channel, before, value, self.begun && events.is_repaired(k));
                self.changed[channel / BLOCK] = true;
            }
        }
        self.pass(self.present, out);
        Ok(())
    }

    fn repaired_span_ms(&self) -> Option<f64> {
        R::SPIKES_OF_REPAIRED.then(|| ms(self.period()) + self.trains.latency_ms)
    }

    fn set_rest(&mut self, t: i64, taxel: usize, rest: f64, out: &mut Vec<Spike>) {
        let Some(channel) = self.channels.of_taxel(taxel) else { return };
        self.advance(t, out);
        self.rule.set_rest(channel, rest);
        if self.input != Input::Frames {
            let value = self.held.values()[channel];
            self.rule.read(channel, value, value, false);
        }
        self.changed[channel / BLOCK] = true;
        self.fresh = true;
    }

    fn rest(&self, taxel: usize) -> Option<f64> {
        self.channels.of_taxel(taxel).and_then(|channel| self.rule.rest(channel))
    }

    fn push_frame(&mut self, t: i64, values: &[f32], out: &mut Vec<Spike>) -> Result<()> {
        match self.input {
            Input::Events => {
                return Err(problem!("frame at {t} us: this stream was begun with events, so it accepts only events"));
            }
            Input::Frames if t < self.present => {
                let open = self.present;
                return Err(problem!("frame at {t} us: must be at {open} us or later, because times must ascend"));
            }
            _ if t.unsigned_abs() > FARTHEST => return Err(problem!("frame at {t} us: the time is too far from 0")),
            _ => (self.input, self.present) = (Input::Frames, t + 1),
        }
        if self.steady && self.begun && 2 * (t - self.last - self.period()).abs() > self.period() {
            let (since, period) = (ms(t - self.last), ms(self.period()));
            return Err(problem!(
                "frame at {t} us is {since} ms after the previous frame: frames must come every {period} ms"
            )
            .with_hint("period_ms", Hint::Give));
        }
        self.channels.load(t, values, &mut self.held, &mut self.changed)?;
        self.fresh = true;
        self.sample(t, out);
        Ok(())
    }

    fn advance(&mut self, t: i64, out: &mut Vec<Spike>) {
        let t = t.clamp(-(FARTHEST as i64), FARTHEST as i64);
        match self.input {
            Input::Unknown => return,
            Input::Events => self.sample_until(t, out),
            Input::Frames => {}
        }
        self.present = self.present.max(t);
        self.pass(t, out);
    }

    fn finish(&mut self, out: &mut Vec<Spike>) -> Option<f64> {
        // Rounded up, to include a spike that is due exactly after the latency.
        let latency = us(self.trains.latency_ms).ceil() as i64;
        let end = match self.input {
            Input::Unknown => return None,
            Input::Events => self.present + self.period() + latency,
            Input::Frames => self.present - 1 + latency,
        };
        self.advance(end + 1, out);
        Some(ms(end))
    }
}
