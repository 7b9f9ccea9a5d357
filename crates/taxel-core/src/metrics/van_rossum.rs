//! Van Rossum distance: Euclidean, between trains smoothed by an exponential; in closed form.

mod matrix;

use serde::{Deserialize, Serialize};

use super::distance::{Distance, Ready};
use super::merged::merge_spikes;
use super::patterns::Patterns;
use crate::Result;
use crate::allowed::{Range, ranges};
use crate::parameters::Described;

/// The Euclidean distance between two trains, in which each spike becomes `exp(-(t - t_i) / tau)` from its time on.
///
/// van Rossum (2001), Neural Comput. 13:751; thesis 5.8 to 5.10. Between spikes the difference of the smoothed trains
/// is one decaying exponential, so its square is integrated exactly, piece by piece, over all time. No term of the sum
/// is negative, so equal trains have distance 0 and similar trains lose no digits. Time O(n + m).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VanRossum {
    /// Time constant, ms.
    pub tau: f64,
    /// The divisor of the integral.
    #[serde(default)]
    pub normalisation: Normalisation,
}

/// The divisor of the integral of the squared difference, before the root.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Normalisation {
    /// tau / 2, as in elephant: one additional spike has distance 1.
    #[default]
    Spike,
    /// tau, as in van Rossum's paper: one additional spike has distance `sqrt(1/2)`.
    Tau,
    /// None, as the norm in 5.10 is named: one additional spike has distance `sqrt(tau / 2)`, in the root of a ms.
    None,
}

impl Normalisation {
    /// The distance for an integral over time in units of tau / 2.
    pub(super) fn root(self, square: f64, tau: f64) -> f64 {
        let factor = match self {
            Self::Spike => 1.0,
            Self::Tau => 0.5,
            Self::None => tau / 2.0,
        };
        (square * factor).sqrt()
    }
}

impl Distance for VanRossum {
    fn described() -> Described {
        Described::by(&Self { tau: 1.0, normalisation: Normalisation::default() }, &["tau"], Self::RANGES)
    }

    fn check(&self) -> Result<()> {
        self.check_ranges()
    }

    fn ready<'m>(&'m self, _: &Patterns<'_>, _: Option<&Patterns<'_>>) -> Result<Box<dyn Ready + 'm>> {
        Ok(Box::new(self))
    }
}

impl VanRossum {
    ranges! {
        tau: "ms", Range::ABOVE_0;
    }

    /// The distance between two ascending trains.
    pub(super) fn between(&self, a: &[f64], b: &[f64]) -> f64 {
        // `height` is the difference of the smoothed trains just after `last`.
        let (mut square, mut height, mut last) = (0.0, 0.0, f64::NEG_INFINITY);
        for (t, more) in merge_spikes(a, b) {
            let fallen = (t - last) / self.tau;
            square -= height * height * (-2.0 * fallen).exp_m1();
            height = height * (-fallen).exp() + more;
            last = t;
        }
        square += height * height;
        self.normalisation.root(square, self.tau)
    }
}

/// If a squared distance is below this share of both trains' squares, it is not computed as a difference of sums, which
/// would have lost too many digits.
pub(super) const NEAR: f64 = 1e-4;
