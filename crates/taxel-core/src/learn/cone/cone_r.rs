//! CONE-R (6.12 to 6.14): the best weights when no weights satisfy all targets and all silence, solved to a proven gap.

use serde::{Deserialize, Serialize};

use crate::allowed::{Range, one_weight_a_train};
use crate::learn::engines::WarmStart;
use crate::learn::fit::{Fit, Left, Round};
use crate::learn::statement::{
    Choice, Divisor, DivisorC, DivisorD, FormB, Margin, Norm, Objective, OneOrEach, Proof, Relaxed, Row, Sides,
    Statement, bounds_of, check_bounds, check_examples, check_silence,
};
use crate::metrics::matching::{WINDOW_MS, match_spikes};
use crate::neuron::{Neuron, Time};
use crate::parameters::parameters;
use crate::{Result, SpikeTrains, Stop, problem};

parameters! {
    /// Parameters of CONE-R; defaults from Tables 6.1 and 6.2.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct ConeR {
        /// The neuron; its grid step is also the step of the silent rows.
        pub neuron: Neuron = Neuron { time: Time::Grid, ..Neuron::default() };
        /// The potential that B requires after a target, in thresholds.
        pub kappa: f64 = 1.2, "", Range::ABOVE_0;
        /// The delay after the target at which B requires that potential, ms; by default `0.1 tau`, as in Tables 6.1
        /// and 6.2.
        pub delta_t_ms: Option<f64> = None, "ms", Range::FROM_0, or delta_t;
        /// `lambda_1` to `lambda_5`: the factors of l1, l2, B, C and D.
        pub lambdas: [f64; 5] = [2.8, 1.2, 100.0, 100.0, 80.0], "", Range::FROM_0;
        /// Least weight, mV.
        pub lb: OneOrEach = OneOrEach::All(-0.3), "mV", Range::FINITE;
        /// Largest weight, mV.
        pub ub: OneOrEach = OneOrEach::All(0.3), "mV", Range::FINITE;
        /// How the distances after the targets add up in B.
        pub form_b: FormB = FormB::Square;
        /// The normaliser of B.
        pub divide_b_by: Divisor = Divisor::Largest;
        /// The normaliser of C.
        pub divide_c_by: DivisorC = DivisorC::Largest;
        /// The normaliser of D.
        pub divide_d_by: DivisorD = DivisorD::Largest;
        /// The potentials after a target that count as a miss in B.
        pub sides_b: Sides = Sides::Both;
        /// The potentials at a target that count as a miss in C.
        pub sides_c: Sides = Sides::Both;
        /// Whether the l2 term is the norm or its square.
        pub norm: Norm = Norm::Norm;
        /// The distance that silence must keep below the threshold, mV.
        pub margin: f64 = 0.0, "mV", Range::FROM_0;
        /// The end of the silent rows, ms; by default the later of the pattern's end and its last target + `tau`.
        pub horizon: Option<f64> = None, "ms", Range::FINITE;
        /// The relative gap between objective and proven bound at which a fit counts as solved.
        pub tolerance: f64 = 1e-6, "", Range::within(1e-10, 0.1);
        /// The time after which the caller requests the best weights so far, s; this crate reads no clock.
        pub max_seconds: Option<f64> = None, "s", Range::ABOVE_0;
    }
}

impl ConeR {
    /// Checks every parameter, and that the neuron runs on a grid.
    ///
    /// # Errors
    ///
    /// `Problem`, naming the parameter, its value and what would be right.
    pub fn check(&self) -> Result<()> {
        self.neuron.check()?;
        if self.neuron.time != Time::Grid {
            return Err(problem!(
                "time"; " is \"continuous\": must be \"grid\", because equation 6.13 is a sum over grid points"
            ));
        }
        self.check_ranges()?;
        if self.lambdas.iter().sum::<f64>() == 0.0 {
            return Err(problem!("lambdas"; " are all 0: at least one must be above 0"));
        }
        check_bounds(&self.lb, &self.ub)
    }

    /// The delay after a target at which B evaluates the potential, ms.
    #[must_use]
    pub fn delta_t(&self) -> f64 {
        self.delta_t_ms.unwrap_or(0.1 * self.neuron.tau)
    }

    /// These parameters with all potentials in units of `unit` mV.
    fn in_units(&self, unit: f64) -> Self {
        let (lb, ub) = (self.lb.times(1.0 / unit), self.ub.times(1.0 / unit));
        Self { neuron: self.neuron.in_units(unit), lb, ub, margin: self.margin / unit, ..self.clone() }
    }
}

/// The multipliers from which a similar fit starts: the nonzero ones, by row, ascending (silent rows first, then targets,
/// then B).
///
/// Each is a share of its row's weight in 6.14 (of twice that weight for a C of both sides): from 0 to 1 for a silent
/// row; for a target from -1/2 to 1/2, from -1 to 0 if C counts only potentials below; likewise for B, if it is a sum.
pub type Shares = Vec<(usize, f64)>;

/// The slopes of the tangents below the terms of 6.14 that prove the gap of a fit: the nonzero ones, 1/mV. In CONE-X
/// (6.11) the rows are hard, and have multipliers instead of D and C.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct GapMultipliers {
    /// The multipliers of D and C, or of hard rows.
    pub rows: Vec<(Row, f64)>,
    /// The multipliers of B, by pattern and target.
    pub behind: Vec<((usize, usize), f64)>,
    /// The multipliers of the l2 term, one per synapse, zeros included.
    pub pull: Vec<f64>,
}

/// A fit of CONE-R.
#[derive(Debug, Clone, PartialEq)]
pub struct ConeRFit {
    /// Weights and objective.
    pub fit: Fit,
    /// The number of rows on their kinks in the last round.
    pub rows: usize,
    /// The multipliers, from which a similar fit may start together with the weights.
    pub multipliers: Shares,
    /// The multipliers that prove the gap.
    pub proof: GapMultipliers,
    /// Targets, as (pattern, target), that no weights within the bounds bring to the threshold.
    pub unreachable: Vec<(usize, usize)>,
    /// Output spikes on the training patterns that follow a previous one within `tau` without a target in between.
    pub refires: usize,
    /// Targets that an output spike is paired with, as in a score, and all targets, of the training patterns.
    pub fired: (usize, usize),
}

/// The rows of a set of examples, computed once and solved for many `lambdas`, `kappa`, bounds and divisors.
///
/// Internally all potentials are in units of `Neuron::unit` mV.
#[derive(Debug, Clone)]
pub struct ConeRProblem {
    base: ConeR,
    pub(crate) patterns: Vec<SpikeTrains>,
    statement: Statement,
    rows: Relaxed,
}

impl ConeRProblem {
    /// Computes the rows of these patterns and targets (ms). Silence counts in the windows of each pattern (start and
    /// stop, ms, ascending, ends included), or everywhere.
    ///
    /// # Errors
    ///
    /// `Problem` for parameters or examples that are not valid (names pattern and target); `Interrupted`.
    pub fn new(
        parameters: &ConeR,
        patterns: &[SpikeTrains],
        targets: &[Vec<f64>],
        silence: &[Option<Vec<[f64; 2]>>],
        stop: Stop<'_>,
    ) -> Result<Self> {
        parameters.check()?;
        let neuron = &parameters.neuron;
        check_examples(neuron, patterns, targets)?;
        if silence.len() != patterns.len() {
            let (lists, count) = (silence.len(), patterns.len());
            return Err(problem!("silence"; ": {lists} lists for {count} patterns; must be one per pattern"));
        }
        for (p, windows) in silence.iter().enumerate() {
            check_silence(p, windows.as_deref())?;
        }
        let mut problem = Self::without_patterns(parameters, patterns[0].len());
        for ((pattern, targets), silence) in patterns.iter().enumerate().zip(targets).zip(silence) {
            problem.push(pattern, targets, silence.as_deref(), stop)?;
        }
        Ok(problem)
    }

    /// No rows yet, for `push`.
    pub(crate) fn without_patterns(parameters: &ConeR, trains: usize) -> Self {
        let unit = parameters.neuron.unit();
        let base = parameters.in_units(unit);
        let statement = Statement::new(&base.neuron, Margin { height: base.margin, slope: 0.0 }, unit, trains);
        Self { rows: Relaxed::new(&statement), base, patterns: vec![], statement }
    }

    /// Adds a pattern, number `p` to the caller, who has checked it, with its targets (ms) and the windows in which
    /// silence counts (ms; `None`: everywhere); on an error nothing changes.
    pub(crate) fn push(
        &mut self,
        (p, pattern): (usize, &SpikeTrains),
        targets: &[f64],
        silence: Option<&[[f64; 2]]>,
        stop: Stop<'_>,
    ) -> Result<()> {
        self.statement.push((p, pattern), targets, silence, self.base.horizon, stop)?;
        if let Err(error) = self.rows.push(&self.statement, self.base.delta_t(), stop) {
            self.statement.drop_last();
            return Err(error);
        }
        self.patterns.push(pattern.clone());
        Ok(())
    }

    /// Removes the first pattern.
    pub(crate) fn drop_first(&mut self) {
        self.rows.drop_first();
        self.statement.drop_first();
        self.patterns.remove(0);
    }

    /// The numbers of rows by kind: of the first pattern, and of all.
    pub(crate) fn rows_by_kind(&self) -> [[usize; 3]; 2] {
        let Relaxed { silent, targets, .. } = &self.rows;
        let after = |targets| if self.base.form_b == FormB::Sum { targets } else { 0 };
        let (first, all) = (targets.count_of_first(), targets.len());
        [[silent.rows_of_first(), first, after(first)], [silent.len(), all, after(all)]]
    }

    /// The number of rows: grid points, with or without a requirement, and targets.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.rows.silent.len() + self.rows.targets.len()
    }

    /// The number of rows that require silence.
    #[must_use]
    pub fn silent_rows(&self) -> usize {
        self.rows.silent.limit.iter().filter(|l| l.is_finite()).count()
    }

    /// The objective 6.14 with these parameters, in this problem's units.
    fn objective(&self, parameters: &ConeR, silent: &[f64]) -> Result<Objective> {
        let bounds = bounds_of(&parameters.lb, &parameters.ub, self.rows.trains)?;
        let ConeR { lambdas, kappa, norm, form_b, sides_b, sides_c, .. } = *parameters;
        let choice = Choice {
            lambdas,
            kappa,
            norm,
            form_b,
            divisors: (parameters.divide_b_by, parameters.divide_c_by, parameters.divide_d_by),
            sides_b,
            sides_c,
        };
        let d_max = |most: &[f64]| self.rows.most_broken_silence(most);
        let unit = self.statement.unit;
        let silent: Vec<f64> = silent.iter().map(|most| most / unit).collect();
        Ok(Objective::new(choice, bounds, &silent, &self.rows.targets, unit, d_max))
    }

    /// Fits the weights.
    ///
    /// `parameters` may differ from those of the problem in `lambdas`, `kappa`, bounds, divisors, sides, `norm`,
    /// and `tolerance`; the others are part of the rows. `silent` are the largest absolute weights (mV) of
    /// trains without a spike, which were left out of the rows but count in the normalisers. `start` are the weights of
    /// a similar fit, with its multipliers if that fit had the same rows; a closer start is faster. The neuron is then run on
    /// `only` one pattern if it is named. If a stop is requested, `fit` returns the best weights so far.
    ///
    /// # Errors
    ///
    /// `Problem` for parameters that are not valid or that need other rows.
    pub fn fit(
        &self,
        parameters: &ConeR,
        silent: &[f64],
        start: Option<(&[f64], Option<&Shares>)>,
        only: Option<usize>,
        progress: &mut dyn FnMut(Round),
        stop: Stop<'_>,
    ) -> Result<ConeRFit> {
        parameters.check()?;
        let unit = self.statement.unit;
        let parameters = &parameters.in_units(unit);
        self.check_same_rows(parameters)?;
        let objective = self.objective(parameters, silent)?;
        let start = self.start_from(&objective, start)?;
        let mut found = self.rows.minimise(&objective, parameters.tolerance, start, progress, stop);
        if self.rows.move_to_limits(&objective, parameters.tolerance, &mut found, stop)? {
            found.fit.rounds += 1;
            let Fit { rounds: round, gap, objective, .. } = found.fit;
            progress(Round { round, rows: found.rows, objective, left: Left::Gap(gap) });
        }
        found.fit.weights.iter_mut().for_each(|w| *w *= unit);
        let (refires, fired) = self.firing(&found.fit.weights, only)?;
        Ok(ConeRFit {
            rows: found.rows,
            multipliers: found.shares.into_iter().enumerate().filter(|(_, share)| *share != 0.0).collect(),
            unreachable: self.unreachable(&objective),
            refires,
            fired,
            proof: self.name_rows(found.proof),
            fit: found.fit,
        })
    }

    /// The nonzero multipliers of a proof, by the names of their rows.
    fn name_rows(&self, mut proof: Proof) -> GapMultipliers {
        proof.divide(1.0, self.statement.unit);
        let (silent, targets) = proof.multipliers.split_at(self.rows.silent.len());
        let names = || self.rows.targets.names.iter().copied();
        let silence = silent.iter().enumerate().filter(|row| *row.1 != 0.0).map(|(row, &multiplier)| {
            let (pattern, t) = self.rows.silent.name(row);
            (Row::Silence { pattern, t }, multiplier)
        });
        let targets = names().zip(targets).filter(|row| *row.1 != 0.0);
        let targets = targets.map(|((pattern, target), &multiplier)| (Row::Target { pattern, target }, multiplier));
        GapMultipliers {
            rows: silence.chain(targets).collect(),
            behind: names().zip(proof.behind).filter(|row| row.1 != 0.0).collect(),
            pull: proof.pull,
        }
    }

    fn start_from(&self, objective: &Objective, start: Option<(&[f64], Option<&Shares>)>) -> Result<WarmStart> {
        let Some((weights, multipliers)) = start else { return Ok(WarmStart::default()) };
        one_weight_a_train(weights, self.rows.trains)?;
        let within = weights.iter().zip(objective.bounds.lower.iter().zip(&objective.bounds.upper));
        let weights = Some(within.map(|(w, (&low, &high))| (w / self.statement.unit).clamp(low, high)).collect());
        let Some(multipliers) = multipliers else { return Ok(WarmStart { weights, multipliers: None }) };
        let program = self.rows.program(objective);
        let all = program.rows();
        let mut shares = vec![0.0; all];
        for &(row, share) in multipliers {
            let Some(entry) = shares.get_mut(row) else {
                return Err(problem!("start"; ": has a multiplier of row {row}, but there are only {all} rows"));
            };
            let low = program.least_share(row);
            if !(low <= share && share <= low + 1.0) {
                return Err(problem!(
                    "start"; ": the multiplier of row {row} is {share}; must be from {low} to {}",
                    low + 1.0
                ));
            }
            *entry = share;
        }
        Ok(WarmStart { weights, multipliers: Some(shares) })
    }

    fn check_same_rows(&self, parameters: &ConeR) -> Result<()> {
        let base = &self.base;
        let same = parameters.neuron == base.neuron
            && parameters.delta_t() == base.delta_t()
            && parameters.margin == base.margin
            && parameters.horizon == base.horizon;
        if same {
            Ok(())
        } else {
            Err(problem!(
                "the rows were prepared for another neuron, delta_t_ms, margin or horizon: prepare the rows again"
            ))
        }
    }

    fn unreachable(&self, objective: &Objective) -> Vec<(usize, usize)> {
        let targets = &self.rows.targets;
        let names = targets.names.iter().zip(targets.iter());
        names.filter(|(_, row)| objective.bounds.range(row.at).1 < row.threshold).map(|(name, _)| *name).collect()
    }

    /// How often the trained neuron fires again without a target, and at how many of how many targets it fires; of one
    /// pattern alone if it is named.
    fn firing(&self, weights: &[f64], only: Option<usize>) -> Result<(usize, (usize, usize))> {
        let (mut refires, mut fired, mut wanted) = (0, 0, 0);
        let neuron = self.base.neuron.in_units(1.0 / self.statement.unit);
        for (p, pattern) in self.patterns.iter().enumerate().filter(|(p, _)| only.is_none_or(|pattern| pattern == *p)) {
            let spikes = neuron.run(weights, pattern, 1.0, Stop::never())?;
            let targets = &self.statement.examples[p].targets;
            let again = |a: f64, b: f64| b - a <= neuron.tau && !targets.iter().any(|&t| a < t && t <= b);
            refires += spikes.windows(2).filter(|w| again(w[0].t, w[1].t)).count();
            let times: Vec<f64> = spikes.iter().map(|spike| spike.t).collect();
            fired += match_spikes(("spikes", &times), ("targets", targets), WINDOW_MS, Stop::never())?.len();
            wanted += targets.len();
        }
        Ok((refires, (fired, wanted)))
    }
}
