//! CONE-R (6.12 to 6.14): the best weights where targets and silence cannot all be met, solved to a proven gap.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::allowed::{Range, ranges};
use crate::learn::engines::START_NEAR_MS;
use crate::learn::engines::Start;
use crate::learn::statement::{Bound, bounds_of, check_bounds};
use crate::learn::statement::{Layout, SilentRows, TargetRow, target_rows};
use crate::learn::statement::{check_examples, check_trains};
use crate::neuron::{Neuron, Time};
use crate::parameters::Described;
use crate::vectors::{add, dot};
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

/// Who finds the least objective.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Engine {
    /// Newton steps on the few rows near threshold; where their result cannot be proven, the cone solver goes on from it.
    #[default]
    #[serde(rename = "native")]
    Native,
    /// Row generation around the cone solver Clarabel.
    #[serde(rename = "cone solver")]
    ConeSolver,
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
    pub lb: Bound,
    /// Largest weight, mV.
    pub ub: Bound,
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
    /// Who solves.
    pub engine: Engine,
    /// After how long the caller asks for the best so far, s; this crate looks at no clock.
    pub max_seconds: Option<f64>,
}

impl Default for ConeR {
    fn default() -> Self {
        Self {
            neuron: Neuron { time: Time::Grid, ..Neuron::default() },
            kappa: 1.2,
            delta_t_ms: None,
            lambdas: [2.8, 1.2, 100.0, 100.0, 80.0],
            lb: Bound::All(-0.3),
            ub: Bound::All(0.3),
            divide_b_by: Divisor::Largest,
            norm: Norm::Norm,
            margin: 0.0,
            horizon: None,
            tolerance: 1e-6,
            engine: Engine::Native,
            max_seconds: None,
        }
    }
}

impl ConeR {
    ranges! {
        kappa: "", Range::ABOVE_0;
        delta_t_ms(delta_t): "ms", Range::FROM_0;
        lambdas: "", Range::FROM_0;
        lb: "mV", Range::FINITE;
        ub: "mV", Range::FINITE;
        margin: "mV", Range::FROM_0;
        horizon: "ms", Range::FINITE;
        tolerance: "", Range::within(1e-10, 0.1);
        max_seconds: "s", Range::ABOVE_0;
    }

    /// Its parameters, with their defaults and ranges.
    #[must_use]
    pub fn described() -> Described {
        Described::by(&Self::default(), &[], Self::RANGES)
    }

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
        self.check_ranges()?;
        if self.lambdas.iter().sum::<f64>() == 0.0 {
            return Err(problem!("lambdas are all 0: at least one must be above 0"));
        }
        check_bounds(&self.lb, &self.ub)
    }

    /// How far behind a target B looks, ms.
    #[must_use]
    pub fn delta_t(&self) -> f64 {
        self.delta_t_ms.unwrap_or(0.1 * self.neuron.tau)
    }

    /// Checks that the horizon lies behind the last target of pattern `p`.
    pub(crate) fn check_horizon(&self, p: usize, targets: &[f64]) -> Result<()> {
        match (self.horizon, targets.last()) {
            (Some(horizon), Some(&last)) if last > horizon => {
                Err(problem!("pattern {p}: last target at {last} ms, the horizon is {horizon} ms"))
            }
            _ => Ok(()),
        }
    }

    /// How many grid points a pattern has: to its stop, or one `tau` past its last target, or the horizon.
    pub(crate) fn points(&self, pattern: &SpikeTrains, targets: &[f64]) -> f64 {
        let last = targets.last().map_or(pattern.stop, |t| pattern.stop.max(t + self.neuron.tau));
        self.neuron.points(pattern.start, self.horizon.unwrap_or(last))
    }

    pub(crate) fn layout(&self) -> Layout<'_> {
        Layout { neuron: &self.neuron, horizon: self.horizon, margin: self.margin, near_ms: START_NEAR_MS }
    }

    /// The same with all potentials in units of this many mV.
    fn in_units(&self, unit: f64) -> Self {
        let (lb, ub) = (self.lb.times(1.0 / unit), self.ub.times(1.0 / unit));
        Self { neuron: self.neuron.in_units(unit), lb, ub, margin: self.margin / unit, ..self.clone() }
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
    pub(crate) fn sum(&self) -> f64 {
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

/// The multipliers that prove a fit: those that are not 0, by row (the silent ones, then the targets).
///
/// As shares of the row's weight in 6.14, of C's twice: from 0 to 1 on a silent row, from -1/2 to 1/2 at a target.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Shares {
    /// Ascending.
    pub rows: Vec<usize>,
    /// One a row.
    pub values: Vec<f64>,
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
    /// Who found it.
    pub engine: Engine,
    /// What a fit nearby may start from, beside the weights.
    pub multipliers: Shares,
    /// Targets, as (pattern, target), that no weights within the bounds bring to the threshold.
    pub unreachable: Vec<(usize, usize)>,
    /// Output spikes on the training patterns that follow another one, with no target between, within `tau`.
    pub refires: usize,
}

/// The rows of one set of examples: made once, solved for many `lambdas`, `kappa`, bounds and divisors.
///
/// Inside, potentials are in units of `unit` mV, a power of 2 near theta_0 over 0.3.
#[derive(Debug, Clone)]
pub struct Problem {
    pub(crate) base: ConeR,
    unit: f64,
    patterns: Vec<SpikeTrains>,
    pub(crate) trains: usize,
    pub(crate) targets: Arc<Vec<TargetRow>>,
    pub(crate) silent: SilentRows,
    /// Rows behind the targets, one after the other, and their `B'B` by columns.
    pub(crate) behind: Arc<Vec<f64>>,
    pub(crate) gram: Arc<Vec<f64>>,
}

/// Everything that turns potentials into 6.14: the parameters with their normalisers.
#[derive(Debug, Clone)]
pub(crate) struct Objective {
    pub(crate) l1: f64,
    pub(crate) l2: f64,
    pub(crate) b: f64,
    pub(crate) c: f64,
    pub(crate) d: f64,
    pub(crate) kappa: f64,
    pub(crate) norm: Norm,
    /// Least and largest weights, one a synapse, mV.
    pub(crate) lower: Vec<f64>,
    pub(crate) upper: Vec<f64>,
}

impl Objective {
    /// The same, every term times `scale`.
    pub(crate) fn scaled(&self, scale: f64) -> Self {
        let (l1, l2, b, c, d) = (self.l1 * scale, self.l2 * scale, self.b * scale, self.c * scale, self.d * scale);
        Self { l1, l2, b, c, d, ..self.clone() }
    }

    /// No weights whose 6.14 is `most` or less hold one larger than this: l1 and l2 alone would come to more.
    pub(crate) fn reach(&self, most: f64) -> f64 {
        let reach = match self.norm {
            Norm::Norm => most / (self.l1 + self.l2),
            Norm::Square => (most / self.l1).min((most / self.l2).sqrt()),
        };
        // Nothing is lost by rounding; where there is neither, nothing is said.
        if reach.is_nan() { f64::INFINITY } else { reach * (1.0 + 1e-9) }
    }

    /// The same within bounds as narrow as that: the least lies within them too.
    pub(crate) fn within_reach(&self, most: f64) -> Self {
        let reach = self.reach(most);
        let lower = self.lower.iter().map(|l| l.max(-reach)).collect();
        let upper = self.upper.iter().map(|u| u.min(reach)).collect();
        Self { lower, upper, ..self.clone() }
    }
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
        for (p, targets) in targets.iter().enumerate() {
            parameters.check_horizon(p, targets)?;
        }
        neuron.check_rows(patterns.iter().zip(targets).map(|(p, t)| parameters.points(p, t)).sum())?;
        Self::laid_out(parameters, patterns, targets, stop)
    }

    /// Lays out one pattern, which may be without targets: others will follow.
    pub(crate) fn of_one(parameters: &ConeR, pattern: &SpikeTrains, targets: &[f64], stop: Stop<'_>) -> Result<Self> {
        Self::laid_out(parameters, std::slice::from_ref(pattern), &[targets.to_vec()], stop)
    }

    fn laid_out(parameters: &ConeR, patterns: &[SpikeTrains], targets: &[Vec<f64>], stop: Stop<'_>) -> Result<Self> {
        let unit = parameters.neuron.unit();
        let parameters = parameters.in_units(unit);
        let neuron = &parameters.neuron;
        let rows = target_rows(neuron, parameters.delta_t(), patterns, targets);
        stop.check()?;
        let silent = SilentRows::new(parameters.layout(), patterns, targets, stop)?;
        let trains = patterns[0].len();
        let mut problem = Self {
            base: parameters,
            unit,
            patterns: patterns.to_vec(),
            trains,
            targets: Arc::new(rows),
            silent,
            behind: Arc::default(),
            gram: Arc::new(vec![0.0; trains * trains]),
        };
        for k in 0..problem.targets.len() {
            stop.check()?;
            problem.lift(k, 1.0);
        }
        Ok(problem)
    }

    /// Counts the row behind target `k` into B's matrix, or, with -1, out of it.
    fn lift(&mut self, k: usize, sign: f64) {
        let row = &self.targets[k].behind;
        if sign > 0.0 {
            Arc::make_mut(&mut self.behind).extend_from_slice(row);
        }
        for (column, &v) in Arc::make_mut(&mut self.gram).chunks_exact_mut(self.trains).zip(row) {
            add(column, sign * v, row);
        }
    }

    /// Adds one more pattern; gives how many silent and free rows it has.
    pub(crate) fn push(&mut self, pattern: &SpikeTrains, targets: &[f64], stop: Stop<'_>) -> Result<usize> {
        let before = self.silent.len();
        self.silent.push(self.base.layout(), pattern, targets, stop)?;
        let (neuron, delta_t) = (&self.base.neuron, self.base.delta_t());
        let rows = target_rows(neuron, delta_t, std::slice::from_ref(pattern), &[targets.to_vec()]);
        let number = self.patterns.len();
        self.patterns.push(pattern.clone());
        for row in rows {
            Arc::make_mut(&mut self.targets).push(TargetRow { pattern: number, ..row });
            self.lift(self.targets.len() - 1, 1.0);
        }
        Ok(self.silent.len() - before)
    }

    /// Takes the first pattern away; gives how many silent and free rows, and how many targets, went with it.
    pub(crate) fn drop_first(&mut self) -> (usize, usize) {
        let before = self.silent.len();
        self.silent.drop_first();
        self.patterns.remove(0);
        let gone = self.targets.partition_point(|row| row.pattern == 0);
        for k in 0..gone {
            self.lift(k, -1.0);
        }
        Arc::make_mut(&mut self.behind).drain(..gone * self.trains);
        let targets = Arc::make_mut(&mut self.targets);
        targets.drain(..gone);
        targets.iter_mut().for_each(|row| row.pattern -= 1);
        (before - self.silent.len(), gone)
    }

    /// The same, but of the silent rows the named ones alone, written out; for solving, not for judging.
    pub(crate) fn of_rows(&self, rows: &[usize]) -> Self {
        Self {
            base: self.base.clone(),
            unit: self.unit,
            patterns: vec![],
            trains: self.trains,
            targets: Arc::clone(&self.targets),
            silent: self.silent.written_out(rows),
            behind: Arc::clone(&self.behind),
            gram: Arc::clone(&self.gram),
        }
    }

    pub(crate) fn check_trains(&self, p: usize, pattern: &SpikeTrains) -> Result<()> {
        check_trains(p, pattern, self.trains)
    }

    pub(crate) fn patterns(&self) -> usize {
        self.patterns.len()
    }

    pub(crate) fn silent_and_free_rows(&self) -> usize {
        self.silent.len()
    }

    /// How many rows there are: silent ones, grid points at which nothing is asked, targets.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.silent.len() + self.targets.len()
    }

    /// How many silent rows there are.
    #[must_use]
    pub fn silent_rows(&self) -> usize {
        self.silent.limit.iter().filter(|l| l.is_finite()).count()
    }

    /// How large weights must be for targets to be met, mV.
    pub(crate) fn needed(&self) -> f64 {
        let length = |row: &TargetRow| dot(&row.at, &row.at).sqrt();
        let (thresholds, lengths) =
            self.targets.iter().fold((0.0, 0.0), |sum, row| (sum.0 + row.threshold, sum.1 + length(row)));
        if lengths > 0.0 { thresholds / lengths } else { f64::INFINITY }
    }

    /// The five normalised weights of 6.14.
    ///
    /// Reading: 6.3.2 takes each term's largest value over the bounds, which lie at -ub and ub; where they do not, over
    /// -max(|lb|, |ub|) to max(|lb|, |ub|), synapse by synapse.
    fn objective(&self, parameters: &ConeR) -> Result<Objective> {
        let [l1, l2, b, c, d] = parameters.shares();
        let (lower, upper) = bounds_of(&parameters.lb, &parameters.ub, self.trains)?;
        let largest: Vec<f64> = lower.iter().zip(&upper).map(|(l, u)| l.abs().max(u.abs())).collect();
        let over = |share: f64, most: f64| if most > 0.0 { share / most } else { 0.0 };
        let rows_at = |r: &TargetRow| {
            let (at, behind) = (dot(&r.at, &largest), dot(&r.behind, &largest));
            ((behind + parameters.kappa * r.threshold).powi(2), at + r.threshold)
        };
        let (b_max, c_max) = self.targets.iter().map(rows_at).fold((0.0, 0.0), |s, v| (s.0 + v.0, s.1 + v.1));
        let mut potential = Vec::new();
        if d > 0.0 {
            self.silent.potential(&largest, &mut potential);
        }
        let d_max: f64 = potential.iter().zip(&self.silent.limit).map(|(u, l)| (u - l).max(0.0)).sum();
        let square = dot(&largest, &largest);
        Ok(Objective {
            l1: over(l1, largest.iter().sum()),
            l2: match parameters.norm {
                Norm::Norm => over(l2, square.sqrt()),
                Norm::Square => over(l2, square),
            },
            b: match parameters.divide_b_by {
                Divisor::Largest => over(b, b_max),
                // A sum of squares over a number: the one term that is no ratio of potentials.
                Divisor::Targets => b / self.targets.len().max(1) as f64 * self.unit.powi(2),
            },
            c: over(c, c_max),
            d: over(d, d_max),
            kappa: parameters.kappa,
            norm: parameters.norm,
            lower,
            upper,
        })
    }

    /// Fits the weights.
    ///
    /// `parameters` may differ from those that the problem was made with in `lambdas`, `kappa`, bounds, `divide_b_by`,
    /// `norm`, `tolerance` and `engine`; the rest is in the rows. `start` are weights of a similar fit, and its multipliers
    /// where it was of these very rows: the closer, the quicker. Where `stop` asks for an end, the best so far comes back.
    ///
    /// # Errors
    ///
    /// `Problem` for parameters that make no sense or that need other rows.
    pub fn fit(
        &self,
        parameters: &ConeR,
        start: Option<(&[f64], Option<&Shares>)>,
        progress: &mut dyn FnMut(Round),
        stop: Stop<'_>,
    ) -> Result<Fit> {
        self.fit_counting(parameters, start, None, progress, stop)
    }

    /// As `fit`; counts refiring on one pattern alone where one is named.
    pub(crate) fn fit_counting(
        &self,
        parameters: &ConeR,
        start: Option<(&[f64], Option<&Shares>)>,
        pattern: Option<usize>,
        progress: &mut dyn FnMut(Round),
        stop: Stop<'_>,
    ) -> Result<Fit> {
        parameters.check()?;
        let parameters = &parameters.in_units(self.unit);
        self.check_same_rows(parameters)?;
        let objective = self.objective(parameters)?;
        let start = self.start_from(&objective, start)?;
        let mut found = self.minimise(&objective, parameters.tolerance, parameters.engine, start, progress, stop)?;
        self.meet(&objective, parameters.tolerance, &mut found, stop)?;
        let weights: Vec<f64> = found.weights.iter().map(|w| w * self.unit).collect();
        let kept = || found.shares.iter().enumerate().filter(|s| *s.1 != 0.0);
        Ok(Fit {
            objective: found.objective,
            parts: found.parts,
            gap: found.gap,
            rounds: found.rounds,
            rows: found.rows,
            status: if found.gap <= parameters.tolerance { Status::Solved } else { Status::Stopped },
            engine: found.engine,
            multipliers: Shares { rows: kept().map(|s| s.0).collect(), values: kept().map(|s| *s.1).collect() },
            unreachable: self.unreachable(&objective),
            refires: self.refires(&weights, pattern)?,
            weights,
        })
    }

    fn start_from(&self, objective: &Objective, start: Option<(&[f64], Option<&Shares>)>) -> Result<Start> {
        let Some((weights, multipliers)) = start else { return Ok(Start::default()) };
        crate::allowed::one_weight_a_train(weights, self.trains)?;
        let within = weights.iter().zip(objective.lower.iter().zip(&objective.upper));
        let weights = Some(within.map(|(w, (&low, &high))| (w / self.unit).clamp(low, high)).collect());
        let Some(multipliers) = multipliers else { return Ok(Start { weights, shares: None }) };
        let silent = self.silent.len();
        let mut shares = vec![0.0; silent + self.targets.len()];
        for (&row, &share) in multipliers.rows.iter().zip(&multipliers.values) {
            let Some(place) = shares.get_mut(row) else {
                return Err(problem!(
                    "start: a multiplier of row {row}, there are {} rows",
                    silent + self.targets.len()
                ));
            };
            let low = if row < silent { 0.0 } else { -0.5 };
            if !(low <= share && share <= low + 1.0) {
                return Err(problem!(
                    "start: the multiplier of row {row} is {share}, must lie from {low} to {}",
                    low + 1.0
                ));
            }
            *place = share;
        }
        Ok(Start { weights, shares: Some(shares) })
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
            Err(problem!("neuron, delta_t_ms, margin and horizon are in the rows: lay them out anew"))
        }
    }

    fn unreachable(&self, objective: &Objective) -> Vec<(usize, usize)> {
        let most = |row: &TargetRow| row.at.iter().zip(&objective.upper).map(|(v, u)| v * u).sum::<f64>();
        let out_of_reach = |row: &&TargetRow| most(row) < row.threshold;
        self.targets.iter().filter(out_of_reach).map(|r| (r.pattern, r.target)).collect()
    }

    fn refires(&self, weights: &[f64], only: Option<usize>) -> Result<usize> {
        let mut refires = 0;
        let neuron = self.base.neuron.in_units(1.0 / self.unit);
        for (p, pattern) in self.patterns.iter().enumerate().filter(|(p, _)| only.is_none_or(|one| one == *p)) {
            let spikes = neuron.run(weights, pattern, 1.0, Stop::never())?;
            let targets: Vec<f64> = self.targets.iter().filter(|r| r.pattern == p).map(|r| r.t).collect();
            let again = |a: f64, b: f64| b - a <= neuron.tau && !targets.iter().any(|&t| a < t && t <= b);
            refires += spikes.windows(2).filter(|w| again(w[0].t, w[1].t)).count();
        }
        Ok(refires)
    }
}
