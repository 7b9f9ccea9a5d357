//! The result of a fit, and its progress, for all learners.

use serde::{Deserialize, Serialize};

use super::statement::Parts;

/// How a fit ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// The weights satisfy all rows of CONE-X (CONE-R has no hard rows), in continuous time the neuron, run on the
    /// patterns, fires at its targets only, and the objective is proven to be within `tolerance` of its least value.
    Solved,
    /// CONE-X: as solved, but the search ended before the objective was proven to be the least.
    Feasible,
    /// No weights satisfy all rows of CONE-X; a certificate proves it.
    Infeasible,
    /// None of these is known; the weights are the best so far.
    Stopped,
}

impl Status {
    /// The status as a word.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Solved => "solved",
            Self::Feasible => "feasible",
            Self::Infeasible => "infeasible",
            Self::Stopped => "stopped",
        }
    }
}

/// Progress after a round of row generation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Round {
    /// The number of the round, from 1.
    pub round: usize,
    /// The number of rows in the working problem.
    pub rows: usize,
    /// The objective: that of this round for CONE-X, the best so far for CONE-R.
    pub objective: f64,
    /// The distance to the end.
    pub left: Left,
}

/// The distance to the end after a round.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Left {
    /// CONE-X: the number of intervals in which silence is violated.
    Broken(usize),
    /// CONE-R: the relative distance between the best objective and the best bound so far.
    Gap(f64),
}

/// The result of a fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Fit {
    /// How the fit ended.
    pub status: Status,
    /// The weights, mV, one per train; NaN if there are none.
    pub weights: Vec<f64>,
    /// The value of 6.14 (of 6.11 for CONE-X) at these weights; infinite if there are none.
    pub objective: f64,
    /// The terms of the objective.
    pub parts: Parts,
    /// The proven relative distance to the least objective.
    pub gap: f64,
    /// The number of rounds of row generation.
    pub rounds: usize,
}
