//! The rest of frames of numbers, which follows each taxel alone: drift is followed, and a touch is not.
//!
//! Within its noise floor of its rest a taxel's value moves the rest with [`NEAR_S`]: it follows a drift of a noise floor in
//! that time (of 1 to 5 s eight drifting sensors bear each, and not 20 s). Below it for two frames, the rest falls; above it
//! for `absorb_s`, the rest rises, so that an object that lies on the sensor becomes rest; both within half a second. Values
//! are handed on less what the rest moved, so that all who read them may keep the rest that was measured.
//!
//! Reading: between two frames the earlier value holds. A low quantile of the last minutes would swallow presses of half a
//! minute, and a mean while nothing is detected would lose a sensor on which an object lies.

use serde::{Deserialize, Serialize};

use super::baseline::{NEAR_S, Waiting};
use super::value::{TIMES_NOISE, Value, touched_from};
use crate::vectors::wide;
use crate::{Array, Result, problem};

/// Time constant with which a rest falls, or rises at last, s: 95 % of the way in half a second. A wire that is loose for
/// some frames moves it little.
const FAST_S: f64 = 0.5 / 3.0;

/// Within this part of the noise floor a value is at its rest.
const THERE: f32 = 0.25;

/// So many frames below the floor are not chance.
const FRAMES_BELOW: i32 = 2;

/// After so long above the floor a taxel is at rest, where the rest stays and is only watched, s.
const ABSORB_S: f64 = 60.0;

/// So many taxels of a grid are a touch if they are above their rest.
const TOUCH: usize = 2;

/// How the rest of frames follows, as a readout or a plain rule states it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Following {
    /// The noise floor of the training, in the unit of the values; a taxel's is six times its own noise, if that is more.
    pub noise_floor: f64,
    /// How long a load may stay until it becomes rest, s; 0: the rest stays as it was measured.
    pub absorb_s: f64,
}

impl Following {
    /// Checks that the numbers are in their ranges.
    ///
    /// # Errors
    ///
    /// `Problem`, naming the number.
    pub fn check(&self) -> Result<()> {
        let Self { noise_floor, absorb_s } = *self;
        if !(noise_floor >= 0.0 && noise_floor.is_finite()) {
            return Err(problem!("noise_floor"; " is {noise_floor}: must be 0 or more, and finite"));
        }
        if absorb_s != 0.0 && !(1.0..=1800.0).contains(&absorb_s) {
            return Err(problem!("absorb_s"; " is {absorb_s}: must be from 1 to 1800 s, or 0"));
        }
        Ok(())
    }
}

/// Since when the rest of as many taxels as a touch has is outside the noise floor of the tare.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct LeftFloor {
    /// The time of the first frame in which it is, us.
    pub since_us: i64,
    /// How many taxels are, at most.
    pub taxels: usize,
}

wide! {
    /// Moves each rest by what was read above it until now, and takes what it moved off the new values; returns how many
    /// taxels rest outside their floor.
    fn follow(values: &mut [f32], taxels: Taxels<'_>, time_us: i32, absorb_us: i32, steps: [f32; 2]) -> u32 {
        let Taxels { rest, floor, moved, above, count } = taxels;
        let [near_step, fast_step] = steps;
        let mut left = 0;
        let state = moved.iter_mut().zip(above).zip(count);
        for (((value, &rest), &floor), ((moved, above), count)) in values.iter_mut().zip(rest).zip(floor).zip(state) {
            // Only near the rest a count ends: at the floor noise would end it again and again.
            let far = THERE * floor;
            let over = if *above < far { (*count).min(0) } else { *count };
            let beside = if *above > -far { over.max(0) } else { over };
            let longer = if *above >= floor { beside + time_us.min(absorb_us - beside) } else { beside };
            *count = if *above <= -floor { (longer - 1).max(-FRAMES_BELOW) } else { longer };
            let fast = (*count >= absorb_us) | (*count <= -FRAMES_BELOW);
            let step = if fast { fast_step } else if above.abs() < floor { near_step } else { 0.0 };
            *moved += step * *above;
            left += u32::from(moved.abs() >= floor);
            *value -= *moved;
            *above = *value - rest;
        }
        left
    }
}

/// What is kept of each taxel.
struct Taxels<'a> {
    rest: &'a [f32],
    floor: &'a [f32],
    moved: &'a mut [f32],
    above: &'a mut [f32],
    count: &'a mut [i32],
}

/// The rest of each taxel of frames, which follows as [`Following`] states.
#[derive(Debug, Clone)]
pub struct FollowedRest {
    following: Following,
    /// The rest that was measured, and from how far from it on a value is outside the noise floor; 0 and NaN where it is not
    /// known: such a taxel stays as it is.
    rest: Vec<f32>,
    floor: Vec<f32>,
    /// By how much the rest moved.
    moved: Vec<f32>,
    /// The latest values above the rest.
    above: Vec<f32>,
    /// For how long a value has been above the floor, us, or for how many frames below it, negative: at most until the rest
    /// rises or falls.
    count: Vec<i32>,
    /// The values less what the rest moved.
    values: Vec<f32>,
    waiting: Waiting,
    /// The axis of each channel, where the channels are axes of taxels.
    axes: Vec<usize>,
    /// The time of the latest frame, us.
    t: Option<i64>,
    /// As many taxels as a touch has.
    touch: usize,
    left: Option<LeftFloor>,
}

impl FollowedRest {
    /// The rest of an array from a tare on, whose values and noise are `rest` and `noise` by taxel: [`Value::NO_REST`] and
    /// 0 where they are not known.
    #[must_use]
    pub fn new(following: Following, array: &Array, rest: &[f64], noise: &[f64]) -> Self {
        let n = rest.len();
        let mut new = Self {
            following,
            rest: vec![0.0; n],
            floor: vec![f32::NAN; n],
            moved: vec![0.0; n],
            above: vec![0.0; n],
            count: vec![0; n],
            values: vec![0.0; n],
            waiting: Waiting::default(),
            axes: array.axes(),
            t: None,
            touch: if array.has_neighbours() { TOUCH } else { 1 },
            left: None,
        };
        for (taxel, &rest) in rest.iter().enumerate().filter(|(_, rest)| **rest != f64::NO_REST) {
            new.floor[taxel] = new.from(noise[taxel]);
            new.set(taxel, rest);
        }
        new
    }

    /// From how far from its rest on a value of a taxel with this noise is outside the noise floor.
    fn from(&self, noise: f64) -> f32 {
        touched_from(0.0, self.following.noise_floor.max(TIMES_NOISE * noise)) as f32
    }

    /// Reads the next frame, at `t` us; returns its values less what the rest moved. A frame of another size is returned as
    /// it is.
    pub fn take<'a>(&'a mut self, t: i64, frame: &'a [f32]) -> &'a [f32] {
        if frame.len() != self.values.len() {
            return frame;
        }
        self.values.copy_from_slice(frame);
        // A clock that steps back moves no rest.
        let time = t.saturating_sub(self.t.unwrap_or(t)).max(0);
        self.t = Some(t);
        let step = |tau: f64| -(-(time as f64) / (1e6 * tau)).exp_m1() as f32;
        let absorb_us = if self.stays() { ABSORB_S } else { self.following.absorb_s } * 1e6;
        self.waiting.fill(&mut self.values, &self.rest);
        let Self { rest, floor, moved, above, count, axes, .. } = self;
        // The rest of x and y stays while z, which says what is touched, is above its own.
        if axes.iter().zip(&*above).zip(&*floor).any(|((&axis, above), floor)| axis == 2 && above >= floor) {
            axes.iter().zip(&mut *above).filter(|(axis, _)| **axis < 2).for_each(|(_, above)| *above = 0.0);
        }
        let taxels = Taxels { rest, floor, moved, above, count };
        let steps = [NEAR_S, FAST_S].map(step);
        let absorb_us = absorb_us as i32;
        let left = follow(&mut self.values, taxels, time.min(absorb_us.into()) as i32, absorb_us, steps) as usize;
        if left >= self.touch {
            let since = self.left.get_or_insert(LeftFloor { since_us: t, taxels: left });
            since.taxels = since.taxels.max(left);
        }
        if self.stays() { frame } else { &self.values }
    }

    /// Whether the rest stays as it was measured.
    #[must_use]
    pub fn stays(&self) -> bool {
        self.following.absorb_s == 0.0
    }

    /// Since when the sensor at rest is outside its noise floor, if it was so far.
    #[must_use]
    pub fn left(&self) -> Option<LeftFloor> {
        self.left
    }

    /// By how much the rest of a taxel moved; 0 where it stays.
    #[must_use]
    pub fn moved(&self, taxel: usize) -> f64 {
        if self.stays() { 0.0 } else { self.moved[taxel].into() }
    }

    /// Sets the rest of a taxel, which follows from there.
    pub fn set(&mut self, taxel: usize, rest: f64) {
        if self.floor[taxel].is_nan() {
            self.floor[taxel] = self.from(0.0);
        }
        (self.rest[taxel], self.count[taxel]) = (rest as f32, 0);
        (self.moved[taxel], self.above[taxel]) = (0.0, 0.0);
    }
}
