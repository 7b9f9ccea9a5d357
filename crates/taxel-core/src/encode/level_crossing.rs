//! Crossings of levels, with hysteresis, a minimum duration, and tonic spikes.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use super::blocks::{BLOCK, Block, NextFrame, blocks};
use super::bracket::{Bracket, check_levels};
use super::channels::Channels;
use super::encoding::Encoding;
use super::periods::micros;
use super::running_range::{RunningRange, SampleWindow};
use super::sampled::{Rule, Sampled};
use super::stream::{Stream, sort_from};
use crate::allowed::{Range, ranges};
use crate::parameters::Described;
use crate::spikes::ms;
use crate::{Array, Result, Spike, problem};

/// Crossings of levels: +1 when a taxel's value reaches a level, -1 when it falls below the level's release.
///
/// A taxel is above a level from the sample that reaches the level until one that is below the release. Trains: taxel
/// times levels (`taxel * levels + level`), signed; with `tonic_ms` followed by one more per taxel. Values and levels
/// are compared in f32. The first sample causes no crossing.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LevelCrossing {
    /// Levels in the sensor's unit, or as fractions of the running range if there is one; ascending.
    pub levels: Vec<f64>,
    /// Release as a fraction of each level, above 0 and up to 1; 1 (no hysteresis) if neither release is given.
    #[serde(default)]
    pub release_share: Option<f64>,
    /// Release as a distance below each level, 0 or more; instead of the fraction.
    #[serde(default)]
    pub release_by: Option<f64>,
    /// Minimum duration of a crossing, ms, which is also the encoder's latency. Default 0.
    #[serde(default)]
    pub hold_ms: f64,
    /// Period of tonic spikes, ms, the slowly adapting part: one at the crossing, then one per period while above; by
    /// default there are none.
    #[serde(default)]
    pub tonic_ms: Option<f64>,
    /// The level above which tonic spikes are emitted, one of `levels`; by default the first.
    #[serde(default)]
    pub tonic_level: Option<f64>,
    /// Measures levels on the channel's own running range instead of in the sensor's unit.
    #[serde(default)]
    pub running_range: Option<RunningRange>,
    /// Sampling period of events, ms; default 0.1, the step of the wire's stamps, which loses nothing.
    #[serde(default = "super::periods::stamp_period")]
    pub period_ms: f64,
}

impl LevelCrossing {
    ranges! {
        release_share: "", Range::ABOVE_0.at_most(1.0);
        release_by: "", Range::FROM_0;
        hold_ms: "ms", Range::FROM_0;
        tonic_ms: "ms", Range::WHOLE_US;
        period_ms: "ms", Range::WHOLE_US;
    }

    /// The parameters with their defaults and ranges.
    #[must_use]
    pub fn described() -> Described {
        Described::by(&Self::at(vec![]), &["levels"], Self::RANGES)
    }

    /// An encoder with these levels, without hysteresis.
    #[must_use]
    pub fn at(levels: Vec<f64>) -> Self {
        Self {
            levels,
            release_share: None,
            release_by: None,
            hold_ms: 0.0,
            tonic_ms: None,
            tonic_level: None,
            running_range: None,
            period_ms: super::periods::stamp_period(),
        }
    }

    fn release(&self, level: f64) -> f64 {
        match (self.release_share, self.release_by) {
            (_, Some(by)) => level - by,
            (Some(share), None) => level * share,
            (None, None) => level,
        }
    }
}

impl Encoding for LevelCrossing {
    fn check(&self) -> Result<()> {
        check_levels(&self.levels)?;
        self.check_ranges()?;
        if self.hold_ms != 0.0 {
            micros("hold_ms", self.hold_ms)?;
        }
        if self.release_share.is_some() && self.release_by.is_some() {
            return Err(problem!("release_share and release_by are both given: give only one of them"));
        }
        if let Some(share) = self.release_share
            && share < 1.0
            && self.levels[0] <= 0.0
        {
            let level = self.levels[0];
            return Err(problem!("release_share"; " is {share}, but level {level} is not above 0: use release_by"));
        }
        if let Some(level) = self.tonic_level {
            if self.tonic_ms.is_none() {
                return Err(problem!("tonic_level is given without tonic_ms: give both"));
            }
            if !self.levels.contains(&level) {
                return Err(problem!("tonic_level"; " is {level}: must be one of the levels {:?}", self.levels));
            }
        }
        self.running_range.as_ref().map_or(Ok(()), RunningRange::check)
    }

    fn stream(&self, array: &Array) -> Result<Box<dyn Stream>> {
        let crossings = LevelCrossings::new(self, Channels::new(array).len())?;
        Ok(Box::new(Sampled::new(self, crossings, array, self.period_ms)?))
    }

    fn trains(&self, array: &Array) -> usize {
        Channels::new(array).len() * (self.levels.len() + usize::from(self.tonic_ms.is_some()))
    }

    fn latency_ms(&self) -> f64 {
        self.hold_ms
    }
}

/// State of one level on one channel.
#[derive(Clone, Copy)]
struct ChannelLevel {
    /// From this value on, the taxel is above.
    on_at: f32,
    /// Below this value, the taxel is no longer above.
    off_at: f32,
    /// Whether the value of the latest sample is above.
    above: bool,
    /// The state at the latest spike; follows `above` after the minimum duration.
    reported: bool,
    /// When `above` last changed, us.
    since: i64,
}

/// The levels of all channels.
#[derive(Clone)]
pub(super) struct LevelCrossings {
    channels: usize,
    levels: Vec<f64>,
    releases: Vec<f64>,
    hold: i64,
    /// Indexed by `channel * levels + level`.
    states: Vec<ChannelLevel>,
    /// The number of these that are above.
    above: usize,
    bracket: Bracket,
    /// Crossings that have not lasted for the minimum duration: the time when they will have, and their index. The
    /// duration is the same for all, so the queue is ordered by time.
    trials: VecDeque<(i64, usize)>,
    tonic: Option<Tonic>,
    window: Option<SampleWindow>,
}

#[derive(Clone)]
struct Tonic {
    interval_us: i64,
    level: usize,
    /// The time of each channel's next tonic spike, the channel, and its crossing's time; the period is the same for
    /// all, so the queue is ordered by time.
    next: VecDeque<(i64, usize, i64)>,
    /// Time of the spike of the crossing since which a channel is above; `None` while it is below.
    above_since: Vec<Option<i64>>,
}

impl LevelCrossings {
    /// Levels that all channels are below.
    pub(super) fn new(parameters: &LevelCrossing, channels: usize) -> Result<Self> {
        parameters.check()?;
        let levels = parameters.levels.clone();
        let releases: Vec<f64> = levels.iter().map(|&l| parameters.release(l)).collect();
        let tonic = match parameters.tonic_ms {
            None => None,
            Some(interval_us) => Some(Tonic {
                interval_us: micros("tonic_ms", interval_us)?,
                level: parameters.tonic_level.and_then(|l| levels.iter().position(|&m| m == l)).unwrap_or(0),
                next: VecDeque::new(),
                above_since: vec![None; channels],
            }),
        };
        let blank = |(&rise, &fall): (&f64, &f64)| ChannelLevel {
            on_at: rise as f32,
            off_at: fall as f32,
            above: false,
            reported: false,
            since: i64::MIN,
        };
        let states = (0..channels).flat_map(|_| levels.iter().zip(&releases).map(blank)).collect();
        Ok(Self {
            channels,
            hold: if parameters.hold_ms == 0.0 { 0 } else { micros("hold_ms", parameters.hold_ms)? },
            states,
            above: 0,
            bracket: Bracket::new(blocks(channels)),
            trials: VecDeque::new(),
            tonic,
            window: parameters.running_range.as_ref().map(|r| SampleWindow::new(r, blocks(channels))).transpose()?,
            levels,
            releases,
        })
    }

    /// The number of levels, of all channels, that are above: between 0 and channels times levels.
    pub(super) fn above(&self) -> usize {
        self.above
    }

    /// Rescales the levels to the running ranges; a channel whose range is empty stays below all levels.
    fn scale(&mut self, ranges: &[(f64, f64)]) {
        for (channel, &(low, high)) in ranges.iter().enumerate().take(self.channels) {
            self.place(channel, low, high - low);
        }
    }

    /// Puts the levels of a channel above `low`, in units of `span`; without a span above 0 it stays below all levels.
    pub(super) fn place(&mut self, channel: usize, low: f64, span: f64) {
        let levels = self.levels.len();
        let states = &mut self.states[channel * levels..(channel + 1) * levels];
        for ((state, level), release) in states.iter_mut().zip(&self.levels).zip(&self.releases) {
            (state.on_at, state.off_at) = if span > 0.0 {
                ((low + level * span) as f32, (low + release * span) as f32)
            } else {
                (f32::INFINITY, f32::INFINITY)
            };
        }
        self.set_bracket(channel);
    }

    fn set_bracket(&mut self, channel: usize) {
        let levels = self.levels.len();
        let (mut low, mut high) = (f32::NEG_INFINITY, f32::INFINITY);
        for state in &self.states[channel * levels..(channel + 1) * levels] {
            if state.above {
                low = low.max(state.off_at);
            } else {
                high = high.min(state.on_at);
            }
        }
        self.bracket.set(channel, low, high);
    }

    /// Processes the first sample: no crossings, but tonic spikes if the value is above the level.
    fn settle(&mut self, t: i64, held: &[Block], out: &mut Vec<Spike>) {
        let levels = self.levels.len();
        for channel in 0..self.channels {
            let value = held[channel / BLOCK][channel % BLOCK];
            for level in 0..levels {
                let state = &mut self.states[channel * levels + level];
                state.above = value >= state.on_at;
                state.reported = state.above;
                if state.reported {
                    self.switch_tonic(t, channel, level, true, out);
                }
            }
            self.set_bracket(channel);
        }
        self.above = self.states.iter().filter(|state| state.above).count();
    }

    #[inline(always)]
    fn cross(&mut self, t: i64, held: &[Block], changed: &[bool], out: &mut Vec<Spike>) {
        let from = out.len();
        self.emit_trials(t, true, out);
        for (block, values) in held.iter().enumerate() {
            if changed[block] && self.bracket.has_left(block, values) {
                for channel in block * BLOCK..self.channels.min((block + 1) * BLOCK) {
                    let value = values[channel % BLOCK];
                    if !self.bracket.holds(channel, value) {
                        self.cross_channel(t, channel, value, out);
                    }
                }
            }
        }
        self.emit_tonic(t, true, out);
        sort_from(out, from);
    }

    fn cross_channel(&mut self, t: i64, channel: usize, value: f32, out: &mut Vec<Spike>) {
        let levels = self.levels.len();
        for train in channel * levels..(channel + 1) * levels {
            let state = &mut self.states[train];
            let above = value >= if state.above { state.off_at } else { state.on_at };
            if above != state.above {
                state.above = above;
                state.since = t;
                self.above = if above { self.above + 1 } else { self.above - 1 };
                if self.hold == 0 {
                    self.report_level(t, train, out);
                } else if above != state.reported {
                    self.trials.push_back((t + self.hold, train));
                }
            }
        }
        self.set_bracket(channel);
    }

    fn report_level(&mut self, t: i64, train: usize, out: &mut Vec<Spike>) {
        let state = &mut self.states[train];
        state.reported = state.above;
        let above = state.reported;
        out.push(Spike { t: ms(t), train: train as u32, value: if above { 1.0 } else { -1.0 } });
        self.switch_tonic(t, train / self.levels.len(), train % self.levels.len(), above, out);
    }

    /// Starts or stops a channel's tonic spikes, if `level` is the tonic level.
    fn switch_tonic(&mut self, t: i64, channel: usize, level: usize, above: bool, out: &mut Vec<Spike>) {
        let first = self.states.len();
        let Some(tonic) = self.tonic.as_mut().filter(|tonic| tonic.level == level) else { return };
        tonic.above_since[channel] = above.then_some(t);
        if above {
            out.push(Spike { t: ms(t), train: (first + channel) as u32, value: 1.0 });
            tonic.next.push_back((t + tonic.interval_us, channel, t));
        }
    }

    /// Emits the crossings whose minimum duration ends before `t` (with `at_too` also at `t`), and the tonic spikes
    /// before each.
    fn emit_trials(&mut self, t: i64, at_too: bool, out: &mut Vec<Spike>) {
        while let Some(&(due, train)) = self.trials.front()
            && (due < t || (at_too && due == t))
        {
            self.trials.pop_front();
            self.emit_tonic(due, false, out);
            let state = self.states[train];
            if state.above != state.reported && state.since == due - self.hold {
                self.report_level(due, train, out);
            }
        }
    }

    /// Emits the tonic spikes before `t` (with `at_too` also at `t`).
    fn emit_tonic(&mut self, t: i64, at_too: bool, out: &mut Vec<Spike>) {
        let first = self.states.len();
        let Some(tonic) = &mut self.tonic else { return };
        while let Some(&(due, channel, since)) = tonic.next.front()
            && (due < t || (at_too && due == t))
        {
            tonic.next.pop_front();
            if tonic.above_since[channel] == Some(since) {
                out.push(Spike { t: ms(due), train: (first + channel) as u32, value: 1.0 });
                tonic.next.push_back((due + tonic.interval_us, channel, since));
            }
        }
    }
}

impl Rule for LevelCrossings {
    fn begin(&mut self, t: i64, held: &[Block], out: &mut Vec<Spike>) {
        match &mut self.window {
            None => self.settle(t, held, out),
            Some(window) => window.take(t, held),
        }
    }

    #[inline(always)]
    fn sample(&mut self, t: i64, held: &[Block], changed: &[bool], _next: &mut NextFrame, out: &mut Vec<Spike>) {
        let Some(mut window) = self.window.take() else { return self.cross(t, held, changed, out) };
        let everything = vec![true; held.len()];
        let first = window.first_full(t);
        if let Some(first) = &first {
            self.scale(&first.ranges);
            for (k, (at, held)) in first.samples.iter().enumerate() {
                if k == 0 {
                    self.settle(*at, held, out);
                } else {
                    self.pass(*at, out);
                    self.cross(*at, held, &everything, out);
                }
            }
            self.pass(t, out);
        }
        let ranges = window.renew(t);
        if let Some(ranges) = &ranges {
            self.scale(ranges);
        }
        match first {
            Some(first) if first.samples.is_empty() => self.settle(t, held, out),
            None if !window.is_full() => {}
            None if ranges.is_none() => self.cross(t, held, changed, out),
            _ => self.cross(t, held, &everything, out),
        }
        window.take(t, held);
        self.window = Some(window);
    }

    fn pass(&mut self, t: i64, out: &mut Vec<Spike>) {
        let from = out.len();
        self.emit_trials(t, false, out);
        self.emit_tonic(t, false, out);
        sort_from(out, from);
    }

    fn idle(&self) -> bool {
        self.window.is_none() && self.trials.is_empty() && self.tonic.as_ref().is_none_or(|t| t.next.is_empty())
    }
}
