//! Van Rossum distance: Euclidean, of trains smoothed by an exponential; in closed form.

mod matrix;

use serde::{Deserialize, Serialize};

use super::law::{Law, One, Ready, summed};
use super::merged::merged;
use super::pairwise::{Matrix, Work};
use super::patterns::Patterns;
use crate::allowed::{Range, ranges};
use crate::parameters::Described;
use crate::{Result, Stop};

/// The Euclidean distance of two trains, each spike of which becomes `exp(-(t - t_i) / tau)` from its time on.
///
/// van Rossum (2001), Neural Comput. 13:751; thesis 5.8 to 5.10. Between spikes the difference of the smoothed trains is
/// one decaying exponential, so its square is integrated piece by piece, exactly, over all time: a sum of terms none of
/// which is below 0, so equal trains give 0 and near ones lose no digits. Time O(n + m).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VanRossum {
    /// Time constant, ms.
    pub tau: f64,
    /// What the integral is divided by.
    #[serde(default)]
    pub normalisation: Normalisation,
}

/// What the integral of the squared difference is divided by, before the root.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Normalisation {
    /// tau / 2: one spike more is 1, as elephant has it.
    #[default]
    Spike,
    /// tau, as van Rossum has it: one spike more is the root of 1/2.
    Tau,
    /// Nothing, the norm as 5.10 names it: one spike more is the root of tau / 2, in the root of a ms.
    None,
}

impl Normalisation {
    /// The distance of an integral over time in units of tau / 2.
    pub(super) fn root(self, square: f64, tau: f64) -> f64 {
        let factor = match self {
            Self::Spike => 1.0,
            Self::Tau => 0.5,
            Self::None => tau / 2.0,
        };
        (square * factor).sqrt()
    }
}

impl Law for VanRossum {
    fn described() -> Described {
        Described::by(&Self { tau: 1.0, normalisation: Normalisation::default() }, &["tau"], Self::RANGES)
    }

    fn check(&self) -> Result<()> {
        self.check_ranges()
    }

    fn ready<'m>(&'m self, a: &Patterns<'_>, b: Option<&Patterns<'_>>) -> Result<Box<dyn Ready + 'm>> {
        let _ = (a, b);
        Ok(Box::new(self))
    }
}

impl Ready for &VanRossum {
    fn between(&self, a: One<'_>, b: One<'_>, stop: Stop<'_>) -> Result<f64> {
        summed(a, b, stop, |a, b| Ok(VanRossum::between(self, a, b)))
    }

    fn fill(
        &self,
        matrix: &Matrix,
        a: &Patterns<'_>,
        b: Option<&Patterns<'_>>,
        work: &mut Work<'_>,
    ) -> Option<Result<()>> {
        Some(VanRossum::fill(self, matrix, a, b, work))
    }
}

impl VanRossum {
    ranges! {
        tau: "ms", Range::ABOVE_0;
    }

    /// The distance of two ascending trains.
    pub(super) fn between(&self, a: &[f64], b: &[f64]) -> f64 {
        // `height`: the difference of the smoothed trains just after `last`.
        let (mut square, mut height, mut last) = (0.0, 0.0, f64::NEG_INFINITY);
        for (t, more) in merged(a, b) {
            let fallen = (t - last) / self.tau;
            square -= height * height * (-2.0 * fallen).exp_m1();
            height = height * (-fallen).exp() + more;
            last = t;
        }
        square += height * height;
        self.normalisation.root(square, self.tau)
    }
}

/// Below this share of both trains' squares, the square of their distance is not taken as a difference of sums any more:
/// it would have lost too many of its digits.
pub(super) const NEAR: f64 = 1e-4;
