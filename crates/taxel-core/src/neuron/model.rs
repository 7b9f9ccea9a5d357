//! The parameters of an SRM0 neuron, and quantities that depend on the parameters alone.

use serde::{Deserialize, Serialize};

use super::kernel::{Kernel, Shape};
use super::points::{Grid, MOST_LAID_OUT, check_points, points_between};
use super::rounding_ms;
use crate::allowed::Range;
use crate::parameters::parameters;
use crate::{Result, problem};

/// The inputs that still contribute after the neuron's own spike.
///
/// Reading: 6.7 sets the potential to 0 for the refractory time and to the whole linear sum afterwards (`Keep`), while
/// the preceding sentence states that inputs during that time have no effect (`Ignore`); figures 6.9 to 6.11 need
/// `Reset`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum AfterSpike {
    /// All inputs (6.7 as printed).
    #[default]
    Keep,
    /// All inputs except those during the refractory time.
    Ignore,
    /// Only inputs after the end of the refractory time.
    Reset,
}

/// The threshold before the first output spike.
///
/// Reading: 6.9 sets the time of spike number 0 to 0, which raises the threshold from the start. By default taxel
/// raises it only after a real spike (`theta_0`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum FirstThreshold {
    /// `theta_0` until the first spike.
    #[default]
    #[serde(rename = "theta_0")]
    Base,
    /// Raised as though the neuron had fired at the start of the inputs.
    #[serde(rename = "printed")]
    Printed,
}

/// The times at which the potential is compared with the threshold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Time {
    /// Every instant: crossings are computed exactly between the input spikes.
    #[default]
    Continuous,
    /// The points `start + k step_ms`.
    Grid,
}

parameters! {
    /// Parameters of an SRM0 neuron; the defaults are those of Table 6.1.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct Neuron {
        /// The effect of an input spike on the potential.
        pub kernel: Kernel = Kernel::Alpha;
        /// Membrane time constant, ms.
        pub tau: f64 = 15.0, "ms", Range::ABOVE_0;
        /// Synaptic time constant of the double exponential kernel, ms; by default `tau/4`, as for the Tempotron.
        pub tau_s: Option<f64> = None, "ms", Range::ABOVE_0, or tau_s;
        /// Baseline threshold, mV.
        pub theta_0: f64 = 0.3, "mV", Range::ABOVE_0;
        /// Rise of the threshold after a spike, mV.
        pub theta_plus: f64 = 0.2, "mV", Range::FROM_0;
        /// Time constant with which that rise decays, ms; by default `2 tau`, as in Tables 6.1 and 6.2.
        pub tau_rec: Option<f64> = None, "ms", Range::ABOVE_0, or tau_rec;
        /// Absolute refractory time, ms.
        pub refractory: f64 = 3.0, "ms", Range::FROM_0;
        /// The inputs that still contribute after a spike.
        pub after_spike: AfterSpike = AfterSpike::Keep;
        /// The threshold before the first spike.
        pub first_threshold: FirstThreshold = FirstThreshold::Base;
        /// After a spike, none until the potential was below this share of the threshold; on a grid only.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub rearm: Option<f64> = None, "", Range::ABOVE_0.at_most(1.0);
        /// Continuous time or a grid.
        pub time: Time = Time::Continuous;
        /// Step of the grid, ms.
        pub step_ms: f64 = 1.0, "ms", Range::ABOVE_0;
    }
}

/// An input at most this far from the end of a refractory time counts as exactly there, ms: trained neurons fire within
/// 1e-6 ms of their targets, and inputs at whole milliseconds often coincide with such an end.
pub(crate) const AT_EDGE: f64 = 1e-6;
/// A maximum of the potential this far below the threshold still counts as reaching it, mV at `theta_0` = 0.3 mV and in
/// proportion to it: a trained potential touches the threshold only to within rounding.
const TOUCH: f64 = 1e-12;

/// The remaining threshold rise at `t`, mV (6.8): `plus` mV, decaying since `recovering` ms.
///
/// A `recovering` that is negative by rounding alone counts as 0, because `t` can be exactly the end of the refractory
/// time.
pub(super) fn left_of_rise(plus: f64, recovering: f64, tau_rec: f64, t: f64) -> f64 {
    if plus == 0.0 || recovering < -rounding_ms(t) { 0.0 } else { plus * (-recovering / tau_rec).exp() }
}

impl Neuron {
    /// Checks the range of every parameter, and that `tau_s` is below `tau`.
    ///
    /// # Errors
    ///
    /// `Problem`, naming the parameter, its value and what would be right.
    pub fn check(&self) -> Result<()> {
        self.check_ranges()?;
        if self.kernel == Kernel::DoubleExponential && self.tau_s() >= self.tau {
            return Err(problem!("tau_s"; " is {} ms: must be below tau, {} ms", self.tau_s(), self.tau));
        }
        if self.kernel == Kernel::Exponential && self.time == Time::Continuous {
            return Err(problem!(
                "kernel"; " is \"exponential\" and time \"continuous\": its potential changes only in jumps, at \
                 inputs, so it crosses the threshold only at inputs; use time \"grid\" or another kernel"
            ));
        }
        if let (Some(rearm), Time::Continuous) = (self.rearm, self.time) {
            return Err(problem!(
                "rearm"; " is {rearm} and time \"continuous\": the potential is compared with rearm only at grid \
                 points; use time \"grid\""
            ));
        }
        if self.refractory == 0.0 && self.after_spike != AfterSpike::Reset {
            return Err(problem!(
                "refractory"; " is 0 ms: must be above 0 unless after_spike is \"reset\"; otherwise the neuron fires \
                 without end"
            ));
        }
        Ok(())
    }

    /// The unit, in mV, in which `theta_0` is near its default of 0.3, so that numerical tolerances do not depend on
    /// the scale.
    ///
    /// It is a power of 2, so that scaling there and back rounds nothing.
    pub(crate) fn unit(&self) -> f64 {
        (self.theta_0 / Self::default().theta_0).log2().round().exp2()
    }

    /// The neuron with its thresholds in units of `unit` mV.
    pub(crate) fn in_units(&self, unit: f64) -> Self {
        Self { theta_0: self.theta_0 / unit, theta_plus: self.theta_plus / unit, ..self.clone() }
    }

    /// The time constant with which the threshold recovers, ms.
    #[must_use]
    pub fn tau_rec(&self) -> f64 {
        self.tau_rec.unwrap_or(2.0 * self.tau)
    }

    /// The synaptic time constant, ms.
    #[must_use]
    pub fn tau_s(&self) -> f64 {
        self.tau_s.unwrap_or(0.25 * self.tau)
    }

    /// The time after which an input's effect is less than 1 % of its largest value for every kernel, ms. The slowest,
    /// 6.5, falls below 1 % after 7.64 tau.
    #[must_use]
    pub fn memory_ms(&self) -> f64 {
        8.0 * self.tau.max(self.tau_s())
    }

    /// The kernel with its constants.
    #[must_use]
    pub fn shape(&self) -> Shape {
        Shape::new(self.kernel, self.tau, self.tau_s())
    }

    /// The threshold `since` ms after the last spike (6.8), or before the first one if `None`, mV.
    ///
    /// In the refractory time the potential is 0, so the threshold has no effect.
    #[must_use]
    pub fn threshold(&self, since: Option<f64>) -> f64 {
        self.theta_0 + since.map_or(0.0, |t| self.rise(Some(0.0), t))
    }

    /// The remaining threshold rise at `t` after the last spike, mV.
    pub(crate) fn rise(&self, spike: Option<f64>, t: f64) -> f64 {
        spike.map_or(0.0, |spike| left_of_rise(self.theta_plus, t - spike - self.refractory, self.tau_rec(), t))
    }

    /// A function that returns how long before `t` a time is, ms; on a grid that begins at `start` it uses the points'
    /// numbers.
    pub(crate) fn ages(&self, start: f64, t: f64) -> impl Fn(f64) -> f64 + use<> {
        let grid = (self.time == Time::Grid).then(|| Grid::new(start, self.step_ms));
        let time = grid.map(|grid| grid.locate(t));
        move |s| match (grid, time) {
            (Some(grid), Some(time)) => grid.between(grid.locate(s), time),
            _ => t - s,
        }
    }

    /// The number of grid points from `start` to `end`.
    pub(crate) fn points(&self, start: f64, end: f64) -> f64 {
        points_between(start, end, self.step_ms)
    }

    /// Refuses more grid points than fit in memory, before any is allocated.
    pub(crate) fn check_rows(&self, points: f64) -> Result<()> {
        check_points(points, MOST_LAID_OUT, self.step_ms)
    }

    /// A maximum of the potential this far below the threshold still counts as reaching it, mV.
    pub(crate) fn touch(&self) -> f64 {
        TOUCH * self.unit()
    }

    /// Whether an input at `t` is lost, given the last output spike before it.
    pub(crate) fn loses(&self, t: f64, last_spike: Option<f64>) -> bool {
        let Some(spike) = last_spike else { return false };
        match self.after_spike {
            AfterSpike::Keep => false,
            AfterSpike::Ignore => spike + AT_EDGE < t && t <= spike + self.refractory + AT_EDGE,
            AfterSpike::Reset => t <= spike + self.refractory + AT_EDGE,
        }
    }
}
