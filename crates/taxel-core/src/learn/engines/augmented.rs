//! The minimum of 6.14 by a proximal augmented Lagrangian with semismooth Newton steps.
//!
//! Each row has a multiplier between the two slopes of its kink. With the multipliers fixed and every kink smoothed
//! over `delta` mV, 6.14 is differentiable, and its curvature comes only from the few rows on their smoothed kinks, the
//! only rows that are ever written out. All other rows enter by one sweep over the grid (the potential) and one back (a
//! weighted sum of rows). After each round every multiplier is set to the slope found and `delta` shrinks, until a
//! lower bound proves the objective.

mod bound;
mod line_search;
mod newton;

use faer::Par;
use faer::dyn_stack::MemBuffer;
use faer::linalg::cholesky::llt::factor::cholesky_in_place_scratch;

use super::rounds::Rounds;
use crate::Stop;
use crate::learn::statement::{Norm, Objective, Relaxed, RelaxedPoint};
use crate::vectors::{add, dot};

/// The initial smoothing of the kinks in thresholds: for targets all of them are smooth at weights of 0; less for
/// silence.
const TARGETS_FROM: f64 = 2.0;
const SILENCE_FROM: f64 = 0.1;
/// The initial smoothing if the start is a similar fit, in thresholds.
const WARM_FROM: f64 = 0.002;
/// The factor by which a round reduces the smoothing, and its least value in thresholds.
const SHRINK: f64 = 0.25;
const SHARPEST: f64 = 1e-8;
/// The largest number of Newton steps in a round, and of rounds.
const STEPS: usize = 12;
const ROUNDS: usize = 60;
/// Additional steps of a round, needed if the bounds are far wider than the weights that the targets need.
const FINER: usize = 3;
/// Bounds wider than this many times the weights that the targets need do not set the scale of the weights.
const FAR: f64 = 30.0;

/// A start: the weights of a similar fit, and its multipliers as shares of their range.
#[derive(Debug, Clone, Default)]
pub(crate) struct WarmStart {
    pub(crate) weights: Option<Vec<f64>>,
    pub(crate) shares: Option<Vec<f64>>,
}

struct Lagrangian<'a> {
    /// Whether the caller gave weights to start from.
    started: bool,
    problem: &'a Relaxed,
    objective: &'a Objective,
    weights: Vec<f64>,
    excess: Vec<f64>,
    behind: Vec<f64>,
    /// The multipliers as shares: of D's weight from 0 to 1, of the kink of C from its lower slope up to 1 more.
    shares: Vec<f64>,
    /// The multipliers of l1 and of the bounds, one per synapse.
    held: Vec<f64>,
    /// The weights at the beginning of the round, the centre of the proximal term.
    centre: Vec<f64>,
    /// The smoothing of the kinks, mV: silence, targets.
    delta: [f64; 2],
    /// The least value of 6.14 so far.
    most: f64,
    /// The scale of differences between weights, mV: the bounds, unless they are far wider than the targets need.
    width: f64,
    /// The curvature of the terms that hold a weight at 0 or at a bound, and of the proximal term.
    sigma: f64,
    rho: f64,
    /// The gradient in the weights.
    gradient: Vec<f64>,
    /// The rows on their smoothed kinks.
    inside: Vec<usize>,
    factors: Vec<f64>,
    hessian: Vec<f64>,
    memory: MemBuffer,
}

impl Relaxed {
    /// Minimises 6.14 (scaled so that it is about 1) until its relative gap is `tolerance`, or until progress ends.
    pub(crate) fn augmented(
        &self,
        objective: &Objective,
        tolerance: f64,
        start: WarmStart,
        progress: &mut dyn FnMut(usize, usize, f64, f64),
        stop: Stop<'_>,
    ) -> Rounds {
        let zero: Vec<f64> = objective
            .bounds
            .lower
            .iter()
            .zip(&objective.bounds.upper)
            .map(|(&low, &high)| 0.0_f64.clamp(low, high))
            .collect();
        let mut best = self.point(objective, zero);
        let mut engine = Lagrangian::new(self, objective, start, &best);
        let mut proof = self.no_proof();
        proof.improve(engine.proof_at_zero(&best));
        engine.most = best.parts.sum();
        if engine.started {
            let candidate = self.point(objective, engine.weights.clone());
            proof.improve(engine.proof());
            if candidate.parts.sum() < best.parts.sum() {
                best = candidate;
            }
            engine.most = best.parts.sum();
        }
        let (mut rounds, mut rows, mut stalled) = (0, 0, 0);
        let mut gap = best.gap(proof.bound);
        let mut stopped = false;
        while gap > tolerance && rounds < ROUNDS && stalled < 12 {
            rounds += 1;
            let accuracy = 0.03 * (best.parts.sum() - proof.bound);
            let (mut reached, mut finer) = (false, 0);
            for _ in 0..STEPS {
                if stop.asked() {
                    stopped = true;
                    break;
                }
                let (near, anywhere) = engine.slope();
                reached |= near <= accuracy;
                finer += usize::from(reached);
                if anywhere <= accuracy || finer > FINER || !engine.step() {
                    break;
                }
            }
            rows = engine.inside.len();
            let candidate = self.point(objective, engine.candidate());
            proof.improve(engine.proof());
            let before = (gap, best.parts.sum());
            if candidate.parts.sum() < best.parts.sum() {
                best = candidate;
            }
            engine.most = best.parts.sum();
            gap = best.gap(proof.bound);
            stalled = if gap > 0.9 * before.0 && engine.most > 0.99 * before.1 { stalled + 1 } else { 0 };
            progress(rounds, rows, best.parts.sum(), gap);
            engine.sharpen(reached);
            if stopped {
                break;
            }
        }
        Rounds { best, proof, rounds, rows, shares: engine.shares, stopped }
    }
}

impl<'a> Lagrangian<'a> {
    fn new(problem: &'a Relaxed, objective: &'a Objective, start: WarmStart, zero: &RelaxedPoint) -> Self {
        let n = problem.trains;
        let silent = problem.silent.len();
        let total = silent + problem.targets.len();
        let theta = problem.theta_0;
        let started = start.weights.is_some();
        let (weights, excess, behind) = match start.weights {
            None => (zero.weights.clone(), zero.excess.clone(), zero.behind.clone()),
            Some(weights) => {
                let at = problem.point(objective, weights);
                (at.weights, at.excess, at.behind)
            }
        };
        let delta =
            if start.shares.is_some() { [WARM_FROM * theta; 2] } else { [SILENCE_FROM * theta, TARGETS_FROM * theta] };
        let warm = start.shares.is_some();
        let mut shares = start.shares.unwrap_or_default();
        shares.resize(total, 0.0);
        let widest =
            objective.bounds.upper.iter().zip(&objective.bounds.lower).fold(0.0_f64, |m, (u, l)| m.max(u.max(-l)));
        let width =
            widest.min(FAR * problem.typical_weight()).max(zero.weights.iter().fold(0.0, |m, w| w.abs().max(m)));
        let scratch = cholesky_in_place_scratch::<f64>(n, Par::Seq, faer::Spec::default());
        let mut engine = Self {
            started,
            problem,
            objective,
            centre: weights.clone(),
            weights,
            excess,
            behind,
            shares,
            held: vec![0.0; n],
            delta,
            most: f64::INFINITY,
            width,
            sigma: 1.0,
            rho: 1.0,
            gradient: vec![0.0; n],
            inside: vec![],
            factors: vec![0.0; total],
            hessian: vec![0.0; n * n],
            memory: MemBuffer::new(scratch),
        };
        // The gradient of the rows at each synapse for weights of 0 sets the scale of `sigma` and `rho`.
        engine.multipliers();
        let mut pull = vec![0.0; n];
        for (k, target) in problem.targets.iter().enumerate() {
            add(&mut pull, engine.factors[silent + k].abs().max(objective.c), target.at);
            add(&mut pull, 2.0 * objective.b * objective.kappa * target.threshold, target.behind);
        }
        let most = (dot(&pull, &pull) / n as f64).sqrt();
        let size = (objective.l1 + objective.l2 / (n as f64).sqrt()).max(1e-3 * most).max(1e-12);
        engine.sigma = if warm { 500.0 } else { 1.0 } * size / width;
        engine.rho = if warm { 1e-3 } else { 0.1 } * size / width;
        if warm {
            engine.balance_multipliers();
        }
        engine
    }

    /// Computes the slope of each row, times its weight in 6.14.
    fn multipliers(&mut self) {
        let silent = self.problem.silent.len();
        let (d, (c, low)) = (self.objective.d, self.objective.kink_of_c());
        let [per_silent, per_slope] = self.delta.map(|delta| 1.0 / delta);
        let rows = self.factors.iter_mut().zip(&self.excess).zip(&self.shares);
        for (k, ((factor, &x), &share)) in rows.enumerate() {
            *factor = if k < silent {
                d * (share + x * per_silent).clamp(0.0, 1.0)
            } else {
                c * (share + x * per_slope).clamp(low, low + 1.0)
            };
        }
    }

    /// Computes the gradient; returns how much 6.14 could fall along it within `width`, and within the bounds.
    fn slope(&mut self) -> (f64, f64) {
        let (problem, o) = (self.problem, self.objective);
        let silent = problem.silent.len();
        self.multipliers();
        self.inside.clear();
        let (d, (c, low)) = (o.d, o.kink_of_c());
        for (k, &factor) in self.factors.iter().enumerate() {
            let on_kink =
                if k < silent { 0.0 < factor && factor < d } else { low * c < factor && factor < (low + 1.0) * c };
            if on_kink {
                self.inside.push(k);
            }
        }
        self.gradient.fill(0.0);
        if o.d > 0.0 {
            problem.silent.add_sum(&self.factors[..silent], &mut self.gradient);
        }
        for ((target, &factor), &behind) in problem.targets.iter().zip(&self.factors[silent..]).zip(&self.behind) {
            add(&mut self.gradient, factor, target.at);
            add(&mut self.gradient, 2.0 * o.b * o.counts_in_b(behind), target.behind);
        }
        match o.norm {
            Norm::Square => add(&mut self.gradient, 2.0 * o.l2, &self.weights),
            Norm::Norm => {
                let pull = self.pull();
                add(&mut self.gradient, 1.0, &pull);
            }
        }
        let (mut near, mut anywhere) = (0.0, 0.0);
        for n in 0..self.weights.len() {
            let w = self.weights[n];
            self.gradient[n] += self.rho * (w - self.centre[n]) + self.penalty(n, w).0;
            let apart = o.bounds.upper[n] - o.bounds.lower[n];
            near += self.gradient[n].abs() * apart.min(2.0 * self.width);
            anywhere += self.gradient[n].abs() * apart;
        }
        (near, anywhere)
    }

    /// The gradient of the norm; 0 if all weights are 0.
    fn pull(&self) -> Vec<f64> {
        let length = dot(&self.weights, &self.weights).sqrt();
        let factor = if length > 0.0 { self.objective.l2 / length } else { 0.0 };
        self.weights.iter().map(|w| factor * w).collect()
    }

    /// The term that holds weight `n` at 0 and within its bounds: its slope, whether it is active, and the value it
    /// holds to.
    fn penalty(&self, n: usize, w: f64) -> (f64, bool, f64) {
        let o = self.objective;
        let z = w + self.held[n] / self.sigma;
        let shift = o.l1 / self.sigma;
        let soft = if z > shift {
            z - shift
        } else if z < -shift {
            z + shift
        } else {
            0.0
        };
        let at = soft.clamp(o.bounds.lower[n], o.bounds.upper[n]);
        let held = at != soft || (soft == 0.0 && shift > 0.0);
        // Not computed as sigma (z - at): z, at and w may be close and sigma large, which would lose digits.
        let slope = if held { self.held[n] + self.sigma * (w - at) } else { o.l1.copysign(z) };
        (slope, held, at)
    }

    /// Sets the multipliers of l1 and of the bounds so that the gradient is 0 at weights that are 0 or at a bound.
    fn balance_multipliers(&mut self) {
        self.slope();
        for n in 0..self.weights.len() {
            let (w, o) = (self.weights[n], self.objective);
            let against = self.penalty(n, w).0 - self.gradient[n];
            self.held[n] = if w <= o.bounds.lower[n] || w >= o.bounds.upper[n] {
                against
            } else if w == 0.0 {
                against.clamp(-o.l1, o.l1)
            } else {
                o.l1 * w.signum()
            };
        }
    }

    /// The weights projected by l1 and the bounds: some exactly 0, none outside the bounds.
    fn candidate(&self) -> Vec<f64> {
        (0..self.weights.len()).map(|n| self.penalty(n, self.weights[n]).2).collect()
    }

    /// Ends a round: sets the multipliers to the slopes found, reduces the smoothing, and weakens the proximal term.
    fn sharpen(&mut self, reached: bool) {
        let silent = self.problem.silent.len();
        self.multipliers();
        let (d, (c, _)) = (self.objective.d, self.objective.kink_of_c());
        for (k, (share, factor)) in self.shares.iter_mut().zip(&self.factors).enumerate() {
            let weight = if k < silent { d } else { c };
            *share = if weight > 0.0 { factor / weight } else { 0.0 };
        }
        for n in 0..self.weights.len() {
            self.held[n] = self.penalty(n, self.weights[n]).0;
        }
        self.centre.copy_from_slice(&self.weights);
        let theta = self.problem.theta_0;
        if reached {
            self.delta = self.delta.map(|delta| (delta * SHRINK).max(SHARPEST * theta));
            self.sigma /= SHRINK;
            self.rho *= SHRINK;
        }
    }
}
