//! The frames of the sources of a recording, their values in whole steps of the unit.

use taxel_core::held::UNKNOWN;
use taxel_core::rest::{NOISE_FLOOR, TrackedRest, ValueSteps};

use crate::array_state::RestSource;

/// A tracked rest is stored where that of a taxel is further than this from the stored one, in ticks of the noise floor.
const REST_MOVED: f64 = 0.5;

/// Where a source's frames are in the array of the recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FrameArea {
    /// Name of the source.
    pub name: String,
    /// Its first column in the array of the recording.
    pub left: u16,
    /// Its rows.
    pub rows: u16,
    /// Its columns.
    pub columns: u16,
}

/// What the values of a source's frames are above.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameRest {
    /// Where it is known from. That of a quiet stretch is tracked from its values on; without any the values are above 0.
    pub source: RestSource,
    /// The rest of each cell, in the unit; [`Value::NO_REST`](taxel_core::rest::Value::NO_REST) where it is unknown.
    pub values: Vec<f64>,
    /// Ticks, in which the noise floor is, by the unit.
    pub ticks_by_unit: f64,
    /// From how much above the rest on a value is a load, in the unit.
    pub loaded_from: f64,
    /// Whether values fall from that of a quiet stretch: less may mean more pressure.
    pub falls: bool,
    /// The cells that flicker: no value of theirs counts as above rest.
    pub flickering: Vec<usize>,
    /// Where something lay in the quiet stretch, for people; empty where nothing did.
    pub preload_at: String,
}

/// The frames of a source as they are given.
#[derive(Debug, Clone)]
pub struct FrameSource<'a> {
    /// Where they are in the array.
    pub area: FrameArea,
    /// Their times, us, ascending.
    pub t: Vec<i64>,
    /// Their values row by row, frame after frame; NaN where one is missing.
    pub values: &'a [f32],
    /// What they are above.
    pub rest: FrameRest,
}

impl FrameSource<'_> {
    /// The rest of the cells in steps, each from the frame of this number on: once where it is fixed, else where it moved.
    #[allow(clippy::cast_possible_truncation)]
    fn rests(&self, steps: ValueSteps) -> Vec<(usize, Vec<u16>)> {
        let FrameRest { source, values, ticks_by_unit, falls, .. } = &self.rest;
        let fixed = |values: &[f64]| values.iter().map(|&value| steps.of_rest(value)).collect();
        match source {
            RestSource::None => return vec![(0, vec![steps.zero; values.len()])],
            RestSource::Given => return vec![(0, fixed(values))],
            RestSource::Quiet => {}
        }
        let begins: Vec<f64> = values.iter().map(|rest| rest * ticks_by_unit).collect();
        let mut tracked = TrackedRest::new(self.area.columns.into(), NOISE_FLOOR, begins);
        if *falls {
            tracked = tracked.falling();
        }
        let mut stored: Vec<Option<f64>> = vec![];
        let mut rests: Vec<(usize, Vec<u16>)> = vec![];
        for (k, (&t, frame)) in self.t.iter().zip(self.values.chunks_exact(values.len())).enumerate() {
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
        if rests.is_empty() { vec![(0, fixed(values))] } else { rests }
    }

    /// The noise floor in steps: values further above the rest count as loaded.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    pub(super) fn floor(&self, steps: ValueSteps) -> u16 {
        (self.rest.loaded_from / steps.size) as u16
    }
}

/// The frames of a source, in steps.
#[derive(Debug, Clone)]
pub(super) struct SteppedFrames {
    pub(super) area: FrameArea,
    pub(super) t: Vec<i64>,
    /// Row by row, frame after frame; [`UNKNOWN`] where a value is missing.
    ticks: Vec<u16>,
    pub(super) rest_source: RestSource,
    pub(super) falls: bool,
    pub(super) flickering: Vec<usize>,
    pub(super) preload_at: String,
    /// The rest of its cells, each from the frame of this number on; there is one at least.
    rests: Vec<(usize, Vec<u16>)>,
}

impl SteppedFrames {
    pub(super) fn new(from: FrameSource<'_>, steps: ValueSteps) -> Self {
        let ticks = from.values.iter().map(|&value| steps.ticks(value)).collect();
        let mut rests = from.rests(steps);
        let FrameRest { source: rest_source, falls, flickering, preload_at, .. } = from.rest;
        for (_, rest) in &mut rests {
            // No value is above the greatest; a taxel without a rest would get that of its first value.
            flickering.iter().for_each(|&cell| rest[cell] = UNKNOWN - 1);
        }
        Self { area: from.area, t: from.t, ticks, rest_source, falls, flickering, preload_at, rests }
    }

    /// The rest of its cells at a frame; before the first one, that of the first.
    pub(super) fn rest(&self, k: usize) -> &[u16] {
        &self.rests[self.rests.partition_point(|&(from, _)| from <= k).max(1) - 1].1
    }

    /// Whether another rest holds from this frame on.
    pub(super) fn rest_moves(&self, k: usize) -> bool {
        k > 0 && self.rests.binary_search_by_key(&k, |&(from, _)| from).is_ok()
    }

    pub(super) fn cells(&self) -> usize {
        usize::from(self.area.rows) * usize::from(self.area.columns)
    }

    pub(super) fn frame(&self, k: usize) -> &[u16] {
        &self.ticks[k * self.cells()..(k + 1) * self.cells()]
    }

    /// Whether a frame has any value.
    pub(super) fn knows(&self, k: usize) -> bool {
        self.frame(k).iter().any(|&ticks| ticks != UNKNOWN)
    }

    /// Number of frames up to a time.
    pub(super) fn until(&self, t: i64) -> usize {
        self.t.partition_point(|&at| at <= t)
    }

    /// The taxels of its cells in an array of `columns` columns, row by row.
    pub(super) fn taxels(&self, columns: u16) -> impl Iterator<Item = usize> + use<> {
        let (left, width, columns) = (self.area.left, self.area.columns, usize::from(columns));
        (0..usize::from(self.area.rows))
            .flat_map(move |y| (0..usize::from(width)).map(move |x| y * columns + usize::from(left) + x))
    }
}
