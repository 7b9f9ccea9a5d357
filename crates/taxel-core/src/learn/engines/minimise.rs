//! Minimises 6.14: by the augmented Lagrangian, and by the cone solver if the former's result cannot be proven.

use super::augmented::WarmStart;
use super::rounds::Rounds;
use crate::learn::fit::{Engine, Left, Round};
use crate::learn::statement::{Objective, Parts, Relaxed, RelaxedPoint, RelaxedProof, Tangents};
use crate::vectors::dot;
use crate::{Result, Stop};

/// The weights found, and the engine that proved them.
pub(crate) struct Minimum {
    pub(crate) weights: Vec<f64>,
    pub(crate) objective: f64,
    pub(crate) parts: Parts,
    pub(crate) gap: f64,
    pub(crate) rounds: usize,
    pub(crate) rows: usize,
    pub(crate) engine: Engine,
    pub(crate) shares: Vec<f64>,
    pub(crate) proof: RelaxedProof,
}

impl Relaxed {
    /// Finds the least objective; the bound that proves it covers all rows, whichever engine ran.
    ///
    /// If a stop is requested, returns the best weights so far with their proven bound.
    ///
    /// # Errors
    ///
    /// `Problem` if the cone solver finds no answer.
    pub(crate) fn minimise(
        &self,
        objective: &Objective,
        tolerance: f64,
        engine: Engine,
        start: WarmStart,
        progress: &mut dyn FnMut(Round),
        stop: Stop<'_>,
    ) -> Result<Minimum> {
        let limits = objective.bounds.lower.iter().zip(&objective.bounds.upper);
        let zero: Vec<f64> = limits.map(|(&low, &high)| 0.0_f64.clamp(low, high)).collect();
        let at_zero = self.point(objective, zero.clone()).parts.sum();
        let scale = if at_zero > 0.0 { 1.0 / at_zero } else { 1.0 };
        let objective = &objective.scaled(scale).within_reach(at_zero * scale);
        let mut before = 0;
        let mut report = |round: usize, rows, least: f64, gap| {
            progress(Round { round, rows, objective: least / scale, left: Left::Gap(gap) });
        };
        let weights = start.weights.clone();
        let mut by = engine;
        let mut found = if engine == Engine::Native {
            match self.near_a_fit(objective, tolerance, start, &mut report, stop) {
                Ok(found) => found,
                Err(start) => self.augmented(objective, tolerance, start, &mut report, stop),
            }
        } else {
            let near = weights.is_some();
            let from = self.point(objective, weights.unwrap_or(zero));
            self.by_rounds(objective, tolerance, (from, self.no_proof(), near), &mut report, stop)?
        };
        if by == Engine::Native && !found.stopped && found.best.gap(found.proof.bound) > tolerance {
            by = Engine::ConeSolver;
            before = found.rounds;
            let mut report = |round, rows, least, gap| report(before + round, rows, least, gap);
            let near = (found.best, found.proof, true);
            found = self.by_rounds(objective, tolerance, near, &mut report, stop)?;
        }
        let least = found.best.parts.sum() / scale;
        let mut parts = found.best.parts;
        for part in [&mut parts.l1, &mut parts.l2, &mut parts.B, &mut parts.C, &mut parts.D] {
            *part /= scale;
        }
        let gap = found.best.gap(found.proof.bound);
        let mut proof = found.proof;
        proof.divide(scale, 1.0);
        Ok(Minimum {
            gap,
            weights: found.best.weights,
            objective: least,
            parts,
            rounds: before + found.rounds,
            rows: found.rows,
            engine: by,
            shares: found.shares,
            proof,
        })
    }

    /// The lower bound that these shares of the multipliers' ranges prove, together with the weights they belong to.
    fn prove(&self, objective: &Objective, point: &RelaxedPoint, shares: &[f64]) -> RelaxedProof {
        let times = |(row, share): (usize, &f64)| share * self.hinge_weight(objective, row);
        let length = dot(&point.weights, &point.weights).sqrt();
        let pull = if length > 0.0 { objective.l2 / length } else { 0.0 };
        let at = Tangents {
            weights: &point.weights,
            excess: &point.excess,
            behind: &point.behind,
            multipliers: &shares.iter().enumerate().map(times).collect::<Vec<_>>(),
            pull: &point.weights.iter().map(|w| pull * w).collect::<Vec<_>>(),
        };
        self.proof(objective, &at, point.parts.sum())
    }

    /// Starts from a similar fit: solves over the rows that are near their kinks there, until no other row matters.
    ///
    /// The rows left out contribute at least 0, so a bound for the others bounds the whole. Returns the start, as far
    /// advanced as it got, if there is no such fit or if too many rows matter.
    fn near_a_fit(
        &self,
        objective: &Objective,
        tolerance: f64,
        start: WarmStart,
        progress: &mut dyn FnMut(usize, usize, f64, f64),
        stop: Stop<'_>,
    ) -> std::result::Result<Rounds, WarmStart> {
        let (Some(weights), Some(mut shares)) = (start.weights.clone(), start.shares.clone()) else {
            return Err(start);
        };
        let silent = self.silent.len();
        let near = NEAR * self.theta_0;
        let mut best = self.point(objective, weights);
        let mut at = best.excess.clone();
        // The multipliers of a fit to the same rows may already prove it.
        let (mut proof, mut rounds) = (self.no_proof(), 0);
        proof.improve(self.prove(objective, &best, &shares));
        if best.gap(proof.bound) <= tolerance {
            let rows = shares.iter().filter(|share| **share != 0.0).count();
            progress(1, rows, best.parts.sum(), best.gap(proof.bound));
            return Ok(Rounds { best, proof, rounds: 1, rows, shares, stopped: false });
        }
        for _ in 0..ATTEMPTS {
            let live: Vec<usize> = (0..silent).filter(|&row| at[row] > -near || shares[row] != 0.0).collect();
            if live.len() > MOST_ROWS {
                break;
            }
            let small = self.with_silent_rows(&live);
            let begin = live.iter().map(|&row| shares[row]).chain(shares[silent..].iter().copied());
            let from = WarmStart { weights: Some(best.weights.clone()), shares: Some(begin.collect()) };
            let mut report =
                |round, rows, _, _| progress(rounds + round, rows, best.parts.sum(), best.gap(proof.bound));
            let found = small.augmented(objective, 0.3 * tolerance, from, &mut report, stop);
            rounds += found.rounds;
            let index = |k: usize| live.get(k).copied().unwrap_or(silent + k - live.len().min(k));
            for (k, &share) in found.shares.iter().enumerate() {
                shares[index(k)] = share;
            }
            let mut multipliers = vec![0.0; shares.len()];
            for (k, &multiplier) in found.proof.multipliers.iter().enumerate() {
                multipliers[index(k)] = multiplier;
            }
            proof.improve(RelaxedProof { multipliers, ..found.proof });
            let point = self.point(objective, found.best.weights);
            at.clone_from(&point.excess);
            if point.parts.sum() < best.parts.sum() {
                best = point;
            }
            let gap = best.gap(proof.bound);
            progress(rounds, found.rows, best.parts.sum(), gap);
            if gap <= tolerance || found.stopped {
                return Ok(Rounds { best, proof, rounds, rows: found.rows, shares, stopped: found.stopped });
            }
        }
        Err(WarmStart { weights: Some(best.weights), shares: Some(shares) })
    }
}

/// Rows at most `NEAR` thresholds below their limit are chosen, up to `ATTEMPTS` times; the attempt ends if more than
/// `MOST_ROWS` are.
const NEAR: f64 = 0.05;
const MOST_ROWS: usize = 4000;
const ATTEMPTS: usize = 4;
