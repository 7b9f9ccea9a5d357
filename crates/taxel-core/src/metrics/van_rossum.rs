//! Van Rossum distance: Euclidean, between trains smoothed by an exponential; in closed form.

use std::ops::Range;
use std::sync::atomic::Ordering::Relaxed;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::merged::merge_spikes;
use super::patterns::Two;
use super::work::Running;
use crate::allowed::ranges;
use crate::parameters::Described;
use crate::{Error, Result, Stop, allowed, vectors};

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

impl VanRossum {
    ranges! {
        tau: "ms", allowed::Range::ABOVE_0;
    }

    /// The parameters with their defaults and ranges.
    #[must_use]
    pub fn described() -> Described {
        Described::by(&Self { tau: 1.0, normalisation: Normalisation::default() }, &["tau"], Self::RANGES)
    }

    /// The distance between two ascending trains.
    pub(super) fn between(&self, a: &[f64], b: &[f64]) -> f64 {
        self.normalisation.root(self.square(a, b), self.tau)
    }

    /// The squared distance between two ascending trains, in units of tau / 2.
    fn square(&self, a: &[f64], b: &[f64]) -> f64 {
        // `height` is the difference of the smoothed trains just after `last`.
        let (mut square, mut height, mut last) = (0.0, 0.0, f64::NEG_INFINITY);
        for (t, more) in merge_spikes(a, b) {
            let fallen = (t - last) / self.tau;
            square -= height * height * (-2.0 * fallen).exp_m1();
            height = height * (-fallen).exp() + more;
            last = t;
        }
        square + height * height
    }

    /// A matrix of sums of distances over trains.
    ///
    /// The inner product of two smoothed trains is, in units of tau / 2, the sum of `exp(-|s - t| / tau)` over their
    /// spikes s and t. The trains of all patterns with the same number are passed once in the order of time, so that
    /// each spike takes one addition for each other pattern.
    pub(super) fn matrix(&self, two: &Two<'_>, running: &Running<'_>) -> Result<Vec<f64>> {
        let mut distances = two.zeros();
        // The patterns of both sides are numbered through.
        let rows = 0..two.rows.count;
        let columns = if two.symmetric { rows.clone() } else { rows.end..rows.end + two.columns.count };
        for n in 0..two.rows.trains {
            let of = |p: usize| if p < rows.end { two.rows.train(p, n) } else { two.columns.train(p - rows.end, n) };
            let spikes = self.in_order((0..columns.end).flat_map(|p| of(p).iter().map(move |&t| (t, p))).collect());
            let squares: Vec<f64> = (0..columns.end).into_par_iter().map(|p| self.square(of(p), &[])).collect();
            let after = sums(&spikes, &rows, &columns, running.stop)?;
            let other = if two.symmetric { None } else { Some(sums(&spikes, &columns, &rows, running.stop)?) };
            let before = other.as_ref().unwrap_or(&after);
            distances.par_chunks_mut(two.width()).enumerate().try_for_each(|(i, row)| {
                running.stop.check()?;
                for (j, cell) in row.iter_mut().enumerate().skip(two.first(i)) {
                    let product = after[i * columns.len() + j] + before[j * rows.len() + i];
                    let both = squares[i] + squares[columns.start + j];
                    let square = both - 2.0 * product;
                    *cell += if square > NEAR * both {
                        self.normalisation.root(square, self.tau)
                    } else {
                        self.between(of(i), of(columns.start + j))
                    };
                }
                Ok::<(), Error>(())
            })?;
            running.done.store(two.pairs() * (n + 1) / two.rows.trains, Relaxed);
        }
        Ok(distances)
    }

    /// Spikes in the order of time, with their exponentials.
    fn in_order(&self, mut spikes: Vec<(f64, usize)>) -> Vec<Spike> {
        // Exponentials are of the time since one spike, which changes before they overflow.
        const HIGHEST: f64 = 250.0;
        spikes.par_sort_unstable_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
        let mut since = spikes.first().map_or(0.0, |&(t, _)| t);
        let exponentials = |(t, pattern): (f64, usize)| {
            let passed = (t - since) / self.tau;
            let fallen = if passed > HIGHEST { (-passed).exp() } else { 1.0 };
            if passed > HIGHEST {
                since = t;
            }
            Spike { pattern, rise: ((t - since) / self.tau).exp(), fallen }
        };
        spikes.into_iter().map(exponentials).collect()
    }
}

/// A spike in the order of time.
struct Spike {
    /// The number of its pattern.
    pattern: usize,
    /// `exp((t - since) / tau)`.
    rise: f64,
    /// What is left of earlier exponentials when `since` changes before this spike; 1 if it does not.
    fallen: f64,
}

/// For each pattern of `rows` and of `columns`, the sum of `exp(-(t - s) / tau)` over the row's spikes t and the
/// column's spikes s before them in the order of `spikes`.
fn sums(spikes: &[Spike], rows: &Range<usize>, columns: &Range<usize>, stop: Stop<'_>) -> Result<Vec<f64>> {
    let width = columns.len().max(1);
    let mut sums = vec![0.0; rows.len() * columns.len()];
    let share = rows.len().div_ceil(rayon::current_num_threads()).max(1);
    sums.par_chunks_mut(share * width).enumerate().try_for_each(|(number, sums)| {
        let first = rows.start + number * share;
        let mut held = vec![0.0; width];
        for (k, spike) in spikes.iter().enumerate() {
            if k % 1024 == 0 {
                stop.check()?;
            }
            if spike.fallen < 1.0 {
                held.iter_mut().for_each(|held| *held *= spike.fallen);
            }
            if let Some(sum) = spike.pattern.checked_sub(first).and_then(|row| sums.chunks_exact_mut(width).nth(row)) {
                vectors::add(sum, 1.0 / spike.rise, &held);
            }
            if columns.contains(&spike.pattern) {
                held[spike.pattern - columns.start] += spike.rise;
            }
        }
        Ok::<(), Error>(())
    })?;
    Ok(sums)
}

/// If a squared distance is below this share of both trains' squares, it is not computed as a difference of sums, which
/// would have lost too many digits.
const NEAR: f64 = 1e-4;
