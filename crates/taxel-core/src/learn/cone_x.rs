//! CONE-X (6.9 to 6.11): weights that meet every target and keep every silence exactly, or the proof that there are none.
//!
//! Of the million silent instants a few hundred matter. A round solves the problem over a working set of rows, prices all
//! of silence at the weights found, and adds the worst instant of each stretch in which it is broken. The shortest weights
//! (l2 alone, or no objective) come from a dual active set, whose every state is a lower bound; they also decide whether
//! there are any. Other objectives go on from there.

use std::collections::HashSet;

use serde::{Deserialize, Serialize};

use super::certificate::{Bounds, Certificate};
use super::cone_r::{Divisor, Norm};
use super::dual_active_set::{DualActiveSet, Multipliers, RowId, Verdict};
use super::silence::{Peak, Silence};
use super::statement::{Margin, Row, Statement};
use super::{OneOrEach, check_examples};
use crate::neuron::{Neuron, Time};
use crate::{Result, SpikeTrains, Stop, problem};

/// How far a target may be missed, mV.
const MET: f64 = 1e-12;
/// Silence counts as broken from this on, mV, and by this share of the sum of absolute weights: rounding of the sweep.
const BROKEN: f64 = 1e-13;
const BROKEN_SHARE: f64 = 2e-16;
/// Cut with the full margin, ask for this share of it: so rounds end.
const ASKED_SHARE: f64 = 0.5;
/// The margin and the slope in continuous time where none is given, mV and mV/ms.
const MARGIN: f64 = 1e-3;
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
    pub lb: OneOrEach,
    /// Largest weight, mV, one for all or one a synapse.
    pub ub: OneOrEach,
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
    pub horizon: Option<OneOrEach>,
    /// The relative gap between objective and proven bound at which a fit counts as solved.
    pub tolerance: f64,
}

impl Default for ConeX {
    fn default() -> Self {
        Self {
            neuron: Neuron::default(),
            kappa: 1.2,
            delta_t_ms: None,
            lambdas: [0.0, 1.0, 0.0],
            lb: OneOrEach::One(-0.3),
            ub: OneOrEach::One(0.3),
            divide_b_by: Divisor::Largest,
            norm: Norm::Norm,
            margin: None,
            slope: None,
            horizon: None,
            tolerance: 1e-8,
        }
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
        if !(self.kappa.is_finite() && self.kappa > 0.0) {
            return Err(problem!("kappa is {}: must be above 0 and finite", self.kappa));
        }
        if !(self.delta_t().is_finite() && self.delta_t() >= 0.0) {
            return Err(problem!("delta_t_ms is {}: must be 0 or more and finite", self.delta_t()));
        }
        if let Some(k) = self.lambdas.iter().position(|l| !(l.is_finite() && *l >= 0.0)) {
            return Err(problem!("lambdas[{k}] is {}: must be 0 or more and finite", self.lambdas[k]));
        }
        for (name, bound) in [("lb", &self.lb), ("ub", &self.ub)] {
            if let Some(value) = bound.values().iter().find(|v| !v.is_finite()) {
                return Err(problem!("{name} is {value} mV: must be finite, no proof holds without bounds"));
            }
        }
        let Margin { height, slope } = self.margin();
        for (name, value, unit) in [("margin", height, "mV"), ("slope", slope, "mV/ms")] {
            if !(value.is_finite() && value >= 0.0) {
                return Err(problem!("{name} is {value} {unit}: must be 0 or more and finite"));
            }
            if value == 0.0 && self.neuron.time == Time::Continuous {
                return Err(problem!("{name} is 0 {unit}: must be above 0 in continuous time (1e-6 will do)"));
            }
        }
        if slope > 0.0 && self.neuron.time == Time::Grid {
            return Err(problem!("slope is {slope} mV/ms: belongs to time \"continuous\", on the grid nothing tapers"));
        }
        if let Some(horizon) = self.horizon.iter().flat_map(OneOrEach::values).find(|h| !h.is_finite()) {
            return Err(problem!("horizon is {horizon} ms: must be finite"));
        }
        if !(1e-12..=0.1).contains(&self.tolerance) {
            return Err(problem!("tolerance is {}: must lie between 1e-12 and 0.1", self.tolerance));
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
    /// Proven relative distance to the least objective.
    pub gap: f64,
    /// How far the worst row is broken: targets missed, silence with half its margin, mV.
    pub violation: f64,
    /// The margin that holds; on the grid the least threshold - potential over the silent points, as `height`.
    pub margin: Margin,
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
#[derive(Debug, Clone)]
pub struct Problem {
    parameters: ConeX,
    statement: Statement,
    silence: Silence,
    bounds: Bounds,
    objective: Objective,
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
                Divisor::Targets => over(b, wanted.len() as f64),
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

/// Where the rounds of the shortest weights ended.
enum End {
    Met,
    Infeasible(Certificate),
    Stopped,
}

struct Shortest {
    weights: Vec<f64>,
    held: Vec<(Row, f64)>,
    rounds: usize,
    end: End,
}

impl Problem {
    /// States the problem of these patterns and targets (ms).
    ///
    /// # Errors
    ///
    /// `Problem` for parameters or examples that make no sense (names pattern and target); `Interrupted`.
    pub fn new(parameters: &ConeX, patterns: &[SpikeTrains], targets: &[Vec<f64>], stop: Stop<'_>) -> Result<Self> {
        parameters.check()?;
        let neuron = &parameters.neuron;
        check_examples(neuron, patterns, targets)?;
        let trains = patterns[0].len();
        let lower = parameters.lb.each("lb", trains, "synapse")?;
        let upper = parameters.ub.each("ub", trains, "synapse")?;
        if let Some(n) = (0..trains).find(|&n| lower[n] > upper[n]) {
            return Err(problem!("synapse {n}: lb is {} mV, above ub, {} mV", lower[n], upper[n]));
        }
        let bounds = Bounds { lower, upper };
        let mut ends = match &parameters.horizon {
            Some(horizon) => horizon.each("horizon", patterns.len(), "pattern")?,
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
        let statement = Statement::new(neuron, parameters.margin(), patterns, targets, &ends);
        let objective = Objective::new(parameters, &statement, &bounds)?;
        stop.check()?;
        let silence = Silence::new(&statement);
        Ok(Self { parameters: parameters.clone(), statement, silence, bounds, objective })
    }

    /// The rows, to be stated when asked.
    #[must_use]
    pub fn statement(&self) -> &Statement {
        &self.statement
    }

    /// The weights that are allowed.
    #[must_use]
    pub fn bounds(&self) -> &Bounds {
        &self.bounds
    }

    /// What B looks at behind a target: coefficients, and `kappa` thresholds.
    ///
    /// # Errors
    ///
    /// `Problem` where there is no such target.
    pub fn behind(&self, pattern: usize, target: usize) -> Result<super::statement::Stated> {
        let mut stated = self.statement.behind(pattern, target, self.parameters.delta_t())?;
        stated.limit *= self.parameters.kappa;
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
        if let Some(certificate) = Certificate::of_one_target(&self.statement, &self.bounds)? {
            return Ok(self.refuted(certificate, 0));
        }
        let shortest = self.shortest(start, progress, stop)?;
        let bound = self.bound_of_square(&shortest.held)?;
        let least = self.objective.of_square(bound);
        let Shortest { weights, held, rounds, end } = shortest;
        let met = match end {
            End::Infeasible(certificate) => return Ok(self.refuted(certificate, rounds)),
            End::Met => true,
            End::Stopped => false,
        };
        self.report(weights, held, rounds, least, Engine::Native, met)
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
            engine: Engine::Native,
            rounds,
            held: certificate.rows.clone(),
            certificate: Some(certificate),
        }
    }

    /// Measures the weights over all rows, whatever engine they come from; `least` is a bound on the objective.
    fn report(
        &self,
        weights: Vec<f64>,
        held: Vec<(Row, f64)>,
        rounds: usize,
        least: f64,
        engine: Engine,
        ended: bool,
    ) -> Result<Fit> {
        let parts = self.objective.parts(&weights);
        let objective: f64 = parts.iter().sum();
        let gap = if objective > 0.0 { (objective - least).max(0.0) / objective } else { 0.0 };
        let missed = self.missed(&weights)?;
        let broken = self.broken(&weights, f64::NEG_INFINITY).iter().fold(f64::NEG_INFINITY, |m, p| m.max(p.excess));
        let within = weights.iter().zip(&self.bounds.lower).zip(&self.bounds.upper).all(|((w, l), u)| l <= w && w <= u);
        let solved =
            ended && within && missed <= MET && broken <= self.rounding(&weights) && gap <= self.parameters.tolerance;
        Ok(Fit {
            status: if solved { Status::Solved } else { Status::Stopped },
            margin: self.margin(&weights),
            weights,
            objective,
            parts,
            gap,
            violation: missed.max(broken).max(0.0),
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
            worst = worst.max((dot(&row, weights) - limit).abs());
        }
        Ok(worst)
    }

    /// Where silence is broken: with half the margin in continuous time, whole on the grid, where nothing lies between rows.
    fn broken(&self, weights: &[f64], tolerance: f64) -> Vec<Peak> {
        let grid = self.parameters.neuron.time == Time::Grid;
        self.silence.broken(weights, if grid { 1.0 } else { ASKED_SHARE }, tolerance)
    }

    fn rounding(&self, weights: &[f64]) -> f64 {
        let grid = self.parameters.neuron.time == Time::Grid;
        let least = if grid { MET } else { BROKEN };
        least.max(BROKEN_SHARE * weights.iter().map(|w| w.abs()).sum::<f64>())
    }

    /// The largest share of the margin that holds; on the grid the least threshold - potential.
    fn margin(&self, weights: &[f64]) -> Margin {
        if self.parameters.neuron.time == Time::Grid {
            let worst = self
                .silence
                .broken(weights, 0.0, f64::NEG_INFINITY)
                .iter()
                .fold(f64::NEG_INFINITY, |m, p| m.max(p.excess));
            return Margin { height: -worst, slope: 0.0 };
        }
        // At the worst instants potential + share margin = threshold gives the next share; the shares only fall.
        let mut share = 1.0;
        loop {
            let broken = self.silence.broken(weights, share, self.rounding(weights));
            let next = broken.iter().map(|peak| {
                let sheet = &self.statement.sheets[peak.pattern];
                share - peak.excess / self.statement.margin_at(sheet, peak.t)
            });
            let next = next.fold(share, f64::min);
            if next >= share || next.is_nan() {
                return self.statement.margin.times(share);
            }
            share = next;
        }
    }

    /// Row generation around the dual active set.
    fn shortest(&self, start: &[(Row, f64)], progress: &mut dyn FnMut(Round), stop: Stop<'_>) -> Result<Shortest> {
        let mut working = Working::new(self, start)?;
        let mut rounds = 0;
        loop {
            rounds += 1;
            let verdict = working.engine.solve(stop)?;
            let weights = working.engine.weights().to_vec();
            let end = match verdict {
                Verdict::Infeasible(ray) => {
                    let proof = Certificate::check(&self.statement, &self.bounds, working.named(&ray.multipliers))?;
                    proof.map_or(End::Stopped, End::Infeasible)
                }
                Verdict::Stopped => End::Stopped,
                Verdict::Optimal => {
                    let broken = self.broken(&weights, self.rounding(&weights));
                    let rows = working.rows();
                    let objective = self.objective.parts(&weights).iter().sum();
                    progress(Round { round: rounds, rows, broken: broken.len(), objective });
                    let flat = working.flat(&weights, ASKED_SHARE * self.statement.margin.slope);
                    if rounds < MOST_ROUNDS && !stop.asked() && working.cut(&self.statement, &broken, &flat)? {
                        continue;
                    }
                    if broken.is_empty() && flat.is_empty() { End::Met } else { End::Stopped }
                }
            };
            let held = working.named(&working.engine.multipliers());
            return Ok(Shortest { weights, held, rounds, end });
        }
    }

    /// A bound on `|w|^2` below, from any multipliers: what the Lagrangian comes to at least within the bounds.
    fn bound_of_square(&self, held: &[(Row, f64)]) -> Result<f64> {
        let trains = self.statement.trains;
        let (mut sum, mut row, mut allowed) = (vec![0.0; trains], vec![0.0; trains], 0.0);
        for &(name, multiplier) in held {
            let limit = self.statement.state_into(name, &mut row)?;
            sum.iter_mut().zip(&row).for_each(|(g, a)| *g += multiplier * a);
            allowed += multiplier * limit;
        }
        let least: f64 = (sum.iter().zip(&self.bounds.lower).zip(&self.bounds.upper))
            .map(|((&g, &l), &u)| {
                let w = (-g).clamp(l, u);
                0.5 * w * w + g * w
            })
            .sum();
        Ok((2.0 * (least - allowed)).max(0.0))
    }
}

/// The engine with the names of its rows.
struct Working {
    engine: DualActiveSet,
    targets: Vec<Row>,
    /// By number of the inequality.
    names: Vec<Row>,
    /// Silent rows in the working set, by pattern and time.
    there: HashSet<(usize, u64)>,
    /// The slope rows, one after the other, and whether they are in the working set.
    slopes: Vec<Slope>,
    row: Vec<f64>,
}

struct Slope {
    name: Row,
    coefficients: Vec<f64>,
    limit: f64,
    id: Option<RowId>,
}

impl Working {
    fn new(problem: &Problem, start: &[(Row, f64)]) -> Result<Self> {
        let Problem { statement, bounds, .. } = problem;
        let mut working = Self {
            engine: DualActiveSet::new(&bounds.lower, &bounds.upper)?,
            targets: statement.targets().map(|(pattern, target)| Row::Target { pattern, target }).collect(),
            names: vec![],
            there: HashSet::new(),
            slopes: vec![],
            row: vec![0.0; statement.trains],
        };
        for &target in &working.targets {
            let limit = statement.state_into(target, &mut working.row)?;
            working.engine.equality(&working.row, limit)?;
        }
        if problem.parameters.neuron.time == Time::Continuous {
            for (pattern, target) in statement.targets() {
                let name = Row::Slope { pattern, target };
                let stated = statement.state(name)?;
                let id = working.engine.inequality(&stated.coefficients, stated.limit)?;
                working.names.push(name);
                working.slopes.push(Slope {
                    name,
                    coefficients: stated.coefficients,
                    limit: stated.limit,
                    id: Some(id),
                });
            }
        }
        if !start.is_empty() {
            working.start(statement, start)?;
        }
        Ok(working)
    }

    fn start(&mut self, statement: &Statement, start: &[(Row, f64)]) -> Result<()> {
        let mut multipliers = Multipliers { equalities: vec![0.0; self.targets.len()], inequalities: vec![] };
        for &(row, multiplier) in start {
            if !multiplier.is_finite() {
                return Err(problem!("start: a multiplier is {multiplier}, must be finite"));
            }
            match row {
                Row::Target { .. } => {
                    if let Some(k) = self.targets.iter().position(|r| *r == row) {
                        multipliers.equalities[k] = multiplier;
                    }
                }
                Row::Slope { .. } => {
                    if let Some(id) = self.slopes.iter().find(|s| s.name == row).and_then(|s| s.id) {
                        multipliers.inequalities.push((id, multiplier.max(0.0)));
                    }
                }
                // Rows that this problem does not have are no help to it.
                Row::Silence { pattern, t } => {
                    if statement.is_asked(pattern, t) && !self.there.contains(&(pattern, t.to_bits())) {
                        let id = self.add(statement, row)?;
                        multipliers.inequalities.push((id, multiplier.max(0.0)));
                    }
                }
            }
        }
        self.engine.start(&multipliers)
    }

    /// Adds a row of silence.
    fn add(&mut self, statement: &Statement, row: Row) -> Result<RowId> {
        let limit = statement.state_into(row, &mut self.row)?;
        let id = self.engine.inequality(&self.row, limit)?;
        self.names.push(row);
        if let Row::Silence { pattern, t } = row {
            self.there.insert((pattern, t.to_bits()));
        }
        Ok(id)
    }

    /// The slope rows out of the working set that are broken by more than `share`, mV/ms.
    fn flat(&self, weights: &[f64], share: f64) -> Vec<usize> {
        let broken = |s: &Slope| s.id.is_none() && dot(&s.coefficients, weights) > s.limit + share;
        self.slopes.iter().enumerate().filter(|(_, s)| broken(s)).map(|(k, _)| k).collect()
    }

    fn rows(&self) -> usize {
        self.targets.len() + self.there.len()
    }

    /// Drops what does not bind and adds what is broken; says whether anything is new.
    fn cut(&mut self, statement: &Statement, broken: &[Peak], flat: &[usize]) -> Result<bool> {
        let new: Vec<&Peak> = broken.iter().filter(|p| !self.there.contains(&(p.pattern, p.t.to_bits()))).collect();
        if new.is_empty() && flat.is_empty() {
            return Ok(false);
        }
        for id in self.engine.drop_inactive() {
            match self.names[id.index()] {
                Row::Silence { pattern, t } => drop(self.there.remove(&(pattern, t.to_bits()))),
                name => self.slopes.iter_mut().filter(|s| s.name == name).for_each(|s| s.id = None),
            }
        }
        for peak in new {
            self.add(statement, peak.row())?;
        }
        for &k in flat {
            let slope = &mut self.slopes[k];
            slope.id = Some(self.engine.inequality(&slope.coefficients, slope.limit)?);
            self.names.push(slope.name);
        }
        Ok(true)
    }

    /// Multipliers by name.
    fn named(&self, multipliers: &Multipliers) -> Vec<(Row, f64)> {
        let targets = self.targets.iter().copied().zip(multipliers.equalities.iter().copied());
        let others = multipliers.inequalities.iter().map(|&(id, z)| (self.names[id.index()], z));
        targets.chain(others).filter(|(_, u)| *u != 0.0).collect()
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
