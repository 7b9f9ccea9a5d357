//! A primal-dual interior-point method (Mehrotra's predictor-corrector) for the mixed objective.
//!
//! With an l1 term, a weight whose bounds have opposite signs is the difference of two *parts*, each between 0 and its
//! bound; elimination leaves one diagonal entry per synapse. The norm is one second-order cone with Nesterov-Todd
//! scaling, which adds a multiple of the identity and a rank-one matrix to the Newton matrix; its length is eliminated
//! as well. Each iteration therefore takes the Cholesky factors of one matrix over synapses and one over equality rows.

mod binding;
mod conditions;
mod cone;
mod newton;
mod variables;

use faer::Mat;

use self::cone::cone_step;
pub(super) use self::variables::PrimalDual;
use self::variables::{Direction, Residual, WeightPart, Workspace};
use super::dense::{add_gram, times};
use super::program::{Iterate, Program};
use crate::Stop;
use crate::learn::statement::Norm;
use crate::vectors::dot;

const MOST_ITERATIONS: usize = 100;
/// The largest share of the way to the boundary that a step takes.
const NEARLY: f64 = 0.995;
/// The primal residual that counts as satisfied, for rows of length 1.
const MET: f64 = 1e-12;
/// The number of steps without improvement after which rounding is assumed to prevent any.
const MOST_IDLE: usize = 15;
/// The least denominator of the relative gap.
const NOTHING: f64 = 1e-10;
/// The largest number of centrality corrections of a step, which are made while they lengthen it.
const MOST_CORRECTIONS: usize = 2;

/// The longest step for which all of `v + step d` stay at or above 0.
fn wall(v: &[f64], d: &[f64]) -> f64 {
    v.iter().zip(d).filter(|(_, d)| **d < 0.0).map(|(v, d)| -v / d).fold(f64::INFINITY, f64::min)
}

/// The interior-point solver of one program.
pub(super) struct Interior<'a> {
    program: &'a Program,
    parts: Vec<WeightPart>,
    base: Vec<f64>,
    /// `2 lift B'B` plus the curvature of a squared l2 term, lower triangle.
    curvature: Mat<f64>,
    normed: bool,
}

impl<'a> Interior<'a> {
    pub(super) fn new(program: &'a Program) -> Self {
        let n = program.width();
        let (mut parts, mut base) = (Vec::new(), vec![0.0; n]);
        for (synapse, (&lower, &upper)) in program.lower.iter().zip(&program.upper).enumerate() {
            if program.l1 > 0.0 && lower < 0.0 && upper > 0.0 {
                parts.push(WeightPart { synapse, sign: 1.0, range: upper, cost: program.l1 });
                parts.push(WeightPart { synapse, sign: -1.0, range: -lower, cost: program.l1 });
            } else {
                base[synapse] = lower;
                let cost = if lower >= 0.0 { program.l1 } else { -program.l1 };
                if upper > lower {
                    parts.push(WeightPart { synapse, sign: 1.0, range: upper - lower, cost });
                }
            }
        }
        let mut curvature = Mat::zeros(n, n);
        if program.lift > 0.0 {
            add_gram(&program.behind, n, 2.0 * program.lift, &mut curvature);
        }
        if program.norm == Norm::Square {
            (0..n).for_each(|j| curvature[(j, j)] += 2.0 * program.l2);
        }
        let normed = program.norm == Norm::Norm && program.l2 > 0.0;
        Self { program, parts, base, curvature, normed }
    }

    /// A start in the middle of the box, or of a plausible range for weights if that is narrower, with all multipliers
    /// 1.
    pub(super) fn start(&self) -> PrimalDual {
        let (n, program) = (self.program.width(), self.program);
        let split = |p: &WeightPart| self.base[p.synapse] == 0.0;
        let x: Vec<f64> =
            self.parts.iter().map(|p| if split(p) { (0.5 * p.range).min(1.0) } else { 0.5 * p.range }).collect();
        let w = self.weights(&x);
        let below = times(&program.below, &w);
        PrimalDual {
            low: vec![1.0; x.len()],
            high: vec![1.0; x.len()],
            equality: vec![0.0; program.equal_to.len()],
            slack: below.iter().zip(&program.limit).map(|(u, limit)| (limit - u).max(1.0)).collect(),
            inequality: vec![1.0; program.limit.len()],
            length: 1.0 + 2.0 * dot(&w, &w).sqrt(),
            dual: (program.l2, vec![0.0; n]),
            x,
        }
    }

    /// Continues from the end of an earlier call after rows were added; values too near the boundary are moved away
    /// from it.
    pub(super) fn resume(&self, start: &PrimalDual) -> PrimalDual {
        let program = self.program;
        let mut state = start.clone();
        let w = self.weights(&state.x);
        let mut mu = self.complementarity(&state, &w);
        let below = times(&program.below, &w);
        let known = state.slack.len();
        let above = || below.iter().zip(&program.limit).skip(known).map(|(u, limit)| u - limit);
        let most = above().fold(1e-4, f64::max);
        mu = mu.max(10.0 * most * most);
        let lift = |a: &mut f64, b: &mut f64| {
            if *a * *b < mu {
                if a > b { *b = mu / *a } else { *a = mu / *b }
            }
        };
        for (s, z) in state.slack.iter_mut().zip(&mut state.inequality) {
            lift(s, z);
        }
        for (j, part) in self.parts.iter().enumerate() {
            let floor = (0.1 * part.range).min(mu.sqrt());
            state.x[j] = state.x[j].clamp(floor, part.range - floor);
            state.low[j] = state.low[j].max(mu / state.x[j]);
            state.high[j] = state.high[j].max(mu / (part.range - state.x[j]));
        }
        for x in above() {
            let s = (-x).max(most);
            state.slack.push(s);
            state.inequality.push(mu / s);
        }
        if self.normed {
            let w = self.weights(&state.x);
            let length = dot(&w, &w).sqrt();
            state.length = state.length.max(length + mu / program.l2);
            state.dual.0 = program.l2;
            let shrink = 1.0 - (mu / (length * program.l2)).min(0.5);
            state.dual.1.iter_mut().for_each(|y| *y *= shrink);
        }
        state
    }

    fn weights(&self, x: &[f64]) -> Vec<f64> {
        let mut w = self.base.clone();
        self.parts.iter().zip(x).for_each(|(p, x)| w[p.synapse] += p.sign * x);
        w
    }

    /// Continues from `state` to a relative gap of about `tolerance`, or until rounding or `stop` ends it.
    pub(super) fn solve(&self, state: &mut PrimalDual, tolerance: f64, stop: Stop<'_>) -> Iterate {
        let program = self.program;
        let (mut best, mut merit, mut least) = (state.clone(), f64::INFINITY, f64::INFINITY);
        let (mut idle, mut iterations) = (0, 0);
        let n = program.width();
        let mut room = Workspace { matrix: Mat::zeros(n, n), scaled: Vec::new() };
        loop {
            let r = self.residual(state);
            let mu = self.complementarity(state, &r.w);
            let objective = program.objective(&r.w);
            let most = |v: &[f64]| v.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
            let primal = most(&r.equality).max(most(&r.inequality));
            let gap = (objective - self.bound(state, &r)).abs() / objective.abs().max(NOTHING);
            // `f64::max` ignores NaN, so the sum is checked too.
            if !(gap + primal + mu).is_finite() {
                break;
            }
            if gap.max(primal) < merit {
                merit = gap.max(primal);
                best.clone_from(state);
            }
            idle = if mu.max(primal) < 0.9 * least { 0 } else { idle + 1 };
            least = least.min(mu.max(primal));
            let met = primal <= MET.max(1e-3 * tolerance);
            if (gap <= tolerance && met) || iterations == MOST_ITERATIONS || idle == MOST_IDLE || stop.asked() {
                break;
            }
            iterations += 1;
            let Some(newton) = self.newton(state, &r.w, &mut room) else { break };
            let affine = newton.direction(&r, &self.complement(state, &newton, 0.0, None));
            let reach = self.reach(state, &r.w, &affine).min(1.0);
            let aimed = (1.0 - reach).powi(3) * mu;
            let mut aim = self.complement(state, &newton, aimed, Some(&affine));
            let mut step = newton.direction(&r, &aim);
            let mut reach = (NEARLY * self.reach(state, &r.w, &step)).min(1.0);
            for _ in 0..if reach > 0.9 { 0 } else { MOST_CORRECTIONS } {
                let further = (1.5 * reach + 0.3).min(1.0);
                let better = self.correct(state, &step, further, aimed, &aim);
                let trial = newton.direction(&r, &better);
                let longer = (NEARLY * self.reach(state, &r.w, &trial)).min(1.0);
                if longer < reach + 0.1 * (further - reach) {
                    break;
                }
                (step, reach, aim) = (trial, longer, better);
                if reach > 0.9 {
                    break;
                }
            }
            room.matrix = newton.factor.into_matrix();
            state.go(reach, &step);
        }
        *state = best;
        self.finish(state)
    }

    /// The least value of the Lagrangian over the box, up to rounding.
    fn bound(&self, state: &PrimalDual, r: &Residual) -> f64 {
        let program = self.program;
        let mut sum = -dot(&state.equality, &program.equal_to) - dot(&state.inequality, &program.limit);
        for (j, &g) in r.gradient.iter().enumerate() {
            sum += program.least_cost(j, g);
        }
        sum - program.tangent(&r.w)
    }

    fn reach(&self, state: &PrimalDual, w: &[f64], step: &Direction) -> f64 {
        let mut most = wall(&state.x, &step.x).min(wall(&state.low, &step.low)).min(wall(&state.high, &step.high));
        for ((p, x), dx) in self.parts.iter().zip(&state.x).zip(&step.x) {
            if *dx > 0.0 {
                most = most.min((p.range - x) / dx);
            }
        }
        most = most.min(wall(&state.slack, &step.slack)).min(wall(&state.inequality, &step.inequality));
        if self.normed {
            most = most.min(cone_step((state.length, w), (step.length, &step.w)));
            most = most.min(cone_step((state.dual.0, &state.dual.1), (step.dual.0, &step.dual.1)));
        }
        most
    }
}
