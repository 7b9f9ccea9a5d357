//! The result of a fit, and its progress, for all learners.

use serde::{Deserialize, Serialize};

use super::statement::Parts;

/// How a fit ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// CONE-X: the weights meet all rows, and in continuous time the neuron, run on the patterns, fires at its targets alone;
    /// `gap` bounds the objective. CONE-R, which has no rows that must be met: the objective is proven to lie within
    /// `tolerance` of its least value.
    Solved,
    /// No weights meet all rows of CONE-X; a certificate proves it.
    Infeasible,
    /// Neither is known: the weights are the best so far.
    Stopped,
}

impl Status {
    /// The word for it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Solved => "solved",
            Self::Infeasible => "infeasible",
            Self::Stopped => "stopped",
        }
    }
}

/// The engine that found the least objective.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Engine {
    /// taxel's own; where its result cannot be proven, the cone solver goes on from it.
    #[default]
    #[serde(rename = "native")]
    Native,
    /// Clarabel, over the rows that matter.
    #[serde(rename = "cone solver")]
    ConeSolver,
}

impl Engine {
    /// The words for it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Native => "native",
            Self::ConeSolver => "cone solver",
        }
    }
}

/// Progress after a round of row generation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Round {
    /// Counted from 1.
    pub round: usize,
    /// Rows of the working problem.
    pub rows: usize,
    /// The objective: of CONE-X that of this round, of CONE-R the best so far.
    pub objective: f64,
    /// The distance to the end.
    pub left: Left,
}

/// The distance to the end after a round.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Left {
    /// CONE-X: silence is violated in so many stretches of time.
    Broken(usize),
    /// The best objective's relative distance to the best bound so far.
    Gap(f64),
}

/// A fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Fit {
    /// How it ended.
    pub status: Status,
    /// mV, one a train; NaN where there are none.
    pub weights: Vec<f64>,
    /// 6.14 (6.11 of CONE-X) at these weights; infinite where there are none.
    pub objective: f64,
    /// Its terms.
    pub parts: Parts,
    /// Proven relative distance to the least objective.
    pub gap: f64,
    /// Rounds of row generation.
    pub rounds: usize,
    /// The engine that found it.
    pub engine: Engine,
}
