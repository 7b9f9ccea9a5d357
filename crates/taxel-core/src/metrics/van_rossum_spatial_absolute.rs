//! 5.12 with the formula printed in 5.10: absolute differences summed over taxels and time.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::distance::{Distance, Pattern, Ready};
use super::patterns::Patterns;
use super::van_rossum_absolute::Exposure;
use super::van_rossum_spatial::{SmoothingState, SmoothingKernel, Smoothing};
use crate::allowed::{Range, ranges};
use crate::parameters::Described;
use crate::{Result, Stop};

/// The sum over taxels of `|g_m(a) - g_m(b)|` (5.11), integrated over time or summed over the points of a grid.
///
/// 5.12 prints `sum over n of sqrt(g_n(a) - g_n(b))`; the square under the root and the sum over time are taken from
/// 5.10. Exact, because all differences are one exponential between spikes. Time O(spikes x taxels).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct VanRossumSpatialAbsolute {
    /// Smoothing in time and over the array.
    #[serde(flatten)]
    pub smoothing: Smoothing,
    /// The time that counts, ms: 0 to T in 5.10; by default all time.
    #[serde(default)]
    pub window: Option<(f64, f64)>,
    /// The distance of the points that are summed (ms), from the window's start, both ends included; by default the
    /// integral.
    #[serde(default)]
    pub step_ms: Option<f64>,
}

impl Distance for VanRossumSpatialAbsolute {
    fn described() -> Described {
        Described { ranges: [Smoothing::RANGES, Self::RANGES].concat(), ..Smoothing::described() }
            .or("window", Value::Null)
            .or("step_ms", Value::Null)
    }

    fn check(&self) -> Result<()> {
        self.smoothing.check()?;
        self.check_ranges()?;
        Exposure::check(self.window)
    }

    fn ready<'m>(&'m self, a: &Patterns<'_>, b: Option<&Patterns<'_>>) -> Result<Box<dyn Ready + 'm>> {
        Ok(Box::new(SmoothedAbsolute(self, self.smoothing.smoothing_kernel(a, b)?)))
    }
}

struct SmoothedAbsolute<'m>(&'m VanRossumSpatialAbsolute, SmoothingKernel);

impl Ready for SmoothedAbsolute<'_> {
    fn between(&self, a: Pattern<'_>, b: Pattern<'_>, stop: Stop<'_>) -> Result<f64> {
        self.0.between(&self.1, a, b, stop)
    }
}

impl VanRossumSpatialAbsolute {
    ranges! {
        step_ms: "ms", Range::ABOVE_0;
    }

    /// The distance between two patterns.
    pub(super) fn between(&self, kernel: &SmoothingKernel, a: Pattern<'_>, b: Pattern<'_>, stop: Stop<'_>) -> Result<f64> {
        let tau = self.smoothing.tau;
        let exposure = Exposure::new(tau, self.window, self.step_ms);
        let mut sum = 0.0;
        kernel
            .walk(tau, a, b, SmoothingState::Absolutes, stop, |height, from, to| sum += height * exposure.between(from, to))?;
        Ok(sum)
    }
}
