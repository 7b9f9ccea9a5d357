//! CONE-R (6.12 to 6.14): the best weights where targets and silence cannot all be met, solved to a proven gap.

use serde::{Deserialize, Serialize};

use super::check_examples;
use super::rounds::START_NEAR_MS;
use super::rows::{SilentRows, TargetRow, target_rows};
use crate::neuron::{Neuron, Time};
use crate::{Result, SpikeTrains, Stop, problem};

/// What B(w) is divided by.
///
/// Reading: 6.14 prints `B_max`, under which kappa is nearly powerless; divided by the number of targets it does what 6.4.5
/// and figure 6.9 say.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Divisor {
    /// Its largest value over the bounds, as printed.
    #[default]
    #[serde(rename = "B_max")]
    Largest,
    /// How many targets there are.
    #[serde(rename = "targets")]
    Targets,
}

/// Whether the l2 term is the norm, as printed, or its square.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Norm {
    /// `|w|_2 / |w_max|_2` (6.14, and the code of Appendix 2).
    #[default]
    Norm,
    /// `|w|_2^2 / |w_max|_2^2`.
    Square,
}

/// Parameters of CONE-R; defaults from Tables 6.1 and 6.2.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ConeR {
    /// The neuron; its step is the step of the silent rows.
    pub neuron: Neuron,
    /// What the potential shall reach behind a target, in thresholds.
    pub kappa: f64,
    /// How far behind the target, ms; `0.1 tau` where left out, as in Tables 6.1 and 6.2.
    pub delta_t_ms: Option<f64>,
    /// `lambda_1` to `lambda_5`: l1, l2, B, C, D.
    pub lambdas: [f64; 5],
    /// Least weight, mV.
    pub lb: f64,
    /// Largest weight, mV.
    pub ub: f64,
    /// What B is divided by.
    pub divide_b_by: Divisor,
    /// The l2 term as norm or as square.
    pub norm: Norm,
    /// How far below the threshold silence shall stay, mV.
    pub margin: f64,
    /// Where silent rows end, ms; the later of the pattern's end and last target + `tau` where left out.
    pub horizon: Option<f64>,
    /// The relative gap between objective and proven bound at which a fit counts as solved.
    pub tolerance: f64,
}

impl Default for ConeR {
    fn default() -> Self {
        Self {
            neuron: Neuron { time: Time::Grid, ..Neuron::default() },
            kappa: 1.2,
            delta_t_ms: None,
            lambdas: [2.8, 1.2, 100.0, 100.0, 80.0],
            lb: -0.3,
            ub: 0.3,
            divide_b_by: Divisor::Largest,
            norm: Norm::Norm,
            margin: 0.0,
            horizon: None,
            tolerance: 1e-6,
        }
    }
}

impl ConeR {
    /// Checks every parameter.
    ///
    /// # Errors
    ///
    /// `Problem`, naming the parameter, its value and what would be right.
    pub fn check(&self) -> Result<()> {
        self.neuron.check()?;
        if self.neuron.time != Time::Grid {
            return Err(problem!("time is \"continuous\": 6.13 is a sum over grid points, must be \"grid\""));
        }
        if !(self.kappa.is_finite() && self.kappa > 0.0) {
            return Err(problem!("kappa is {}: must be above 0 and finite", self.kappa));
        }
        for (name, value) in [("delta_t_ms", self.delta_t()), ("margin", self.margin)] {
            if !(value.is_finite() && value >= 0.0) {
                return Err(problem!("{name} is {value}: must be 0 or more and finite"));
            }
        }
        if let Some(k) = self.lambdas.iter().position(|l| !(l.is_finite() && *l >= 0.0)) {
            return Err(problem!("lambdas[{k}] is {}: must be 0 or more and finite", self.lambdas[k]));
        }
        if self.lambdas.iter().sum::<f64>() == 0.0 {
            return Err(problem!("lambdas are all 0: at least one must be above 0"));
        }
        if !(self.lb.is_finite() && self.ub.is_finite() && self.lb < self.ub) {
            return Err(problem!("bounds {} to {} mV: lb must lie below ub, both finite", self.lb, self.ub));
        }
        if let Some(horizon) = self.horizon
            && !horizon.is_finite()
        {
            return Err(problem!("horizon is {horizon} ms: must be finite"));
        }
        if !(1e-10..=0.1).contains(&self.tolerance) {
            return Err(problem!("tolerance is {}: must lie between 1e-10 and 0.1", self.tolerance));
        }
        Ok(())
    }

    /// How far behind a target B looks, ms.
    #[must_use]
    pub fn delta_t(&self) -> f64 {
        self.delta_t_ms.unwrap_or(0.1 * self.neuron.tau)
    }

    /// `lambda` over its sum, as in 6.3.3.
    fn shares(&self) -> [f64; 5] {
        let sum: f64 = self.lambdas.iter().sum();
        self.lambdas.map(|l| l / sum)
    }
}

/// How a fit ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// The objective is proven to lie within `tolerance` of its least value.
    Solved,
    /// It is not: the weights are the best that were found, `gap` says how far off they may be.
    Stopped,
}

/// The five terms of 6.14, weighted and normalised: their sum is the objective.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[allow(non_snake_case)]
pub struct Parts {
    /// Sum of absolute weights.
    pub l1: f64,
    /// Length of the weights, or its square.
    pub l2: f64,
    /// Missed lift behind the targets (6.10).
    pub B: f64,
    /// Missed targets (6.12).
    pub C: f64,
    /// Broken silence (6.13).
    pub D: f64,
}

impl Parts {
    pub(super) fn sum(&self) -> f64 {
        self.l1 + self.l2 + self.B + self.C + self.D
    }
}

/// What is known after a round of row generation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Round {
    /// Counted from 1.
    pub round: usize,
    /// Rows handed to the cone program.
    pub rows: usize,
    /// The best objective so far.
    pub objective: f64,
    /// Its relative distance to the best bound so far.
    pub gap: f64,
}

/// A fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Fit {
    /// mV, one a train.
    pub weights: Vec<f64>,
    /// 6.14 at these weights.
    pub objective: f64,
    /// Its terms.
    pub parts: Parts,
    /// Proven relative distance to the least objective.
    pub gap: f64,
    /// Rounds of row generation.
    pub rounds: usize,
    /// Rows in the last cone program.
    pub rows: usize,
    /// How it ended.
    pub status: Status,
    /// Targets, as (pattern, target), that no weights within the bounds bring to the threshold.
    pub unreachable: Vec<(usize, usize)>,
    /// Output spikes on the training patterns that follow another one, with no target between, within `tau`.
    pub refires: usize,
}

/// The rows of one set of examples: made once, solved for many `lambdas`, `kappa`, bounds and divisors.
#[derive(Debug, Clone)]
pub struct Problem {
    pub(super) base: ConeR,
    patterns: Vec<SpikeTrains>,
    pub(super) trains: usize,
    pub(super) targets: Vec<TargetRow>,
    pub(super) silent: SilentRows,
    /// Rows behind the targets, one after the other, and their `B'B` by columns.
    pub(super) behind: Vec<f64>,
    pub(super) gram: Vec<f64>,
    /// The potential on all silent rows at weights of 1 mV.
    at_one: Vec<f64>,
}

/// Everything that turns potentials into 6.14: the parameters with their normalisers.
#[derive(Debug)]
pub(super) struct Objective {
    pub(super) l1: f64,
    pub(super) l2: f64,
    pub(super) b: f64,
    pub(super) c: f64,
    pub(super) d: f64,
    pub(super) kappa: f64,
    pub(super) norm: Norm,
    pub(super) lower: f64,
    pub(super) upper: f64,
}

impl Problem {
    /// Lays out the rows of these patterns and targets (ms).
    ///
    /// # Errors
    ///
    /// `Problem` for parameters or examples that make no sense (names pattern and target); `Interrupted`.
    pub fn new(parameters: &ConeR, patterns: &[SpikeTrains], targets: &[Vec<f64>], stop: Stop<'_>) -> Result<Self> {
        parameters.check()?;
        let neuron = &parameters.neuron;
        check_examples(neuron, patterns, targets)?;
        if let Some(horizon) = parameters.horizon {
            for (p, targets) in targets.iter().enumerate() {
                if let Some(last) = targets.last().filter(|&&t| t > horizon) {
                    return Err(problem!("pattern {p}: last target at {last} ms, the horizon is {horizon} ms"));
                }
            }
        }
        let rows = target_rows(neuron, parameters.delta_t(), patterns, targets);
        stop.check()?;
        let (horizon, margin) = (parameters.horizon, parameters.margin);
        let silent = SilentRows::new(neuron, horizon, margin, START_NEAR_MS, patterns, targets, stop)?;
        let trains = patterns[0].len();
        let behind: Vec<f64> = rows.iter().flat_map(|r| r.behind.iter().copied()).collect();
        let mut gram = vec![0.0; trains * trains];
        for row in &rows {
            stop.check()?;
            for (column, &v) in gram.chunks_exact_mut(trains).zip(&row.behind) {
                if v != 0.0 {
                    column.iter_mut().zip(&row.behind).for_each(|(g, r)| *g += v * r);
                }
            }
        }
        let mut at_one = Vec::new();
        silent.potential(&vec![1.0; trains], &mut at_one);
        let patterns = patterns.to_vec();
        Ok(Self { base: parameters.clone(), patterns, trains, targets: rows, silent, behind, gram, at_one })
    }

    /// How many silent rows there are.
    #[must_use]
    pub fn silent_rows(&self) -> usize {
        self.silent.limit.iter().filter(|l| l.is_finite()).count()
    }

    /// The five normalised weights of 6.14.
    fn objective(&self, parameters: &ConeR) -> Objective {
        let [l1, l2, b, c, d] = parameters.shares();
        let largest = parameters.lb.abs().max(parameters.ub.abs());
        let n = self.trains as f64;
        let over = |share: f64, most: f64| if most > 0.0 { share / most } else { 0.0 };
        let rows_at = |r: &TargetRow| {
            let at: f64 = r.at.iter().sum();
            let behind: f64 = r.behind.iter().sum();
            ((largest * behind + parameters.kappa * r.threshold).powi(2), largest * at + r.threshold)
        };
        let (b_max, c_max) = self.targets.iter().map(rows_at).fold((0.0, 0.0), |s, v| (s.0 + v.0, s.1 + v.1));
        let d_max: f64 = self.at_one.iter().zip(&self.silent.limit).map(|(u, l)| (largest * u - l).max(0.0)).sum();
        Objective {
            l1: l1 / (n * largest),
            l2: match parameters.norm {
                Norm::Norm => l2 / (n.sqrt() * largest),
                Norm::Square => l2 / (n * largest * largest),
            },
            b: match parameters.divide_b_by {
                Divisor::Largest => over(b, b_max),
                Divisor::Targets => b / self.targets.len() as f64,
            },
            c: over(c, c_max),
            d: over(d, d_max),
            kappa: parameters.kappa,
            norm: parameters.norm,
            lower: parameters.lb,
            upper: parameters.ub,
        }
    }

    /// Fits the weights.
    ///
    /// `parameters` may differ from those that the problem was made with in `lambdas`, `kappa`, bounds, `divide_b_by`,
    /// `norm` and `tolerance`; the rest is in the rows. `start` are weights of a similar fit: the closer, the quicker.
    ///
    /// # Errors
    ///
    /// `Problem` for parameters that make no sense or that need other rows; `Interrupted`.
    pub fn fit(
        &self,
        parameters: &ConeR,
        start: Option<&[f64]>,
        progress: &mut dyn FnMut(Round),
        stop: Stop<'_>,
    ) -> Result<Fit> {
        self.check_same_rows(parameters)?;
        if let Some(weights) = start {
            parameters.neuron.check_weights(weights, self.trains)?;
        }
        let start = start.map(|weights| weights.iter().map(|w| w.clamp(parameters.lb, parameters.ub)).collect());
        let objective = self.objective(parameters);
        let found = self.minimise(&objective, parameters.tolerance, start, progress, stop)?;
        Ok(Fit {
            objective: found.parts.sum(),
            parts: found.parts,
            gap: found.gap,
            rounds: found.rounds,
            rows: found.rows,
            status: if found.gap <= parameters.tolerance { Status::Solved } else { Status::Stopped },
            unreachable: self.unreachable(&objective),
            refires: self.refires(&found.weights, stop)?,
            weights: found.weights,
        })
    }

    fn check_same_rows(&self, parameters: &ConeR) -> Result<()> {
        parameters.check()?;
        let base = &self.base;
        let same = parameters.neuron == base.neuron
            && parameters.delta_t() == base.delta_t()
            && parameters.margin == base.margin
            && parameters.horizon == base.horizon;
        if same {
            Ok(())
        } else {
            Err(problem!("neuron, delta_t_ms, margin and horizon are in the rows: lay them out anew"))
        }
    }

    fn unreachable(&self, objective: &Objective) -> Vec<(usize, usize)> {
        let most = |row: &TargetRow| row.at.iter().map(|v| v * objective.upper.max(0.0)).sum::<f64>();
        let out_of_reach = |row: &&TargetRow| most(row) < row.threshold;
        self.targets.iter().filter(out_of_reach).map(|r| (r.pattern, r.target)).collect()
    }

    fn refires(&self, weights: &[f64], stop: Stop<'_>) -> Result<usize> {
        let mut refires = 0;
        for (p, pattern) in self.patterns.iter().enumerate() {
            let spikes = self.base.neuron.run(weights, pattern, 1.0, stop)?;
            let targets: Vec<f64> = self.targets.iter().filter(|r| r.pattern == p).map(|r| r.t).collect();
            let again = |a: f64, b: f64| b - a <= self.base.neuron.tau && !targets.iter().any(|&t| a < t && t <= b);
            refires += spikes.windows(2).filter(|w| again(w[0].t, w[1].t)).count();
        }
        Ok(refires)
    }
}
