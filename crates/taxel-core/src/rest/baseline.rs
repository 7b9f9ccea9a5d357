//! Baselines of the taxels' values: a rest that is tracked, a running mean, or a rest that stays.
//!
//! The tracked rest is the rule for all who need a rest that drifts: it begins at the tare and follows each taxel's
//! value, fast near it and slowly far from it, so that drift is followed and a touch is not. Where it is held, what is far
//! is followed so slowly that a press stays for many minutes.
//!
//! Reading: between two samples the earlier value holds, and it decides whether the taxel is near its rest.

use super::value::{Value, touched_from};
use crate::vectors::wide;

/// Time constant of the tracked rest of a taxel whose value is near it, s.
pub const NEAR_S: f64 = 1.0;

/// Time constant of the tracked rest of a taxel whose value is far from it, s.
pub const FAR_S: f64 = 20.0;

/// Time constant of a rest that is held, of a taxel whose value is far from it, s: a press of ten minutes keeps 85 %.
pub const HELD_S: f64 = 3600.0;

/// Number of standard deviations of a taxel's noise from which its value is far from the tracked rest.
pub const FAR_NOISE: f64 = 5.0;

/// The difference from its rest at which a taxel stands out by `times` its noise, which is at least that of a touch.
#[must_use]
pub fn stands_out_from(times: f64, noise: f64, noise_floor: f64) -> f64 {
    touched_from(0.0, noise_floor).max(times * noise)
}

wide! {
    /// Moves the baselines towards the values that held until now, and subtracts them from the new values.
    fn follow(values: &[f32], baselines: &mut [f64], above: &mut [f32], far: &[f32], held: &[bool], steps: [f32; 3]) {
        let [near_step, far_step, held_step] = steps;
        for ((((&value, baseline), above), &far), &held) in values.iter().zip(baselines).zip(above).zip(far).zip(held) {
            let step = if above.abs() < far { near_step } else if held { held_step } else { far_step };
            *baseline += f64::from(step * *above);
            *above = (f64::from(value) - *baseline) as f32;
        }
    }
}

/// Taxels that have been 0 since the first value: they have no value yet, and count as at rest.
#[derive(Debug, Clone, Default)]
pub struct Waiting(Option<Vec<usize>>);

impl Waiting {
    /// Replaces the next values of these taxels by their rest ([`Value::NO_REST`] if unknown).
    pub fn fill(&mut self, values: &mut [f32], rest: &[impl Copy + Into<f64>]) {
        let is_0 = |&taxel: &usize| values[taxel] == 0.0;
        let waiting = self.0.get_or_insert_with(|| (0..values.len()).filter(is_0).collect());
        waiting.retain(is_0);
        for &taxel in &*waiting {
            let rest = rest[taxel].into();
            values[taxel] = if rest == f64::NO_REST { 0.0 } else { rest as f32 };
        }
    }
}

/// The baseline of each taxel, and the taxels' latest values above it.
#[derive(Debug, Clone, PartialEq)]
pub struct Baseline {
    /// Baselines by taxel; [`Value::NO_REST`] until the first value of a taxel whose baseline is not known.
    baselines: Vec<f64>,
    /// The latest values above the baselines; 0 before the first.
    above: Vec<f32>,
    /// The difference from the baseline from which a value is far.
    far: Vec<f32>,
    /// Whether the baseline is held: see [`Baseline::freeze`].
    held: Vec<bool>,
    /// Time constants of near values, of far ones, and of far ones of a baseline that is held, us.
    tau_us: [f64; 3],
    /// Time of the latest values, us.
    t: Option<i64>,
    /// The time between values for which the steps were computed last, us, and the steps: the part of the difference
    /// by which the baseline moves, by time constant.
    steps: (i64, [f32; 3]),
}

impl Baseline {
    /// The tracked rest: it begins at `rest` ([`Value::NO_REST`] if unknown) and follows values nearer than `far` with
    /// [`NEAR_S`], others with [`FAR_S`]; all in the sensor's unit, one entry per taxel.
    #[must_use]
    pub fn tracked(rest: Vec<f64>, far: Vec<f32>) -> Self {
        Self { far, ..Self::new(rest, [NEAR_S, FAR_S, HELD_S].map(|s| s * 1e6)) }
    }

    /// The rest as it was measured, which stays.
    #[must_use]
    pub fn measured(rest: Vec<f64>) -> Self {
        Self::new(rest, [f64::INFINITY; 3])
    }

    /// The running mean of each value, with a time constant in us; it begins at the first value.
    #[must_use]
    pub fn running(taxels: usize, tau_us: f64) -> Self {
        Self::new(vec![f64::NO_REST; taxels], [tau_us; 3])
    }

    fn new(baselines: Vec<f64>, tau_us: [f64; 3]) -> Self {
        let n = baselines.len();
        let (above, far, held) = (vec![0.0; n], vec![f32::INFINITY; n], vec![false; n]);
        Self { baselines, above, far, held, tau_us, t: None, steps: (0, [0.0; 3]) }
    }

    /// Reads the next values, at `t` us; returns them above their baselines.
    pub fn take(&mut self, t: i64, values: &[f32]) -> &[f32] {
        if self.t.is_none() {
            for (baseline, &value) in self.baselines.iter_mut().zip(values) {
                if *baseline == f64::NO_REST {
                    *baseline = f64::from(value);
                }
            }
        }
        // A clock that steps back moves no baseline.
        let time = t.saturating_sub(self.t.unwrap_or(t)).max(0);
        if time != self.steps.0 {
            self.steps = (time, self.tau_us.map(|tau| -(-(time as f64) / tau).exp_m1() as f32));
        }
        self.t = Some(t);
        follow(values, &mut self.baselines, &mut self.above, &self.far, &self.held, self.steps.1);
        &self.above
    }

    /// The latest values above the baselines.
    #[must_use]
    pub fn above(&self) -> &[f32] {
        &self.above
    }

    /// The baseline of each taxel; [`Value::NO_REST`] if it is not known yet.
    #[must_use]
    pub fn values(&self) -> &[f64] {
        &self.baselines
    }

    /// Sets the baseline of a taxel, which follows its value from there.
    pub fn set(&mut self, taxel: usize, baseline: f64) {
        let before = std::mem::replace(&mut self.baselines[taxel], baseline);
        if self.t.is_some() {
            self.above[taxel] = (before + f64::from(self.above[taxel]) - baseline) as f32;
        }
    }

    /// Makes a taxel's first value its baseline.
    pub fn begin(&mut self, taxel: usize, value: f64) {
        (self.baselines[taxel], self.above[taxel]) = (value, 0.0);
    }

    /// Sets the difference from the baseline from which a taxel's value is far.
    pub fn set_far(&mut self, taxel: usize, far: f32) {
        self.far[taxel] = far;
    }

    /// Holds a taxel's baseline from now on: it follows far values with [`HELD_S`].
    pub fn freeze(&mut self, taxel: usize) {
        self.held[taxel] = true;
    }
}
