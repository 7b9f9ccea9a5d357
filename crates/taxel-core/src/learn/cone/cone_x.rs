//! CONE-X (6.9 to 6.11): weights that satisfy every row of targets and silence exactly, or a proof that no weights do.
//!
//! A few hundred of a million silent instants are binding. Each round solves the problem over a working set of rows,
//! evaluates silence everywhere at the resulting weights, and adds the worst instant of each interval in which it is
//! violated. A dual active set finds the shortest weights (l2 alone, or no objective), with a lower bound at every
//! step, and also decides feasibility. Other objectives continue from its weights.

use serde::{Deserialize, Serialize};

use super::cone_r::GapMultipliers;
use super::exact::{BestWeights, Exact};
use super::shortest::{RowGenerationEnd, Shortest};
use crate::allowed::Range;
use crate::learn::fit::{Fit, Round, Status};
use crate::learn::statement::{
    Bounds, Certificate, Choice, Divisor, DivisorC, DivisorD, FormB, Margin, Norm, Objective, OneOrEach, Parts, Row,
    Sides, StatedRow, Statement, bounds_of, check_bounds, check_examples, check_some_target, largest, relative_gap,
};
use crate::neuron::{Neuron, Time};
use crate::parameters::parameters;
use crate::{Result, SpikeTrains, Stop, problem};

/// The default margin and slope in continuous time, mV and mV/ms at the default threshold, in proportion to it
/// otherwise.
const MARGIN: f64 = 1e-3;
/// If no weights keep the default margin, it is multiplied by this factor, down to `LEAST_SHARE` of the default.
const SMALLER: f64 = 0.1;
const LEAST_SHARE: f64 = 0.99e-3;

parameters! {
    /// Parameters of CONE-X; defaults from Table 6.1 and 6.4.3.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct ConeX {
        /// The neuron; on the grid its step is also the step of the silent rows.
        pub neuron: Neuron = Neuron::default();
        /// The potential that B aims at after a target, in thresholds.
        pub kappa: f64 = 1.2, "", Range::ABOVE_0;
        /// The delay after the target at which B evaluates the potential, ms; by default `0.1 tau`, as in Table 6.1.
        pub delta_t_ms: Option<f64> = None, "ms", Range::FROM_0, or delta_t;
        /// `lambda_1` to `lambda_3`: the factors of l1, l2 and B; only their ratios matter. All 0: any weights that
        /// satisfy the rows.
        pub lambdas: [f64; 3] = [0.0, 1.0, 0.0], "", Range::FROM_0;
        /// Least weight, mV, one for all or one per synapse.
        pub lb: OneOrEach = OneOrEach::All(-0.3), "mV", Range::FINITE;
        /// Largest weight, mV, one for all or one per synapse.
        pub ub: OneOrEach = OneOrEach::All(0.3), "mV", Range::FINITE;
        /// How the distances after the targets add up in B.
        pub form_b: FormB = FormB::Square;
        /// The normaliser of B.
        pub divide_b_by: Divisor = Divisor::Largest;
        /// Whether the l2 term is the norm or its square.
        pub norm: Norm = Norm::Norm;
        /// The distance that silence must keep below the threshold, mV; by default `theta_0` / 300 in continuous time,
        /// 0 on the grid.
        pub margin: Option<f64> = None, "mV", Range::FROM_0;
        /// The slope with which that margin falls to 0 towards a target, mV/ms; continuous time only, by default
        /// `theta_0` / 300 per ms.
        pub slope: Option<f64> = None, "mV/ms", Range::FROM_0;
        /// The end of silence, ms, one for all or one per pattern; by default the later of a pattern's end and its last
        /// target + `tau`.
        pub horizon: Option<OneOrEach> = None, "ms", Range::FINITE;
        /// The relative gap between objective and proven bound at which a fit counts as solved.
        pub tolerance: f64 = 1e-8, "", Range::within(1e-12, 0.1);
        /// The time after which the caller requests the best weights so far, s; this crate reads no clock.
        pub max_seconds: Option<f64> = None, "s", Range::ABOVE_0;
    }
}

impl ConeX {
    /// Checks every parameter.
    ///
    /// # Errors
    ///
    /// `Problem`, naming the parameter, its value and what would be right.
    pub fn check(&self) -> Result<()> {
        self.neuron.check()?;
        if let Some(rearm) = self.neuron.rearm {
            return Err(problem!(
                "rearm"; " is {rearm}: must be None, because CONE-X requires silence at every point, also where a \
                 neuron is not rearmed"
            ));
        }
        self.check_ranges()?;
        check_bounds(&self.lb, &self.ub)?;
        let Margin { height, slope } = self.margin();
        for (name, value, unit) in [("margin", height, "mV"), ("slope", slope, "mV/ms")] {
            if value == 0.0 && self.neuron.time == Time::Continuous {
                return Err(problem!(name; " is 0 {unit}: must be above 0 in continuous time, for example 1e-6"));
            }
        }
        if slope > 0.0 && self.neuron.time == Time::Grid {
            return Err(problem!(
                "slope"; " is {slope} mV/ms: must be 0 or None with time \"grid\"; only time \"continuous\" uses \
                          the slope"
            ));
        }
        Ok(())
    }

    /// The delay after a target at which B evaluates the potential, ms.
    #[must_use]
    pub fn delta_t(&self) -> f64 {
        self.delta_t_ms.unwrap_or(0.1 * self.neuron.tau)
    }

    /// The margin of silence, with its defaults.
    #[must_use]
    pub fn margin(&self) -> Margin {
        let continuous = self.neuron.time == Time::Continuous;
        let left_out = if continuous { MARGIN * (self.neuron.theta_0 / Neuron::default().theta_0) } else { 0.0 };
        Margin { height: self.margin.unwrap_or(left_out), slope: self.slope.unwrap_or(left_out) }
    }

    /// These parameters with all potentials in units of `unit` mV.
    fn in_units(&self, unit: f64) -> Self {
        let Margin { height, slope } = self.margin().times(1.0 / unit);
        let neuron = self.neuron.in_units(unit);
        let (lb, ub) = (self.lb.times(1.0 / unit), self.ub.times(1.0 / unit));
        Self { neuron, lb, ub, margin: Some(height), slope: Some(slope), ..self.clone() }
    }
}

/// Reasons for a search that ended early.
const ASKED: &str = "stopped by max_seconds or Ctrl-C";
const UNDECIDED: &str = "rounding errors are too large to decide whether some rows can be met";

/// A fit of CONE-X.
#[derive(Debug, Clone, PartialEq)]
pub struct ConeXFit {
    /// Weights and objective; its gap refers to all weights that keep the whole margin.
    pub fit: Fit,
    /// The largest violation of any row: targets, and silence with half its margin, mV.
    pub violation: f64,
    /// The margin that the weights keep; on the grid `height` is the least threshold - potential over the silent
    /// points.
    pub margin: Margin,
    /// The margin of the last problem solved: smaller than the default if the caller fixed none and no weights keep the
    /// default.
    pub asked: Margin,
    /// Why a fit is stopped, or why the objective of a feasible one is not proven to within the tolerance.
    pub reason: Option<String>,
    /// The binding rows with their multipliers: a start for a similar problem.
    pub held: Vec<(Row, f64)>,
    /// The proof that no weights exist, if the fit is infeasible.
    pub certificate: Option<Certificate>,
    /// The proof of the gap, if there are weights.
    pub proof: Option<GapMultipliers>,
}

/// The problem that a set of examples states, ready to be solved.
///
/// Internally all potentials are in units of `Neuron::unit` mV.
#[derive(Debug, Clone)]
pub struct ConeXProblem {
    parameters: ConeX,
    pub(super) exact: Exact,
    /// Whether the caller left the margin to its default, so that it may be reduced.
    free_margin: bool,
}

impl ConeXProblem {
    /// States the problem of these patterns and targets (ms).
    ///
    /// # Errors
    ///
    /// `Problem` for parameters or examples that are not valid (names pattern and target); `Interrupted`.
    pub fn new(parameters: &ConeX, patterns: &[SpikeTrains], targets: &[Vec<f64>], stop: Stop<'_>) -> Result<Self> {
        parameters.check()?;
        check_examples(&parameters.neuron, patterns, targets)?;
        check_some_target(targets)?;
        let unit = parameters.neuron.unit();
        let free_margin =
            parameters.margin.is_none() && parameters.slope.is_none() && parameters.neuron.time == Time::Continuous;
        let parameters = parameters.in_units(unit);
        let neuron = &parameters.neuron;
        let trains = patterns[0].len();
        let bounds = bounds_of(&parameters.lb, &parameters.ub, trains)?;
        if let Some(count) = parameters.horizon.as_ref().and_then(OneOrEach::count).filter(|&n| n != patterns.len()) {
            return Err(problem!(
                "horizon"; ": {count} values; must be one number for all patterns, or one per pattern, {}", patterns.len()
            ));
        }
        let mut statement = Statement::new(neuron, parameters.margin(), unit, trains);
        for (example, targets) in patterns.iter().enumerate().zip(targets) {
            let horizon = parameters.horizon.as_ref().map(|horizon| horizon.at(example.0));
            statement.push(example, targets, None, horizon, stop)?;
        }
        let [l1, l2, b] = parameters.lambdas;
        let choice = Choice {
            lambdas: [l1, l2, b, 0.0, 0.0],
            kappa: parameters.kappa,
            norm: parameters.norm,
            form_b: parameters.form_b,
            divisors: (parameters.divide_b_by, DivisorC::default(), DivisorD::default()),
            sides_b: Sides::Both,
            sides_c: Sides::Both,
        };
        let objective = |targets: &_| Objective::new(choice, bounds, &[], targets, unit, |_| 0.0);
        let exact = Exact::new(statement, parameters.delta_t(), objective, parameters.tolerance, stop)?;
        Ok(Self { parameters, exact, free_margin })
    }

    /// The same problem with another margin, mV and mV/ms.
    ///
    /// # Errors
    ///
    /// `Interrupted`.
    pub fn with_margin(&self, margin: Margin, stop: Stop<'_>) -> Result<Self> {
        let exact = self.exact.with_margin(margin.times(1.0 / self.unit()), stop)?;
        Ok(Self { exact, ..self.clone() })
    }

    /// The internal unit of potentials, mV.
    fn unit(&self) -> f64 {
        self.exact.statement.unit
    }

    /// The margin of the rows, mV and mV/ms.
    #[must_use]
    pub fn margin(&self) -> Margin {
        self.exact.statement.margin.times(self.unit())
    }

    /// The coefficients and limit of a row, with or without its margin, mV (of a slope row mV/ms).
    ///
    /// # Errors
    ///
    /// `Problem` if there is no such row.
    pub fn row(&self, row: Row, margin: bool) -> Result<StatedRow> {
        let mut stated = self.exact.statement.state(row)?;
        stated.limit += if margin { 0.0 } else { self.exact.statement.margin_of(row) };
        stated.limit *= self.unit();
        Ok(stated)
    }

    /// The bounds on the weights, mV.
    #[must_use]
    pub fn bounds(&self) -> Bounds {
        let Bounds { lower, upper } = &self.exact.objective.bounds;
        let times = |side: &[f64]| side.iter().map(|w| w * self.unit()).collect();
        Bounds { lower: times(lower), upper: times(upper) }
    }

    /// The row of B after a target: its coefficients, and `kappa` thresholds as limit.
    ///
    /// # Errors
    ///
    /// `Problem` if there is no such target.
    pub fn behind(&self, pattern: usize, target: usize) -> Result<StatedRow> {
        let mut stated = self.exact.statement.behind(pattern, target, self.parameters.delta_t())?;
        stated.limit *= self.parameters.kappa * self.unit();
        Ok(stated)
    }

    /// Finds the weights, or a proof that there are none; if stopped, returns the best weights so far.
    ///
    /// `start` are the binding rows of an earlier fit of a similar problem, with their multipliers.
    ///
    /// # Errors
    ///
    /// `Problem` for a start that is not valid.
    pub fn fit(&self, start: &[(Row, f64)], progress: &mut dyn FnMut(Round), stop: Stop<'_>) -> Result<ConeXFit> {
        let unit = self.unit();
        let start: Vec<(Row, f64)> = start.iter().map(|&(row, multiplier)| (row, multiplier / unit)).collect();
        let mut found = self.exact.solve(&start, progress, stop)?;
        let (first, mut rounds) = (self.exact.statement.margin, found.fit.rounds);
        let not_at_all = |found: &ConeXFit| found.certificate.as_ref().is_some_and(|proof| !proof.at_all);
        if self.free_margin
            && not_at_all(&found)
            && let Some(proof) =
                Certificate::of_same_inputs(&self.exact.statement, &self.exact.objective.bounds)?.filter(|p| p.at_all)
        {
            found = self.exact.fit_without_weights(Some(proof), rounds);
        }
        while self.free_margin && not_at_all(&found) {
            let margin = found.asked.times(SMALLER);
            if margin.height < LEAST_SHARE * first.height {
                found = self.undecided_fit(&found);
                break;
            }
            let mut notify = |round: Round| progress(Round { round: rounds + round.round, ..round });
            found = self.exact.with_margin(margin, stop)?.solve(&start, &mut notify, stop)?;
            rounds += found.fit.rounds;
        }
        found.fit.rounds = rounds;
        found.fit.weights.iter_mut().for_each(|w| *w *= unit);
        found.asked = found.asked.times(unit);
        found.violation *= unit;
        found.margin = found.margin.times(unit);
        found.held.iter_mut().for_each(|(_, multiplier)| *multiplier *= unit);
        if let Some(certificate) = &mut found.certificate {
            certificate.gap *= unit;
        }
        if let Some(proof) = &mut found.proof {
            let rows = proof.rows.iter_mut().map(|row| &mut row.1);
            rows.chain(proof.behind.iter_mut().map(|row| &mut row.1)).chain(&mut proof.pull).for_each(|m| *m /= unit);
        }
        Ok(found)
    }

    /// The result if infeasibility is proven for the smallest margin alone, which leaves still smaller margins
    /// undecided.
    fn undecided_fit(&self, found: &ConeXFit) -> ConeXFit {
        let Margin { height, slope } = found.asked.times(self.unit());
        let proof = found.certificate.as_ref().map_or("", |proof| proof.text.as_str());
        let reason = format!(
            "no weights keep silence {height:.1e} mV below the threshold and reach the targets with a slope of \
             {slope:.1e} mV/ms, the smallest margin that taxel tries; weights for a smaller margin may exist ({proof})"
        );
        ConeXFit {
            fit: Fit { status: Status::Stopped, gap: f64::INFINITY, ..found.fit.clone() },
            reason: Some(reason),
            certificate: None,
            proof: None,
            held: vec![],
            ..found.clone()
        }
    }
}

impl Exact {
    /// Finds the weights at this margin, or a proof that there are none.
    fn solve(&self, start: &[(Row, f64)], progress: &mut dyn FnMut(Round), stop: Stop<'_>) -> Result<ConeXFit> {
        if let Some(certificate) = Certificate::of_one_target(&self.statement, &self.objective.bounds)? {
            return Ok(self.fit_without_weights(Some(certificate), 0));
        }
        let Shortest { weights, held, rounds, end } = self.shortest(start, progress, stop)?;
        // The other terms are at least 0, so a bound on the l2 term bounds the objective.
        let (least, proof) = self.bound_of_length(&held)?;
        let best = BestWeights { weights, least, proof, held, rounds };
        Ok(match end {
            RowGenerationEnd::Infeasible(certificate) => self.fit_without_weights(Some(certificate), rounds),
            RowGenerationEnd::Met if self.objective.l1 > 0.0 || self.objective.b > 0.0 => {
                let best = self.mix(best, start, progress, stop)?;
                self.report(best, stop.asked().then_some(ASKED))?
            }
            RowGenerationEnd::Met => self.report(best, None)?,
            RowGenerationEnd::Stopped if stop.asked() => self.report(best, Some(ASKED))?,
            RowGenerationEnd::Stopped => self.report(best, Some(UNDECIDED))?,
        })
    }

    /// The result if there are no weights: infeasible with a proof, stopped without.
    fn fit_without_weights(&self, certificate: Option<Certificate>, rounds: usize) -> ConeXFit {
        let none = f64::INFINITY;
        let status = if certificate.is_some() { Status::Infeasible } else { Status::Stopped };
        ConeXFit {
            fit: Fit {
                status,
                weights: vec![f64::NAN; self.statement.trains],
                objective: none,
                parts: Parts { l1: none, l2: none, B: none, C: none, D: none },
                gap: if status == Status::Infeasible { f64::NAN } else { none },
                rounds,
            },
            violation: none,
            margin: Margin { height: f64::NAN, slope: f64::NAN },
            asked: self.statement.margin,
            reason: certificate.is_none().then(|| UNDECIDED.to_owned()),
            held: certificate.as_ref().map_or(vec![], |certificate| certificate.rows.clone()),
            certificate,
            proof: None,
        }
    }

    /// Evaluates the weights over all rows, whichever engine found them.
    fn report(&self, best: BestWeights, cut_short: Option<&str>) -> Result<ConeXFit> {
        let BestWeights { mut weights, least, proof, held, rounds } = best;
        if weights.iter().any(|w| !w.is_finite()) {
            return Ok(self.fit_without_weights(None, rounds));
        }
        let Bounds { lower, upper } = &self.objective.bounds;
        // Rounding can move a weight across its bound.
        for ((w, &l), &u) in weights.iter_mut().zip(lower).zip(upper) {
            *w = w.clamp(l, u);
        }
        let unmet = self.find_unmet(&weights)?;
        let parts = self.parts(&weights);
        let objective = parts.sum();
        let gap = relative_gap(objective, least);
        let known = gap <= self.tolerance || objective - least <= self.objective.nothing_of_b(&self.targets);
        let status = match unmet {
            None if known => Status::Solved,
            None => Status::Feasible,
            Some(_) => Status::Stopped,
        };
        let open = || format!("the objective is only proven to be within {gap:.1e} of its least value");
        let reason = match (cut_short, unmet.or_else(|| (!known).then(open))) {
            (Some(why), Some(reason)) => Some(format!("{why}; {reason}")),
            (_, reason) => reason,
        };
        let violation = largest([self.worst_target(&weights), self.worst(&weights), 0.0]);
        Ok(ConeXFit {
            margin: self.kept_margin(&weights),
            fit: Fit { status, weights, objective, parts, gap, rounds },
            asked: self.statement.margin,
            reason,
            violation,
            held,
            certificate: None,
            proof: Some(proof),
        })
    }
}
