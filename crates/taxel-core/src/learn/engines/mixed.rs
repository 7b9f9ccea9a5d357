//! The mixed objective over a working set of rows: l1, l2 (norm or square) and B with targets and silence as hard rows.
//!
//! Minimise `l1 |w|_1 + l2 |w|_2 (or |w|_2^2) + lift sum_k (behind_k.w - wanted_k)^2` over `equal.w = equal_to`,
//! `below.w <= limit` and `lower <= w <= upper`. An interior point comes near, a polish on the rows and bounds that bind
//! ends exactly, and a bound that holds whatever the solver did says how near the least objective is.

mod dense;
mod interior;
mod polish;
mod proximal;
#[cfg(test)]
mod tests;

use dense::{add_sum, times};

use super::cone_program::{ConeProgram, HardRows, Hinges};
use super::nearest::nearest;
use crate::learn::cone::cone_r::Norm;
use crate::learn::cone::cone_x::NOTHING;
use crate::learn::statement::Bounds;
use crate::vectors::dot;
use crate::{Error, Result, Stop};
use interior::{Interior, State};
use polish::{Guess, polish};

/// Looser than this, an interior point is answer enough: rows are to be found by it, not weights.
const LOOSE: f64 = 1e-5;
/// Gaps at which a polish is tried.
const TRIES: [f64; 3] = [1e-6, 1e-9, 1e-12];

/// The terms of the objective, weighted and normalised.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Terms<'a> {
    pub(crate) l1: f64,
    pub(crate) l2: f64,
    pub(crate) norm: Norm,
    /// The factor of B, its rows one after the other, and what they should reach.
    pub(crate) lift: f64,
    pub(crate) behind: &'a [f64],
    pub(crate) wanted: &'a [f64],
}

/// What solved.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Engine {
    /// The interior point of this module.
    Native,
    /// Clarabel, as that one did not close the gap.
    Clarabel,
}

/// Where a later call with more rows can go on.
#[derive(Debug, Clone)]
pub(crate) struct Start {
    state: State,
    /// The last polished point, in the program's units, and what binds there.
    exact: Option<(Point, Guess)>,
}

impl Start {
    /// Forgets inequality rows, as the caller does; those added later than the call come last.
    pub(crate) fn retain(&mut self, keep: &[bool]) {
        self.state.retain(keep);
        if let Some((point, guess)) = &mut self.exact {
            retain(&mut point.inequality, keep);
            retain(&mut guess.binding, keep);
        }
    }
}

/// What was found.
#[derive(Debug, Clone)]
pub(crate) struct Found {
    pub(crate) weights: Vec<f64>,
    /// Multipliers of the inequality rows, at least 0.
    pub(crate) inequality: Vec<f64>,
    /// The least objective over these rows is no lower, hence over these and more.
    pub(crate) bound: f64,
    pub(crate) engine: Engine,
    pub(crate) stopped: bool,
    pub(crate) start: Start,
}

/// Weights and multipliers; `pull` stands for the slope of `l2 |w|_2`, no longer than `l2`.
#[derive(Debug, Clone, Default)]
pub(crate) struct Point {
    pub(crate) weights: Vec<f64>,
    pub(crate) equality: Vec<f64>,
    pub(crate) inequality: Vec<f64>,
    pub(crate) pull: Vec<f64>,
}

/// Minimises the objective over these rows and bounds.
///
/// `size` is that of the largest weight in any weights that will do: bounds may be far wider, and say nothing of the scale.
/// With a `tolerance` of more than 1e-5 the weights are those of an interior point near the optimum: rows are met about as
/// well, and the rows they break are worth adding. Below that, rows are met to rounding and the gap is `tolerance` where
/// the bound says so.
///
/// # Errors
///
/// `Problem` where Clarabel, asked as a last resort, refuses the problem.
pub(crate) fn minimise(
    terms: &Terms<'_>,
    rows: &HardRows<'_>,
    bounds: &Bounds,
    size: f64,
    start: Option<&Start>,
    tolerance: f64,
    stop: Stop<'_>,
) -> Result<Found> {
    let program = Program::new(terms, rows, bounds, size);
    let interior = Interior::new(&program);
    let mut best = Best::new(&program);
    if let Some(Start { state, exact: Some((point, guess)) }) = start
        && tolerance <= LOOSE
    {
        // A few new rows often need no more than a few exchanges.
        best.exchange(point, guess, tolerance, stop);
        if best.gap() <= tolerance || stop.asked() {
            return Ok(best.found(Engine::Native, stop.asked(), state.clone()));
        }
    }
    let mut state = start.map_or_else(|| interior.start(), |s| interior.resume(&s.state));
    if tolerance > LOOSE {
        let near = interior.solve(&mut state, tolerance, stop);
        best.offer(near.point, None);
        return Ok(best.found(Engine::Native, stop.asked(), state));
    }
    for aim in TRIES {
        let near = interior.solve(&mut state, aim, stop);
        best.improve(&near.point, near.guess, tolerance, stop)?;
        if best.gap() > tolerance && program.is_lift_alone() {
            best.proximal(&near.point.weights, tolerance, stop)?;
        }
        if best.gap() <= tolerance || stop.asked() {
            return Ok(best.found(Engine::Native, stop.asked(), state));
        }
    }
    match program.clarabel(stop) {
        Ok(point) => {
            let guess = program.guess(&point);
            best.improve(&point, guess, tolerance, stop)?;
        }
        Err(Error::Interrupted) => {}
        Err(error) => return Err(error),
    }
    Ok(best.found(Engine::Clarabel, stop.asked(), state))
}

/// The best point so far and the best bound.
struct Best<'a> {
    program: &'a Program,
    point: Point,
    guess: Option<Guess>,
    met: bool,
    objective: f64,
    bound: f64,
}

impl<'a> Best<'a> {
    fn new(program: &'a Program) -> Self {
        let weights = program.lower.iter().zip(&program.upper).map(|(l, u)| 0.0_f64.clamp(*l, *u)).collect();
        let point = Point {
            weights,
            equality: vec![0.0; program.equal_to.len()],
            inequality: vec![0.0; program.limit.len()],
            pull: vec![0.0; program.width()],
        };
        // No term is below 0.
        Self { program, point, guess: None, met: false, objective: f64::INFINITY, bound: 0.0 }
    }

    fn offer(&mut self, point: Point, guess: Option<Guess>) {
        let objective = self.program.objective(&point.weights);
        let met = self.program.met(&point.weights);
        self.bound = self.bound.max(self.program.bound(&point));
        if self.objective.is_infinite() || (met && !self.met) || (met == self.met && objective < self.objective) {
            (self.point, self.guess, self.met, self.objective) = (point, guess, met, objective);
        }
    }

    fn improve(&mut self, near: &Point, guess: Guess, tolerance: f64, stop: Stop<'_>) -> Result<()> {
        let program = self.program;
        if let Some((point, guess)) = polish(program, near, guess, tolerance, stop) {
            self.offer(point, Some(guess));
        }
        if self.gap() <= tolerance {
            return Ok(());
        }
        // Where what binds cannot be told, good multipliers and the nearest weights that meet the rows will do.
        self.offer(near.clone(), None);
        if program.gap(near) <= tolerance
            && let Some(weights) = nearest(&near.weights, &program.hard(), &program.lower, &program.upper, stop)?
        {
            self.offer(Point { weights, ..near.clone() }, None);
        }
        Ok(())
    }

    /// Goes on from a polished point with rows added since.
    fn exchange(&mut self, point: &Point, guess: &Guess, tolerance: f64, stop: Stop<'_>) {
        let (mut point, mut guess) = (point.clone(), guess.clone());
        let below = times(&self.program.below, &point.weights);
        let added = below.iter().zip(&self.program.limit).skip(guess.binding.len());
        guess.binding.extend(added.map(|(u, limit)| u > limit));
        point.inequality.resize(guess.binding.len(), 0.0);
        if let Some((point, guess)) = polish(self.program, &point, guess, tolerance, stop) {
            self.offer(point, Some(guess));
        }
    }

    fn gap(&self) -> f64 {
        if !self.met {
            f64::INFINITY
        } else if self.objective - self.bound <= NOTHING * self.program.at_zero() {
            0.0
        } else {
            relative(self.objective, self.bound)
        }
    }

    fn found(self, engine: Engine, stopped: bool, state: State) -> Found {
        let program = self.program;
        let multipliers = self.point.inequality.iter().zip(&program.of_below);
        Found {
            weights: self.point.weights.iter().map(|w| w * program.weight).collect(),
            inequality: multipliers.map(|(z, scale)| z * program.cost / scale).collect(),
            bound: self.bound * program.cost,
            engine,
            stopped,
            start: Start { state, exact: self.guess.map(|guess| (self.point, guess)) },
        }
    }
}

/// Where a weight stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Place {
    Free,
    Zero,
    Lower,
    Upper,
}

/// The problem in units in which weights, rows and costs are about 1. All scales are powers of 2, so nothing is rounded.
struct Program {
    l1: f64,
    l2: f64,
    norm: Norm,
    lift: f64,
    behind: Vec<f64>,
    wanted: Vec<f64>,
    equal: Vec<f64>,
    equal_to: Vec<f64>,
    below: Vec<f64>,
    limit: Vec<f64>,
    lower: Vec<f64>,
    upper: Vec<f64>,
    /// What a weight, the objective and each inequality row were divided by.
    weight: f64,
    cost: f64,
    of_below: Vec<f64>,
}

/// Keeps what is kept, and all behind.
fn retain<T>(values: &mut Vec<T>, keep: &[bool]) {
    let mut keep = keep.iter();
    values.retain(|_| keep.next().copied().unwrap_or(true));
}

/// The power of 2 next to a positive number; 1 for any other.
fn power_of_2(x: f64) -> f64 {
    if x > 0.0 && x.is_finite() { x.log2().round().clamp(-1000.0, 1000.0).exp2() } else { 1.0 }
}

impl Program {
    fn new(terms: &Terms<'_>, rows: &HardRows<'_>, bounds: &Bounds, size: f64) -> Self {
        let Bounds { lower, upper } = bounds;
        let n = lower.len();
        let weight = power_of_2(size);
        let scaled = |rows: &[f64], limits: &[f64]| {
            let (mut rows, mut limits) = (rows.to_vec(), limits.to_vec());
            let mut scales = Vec::with_capacity(limits.len());
            for (row, limit) in rows.chunks_exact_mut(n.max(1)).zip(&mut limits) {
                let scale = power_of_2(dot(row, row).sqrt() * weight);
                row.iter_mut().for_each(|v| *v *= weight / scale);
                *limit /= scale;
                scales.push(scale);
            }
            (rows, limits, scales)
        };
        let (equal, equal_to, _) = scaled(rows.equal, rows.equal_to);
        let (below, limit, of_below) = scaled(rows.below, rows.limit);
        let behind: Vec<f64> = terms.behind.iter().map(|v| v * weight).collect();
        let square = terms.norm == Norm::Square;
        let l2 = terms.l2 * if square { weight * weight } else { weight };
        let mut pulled = vec![0.0; n];
        if terms.lift > 0.0 {
            add_sum(&behind, terms.wanted, &mut pulled);
        }
        let lifted = 2.0 * terms.lift * pulled.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        let cost = power_of_2(terms.l1 * weight + if square { 2.0 * l2 } else { l2 / (n as f64).sqrt() } + lifted);
        Self {
            l1: terms.l1 * weight / cost,
            l2: l2 / cost,
            norm: terms.norm,
            lift: terms.lift / cost,
            behind,
            wanted: terms.wanted.to_vec(),
            equal,
            equal_to,
            below,
            limit,
            lower: lower.iter().map(|w| w / weight).collect(),
            upper: upper.iter().map(|w| w / weight).collect(),
            weight,
            cost,
            of_below,
        }
    }

    fn width(&self) -> usize {
        self.lower.len()
    }

    fn hard(&self) -> HardRows<'_> {
        HardRows { equal: &self.equal, equal_to: &self.equal_to, below: &self.below, limit: &self.limit }
    }

    fn missed(&self, w: &[f64]) -> Vec<f64> {
        if self.lift > 0.0 {
            times(&self.behind, w).iter().zip(&self.wanted).map(|(u, m)| u - m).collect()
        } else {
            vec![]
        }
    }

    fn objective(&self, w: &[f64]) -> f64 {
        let square = dot(w, w);
        let missed = self.missed(w);
        self.l1 * w.iter().map(|w| w.abs()).sum::<f64>()
            + self.l2 * if self.norm == Norm::Square { square } else { square.sqrt() }
            + self.lift * dot(&missed, &missed)
    }

    /// The slope of the smooth terms: B, and the square.
    fn slope(&self, w: &[f64]) -> Vec<f64> {
        let mut slope = vec![0.0; w.len()];
        if self.lift > 0.0 {
            let mut missed = self.missed(w);
            missed.iter_mut().for_each(|m| *m *= 2.0 * self.lift);
            add_sum(&self.behind, &missed, &mut slope);
        }
        if self.norm == Norm::Square {
            slope.iter_mut().zip(w).for_each(|(s, w)| *s += 2.0 * self.l2 * w);
        }
        slope
    }

    /// How far the tangent of the smooth terms at `w` lies below 0 at weights of 0.
    fn tangent(&self, w: &[f64]) -> f64 {
        let missed = self.missed(w);
        let lift: f64 = missed.iter().zip(&self.wanted).map(|(x, m)| x * (2.0 * m + x)).sum();
        let square = if self.norm == Norm::Square { self.l2 * dot(w, w) } else { 0.0 };
        self.lift * lift + square
    }

    /// The least value of `slope v + l1 |v|` between the bounds of weight `j`.
    fn least(&self, j: usize, slope: f64) -> f64 {
        let cost = |v: f64| slope * v + self.l1 * v.abs();
        let (lower, upper) = (self.lower[j], self.upper[j]);
        let ends = cost(lower).min(cost(upper));
        if lower < 0.0 && upper > 0.0 { ends.min(0.0) } else { ends }
    }

    /// The slope of `l2 |w|_2`.
    fn pull(&self, w: &[f64]) -> Vec<f64> {
        let length = dot(w, w).sqrt();
        if self.norm == Norm::Norm && self.l2 > 0.0 && length > 0.0 {
            w.iter().map(|w| self.l2 * w / length).collect()
        } else {
            vec![0.0; w.len()]
        }
    }

    /// How far rows and bounds are missed at most.
    fn missing(&self, w: &[f64]) -> f64 {
        let equal = times(&self.equal, w);
        let equal = equal.iter().zip(&self.equal_to).map(|(u, e)| (u - e).abs());
        let below = times(&self.below, w);
        let below = below.iter().zip(&self.limit).map(|(u, limit)| u - limit);
        let bounds = w.iter().zip(self.lower.iter().zip(&self.upper)).map(|(w, (l, u))| (l - w).max(w - u));
        equal.chain(below).chain(bounds).fold(0.0, f64::max)
    }

    fn met(&self, w: &[f64]) -> bool {
        w.iter().all(|w| w.is_finite()) && self.missing(w) <= polish::MET * (self.width() as f64).sqrt().max(10.0)
    }

    fn is_lift_alone(&self) -> bool {
        self.l1 == 0.0 && self.l2 == 0.0 && self.lift > 0.0
    }

    fn at_zero(&self) -> f64 {
        self.lift * dot(&self.wanted, &self.wanted)
    }

    /// Solves the same program with Clarabel, as far as it goes.
    fn clarabel(&self, stop: Stop<'_>) -> Result<Point> {
        let n = self.width();
        let mut gram = vec![0.0; n * n];
        let mut linear = vec![0.0; n];
        if self.lift > 0.0 {
            for row in self.behind.chunks_exact(n) {
                for (column, v) in gram.chunks_exact_mut(n).zip(row) {
                    column.iter_mut().zip(row).for_each(|(g, r)| *g += v * r);
                }
            }
            let factors: Vec<f64> = self.wanted.iter().map(|m| -2.0 * self.lift * m).collect();
            add_sum(&self.behind, &factors, &mut linear);
        }
        let program = ConeProgram {
            linear: &linear,
            l1: self.l1,
            l2: self.l2,
            norm: self.norm,
            quadratic: self.lift,
            behind: &self.behind,
            gram: &gram,
            bounds: self.lower.iter().zip(&self.upper).map(|(l, u)| [*l, *u]).collect(),
            hinges: &Hinges::default(),
            hard: self.hard(),
        };
        let answer = program.solve(1.0, 1e-11, stop)?;
        Ok(Point {
            weights: answer.weights,
            equality: answer.equality,
            inequality: answer.inequality,
            pull: answer.pull,
        })
    }

    /// What seems to bind at weights and multipliers of any solver.
    fn guess(&self, point: &Point) -> Guess {
        const NEAR: f64 = 1e-7;
        let place = |(w, (l, u)): (&f64, (&f64, &f64))| match *w {
            w if w - l <= NEAR => Place::Lower,
            w if u - w <= NEAR => Place::Upper,
            w if self.l1 > 0.0 && w.abs() <= NEAR => Place::Zero,
            _ => Place::Free,
        };
        let below = times(&self.below, &point.weights);
        let rows = below.iter().zip(&self.limit).zip(&point.inequality);
        Guess {
            places: point.weights.iter().zip(self.lower.iter().zip(&self.upper)).map(place).collect(),
            binding: rows.map(|((u, limit), z)| limit - u < *z).collect(),
        }
    }

    /// Relative distance between the objective and the bound of these multipliers.
    fn gap(&self, point: &Point) -> f64 {
        relative(self.objective(&point.weights), self.bound(point))
    }

    /// A bound below the least objective, whatever the multipliers (those of inequalities at least 0) and the point are.
    ///
    /// Every term is replaced by a tangent below it: the norm by a `pull` no longer than its factor, a square by its slope
    /// at the weights; rows by their multipliers. What is left is linear and l1 over the box, and has its least value synapse by
    /// synapse. What rounding can add to any of these sums is taken off.
    fn bound(&self, point: &Point) -> f64 {
        let n = self.width();
        let w = &point.weights;
        let mut slope = vec![0.0; n];
        let mut sizes = vec![0.0; n];
        let mut terms = 4.0;
        let mut value = 0.0;
        let mut size = 0.0;
        let mut add = |rows: &[f64], factors: &[f64], values: &[f64]| {
            add_sum(rows, factors, &mut slope);
            for (row, factor) in rows.chunks_exact(n.max(1)).zip(factors) {
                if *factor != 0.0 {
                    terms += 1.0;
                    sizes.iter_mut().zip(row).for_each(|(s, r)| *s += (factor * r).abs());
                }
            }
            for (f, v) in factors.iter().zip(values) {
                value -= f * v;
                size += (f * v).abs();
            }
        };
        let inequality: Vec<f64> = point.inequality.iter().map(|z| z.max(0.0)).collect();
        add(&self.equal, &point.equality, &self.equal_to);
        add(&self.below, &inequality, &self.limit);
        if self.lift > 0.0 {
            // x^2 >= 2 m x - m^2 for any m, with x = behind.w - wanted.
            let missed = self.missed(w);
            let factors: Vec<f64> = missed.iter().map(|m| 2.0 * self.lift * m).collect();
            let values: Vec<f64> = missed.iter().zip(&self.wanted).map(|(m, wanted)| wanted + 0.5 * m).collect();
            add(&self.behind, &factors, &values);
        }
        if self.norm == Norm::Square {
            for (k, w) in w.iter().enumerate() {
                slope[k] += 2.0 * self.l2 * w;
                sizes[k] += (2.0 * self.l2 * w).abs();
            }
            value -= self.l2 * dot(w, w);
            size += self.l2 * dot(w, w);
        } else if self.l2 > 0.0 {
            let length = dot(&point.pull, &point.pull).sqrt();
            let shrink = (self.l2 / length.max(f64::MIN_POSITIVE)).min(1.0) * (1.0 - n as f64 * f64::EPSILON);
            for (k, p) in point.pull.iter().enumerate() {
                slope[k] += shrink * p;
                sizes[k] += p.abs();
            }
        }
        let mut rounding = 0.0;
        for k in 0..n {
            let least = self.least(k, slope[k]);
            let most = self.lower[k].abs().max(self.upper[k].abs());
            value += least;
            size += least.abs();
            rounding += sizes[k] * most;
        }
        // Half an epsilon for each of so many additions and products, whatever their order.
        value - 0.5 * f64::EPSILON * (terms * rounding + (terms + n as f64) * size)
    }
}

/// Relative distance of a bound below an objective.
fn relative(objective: f64, bound: f64) -> f64 {
    (objective - bound).max(0.0) / objective.abs().max(f64::MIN_POSITIVE)
}
