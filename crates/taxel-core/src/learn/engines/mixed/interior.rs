//! A primal-dual interior point (Mehrotra's predictor and corrector) for the mixed objective.
//!
//! With an l1 term a weight whose bounds lie on both sides of 0 is the difference of two *parts*, each between 0 and its
//! bound; elimination leaves one number a synapse on the diagonal. The norm is one second-order cone, scaled as Nesterov
//! and Todd do, and adds a multiple of one and one rank to the Newton matrix; its length is eliminated as well. So each
//! iteration takes the Cholesky factors of one matrix of synapses and one of equality rows.

use super::dense::{Cholesky, add_gram, add_sum, outer, times};
use super::program::{Guess, Place, Point, Program, retain};
use crate::Stop;
use crate::learn::statement::Norm;
use crate::vectors::dot;
use faer::Mat;

const MOST_ITERATIONS: usize = 100;
/// Share of the way to the next wall that a step takes at most.
const NEARLY: f64 = 0.995;
/// Primal residual that counts as met, in units of rows of length 1.
const MET: f64 = 1e-12;
/// Steps without gain after which rounding must be in the way.
const MOST_IDLE: usize = 15;
/// An objective below this counts as this in the gap.
const NOTHING: f64 = 1e-10;
/// Corrections of a step towards equal products, as long as they lengthen it.
const MOST_CORRECTIONS: usize = 2;
/// A linear system is solved to this, relatively, in so many refinements at most.
const REFINED: f64 = 1e-10;
const MOST_REFINEMENTS: usize = 3;
/// Curvature of a weight that cannot move.
const FIXED: f64 = 1e30;

/// Where an interior point ended.
pub(super) struct Iterate {
    pub(super) point: Point,
    /// What seems to bind.
    pub(super) guess: Guess,
}

/// One weight's way up or down from its base.
struct Part {
    synapse: usize,
    sign: f64,
    range: f64,
    cost: f64,
}

/// The variables: parts `x` with the multipliers of their two ends, rows' slacks and multipliers, the cone of the norm.
#[derive(Debug, Clone)]
pub(super) struct PrimalDual {
    x: Vec<f64>,
    low: Vec<f64>,
    high: Vec<f64>,
    equality: Vec<f64>,
    slack: Vec<f64>,
    inequality: Vec<f64>,
    length: f64,
    /// The cone's multiplier: its first entry, then the rest (minus the pull).
    dual: (f64, Vec<f64>),
}

/// A direction in the same variables.
struct Step {
    x: Vec<f64>,
    w: Vec<f64>,
    low: Vec<f64>,
    high: Vec<f64>,
    equality: Vec<f64>,
    slack: Vec<f64>,
    inequality: Vec<f64>,
    length: f64,
    dual: (f64, Vec<f64>),
}

impl PrimalDual {
    /// Forgets the rows that are not kept.
    pub(super) fn retain(&mut self, keep: &[bool]) {
        retain(&mut self.slack, keep);
        retain(&mut self.inequality, keep);
    }

    fn go(&mut self, reach: f64, step: &Step) {
        let go = |v: &mut [f64], d: &[f64]| v.iter_mut().zip(d).for_each(|(v, d)| *v += reach * d);
        go(&mut self.x, &step.x);
        go(&mut self.low, &step.low);
        go(&mut self.high, &step.high);
        go(&mut self.equality, &step.equality);
        go(&mut self.slack, &step.slack);
        go(&mut self.inequality, &step.inequality);
        self.length += reach * step.length;
        self.dual.0 += reach * step.dual.0;
        go(&mut self.dual.1, &step.dual.1);
    }
}

/// Nesterov-Todd scaling of the norm's cone.
struct Scaling {
    eta: f64,
    w0: f64,
    w1: Vec<f64>,
    /// The scaled point, `W^-1 s = W y`.
    point: (f64, Vec<f64>),
}

impl Scaling {
    fn new(s: (f64, &[f64]), y: (f64, &[f64])) -> Self {
        let gap = |(t, v): (f64, &[f64])| {
            let length = dot(v, v).sqrt();
            ((t - length) * (t + length)).max(1e-300).sqrt()
        };
        let (sr, yr) = (gap(s), gap(y));
        let inner = (s.0 * y.0 + dot(s.1, y.1)) / (sr * yr);
        let gamma = (0.5 * (1.0 + inner)).max(1e-300).sqrt();
        let w1: Vec<f64> = s.1.iter().zip(y.1).map(|(s, y)| (s / sr - y / yr) / (2.0 * gamma)).collect();
        let w0 = (1.0 + dot(&w1, &w1)).sqrt();
        let mut out = Self { eta: (sr / yr).sqrt(), w0, w1, point: (0.0, vec![]) };
        out.point = out.scale(y);
        out
    }

    /// `W v`.
    fn scale(&self, v: (f64, &[f64])) -> (f64, Vec<f64>) {
        let along = dot(&self.w1, v.1);
        let factor = v.0 + along / (1.0 + self.w0);
        let rest = v.1.iter().zip(&self.w1).map(|(v, w)| self.eta * (v + factor * w)).collect();
        (self.eta * (self.w0 * v.0 + along), rest)
    }

    /// `W^-1 v`.
    fn unscale(&self, v: (f64, &[f64])) -> (f64, Vec<f64>) {
        let along = dot(&self.w1, v.1);
        let factor = along / (1.0 + self.w0) - v.0;
        let rest = v.1.iter().zip(&self.w1).map(|(v, w)| (v + factor * w) / self.eta).collect();
        ((self.w0 * v.0 - along) / self.eta, rest)
    }
}

/// The longest step (up to 1) that keeps `v + step d` in the second-order cone.
fn cone_step(v: (f64, &[f64]), d: (f64, &[f64])) -> f64 {
    let (vl, dl) = (dot(v.1, v.1).sqrt(), dot(d.1, d.1));
    let a = d.0 * d.0 - dl;
    let b = v.0 * d.0 - dot(v.1, d.1);
    let c = ((v.0 - vl) * (v.0 + vl)).max(0.0);
    let mut most: f64 = if d.0 < 0.0 { v.0 / -d.0 } else { f64::INFINITY };
    let disc = b * b - a * c;
    if disc >= 0.0 {
        let root = disc.sqrt();
        // The smallest positive root of a s^2 + 2 b s + c.
        let q = -(b + if b >= 0.0 { root } else { -root });
        for s in [q / a, c / q] {
            if s > 0.0 && s.is_finite() {
                most = most.min(s);
            }
        }
    }
    most
}

/// The longest step that keeps all of `v + step d` above 0.
fn wall(v: &[f64], d: &[f64]) -> f64 {
    v.iter().zip(d).filter(|(_, d)| **d < 0.0).map(|(v, d)| -v / d).fold(f64::INFINITY, f64::min)
}

/// The solver of one program.
pub(super) struct Interior<'a> {
    program: &'a Program,
    parts: Vec<Part>,
    base: Vec<f64>,
    /// `2 lift B'B` and the curvature of a square, lower triangle.
    curvature: Mat<f64>,
    normed: bool,
}

/// Memory that every iteration needs anew.
struct Room {
    matrix: Mat<f64>,
    scaled: Vec<f64>,
}

/// What a factored Newton matrix needs to solve for a direction.
struct Newton<'a> {
    inner: &'a Interior<'a>,
    state: &'a PrimalDual,
    diagonal: Vec<f64>,
    of_part: Vec<f64>,
    ratio: Vec<f64>,
    scaling: Option<Scaling>,
    /// The factor of the equality rows in the matrix.
    weight: f64,
    factor: Cholesky,
    schur: Option<Cholesky>,
}

/// Residuals of the optimality conditions.
struct Residual {
    w: Vec<f64>,
    gradient: Vec<f64>,
    dual: Vec<f64>,
    equality: Vec<f64>,
    inequality: Vec<f64>,
    length: f64,
}

/// Targets of the complementarity products, less what they are.
struct Complement {
    low: Vec<f64>,
    high: Vec<f64>,
    rows: Vec<f64>,
    /// Already divided by the scaled point.
    cone: Option<(f64, Vec<f64>)>,
}

impl<'a> Interior<'a> {
    pub(super) fn new(program: &'a Program) -> Self {
        let n = program.width();
        let (mut parts, mut base) = (Vec::new(), vec![0.0; n]);
        for (synapse, (&lower, &upper)) in program.lower.iter().zip(&program.upper).enumerate() {
            if program.l1 > 0.0 && lower < 0.0 && upper > 0.0 {
                parts.push(Part { synapse, sign: 1.0, range: upper, cost: program.l1 });
                parts.push(Part { synapse, sign: -1.0, range: -lower, cost: program.l1 });
            } else {
                base[synapse] = lower;
                let cost = if lower >= 0.0 { program.l1 } else { -program.l1 };
                if upper > lower {
                    parts.push(Part { synapse, sign: 1.0, range: upper - lower, cost });
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

    /// The middle of the box, or of what a weight may well be where that is less; all multipliers 1.
    pub(super) fn start(&self) -> PrimalDual {
        let (n, program) = (self.program.width(), self.program);
        let split = |p: &Part| self.base[p.synapse] == 0.0;
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

    /// Goes on from where an earlier call ended, rows having been added since; all that is too near a wall is moved off.
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

    fn residual(&self, state: &PrimalDual) -> Residual {
        let program = self.program;
        let w = self.weights(&state.x);
        let mut gradient = program.slope(&w);
        add_sum(&program.equal, &state.equality, &mut gradient);
        add_sum(&program.below, &state.inequality, &mut gradient);
        if self.normed {
            gradient.iter_mut().zip(&state.dual.1).for_each(|(g, y)| *g -= y);
        }
        let dual = self
            .parts
            .iter()
            .zip(state.low.iter().zip(&state.high))
            .map(|(p, (low, high))| p.sign * gradient[p.synapse] + p.cost - low + high)
            .collect();
        let equality = times(&program.equal, &w).iter().zip(&program.equal_to).map(|(u, e)| u - e).collect();
        let rows = times(&program.below, &w);
        let rows = rows.iter().zip(&program.limit).zip(&state.slack);
        let inequality = rows.map(|((u, limit), s)| u - limit + s).collect();
        Residual { w, gradient, dual, equality, inequality, length: program.l2 - state.dual.0 }
    }

    fn complementarity(&self, state: &PrimalDual, w: &[f64]) -> f64 {
        let high: f64 =
            self.parts.iter().zip(state.x.iter().zip(&state.high)).map(|(p, (x, high))| (p.range - x) * high).sum();
        let mut sum = dot(&state.x, &state.low) + high + dot(&state.slack, &state.inequality);
        let mut count = 2 * self.parts.len() + state.slack.len();
        if self.normed {
            sum += state.length * state.dual.0 + dot(w, &state.dual.1);
            count += 1;
        }
        sum / count as f64
    }

    fn newton<'b>(&'b self, state: &'b PrimalDual, w: &[f64], room: &mut Room) -> Option<Newton<'b>> {
        let n = self.program.width();
        let of_part: Vec<f64> = self
            .parts
            .iter()
            .zip(&state.x)
            .zip(state.low.iter().zip(&state.high))
            .map(|((p, x), (low, high))| low / x + high / (p.range - x))
            .collect();
        let mut softness = vec![0.0; n];
        self.parts.iter().zip(&of_part).for_each(|(p, d)| softness[p.synapse] += 1.0 / d);
        let diagonal: Vec<f64> = softness.iter().map(|s| if *s > 0.0 { 1.0 / s } else { FIXED }).collect();
        let ratio: Vec<f64> = state.inequality.iter().zip(&state.slack).map(|(z, s)| z / s).collect();
        let mut matrix = std::mem::replace(&mut room.matrix, Mat::new());
        matrix.copy_from(&self.curvature);
        let scaled = &mut room.scaled;
        scaled.clear();
        scaled.extend_from_slice(&self.program.below);
        for (row, ratio) in scaled.chunks_exact_mut(n.max(1)).zip(&ratio) {
            let root = ratio.sqrt();
            row.iter_mut().for_each(|v| *v *= root);
        }
        // Equality rows change nothing here, but near a vertex the rest alone is singular up to rounding.
        let weight = ratio.iter().fold(1.0_f64, |m, r| m.max(*r)).min(1e12);
        scaled.extend(self.program.equal.iter().map(|v| v * weight.sqrt()));
        add_gram(scaled, n, 1.0, &mut matrix);
        let scaling = self.normed.then(|| Scaling::new((state.length, w), (state.dual.0, &state.dual.1)));
        let mut ridge = 0.0;
        if let Some(scaling) = &scaling {
            ridge = scaling.eta.powi(-2);
            let factor = -2.0 * ridge / (2.0 * scaling.w0 * scaling.w0 - 1.0);
            add_gram(&scaling.w1, n, factor, &mut matrix);
        }
        (0..n).for_each(|j| matrix[(j, j)] += diagonal[j] + ridge);
        let factor = Cholesky::new(matrix)?;
        let half = factor.halve(&self.program.equal);
        let schur = if self.program.equal_to.is_empty() {
            None
        } else {
            let mut schur = outer(&half, n);
            let most = (0..schur.nrows()).map(|i| schur[(i, i)]).fold(0.0, f64::max);
            (0..schur.nrows()).for_each(|i| schur[(i, i)] += 1e-14 * most);
            Some(Cholesky::new(schur)?)
        };
        Some(Newton { inner: self, state, diagonal, of_part, ratio, scaling, weight, factor, schur })
    }

    /// Goes on from `state` to a relative gap of about `tolerance`, or as far as rounding and `stop` let it.
    pub(super) fn solve(&self, state: &mut PrimalDual, tolerance: f64, stop: Stop<'_>) -> Iterate {
        let program = self.program;
        let (mut best, mut merit, mut least) = (state.clone(), f64::INFINITY, f64::INFINITY);
        let (mut idle, mut iterations) = (0, 0);
        let n = program.width();
        let mut room = Room { matrix: Mat::zeros(n, n), scaled: Vec::new() };
        loop {
            let r = self.residual(state);
            let mu = self.complementarity(state, &r.w);
            let objective = program.objective(&r.w);
            let most = |v: &[f64]| v.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
            let primal = most(&r.equality).max(most(&r.inequality));
            let gap = (objective - self.bound(state, &r)).abs() / objective.abs().max(NOTHING);
            // `max` leaves NaN out.
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

    /// The least value over the box of what the multipliers leave, up to rounding.
    fn bound(&self, state: &PrimalDual, r: &Residual) -> f64 {
        let program = self.program;
        let mut sum = -dot(&state.equality, &program.equal_to) - dot(&state.inequality, &program.limit);
        for (j, &g) in r.gradient.iter().enumerate() {
            sum += program.least(j, g);
        }
        sum - program.tangent(&r.w)
    }

    fn complement(&self, state: &PrimalDual, newton: &Newton<'_>, mu: f64, affine: Option<&Step>) -> Complement {
        let mut out = Complement {
            low: state.x.iter().zip(&state.low).map(|(x, l)| mu - x * l).collect(),
            high: self
                .parts
                .iter()
                .zip(state.x.iter().zip(&state.high))
                .map(|(p, (x, h))| mu - (p.range - x) * h)
                .collect(),
            rows: state.slack.iter().zip(&state.inequality).map(|(s, z)| mu - s * z).collect(),
            cone: None,
        };
        if let Some(step) = affine {
            for (j, dx) in step.x.iter().enumerate() {
                out.low[j] -= dx * step.low[j];
                out.high[j] += dx * step.high[j];
            }
            for (o, (ds, dz)) in out.rows.iter_mut().zip(step.slack.iter().zip(&step.inequality)) {
                *o -= ds * dz;
            }
        }
        if let Some(scaling) = &newton.scaling {
            let (p0, p1) = (scaling.point.0, &scaling.point.1);
            let mut r0 = mu - (p0 * p0 + dot(p1, p1));
            let mut r1: Vec<f64> = p1.iter().map(|p| -2.0 * p0 * p).collect();
            if let Some(step) = affine {
                let a = scaling.unscale((step.length, &step.w));
                let b = scaling.scale((step.dual.0, &step.dual.1));
                r0 -= a.0 * b.0 + dot(&a.1, &b.1);
                r1.iter_mut().zip(a.1.iter().zip(&b.1)).for_each(|(r, (x, y))| *r -= a.0 * y + b.0 * x);
            }
            let length = dot(p1, p1).sqrt();
            let det = ((p0 - length) * (p0 + length)).max(1e-300);
            let x0 = (p0 * r0 - dot(p1, &r1)) / det;
            let x1 = r1.iter().zip(p1).map(|(r, p)| (r - x0 * p) / p0).collect();
            out.cone = Some((x0, x1));
        }
        out
    }

    /// Gondzio's corrector: products that a longer step would bring far from `mu` are pulled back.
    fn correct(&self, state: &PrimalDual, step: &Step, reach: f64, mu: f64, aim: &Complement) -> Complement {
        let pull = |product: f64| {
            if product < 0.1 * mu {
                0.1 * mu - product
            } else if product > 10.0 * mu {
                (10.0 * mu - product).max(-10.0 * mu)
            } else {
                0.0
            }
        };
        let pair = |a: f64, da: f64, b: f64, db: f64| pull((a + reach * da) * (b + reach * db));
        let mut out =
            Complement { low: aim.low.clone(), high: aim.high.clone(), rows: aim.rows.clone(), cone: aim.cone.clone() };
        for (j, p) in self.parts.iter().enumerate() {
            out.low[j] += pair(state.x[j], step.x[j], state.low[j], step.low[j]);
            out.high[j] += pair(p.range - state.x[j], -step.x[j], state.high[j], step.high[j]);
        }
        for i in 0..state.slack.len() {
            out.rows[i] += pair(state.slack[i], step.slack[i], state.inequality[i], step.inequality[i]);
        }
        out
    }

    fn reach(&self, state: &PrimalDual, w: &[f64], step: &Step) -> f64 {
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

    fn finish(&self, state: &PrimalDual) -> Iterate {
        let program = self.program;
        let weights = self.weights(&state.x);
        let n = program.width();
        // What binds has a multiplier larger for its kind than its distance; costs are about 1.
        let typical = |v: &[f64]| dot(v, v) / v.iter().sum::<f64>().max(f64::MIN_POSITIVE);
        let (far, force) = (typical(&state.x).clamp(1e-3, 1.0), typical(&state.low).max(1.0));
        let (room, press) = (typical(&state.slack).clamp(1e-3, 1.0), typical(&state.inequality).max(1.0));
        let mut at_low = vec![true; n];
        let mut places: Vec<Place> = program
            .lower
            .iter()
            .zip(&program.upper)
            .map(|(l, u)| if l == u { Place::Lower } else { Place::Free })
            .collect();
        for (j, part) in self.parts.iter().enumerate() {
            let k = part.synapse;
            if state.x[j] / far >= state.low[j] / force {
                at_low[k] = false;
            }
            if (part.range - state.x[j]) / far < state.high[j] / force {
                places[k] = if part.sign > 0.0 { Place::Upper } else { Place::Lower };
            }
        }
        for (k, place) in places.iter_mut().enumerate() {
            if at_low[k] && *place == Place::Free {
                let split = program.l1 > 0.0 && program.lower[k] < 0.0 && program.upper[k] > 0.0;
                *place = if split { Place::Zero } else { Place::Lower };
            }
        }
        let binding = state.slack.iter().zip(&state.inequality).map(|(s, z)| s / room < z / press).collect();
        let pull = if self.normed { state.dual.1.iter().map(|y| -y).collect() } else { vec![0.0; n] };
        let (equality, inequality) = (state.equality.clone(), state.inequality.clone());
        let point = Point { weights, equality, inequality, pull };
        Iterate { point, guess: Guess { places, binding } }
    }
}

impl Newton<'_> {
    /// The matrix of the reduced system times a vector.
    fn times(&self, v: &[f64]) -> Vec<f64> {
        let program = self.inner.program;
        let mut out: Vec<f64> = v.iter().zip(&self.diagonal).map(|(v, d)| v * d).collect();
        if program.lift > 0.0 {
            let mut b = times(&program.behind, v);
            b.iter_mut().for_each(|b| *b *= 2.0 * program.lift);
            add_sum(&program.behind, &b, &mut out);
        }
        if program.norm == Norm::Square {
            out.iter_mut().zip(v).for_each(|(o, v)| *o += 2.0 * program.l2 * v);
        }
        let mut a = times(&program.below, v);
        a.iter_mut().zip(&self.ratio).for_each(|(a, r)| *a *= r);
        add_sum(&program.below, &a, &mut out);
        if let Some(s) = &self.scaling {
            let ridge = s.eta.powi(-2);
            let along = 2.0 * dot(&s.w1, v) / (2.0 * s.w0 * s.w0 - 1.0);
            out.iter_mut().zip(v.iter().zip(&s.w1)).for_each(|(o, (v, w))| *o += ridge * (v - along * w));
        }
        out
    }

    fn once(&self, w: &[f64], equality: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let mut right = w.to_vec();
        let weighted: Vec<f64> = equality.iter().map(|e| self.weight * e).collect();
        add_sum(&self.inner.program.equal, &weighted, &mut right);
        let mut dw = right.clone();
        self.factor.solve(&mut dw);
        let Some(schur) = &self.schur else { return (dw, vec![]) };
        let mut du = times(&self.inner.program.equal, &dw);
        du.iter_mut().zip(equality).for_each(|(u, e)| *u -= e);
        schur.solve(&mut du);
        let minus: Vec<f64> = du.iter().map(|u| -u).collect();
        add_sum(&self.inner.program.equal, &minus, &mut right);
        self.factor.solve(&mut right);
        (right, du)
    }

    fn direction(&self, r: &Residual, aim: &Complement) -> Step {
        let (inner, state, program) = (self.inner, self.state, self.inner.program);
        let n = program.width();
        let of_x: Vec<f64> = (0..inner.parts.len())
            .map(|j| -r.dual[j] + aim.low[j] / state.x[j] - aim.high[j] / (inner.parts[j].range - state.x[j]))
            .collect();
        let mut right = vec![0.0; n];
        for (j, p) in inner.parts.iter().enumerate() {
            right[p.synapse] += p.sign * of_x[j] / self.of_part[j];
        }
        right.iter_mut().zip(&self.diagonal).for_each(|(r, d)| *r *= d);
        let rows: Vec<f64> =
            (0..self.ratio.len()).map(|i| self.ratio[i] * r.inequality[i] + aim.rows[i] / state.slack[i]).collect();
        let minus: Vec<f64> = rows.iter().map(|v| -v).collect();
        add_sum(&program.below, &minus, &mut right);
        // The cone: dual step = h - M (length, w), its first line giving the length.
        let mut cone = None;
        if let (Some(s), Some(c)) = (&self.scaling, &aim.cone) {
            let h = s.unscale((c.0, &c.1));
            let ridge = s.eta.powi(-2);
            let m00 = ridge * (2.0 * s.w0 * s.w0 - 1.0);
            let m01: Vec<f64> = s.w1.iter().map(|w| -2.0 * ridge * s.w0 * w).collect();
            let free = (h.0 - r.length) / m00;
            for j in 0..n {
                right[j] += h.1[j] - m01[j] * free;
            }
            cone = Some((h, m00, m01));
        }
        let equality: Vec<f64> = r.equality.iter().map(|e| -e).collect();
        let (mut w, mut du) = self.once(&right, &equality);
        let size = right.iter().chain(&equality).fold(0.0_f64, |m, x| m.max(x.abs()));
        for _ in 0..MOST_REFINEMENTS {
            let mut left = self.times(&w);
            add_sum(&program.equal, &du, &mut left);
            let rw: Vec<f64> = right.iter().zip(&left).map(|(a, b)| a - b).collect();
            let re: Vec<f64> = equality.iter().zip(times(&program.equal, &w)).map(|(a, b)| a - b).collect();
            let off = rw.iter().chain(&re).fold(0.0_f64, |m, x| m.max(x.abs()));
            if off <= REFINED * size {
                break;
            }
            let (cw, cu) = self.once(&rw, &re);
            w.iter_mut().zip(&cw).for_each(|(a, b)| *a += b);
            du.iter_mut().zip(&cu).for_each(|(a, b)| *a += b);
        }
        // What the parts share of each weight's step.
        let mut of_w = vec![0.0; n];
        for (j, p) in inner.parts.iter().enumerate() {
            of_w[p.synapse] += p.sign * of_x[j] / self.of_part[j];
        }
        let force: Vec<f64> = (0..n).map(|k| self.diagonal[k] * (of_w[k] - w[k])).collect();
        let x: Vec<f64> = (0..inner.parts.len())
            .map(|j| (of_x[j] - inner.parts[j].sign * force[inner.parts[j].synapse]) / self.of_part[j])
            .collect();
        let low = (0..x.len()).map(|j| (aim.low[j] - state.low[j] * x[j]) / state.x[j]).collect();
        let high =
            (0..x.len()).map(|j| (aim.high[j] + state.high[j] * x[j]) / (inner.parts[j].range - state.x[j])).collect();
        let a = times(&program.below, &w);
        let inequality = (0..a.len()).map(|i| self.ratio[i] * a[i] + rows[i]).collect();
        let slack = a.iter().zip(&r.inequality).map(|(a, r)| -a - r).collect();
        let (mut length, mut dual) = (0.0, (0.0, vec![0.0; n]));
        if let (Some(s), Some((h, m00, m01))) = (&self.scaling, cone) {
            length = (h.0 - r.length - dot(&m01, &w)) / m00;
            let ridge = s.eta.powi(-2);
            let along = 2.0 * dot(&s.w1, &w);
            dual.0 = r.length;
            for j in 0..n {
                dual.1[j] = h.1[j] - m01[j] * length - ridge * (w[j] + along * s.w1[j]);
            }
        }
        Step { x, w, low, high, equality: du, slack, inequality, length, dual }
    }
}
