//! What the array holds at a moment: held values, rest, the largest recent changes, and the last seconds by column of time.
//!
//! The same for live events and for recordings: a state that was begun earlier and one that was begun from a keyframe are
//! equal as soon as [`FORGET`] columns of time have passed.

use std::ops::Range;
use std::sync::Arc;

use crate::block::Block;
use crate::columns::{COLUMN_US, Curve, Curves, MISSING, TimeColumns, column_of};
use crate::frame_values::{Frames, RestSource};
use crate::load::{Coordinates, Load, Weights};
use taxel_core::Array;
use taxel_core::held::{Held, UNKNOWN};
use taxel_core::rest::{NOISE_FLOOR, Rest, TrackedRest, Value};
use taxel_live::pipeline::TaxelChange;

/// Columns of [`COLUMN_US`] after which a change has decayed: 127, less a sixteenth per column, is then 0.
pub const FORGET: i64 = 64;

/// How often the rest is tracked, us: a multiple of the width of the columns of time.
const TRACK_US: i64 = 64_000;

/// Most steps of the rest during a silence; the rest of a longer one is a single step.
const TRACK_STEPS: i64 = 64;

/// Size of a change whose event has no value.
const UNVALUED: i8 = 16;

/// State of an array at a moment, from which an [`ArrayState`] can begin.
#[derive(Debug, Clone, PartialEq)]
pub struct Keyframe {
    /// Board time of the latest event, us; `None` before the first.
    pub latest: Option<i64>,
    /// Number of events up to there.
    pub events: u64,
    /// Held value of each taxel; [`UNKNOWN`] before its first event.
    pub held: Vec<u16>,
    /// Value of each taxel at rest.
    pub rest: Vec<u16>,
    /// How that rest was found; `None`: it is tracked anew from there.
    pub tracked: Option<Box<TrackedRest>>,
}

impl Keyframe {
    /// A sensor of which nothing is known.
    pub fn blank(taxels: usize) -> Self {
        Self { latest: None, events: 0, held: vec![UNKNOWN; taxels], rest: vec![UNKNOWN; taxels], tracked: None }
    }

    /// Memory that it takes, about.
    pub(crate) fn bytes(&self) -> usize {
        // Beside held values and rest it stores how the rest is tracked.
        self.held.len() * if self.tracked.is_some() { 64 } else { 4 }
    }
}

/// The first time after `t` at which the rest is tracked, us.
fn next_track(t: i64) -> i64 {
    (t.div_euclid(TRACK_US) + 1).saturating_mul(TRACK_US)
}

/// A sensor and its values, which are the same at all times.
#[derive(Debug)]
pub struct Sensor {
    /// Its taxels.
    pub array: Array,
    /// The noise floor, ticks above rest, until another one is set.
    pub floor: u16,
    /// What its values are, if they come in frames.
    pub frames: Option<Frames>,
    /// Column and row of each taxel, looked up because a division per change would dominate the cost.
    positions: Box<[(u16, u16)]>,
    centre: Coordinates,
    weights: Weights,
}

impl Sensor {
    /// A sensor of events, or of frames.
    pub fn new(array: Array, floor: u16, frames: Option<Frames>) -> Self {
        let position = |y: u16| (0..array.columns).map(move |x| (x, y));
        let weights = frames.as_ref().map_or_else(Weights::default, |frames| Weights::new(&array, &frames.unit).0);
        Self {
            positions: (0..array.rows).flat_map(position).collect(),
            centre: Coordinates::new(&array),
            weights,
            array,
            floor,
            frames,
        }
    }

    /// Column and row of a taxel.
    pub fn position(&self, taxel: usize) -> (u16, u16) {
        self.positions[taxel]
    }

    /// Number of sources that have a curve each.
    pub fn curves(&self) -> usize {
        self.frames.as_ref().map_or(0, |frames| if frames.source_of.is_empty() { 0 } else { frames.sources.len() })
    }

    /// Number of the source of a taxel, where each has a curve.
    fn source_of(&self, taxel: usize) -> Option<usize> {
        self.frames.as_ref()?.source_of.get(usize::from(self.positions[taxel].0)).copied()
    }
}

/// The rest of each taxel.
#[derive(Debug, Clone)]
struct CurrentRest {
    values: Rest<u16>,
    /// How it is tracked; `None` where it was given, and of frames.
    tracked: Option<Box<TrackedRest>>,
    /// That of the first quiet stretch.
    first_quiet: Option<Vec<f64>>,
    /// When it is tracked next, us.
    track_at: Option<i64>,
}

/// The largest recent change of each taxel, ticks, decaying.
#[derive(Debug, Clone)]
struct RecentChanges {
    sizes: Vec<i8>,
    /// The current column of [`COLUMN_US`], by which they decay.
    column: Option<i64>,
}

impl RecentChanges {
    fn note(&mut self, taxel: usize, size: i8) {
        let largest = &mut self.sizes[taxel];
        if size.unsigned_abs() >= largest.unsigned_abs() {
            *largest = size;
        }
    }

    fn decay_to(&mut self, column: i64) {
        let passed = self.column.map_or(0, |before| (column - before).min(FORGET));
        for _ in 0..passed {
            for size in &mut self.sizes {
                // Towards 0, so that 1 becomes 0.
                {
                    *size = (i16::from(*size) * 15 / 16) as i8;
                }
            }
        }
    }
}

/// Raster and curves by column of time.
#[derive(Debug, Clone)]
struct CurrentColumns {
    us: i64,
    all: TimeColumns,
    /// The current one, and its curves so far.
    column: Option<i64>,
    during: Curves,
}

/// Held values, rest and recent changes of every taxel, with raster and curves by column of time.
#[derive(Debug, Clone)]
pub struct ArrayState {
    /// The sensor.
    pub sensor: Arc<Sensor>,
    held: Held,
    rest: CurrentRest,
    /// Ticks above rest up to which a taxel is not loaded, and those that count as none in the sums.
    floor: u16,
    sum_floor: u16,
    recent: RecentChanges,
    /// The load of all taxels, and of each of several sources.
    loads: Vec<Load>,
    columns: CurrentColumns,
    /// Board time of the state, us.
    pub latest: Option<i64>,
    /// Times that lie in the current columns, us.
    within: Range<i64>,
    /// Number of events so far.
    pub events: u64,
    /// Number of times that time was set back or the board was reset.
    pub restarts: u64,
}

impl ArrayState {
    /// State of a sensor, begun from a keyframe; so many columns of time, `column_us` wide, are stored at most. The rest of frames
    /// is that of the keyframe until [`ArrayState::set_rest`]; that of events is tracked.
    pub fn new(sensor: &Arc<Sensor>, from: &Keyframe, column_us: i64, most: i64) -> Self {
        let frames = sensor.frames.as_ref();
        let tracked = frames.is_none().then(|| {
            let rest = |&value: &u16| if value == UNKNOWN { f64::NO_REST } else { value.into() };
            let begins = || from.rest.iter().map(rest).collect();
            let anew = || Box::new(TrackedRest::new(sensor.array.columns.into(), NOISE_FLOOR, begins()));
            from.tracked.clone().unwrap_or_else(anew)
        });
        let all = TimeColumns::new(&sensor.array, sensor.curves(), most);
        let mut state = Self {
            sensor: Arc::clone(sensor),
            held: from.held.clone().into(),
            rest: CurrentRest {
                values: Rest::measured(from.rest.clone()),
                tracked,
                first_quiet: None,
                track_at: from.latest.map(next_track),
            },
            floor: sensor.floor,
            sum_floor: frames.map_or(sensor.floor, |frames| frames.sum_floor),
            recent: RecentChanges { sizes: vec![0; from.held.len()], column: None },
            loads: vec![Load::default(); 1 + sensor.curves()],
            columns: CurrentColumns { us: column_us, during: all.no_curves(), all, column: None },
            latest: from.latest,
            within: 0..0,
            events: from.events,
            restarts: 0,
        };
        state.sum_above_rest();
        if let Some(t) = from.latest {
            state.advance(t);
        }
        state
    }

    /// The same with the columns of the whole source before column `from`.
    pub fn after(mut self, whole: Arc<TimeColumns>, from: i64) -> Self {
        self.columns.all = self.columns.all.after(whole, from);
        self
    }

    /// A keyframe of the current state.
    pub fn keyframe(&self) -> Keyframe {
        let tracked = self.rest.tracked.clone();
        let (held, rest) = (self.held().to_vec(), self.rest().to_vec());
        Keyframe { latest: self.latest, events: self.events, held, rest, tracked }
    }

    /// Computes the sums above rest from all taxels.
    fn sum_above_rest(&mut self) {
        self.loads.fill(Load::default());
        for taxel in 0..self.sensor.positions.len() {
            self.change_above_rest(taxel, 0, self.above(taxel));
        }
    }

    /// Ticks of a taxel above rest, as they count in the sums; 0 up to the noise floor.
    fn above(&self, taxel: usize) -> u16 {
        self.rest.values.above_noise(taxel, self.held.values()[taxel], self.sum_floor)
    }

    /// Updates the sums for a taxel that was `before` ticks above rest and is `now`.
    #[inline(always)]
    fn change_above_rest(&mut self, taxel: usize, before: u16, now: u16) {
        if before == now {
            return;
        }
        let Sensor { centre, weights, .. } = &*self.sensor;
        self.loads[0].change(taxel, (before, now), self.floor, centre, weights);
        if self.loads.len() > 1
            && let Some(source) = self.sensor.source_of(taxel)
        {
            self.loads[1 + source].change(taxel, (before, now), self.floor, centre, weights);
        }
    }

    /// Applies a whole block.
    pub fn take(&mut self, block: &Block) {
        self.begin_block(block);
        self.apply(&block.changes);
        self.end_block(block);
    }

    /// Sets the held values where changes are missing before a block.
    pub fn begin_block(&mut self, block: &Block) {
        if let Some((held, events)) = &block.held {
            self.held.values_mut().copy_from_slice(held);
            self.events = *events;
            for (taxel, &held) in held.iter().enumerate().filter(|(_, held)| **held != UNKNOWN) {
                self.begin_rest(taxel, held);
            }
            self.sum_above_rest();
        }
    }

    /// Sets the rest that holds after a block.
    pub fn end_block(&mut self, block: &Block) {
        if let Some(rest) = &block.rest {
            self.set_rest(rest.clone());
        }
    }

    /// Applies changes in order; those of one time together, because most of the work is per time.
    pub fn apply(&mut self, changes: &[TaxelChange]) {
        for together in changes.chunk_by(|change, next| change.t == next.t) {
            let t = together[0].t;
            self.advance(t);
            self.events += if self.sensor.frames.is_some() { 1 } else { together.len() as u64 };
            together.iter().for_each(|change| self.apply_to_taxel(change));
            let column = match self.columns.column {
                Some(column) if self.within.contains(&t) => column,
                _ => column_of(t, self.columns.us),
            };
            let positions = &self.sensor.positions;
            self.columns
                .all
                .count(column, together.iter().map(|change| (positions[change.taxel as usize].1, change.up)));
        }
    }

    /// Updates the held value, rest and recent change of the taxel of a change.
    #[inline]
    fn apply_to_taxel(&mut self, change: &TaxelChange) {
        let taxel = change.taxel as usize;
        if change.ticks == UNKNOWN && self.sensor.frames.is_some() {
            let above = self.above(taxel);
            self.held.set(taxel, UNKNOWN);
            return self.change_above_rest(taxel, above, 0);
        }
        if change.ticks == UNKNOWN {
            let size = if change.up { UNVALUED } else { -UNVALUED };
            let sum = &mut self.recent.sizes[taxel];
            *sum = sum.saturating_add(size).max(-127);
            return;
        }
        let above = self.above(taxel);
        let before = self.held.set(taxel, change.ticks);
        // The first value of a taxel is not a change.
        let moved = if before == UNKNOWN { 0 } else { i32::from(change.ticks) - i32::from(before) };
        self.recent.note(taxel, moved.clamp(-127, 127) as i8);
        self.begin_rest(taxel, change.ticks);
        self.change_above_rest(taxel, above, self.above(taxel));
    }

    /// Makes the first value of a taxel its rest, which is tracked from there.
    #[inline]
    fn begin_rest(&mut self, taxel: usize, ticks: u16) {
        if self.rest.values.follow(taxel, ticks)
            && let Some(tracked) = &mut self.rest.tracked
        {
            tracked.begin(taxel, ticks.into());
        }
    }

    /// Moves time forward, with the rest that is tracked; an earlier time does nothing.
    pub fn advance(&mut self, t: i64) {
        let mut steps = 0;
        while let Some(at) = self.rest.track_at.filter(|&at| at <= t) {
            // The values do not change any more before `t`.
            steps += 1;
            let at = if steps < TRACK_STEPS { at } else { next_track(t) - TRACK_US };
            self.move_to(at);
            self.track(at);
        }
        self.move_to(t);
        if self.rest.track_at.is_none() {
            self.rest.track_at = Some(next_track(t));
        }
    }

    /// Reads the held values for the rest, at `t` us.
    fn track(&mut self, t: i64) {
        self.rest.track_at = Some(next_track(t));
        let Some(tracked) = &mut self.rest.tracked else { return };
        let value = |&held: &u16| if held == UNKNOWN { f32::NAN } else { f32::from(held) };
        tracked.take(t, self.held.values().iter().map(value));
        if self.rest.first_quiet.is_none() && tracked.quiet().is_some() {
            self.rest.first_quiet = Some(tracked.begins().to_vec());
        }
        let mut changed = false;
        for (taxel, rest) in tracked.rests().enumerate() {
            // The rest follows values of 16 bits.
            if let Some(rest) = rest {
                changed |= self.rest.values.track(taxel, rest.round() as u16);
            }
        }
        if changed {
            self.sum_above_rest();
        }
    }

    fn move_to(&mut self, t: i64) {
        if self.latest.is_some_and(|latest| t < latest) {
            return;
        }
        if self.latest.is_some_and(|latest| t > latest) {
            // What holds now has held since the latest time.
            self.extend_during();
        }
        self.latest = Some(t);
        if self.within.contains(&t) {
            return;
        }
        let column = column_of(t, self.columns.us);
        if let Some(before) = self.columns.column.filter(|&before| before != column) {
            let now = self.extended(self.columns.all.no_curves());
            self.columns.all.set_curves(before, &self.columns.during);
            self.columns.all.set_curves(before + 1, &now);
            self.columns.during = if t > column * self.columns.us { now } else { self.columns.all.no_curves() };
        }
        let of_changes = column_of(t, COLUMN_US);
        self.recent.decay_to(of_changes);
        self.enter_columns(column, of_changes);
    }

    /// Makes these the current columns.
    fn enter_columns(&mut self, column: i64, of_changes: i64) {
        let us = self.columns.us;
        (self.columns.column, self.recent.column) = (Some(column), Some(of_changes));
        self.within = (column * us).max(of_changes * COLUMN_US)..((column + 1) * us).min((of_changes + 1) * COLUMN_US);
        self.columns.all.extend_to(column);
    }

    /// Sets time back after it had been moved forward through an assumed silence; a later time does nothing.
    pub fn set_back(&mut self, t: i64) {
        if self.latest.is_none_or(|latest| latest <= t) {
            return;
        }
        self.latest = Some(t);
        self.rest.track_at = Some(next_track(t));
        let column = column_of(t, self.columns.us);
        self.columns.all.truncate_after(column);
        if self.columns.column != Some(column) {
            self.columns.during = self.columns.all.curves(column);
        }
        self.enter_columns(column, column_of(t, COLUMN_US));
        self.restarts += 1;
    }

    /// Clears all held values after a reset of the board: they are unknown until the next event of each taxel.
    pub fn clear(&mut self) {
        self.held.clear();
        self.sum_above_rest();
        self.restarts += 1;
    }

    /// Sets the rest of one taxel, until the rest of all taxels is set.
    pub fn zero(&mut self, taxel: usize, rest: u16) {
        let above = self.above(taxel);
        self.rest.values.set(taxel, rest);
        self.change_above_rest(taxel, above, self.above(taxel));
    }

    /// Sets the rest of all taxels; [`UNKNOWN`] for those whose first value it is.
    pub fn set_rest(&mut self, rest: Vec<u16>) {
        (self.rest.values, self.rest.tracked) = (Rest::measured(rest), None);
        self.sum_above_rest();
    }

    /// Where the rest comes from.
    pub fn rest_source(&self) -> RestSource {
        match (&self.sensor.frames, &self.rest.tracked) {
            (Some(frames), _) => frames.rest_source,
            (None, None) => RestSource::Given,
            (None, Some(tracked)) if tracked.quiet().is_some() => RestSource::Quiet,
            (None, Some(_)) => RestSource::None,
        }
    }

    /// By how much each taxel rested lower later than in the first quiet stretch, ticks; not a number where it had no rest
    /// then. Empty without such a stretch.
    pub(crate) fn rests_less(&self) -> Vec<f64> {
        let first = self.rest.first_quiet.as_deref().unwrap_or_default();
        let lowest = self.rest.tracked.as_ref().map_or(&[][..], |tracked| tracked.begins());
        let less = |(first, lowest): (&f64, &f64)| if first.is_finite() { first - lowest } else { f64::NAN };
        first.iter().zip(lowest).map(less).collect()
    }

    /// Sets the noise floor: ticks above rest that count as none.
    pub fn set_noise_floor(&mut self, floor: u16) {
        (self.floor, self.sum_floor) = (floor, floor);
        self.sum_above_rest();
    }

    /// Held value of each taxel.
    pub fn held(&self) -> &[u16] {
        self.held.values()
    }

    /// Value of each taxel at rest.
    pub fn rest(&self) -> &[u16] {
        self.rest.values.values()
    }

    /// The largest recent change of each taxel, ticks, decaying.
    pub fn change(&self) -> &[i8] {
        &self.recent.sizes
    }

    /// The curves of all taxels and of each of several sources, at this time.
    pub fn curves(&self) -> impl Iterator<Item = Curve> {
        let Sensor { frames, centre, weights, .. } = &*self.sensor;
        self.loads.iter().enumerate().map(move |(number, load)| {
            let missing = frames.is_some() && !self.knows(number.checked_sub(1));
            if missing { MISSING } else { load.curve(centre, weights) }
        })
    }

    /// Whether any taxel, or any of a source, has a value.
    fn knows(&self, source: Option<usize>) -> bool {
        let mut held = self.held.values().iter().enumerate();
        held.any(|(taxel, &held)| held != UNKNOWN && (source.is_none() || self.sensor.source_of(taxel) == source))
    }

    /// Writes the curves of the current column up to now.
    pub fn update_curve(&mut self) {
        if let Some(now) = self.columns.column {
            self.extend_during();
            self.columns.all.set_curves(now, &self.columns.during);
        }
    }

    /// Extends the curves of the current column to what holds now.
    fn extend_during(&mut self) {
        let during = std::mem::take(&mut self.columns.during);
        self.columns.during = self.extended(during);
    }

    /// Curves, extended to what holds now.
    fn extended(&self, mut curves: Curves) -> Curves {
        curves.sums.iter_mut().zip(self.curves()).for_each(|(extent, curve)| extent.extend(&curve));
        for (channel, all) in curves.channels.iter_mut().enumerate() {
            let above = self.above(channel);
            *all = (all.0.min(above), all.1.max(above));
        }
        curves
    }

    /// Raster and curves; the current column is as of the last [`ArrayState::update_curve`].
    pub fn columns(&self) -> &TimeColumns {
        &self.columns.all
    }
}

#[cfg(test)]
mod tests;
