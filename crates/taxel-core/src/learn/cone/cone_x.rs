//! CONE-X (6.9 to 6.11): weights that meet every target and keep every silence exactly, or the proof that there are none.
//!
//! Of the million silent instants a few hundred matter. A round solves the problem over a working set of rows, prices all
//! of silence at the weights found, and adds the worst instant of each stretch in which it is broken. The shortest weights
//! (l2 alone, or no objective) come from a dual active set, whose every state is a lower bound; they also decide whether
//! there are any. Other objectives go on from there.

mod mix;
mod shortest;

use serde::{Deserialize, Serialize};

use super::cone_r::{Divisor, Norm};
use crate::allowed::{Numbers, Range, ranges};
use crate::learn::statement::{Bound, bounds_of, check_bounds};
use crate::learn::statement::{Bounds, Certificate};
use crate::learn::statement::{Margin, Row, Stated, Statement};
use crate::learn::statement::{Peak, Silence};
use crate::learn::statement::{check_examples, check_some_target};
use crate::neuron::{Neuron, Time};
use crate::parameters::Described;
use crate::vectors::dot;
use crate::{Result, SpikeTrains, Stop, problem};
use shortest::{End, Shortest};

/// How far a target may be missed, mV.
const MET: f64 = 1e-12;
/// Silence counts as broken from this on, mV, and by this share of the sum of absolute weights: rounding of the sweep.
const BROKEN: f64 = 1e-13;
const BROKEN_SHARE: f64 = 2e-16;
/// The share of the margin that weights must keep to count as a solution.
const KEPT_SHARE: f64 = 0.5;
/// The margin and the slope in continuous time where none is given, mV and mV/ms.
const MARGIN: f64 = 1e-3;
/// Where no weights keep it, a smaller one is tried, down to this share of it, and to so many units.
const SMALLER: f64 = 0.1;
const LEAST_SHARE: f64 = 1e-3;
const LEAST_MARGIN: f64 = 0.99e-6;
/// An objective that is known to this share of what B is of no weights at all is known: every lift may be reached.
pub(crate) const NOTHING: f64 = 1e-10;
/// Rounds end without a verdict after so many.
const MOST_ROUNDS: usize = 1000;

/// Parameters of CONE-X; defaults from Table 6.1 and 6.4.3.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ConeX {
    /// The neuron; on the grid its step is the step of the silent rows.
    pub neuron: Neuron,
    /// What the potential shall reach behind a target, in thresholds.
    pub kappa: f64,
    /// How far behind the target, ms; `0.1 tau` where left out, as in Table 6.1.
    pub delta_t_ms: Option<f64>,
    /// `lambda_1` to `lambda_3`: l1, l2, B; only their ratios matter, all 0 asks for any weights.
    pub lambdas: [f64; 3],
    /// Least weight, mV, one for all or one a synapse.
    pub lb: Bound,
    /// Largest weight, mV, one for all or one a synapse.
    pub ub: Bound,
    /// What B is divided by.
    pub divide_b_by: Divisor,
    /// The l2 term as norm or as square.
    pub norm: Norm,
    /// How far below the threshold silence shall stay, mV; where left out 1e-3 in continuous time, 0 on the grid.
    pub margin: Option<f64>,
    /// How steeply that margin falls to 0 at a target, mV/ms; continuous time only, 1e-3 where left out.
    pub slope: Option<f64>,
    /// Where silence ends, ms, one for all or one a pattern; the later of a pattern's end and its last target + `tau` where
    /// left out.
    pub horizon: Option<Horizon>,
    /// The relative gap between objective and proven bound at which a fit counts as solved.
    pub tolerance: f64,
    /// After how long the caller asks for the best so far, s; this crate looks at no clock.
    pub max_seconds: Option<f64>,
}

/// Where silence ends, ms.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged, expecting = "must be a number, or one a pattern, ms")]
pub enum Horizon {
    /// The same in all patterns.
    All(f64),
    /// One a pattern.
    Each(Vec<f64>),
}

impl Numbers for Horizon {
    fn each(&self, look: &mut dyn FnMut(Option<usize>, f64)) {
        match self {
            Self::All(value) => value.each(look),
            Self::Each(values) => values.each(look),
        }
    }
}

impl Horizon {
    fn each(&self, patterns: usize) -> Result<Vec<f64>> {
        match self {
            Self::All(value) => Ok(vec![*value; patterns]),
            Self::Each(values) if values.len() == patterns => Ok(values.clone()),
            Self::Each(values) => {
                Err(problem!("horizon: {} values, must be one, or one a pattern, {patterns}", values.len()))
            }
        }
    }
}

impl Default for ConeX {
    fn default() -> Self {
        Self {
            neuron: Neuron::default(),
            kappa: 1.2,
            delta_t_ms: None,
            lambdas: [0.0, 1.0, 0.0],
            lb: Bound::All(-0.3),
            ub: Bound::All(0.3),
            divide_b_by: Divisor::Largest,
            norm: Norm::Norm,
            margin: None,
            slope: None,
            horizon: None,
            tolerance: 1e-8,
            max_seconds: None,
        }
    }
}

impl ConeX {
    ranges! {
        kappa: "", Range::ABOVE_0;
        delta_t_ms(delta_t): "ms", Range::FROM_0;
        lambdas: "", Range::FROM_0;
        lb: "mV", Range::FINITE;
        ub: "mV", Range::FINITE;
        margin: "mV", Range::FROM_0;
        slope: "mV/ms", Range::FROM_0;
        horizon: "ms", Range::FINITE;
        tolerance: "", Range::within(1e-12, 0.1);
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
        self.check_ranges()?;
        check_bounds(&self.lb, &self.ub)?;
        let Margin { height, slope } = self.margin();
        for (name, value, unit) in [("margin", height, "mV"), ("slope", slope, "mV/ms")] {
            if value == 0.0 && self.neuron.time == Time::Continuous {
                return Err(problem!("{name} is 0 {unit}: must be above 0 in continuous time (1e-6 will do)"));
            }
        }
        if slope > 0.0 && self.neuron.time == Time::Grid {
            return Err(problem!("slope is {slope} mV/ms: belongs to time \"continuous\", on the grid nothing tapers"));
        }
        Ok(())
    }

    /// How far behind a target B looks, ms.
    #[must_use]
    pub fn delta_t(&self) -> f64 {
        self.delta_t_ms.unwrap_or(0.1 * self.neuron.tau)
    }

    /// The margin that silence keeps.
    #[must_use]
    pub fn margin(&self) -> Margin {
        let left_out = if self.neuron.time == Time::Continuous { MARGIN } else { 0.0 };
        Margin { height: self.margin.unwrap_or(left_out), slope: self.slope.unwrap_or(left_out) }
    }

    /// The same with all potentials in units of this many mV.
    fn in_units(&self, unit: f64) -> Self {
        let Margin { height, slope } = self.margin().times(1.0 / unit);
        let neuron = self.neuron.in_units(unit);
        let (lb, ub) = (self.lb.times(1.0 / unit), self.ub.times(1.0 / unit));
        Self { neuron, lb, ub, margin: Some(height), slope: Some(slope), ..self.clone() }
    }
}

/// How a fit ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// Targets are met, silence is kept, and no weights have an objective smaller by more than the tolerance.
    Solved,
    /// There are no such weights; a certificate proves it.
    Infeasible,
    /// Neither is known: the weights are the best so far.
    Stopped,
}

/// Why a fit is stopped that was asked to.
const ASKED: &str = "asked to stop, by max_seconds or Ctrl-C";

/// What solved the problem over the working set.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Engine {
    /// taxel's own.
    #[serde(rename = "native")]
    Native,
    /// Clarabel, where the own one did not close the gap.
    #[serde(rename = "cone solver")]
    ConeSolver,
}

/// What is known after a round.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Round {
    /// Counted from 1.
    pub round: usize,
    /// Rows that are held.
    pub rows: usize,
    /// Stretches of time in which silence is broken.
    pub broken: usize,
    /// The objective at the weights of this round.
    pub objective: f64,
}

/// A fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Fit {
    /// How it ended.
    pub status: Status,
    /// mV, one a train; NaN where there are none.
    pub weights: Vec<f64>,
    /// 6.11 at these weights; infinite where there are none.
    pub objective: f64,
    /// Its terms: l1, l2, B.
    pub parts: [f64; 3],
    /// Proven relative distance to the least objective of weights that keep the whole margin.
    pub gap: f64,
    /// How far the worst row is broken: targets missed, silence with half its margin, mV.
    pub violation: f64,
    /// The margin that holds; on the grid the least threshold - potential over the silent points, as `height`.
    pub margin: Margin,
    /// The margin that was asked for at last: smaller than the first where nobody fixed it and no weights keep that.
    pub asked: Margin,
    /// Why a fit is stopped.
    pub reason: Option<String>,
    /// What solved it.
    pub engine: Engine,
    /// Rounds of row generation.
    pub rounds: usize,
    /// The rows that bind, with their multipliers: a start for a similar problem.
    pub held: Vec<(Row, f64)>,
    /// The proof, where there are no weights.
    pub certificate: Option<Certificate>,
}

/// A stated problem, ready to be solved.
///
/// Inside, potentials are in units of `Neuron::unit` mV.
#[derive(Debug, Clone)]
pub struct Problem {
    parameters: ConeX,
    statement: Statement,
    silence: Silence,
    bounds: Bounds,
    objective: Objective,
    /// Whether nobody fixed the margin.
    free_margin: bool,
}

/// What turns weights into 6.11: normalised factors and the rows of B.
#[derive(Debug, Clone)]
struct Objective {
    l1: f64,
    l2: f64,
    b: f64,
    norm: Norm,
    /// The rows behind the targets, one after the other, and what the potential shall reach there, mV.
    behind: Vec<f64>,
    wanted: Vec<f64>,
}

impl Objective {
    fn new(parameters: &ConeX, statement: &Statement, bounds: &Bounds) -> Result<Self> {
        let sum: f64 = parameters.lambdas.iter().sum();
        let [l1, l2, b] = parameters.lambdas.map(|l| if sum > 0.0 { l / sum } else { 0.0 });
        let most: Vec<f64> = bounds.lower.iter().zip(&bounds.upper).map(|(l, u)| l.abs().max(u.abs())).collect();
        let (mut behind, mut wanted, mut b_max) = (Vec::new(), Vec::new(), 0.0);
        for (pattern, target) in statement.targets() {
            let row = statement.behind(pattern, target, parameters.delta_t())?;
            wanted.push(parameters.kappa * row.limit);
            b_max += (dot(&row.coefficients, &most) + parameters.kappa * row.limit).powi(2);
            behind.extend(row.coefficients);
        }
        let over = |share: f64, most: f64| if most > 0.0 { share / most } else { 0.0 };
        let square = dot(&most, &most);
        Ok(Self {
            l1: over(l1, most.iter().sum()),
            l2: match parameters.norm {
                Norm::Norm => over(l2, square.sqrt()),
                Norm::Square => over(l2, square),
            },
            b: match parameters.divide_b_by {
                Divisor::Largest => over(b, b_max),
                // A sum of squares over a number: the one term that is no ratio of potentials.
                Divisor::Targets => over(b, wanted.len() as f64) * statement.unit.powi(2),
            },
            norm: parameters.norm,
            behind,
            wanted,
        })
    }

    fn parts(&self, weights: &[f64]) -> [f64; 3] {
        let rows = self.behind.chunks_exact(weights.len());
        let missed: f64 = rows.zip(&self.wanted).map(|(row, wanted)| (dot(row, weights) - wanted).powi(2)).sum();
        [self.l1 * weights.iter().map(|w| w.abs()).sum::<f64>(), self.of_square(dot(weights, weights)), self.b * missed]
    }

    /// The l2 term of weights whose squares sum to this.
    fn of_square(&self, square: f64) -> f64 {
        self.l2 * if self.norm == Norm::Norm { square.sqrt() } else { square }
    }
}

/// The best weights so far, and what is known of them.
struct Best {
    weights: Vec<f64>,
    /// No weights have a smaller objective.
    least: f64,
    held: Vec<(Row, f64)>,
    engine: Engine,
    rounds: usize,
}

impl Problem {
    /// States the problem of these patterns and targets (ms).
    ///
    /// # Errors
    ///
    /// `Problem` for parameters or examples that make no sense (names pattern and target); `Interrupted`.
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
        let (lower, upper) = bounds_of(&parameters.lb, &parameters.ub, trains)?;
        let bounds = Bounds { lower, upper };
        let mut ends = match &parameters.horizon {
            Some(horizon) => horizon.each(patterns.len())?,
            None => patterns.iter().map(|pattern| pattern.stop).collect(),
        };
        for (p, ((end, targets), pattern)) in ends.iter_mut().zip(targets).zip(patterns).enumerate() {
            if parameters.horizon.is_none() {
                *end = targets.last().map_or(*end, |last| end.max(last + neuron.tau));
            } else if let Some(last) = targets.last().filter(|last| *last > end) {
                return Err(problem!("pattern {p}: last target at {last} ms, the horizon is {end} ms"));
            } else if *end < pattern.start {
                return Err(problem!("pattern {p}: starts at {} ms, the horizon is {end} ms", pattern.start));
            }
        }
        stop.check()?;
        if neuron.time == Time::Grid {
            let points = patterns.iter().zip(&ends).map(|(pattern, end)| neuron.points(pattern.start, *end)).sum();
            neuron.check_rows(points)?;
        }
        let statement = Statement::new(neuron, parameters.margin(), unit, patterns, targets, &ends);
        let objective = Objective::new(&parameters, &statement, &bounds)?;
        stop.check()?;
        let silence = Silence::new(&statement);
        Ok(Self { parameters, statement, silence, bounds, objective, free_margin })
    }

    /// The same problem with another margin, mV and mV/ms.
    #[must_use]
    pub fn with_margin(&self, margin: Margin) -> Self {
        let statement = self.statement.with_margin(margin.times(1.0 / self.statement.unit));
        Self { silence: Silence::new(&statement), statement, ..self.clone() }
    }

    /// What margin its rows have, mV and mV/ms.
    #[must_use]
    pub fn margin(&self) -> Margin {
        self.statement.margin.times(self.statement.unit)
    }

    /// A row, with or without its margin, mV (a slope row: mV/ms).
    ///
    /// # Errors
    ///
    /// `Problem` where there is no such row.
    pub fn row(&self, row: Row, margin: bool) -> Result<Stated> {
        let mut stated = self.statement.state(row)?;
        stated.limit += if margin { 0.0 } else { self.statement.margin_of(row) };
        stated.limit *= self.statement.unit;
        Ok(stated)
    }

    /// The weights that are allowed, mV.
    #[must_use]
    pub fn bounds(&self) -> Bounds {
        let times = |side: &[f64]| side.iter().map(|w| w * self.statement.unit).collect();
        Bounds { lower: times(&self.bounds.lower), upper: times(&self.bounds.upper) }
    }

    /// What B looks at behind a target: coefficients, and `kappa` thresholds.
    ///
    /// # Errors
    ///
    /// `Problem` where there is no such target.
    pub fn behind(&self, pattern: usize, target: usize) -> Result<Stated> {
        let mut stated = self.statement.behind(pattern, target, self.parameters.delta_t())?;
        stated.limit *= self.parameters.kappa * self.statement.unit;
        Ok(stated)
    }

    /// Finds the weights, or the proof that there are none; where it is stopped, the best so far.
    ///
    /// `start` are the rows that bound in an earlier fit of a similar problem, with their multipliers.
    ///
    /// # Errors
    ///
    /// `Problem` for a start that makes no sense.
    pub fn fit(&self, start: &[(Row, f64)], progress: &mut dyn FnMut(Round), stop: Stop<'_>) -> Result<Fit> {
        let unit = self.statement.unit;
        let start: Vec<(Row, f64)> = start.iter().map(|&(row, multiplier)| (row, multiplier / unit)).collect();
        let mut fit = self.solve(&start, progress, stop)?;
        let (first, mut rounds) = (self.statement.margin, fit.rounds);
        let not_at_all = |fit: &Fit| fit.certificate.as_ref().is_some_and(|proof| !proof.at_all);
        while self.free_margin && not_at_all(&fit) {
            let margin = fit.asked.times(SMALLER);
            if margin.height < (0.99 * LEAST_SHARE * first.height).max(LEAST_MARGIN) {
                fit = self.undecided(&fit, rounds);
                break;
            }
            let mut told = |round: Round| progress(Round { round: rounds + round.round, ..round });
            fit = self.with_margin(margin.times(unit)).solve(&start, &mut told, stop)?;
            rounds += fit.rounds;
        }
        fit.rounds = rounds;
        fit.asked = fit.asked.times(unit);
        fit.weights.iter_mut().for_each(|w| *w *= unit);
        fit.violation *= unit;
        fit.margin = fit.margin.times(unit);
        fit.held.iter_mut().for_each(|(_, multiplier)| *multiplier *= unit);
        if let Some(certificate) = &mut fit.certificate {
            certificate.gap *= unit;
        }
        Ok(fit)
    }

    fn solve(&self, start: &[(Row, f64)], progress: &mut dyn FnMut(Round), stop: Stop<'_>) -> Result<Fit> {
        if let Some(certificate) = Certificate::of_one_target(&self.statement, &self.bounds)? {
            return Ok(self.refuted(certificate, 0));
        }
        let Shortest { weights, held, rounds, end } = self.shortest(start, progress, stop)?;
        // The other terms are never below 0.
        let least = self.objective.of_square(self.bound_of_square(&held)?);
        let best = Best { weights, least, held, engine: Engine::Native, rounds };
        match end {
            End::Infeasible(certificate) => Ok(self.refuted(certificate, rounds)),
            End::Met if self.objective.l1 > 0.0 || self.objective.b > 0.0 => {
                let best = self.mix(best, start, progress, stop)?;
                self.report(best, stop.asked().then_some(ASKED))
            }
            End::Met => self.report(best, None),
            End::Stopped if stop.asked() => self.report(best, Some(ASKED)),
            End::Stopped => self.report(best, Some("rows that rounding cannot tell apart are neither met nor refuted")),
        }
    }

    /// A verdict that holds for the least margin only says nothing of smaller ones.
    fn undecided(&self, fit: &Fit, rounds: usize) -> Fit {
        let Margin { height, slope } = fit.asked.times(self.statement.unit);
        let proof = fit.certificate.as_ref().map_or("", |proof| proof.text.as_str());
        let reason = format!(
            "no weights keep silence {height:.1e} mV below the threshold and come up to targets by {slope:.1e} mV/ms, the \
             least margin that is tried; whether any do with less is not known ({proof})"
        );
        Fit {
            status: Status::Stopped,
            reason: Some(reason),
            certificate: None,
            gap: f64::INFINITY,
            rounds,
            held: vec![],
            ..fit.clone()
        }
    }

    fn refuted(&self, certificate: Certificate, rounds: usize) -> Fit {
        Fit {
            status: Status::Infeasible,
            weights: vec![f64::NAN; self.statement.trains],
            objective: f64::INFINITY,
            parts: [f64::INFINITY; 3],
            gap: 0.0,
            violation: f64::INFINITY,
            margin: Margin { height: f64::NAN, slope: f64::NAN },
            asked: self.statement.margin,
            reason: None,
            engine: Engine::Native,
            rounds,
            held: certificate.rows.clone(),
            certificate: Some(certificate),
        }
    }

    /// Measures the weights over all rows, whatever engine they come from.
    fn report(&self, best: Best, cut_short: Option<&str>) -> Result<Fit> {
        let Best { mut weights, least, held, engine, rounds } = best;
        // A bound that binds is met to rounding, from either side.
        for ((w, &l), &u) in weights.iter_mut().zip(&self.bounds.lower).zip(&self.bounds.upper) {
            *w = w.clamp(l, u);
        }
        let parts = self.objective.parts(&weights);
        let objective: f64 = parts.iter().sum();
        let nothing = NOTHING * self.objective.b * dot(&self.objective.wanted, &self.objective.wanted);
        let above = (objective - least).max(0.0);
        let gap = if above > 0.0 { above / objective } else { 0.0 };
        let known = gap <= self.parameters.tolerance || above <= nothing;
        let (missed, broken) = (self.missed(&weights)?, self.worst(&weights));
        let kept = missed <= MET && broken <= self.rounding(&weights);
        let unit = self.statement.unit;
        let reason = if let Some(reason) = cut_short {
            Some(reason.to_owned())
        } else if !kept {
            Some(format!(
                "targets are missed by {:.1e} mV, silence is broken by {:.1e} mV",
                missed * unit,
                broken * unit
            ))
        } else if !known {
            Some(format!("the objective is only proven to lie within {gap:.1e} of its least value"))
        } else {
            None
        };
        Ok(Fit {
            status: if reason.is_none() { Status::Solved } else { Status::Stopped },
            reason,
            asked: self.statement.margin,
            margin: self.kept_margin(&weights),
            weights,
            objective,
            parts,
            gap,
            violation: largest([missed, broken, 0.0]),
            engine,
            rounds,
            held,
            certificate: None,
        })
    }

    /// How far the worst target is missed, mV.
    fn missed(&self, weights: &[f64]) -> Result<f64> {
        let mut row = vec![0.0; weights.len()];
        let mut worst: f64 = 0.0;
        for (pattern, target) in self.statement.targets() {
            let limit = self.statement.state_into(Row::Target { pattern, target }, &mut row)?;
            worst = largest([worst, (dot(&row, weights) - limit).abs()]);
        }
        Ok(worst)
    }

    /// Where silence is broken with this share of the margin; on the grid the whole, as nothing lies between its rows.
    fn broken(&self, weights: &[f64], share: f64, tolerance: f64) -> Vec<Peak> {
        let grid = self.parameters.neuron.time == Time::Grid;
        self.silence.broken(weights, if grid { 1.0 } else { share }, tolerance)
    }

    /// By how much silence is broken at worst, mV; below 0 where it is kept.
    fn worst(&self, weights: &[f64]) -> f64 {
        largest(self.broken(weights, KEPT_SHARE, f64::NEG_INFINITY).iter().map(|peak| peak.excess))
    }

    fn rounding(&self, weights: &[f64]) -> f64 {
        let grid = self.parameters.neuron.time == Time::Grid;
        let least = if grid { MET } else { BROKEN };
        least.max(BROKEN_SHARE * weights.iter().map(|w| w.abs()).sum::<f64>())
    }

    /// The largest share of the margin that holds, 0 where silence is broken; on the grid the least threshold - potential.
    fn kept_margin(&self, weights: &[f64]) -> Margin {
        if self.parameters.neuron.time == Time::Grid {
            let peaks = self.silence.broken(weights, 0.0, f64::NEG_INFINITY);
            return Margin { height: -largest(peaks.iter().map(|peak| peak.excess)), slope: 0.0 };
        }
        // At the worst instants potential + share margin = threshold gives the next share; the shares only fall.
        let mut share = 1.0;
        loop {
            let broken = self.silence.broken(weights, share, self.rounding(weights));
            let less = broken.iter().map(|peak| {
                let sheet = &self.statement.sheets[peak.pattern];
                peak.excess / self.statement.margin_at(sheet, peak.t)
            });
            let next = share - largest(less.chain([0.0]));
            // Weights of a fit that was stopped may keep none at all.
            if next.is_nan() || next <= 0.0 {
                return self.statement.margin.times(0.0);
            }
            if next >= share {
                return self.statement.margin.times(share);
            }
            share = next;
        }
    }
}

/// Slope rows, which no sweep prices.
#[derive(Debug)]
struct Slopes(Vec<(Row, Stated)>);

impl Slopes {
    fn new(statement: &Statement) -> Result<Self> {
        if statement.neuron.time == Time::Grid {
            return Ok(Self(vec![]));
        }
        let rows = statement.targets().map(|(pattern, target)| Row::Slope { pattern, target });
        Ok(Self(rows.map(|row| Ok((row, statement.state(row)?))).collect::<Result<_>>()?))
    }

    /// Those that are broken even with so much less slope.
    fn broken(&self, weights: &[f64], left_out: f64) -> Vec<usize> {
        let kept = |row: &Stated| dot(&row.coefficients, weights) <= row.limit + left_out;
        (0..self.0.len()).filter(|&k| !kept(&self.0[k].1)).collect()
    }
}

/// The largest value, or no number where one is none.
fn largest(values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().fold(f64::NEG_INFINITY, |most, x| if x <= most || most.is_nan() { most } else { x })
}
