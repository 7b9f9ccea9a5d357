//! The best weights and the best bound so far, whichever solver found them.

use super::dense::times;
use super::interior::PrimalDual;
use super::polish::polish;
use super::program::{Guess, MixedProof, PrimalDualPoint, Program, retain};
use crate::learn::engines::nearest;
use crate::learn::fit::Engine;
use crate::learn::statement::{NOTHING, relative_gap};
use crate::{Result, Stop};

/// The state from which a later call with more rows can continue.
#[derive(Debug, Clone)]
pub(crate) struct ResumeState {
    pub(super) state: PrimalDual,
    /// The last polished point, in the program's units, and its binding rows and bounds.
    pub(super) exact: Option<(PrimalDualPoint, Guess)>,
}

impl ResumeState {
    /// Removes the inequality rows that the caller removes; rows added since the call that made this start come
    /// last.
    pub(crate) fn retain(&mut self, keep: &[bool]) {
        self.state.retain(keep);
        if let Some((point, guess)) = &mut self.exact {
            retain(&mut point.inequality, keep);
            retain(&mut guess.binding, keep);
        }
    }
}

/// The result of a minimisation.
#[derive(Debug, Clone)]
pub(crate) struct MixedMinimum {
    pub(crate) weights: Vec<f64>,
    /// The multipliers of the inequality rows, at least 0.
    pub(crate) inequality: Vec<f64>,
    /// A lower bound on the objective over these rows, and therefore over these and more.
    pub(crate) bound: f64,
    pub(crate) proof: MixedProof,
    pub(crate) engine: Engine,
    pub(crate) stopped: bool,
    pub(crate) start: ResumeState,
}

/// The best point so far and the best bound.
pub(super) struct BestPoint<'a> {
    pub(super) program: &'a Program,
    pub(super) point: PrimalDualPoint,
    pub(super) guess: Option<Guess>,
    pub(super) met: bool,
    pub(super) objective: f64,
    pub(super) bound: f64,
    /// The point whose multipliers prove the bound.
    proof: PrimalDualPoint,
}

impl<'a> BestPoint<'a> {
    pub(super) fn new(program: &'a Program) -> Self {
        let weights = program.lower.iter().zip(&program.upper).map(|(l, u)| 0.0_f64.clamp(*l, *u)).collect();
        let point = PrimalDualPoint {
            weights,
            equality: vec![0.0; program.equal_to.len()],
            inequality: vec![0.0; program.limit.len()],
            pull: vec![0.0; program.width()],
        };
        // No term is below 0, so 0 is a lower bound.
        let proof = point.clone();
        Self { program, point, guess: None, met: false, objective: f64::INFINITY, bound: 0.0, proof }
    }

    pub(super) fn offer(&mut self, point: PrimalDualPoint, guess: Option<Guess>) {
        let objective = self.program.objective(&point.weights);
        let met = self.program.meets_rows(&point.weights);
        let bound = self.program.bound(&point);
        if bound > self.bound {
            (self.bound, self.proof) = (bound, point.clone());
        }
        if self.objective.is_infinite() || (met && !self.met) || (met == self.met && objective < self.objective) {
            (self.point, self.guess, self.met, self.objective) = (point, guess, met, objective);
        }
    }

    pub(super) fn improve(
        &mut self,
        near: &PrimalDualPoint,
        guess: Guess,
        tolerance: f64,
        stop: Stop<'_>,
    ) -> Result<()> {
        let program = self.program;
        if let Some((point, guess)) = polish(program, near, guess, tolerance, stop) {
            self.offer(point, Some(guess));
        }
        if self.gap() <= tolerance {
            return Ok(());
        }
        // If the binding rows cannot be identified, good multipliers and the nearest feasible weights are enough.
        self.offer(near.clone(), None);
        if program.gap(near) <= tolerance
            && let Some(weights) = nearest(&near.weights, &program.hard(), &program.lower, &program.upper, stop)?
        {
            self.offer(PrimalDualPoint { weights, ..near.clone() }, None);
        }
        Ok(())
    }

    /// Continues from a polished point after rows were added.
    pub(super) fn exchange(&mut self, point: &PrimalDualPoint, guess: &Guess, tolerance: f64, stop: Stop<'_>) {
        let (mut point, mut guess) = (point.clone(), guess.clone());
        let below = times(&self.program.below, &point.weights);
        let added = below.iter().zip(&self.program.limit).skip(guess.binding.len());
        guess.binding.extend(added.map(|(u, limit)| u > limit));
        point.inequality.resize(guess.binding.len(), 0.0);
        if let Some((point, guess)) = polish(self.program, &point, guess, tolerance, stop) {
            self.offer(point, Some(guess));
        }
    }

    pub(super) fn gap(&self) -> f64 {
        if !self.met {
            f64::INFINITY
        } else if self.objective - self.bound <= NOTHING * self.program.at_zero() {
            0.0
        } else {
            relative_gap(self.objective, self.bound)
        }
    }

    pub(super) fn minimum(self, engine: Engine, stopped: bool, state: PrimalDual) -> MixedMinimum {
        let program = self.program;
        let multipliers = self.point.inequality.iter().zip(&program.of_below);
        MixedMinimum {
            weights: self.point.weights.iter().map(|w| w * program.weight).collect(),
            inequality: multipliers.map(|(z, scale)| z * program.cost / scale).collect(),
            bound: self.bound * program.cost,
            proof: program.proof(&self.proof),
            engine,
            stopped,
            start: ResumeState { state, exact: self.guess.map(|guess| (self.point, guess)) },
        }
    }
}
