//! Area, force and displacement of a touch. None of them depends on where the touch began, so what is learnt at one
//! position holds at others.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use super::blocks::{Block, Next};
use super::law::Law;
use super::loaded::{Loaded, Sums};
use super::periods::micros;
use super::sampled::{Rule, Sampled};
use super::stream::{Stream, sort_from};
use super::tare::Tare;
use crate::allowed::{Range, ranges};
use crate::parameters::Described;
use crate::spikes::ms;
use crate::{Array, Result, Spike, problem};

/// Moments of the current values above rest, each with levels in a geometric series.
///
/// The moments are computed over the taxels that count for [`ContactArea`](super::ContactArea): their number (area),
/// the sum and the largest of their values above rest (total, peak), and the displacement of their centre, weighted by
/// these values, to the right and downwards since the current touch began, mm. A touch begins when the area rises above
/// 0 and ends when it is 0; between touches all moments are 0. Each level of the displacement exists on both sides of 0
/// and is crossed outwards.
///
/// Trains, unsigned; levels in the order area, total, peak, x right, x left, y down, y up, ascending within each. First
/// a train per level that spikes when the level is reached, then one per level that spikes when it is left, then, with
/// `tonic_ms`, one that spikes while the level is exceeded. The first sample causes no spike of the first two kinds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Moments {
    /// The board's noise floor, 0 or more, in the sensor's unit (ticks). Default 3, that of the fast presets.
    pub noise_floor: f64,
    /// Number of levels of each moment, for a displacement on each side of 0. Default 20.
    pub levels: usize,
    /// Smallest and largest level of the number of taxels; `None` omits the moment.
    pub area: Option<[f64; 2]>,
    /// Smallest and largest level of the sum above rest, in the sensor's unit.
    pub total: Option<[f64; 2]>,
    /// Smallest and largest level of the largest value above rest, in the sensor's unit.
    pub peak: Option<[f64; 2]>,
    /// Smallest and largest level of the centre's displacement in x and in y, mm.
    pub displacement_mm: Option<[f64; 2]>,
    /// Period of the tonic spikes while a level is exceeded, ms, the first when it is reached; `None` for none. Default
    /// 0.5.
    pub tonic_ms: Option<f64>,
    /// Sampling period of events, ms; default 0.1, the step of the wire's stamps, which loses nothing.
    pub period_ms: f64,
    /// The taxels' rest. It is valid for one board on one day: a saved readout has none and receives one when it is
    /// used.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tare: Option<Tare>,
}

impl Default for Moments {
    fn default() -> Self {
        Self {
            noise_floor: 3.0,
            levels: 20,
            area: Some([2.0, 500.0]),
            total: Some([8.0, 20_000.0]),
            peak: Some([4.0, 120.0]),
            displacement_mm: Some([0.2, 20.0]),
            tonic_ms: Some(0.5),
            period_ms: super::periods::stamp_period(),
            tare: None,
        }
    }
}

impl Moments {
    ranges! {
        noise_floor: "", Range::FROM_0;
        levels: "", Range::within(1.0, 1000.0);
        area: "", Range::ABOVE_0;
        total: "", Range::ABOVE_0;
        peak: "", Range::ABOVE_0;
        displacement_mm: "mm", Range::ABOVE_0;
        tonic_ms: "ms", Range::WHOLE_US;
        period_ms: "ms", Range::WHOLE_US;
    }

    fn ranges(&self) -> [(&'static str, Option<[f64; 2]>); 4] {
        [("area", self.area), ("total", self.total), ("peak", self.peak), ("displacement_mm", self.displacement_mm)]
    }

    /// All levels, each with its moment: area, total, peak, x, y.
    fn all_levels(&self) -> Vec<Level> {
        let mut all = vec![];
        let [area, total, peak, way] = self.ranges().map(|(_, range)| range);
        for (moment, range) in [area, total, peak, way, way].into_iter().enumerate() {
            let Some([least, most]) = range else { continue };
            let levels = in_equal_ratios(least, most, self.levels);
            all.extend(levels.iter().map(|&at| Level { moment, at }));
            if moment >= 3 {
                all.extend(levels.iter().map(|&at| Level { moment, at: -at }));
            }
        }
        all
    }
}

impl Law for Moments {
    fn described() -> Described {
        Described::by(&Self::default(), &[], Self::RANGES).or_nothing("tare")
    }

    fn check(&self) -> Result<()> {
        self.check_ranges()?;
        let ranges = self.ranges();
        if ranges.iter().all(|(_, range)| range.is_none()) {
            return Err(problem!("area, total, peak and displacement_mm are all left out: give one or more"));
        }
        for (name, range) in ranges {
            if let Some([least, most]) = range
                && most <= least
            {
                return Err(problem!("{name} is {least} to {most}: must ascend"));
            }
        }
        self.tare.as_ref().map_or(Ok(()), Tare::check)
    }

    fn stream(&self, array: &Array) -> Result<Box<dyn Stream>> {
        let loaded = Loaded::new("moments", array, self.tare.as_ref(), self.noise_floor)?;
        let levels = self.all_levels();
        let passing = Passing {
            loaded,
            pitch_mm: array.pitch_mm,
            origin: None,
            since: vec![None; levels.len()],
            levels,
            every: self.tonic_ms.map(|every| micros("tonic_ms", every)).transpose()?,
            due: VecDeque::new(),
        };
        // Channels are all places here; `loaded` defines which taxels exist.
        let places = Array { exists: None, ..array.clone() };
        Ok(Box::new(Sampled::new(self, passing, &places, self.period_ms)?))
    }

    fn trains(&self, _array: &Array) -> usize {
        self.all_levels().len() * if self.tonic_ms.is_some() { 3 } else { 2 }
    }

    fn signed(&self) -> bool {
        false
    }

    fn set_tare(&mut self, tare: &Tare) {
        self.tare = Some(tare.clone());
    }
}

/// `n` levels in a geometric series, rounded to 12 digits, so that differences between machines' `powf` do not move a
/// level off a whole number.
fn in_equal_ratios(least: f64, most: f64, n: usize) -> Vec<f64> {
    let level = |k: usize| {
        let exact = least * (most / least).powf(k as f64 / (n.max(2) - 1) as f64);
        format!("{exact:.11e}").parse().unwrap_or(exact)
    };
    (0..n).map(level).collect()
}

/// A level of one moment; a negative level is crossed downwards.
#[derive(Clone, Copy)]
struct Level {
    moment: usize,
    at: f64,
}

impl Level {
    fn is_reached(self, moments: &[f64; 5]) -> bool {
        let value = moments[self.moment];
        if self.at > 0.0 { value >= self.at } else { value <= self.at }
    }
}

#[derive(Clone)]
struct Passing {
    loaded: Loaded,
    pitch_mm: f64,
    /// The centre when the current touch began, in taxels.
    origin: Option<[f64; 2]>,
    levels: Vec<Level>,
    /// The time at which each level was reached, us; `None` below it.
    since: Vec<Option<i64>>,
    /// Period of the tonic spikes, us.
    every: Option<i64>,
    /// The time of a level's next tonic spike, the level, and when it was reached; the period is the same for all, so
    /// the queue is ordered by time.
    due: VecDeque<(i64, usize, i64)>,
}

impl Passing {
    /// Area, total, peak, and the displacement of the centre in x and y, mm.
    fn moments(&mut self, held: &[Block]) -> [f64; 5] {
        if self.loaded.area() == 0 {
            self.origin = None;
            return [0.0; 5];
        }
        let Sums { total, peak, x, y } = self.loaded.sums(held);
        let centre = [x / total, y / total];
        let origin = *self.origin.get_or_insert(centre);
        let way = |axis: usize| (centre[axis] - origin[axis]) * self.pitch_mm;
        [f64::from(self.loaded.area()), total, peak, way(0), way(1)]
    }

    /// Notes that a level is reached: its tonic spikes begin.
    fn reach(&mut self, t: i64, level: usize, out: &mut Vec<Spike>) {
        self.since[level] = Some(t);
        if let Some(every) = self.every {
            out.push(Spike { t: ms(t), train: (2 * self.levels.len() + level) as u32, value: 1.0 });
            self.due.push_back((t + every, level, t));
        }
    }

    /// Emits the tonic spikes before `t` (with `at_too` also at `t`).
    fn speak(&mut self, t: i64, at_too: bool, out: &mut Vec<Spike>) {
        let Some(every) = self.every else { return };
        while let Some(&(due, level, since)) = self.due.front()
            && (due < t || (at_too && due == t))
        {
            self.due.pop_front();
            if self.since[level] == Some(since) {
                out.push(Spike { t: ms(due), train: (2 * self.levels.len() + level) as u32, value: 1.0 });
                self.due.push_back((due + every, level, since));
            }
        }
    }
}

impl Rule for Passing {
    fn begin(&mut self, t: i64, held: &[Block], out: &mut Vec<Spike>) {
        for (block, values) in held.iter().enumerate() {
            self.loaded.take_block(block, values);
        }
        let moments = self.moments(held);
        for level in 0..self.levels.len() {
            if self.levels[level].is_reached(&moments) {
                self.reach(t, level, out);
            }
        }
    }

    #[inline(always)]
    fn sample(&mut self, t: i64, held: &[Block], changed: &[bool], _next: &mut Next, out: &mut Vec<Spike>) {
        if !changed.contains(&true) {
            return;
        }
        for (block, values) in held.iter().enumerate().filter(|&(block, _)| changed[block]) {
            self.loaded.take_block(block, values);
        }
        let (moments, from) = (self.moments(held), out.len());
        for level in 0..self.levels.len() {
            let (is, was) = (self.levels[level].is_reached(&moments), self.since[level].is_some());
            if is && !was {
                out.push(Spike { t: ms(t), train: level as u32, value: 1.0 });
                self.reach(t, level, out);
            } else if was && !is {
                out.push(Spike { t: ms(t), train: (self.levels.len() + level) as u32, value: 1.0 });
                self.since[level] = None;
            }
        }
        self.speak(t, true, out);
        sort_from(out, from);
    }

    fn pass(&mut self, t: i64, out: &mut Vec<Spike>) {
        let from = out.len();
        self.speak(t, false, out);
        sort_from(out, from);
    }

    fn set_rest(&mut self, channel: usize, rest: f64) {
        self.loaded.set_rest(channel, rest);
    }

    fn rest(&self, channel: usize) -> Option<f64> {
        self.loaded.rest(channel)
    }

    fn idle(&self) -> bool {
        self.due.is_empty()
    }
}
