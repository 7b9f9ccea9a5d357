//! The least 6.14: by the engine of this house, and by the cone solver where that one's check fails.

use super::augmented::{Start, relative};
use super::cone_r::{Engine, Objective, Parts, Problem, Round};
use crate::{Result, Stop};

/// What was found, and who proved it.
pub(super) struct Found {
    pub(super) weights: Vec<f64>,
    pub(super) objective: f64,
    pub(super) parts: Parts,
    pub(super) gap: f64,
    pub(super) rounds: usize,
    pub(super) rows: usize,
    pub(super) engine: Engine,
    pub(super) shares: Vec<f64>,
}

impl Problem {
    /// Finds the least objective; the bound that proves it counts all rows, whichever engine ran.
    ///
    /// Where `stop` asks for an end, the best so far comes back, with what is proven of it.
    ///
    /// # Errors
    ///
    /// `Problem` where the cone solver finds no answer.
    pub(super) fn minimise(
        &self,
        objective: &Objective,
        tolerance: f64,
        engine: Engine,
        start: Start,
        progress: &mut dyn FnMut(Round),
        stop: Stop<'_>,
    ) -> Result<Found> {
        let limits = objective.lower.iter().zip(&objective.upper);
        let zero: Vec<f64> = limits.map(|(&low, &high)| 0.0_f64.clamp(low, high)).collect();
        let at_zero = self.point(objective, zero).parts.sum();
        let scale = if at_zero > 0.0 { 1.0 / at_zero } else { 1.0 };
        let objective = &objective.scaled(scale);
        let mut before = 0;
        let mut told = |round: usize, rows, least: f64, gap| {
            progress(Round { round, rows, objective: least / scale, gap });
        };
        let weights = start.weights.clone();
        let mut by = engine;
        let mut found = if engine == Engine::Native {
            self.augmented(objective, tolerance, start, &mut told, stop)
        } else {
            let near = weights.is_some();
            let from = self.point(objective, weights.unwrap_or_else(|| vec![0.0; self.trains]));
            self.by_rounds(objective, tolerance, (from, 0.0, near), &mut told, stop)?
        };
        let open = |best, bound| relative(best, bound) > tolerance;
        if by == Engine::Native && !found.stopped && open(&found.best, found.bound) {
            by = Engine::ConeSolver;
            before = found.rounds;
            let mut told = |round, rows, least, gap| told(before + round, rows, least, gap);
            let near = (found.best, found.bound, true);
            found = self.by_rounds(objective, tolerance, near, &mut told, stop)?;
        }
        let least = found.best.parts.sum() / scale;
        let mut parts = found.best.parts;
        for part in [&mut parts.l1, &mut parts.l2, &mut parts.B, &mut parts.C, &mut parts.D] {
            *part /= scale;
        }
        Ok(Found {
            gap: relative(&found.best, found.bound),
            weights: found.best.weights,
            objective: least,
            parts,
            rounds: before + found.rounds,
            rows: found.rows,
            engine: by,
            shares: found.shares,
        })
    }
}
