//! CONE-R as data arrives: a sliding window of patterns, one in and one out, each time fitted from the fit before.
//!
//! The thesis names as CONE's limit that it cannot learn on line, and suggests such a window. Rows of a pattern are laid out
//! once, when it comes; the objective is that of a fit to the whole window from nothing, to the same proven gap.

use crate::allowed::{Parameter, Range};
use crate::learn::cone::{ConeR, ConeRFit, ConeRProblem, Shares};
use crate::learn::fit::Round;
use crate::learn::statement::check_example;
use crate::parameters::Described;
use crate::{Result, SpikeTrains, Stop, problem};

/// The window, its rows, and the last fit.
#[derive(Debug, Clone)]
pub struct OnlineConeR {
    parameters: ConeR,
    window: usize,
    problem: Option<ConeRProblem>,
    /// How many patterns came so far.
    seen: usize,
    last: Option<(Vec<f64>, Shares)>,
}

impl OnlineConeR {
    /// How many patterns the window holds.
    const WINDOW: Parameter = Parameter { name: "window", unit: "", range: Range::FROM_1 };

    /// The parameters of [`ConeR`] and `window`, with their defaults and ranges.
    #[must_use]
    pub fn described() -> Described {
        ConeR::described().with(Self::WINDOW, 200)
    }

    /// An empty window of so many patterns.
    ///
    /// # Errors
    ///
    /// `Problem` for parameters that make no sense, or a window of none.
    pub fn new(parameters: &ConeR, window: usize) -> Result<Self> {
        parameters.check()?;
        Self::WINDOW.check(&window)?;
        Ok(Self { parameters: parameters.clone(), window, problem: None, seen: 0, last: None })
    }

    /// How many patterns the window holds now.
    #[must_use]
    pub fn patterns(&self) -> usize {
        self.seen.min(self.window)
    }

    /// How many rows they have that demand silence.
    #[must_use]
    pub fn silent_rows(&self) -> usize {
        self.problem.as_ref().map_or(0, ConeRProblem::silent_rows)
    }

    /// Takes a pattern with its targets (ms) into the window; the oldest leaves where it is full.
    ///
    /// # Errors
    ///
    /// `Problem` for a pattern or targets that make no sense (names them), `Interrupted`; the window is then as before.
    pub fn add(&mut self, pattern: &SpikeTrains, targets: &[f64], stop: Stop<'_>) -> Result<()> {
        let parameters = &self.parameters;
        check_example(&parameters.neuron, self.seen, pattern, targets)?;
        let (end, points) = parameters.end_of(self.seen, pattern, targets)?;
        let rows = self.problem.as_ref().map_or(0, ConeRProblem::silent_and_free_rows);
        parameters.neuron.check_rows(rows as f64 + points)?;
        if let Some(problem) = &mut self.problem {
            problem.check_trains(self.seen, pattern)?;
            let silent = problem.silent_and_free_rows();
            problem.push(pattern, targets, end, stop)?;
            let rows = problem.silent_and_free_rows() - silent;
            if let Some((_, shares)) = &mut self.last {
                shares.make_room(silent, rows);
            }
            if self.seen >= self.window {
                let (rows, targets_gone) = problem.drop_first();
                if let Some((_, shares)) = &mut self.last {
                    shares.drop_first(rows, problem.silent_and_free_rows(), targets_gone);
                }
            }
        } else {
            self.problem = Some(ConeRProblem::of_one(parameters, pattern, targets, end, stop)?);
        }
        self.seen += 1;
        Ok(())
    }

    /// Fits the weights to the window. Where `stop` is requested, returns the best so far.
    ///
    /// # Errors
    ///
    /// `Problem` for a window without a pattern.
    pub fn fit(&mut self, progress: &mut dyn FnMut(Round), stop: Stop<'_>) -> Result<ConeRFit> {
        let Some(problem) = &self.problem else {
            return Err(problem!("the window is empty: add a pattern first"));
        };
        let start = self.last.as_ref().map(|(weights, shares)| (weights.as_slice(), Some(shares)));
        let fit = problem.fit_counting(&self.parameters, &[], start, Some(problem.patterns() - 1), progress, stop)?;
        self.last = Some((fit.fit.weights.clone(), fit.multipliers.clone()));
        Ok(fit)
    }
}

impl Shares {
    /// The first pattern's rows and targets are gone; `silent` silent rows are left.
    fn drop_first(&mut self, rows: usize, silent: usize, targets: usize) {
        let mut kept = Self::default();
        for (&row, &value) in self.rows.iter().zip(&self.values) {
            let target = row >= silent + rows;
            let gone = if target { row < silent + rows + targets } else { row < rows };
            if !gone {
                kept.rows.push(row - rows - if target { targets } else { 0 });
                kept.values.push(value);
            }
        }
        *self = kept;
    }

    /// Behind `silent` silent rows there are now so many more.
    fn make_room(&mut self, silent: usize, rows: usize) {
        self.rows.iter_mut().filter(|row| **row >= silent).for_each(|row| *row += rows);
    }
}
