//! What the array holds at a moment: held values, rest, the largest recent changes, and the last seconds by column of time.
//!
//! The same for live events and for recordings: a state that was begun earlier and one that was begun from a keyframe are
//! equal as soon as [`FORGET`] columns of time have passed.

use std::sync::Arc;

use super::load::Coordinates;
use super::load::Load;
use super::load::Weights;
use super::time_columns::{COLUMN_US, Curve, Curves, Extent, MISSING, TimeColumns, column_of};
use serde::{Deserialize, Serialize};
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

/// Where the rest comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum RestSource {
    /// A tare, or the values held at a moment; 0 of frames of force or pressure.
    Given,
    /// A quiet stretch, from which it is tracked.
    Quiet,
    /// There was no quiet stretch so far: the taxels' first values, from which it is tracked; 0 of frames.
    None,
}

impl Keyframe {
    /// A sensor of which nothing is known.
    #[must_use]
    pub fn blank(taxels: usize) -> Self {
        Self { latest: None, events: 0, held: vec![UNKNOWN; taxels], rest: vec![UNKNOWN; taxels], tracked: None }
    }
}

/// The first time after `t` at which the rest is tracked, us.
fn next_track(t: i64) -> i64 {
    (t.div_euclid(TRACK_US) + 1).saturating_mul(TRACK_US)
}

/// A rest that is tracked from these values on.
fn tracked_from(columns: usize, values: &[u16]) -> TrackedRest {
    let rest = |&value: &u16| if value == UNKNOWN { f64::NO_REST } else { value.into() };
    TrackedRest::new(columns, NOISE_FLOOR, values.iter().map(rest).collect())
}

/// Held values, rest and recent changes of every taxel, with raster and curves by column of time.
#[derive(Debug, Clone)]
pub struct ArrayState {
    /// Column and row of each taxel, looked up because a division per change would dominate the cost.
    positions: Arc<[(u16, u16)]>,
    floor: u16,
    /// Ticks above rest that count as none in the sums.
    sum_floor: u16,
    columns: usize,
    centre: Coordinates,
    weights: Weights,
    /// Where the rest of frames comes from, if frames are shown ([`ArrayState::of_frames`]).
    frames: Option<RestSource>,
    held: Held,
    rest: Rest<u16>,
    /// The rest as it is tracked; `None` where it was given.
    tracked: Option<Box<TrackedRest>>,
    /// That of the first quiet stretch.
    first_quiet: Option<Vec<f64>>,
    /// When the rest is tracked next, us.
    track_at: Option<i64>,
    /// Number of changes of the rest.
    rests: u64,
    change: Vec<i8>,
    time_columns: TimeColumns,
    column_us: i64,
    /// The curves of the current column of time so far.
    during: Curves,
    /// The current column of time.
    column: Option<i64>,
    /// The current column of [`COLUMN_US`], by which changes decay.
    decay_column: i64,
    /// Times that lie in both current columns, us.
    within: std::ops::Range<i64>,
    latest: Option<i64>,
    /// Number of times that time was set back or the board was reset.
    restarts: u64,
    events: u64,
    load: Load,
    /// Number of the source of each column of several sources, and the load of each; else empty.
    source_of: Arc<[usize]>,
    loads: Vec<Load>,
    /// Up to this sum of ticks above rest there is noise alone, and no centre; of each of several sources.
    noise: (u32, Vec<u32>),
}

impl ArrayState {
    /// State of an array, begun from a keyframe; its columns of time are `column_us` wide.
    #[must_use]
    pub fn new(array: &Array, floor: u16, from: &Keyframe, column_us: i64, time_column_bytes: usize) -> Self {
        let columns = usize::from(array.columns).max(1);
        // An array has 65 535 rows and columns at most.
        #[allow(clippy::cast_possible_truncation)]
        let position = |taxel: usize| ((taxel % columns) as u16, (taxel / columns) as u16);
        let time_columns = TimeColumns::new(array, time_column_bytes);
        let mut state = Self {
            positions: (0..from.held.len()).map(position).collect(),
            floor,
            sum_floor: floor,
            columns,
            centre: Coordinates::new(array),
            weights: Weights::default(),
            frames: None,
            held: from.held.clone().into(),
            rest: Rest::measured(from.rest.clone()),
            tracked: Some(from.tracked.clone().unwrap_or_else(|| Box::new(tracked_from(columns, &from.rest)))),
            first_quiet: None,
            track_at: from.latest.map(next_track),
            rests: 1,
            change: vec![0; from.held.len()],
            during: time_columns.no_curves(),
            time_columns,
            column_us,
            column: None,
            decay_column: 0,
            within: 0..0,
            latest: from.latest,
            restarts: 0,
            events: from.events,
            load: Load::default(),
            source_of: Arc::default(),
            loads: vec![],
            noise: (0, vec![]),
        };
        state.sum_above_rest();
        if let Some(t) = from.latest {
            state.advance(t);
        }
        state
    }

    /// The state where frames are shown: the rest is that of the keyframe until [`ArrayState::set_rest`]; a change without
    /// a value is a value that is missing from then on, and frames are counted as events are. The sums have a floor of
    /// steps above rest, the columns of the array are of these sources, and up to these sums, of all and of each, there is
    /// noise alone.
    #[must_use]
    pub(crate) fn of_frames(
        mut self,
        from: &Keyframe,
        rest: RestSource,
        sum_floor: u16,
        weights: &Weights,
        source_of: Arc<[usize]>,
        noise: (u32, Vec<u32>),
    ) -> Self {
        (self.frames, self.sum_floor, self.noise) = (Some(rest), sum_floor, noise);
        (self.weights, self.source_of) = (weights.clone(), source_of);
        self.loads = vec![Load::default(); self.source_of.last().map_or(0, |last| last + 1)];
        self.time_columns = self.time_columns.with_sources(self.loads.len());
        self.during = self.time_columns.no_curves();
        (self.tracked, self.track_at) = (None, None);
        self.rest = Rest::measured(from.rest.clone());
        self.sum_above_rest();
        self
    }

    /// A keyframe of the current state.
    #[must_use]
    pub fn keyframe(&self) -> Keyframe {
        let tracked = self.tracked.clone();
        let (held, rest) = (self.held().to_vec(), self.rest().to_vec());
        Keyframe { latest: self.latest, events: self.events, held, rest, tracked }
    }

    /// Computes the sums above rest from all taxels.
    fn sum_above_rest(&mut self) {
        self.load = Load::default();
        self.loads.fill(Load::default());
        for taxel in 0..self.positions.len() {
            self.change_above_rest(taxel, 0, self.above(taxel));
        }
    }

    /// Ticks of a taxel above rest, as they count in the sums; 0 up to the noise floor.
    fn above(&self, taxel: usize) -> u16 {
        self.rest.above_noise(taxel, self.held.values()[taxel], self.sum_floor)
    }

    /// Updates the sums for a taxel that was `before` ticks above rest and is `now`.
    #[inline(always)]
    fn change_above_rest(&mut self, taxel: usize, before: u16, now: u16) {
        if before == now {
            return;
        }
        self.load.change(taxel, (before, now), self.floor, &self.centre, &self.weights);
        if let Some(&source) = self.source_of.get(usize::from(self.positions[taxel].0)) {
            self.loads[source].change(taxel, (before, now), self.floor, &self.centre, &self.weights);
        }
    }

    /// Applies changes in order; those of one time together, because most of the work is per time.
    pub fn apply(&mut self, changes: &[TaxelChange]) {
        for together in changes.chunk_by(|change, next| change.t == next.t) {
            let t = together[0].t;
            self.advance(t);
            self.events += if self.frames.is_some() { 1 } else { together.len() as u64 };
            together.iter().for_each(|change| self.apply_to_taxel(change));
            let column = match self.column {
                Some(column) if self.within.contains(&t) => column,
                _ => column_of(t, self.column_us),
            };
            self.time_columns
                .count(column, together.iter().map(|change| (self.positions[change.taxel as usize].1, change.up)));
        }
    }

    /// Applies a single change.
    #[cfg(test)]
    pub fn apply_one(&mut self, change: &TaxelChange) {
        self.apply(std::slice::from_ref(change));
    }

    /// Updates the held value, rest and recent change of the taxel of a change.
    #[inline]
    fn apply_to_taxel(&mut self, change: &TaxelChange) {
        let taxel = change.taxel as usize;
        if change.ticks == UNKNOWN && self.frames.is_some() {
            let above = self.above(taxel);
            self.held.set(taxel, UNKNOWN);
            return self.change_above_rest(taxel, above, 0);
        }
        if change.ticks == UNKNOWN {
            let size = if change.up { UNVALUED } else { -UNVALUED };
            self.change[taxel] = self.change[taxel].saturating_add(size).max(-127);
            return;
        }
        let above = self.above(taxel);
        let before = self.held.set(taxel, change.ticks);
        // The first value of a taxel is not a change.
        let moved = if before == UNKNOWN { 0 } else { i32::from(change.ticks) - i32::from(before) };
        #[allow(clippy::cast_possible_truncation)]
        let size = moved.clamp(-127, 127) as i8;
        let largest = self.change[taxel];
        self.change[taxel] = if size.unsigned_abs() >= largest.unsigned_abs() { size } else { largest };
        self.begin_rest(taxel, change.ticks);
        self.change_above_rest(taxel, above, self.above(taxel));
    }

    /// Makes the first value of a taxel its rest, which is tracked from there.
    #[inline]
    fn begin_rest(&mut self, taxel: usize, ticks: u16) {
        if self.rest.follow(taxel, ticks) {
            self.rests += 1;
            if let Some(tracked) = &mut self.tracked {
                tracked.begin(taxel, ticks.into());
            }
        }
    }

    /// Moves time forward, with the rest that is tracked; an earlier time does nothing.
    pub fn advance(&mut self, t: i64) {
        let mut steps = 0;
        while let Some(at) = self.track_at.filter(|&at| at <= t) {
            // The values do not change any more before `t`.
            steps += 1;
            let at = if steps < TRACK_STEPS { at } else { next_track(t) - TRACK_US };
            self.move_to(at);
            self.track(at);
        }
        self.move_to(t);
        if self.track_at.is_none() {
            self.track_at = Some(next_track(t));
        }
    }

    /// Reads the held values for the rest, at `t` us.
    fn track(&mut self, t: i64) {
        self.track_at = Some(next_track(t));
        let Some(tracked) = &mut self.tracked else { return };
        let value = |&held: &u16| if held == UNKNOWN { f32::NAN } else { f32::from(held) };
        tracked.take(t, self.held.values().iter().map(value));
        if self.first_quiet.is_none() && tracked.quiet().is_some() {
            self.first_quiet = Some(tracked.begins().to_vec());
        }
        let mut changed = false;
        for (taxel, rest) in tracked.rests().enumerate() {
            // The rest follows values of 16 bits.
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
            if let Some(rest) = rest {
                changed |= self.rest.track(taxel, rest.round() as u16);
            }
        }
        if changed {
            self.rests += 1;
            self.sum_above_rest();
        }
    }

    fn move_to(&mut self, t: i64) {
        if self.latest.is_some_and(|latest| t < latest) {
            return;
        }
        if self.latest.is_some_and(|latest| t > latest) {
            // What holds now has held since the latest time.
            self.extend_curves();
        }
        self.latest = Some(t);
        if self.within.contains(&t) {
            return;
        }
        let (column, decay_column) = (column_of(t, self.column_us), column_of(t, COLUMN_US));
        match self.column {
            None => self.decay_column = decay_column,
            Some(now) if now == column => {}
            Some(now) => {
                self.store_curves(now);
                self.during = self.time_columns.no_curves();
                if t > column * self.column_us {
                    self.extend_curves();
                }
            }
        }
        for _ in 0..(decay_column - self.decay_column).min(FORGET) {
            for change in &mut self.change {
                // Towards 0, so that 1 becomes 0.
                #[allow(clippy::cast_possible_truncation)]
                {
                    *change = (i16::from(*change) * 15 / 16) as i8;
                }
            }
        }
        self.enter_column(column, decay_column);
    }

    /// Makes these the current columns.
    fn enter_column(&mut self, column: i64, decay_column: i64) {
        (self.column, self.decay_column) = (Some(column), decay_column);
        let begin = (column * self.column_us).max(decay_column * COLUMN_US);
        self.within = begin..((column + 1) * self.column_us).min((decay_column + 1) * COLUMN_US);
        self.time_columns.extend_to(column);
    }

    /// Sets time back after it had been moved forward through an assumed silence; a later time does nothing.
    pub fn set_back(&mut self, t: i64) {
        if self.latest.is_none_or(|latest| latest <= t) {
            return;
        }
        self.latest = Some(t);
        self.track_at = Some(next_track(t));
        let column = column_of(t, self.column_us);
        self.time_columns.truncate_after(column);
        if self.column != Some(column) {
            self.during = self.time_columns.no_curves();
            self.time_columns.join_curves(column..column + 1, &mut self.during.sums, &mut self.during.channels);
        }
        self.enter_column(column, column_of(t, COLUMN_US));
        self.restarts += 1;
    }

    /// Clears all held values after a reset of the board: they are unknown until the next event of each taxel.
    pub fn clear(&mut self) {
        self.held.clear();
        self.sum_above_rest();
        self.restarts += 1;
    }

    /// Number of times that time was set back or the board was reset.
    #[must_use]
    pub fn restarts(&self) -> u64 {
        self.restarts
    }

    /// Sets all held values where events are missing; `events` is the number of events up to now.
    pub fn set_held(&mut self, held: &[u16], events: u64) {
        self.held.values_mut().copy_from_slice(held);
        self.events = events;
        for (taxel, &held) in held.iter().enumerate().filter(|(_, held)| **held != UNKNOWN) {
            self.begin_rest(taxel, held);
        }
        self.sum_above_rest();
    }

    /// Sets the rest of one taxel, until the rest of all taxels is set.
    pub fn zero(&mut self, taxel: usize, rest: u16) {
        let above = self.above(taxel);
        self.rest.set(taxel, rest);
        self.rests += 1;
        self.change_above_rest(taxel, above, self.above(taxel));
    }

    /// Sets the rest of all taxels; [`UNKNOWN`] for those whose first value it is.
    pub fn set_rest(&mut self, rest: Vec<u16>) {
        self.rest = Rest::measured(rest);
        self.tracked = None;
        self.rests += 1;
        self.sum_above_rest();
    }

    /// Tracks the rest of all taxels from their held values on.
    pub fn track_rest(&mut self) {
        let held = self.held().to_vec();
        self.tracked = Some(Box::new(tracked_from(self.columns, &held)));
        self.rest = Rest::measured(held);
        self.rests += 1;
        self.sum_above_rest();
    }

    /// Where the rest comes from.
    #[must_use]
    pub fn rest_source(&self) -> RestSource {
        match (self.frames, &self.tracked) {
            (Some(source), _) => source,
            (None, None) => RestSource::Given,
            (None, Some(tracked)) if tracked.quiet().is_some() => RestSource::Quiet,
            (None, Some(_)) => RestSource::None,
        }
    }

    /// By how much each taxel rested lower later than in the first quiet stretch, ticks; not a number where it had no rest
    /// then. Empty without such a stretch.
    #[must_use]
    pub(crate) fn rests_less(&self) -> Vec<f64> {
        let first = self.first_quiet.as_deref().unwrap_or_default();
        let lowest = self.tracked.as_ref().map_or(&[][..], |tracked| tracked.begins());
        let less = |(first, lowest): (&f64, &f64)| if first.is_finite() { first - lowest } else { f64::NAN };
        first.iter().zip(lowest).map(less).collect()
    }

    /// Copies rest and noise floor from another state of the same source, where they differ.
    pub fn copy_rest(&mut self, from: &Self) {
        if self.floor != from.floor || self.rest != from.rest {
            (self.floor, self.sum_floor) = (from.floor, from.sum_floor);
            self.rest.clone_from(&from.rest);
            self.tracked.clone_from(&from.tracked);
            self.sum_above_rest();
        }
    }

    /// Sets the noise floor: ticks above rest that count as none.
    pub fn set_noise_floor(&mut self, floor: u16) {
        (self.floor, self.sum_floor) = (floor, floor);
        self.sum_above_rest();
    }

    /// Held value of each taxel.
    #[must_use]
    pub fn held(&self) -> &[u16] {
        self.held.values()
    }

    /// Value of each taxel at rest.
    #[must_use]
    pub fn rest(&self) -> &[u16] {
        self.rest.values()
    }

    /// Number of changes of the rest.
    #[must_use]
    pub fn rests(&self) -> u64 {
        self.rests
    }

    /// The largest recent change of each taxel, ticks, decaying.
    #[must_use]
    pub fn change(&self) -> &[i8] {
        &self.change
    }

    /// Board time of the state, us.
    #[must_use]
    pub fn latest(&self) -> Option<i64> {
        self.latest
    }

    /// Number of events so far.
    #[must_use]
    pub fn events(&self) -> u64 {
        self.events
    }

    /// The curve of all taxels (0), or of one of several sources, at this time.
    #[must_use]
    pub fn curve(&self, number: usize) -> Curve {
        let curve = |load: &Load, noise: u32| load.curve(&self.centre, &self.weights, noise);
        match number.checked_sub(1) {
            None if self.frames.is_some() && self.held.values().iter().all(|&value| value == UNKNOWN) => MISSING,
            None => curve(&self.load, self.noise.0),
            Some(source) if self.knows(source) => {
                curve(&self.loads[source], self.noise.1.get(source).copied().unwrap_or(0))
            }
            Some(_) => MISSING,
        }
    }

    /// The curves of all taxels and of each of several sources, at this time.
    pub fn curves(&self) -> impl Iterator<Item = Curve> {
        (0..=self.loads.len()).map(|number| self.curve(number))
    }

    /// Writes the curves of the current column up to now.
    pub fn update_curve(&mut self) {
        if let Some(now) = self.column {
            self.extend_curves();
            self.store_curves(now);
        }
    }

    /// Extends the curves of the current column to what holds now.
    fn extend_curves(&mut self) {
        let mut during = std::mem::replace(&mut self.during, Curves { sums: vec![], channels: vec![] });
        self.extend(&mut during);
        self.during = during;
    }

    fn extend(&self, curves: &mut Curves) {
        curves
            .sums
            .iter_mut()
            .zip(self.curves())
            .for_each(|(extent, curve): (&mut Extent, Curve)| extent.extend(&curve));
        for (channel, all) in curves.channels.iter_mut().enumerate() {
            let above = self.above(channel);
            *all = (all.0.min(above), all.1.max(above));
        }
    }

    /// Writes the curves of a column that ends, or of the current one, and what holds after it.
    fn store_curves(&mut self, column: i64) {
        let mut after = self.time_columns.no_curves();
        self.extend(&mut after);
        self.time_columns.set_curves(column, &self.during, &after);
    }

    /// Whether any taxel of a source has a value.
    fn knows(&self, source: usize) -> bool {
        let mut held = self.positions.iter().zip(self.held.values());
        held.any(|(&(x, _), &held)| held != UNKNOWN && self.source_of[usize::from(x)] == source)
    }

    /// Raster and curves; the current column is as of the last [`ArrayState::update_curve`].
    #[must_use]
    pub fn time_columns(&self) -> &TimeColumns {
        &self.time_columns
    }
}

#[cfg(test)]
mod tests;
