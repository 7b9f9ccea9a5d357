//! Local load: how much of a touch there is, in units of each taxel's own noise.

use serde::{Deserialize, Serialize};

use super::blocks::{Block, NextFrame};
use super::by_stamp::{ByStamp, Measure};
use super::encoding::Encoding;
use super::loaded::{Loaded, require_tare};
use super::local_sums::{LocalSums, SumPair, Values};
use super::recent::{PastWindow, RecentSamples};
use super::sampled::{Rule, Sampled};
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
        let mut stream = self.sampled(events.array, Emit::Values)?;
        Ok(quantities(&spikes_of_events(&mut stream, events, stop)?.0))
    }

    /// The quantities of each frame, frame by frame, in the order of [`quantities`](Self::quantities).
    ///
    /// # Errors
    ///
    /// As [`Encoder::encode_frames`](super::Encoder::encode_frames).
    pub fn values_of_frames(&self, frames: FramesView<'_>, stop: Stop<'_>) -> Result<Vec<f64>> {
        self.check()?;
        let mut stream = self.sampled(frames.array, Emit::Values)?;
        Ok(quantities(&spikes_of_frames(&mut stream, frames, stop)?.0))
    }

    /// The largest local sums alone, of an array's frames: quantities of plain rules.
    ///
    /// # Errors
    ///
    /// As [`Encoder::stream`](super::Encoder::stream).
    pub fn largest(&self, array: &Array) -> Result<LargestSums> {
        self.check()?;
        self.sums(array, &self.running_us()).map(LargestSums)
    }

    fn running_us(&self) -> Vec<f64> {
        self.local_ms.iter().map(|&tau| us(tau)).collect()
    }

    /// The number of largest sums that have levels: above the rest, and above and below each running mean.
    fn sums_with_levels(&self) -> usize {
        1 + 2 * self.local_ms.len()
    }

    fn sums(&self, array: &Array, running_us: &[f64]) -> Result<LocalSums> {
        let tare = require_tare("local load", self.tare.as_ref())?;
        let least = (self.least_noise, self.noise_floor);
        LocalSums::new(array, tare, least, self.rest == LocalRest::Tracked, running_us)
    }

    fn sampled(&self, array: &Array, emit: Emit) -> Result<Sampled<LocalLoadRule>> {
        let whole_us = |ms: f64| us(ms).round() as i64;
        let windows: Vec<PastWindow> = self
            .windows()
            .map(|([from, to], quantities)| PastWindow { from: whole_us(from), to: whole_us(to), quantities })
            .collect();
        let recent = RecentSamples::new(windows[0].quantities, &windows);
        let rule = LocalLoadRule { sums: self.sums(array, &self.running_us())?, recent, quantities: vec![], emit };
        Sampled::new(self, rule, array, self.period_ms)
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
            return Ok(Box::new(self.sampled(array, Emit::Spikes)?));
        }
        let loaded = Loaded::never("local load", array, self.tare.as_ref())?;
        let sums = self.sums(array, &self.running_us())?;
        let level = |&at: &f64| SumLevel { at, left_below: self.release * at, reached: false };
        let levels = (0..self.sums_with_levels()).flat_map(|_| self.levels.iter().map(level)).collect();
        Ok(Box::new(ByStamp::new(SumLevels { sums, largest: vec![], levels }, loaded, array)))
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

/// The largest local sums of each frame: above the rest, and above and below the last running mean, if there is any.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LargestOfFrame {
    /// [`LocalLoad`]'s quantity "largest".
    pub above_rest: f64,
    /// The same above and below the running mean: "largest" and "largest below".
    pub of_mean: [f64; 2],
}

/// Computes the largest local sums of each frame.
#[derive(Clone)]
pub struct LargestSums(LocalSums);

impl LargestSums {
    /// Reads the next frame, row by row, at `t` us, which must not be earlier than the last; returns its largest sums.
    pub fn take(&mut self, t: i64, frame: &[f32]) -> LargestOfFrame {
        let (mut largest, mut of_rest) = (LargestOfFrame::default(), true);
        self.0.take(t, Values::Frame(frame), |sums| {
            if std::mem::take(&mut of_rest) {
                largest.above_rest = sums.largest[0];
            } else {
                largest.of_mean = sums.largest;
            }
        });
        largest
    }

    /// Sets the rest of a taxel, by index, from now on.
    pub fn set_rest(&mut self, taxel: usize, rest: f64) {
        self.0.set_rest_at(taxel, rest);
    }
}

/// A level of one of the largest sums.
#[derive(Clone)]
struct SumLevel {
    at: f64,
    left_below: f64,
    reached: bool,
}

/// Crossings of levels by the largest sums.
#[derive(Clone)]
struct SumLevels {
    sums: LocalSums,
    /// The largest sums of the last stamp: above the rest, then above and below each running mean.
    largest: Vec<f64>,
    /// All levels of the first sum, then those of the next.
    levels: Vec<SumLevel>,
}

impl Measure for SumLevels {
    fn trains(&self) -> usize {
        2 * self.levels.len()
    }

    fn drifts(&self) -> bool {
        true
    }

    fn set_rest(&mut self, taxel: usize, rest: f64) {
        self.sums.set_rest_at(taxel, rest);
    }

    fn emit(&mut self, t: i64, _loaded: &Loaded, held: &[Block], out: &mut Vec<Spike>) {
        let Self { sums, largest, levels } = self;
        largest.clear();
        sums.take(t, Values::Frame(held.as_flattened()), |SumPair { largest: [up, down], .. }| {
            let present = if largest.is_empty() { &[up][..] } else { &[up, down][..] };
            largest.extend_from_slice(present);
        });
        let each = levels.len() / largest.len();
        let falls = levels.len();
        let mut left = vec![];
        for (train, level) in levels.iter_mut().enumerate() {
            // In single precision, as plain rules compare it.
            let now = f64::from(largest[train / each] as f32);
            if !level.reached && now >= level.at {
                level.reached = true;
                out.push(Spike { t: ms(t), train: train as u32, value: 1.0 });
            } else if level.reached && now < level.left_below {
                level.reached = false;
                left.push(Spike { t: ms(t), train: (falls + train) as u32, value: 1.0 });
            }
        }
        out.append(&mut left);
    }
}

/// What a sample gives: spikes of the quantities that are not 0, or the quantities themselves, each as the value of one
/// spike.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Emit {
    Spikes,
    Values,
}

#[derive(Clone)]
struct LocalLoadRule {
    sums: LocalSums,
    recent: RecentSamples,
    quantities: Vec<f64>,
    emit: Emit,
}

impl LocalLoadRule {
    fn take(&mut self, t: i64, held: &[Block], out: &mut Vec<Spike>) {
        let quantities = &mut self.quantities;
        quantities.clear();
        self.sums.take(t, Values::Taxels(held.as_flattened()), |sums| {
            let SumPair { largest: [up, down], places, area: [area, area_below], total: [total, total_below] } = sums;
            if quantities.is_empty() {
                quantities.extend([area, up, places, total]);
            } else {
                quantities.extend([area, up, down, area_below, total, total_below]);
            }
        });
        self.recent.take(t, quantities);
        quantities.push(1.0);
        for (train, &quantity) in quantities.iter().enumerate() {
            let value = match self.emit {
                Emit::Spikes => libm::log1p(quantity) as f32,
                Emit::Values => quantity as f32,
            };
            if value != 0.0 || self.emit == Emit::Values {
                out.push(Spike { t: ms(t), train: train as u32, value });
            }
        }
    }
}

impl Rule for LocalLoadRule {
    fn begin(&mut self, t: i64, held: &[Block], out: &mut Vec<Spike>) {
        self.take(t, held, out);
    }

    #[inline(always)]
    fn sample(&mut self, t: i64, held: &[Block], _changed: &[bool], _next: &mut NextFrame, out: &mut Vec<Spike>) {
        self.take(t, held, out);
    }

    fn set_rest(&mut self, channel: usize, rest: f64) {
        self.sums.set_rest(channel, rest);
    }

    fn rest(&self, channel: usize) -> Option<f64> {
        self.sums.rest(channel)
    }

    fn idle(&self) -> bool {
        false
    }
}
