//! Area, force, displacement and age of a touch. None of them depends on where the touch began, so what is learnt at one
//! position holds at others; its centre, which does, is an option.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use super::blocks::{Block, NextFrame};
use super::encoding::Encoding;
use super::loaded::{Loaded, LoadedSums};
use super::periods::micros;
use super::sampled::{Rule, Sampled};
use super::stream::{Stream, sort_from};
use super::tare::Tare;
use crate::allowed::Range;
use crate::array::{Pitch, PlaceUnit, Places};
use crate::parameters::parameters;
use crate::spikes::{ms, us};
use crate::{Array, Result, Spike, SpikeKind, problem};

parameters! {
    /// Moments of the current values above rest, each with levels in a geometric series.
    ///
    /// The moments are computed over the taxels that count for [`ContactArea`](super::ContactArea): their number
    /// (area), the sum and the largest of their values above rest (total, peak), and the displacement of their centre,
    /// weighted by these values, to the right and downwards since the current touch began, mm. A touch begins when the
    /// area rises above 0 and ends when it is 0; between touches all moments are 0. Each level of the displacement
    /// exists on both sides of 0 and is crossed outwards.
    ///
    /// Trains, unsigned; levels in the order area, total, peak, x right, x left, y down, y up, ascending within each.
    /// First a train per level that spikes when the level is reached, then one per level that spikes when it is left,
    /// then, with `tonic_ms`, one that spikes while the level is exceeded. The first sample causes no spike of the
    /// first two kinds.
    ///
    /// With `graded` all trains are graded: those of the levels, with the value 1, are followed by one per moment in
    /// the order area, total, peak, x, y. During a touch it spikes at every sample (each frame; of events every
    /// `period_ms` from the first stamp) with the value `log(1 + moment)`, of a displacement `log(1 + |moment|)` with
    /// its sign; never with 0.
    ///
    /// With `centre` four more follow, with the column of the centre, -1 in the first to 1 in the last, its square, and
    /// its row and that one's square, as they are.
    ///
    /// With `ages_ms` the last trains are one per age. During a touch, at every sample, the train of the largest of
    /// these ages that the touch has reached spikes; its age is counted from the sample at which it began.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct Moments {
        /// The board's noise floor, 0 or more, in the sensor's unit (ticks). Default 3, that of the fast presets.
        pub noise_floor: f64 = 3.0, "", Range::FROM_0;
        /// Number of levels of each moment, for a displacement on each side of 0; with 0 there are no trains of levels.
        /// Default 20.
        pub levels: usize = 20, "", Range::within(0.0, 1000.0);
        /// Smallest and largest level of the number of taxels; `None` omits the moment.
        pub area: Option<[f64; 2]> = Some([2.0, 500.0]), "", Range::ABOVE_0;
        /// Smallest and largest level of the sum above rest, in the sensor's unit.
        pub total: Option<[f64; 2]> = Some([8.0, 20_000.0]), "", Range::ABOVE_0;
        /// Smallest and largest level of the largest value above rest, in the sensor's unit.
        pub peak: Option<[f64; 2]> = Some([4.0, 120.0]), "", Range::ABOVE_0;
        /// Smallest and largest level of the centre's displacement in x and in y, mm.
        pub displacement_mm: Option<[f64; 2]> = Some([0.2, 20.0]), "mm", Range::ABOVE_0;
        /// Period of the tonic spikes while a level is exceeded, ms, the first when it is reached; `None` for none.
        /// Default 0.5.
        pub tonic_ms: Option<f64> = Some(0.5), "ms", Range::WHOLE_US;
        /// Whether the moments themselves are emitted, as graded spikes.
        #[serde(skip_serializing_if = "std::ops::Not::not")]
        pub graded: bool = false;
        /// Whether the place of the centre is emitted too, as graded spikes.
        #[serde(skip_serializing_if = "std::ops::Not::not")]
        pub centre: bool = false;
        /// The ages of a touch that have a train each, ms, ascending, each rounded to a whole us; `None` for none.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub ages_ms: Option<Vec<f64>> = None, "ms", Range::FROM_0;
        /// Sampling period of events, ms; default 0.1, the step of the wire's stamps, which loses nothing.
        pub period_ms: f64 = super::periods::stamp_period(), "ms", Range::WHOLE_US;
        /// The taxels' rest. It is valid for one board on one day: a saved readout has none and receives one when it is
        /// used.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub tare: Option<Tare> = None;
    }
}

impl Moments {
    fn ranges(&self) -> [(&'static str, Option<[f64; 2]>); 4] {
        [("area", self.area), ("total", self.total), ("peak", self.peak), ("displacement_mm", self.displacement_mm)]
    }

    /// All levels, each with its moment: area, total, peak, x, y.
    fn all_levels(&self) -> Vec<MomentLevel> {
        let mut all = vec![];
        let [area, total, peak, way] = self.ranges().map(|(_, range)| range);
        for (moment, range) in [area, total, peak, way, way].into_iter().enumerate() {
            let Some([least, most]) = range else { continue };
            let levels = geometric_levels(least, most, self.levels);
            all.extend(levels.iter().map(|&at| MomentLevel { moment, at }));
            if moment >= 3 {
                all.extend(levels.iter().map(|&at| MomentLevel { moment, at: -at }));
            }
        }
        all
    }

    /// The moments that are emitted as graded spikes, numbered as in `all_levels`.
    fn all_graded(&self) -> Vec<usize> {
        let [area, total, peak, way] = self.ranges().map(|(_, range)| range.is_some());
        let present = [area, total, peak, way, way].into_iter().enumerate();
        present.filter(|&(_, present)| self.graded && present).map(|(moment, _)| moment).collect()
    }

    /// The ages that have a train each, us.
    fn all_ages(&self) -> Vec<i64> {
        self.ages_ms.iter().flatten().map(|&age| us(age).round() as i64).collect()
    }

    /// The number of trains of the centre.
    fn centre_trains(&self) -> usize {
        if self.centre { CENTRE } else { 0 }
    }

    /// The number of trains of levels.
    fn level_trains(&self) -> usize {
        self.all_levels().len() * if self.tonic_ms.is_some() { 3 } else { 2 }
    }
}

impl Encoding for Moments {
    fn check(&self) -> Result<()> {
        self.check_ranges()?;
        let ranges = self.ranges();
        let ages = self.all_ages();
        if ranges.iter().all(|(_, range)| range.is_none()) && (self.graded || ages.is_empty()) {
            return Err(problem!("area, total, peak and displacement_mm are all left out: give one or more"));
        }
        for (name, range) in ranges {
            if let Some([least, most]) = range
                && most <= least
            {
                return Err(problem!(name; " is {least} to {most}: must ascend"));
            }
        }
        if self.ages_ms.as_ref().is_some_and(Vec::is_empty) {
            return Err(problem!("ages_ms"; " is empty: must contain one age or more, or be left out"));
        }
        if let Some(k) = ages.windows(2).position(|pair| pair[0] >= pair[1]) {
            return Err(problem!("ages_ms"; "[{}]: must be at least 1 us above the age before", k + 1));
        }
        if self.levels == 0 && !self.graded && ages.is_empty() {
            return Err(
                problem!("levels"; " is 0, and neither graded nor ages_ms is given: give at least one of the three"),
            );
        }
        if self.centre && !self.graded {
            return Err(problem!("centre"; " is given without graded: only graded spikes have a centre"));
        }
        self.tare.as_ref().map_or(Ok(()), Tare::check)
    }

    fn stream(&self, array: &Array) -> Result<Box<dyn Stream>> {
        if self.centre || self.displacement_mm.is_some() {
            array.check_neighbours("moments")?;
        }
        let loaded = Loaded::new("moments", array, self.tare.as_ref(), self.noise_floor)?;
        let way = if self.displacement_mm.is_some() { Some(Way::on(array)?) } else { None };
        let levels = self.all_levels();
        let passing = LevelPass {
            loaded,
            way,
            touch: None,
            moments: [0.0; 5],
            since: vec![None; levels.len()],
            levels,
            first_graded: self.level_trains(),
            graded: self.all_graded(),
            centre: self.centre.then(|| [array.columns, array.rows].map(|count| (count.max(2) - 1) as f64 / 2.0)),
            position: [0.0; CENTRE],
            ages: self.all_ages(),
            interval_us: self.tonic_ms.map(|interval_us| micros("tonic_ms", interval_us)).transpose()?,
            due: VecDeque::new(),
        };
        // Channels are all taxels here; `loaded` defines which taxels exist.
        let grid = Array { exists: None, ..array.clone() };
        Ok(Box::new(Sampled::new(self, passing, &grid, self.period_ms)?))
    }

    fn trains(&self, _array: &Array) -> usize {
        self.level_trains() + self.all_graded().len() + self.centre_trains() + self.all_ages().len()
    }

    fn kind(&self) -> SpikeKind {
        if self.graded { SpikeKind::Graded } else { SpikeKind::Unsigned }
    }

    fn set_tare(&mut self, tare: &Tare) {
        self.tare = Some(tare.clone());
    }
}

/// `n` levels in a geometric series, rounded to 12 digits, so that the rounding of powers does not move a level off
/// a whole number.
fn geometric_levels(least: f64, most: f64, n: usize) -> Vec<f64> {
    let level = |k: usize| {
        let exact = least * libm::pow(most / least, k as f64 / (n.max(2) - 1) as f64);
        format!("{exact:.11e}").parse().unwrap_or(exact)
    };
    (0..n).map(level).collect()
}

/// The centre's column, its square, its row and that one's square.
const CENTRE: usize = 4;

/// A level of one moment; a negative level is crossed downwards.
#[derive(Clone, Copy)]
struct MomentLevel {
    moment: usize,
    at: f64,
}

impl MomentLevel {
    fn is_reached(self, moments: &[f64; 5]) -> bool {
        let value = moments[self.moment];
        if self.at > 0.0 { value >= self.at } else { value <= self.at }
    }
}

/// How the centre of a touch is measured in mm.
#[derive(Clone)]
enum Way {
    /// In columns and rows, so far apart.
    Pitch(Pitch),
    /// By the place of each taxel, mm.
    Places(Vec<[f64; 2]>),
}

impl Way {
    fn on(array: &Array) -> Result<Self> {
        match &array.places {
            Some(Places { x, y, unit: Some(PlaceUnit::Mm), .. }) => {
                Ok(Self::Places(x.iter().zip(y).map(|(&x, &y)| [x, y]).collect()))
            }
            Some(_) => Err(problem!(
                "displacement_mm"; " needs places in mm; the places of {} are in another unit", array.name
            )),
            None => array.pitch("moments: displacement_mm").map(Self::Pitch),
        }
    }
}

#[derive(Clone)]
struct LevelPass {
    loaded: Loaded,
    /// How the centre is measured; `None` where its displacement is not asked for.
    way: Option<Way>,
    /// When the current touch began, us, and its centre then, in the unit of `way`.
    touch: Option<(i64, [f64; 2])>,
    /// The moments of the last sample: area, total, peak, and the displacement of the centre in x and y, mm.
    moments: [f64; 5],
    levels: Vec<MomentLevel>,
    /// The number of the first train after those of the levels.
    first_graded: usize,
    /// The moments that are emitted as graded spikes.
    graded: Vec<usize>,
    /// Half of the columns and rows, where the centre is emitted; `None` where it is not.
    centre: Option<[f64; 2]>,
    /// The place of the centre in the last sample.
    position: [f64; CENTRE],
    /// The ages that have a train each, us.
    ages: Vec<i64>,
    /// The time at which each level was reached, us; `None` below it.
    since: Vec<Option<i64>>,
    /// Period of the tonic spikes, us.
    interval_us: Option<i64>,
    /// The time of a level's next tonic spike, the level, and when it was reached; the period is the same for all, so
    /// the queue is ordered by time.
    due: VecDeque<(i64, usize, i64)>,
}

impl LevelPass {
    /// Computes the moments at `t` us.
    fn measure(&mut self, t: i64, held: &[Block]) {
        if self.loaded.area() == 0 {
            (self.touch, self.moments) = (None, [0.0; 5]);
            return;
        }
        let (LoadedSums { total, peak, x, y }, unit) = match &self.way {
            Some(Way::Places(at)) => (self.loaded.sums_at(held, |taxel| at[taxel]), [1.0; 2]),
            Some(Way::Pitch(Pitch { rows, columns })) => (self.loaded.sums(held), [*columns, *rows]),
            None => (self.loaded.sums(held), [0.0; 2]),
        };
        let centre = [x / total, y / total];
        let (_, origin) = *self.touch.get_or_insert((t, centre));
        let way = |axis: usize| (centre[axis] - origin[axis]) * unit[axis];
        self.moments = [f64::from(self.loaded.area()), total, peak, way(0), way(1)];
        if let Some(half) = self.centre {
            let LoadedSums { total, x, y, .. } = self.loaded.sums(held);
            let [column, row] = [x / total / half[0] - 1.0, y / total / half[1] - 1.0];
            self.position = [column, column * column, row, row * row];
        }
    }

    /// Whether every sample during a touch causes spikes.
    fn at_every_sample(&self) -> bool {
        !self.graded.is_empty() || !self.ages.is_empty()
    }

    /// Emits the graded spikes of the moments at `t`, and the spike of the age.
    fn emit_sample(&self, t: i64, out: &mut Vec<Spike>) {
        let Some((since, _)) = self.touch else { return };
        let mut emit = |n: usize, value: f32| {
            if value != 0.0 {
                out.push(Spike { t: ms(t), train: (self.first_graded + n) as u32, value });
            }
        };
        for (n, &moment) in self.graded.iter().enumerate() {
            let value = self.moments[moment];
            emit(n, libm::log1p(value.abs()).copysign(value) as f32);
        }
        let position = if self.centre.is_some() { &self.position[..] } else { &[] };
        for (n, &value) in position.iter().enumerate() {
            emit(self.graded.len() + n, value as f32);
        }
        if let Some(reached) = self.ages.partition_point(|&age| age <= t - since).checked_sub(1) {
            emit(self.graded.len() + position.len() + reached, 1.0);
        }
    }

    /// Notes that a level is reached: its tonic spikes begin.
    fn reach(&mut self, t: i64, level: usize, out: &mut Vec<Spike>) {
        self.since[level] = Some(t);
        if let Some(interval_us) = self.interval_us {
            out.push(Spike { t: ms(t), train: (2 * self.levels.len() + level) as u32, value: 1.0 });
            self.due.push_back((t + interval_us, level, t));
        }
    }

    /// Emits the tonic spikes before `t` (with `at_too` also at `t`).
    fn emit_tonic(&mut self, t: i64, at_too: bool, out: &mut Vec<Spike>) {
        let Some(interval_us) = self.interval_us else { return };
        while let Some(&(due, level, since)) = self.due.front()
            && (due < t || (at_too && due == t))
        {
            self.due.pop_front();
            if self.since[level] == Some(since) {
                out.push(Spike { t: ms(due), train: (2 * self.levels.len() + level) as u32, value: 1.0 });
                self.due.push_back((due + interval_us, level, since));
            }
        }
    }
}

impl Rule for LevelPass {
    fn begin(&mut self, t: i64, held: &[Block], out: &mut Vec<Spike>) {
        for (block, values) in held.iter().enumerate() {
            self.loaded.take_block(block, values);
        }
        self.measure(t, held);
        for level in 0..self.levels.len() {
            if self.levels[level].is_reached(&self.moments) {
                self.reach(t, level, out);
            }
        }
        self.emit_sample(t, out);
    }

    #[inline(always)]
    fn sample(&mut self, t: i64, held: &[Block], changed: &[bool], _next: &mut NextFrame, out: &mut Vec<Spike>) {
        let changes = changed.contains(&true);
        if !changes && !self.at_every_sample() {
            return;
        }
        let from = out.len();
        for (block, values) in held.iter().enumerate().filter(|&(block, _)| changed[block]) {
            self.loaded.take_block(block, values);
        }
        if changes {
            self.measure(t, held);
        }
        for level in 0..self.levels.len() {
            let (is, was) = (self.levels[level].is_reached(&self.moments), self.since[level].is_some());
            if is && !was {
                out.push(Spike { t: ms(t), train: level as u32, value: 1.0 });
                self.reach(t, level, out);
            } else if was && !is {
                out.push(Spike { t: ms(t), train: (self.levels.len() + level) as u32, value: 1.0 });
                self.since[level] = None;
            }
        }
        self.emit_sample(t, out);
        self.emit_tonic(t, true, out);
        sort_from(out, from);
    }

    fn pass(&mut self, t: i64, out: &mut Vec<Spike>) {
        let from = out.len();
        self.emit_tonic(t, false, out);
        sort_from(out, from);
    }

    fn set_rest(&mut self, channel: usize, rest: f64) {
        self.loaded.set_rest(channel, rest);
    }

    fn rest(&self, channel: usize) -> Option<f64> {
        self.loaded.rest(channel)
    }

    fn idle(&self) -> bool {
        self.due.is_empty() && (self.touch.is_none() || !self.at_every_sample())
    }
}
