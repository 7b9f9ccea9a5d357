//! The distance printed in thesis 5.10: absolute differences of smoothed trains, over time.

use serde::{Deserialize, Serialize};

use super::distance::{Distance, Pattern, Ready, sum_over_trains};
use super::merged::merge_spikes;
use super::patterns::Patterns;
use crate::allowed::{Range, ranges};
use crate::parameters::Described;
use crate::{Result, Stop, problem};

/// The absolute difference between two trains, smoothed as in 5.8, integrated over time or summed over the points of a
/// grid.
///
/// The text of 5.10 names a Euclidean norm, but its formula is `sum over t of sqrt((f_a - f_b)^2)`, which is this
/// distance. Between spikes the difference is one decaying exponential of one sign, so integral and sum are exact. Time
/// O(n + m).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VanRossumAbsolute {
    /// Time constant, ms.
    pub tau: f64,
    /// The time that counts, ms: 0 to T in 5.10; by default all time.
    #[serde(default)]
    pub window: Option<(f64, f64)>,
    /// The distance of the points that are summed (ms), from the window's start, both ends included; by default the
    /// integral.
    #[serde(default)]
    pub step_ms: Option<f64>,
}

impl Distance for VanRossumAbsolute {
    fn described() -> Described {
        Described::by(&Self { tau: 1.0, window: None, step_ms: None }, &["tau"], Self::RANGES)
    }

    fn check(&self) -> Result<()> {
        self.check_ranges()?;
        Exposure::check(self.window)
    }

    fn ready<'m>(&'m self, _: &Patterns<'_>, _: Option<&Patterns<'_>>) -> Result<Box<dyn Ready + 'm>> {
        Ok(Box::new(self))
    }
}

impl Ready for &VanRossumAbsolute {
    fn between(&self, a: Pattern<'_>, b: Pattern<'_>, stop: Stop<'_>) -> Result<f64> {
        sum_over_trains(a, b, stop, |a, b| Ok(VanRossumAbsolute::between(self, a, b)))
    }
}

impl VanRossumAbsolute {
    ranges! {
        tau: "ms", Range::ABOVE_0;
        step_ms: "ms", Range::ABOVE_0;
    }

    /// The distance between two ascending trains.
    pub(super) fn between(&self, a: &[f64], b: &[f64]) -> f64 {
        let exposure = Exposure::new(self.tau, self.window, self.step_ms);
        let (mut sum, mut height, mut last) = (0.0_f64, 0.0_f64, f64::NEG_INFINITY);
        for (t, more) in merge_spikes(a, b) {
            if height != 0.0 {
                sum += height.abs() * exposure.between(last, t);
            }
            height = height * (-(t - last) / self.tau).exp() + more;
            last = t;
        }
        if height != 0.0 {
            sum += height.abs() * exposure.between(last, f64::INFINITY);
        }
        sum
    }
}

/// The sum, or integral, of an exponential that starts at 1, over parts of the time that counts.
#[derive(Debug, Clone, Copy)]
pub(super) struct Exposure {
    tau: f64,
    start: f64,
    stop: f64,
    step: Option<f64>,
}

impl Exposure {
    pub(super) fn check(window: Option<(f64, f64)>) -> Result<()> {
        if let Some((start, stop)) = window
            && !(start.is_finite() && stop.is_finite() && start <= stop)
        {
            return Err(problem!("window"; " is {start} to {stop} ms: must be finite, with start not after stop"));
        }
        Ok(())
    }

    pub(super) fn new(tau: f64, window: Option<(f64, f64)>, step: Option<f64>) -> Self {
        let (start, stop) = window.unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
        Self { tau, start, stop, step }
    }

    /// The integral (ms), or the sum over the points, of `exp(-(t - from) / tau)` over `from <= t < to`.
    pub(super) fn between(&self, from: f64, to: f64) -> f64 {
        let fallen = |t: f64| (-(t - from) / self.tau).exp();
        let (first, end) = (from.max(self.start), to.min(self.stop));
        let Some(step) = self.step else {
            return if first < end { self.tau * fallen(first) * -(-(end - first) / self.tau).exp_m1() } else { 0.0 };
        };
        // Points are whole steps from the window's start, or from 0 if the window has none.
        let origin = if self.start.is_finite() { self.start } else { 0.0 };
        let grid_index = |t: f64| ((t - origin) / step).ceil();
        // The stop itself is a point; the time `to` belongs to the following interval.
        let past = if to <= self.stop { grid_index(to) } else { ((self.stop - origin) / step).floor() + 1.0 };
        let least = grid_index(first);
        if least >= past {
            return 0.0;
        }
        fallen(origin + least * step) * (-(past - least) * step / self.tau).exp_m1() / (-step / self.tau).exp_m1()
    }
}
