//! Online CONE-R: a sliding window of patterns; each fit starts from the previous one.
//!
//! The thesis names the lack of online learning as a limit of CONE and suggests such a window. The rows of a pattern
//! are computed once, when it is added; the objective and its proven gap are those of a fit to the whole window from
//! scratch.

use crate::allowed::{Parameter, Range};
use crate::learn::cone::{ConeR, ConeRFit, ConeRProblem, Shares};
use crate::learn::fit::Round;
use crate::learn::statement::{check_example, check_silence, check_trains};
use crate::parameters::Described;
use crate::{Result, SpikeTrains, Stop, problem};

/// The window, its rows, and the last fit.
#[derive(Debug, Clone)]
pub struct OnlineConeR {
    parameters: ConeR,
    window: usize,
    problem: ConeRProblem,
    /// The number of patterns added so far.
    added: usize,
    last: Option<(Vec<f64>, Shares)>,
}

impl OnlineConeR {
    /// The number of patterns in a full window.
    const WINDOW: Parameter = Parameter { name: "window", unit: "", range: Range::FROM_1 };

    /// The parameters of [`ConeR`] and `window`, with their defaults and ranges.
    #[must_use]
    pub fn described() -> Described {
        ConeR::described().with(Self::WINDOW, 200)
    }

    /// An empty window for `window` patterns.
    ///
    /// # Errors
    ///
    /// `Problem` for parameters that are not valid, or a window of 0 patterns.
    pub fn new(parameters: &ConeR, window: usize) -> Result<Self> {
        parameters.check()?;
        Self::WINDOW.check(&window)?;
        let problem = ConeRProblem::without_patterns(parameters, 0);
        Ok(Self { parameters: parameters.clone(), window, problem, added: 0, last: None })
    }

    /// The number of patterns in the window.
    #[must_use]
    pub fn patterns(&self) -> usize {
        self.added.min(self.window)
    }

    /// The number of rows in the window that require silence.
    #[must_use]
    pub fn silent_rows(&self) -> usize {
        self.problem.silent_rows()
    }

    /// Adds a pattern with its targets (ms) and the windows in which silence counts (ms; `None`: everywhere) to the
    /// window, and removes the oldest if the window is full.
    ///
    /// # Errors
    ///
    /// `Problem` for a pattern or targets that are not valid (names them), `Interrupted`; the window then stays
    /// unchanged.
    pub fn add(
        &mut self,
        pattern: &SpikeTrains,
        targets: &[f64],
        silence: Option<&[[f64; 2]]>,
        stop: Stop<'_>,
    ) -> Result<()> {
        let parameters = &self.parameters;
        check_example(&parameters.neuron, self.added, pattern, targets)?;
        check_silence(self.added, silence)?;
        if self.added == 0 {
            self.problem = ConeRProblem::without_patterns(parameters, pattern.len());
        }
        let problem = &mut self.problem;
        if let Some(first) = problem.patterns.first() {
            check_trains(self.added, pattern, first.len())?;
        }
        let [_, before] = problem.rows_by_kind();
        problem.push((self.added, pattern), targets, silence, stop)?;
        let mut gone = [0; 3];
        if self.added >= self.window {
            [gone, _] = problem.rows_by_kind();
            problem.drop_first();
        }
        if let Some((_, shares)) = &mut self.last {
            let [_, after] = problem.rows_by_kind();
            renumber(shares, before, gone, after);
        }
        self.added += 1;
        Ok(())
    }

    /// Fits the weights to the window. Where `stop` is requested, returns the best so far.
    ///
    /// # Errors
    ///
    /// `Problem` for a window without a pattern.
    pub fn fit(&mut self, progress: &mut dyn FnMut(Round), stop: Stop<'_>) -> Result<ConeRFit> {
        if self.added == 0 {
            return Err(problem!("the window is empty: add a pattern first"));
        }
        let problem = &self.problem;
        let start = self.last.as_ref().map(|(weights, shares)| (weights.as_slice(), Some(shares)));
        let fit = problem.fit(&self.parameters, &[], start, Some(problem.patterns.len() - 1), progress, stop)?;
        self.last = Some((fit.fit.weights.clone(), fit.multipliers.clone()));
        Ok(fit)
    }
}

/// Removes the entries of the first `gone` rows of each kind, and renumbers the others for `after` rows a kind.
fn renumber(shares: &mut Shares, before: [usize; 3], gone: [usize; 3], after: [usize; 3]) {
    shares.retain_mut(|(row, _)| {
        let (mut kind, mut place, mut first) = (0, *row, 0);
        while place >= before[kind] {
            (place, first, kind) = (place - before[kind], first + after[kind], kind + 1);
        }
        *row = (first + place).saturating_sub(gone[kind]);
        place >= gone[kind]
    });
}
