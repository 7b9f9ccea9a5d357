//! The index of a recording of frames.
//!
//! Views show changes of ticks. Of frames a tick is a step of their unit, and the changes at a time are the cells that differ
//! from the frame before; one that equals it has a change all the same, as it has a time.

use taxel_core::Array;
use taxel_core::held::UNKNOWN;
use taxel_core::rest::{NOISE_FLOOR, TrackedRest, ValueSteps};
use taxel_live::Result;
use taxel_live::pipeline::TaxelChange;

use crate::block::Block;
use crate::frame_values::{FrameRest, Frames, FramesOfSource, RestSource};
use crate::index::{CHANGES, Index, Indexing, Kept};
use crate::load::Weights;
use crate::state::{Keyframe, Sensor};

/// Maximum number of sources that each have a curve of their sum.
const MOST_SOURCES: usize = 4;

/// A tracked rest is stored where that of a taxel is further than this from the stored one, in ticks of the noise floor.
const REST_MOVED: f64 = 0.5;

/// The frames of a source as they are given.
#[derive(Debug, Clone)]
pub struct FrameSource<'a> {
    /// The source.
    pub about: FramesOfSource,
    /// Their times, us, ascending.
    pub t: Vec<i64>,
    /// Their values row by row, frame after frame; NaN where one is missing.
    pub values: &'a [f32],
}

/// The frames of a source, in ticks.
struct SteppedFrames<'a> {
    given: FrameSource<'a>,
    /// Row by row, frame after frame; [`UNKNOWN`] where a value is missing.
    ticks: Vec<u16>,
    /// The taxels of its cells.
    taxels: Vec<usize>,
    /// The rest of its cells, each from the frame of this number on; there is one at least.
    rests: Vec<(usize, Vec<u16>)>,
}

impl<'a> SteppedFrames<'a> {
    fn new(given: FrameSource<'a>, steps: ValueSteps, columns: u16) -> Self {
        let ticks = given.values.iter().map(|&value| steps.ticks(value)).collect();
        Self { ticks, taxels: given.about.taxels(columns).collect(), rests: rests(&given, steps), given }
    }

    fn frame(&self, k: usize) -> &[u16] {
        &self.ticks[k * self.taxels.len()..(k + 1) * self.taxels.len()]
    }

    /// The rest of its cells at a frame.
    fn rest(&self, k: usize) -> &[u16] {
        &self.rests[self.rests.partition_point(|&(from, _)| from <= k).max(1) - 1].1
    }

    /// Appends the changes of a frame.
    fn changes(&self, k: usize, to: &mut Vec<TaxelChange>) {
        let (t, before) = (self.given.t[k], k.checked_sub(1).map(|before| self.frame(before)));
        let begin = to.len();
        let change = |(cell, &ticks): (usize, &u16)| {
            let held = before.map_or(UNKNOWN, |before| before[cell]);
            // A sensor has 2^22 taxels at most (the limits of recordings).
            let taxel = self.taxels[cell] as u32;
            (TaxelChange { t, taxel, ticks, up: ticks >= held, repaired: false }, held != ticks)
        };
        let all = || self.frame(k).iter().enumerate().map(change);
        to.extend(all().filter(|&(_, differs)| differs).map(|(change, _)| change));
        if to.len() == begin {
            to.extend(all().next().map(|(change, _)| change));
        }
    }

    fn frame_us(&self) -> i64 {
        let t = &self.given.t;
        let steps = i64::try_from(t.len()).unwrap_or(i64::MAX).saturating_sub(1).max(1);
        t.first().zip(t.last()).map_or(0, |(first, last)| (last - first) / steps)
    }
}

/// What the values of a cell without a rest are above, in steps: 0, or the least of them where most are negative.
fn base(values: &[f32], cell: usize, cells: usize, steps: ValueSteps) -> u16 {
    let of_cell = || values.iter().skip(cell).step_by(cells).copied().filter(|value| value.is_finite());
    let negative = of_cell().filter(|&value| value < 0.0).count();
    if 2 * negative > of_cell().count() { steps.ticks(of_cell().fold(f32::INFINITY, f32::min)) } else { steps.zero }
}

/// The rest of a source's cells in steps, each from the frame of this number on: once where it is fixed, else where it moved.
fn rests(given: &FrameSource<'_>, steps: ValueSteps) -> Vec<(usize, Vec<u16>)> {
    let FrameRest { source, values, ticks_by_unit, falls, .. } = &given.about.rest;
    let fixed = || vec![(0, values.iter().map(|&value| steps.of_rest(value)).collect())];
    match source {
        RestSource::None => {
            return vec![(0, (0..values.len()).map(|cell| base(given.values, cell, values.len(), steps)).collect())];
        }
        RestSource::Given => return fixed(),
        // Nothing is shown above it.
        RestSource::Quiet if *falls => return vec![(0, vec![UNKNOWN; values.len()])],
        RestSource::Quiet => {}
    }
    let begins: Vec<f64> = values.iter().map(|rest| rest * ticks_by_unit).collect();
    let mut tracked = TrackedRest::new(given.about.sensor.columns.into(), NOISE_FLOOR, begins);
    let mut stored: Vec<Option<f64>> = vec![];
    let mut rests: Vec<(usize, Vec<u16>)> = vec![];
    for (k, (&t, frame)) in given.t.iter().zip(given.values.chunks_exact(values.len())).enumerate() {
        tracked.take(t, frame.iter().map(|value| value * *ticks_by_unit as f32));
        let moved = |(now, then): (Option<f64>, &Option<f64>)| match (now, then) {
            (Some(now), Some(then)) => (now - then).abs() > REST_MOVED,
            (now, then) => now.is_some() != then.is_some(),
        };
        if stored.is_empty() || tracked.rests().zip(&stored).any(moved) {
            stored = tracked.rests().collect();
            let ticks = |rest: &Option<f64>| rest.map_or(UNKNOWN, |rest| steps.of_rest(rest / ticks_by_unit));
            rests.push((k, stored.iter().map(ticks).collect()));
        }
    }
    if rests.is_empty() { fixed() } else { rests }
}

impl Index {
    /// Indexes frames of sources that have areas in `array`, from left to right.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` where the temporary file cannot be made or has no room.
    pub fn of_frames(
        array: Array,
        unit: String,
        number_us: Option<i64>,
        sources: Vec<FrameSource<'_>>,
        kept: Kept,
    ) -> Result<Self> {
        let steps = ValueSteps::fitting(sources.iter().map(|source| source.values), array.len());
        // Of several sources, the most.
        let floor = sources.iter().map(|source| (source.about.rest.loaded_from / steps.size) as u16).max().unwrap_or(0);
        let step = |source| SteppedFrames::new(source, steps, array.columns);
        let sources: Vec<SteppedFrames<'_>> = sources.into_iter().map(step).collect();
        let frames = about(&array, unit, number_us, steps, floor, &sources);
        let begin = Keyframe { rest: rest_at(&sources, i64::MIN, array.len()), ..Keyframe::blank(array.len()) };
        let taxels = array.len();
        let mut indexing = Indexing::new(Sensor::new(array, floor, Some(frames)), &begin, kept);
        let numbers =
            |(number, source): (usize, &SteppedFrames<'_>)| (0..source.given.t.len()).map(move |k| (number, k));
        let mut order: Vec<(usize, usize)> = sources.iter().enumerate().flat_map(numbers).collect();
        let time = |&(source, k): &(usize, usize)| sources[source].given.t[k];
        order.sort_by_key(time);
        let mut changes = vec![];
        for together in order.chunk_by(|a, b| time(a) == time(b)) {
            together.iter().for_each(|&(source, k)| sources[source].changes(k, &mut changes));
            let rest_moves = |&(source, k): &(usize, usize)| {
                k > 0 && sources[source].rests.binary_search_by_key(&k, |&(from, _)| from).is_ok()
            };
            let moves = together.iter().any(rest_moves);
            if moves || changes.len() >= CHANGES {
                let rest = moves.then(|| rest_at(&sources, time(&together[0]), taxels));
                indexing.push(Block { held: None, changes: std::mem::take(&mut changes).into(), rest })?;
            }
        }
        indexing.push(Block { changes: changes.into(), ..Block::default() })?;
        Ok(indexing.finish())
    }
}

/// The rest of each taxel at a time, us; before the first frame, that of it.
fn rest_at(sources: &[SteppedFrames<'_>], t: i64, taxels: usize) -> Vec<u16> {
    let mut rest = vec![UNKNOWN; taxels];
    for source in sources {
        let last = source.given.t.partition_point(|&at| at <= t).saturating_sub(1);
        source.taxels.iter().zip(source.rest(last)).for_each(|(&taxel, &ticks)| rest[taxel] = ticks);
    }
    rest
}

/// What the values of stepped frames are.
fn about(
    array: &Array,
    unit: String,
    number_us: Option<i64>,
    steps: ValueSteps,
    floor: u16,
    sources: &[SteppedFrames<'_>],
) -> Frames {
    let rests = || sources.iter().map(|source| source.given.about.rest.source);
    let sum_floor = if rests().any(|rest| rest == RestSource::Quiet) { floor } else { 0 };
    let (_, newtons) = Weights::new(array, &unit);
    let first = rests().next().unwrap_or(RestSource::None);
    let mut frames = Frames {
        unit,
        number_us,
        steps,
        count: sources.iter().map(|source| source.given.t.len()).sum(),
        newtons: newtons.map(|newtons| newtons * steps.size),
        sources: sources.iter().map(|source| source.given.about.clone()).collect(),
        frame_us: sources.iter().map(SteppedFrames::frame_us).max().unwrap_or(0),
        rest_source: if rests().all(|rest| rest == first) { first } else { RestSource::None },
        sum_floor,
        source_of: vec![],
    };
    if (2..=MOST_SOURCES).contains(&sources.len()) {
        // An empty column between two sources counts as of the one before.
        let source_at = |column| frames.sources.partition_point(|source| source.left <= column).saturating_sub(1);
        frames.source_of = (0..array.columns).map(source_at).collect();
    }
    frames
}

#[cfg(test)]
mod tests;
