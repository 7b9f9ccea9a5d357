//! Local load: how much of a touch there is, in units of each taxel's own noise.

use serde::{Deserialize, Serialize};

use super::channels::Channels;
use super::driver::{Clock, Driver, Rule, Sample};
use super::encoding::Encoding;
use super::features::{self, Emit, Feature};
use super::levels::Levels;
use super::loaded::require_tare;
use super::local_sums::{LocalSums, SumPair};
use super::periods::micros;
use super::recent::{PastWindow, RecentSamples};
use super::stream::{Stream, spikes_of_events, spikes_of_frames};
use super::tare::Tare;
use crate::allowed::Range;
use crate::parameters::parameters;
use crate::spikes::{ms, us};
use crate::{Array, EventsView, FramesView, Result, Spike, SpikeKind, Stop, problem};

/// The quantities of what is above the rest.
const OF_REST: [&str; 4] = ["area", "largest", "places", "total"];

/// The quantities of what is above or below a running mean.
const OF_MEAN: [&str; 6] = ["area", "largest", "largest below", "area below", "total", "total below"];

/// The windows over which each quantity's mean is a quantity too, ms.
const MEANS: [[f64; 2]; 2] = [[0.0, 3.0], [2.0, 10.0]];

/// The further windows for the quantities of what is above the rest, ms.
const MEANS_OF_REST: [[f64; 2]; 2] = [[0.0, 10.0], [0.0, 50.0]];

/// The rest from which a local load is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LocalRest {
    /// Begins at the tare and follows each taxel's value: [`Baseline::tracked`](crate::rest::Baseline::tracked).
    #[default]
    Tracked,
    /// The tare.
    Tare,
}

parameters! {
    /// Quantities of a touch in units of each taxel's own noise, as graded spikes: one each `period_ms` and quantity,
    /// with the value log(1 + quantity); none where the quantity is 0.
    ///
    /// With u a value less its rest, `sigma` the taxel's standard deviation in the tare (at least `least_noise`) and
    /// `s = sqrt(sigma^2 + noise_floor^2 / 4)`, the quantities are
    /// - area: the number of taxels with `u >= max(noise_floor + 0.5, 3 sigma)` and such a neighbour among the 8,
    /// - largest: the largest sum of u, clipped to +-3 s, over 3 x 3 taxels, divided by `sqrt(sum s^2)`; at least 0,
    /// - places: the number of taxels around which that sum is above 4,
    /// - total: the sum of all u of `5 sigma` or more.
    ///
    /// For each running mean of `local_ms`, with u a value less its running mean: area (with `4 sigma`), largest, the
    /// two below instead of above (largest below, area below), total and total below. Then the means of all these over
    /// the last 3 ms and from 10 to 2 ms ago; of the first four over the last 10 and 50 ms; and 1 (clock). A taxel that
    /// is 0 from the first sample on has no value yet: it counts as at rest.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct LocalLoad {
        /// The board's noise floor, 0 or more, in the sensor's unit (ticks). Default 3, that of the fast presets.
        pub noise_floor: f64 = 3.0, "", Range::FROM_0;
        /// The smallest noise of a taxel, in the sensor's unit. Default 0.3, the deviation within a tick.
        pub least_noise: f64 = 0.3, "", Range::within(1e-9, 1e9);
        /// The rest from which a load is measured.
        pub rest: LocalRest = LocalRest::default();
        /// Time constants of the running means, ms, each with six more quantities; none by default.
        pub local_ms: Vec<f64> = vec![], "ms", Range::ABOVE_0;
        /// Sampling period of events, ms; default 0.1, the step of the wire's stamps, which loses nothing.
        pub period_ms: f64 = super::periods::stamp_period(), "ms", Range::WHOLE_US;
        /// Levels of the largest sums, in units of noise, ascending; none by default.
        #[serde(skip_serializing_if = "Vec::is_empty")]
        pub levels: Vec<f64> = vec![], "", Range::ABOVE_0;
        /// The part of a level below which it is left, from 0.01 to 1; default 1. Below 1, noise near a level does not
        /// cross it again and again.
        #[serde(skip_serializing_if = "is_one")]
        pub release: f64 = 1.0, "", Range::within(0.01, 1.0);
        /// The taxels' rest and noise. It is valid for one board on one day: a saved readout has none and receives one
        /// when it is used.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub tare: Option<Tare> = None;
    }
}

/// Whether a level is left where it was reached, which JSON leaves out.
#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes a reference")]
fn is_one(release: &f64) -> bool {
    (release - 1.0).abs() < f64::EPSILON
}

impl LocalLoad {
    /// The names of the quantities, a train each.
    #[must_use]
    pub fn quantities(&self) -> Vec<String> {
        let mut names: Vec<String> = OF_REST.iter().map(|&name| name.to_owned()).collect();
        for tau in &self.local_ms {
            names.extend(OF_MEAN.iter().map(|name| format!("{name}, {tau} ms")));
        }
        let present = names.clone();
        for ([from, to], count) in self.windows() {
            names.extend(present[..count].iter().map(|name| format!("{name}, mean of {from} to {to} ms ago")));
        }
        names.push("clock".to_owned());
        names
    }

    /// The windows, each with the number of quantities that are averaged over it.
    fn windows(&self) -> impl Iterator<Item = ([f64; 2], usize)> {
        let all = OF_REST.len() + OF_MEAN.len() * self.local_ms.len();
        MEANS.into_iter().map(move |window| (window, all)).chain(MEANS_OF_REST.map(|window| (window, OF_REST.len())))
    }

    /// The quantities of each sample of events, sample by sample, in the order of [`quantities`](Self::quantities).
    ///
    /// # Errors
    ///
    /// As [`Encoder::encode_events`](super::Encoder::encode_events).
    pub fn values_of_events(&self, events: EventsView<'_>, stop: Stop<'_>) -> Result<Vec<f64>> {
        self.check()?;
        let mut stream = self.sampled(events.array, true)?;
        Ok(quantities(&spikes_of_events(&mut stream, events, stop)?.0))
    }

    /// The quantities of each frame, frame by frame, in the order of [`quantities`](Self::quantities).
    ///
    /// # Errors
    ///
    /// As [`Encoder::encode_frames`](super::Encoder::encode_frames).
    pub fn values_of_frames(&self, frames: FramesView<'_>, stop: Stop<'_>) -> Result<Vec<f64>> {
        self.check()?;
        let mut stream = self.sampled(frames.array, true)?;
        Ok(quantities(&spikes_of_frames(&mut stream, frames, stop)?.0))
    }

    /// The number of largest sums that have levels: above the rest, and above and below each running mean.
    fn sums_with_levels(&self) -> usize {
        1 + 2 * self.local_ms.len()
    }

    /// The local sums of an array's frames.
    pub(super) fn sums(&self, array: &Array) -> Result<LocalSums> {
        let tare = require_tare("local load", self.tare.as_ref())?;
        let running_us: Vec<f64> = self.local_ms.iter().map(|&tau| us(tau)).collect();
        LocalSums::new(array, tare, (self.least_noise, self.noise_floor), self.rest == LocalRest::Tracked, &running_us)
    }

    fn sampled(&self, array: &Array, as_values: bool) -> Result<Driver<LocalLoadRule>> {
        let whole_us = |ms: f64| us(ms).round() as i64;
        let windows: Vec<PastWindow> = self
            .windows()
            .map(|([from, to], quantities)| PastWindow { from: whole_us(from), to: whole_us(to), quantities })
            .collect();
        let recent = RecentSamples::new(windows[0].quantities, &windows);
        let rule = LocalLoadRule { sums: self.sums(array)?, recent, quantities: vec![], as_values };
        let clock = Clock::Period(micros("period_ms", self.period_ms)?);
        Ok(Driver::new(rule, Channels::grid(array), self.trains_of(array), clock))
    }
}

/// The quantities that a stream emitted as spikes' values.
fn quantities(spikes: &[Spike]) -> Vec<f64> {
    spikes.iter().map(|spike| f64::from(spike.value)).collect()
}

impl Encoding for LocalLoad {
    fn check(&self) -> Result<()> {
        self.check_ranges()?;
        if let Some(k) = self.levels.windows(2).position(|pair| pair[0] >= pair[1]) {
            return Err(problem!("levels"; "[{}]: must be above the level before", k + 1));
        }
        self.tare.as_ref().map_or(Ok(()), Tare::check)
    }

    fn stream(&self, array: &Array) -> Result<Box<dyn Stream>> {
        array.check_neighbours("local load")?;
        if self.levels.is_empty() {
            return Ok(Box::new(self.sampled(array, false)?));
        }
        let rest = require_tare("local load", self.tare.as_ref())?.rest_of(array)?;
        let emit = Emit::Crossings(Levels::of_each(self.sums_with_levels(), &self.levels, self.release));
        let sums = Feature::Local(self.sums(array)?);
        Ok(features::stream(vec![sums], None, rest, emit, array, self.trains_of(array)))
    }

    fn trains(&self, _array: &Array) -> usize {
        if self.levels.is_empty() { self.quantities().len() } else { 2 * self.sums_with_levels() * self.levels.len() }
    }

    fn kind(&self) -> SpikeKind {
        if self.levels.is_empty() { SpikeKind::Graded } else { SpikeKind::Unsigned }
    }

    fn set_tare(&mut self, tare: &Tare) {
        self.tare = Some(tare.clone());
    }
}

/// The quantities of each sample, as graded spikes.
#[derive(Clone)]
struct LocalLoadRule {
    sums: LocalSums,
    recent: RecentSamples,
    quantities: Vec<f64>,
    /// Whether a sample gives the quantities themselves, each as the value of one spike.
    as_values: bool,
}

impl Rule for LocalLoadRule {
    #[inline(always)]
    fn sample(&mut self, now: Sample<'_>, out: &mut Vec<Spike>) {
        let quantities = &mut self.quantities;
        quantities.clear();
        self.sums.take(now.t, now.held.as_flattened(), |sums| {
            let SumPair { largest: [up, down], places, area: [area, area_below], total: [total, total_below] } = sums;
            if quantities.is_empty() {
                quantities.extend([area, up, places, total]);
            } else {
                quantities.extend([area, up, down, area_below, total, total_below]);
            }
        });
        self.recent.take(now.t, quantities);
        quantities.push(1.0);
        for (train, &quantity) in quantities.iter().enumerate() {
            let value = if self.as_values { quantity } else { libm::log1p(quantity) } as f32;
            if value != 0.0 || self.as_values {
                out.push(Spike { t: ms(now.t), train: train as u32, value });
            }
        }
    }

    fn set_rest(&mut self, channel: usize, rest: f64) {
        self.sums.set_rest(channel, rest);
    }

    fn rest(&self, channel: usize) -> Option<f64> {
        self.sums.rest(channel)
    }
}
