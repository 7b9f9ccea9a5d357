//! The rows of the relaxed problem (6.12 to 6.14), in which violations of rows are penalised.

use std::sync::Arc;

use super::grid::SilentRows;
use super::objective::Objective;
use super::program::{Program, Rows};
use super::rows::Statement;
use super::targets::Targets;
use crate::{Result, Stop};

/// The rows of a set of examples on the grid, for 6.14.
///
/// Rows are numbered: grid points first, then targets.
#[derive(Debug, Clone)]
pub(crate) struct Relaxed {
    pub(crate) theta_0: f64,
    /// A potential this far below the threshold still counts as reaching it, mV.
    pub(crate) touch: f64,
    pub(crate) trains: usize,
    pub(crate) targets: Arc<Targets>,
    pub(crate) silent: SilentRows,
    /// `B'B` of the rows after the targets, by columns.
    pub(crate) gram: Arc<Vec<f64>>,
}

impl Relaxed {
    /// No rows yet, for a statement without patterns.
    pub(crate) fn new(statement: &Statement) -> Self {
        Self {
            theta_0: statement.neuron.theta_0,
            touch: statement.neuron.touch(),
            trains: statement.trains,
            targets: Arc::new(Targets::none(statement.trains)),
            silent: SilentRows::none(statement),
            gram: Arc::new(vec![0.0; statement.trains * statement.trains]),
        }
    }

    /// Adds the rows of the statement's last pattern, in which B evaluates the potential `delta_t` ms after the
    /// targets; if the caller stops it, nothing changes.
    pub(crate) fn push(&mut self, statement: &Statement, delta_t: f64, stop: Stop<'_>) -> Result<()> {
        let (pattern, before) = (statement.examples.len() - 1, self.targets.len());
        let targets = Targets::of_pattern(statement, pattern, delta_t, stop)?;
        self.silent.push(statement, pattern, stop)?;
        Arc::make_mut(&mut self.targets).append(targets);
        for k in before..self.targets.len() {
            self.targets.add_square(k, 1.0, Arc::make_mut(&mut self.gram).as_mut_slice());
        }
        Ok(())
    }

    /// Removes the rows of the first pattern.
    pub(crate) fn drop_first(&mut self) {
        for k in 0..self.targets.count_of_first() {
            self.targets.add_square(k, -1.0, Arc::make_mut(&mut self.gram).as_mut_slice());
        }
        Arc::make_mut(&mut self.targets).drop_first();
        self.silent.drop_first();
    }

    /// 6.14 over all these rows.
    pub(crate) fn program<'a>(&'a self, objective: &'a Objective) -> Program<'a> {
        Program {
            silent: Rows::Grid(&self.silent),
            limit: &self.silent.limit,
            targets: &self.targets,
            gram: &self.gram,
            objective,
            slopes: [
                [0.0, objective.d],
                objective.choice.sides_c.slopes(objective.c),
                objective.choice.sides_b.slopes(objective.b),
            ],
            theta_0: self.theta_0,
        }
    }

    /// D at these weights, without its factor, if the values of all inputs were positive: its largest value, unless
    /// inputs of both signs are present; then D cannot exceed it.
    pub(crate) fn most_broken_silence(&self, weights: &[f64]) -> f64 {
        let mut potential = vec![0.0; self.silent.len()];
        self.silent.unsigned_rows().potential(weights, &mut potential);
        potential.iter().zip(&self.silent.limit).map(|(u, limit)| (u - limit).max(0.0)).sum()
    }
}
