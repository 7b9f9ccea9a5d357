//! Victor-Purpura distance: the least cost of turning one spike train into another.

mod lanes;

use serde::{Deserialize, Serialize};

use super::distance::{Distance, Pattern, Ready, number_or_name, sum_over_trains};
use super::pairwise::{DistanceMatrix, Work};
use super::patterns::Patterns;
use crate::allowed::{Range, ranges};
use crate::parameters::Described;
use crate::vectors::Instructions;
use crate::{Result, Stop};
use lanes::{TrainBlock, lanes};

/// The least cost of turning one train into the other: 1 for each spike removed or added, `q |dt|` for each spike
/// moved.
///
/// Victor and Purpura (1996), J. Neurophysiol. 76:1310; thesis 6.3.5. Spikes more than `2 / q` apart never match, so
/// only nearer pairs are considered: time O(n + m + pairs within `2 / q`), memory O(m).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VictorPurpura {
    /// Cost of moving a spike by 1 ms; if infinite, only spikes at exactly the same time match.
    #[serde(deserialize_with = "number_or_name")]
    pub q: f64,
}

impl Distance for VictorPurpura {
    fn described() -> Described {
        Described::by(&Self { q: 0.0 }, &["q"], Self::RANGES)
    }

    fn check(&self) -> Result<()> {
        self.check_ranges()
    }

    fn ready<'m>(&'m self, _: &Patterns<'_>, _: Option<&Patterns<'_>>) -> Result<Box<dyn Ready + 'm>> {
        Ok(Box::new(self))
    }
}

impl Ready for &VictorPurpura {
    fn between(&self, a: Pattern<'_>, b: Pattern<'_>, stop: Stop<'_>) -> Result<f64> {
        sum_over_trains(a, b, stop, |a, b| VictorPurpura::between(self, a, b, stop))
    }

    /// Fills a matrix with the sums of distances over trains, many pairs side by side.
    ///
    /// Train after train, the columns' trains are sorted by length, so that trains processed side by side have similar
    /// lengths.
    fn fill(
        &self,
        matrix: &DistanceMatrix,
        a: &Patterns<'_>,
        b: Option<&Patterns<'_>>,
        work: &mut Work<'_>,
    ) -> Result<bool> {
        if !self.has_reach() || work.instructions == Instructions::Plain {
            return Ok(false);
        }
        let (set, lanes) = (work.instructions, lanes(work.instructions));
        let others = b.unwrap_or(a);
        let (pairs, reach) = (matrix.pairs(), self.reach());
        for n in 0..a.trains {
            let mut order: Vec<usize> = (0..others.count).collect();
            order.sort_by_key(|&p| others.train(p, n).len());
            let blocks: Vec<TrainBlock> = order
                .chunks(lanes)
                .map(|chunk| TrainBlock::new(lanes, &chunk.iter().map(|&p| others.train(p, n)).collect::<Vec<_>>()))
                .collect();
            // For patterns against each other, a row is compared with those that follow in the order.
            let row = |at: usize| if b.is_some() { (at, 0) } else { (order[at], at + 1) };
            let report = |rows: usize| ((pairs * n + pairs * rows / a.count) / a.trains, pairs);
            work.each(a.count, &report, |at, stop| {
                let (i, first) = row(at);
                let mut cost = Vec::new();
                for (block, from) in blocks.iter().zip((0..).step_by(lanes)).skip(first / lanes) {
                    stop.check()?;
                    let distances = block.distances(set, a.train(i, n), self.q, reach, &mut cost, stop)?;
                    for (at, distance) in (from..others.count).zip(distances).skip(first.saturating_sub(from)) {
                        matrix.add(i, order[at], distance);
                    }
                }
                Ok(())
            })?;
        }
        Ok(true)
    }
}

impl VictorPurpura {
    ranges! {
        q: "1/ms", Range::COST;
    }

    /// Whether moving has a positive and finite cost; otherwise spikes are only counted.
    pub(super) fn has_reach(&self) -> bool {
        self.q > 0.0 && self.q.is_finite()
    }

    /// Spikes farther apart than this never match; rounded up so that no pair is left out.
    fn reach(&self) -> f64 {
        2.0 / self.q * (1.0 + 4.0 * f64::EPSILON)
    }

    /// The distance between two ascending trains.
    pub(super) fn between(&self, a: &[f64], b: &[f64], stop: Stop<'_>) -> Result<f64> {
        let count = |n: usize| n as f64;
        if self.q == 0.0 {
            return Ok(count(a.len().abs_diff(b.len())));
        }
        if self.q == f64::INFINITY {
            return Ok(count(a.len() + b.len() - 2 * coincident(a, b)));
        }
        // `cost[j]` is the cost of turning the spikes of `a` so far into the first j of `b`; only columns lo to hi are
        // up to date. Earlier columns have spikes too early to match and are no longer read; in later ones, whose
        // spikes are still too late to match, each spike adds a cost of 1.
        let mut cost = vec![0.0; b.len() + 1];
        let (mut lo, mut hi) = (0, 0);
        let reach = self.reach();
        for (i, &from) in a.iter().enumerate() {
            if i % 64 == 0 {
                stop.check()?;
            }
            while hi < b.len() && b[hi] <= from + reach {
                cost[hi + 1] = cost[hi] + 1.0;
                hi += 1;
            }
            while lo < hi && b[lo] < from - reach {
                lo += 1;
            }
            let mut diagonal = cost[lo];
            let mut left = diagonal + 1.0;
            cost[lo] = left;
            for (&to, above) in b[lo..hi].iter().zip(&mut cost[lo + 1..=hi]) {
                let moved = diagonal + self.q * (from - to).abs();
                diagonal = *above;
                left = lesser(moved, lesser(diagonal, left) + 1.0);
                *above = left;
            }
        }
        Ok(cost[hi] + count(b.len() - hi))
    }
}

/// The smaller of two numbers, neither of which is NaN: a single instruction, unlike `f64::min`.
#[inline(always)]
fn lesser(x: f64, y: f64) -> f64 {
    if x < y { x } else { y }
}

/// The number of spikes with a partner at exactly the same time, the only ones that match if moving has infinite cost.
fn coincident(a: &[f64], b: &[f64]) -> usize {
    let (mut i, mut j, mut n) = (0, 0, 0);
    while i < a.len() && j < b.len() {
        if a[i] < b[j] {
            i += 1;
        } else if a[i] > b[j] {
            j += 1;
        } else {
            (i, j, n) = (i + 1, j + 1, n + 1);
        }
    }
    n
}
