//! Crossings of levels, with hysteresis, a minimum duration, and tonic spikes.

use serde::{Deserialize, Serialize};

use super::blocks::blocks;
use super::channel_levels::{ChannelLevels, check_levels};
use super::channels::Channels;
use super::driver::{Clock, Driver, Rule, Sample};
use super::encoding::Encoding;
use super::periods::micros;
use super::running_range::{RunningRange, SampleWindow};
use super::stream::Stream;
use crate::allowed::{Range, ranges};
use crate::parameters::Described;
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
        let channels = Channels::new(array);
        let crossings = LevelCrossings::new(self, channels.len())?;
        let clock = Clock::Period(micros("period_ms", self.period_ms)?);
        Ok(Box::new(Driver::new(crossings, channels, self.trains_of(array), clock)))
    }

    fn trains(&self, array: &Array) -> usize {
        Channels::new(array).len() * (self.levels.len() + usize::from(self.tonic_ms.is_some()))
    }

    fn latency_ms(&self) -> f64 {
        self.hold_ms
    }
}

/// The levels of all channels, moved by their running ranges if they have one.
#[derive(Clone)]
pub(super) struct LevelCrossings {
    /// Each level with its release, as given.
    given: Vec<(f64, f64)>,
    levels: ChannelLevels,
    window: Option<SampleWindow>,
}

impl LevelCrossings {
    /// Levels that all channels are below.
    pub(super) fn new(parameters: &LevelCrossing, channels: usize) -> Result<Self> {
        parameters.check()?;
        let given: Vec<(f64, f64)> = parameters.levels.iter().map(|&l| (l, parameters.release(l))).collect();
        let hold = if parameters.hold_ms == 0.0 { 0 } else { micros("hold_ms", parameters.hold_ms)? };
        let interval = parameters.tonic_ms.map(|ms| micros("tonic_ms", ms)).transpose()?;
        let tonic = parameters.tonic_level.and_then(|l| parameters.levels.iter().position(|&m| m == l)).unwrap_or(0);
        Ok(Self {
            levels: ChannelLevels::new(channels, &given, hold, interval.unwrap_or(0), interval.map(|_| tonic)),
            given,
            window: parameters.running_range.as_ref().map(|r| SampleWindow::new(r, blocks(channels))).transpose()?,
        })
    }

    /// The number of levels, of all channels, that are above: between 0 and channels times levels.
    pub(super) fn above(&self) -> usize {
        self.levels.levels.above()
    }

    /// Rescales the levels to the running ranges; a channel whose range is empty stays below all levels.
    fn scale(&mut self, ranges: &[(f64, f64)]) {
        for (channel, &(low, high)) in ranges.iter().enumerate().take(self.levels.channels()) {
            self.place(channel, low, high - low);
        }
    }

    /// Puts the levels of a channel above `low`, in units of `span`; without a span above 0 it stays below all levels.
    pub(super) fn place(&mut self, channel: usize, low: f64, span: f64) {
        let at = |level: f64| if span > 0.0 { low + level * span } else { f64::INFINITY };
        self.levels.place(channel, self.given.iter().map(|&(level, release)| (at(level), at(release))));
    }
}

impl Rule for LevelCrossings {
    fn begin(&mut self, now: Sample<'_>, out: &mut Vec<Spike>) {
        match &mut self.window {
            None => self.levels.settle(now.t, now.held, out),
            Some(window) => window.take(now.t, now.held),
        }
    }

    #[inline(always)]
    fn sample(&mut self, now: Sample<'_>, out: &mut Vec<Spike>) {
        let Some(mut window) = self.window.take() else { return self.levels.take(now, false, out) };
        let Sample { t, held, .. } = now;
        let first = window.first_full(t);
        if let Some(first) = &first {
            self.scale(&first.ranges);
            for (k, (at, held)) in first.samples.iter().enumerate() {
                if k == 0 {
                    self.levels.settle(*at, held, out);
                } else {
                    self.pass(*at, out);
                    self.levels.take(Sample { t: *at, held, ..now }, true, out);
                }
            }
            self.pass(t, out);
        }
        let ranges = window.renew(t);
        if let Some(ranges) = &ranges {
            self.scale(ranges);
        }
        match first {
            Some(first) if first.samples.is_empty() => self.levels.settle(t, held, out),
            None if !window.is_full() => {}
            first => self.levels.take(now, first.is_some() || ranges.is_some(), out),
        }
        window.take(t, held);
        self.window = Some(window);
    }

    fn pass(&mut self, t: i64, out: &mut Vec<Spike>) {
        self.levels.levels.pass(t, false, out);
    }

    fn idle(&self) -> bool {
        self.window.is_none() && self.levels.levels.idle()
    }
}
