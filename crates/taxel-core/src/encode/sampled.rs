//! Encoders that read pressure: pictures as they come, or held intensities sampled at a fixed period.
//!
//! A [`Rule`] computes one encoder's law and reads neither events nor pieces; [`Sampled`] passes it the samples, and
//! the blocks that did not change since the last sample, which a rule can skip.

use super::blocks::{BLOCK, Block, Next, blocks, in_blocks};
use super::channels::{Channels, FARTHEST};
use super::law::Law;
use super::periods::micros;
use super::stream::Stream;
use super::tare::Tare;
use crate::events::FARTHEST_BACK_US;
use crate::held::Held;
use crate::rest::Rest;
use crate::spikes::{ms, us};
use crate::vectors::wide;
use crate::{Array, EventsView, Result, Spike, problem};

/// What an encoder does with samples; `sample` and `pass` are `#[inline(always)]`, to be compiled for wider vectors.
///
/// Channels are the existing taxels in the order of their index. The last block is filled up with channels that always read 0 and must never spike.
pub(super) trait Rule: Send + Clone + 'static {
    /// The first sample: the encoder begins as if the array had always read it.
    fn begin(&mut self, t: i64, held: &[Block], out: &mut Vec<Spike>);

    /// A later sample; only blocks that `changed` differ from the last one. Everything before `t` was passed.
    fn sample(&mut self, t: i64, held: &[Block], changed: &[bool], next: &mut Next, out: &mut Vec<Spike>);

    /// Whether a block takes so long to compute that the rule prefetches parts of the `next` picture between blocks.
    const ASKS: bool = false;

    /// Emits the spikes that fall due before `t` (exclusive) while the last sample holds.
    fn pass(&mut self, _t: i64, _out: &mut Vec<Spike>) {}

    /// Whether a value that a state repaired gives spikes. In a rule of changes it does not, as the time of the change is not
    /// known: the rule's reference moves with the value ([`Rule::repair`]).
    const SPIKES_OF_REPAIRED: bool = true;

    /// A state reports that a channel which read `from` reads `to`, and did so before: that gives no spike.
    fn repair(&mut self, _channel: usize, _from: f32, _to: f32) {}

    /// A channel, whose block counts as changed in the next sample, rests at `rest` from there on.
    fn set_rest(&mut self, _channel: usize, _rest: f64) {}

    /// The rest of a channel; `None` where that is not known, or the rule reads no tare.
    fn rest(&self, _channel: usize) -> Option<f64> {
        None
    }

    /// Whether the last sample, if it holds, gives no spike any more, so that samples without change may be left out.
    fn idle(&self) -> bool;
}

wide! {
    fn take_sample<R: Rule>(
        rule: &mut R,
        t: i64,
        held: &[Block],
        changed: &[bool],
        next: &mut Next,
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
pub(super) enum Source {
    Unknown,
    Events {
        /// The time come to: nothing counts as of before it any more.
        present: i64,
        /// How many came too far behind it.
        late: u64,
    },
    Frames {
        /// The first time at which a frame may still come.
        open: i64,
    },
}

impl Source {
    /// Takes the times of events; returns the time come to before them, `None` where there is no event.
    pub(super) fn events(&mut self, times: &[i64]) -> Result<Option<i64>> {
        let Some(&first) = times.first() else { return Ok(None) };
        let (before, mut late) = match *self {
            Source::Frames { .. } => return Err(problem!("event at {first} us: this stream was begun with frames")),
            Source::Events { present, late } => (present, late),
            Source::Unknown => (first, 0),
        };
        let mut present = before;
        for &t in times {
            present = present.max(t);
            late += u64::from(present - t > FARTHEST_BACK_US);
        }
        *self = Source::Events { present, late };
        Ok(Some(before))
    }

    /// How many events came too far behind the time come to.
    pub(super) fn late(&self) -> u64 {
        if let Source::Events { late, .. } = self { *late } else { 0 }
    }

    /// Takes the time of a frame.
    pub(super) fn frame(&mut self, t: i64) -> Result<()> {
        match *self {
            Source::Events { .. } => return Err(problem!("frame at {t} us: this stream was begun with events")),
            Source::Frames { open } if t < open => {
                return Err(problem!("frame at {t} us: must come at {open} us or later, times ascend"));
            }
            _ if t.unsigned_abs() > FARTHEST => return Err(problem!("frame at {t} us: lies too far from 0")),
            _ => {}
        }
        *self = Source::Frames { open: t + 1 };
        Ok(())
    }
}

/// A rule fed with samples: each frame is one; events are read as held intensities every `period`.
///
/// The samples of events stand at the first stamp plus whole periods, and each holds what came up to and at its time.
/// A taxel reads 0 until its first event. An event behind the latest stamp (reordered datagrams) counts as of that stamp.
#[derive(Clone)]
pub(super) struct Sampled<R> {
    rule: R,
    channels: Channels,
    period: i64,
    trains: usize,
    signed: bool,
    latency_ms: f64,
    held: Held<f32>,
    changed: Vec<bool>,
    quiet: bool,
    source: Source,
    /// The time of the next sample of events.
    next: i64,
    /// The time of the last sample, once begun.
    last: i64,
    begun: bool,
    steady: bool,
    above: Option<Above>,
}

/// What stands above rest, for a rule that feels held pressure: 0 where a taxel reads less, or where its rest is not known.
#[derive(Clone)]
struct Above {
    rest: Rest<f64>,
    /// What each place reads.
    held: Held<f32>,
    /// A picture of what stands above.
    picture: Vec<f32>,
}

impl Above {
    fn of(&self, place: usize) -> f32 {
        self.rest.above(place, f64::from(self.held.values()[place])) as f32
    }
}

impl<R: Rule> Sampled<R> {
    /// Samples for a rule, whose law says how many trains it has, whether they are signed, and how late they come.
    pub(super) fn new(law: &impl Law, rule: R, array: &Array, period_ms: f64) -> Result<Self> {
        let channels = Channels::new(array);
        let n = blocks(channels.len());
        Ok(Self {
            rule,
            channels,
            period: micros("period_ms", period_ms)?,
            trains: law.trains(array),
            signed: law.signed(),
            latency_ms: law.latency_ms(),
            held: Held::all(n * BLOCK, 0.0),
            changed: vec![false; n],
            quiet: true,
            source: Source::Unknown,
            next: 0,
            last: 0,
            begun: false,
            steady: false,
            above: None,
        })
    }

    /// Returns the rule values above rest, where there is a tare.
    pub(super) fn above(mut self, tare: Option<&Tare>, array: &Array) -> Result<Self> {
        if let Some(tare) = tare {
            let (rest, n) = (tare.rest_of(array)?, array.len());
            self.above = Some(Above { rest, held: Held::all(n, 0.0), picture: vec![0.0; n] });
        }
        Ok(self)
    }

    /// Frames must come at the period, give or take half of it.
    pub(super) fn steady(mut self) -> Self {
        self.steady = true;
        self
    }

    fn sample(&mut self, t: i64, mut next: Next, out: &mut Vec<Spike>) {
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

    /// Takes all samples of events before `t`.
    fn sample_until(&mut self, t: i64, out: &mut Vec<Spike>) {
        while self.next < t {
            if self.quiet && self.begun && self.rule.idle() {
                let left = t.abs_diff(self.next).div_ceil(self.period.unsigned_abs());
                self.next = self.next.saturating_add_unsigned(left.saturating_mul(self.period.unsigned_abs()));
                return;
            }
            self.sample(self.next, Next::unknown(), out);
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

    fn signed(&self) -> bool {
        self.signed
    }

    fn latency_ms(&self) -> f64 {
        self.latency_ms
    }

    fn push_events(&mut self, events: EventsView<'_>, out: &mut Vec<Spike>) -> Result<()> {
        self.channels.check(events)?;
        let Some(intensity) = &events.intensity else {
            return Err(problem!("events without intensities: this encoder reads held values, so record intensities"));
        };
        let fresh = matches!(self.source, Source::Unknown);
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
            let place = self.channels.place(events.x[k], events.y[k]);
            if intensity.present[k]
                && let Some(channel) = self.channels.of_place(place)
            {
                let read = f32::from(intensity.ticks[k]);
                let value = self.above.as_mut().map_or(read, |above| {
                    above.held.set(place, read);
                    above.of(place)
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

    fn hears_repaired_ms(&self) -> Option<f64> {
        R::SPIKES_OF_REPAIRED.then(|| ms(self.period) + self.latency_ms)
    }

    fn set_rest(&mut self, t: i64, place: usize, rest: f64, out: &mut Vec<Spike>) {
        let Some(channel) = self.channels.of_place(place) else { return };
        if let Source::Events { present, .. } = &mut self.source {
            *present = t.max(*present);
            self.sample_until(t, out);
        }
        if self.begun {
            pass(&mut self.rule, t, out);
        }
        self.rule.set_rest(channel, rest);
        if let Some(above) = &mut self.above {
            above.rest.set(place, rest);
            self.held.set(channel, above.of(place));
        }
        self.changed[channel / BLOCK] = true;
        self.quiet = false;
    }

    fn rest(&self, place: usize) -> Option<f64> {
        let channel = self.channels.of_place(place)?;
        let above = self.above.as_ref().map(|above| above.rest.values()[place]).filter(|rest| rest.is_finite());
        above.or_else(|| self.rule.rest(channel))
    }

    fn push_frame(&mut self, t: i64, values: &[f32], out: &mut Vec<Spike>) -> Result<()> {
        self.source.frame(t)?;
        if self.steady && self.begun && 2 * (t - self.last - self.period).abs() > self.period {
            let (since, period) = (ms(t - self.last), ms(self.period));
            return Err(problem!("frame at {t} us, {since} ms after the last: must come every period_ms, {period}"));
        }
        let (now, later) = (Next::after(values), Next::unknown());
        let (mut now, later) = if R::ASKS { (later, now) } else { (now, later) };
        let values = match &mut self.above {
            Some(above) if values.len() == above.picture.len() => {
                above.held.values_mut().copy_from_slice(values);
                for (place, &read) in values.iter().enumerate() {
                    // What is not finite stays so, and is refused.
                    above.picture[place] = if read.is_finite() { above.of(place) } else { read };
                }
                &above.picture
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
            Source::Unknown => return,
            Source::Events { present, .. } => {
                *present = t.max(*present);
                self.sample_until(t, out);
            }
            Source::Frames { open } => *open = t.max(*open),
        }
        if self.begun {
            pass(&mut self.rule, t, out);
        }
    }

    fn finish(&mut self, out: &mut Vec<Spike>) -> Option<f64> {
        // Rounded up, so that a spike that is due exactly after the latency is in.
        let latency = us(self.latency_ms).ceil() as i64;
        let end = match self.source {
            Source::Unknown => return None,
            Source::Events { present, .. } => present + self.period + latency,
            Source::Frames { open } => open - 1 + latency,
        };
        self.advance(end + 1, out);
        Some(ms(end))
    }
}
