//! Area, force, displacement and age of a touch. None of them depends on where the touch began, so what is learnt at one
//! position holds at others; its centre, which does, is an option.

use serde::{Deserialize, Serialize};

use super::channels::Channels;
use super::driver::{Clock, Driver, Rule, Sample};
use super::encoding::Encoding;
use super::levels::{Level, Levels};
use super::loaded::Loaded;
use super::periods::micros;
use super::stream::Stream;
use super::tare::Tare;
use crate::allowed::Range;
use crate::array::{PlaceUnit, Places};
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
    /// The ranges of the moments' levels: area, total, peak, x, y.
    fn ranges(&self) -> [(&'static str, Option<[f64; 2]>); 5] {
        let way = ("displacement_mm", self.displacement_mm);
        [("area", self.area), ("total", self.total), ("peak", self.peak), way, way]
    }

    /// All levels, each with its moment, by the number of its range; a negative level is crossed downwards.
    fn all_levels(&self) -> Vec<(usize, f64)> {
        let mut all = vec![];
        for (moment, (_, range)) in self.ranges().into_iter().enumerate() {
            let Some([least, most]) = range else { continue };
            let levels = geometric_levels(least, most, self.levels);
            all.extend(levels.iter().map(|&at| (moment, at)));
            if moment >= 3 {
                all.extend(levels.iter().map(|&at| (moment, -at)));
            }
        }
        all
    }

    /// The moments that are emitted as graded spikes, numbered as in `all_levels`.
    fn all_graded(&self) -> Vec<usize> {
        let present = self.ranges().into_iter().enumerate().filter(|(_, (_, range))| self.graded && range.is_some());
        present.map(|(moment, _)| moment).collect()
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
        let (places, unit) = if self.displacement_mm.is_some() { way(array)? } else { (None, [0.0; 2]) };
        let (levels, interval) = (self.all_levels(), self.tonic_ms.map(|ms| micros("tonic_ms", ms)).transpose()?);
        let n = levels.len();
        let level = |(k, &(_, at)): (usize, &(usize, f64))| {
            Level::new(at.abs(), at.abs(), [k, n + k], interval.map(|_| 2 * n + k))
        };
        let moments = MomentRule {
            loaded,
            places,
            unit,
            touch: None,
            moments: [0.0; 5],
            levels: Levels::new(levels.iter().enumerate().map(level).collect(), 0, interval.unwrap_or(0)),
            of_level: levels.iter().map(|&(moment, at)| (moment, at.signum())).collect(),
            first_graded: self.level_trains(),
            graded: self.all_graded(),
            centre: self.centre.then(|| [array.columns, array.rows].map(|count| (count.max(2) - 1) as f64 / 2.0)),
            position: [0.0; CENTRE],
            ages: self.all_ages(),
        };
        let clock = Clock::Period(micros("period_ms", self.period_ms)?);
        Ok(Box::new(Driver::new(moments, Channels::grid(array), self.trains_of(array), clock)))
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

/// The place of each taxel, `None` for its column and row; and the unit of these, mm.
type Way = (Option<Vec<[f64; 2]>>, [f64; 2]);

/// How the centre of a touch is measured in mm: by the place of each taxel, or in columns and rows.
fn way(array: &Array) -> Result<Way> {
    match &array.places {
        Some(Places { x, y, unit: Some(PlaceUnit::Mm), .. }) => {
            Ok((Some(x.iter().zip(y).map(|(&x, &y)| [x, y]).collect()), [1.0; 2]))
        }
        Some(_) => Err(problem!(
            "displacement_mm"; " needs places in mm; the places of {} are in another unit", array.name
        )),
        None => array.pitch("moments: displacement_mm").map(|pitch| (None, [pitch.columns, pitch.rows])),
    }
}

#[derive(Clone)]
struct MomentRule {
    loaded: Loaded,
    /// The place of each taxel, in which the centre is measured; `None` where that is in columns and rows.
    places: Option<Vec<[f64; 2]>>,
    /// The unit of places, or the distance of columns and of rows, mm; 0 where the displacement is not asked for.
    unit: [f64; 2],
    /// When the current touch began, us, and its centre then.
    touch: Option<(i64, [f64; 2])>,
    /// The moments of the last sample: area, total, peak, and the displacement of the centre in x and y, mm.
    moments: [f64; 5],
    levels: Levels,
    /// The moment of each level, and -1 for one that is crossed downwards.
    of_level: Vec<(usize, f64)>,
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
}

impl MomentRule {
    /// Computes the moments.
    fn measure(&mut self, now: Sample<'_>) {
        self.loaded.take_changed(now);
        if self.loaded.area() == 0 {
            (self.touch, self.moments) = (None, [0.0; 5]);
            return;
        }
        let sums = self.loaded.sums(now.held);
        if let Some(half) = self.centre {
            let [column, row] = [sums.x / sums.total / half[0] - 1.0, sums.y / sums.total / half[1] - 1.0];
            self.position = [column, column * column, row, row * row];
        }
        let sums = self.places.as_ref().map_or(sums, |at| self.loaded.sums_at(now.held, |taxel| at[taxel]));
        let centre = [sums.x / sums.total, sums.y / sums.total];
        let (_, origin) = *self.touch.get_or_insert((now.t, centre));
        let way = |axis: usize| (centre[axis] - origin[axis]) * self.unit[axis];
        self.moments = [f64::from(self.loaded.area()), sums.total, sums.peak, way(0), way(1)];
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
}

impl Rule for MomentRule {
    fn begin(&mut self, now: Sample<'_>, out: &mut Vec<Spike>) {
        self.measure(Sample { changed: &vec![true; now.held.len()], ..now });
        let Self { levels, of_level, moments, .. } = self;
        levels.settle(now.t, 0..levels.len(), |level| of_level[level].1 * moments[of_level[level].0], out);
        self.emit_sample(now.t, out);
    }

    #[inline(always)]
    fn sample(&mut self, now: Sample<'_>, out: &mut Vec<Spike>) {
        if now.changed.contains(&true) {
            self.measure(now);
            let Self { levels, of_level, moments, .. } = self;
            levels.take(now.t, 0..levels.len(), |level| of_level[level].1 * moments[of_level[level].0], out);
        }
        self.emit_sample(now.t, out);
        if now.changed.contains(&true) || self.at_every_sample() {
            self.levels.pass(now.t, true, out);
        }
    }

    fn pass(&mut self, t: i64, out: &mut Vec<Spike>) {
        self.levels.pass(t, false, out);
    }

    fn set_rest(&mut self, channel: usize, rest: f64) {
        self.loaded.set_rest(channel, rest);
    }

    fn rest(&self, channel: usize) -> Option<f64> {
        self.loaded.rest(channel)
    }

    fn idle(&self) -> bool {
        self.levels.idle() && (self.touch.is_none() || !self.at_every_sample())
    }
}
