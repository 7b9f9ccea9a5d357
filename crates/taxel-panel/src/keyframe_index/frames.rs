//! The index of a recording of frames: all of them in memory, their values in whole steps of the unit.
//!
//! Views show changes of ticks. Frames are shown by the same code: a tick is then a step of their unit, and the changes
//! at a time are the cells that differ from the frame before.

use std::sync::Arc;

use taxel_core::Array;
use taxel_core::array::Places;
use taxel_core::held::UNKNOWN;
use taxel_core::rest::{FrameNoise, ValueSteps, above_noise};
use taxel_live::Result;
use taxel_live::pipeline::TaxelChange;

use super::stepped_frames::SteppedFrames;
pub use super::stepped_frames::{FrameArea, FrameRest, FrameSource};
use super::{Block, FrameSources, KeyframeIndex};
use crate::array_state::{ArrayState, Keyframe, RestSource};
use crate::load::Weights;
use crate::time_columns::{COLUMN_US, TimeColumns, column_of};

/// Memory that the curves may take, bytes.
const TIME_COLUMN_BYTES: usize = 256 << 20;

/// Bins of the overview.
const BINS: i64 = 1000;

/// Maximum number of sources that each have a curve of their sum.
const MOST_SOURCES: usize = 4;

/// An indexed recording of frames.
#[derive(Debug)]
pub struct FrameIndex {
    /// Unit of the values.
    pub unit: String,
    /// Time from one frame to the next in the index, where the frames are numbered, us; `None` where they have times.
    pub number_us: Option<i64>,
    /// Size of a step of the shown values, in the unit.
    pub step: f64,
    /// Ticks of the value 0.
    pub zero: u16,
    /// Number of frames.
    pub count: u64,
    /// Steps above rest up to which a taxel counts as not loaded: of several sources, the most.
    pub floor: u16,
    /// The force that a step of the sums is, N; `None` where they are sums of the values.
    pub newtons: Option<f64>,
    weights: Weights,
    array: Array,
    sources: Vec<SteppedFrames>,
    /// The frames of all sources in order of time: number of the source, and of its frame.
    order: Vec<(usize, usize)>,
    time_columns: Option<TimeColumns>,
    /// Up to this sum of ticks above rest there is noise alone, of each source.
    noise: Vec<u32>,
    range: Option<(i64, i64)>,
}

impl FrameIndex {
    /// Indexes frames of sources that have areas in `array`.
    #[must_use]
    pub fn new(array: Array, unit: String, number_us: Option<i64>, sources: Vec<FrameSource<'_>>) -> Self {
        let steps = ValueSteps::fitting(sources.iter().map(|source| source.values), array.len());
        let floor = sources.iter().map(|source| source.floor(steps)).max().unwrap_or(0);
        let sources: Vec<SteppedFrames> = sources.into_iter().map(|source| SteppedFrames::new(source, steps)).collect();
        let frames = |(number, source): (usize, &SteppedFrames)| (0..source.t.len()).map(move |k| (number, k));
        let mut order: Vec<(usize, usize)> = sources.iter().enumerate().flat_map(frames).collect();
        order.sort_by_key(|&(source, k)| sources[source].t[k]);
        let time = |&(source, k): &(usize, usize)| sources[source].t[k];
        let range = order.first().map(time).zip(order.last().map(time));
        let (weights, newtons) = Weights::new(&array, &unit);
        let mut index = Self {
            unit,
            number_us,
            step: steps.size,
            zero: steps.zero,
            count: order.len() as u64,
            floor,
            newtons: newtons.map(|newtons| newtons * steps.size),
            weights,
            range,
            array,
            sources,
            order,
            time_columns: None,
            noise: vec![],
        };
        index.noise = index.measure_noise();
        index.time_columns = index.measure();
        index
    }

    /// The areas of its sources, where the rest of each comes from, whether its values fall from it, and where something lay then.
    pub fn areas(&self) -> impl Iterator<Item = (&FrameArea, RestSource, bool, &str)> {
        self.sources.iter().map(|source| (&source.area, source.rest_source, source.falls, source.preload_at.as_str()))
    }

    /// Column and row of the taxels that flicker, which never count as above rest.
    pub fn flickering(&self) -> impl Iterator<Item = (usize, usize)> {
        let columns = usize::from(self.array.columns);
        let places_of = move |source: &SteppedFrames| {
            let taxels: Vec<usize> = source.taxels(self.array.columns).collect();
            let positions = source.flickering.iter().map(|&cell| (taxels[cell] % columns, taxels[cell] / columns));
            positions.collect::<Vec<_>>()
        };
        self.sources.iter().flat_map(places_of)
    }

    /// Time of the last frame up to a time, us.
    #[must_use]
    pub fn frame_until(&self, t: i64) -> Option<i64> {
        self.sources.iter().filter_map(|source| source.t[..source.until(t)].last().copied()).max()
    }

    /// Mean time from one frame of a source to the next, us; 0 where there is one alone.
    #[must_use]
    pub fn frame_us(&self) -> i64 {
        let mean = |source: &SteppedFrames| {
            let (first, last) = source.t.first().zip(source.t.last())?;
            Some((last - first) / i64::try_from(source.t.len()).ok()?.saturating_sub(1).max(1))
        };
        self.sources.iter().filter_map(mean).max().unwrap_or(0)
    }

    /// Start and width of a bin of the overview, us, and the number of bins.
    #[must_use]
    pub fn bins(&self) -> (i64, i64, usize) {
        let Some((first, last)) = self.range else { return (0, COLUMN_US, 0) };
        let step = COLUMN_US.max((last - first) / BINS + 1);
        (first, step, usize::try_from((last - first) / step).unwrap_or(0) + 1)
    }

    /// The most that noise adds up to, of each source.
    fn measure_noise(&self) -> Vec<u32> {
        // Noise is what is above a rest that was found: above a given one any value is load.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let most = |source: &SteppedFrames| match source.rest_source {
            RestSource::Quiet => {
                let mut noise = FrameNoise::default();
                for (k, &t) in source.t.iter().enumerate().filter(|&(k, _)| source.knows(k)) {
                    noise.take(t, self.sum(source, k).into());
                }
                noise.most(self.floor.into()) as u32
            }
            RestSource::Given | RestSource::None => 0,
        };
        self.sources.iter().map(most).collect()
    }

    /// The curves of the whole recording; `None` where they take too much memory.
    fn measure(&self) -> Option<TimeColumns> {
        let (first, _) = self.range?;
        let (keyframe, mut next) = self.keyframe(first.saturating_sub(1));
        let mut state = self.state(&keyframe, COLUMN_US, TIME_COLUMN_BYTES);
        while let Some(Block { next: later, changes, rest, .. }) = self.changes(next) {
            state.apply(&changes);
            rest.into_iter().for_each(|rest| state.set_rest(rest));
            next = later;
        }
        state.update_curve();
        let columns = state.time_columns().clone();
        let is_whole = columns.reach().is_none_or(|(begin, _)| begin <= column_of(first, COLUMN_US));
        is_whole.then_some(columns)
    }

    /// What is shown at a time, us, and the number of the next frame.
    fn keyframe(&self, t: i64) -> (Keyframe, u64) {
        let mut held = vec![UNKNOWN; self.array.len()];
        for source in &self.sources {
            if let Some(last) = source.until(t).checked_sub(1) {
                source.taxels(self.array.columns).zip(source.frame(last)).for_each(|(k, &ticks)| held[k] = ticks);
            }
        }
        let next = self.order.partition_point(|&(source, k)| self.sources[source].t[k] <= t) as u64;
        let latest = self.keyframe_before(t.saturating_add(1));
        (Keyframe { latest, events: next, held, rest: self.rest(t), tracked: None }, next)
    }

    /// A frame; the changes are the cells that differ from the one before.
    fn changes(&self, number: u64) -> Option<Block> {
        let frame = usize::try_from(number).ok().and_then(|number| self.order.get(number));
        let &(source, k) = frame?;
        let source = &self.sources[source];
        let before = k.checked_sub(1).map(|before| source.frame(before));
        let t = source.t[k];
        let change = |(cell, (taxel, &ticks)): (usize, (usize, &u16))| {
            let held = before.map_or(UNKNOWN, |before| before[cell]);
            // A sensor has 2^22 taxels at most (the limits of recordings).
            #[allow(clippy::cast_possible_truncation)]
            let change = TaxelChange { t, taxel: taxel as u32, ticks, up: ticks >= held, repaired: false };
            (change, held != ticks)
        };
        let all = || source.taxels(self.array.columns).zip(source.frame(k)).enumerate().map(change);
        let mut changes: Vec<TaxelChange> = all().filter(|&(_, differs)| differs).map(|(change, _)| change).collect();
        if changes.is_empty() {
            // A frame equal to the one before has a time of its own.
            changes.extend(all().next().map(|(change, _)| change));
        }
        let rest = source.rest_moves(k).then(|| self.rest(t));
        Some(Block { next: number + 1, held: None, changes, rest })
    }

    /// The number of sources that have a curve each.
    fn curves(&self) -> usize {
        Some(self.sources.len()).filter(|count| (2..=MOST_SOURCES).contains(count)).unwrap_or(0)
    }

    /// The taxels of a source's frame, each with its steps above rest as they count in the sums.
    fn above<'a>(&'a self, source: &'a SteppedFrames, k: usize) -> impl Iterator<Item = (usize, u16)> + 'a {
        let values = source.frame(k).iter().zip(source.rest(k));
        let floor = self.sum_floor();
        let above = move |(&ticks, &rest): (&u16, &u16)| above_noise(ticks, rest, floor);
        source.taxels(self.array.columns).zip(values.map(above))
    }

    /// The rest of each taxel at a time, us.
    fn rest(&self, t: i64) -> Vec<u16> {
        let mut rest = vec![UNKNOWN; self.array.len()];
        for source in &self.sources {
            let of_last = source.rest(source.until(t).saturating_sub(1));
            source.taxels(self.array.columns).zip(of_last).for_each(|(k, &ticks)| rest[k] = ticks);
        }
        rest
    }

    /// Where the rest of the sources comes from; none where they differ.
    fn rest_source(&self) -> RestSource {
        let mut found = self.sources.iter().map(|source| source.rest_source);
        let first = found.next().unwrap_or(RestSource::None);
        if found.all(|rest_source| rest_source == first) { first } else { RestSource::None }
    }

    /// Steps above rest that count as none in the sums. Forces and pressures are summed over all taxels; of others, above a rest that was found, the noise is no load.
    fn sum_floor(&self) -> u16 {
        let found = self.sources.iter().any(|source| source.rest_source == RestSource::Quiet);
        if found { self.floor } else { 0 }
    }

    /// Number of the source of each column of the array; empty where there is one, or more than have a curve each.
    fn source_of(&self) -> Arc<[usize]> {
        if self.curves() == 0 {
            return Arc::default();
        }
        // An empty column between two sources counts as of the one before.
        let source = |x| self.sources.partition_point(|source| source.area.left <= x).saturating_sub(1);
        (0..self.array.columns).map(source).collect()
    }

    /// The sum of a source's frame above rest.
    fn sum(&self, source: &SteppedFrames, k: usize) -> u32 {
        let (mut plain, mut weighted) = (0_u64, 0_u64);
        for (taxel, above) in self.above(source, k) {
            plain += u64::from(above);
            weighted = weighted.wrapping_add(self.weights.weighed(taxel, above.into()));
        }
        self.weights.sum(plain, weighted)
    }
}

impl FrameSources for FrameIndex {
    fn array(&self) -> &Array {
        &self.array
    }

    fn numbered(&self) -> bool {
        self.number_us.is_some()
    }

    fn sensors(&self) -> Vec<Array> {
        let sensor = |source: &SteppedFrames| {
            let taxels: Vec<usize> = source.taxels(self.array.columns).collect();
            let part = |values: &[f64]| taxels.iter().map(|&taxel| values[taxel]).collect::<Vec<f64>>();
            let area = &source.area;
            Array {
                rows: area.rows,
                columns: area.columns,
                pitch_mm: self.array.pitch_mm,
                name: area.name.clone(),
                exists: self.array.exists.as_ref().map(|exists| taxels.iter().map(|&taxel| exists[taxel]).collect()),
                places: self.array.places.as_ref().map(|places| Places {
                    x: part(&places.x),
                    y: part(&places.y),
                    area: places.area.as_deref().map(part),
                    unit: places.unit,
                }),
                names: self
                    .array
                    .names
                    .as_ref()
                    .map(|names| taxels.iter().map(|&taxel| names[taxel].clone()).collect()),
            }
        };
        self.sources.iter().map(sensor).collect()
    }

    fn until(&self, source: usize, t: i64) -> usize {
        self.sources[source].until(t)
    }

    #[allow(clippy::cast_possible_truncation)]
    fn frame(&self, source: usize, k: usize) -> Option<(i64, Vec<f32>)> {
        let source = &self.sources[source];
        let value = |&ticks: &u16| match ticks {
            UNKNOWN => f32::NAN,
            ticks => ((f64::from(ticks) - f64::from(self.zero)) * self.step) as f32,
        };
        source.t.get(k).map(|&t| (t, source.frame(k).iter().map(value).collect()))
    }
}

impl KeyframeIndex for FrameIndex {
    fn array(&self) -> &Array {
        &self.array
    }

    fn noise_floor(&self) -> u16 {
        self.floor
    }

    fn frames(self: Arc<Self>) -> Option<Arc<dyn FrameSources>> {
        Some(self)
    }

    fn state(&self, from: &Keyframe, column_us: i64, time_column_bytes: usize) -> ArrayState {
        let all = self.noise.iter().fold(0, |sum: u32, &noise| sum.saturating_add(noise));
        let (floor, noise) = (self.sum_floor(), (all, self.noise.clone()));
        let state = ArrayState::new(&self.array, self.floor, from, column_us, time_column_bytes);
        state.of_frames(from, self.rest_source(), floor, &self.weights, self.source_of(), noise)
    }

    fn range(&self) -> Option<(i64, i64)> {
        self.range
    }

    fn open(&self, t: i64) -> Result<(Keyframe, u64)> {
        Ok(self.keyframe(t))
    }

    fn block(&self, number: u64) -> Result<Option<Block>> {
        Ok(self.changes(number))
    }

    fn keyframe_before(&self, t: i64) -> Option<i64> {
        let before = |source: &SteppedFrames| source.until(t.saturating_sub(1)).checked_sub(1).map(|k| source.t[k]);
        self.sources.iter().filter_map(before).max()
    }

    fn time_columns(&self) -> Option<&TimeColumns> {
        self.time_columns.as_ref()
    }

    fn events_before(&self, t: i64) -> u64 {
        // In a step a quarter of the cells changes.
        self.sources.iter().map(|source| (source.until(t) * source.cells() / 4) as u64).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time_columns::{Curve, MISSING};
    use crate::view::player::{Player, ViewOptions};
    use rand::{Rng, SeedableRng, rngs::StdRng};

    fn area(name: &str, left: u16) -> FrameArea {
        FrameArea { name: name.to_owned(), left, rows: 2, columns: 3 }
    }

    fn index(left: &(Vec<i64>, Vec<f32>), right: &(Vec<i64>, Vec<f32>)) -> Arc<FrameIndex> {
        let array = Array::new(2, 7, 1.0, "feet").unwrap();
        let rest = FrameRest {
            source: RestSource::None,
            values: vec![0.0; 6],
            ticks_by_unit: 1.0,
            loaded_from: 0.0,
            falls: false,
            flickering: vec![],
            preload_at: String::new(),
        };
        let source = |area, (t, values): &'_ (Vec<i64>, Vec<f32>)| (area, t.clone(), values.clone());
        let all = [source(area("left", 0), left), source(area("right", 4), right)];
        let sources = all.iter().map(|(area, t, values)| FrameSource {
            area: area.clone(),
            t: t.clone(),
            values,
            rest: rest.clone(),
        });
        Arc::new(FrameIndex::new(array, String::new(), None, sources.collect()))
    }

    fn drawn(random: &mut StdRng, fractions: bool) -> (Vec<i64>, Vec<f32>) {
        let mut t = random.random_range(-50_000..50_000_i64);
        let (mut times, mut values) = (vec![], vec![]);
        for _ in 0..random.random_range(1..200) {
            times.push(t);
            t += if random.random_range(0..20) == 0 { 5_000_000 } else { random.random_range(1..20_000) };
            for _ in 0..6 {
                let value = random.random_range(-20..200_i16);
                values.push(match random.random_range(0..12) {
                    0 => f32::NAN,
                    _ if fractions => f32::from(value) * 0.37,
                    _ => f32::from(value),
                });
            }
        }
        (times, values)
    }

    #[test]
    fn at_any_time_the_last_frame_of_each_source_is_shown_with_its_load() {
        let mut random = StdRng::seed_from_u64(7);
        for round in 0..40 {
            let (left, right) = (drawn(&mut random, round % 2 == 0), drawn(&mut random, round % 2 == 0));
            let index = index(&left, &right);
            let shared: Arc<dyn KeyframeIndex> = index.clone();
            let (first, last) = shared.range().unwrap();
            let mut player = Player::open(Arc::clone(&shared), first, ViewOptions::plain(COLUMN_US)).unwrap();
            for _ in 0..10 {
                let t = random.random_range(first..=last);
                let mut sought = Player::open(Arc::clone(&shared), t, ViewOptions::plain(COLUMN_US)).unwrap();
                if t >= player.t() {
                    player.advance(t).unwrap();
                }
                let (mut expected, mut sums) = (vec![f32::NAN; 14], [None; 2]);
                for (source, ((times, values), offset)) in [(&left, 0), (&right, 4)].into_iter().enumerate() {
                    let Some(k) = times.partition_point(|&at| at <= t).checked_sub(1) else { continue };
                    for cell in 0..6 {
                        let value = values[6 * k + cell];
                        expected[cell / 3 * 7 + offset + cell % 3] = value;
                        if !value.is_nan() {
                            *sums[source].get_or_insert(0.0) += value.max(0.0);
                        }
                    }
                }
                let shown = |player: &Player| -> Vec<f64> {
                    let value = |ticks: u16| (f64::from(ticks) - f64::from(index.zero)) * index.step;
                    let held = player.state().held().iter();
                    held.map(|&ticks| if ticks == UNKNOWN { f64::NAN } else { value(ticks) }).collect()
                };
                for player in [&sought].into_iter().chain((player.t() == t).then_some(&player)) {
                    for (ours, theirs) in shown(player).iter().zip(&expected) {
                        let near = (ours - f64::from(*theirs)).abs() <= 0.51 * index.step;
                        assert!(near || ours.is_nan() && theirs.is_nan(), "{ours} {theirs}");
                    }
                }
                sought.state_mut().update_curve();
                let column = column_of(t, COLUMN_US);
                let curves: Vec<Curve> = sought.state().curves().collect();
                let load = f64::from(curves[0].sum) * index.step;
                let sum: f32 = sums.iter().flatten().sum();
                assert!((load - f64::from(sum)).abs() < 12.0 * index.step, "{load} {sum}");
                for (source, (curve, theirs)) in curves[1..].iter().zip(sums).enumerate() {
                    let Curve { sum, x, y, .. } = *curve;
                    assert_eq!(curve.area == MISSING.area, theirs.is_none());
                    let near =
                        |expected: f32| (f64::from(sum) * index.step - f64::from(expected)).abs() < 6.0 * index.step;
                    assert!(theirs.is_none_or(near), "{sum} {theirs:?}");
                    assert_eq!(x.is_nan(), sum == 0 || theirs.is_none());
                    let (mut mass, mut at) = (0.0, [0.0; 2]);
                    for (cell, value) in expected.iter().enumerate().filter(|(_, value)| **value > 0.0) {
                        let (row, column) = (cell / 7, cell % 7);
                        if (column >= 4) == (source == 1) {
                            mass += value;
                            at = [at[0] + value * column as f32, at[1] + value * row as f32];
                        }
                    }
                    let far = |ours: f32, moment: f32| (ours - moment / mass).abs() > 0.02;
                    assert!(mass < 30.0 || !(far(x, at[0]) || far(y, at[1])), "{source}: {x}, {y} of {at:?} / {mass}");
                }
                if sought.t() == last {
                    let of = |columns: &TimeColumns| {
                        let mut curves = columns.no_curves();
                        columns.join_curves(column..column + 1, &mut curves.sums, &mut curves.channels);
                        curves
                    };
                    assert_eq!(of(shared.time_columns().unwrap()), of(sought.state().time_columns()));
                }
            }
        }
    }

    #[test]
    fn noise_has_no_centre_and_a_touch_has_one_also_where_one_foot_always_stands() {
        let mut random = StdRng::seed_from_u64(5);
        let stands = |foot: usize, k: usize| k >= 60 && (k / 40 + foot).is_multiple_of(2);
        for spread in [0, 2, 4, 6] {
            let values = [0, 1].map(|foot| {
                let mut value = |k: usize| -> f32 {
                    let noise: i16 = (0..4).map(|_| random.random_range(-spread..=spread)).sum();
                    f32::from(200 + noise) + if stands(foot, k) { 60.0 } else { 0.0 }
                };
                (0..600).flat_map(|k| [k; 16]).map(&mut value).collect::<Vec<f32>>()
            });
            let rest = FrameRest {
                source: RestSource::Quiet,
                values: vec![200.0; 16],
                ticks_by_unit: 0.5,
                loaded_from: 7.0,
                falls: false,
                flickering: vec![],
                preload_at: String::new(),
            };
            let sources = values.iter().zip([("left", 0), ("right", 5)]).map(|(values, (name, left))| FrameSource {
                area: FrameArea { name: name.to_owned(), left, rows: 4, columns: 4 },
                t: (0..600).map(|k| 10_000 * k).collect(),
                values,
                rest: rest.clone(),
            });
            let array = Array::new(4, 9, 1.0, "feet").unwrap();
            let index = FrameIndex::new(array, String::new(), None, sources.collect());
            for k in 0..600 {
                let sum: u32 = index.sources.iter().map(|foot| index.sum(foot, k)).sum();
                let (touches, noise) = (stands(0, k) || stands(1, k), index.noise.iter().sum::<u32>());
                assert_eq!(sum > noise, touches, "spread {spread}, frame {k}: {sum} of {noise}");
            }
        }
    }

    #[test]
    fn a_source_that_begins_later_has_the_noise_of_its_own_frames() {
        let values = vec![210.0; 600 * 6];
        let noise = [0, 1_000_000].map(|late| {
            let rest = FrameRest {
                source: RestSource::Quiet,
                values: vec![200.0; 6],
                ticks_by_unit: 0.5,
                loaded_from: 7.0,
                falls: false,
                flickering: vec![],
                preload_at: String::new(),
            };
            let sources = [("left", 0, 0), ("right", 4, late)].map(|(name, left, begin)| FrameSource {
                area: area(name, left),
                t: (0..600).map(|k| begin + 10_000 * k).collect(),
                values: &values,
                rest: rest.clone(),
            });
            let array = Array::new(2, 7, 1.0, "feet").unwrap();
            let index = FrameIndex::new(array, String::new(), None, sources.into());
            index.noise
        });
        assert_eq!(noise[0], noise[1]);
        assert!(noise[0][1] > 4 * 7);
    }

    #[test]
    fn steps_go_from_frame_to_frame_both_ways() {
        let left = ((0..9).map(|k| 10_000 * k).collect::<Vec<i64>>(), vec![1.0; 54]);
        let index = index(&left, &(vec![], vec![]));
        let shared: Arc<dyn KeyframeIndex> = index;
        let mut player = Player::open(Arc::clone(&shared), 30_000, ViewOptions::plain(COLUMN_US)).unwrap();
        assert_eq!((player.last_stamp().unwrap(), player.next_stamp().unwrap()), (Some(20_000), Some(40_000)));
        assert_eq!(player.state().events(), 4);
        player.advance(80_000).unwrap();
        assert_eq!((player.next_stamp().unwrap(), player.state().events()), (None, 9));
    }
}
