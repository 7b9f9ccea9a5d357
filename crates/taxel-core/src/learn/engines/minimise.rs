//! Minimises 6.14, from nothing or from a similar fit.

use super::augmented::{Found, WarmStart};
use crate::Stop;
use crate::learn::fit::{Fit, Left, Round, Status};
use crate::learn::statement::{Objective, Point, Program, Proof, Relaxed, Rows};
use crate::vectors::dot;

/// The weights found, with what proves them.
pub(crate) struct Minimum {
    pub(crate) fit: Fit,
    pub(crate) rows: usize,
    /// The multiplier of each row as a share of the difference of its slopes.
    pub(crate) shares: Vec<f64>,
    pub(crate) proof: Proof,
}

impl Relaxed {
    /// Finds the least objective; the bound that proves it covers all rows. The start's multipliers are shares.
    ///
    /// If a stop is requested, returns the best weights so far with their proven bound.
    pub(crate) fn minimise(
        &self,
        objective: &Objective,
        tolerance: f64,
        mut start: WarmStart,
        progress: &mut dyn FnMut(Round),
        stop: Stop<'_>,
    ) -> Minimum {
        let plain = self.program(objective);
        let at_zero = plain.point(plain.nearest_to_zero()).parts.sum();
        let scale = if at_zero > 0.0 { 1.0 / at_zero } else { 1.0 };
        let objective = &objective.scaled(scale).within_reach(at_zero * scale);
        let program = self.program(objective);
        let mut report = |round: usize, rows, least: f64, gap| {
            progress(Round { round, rows, objective: least / scale, left: Left::Gap(gap) });
        };
        let ranges = program.slopes.map(|[low, high]| high - low);
        let range_of = |row: usize| ranges[program.kind(row)];
        if let Some(shares) = &mut start.multipliers {
            shares.iter_mut().enumerate().for_each(|(row, share)| *share *= range_of(row));
        }
        let Found { best, mut proof, rounds, rows, multipliers: mut shares, .. } =
            match program.near_a_fit(tolerance, start, &mut report, stop) {
                Ok(found) => found,
                Err(start) => program.augmented(tolerance, start, &mut report, stop),
            };
        for (row, share) in shares.iter_mut().enumerate() {
            *share = if range_of(row) > 0.0 { *share / range_of(row) } else { 0.0 };
        }
        let (least, gap) = (best.parts.sum() / scale, best.gap(proof.bound));
        let mut parts = best.parts;
        for part in [&mut parts.l1, &mut parts.l2, &mut parts.B, &mut parts.C, &mut parts.D] {
            *part /= scale;
        }
        proof.divide(scale, 1.0);
        let status = if gap <= tolerance { Status::Solved } else { Status::Stopped };
        let fit = Fit { status, weights: best.weights, objective: least, parts, gap, rounds };
        Minimum { fit, rows, shares, proof }
    }
}

impl Program<'_> {
    /// The lower bound that these multipliers prove, together with the weights they belong to.
    fn prove(&self, point: &Point, multipliers: &[f64]) -> Proof {
        let length = dot(&point.weights, &point.weights).sqrt();
        let pull = if length > 0.0 { self.objective.l2 / length } else { 0.0 };
        let pull: Vec<f64> = point.weights.iter().map(|w| pull * w).collect();
        self.proof(point, multipliers, &pull, point.parts.sum())
    }

    /// Starts from a similar fit: solves over the rows that are near their kinks there, until no other row matters.
    ///
    /// The rows left out contribute at least 0, so a bound for the others bounds the whole. Returns the start, as far
    /// advanced as it got, if there is no such fit or if too many rows matter.
    fn near_a_fit(
        &self,
        tolerance: f64,
        start: WarmStart,
        progress: &mut dyn FnMut(usize, usize, f64, f64),
        stop: Stop<'_>,
    ) -> Result<Found, WarmStart> {
        let (Some(weights), Some(mut multipliers)) = (start.weights.clone(), start.multipliers.clone()) else {
            return Err(start);
        };
        let silent = self.limit.len();
        let near = NEAR * self.theta_0;
        let mut best = self.point(weights);
        let mut at = best.excess.clone();
        // The multipliers of a fit to the same rows may already prove it.
        let (mut proof, mut rounds) = (self.no_proof(), 0);
        proof.improve(self.prove(&best, &multipliers));
        if best.gap(proof.bound) <= tolerance {
            let rows = multipliers.iter().filter(|multiplier| **multiplier != 0.0).count();
            progress(1, rows, best.parts.sum(), best.gap(proof.bound));
            return Ok(Found { best, proof, rounds: 1, rows, multipliers, stopped: false });
        }
        for _ in 0..ATTEMPTS {
            let live: Vec<usize> = (0..silent).filter(|&row| at[row] > -near || multipliers[row] != 0.0).collect();
            if live.len() > MOST_ROWS {
                break;
            }
            let written = self.silent.coefficients(&live, self.trains());
            let limit: Vec<f64> = live.iter().map(|&row| self.limit[row]).collect();
            let small = Program { silent: Rows::Written(&written), limit: &limit, ..*self };
            let begin = live.iter().map(|&row| multipliers[row]).chain(multipliers[silent..].iter().copied());
            let from = WarmStart { weights: Some(best.weights.clone()), multipliers: Some(begin.collect()) };
            let mut report =
                |round, rows, _, _| progress(rounds + round, rows, best.parts.sum(), best.gap(proof.bound));
            let found = small.augmented(0.3 * tolerance, from, &mut report, stop);
            rounds += found.rounds;
            let index = |k: usize| live.get(k).copied().unwrap_or(silent + k - live.len().min(k));
            for (k, &multiplier) in found.multipliers.iter().enumerate() {
                multipliers[index(k)] = multiplier;
            }
            let mut proven = vec![0.0; multipliers.len()];
            for (k, &multiplier) in found.proof.multipliers.iter().enumerate() {
                proven[index(k)] = multiplier;
            }
            proof.improve(Proof { multipliers: proven, ..found.proof });
            let point = self.point(found.best.weights);
            at.clone_from(&point.excess);
            if point.parts.sum() < best.parts.sum() {
                best = point;
            }
            let gap = best.gap(proof.bound);
            progress(rounds, found.rows, best.parts.sum(), gap);
            if gap <= tolerance || found.stopped {
                return Ok(Found { best, proof, rounds, multipliers, ..found });
            }
        }
        Err(WarmStart { weights: Some(best.weights), multipliers: Some(multipliers) })
    }
}

/// Rows at most `NEAR` thresholds below their limit are chosen, up to `ATTEMPTS` times; the attempt ends if more than
/// `MOST_ROWS` are.
const NEAR: f64 = 0.05;
const MOST_ROWS: usize = 4000;
const ATTEMPTS: usize = 4;
