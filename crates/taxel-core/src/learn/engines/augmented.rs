//! The minimum of an objective with kinks (6.14, and 6.11 with hard rows) by a proximal augmented Lagrangian with
//! semismooth Newton steps.
//!
//! Each row has a multiplier between the two slopes of its kink; those of a hard row are infinite. With the multipliers
//! fixed and every kink smoothed over `delta` mV, the objective is differentiable, and its curvature comes only from the
//! few rows on their smoothed kinks, the only rows that are ever written out. All other rows enter by one sweep over the
//! grid (the potential) and one back (a weighted sum of rows). After each round every multiplier is set to the slope
//! found and `delta` shrinks, until a lower bound proves the objective. How steeply the slope of a smoothed row changes
//! follows from the range of its multipliers; where these rounds stall, as that range is far wider than the multipliers
//! are large, it follows from the multipliers found.

mod bound;
mod line_search;
mod newton;

use faer::Par;
use faer::dyn_stack::MemBuffer;
use faer::linalg::cholesky::llt::factor::cholesky_in_place_scratch;

use crate::Stop;
use crate::learn::statement::{Norm, Point, Program, Proof};
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
/// Those of rounds by the multipliers, the first of which smooths by `SMOOTH_FROM`; a round that is not solved in
/// `STEPS_WHOLE` steps is begun anew with `BLUNTER` times its smoothing, because slopes of unsolved rounds may be far off;
/// over soft rows it goes on with the smoothing of the round before, nearer to where it ended.
const SMOOTH_FROM: f64 = 0.1;
const SHRINK_WHOLE: f64 = 0.5;
const SHARPEST_WHOLE: f64 = 1e-9;
const STEPS_WHOLE: usize = 40;
const BLUNTER: f64 = 8.0;
/// A round counts as solved at this many times its accuracy if `STEPS_WHOLE` steps end there: rounding leaves no more.
const ROUGH: f64 = 1e3;
/// Over soft rows also to no more than this share of the objective.
const ROUGH_SHARE: f64 = 1e-3;
/// Kinks stay as smooth as they are while the distances from their limits cost less than this share of the accuracy.
const ENOUGH_MET: f64 = 0.1;
/// The least change of a multiplier over its row's smoothing in rounds by the multipliers, as a share of what the objective is per threshold and
/// target: all multipliers vanish where B can be met exactly.
const LEAST_UNIT: f64 = 1e-3;
/// The norm is smoothed below a length of this share of the weights' scale times the smoothing of the targets in
/// thresholds: weights of 0 are a kink, at which no step could begin or end.
const SHORT: f64 = 1e-2;
/// The least share of the targets' pull in the scale of the terms that hold weights at 0 and at their bounds, and in
/// that of the proximal term.
const HELD_SHARE: f64 = 1.0;
const CENTRE_SHARE: f64 = 1e-3;
/// In rounds by the multipliers, the curvature of the proximal term relative to the smoothing at first, and the factor
/// of each round that proves little more, and its least value: where the objective is nearly flat, steps must grow.
const NEAR_CENTRE: f64 = 10.0;
const FARTHER: f64 = 0.1;
const FARTHEST: f64 = 1e-9;
/// There the share of the targets' pull that holds weights at 0 and at their bounds at first, and its factor after each
/// round that proves little more: the multipliers move far, and stiff terms take twice as many steps.
const HELD_LESS: f64 = 0.1;
const STIFFER: f64 = 3.0;
/// The number of such rounds without a smaller gap after which the search ends.
const MOST_IDLE: usize = 15;
/// The most rounds in all.
const MOST_ROUNDS: usize = 300;
/// A round is solved to this share of the gap, but no finer than for a gap of this share of the tolerance.
pub(crate) const ACCURACY: f64 = 0.03;
pub(crate) const FINEST: f64 = 1e-2;
/// The largest number of Newton steps in a round, and of rounds.
const STEPS: usize = 12;
const ROUNDS: usize = 60;
/// Additional steps of a round, needed if the bounds are far wider than the weights that the targets need.
const FINER: usize = 3;
/// Bounds wider than this many times the weights that the targets need do not set the scale of the weights.
const FAR: f64 = 30.0;
/// The number of rounds with little progress after which the search ends.
const STALLED: usize = 20;

/// A start: the weights of a similar fit, and its multipliers.
#[derive(Debug, Clone, Default)]
pub(crate) struct WarmStart {
    pub(crate) weights: Option<Vec<f64>>,
    pub(crate) multipliers: Option<Vec<f64>>,
}

/// The state between two rounds by the multipliers; hard rows may come in between.
#[derive(Debug, Clone)]
pub(crate) struct Between {
    pub(crate) weights: Vec<f64>,
    pub(crate) multipliers: Vec<f64>,
    /// The multipliers of l1 and of the bounds; none before the first round.
    held: Option<Vec<f64>>,
    /// How far the kinks are smoothed, in thresholds.
    smoothing: f64,
    /// The curvature of the proximal term relative to the smoothing.
    nearness: f64,
    /// As [`HELD_SHARE`].
    held_share: f64,
    /// The least gap so far, and the number of rounds since.
    pub(crate) least_gap: f64,
    idle: usize,
}

impl Between {
    /// The state before the first round.
    pub(crate) fn at(weights: Vec<f64>, multipliers: Vec<f64>) -> Self {
        Self {
            weights,
            multipliers,
            held: None,
            smoothing: SMOOTH_FROM,
            nearness: NEAR_CENTRE,
            held_share: HELD_LESS,
            least_gap: f64::INFINITY,
            idle: 0,
        }
    }

    /// Takes note of the gap that a round proved; returns whether too many rounds proved little more.
    pub(crate) fn is_idle(&mut self, gap: f64) -> bool {
        self.idle = if gap < 0.9 * self.least_gap { 0 } else { self.idle + 1 };
        if self.idle > 0 {
            self.nearness = (FARTHER * self.nearness).max(FARTHEST);
            self.held_share = (STIFFER * self.held_share).min(1.0);
        }
        self.least_gap = self.least_gap.min(gap);
        self.idle > MOST_IDLE
    }
}

/// The end of a round by the multipliers.
pub(crate) struct Reached {
    /// Weights that violate the rows by about the accuracy reached.
    pub(crate) point: Point,
    /// The objective there, and what the multipliers count the distances from the limits as.
    pub(crate) value: f64,
    pub(crate) proof: Proof,
    pub(crate) state: Between,
    /// The number of rows on their kinks.
    rows: usize,
    /// Whether it was solved to the accuracy.
    solved: bool,
    pub(crate) stopped: bool,
}

/// The best weights found, proven or not.
pub(crate) struct Found {
    pub(crate) best: Point,
    pub(crate) proof: Proof,
    pub(crate) rounds: usize,
    /// The number of rows on their kinks in the last round.
    pub(crate) rows: usize,
    pub(crate) multipliers: Vec<f64>,
    pub(crate) stopped: bool,
}

struct Lagrangian<'a> {
    program: &'a Program<'a>,
    /// Where the weights are now; the terms of the objective are those where the Lagrangian began.
    at: Point,
    /// One per row, between its slopes.
    multipliers: Vec<f64>,
    /// The multipliers of l1 and of the bounds, one per synapse.
    held: Vec<f64>,
    /// The weights at the beginning of the round, the centre of the proximal term.
    centre: Vec<f64>,
    /// The change of a multiplier, and the smoothing of the kinks, mV, over which it takes place, by kind of row.
    unit: [f64; 3],
    delta: [f64; 3],
    /// The least value of the objective so far.
    most: f64,
    /// The scale of differences between weights, mV: the bounds, unless they are far wider than the targets need.
    width: f64,
    /// The curvature of the terms that hold a weight at 0 or at a bound, and of the proximal term.
    sigma: f64,
    rho: f64,
    /// The gradient in the weights.
    gradient: Vec<f64>,
    /// The slopes of the smoothed rows.
    factors: Vec<f64>,
    /// The rows on their smoothed kinks.
    inside: Vec<usize>,
    /// Whether some of many rows stand for all of them in the curvature: until a round is not solved so.
    samples: bool,
    hessian: Vec<f64>,
    memory: MemBuffer,
}

impl Program<'_> {
    /// Minimises 6.14 (scaled so that it is about 1) until its relative gap is `tolerance`, or until progress ends.
    pub(crate) fn augmented(
        &self,
        tolerance: f64,
        start: WarmStart,
        progress: &mut dyn FnMut(usize, usize, f64, f64),
        stop: Stop<'_>,
    ) -> Found {
        let mut best = self.point(self.nearest_to_zero());
        let started = start.weights.is_some();
        let mut engine = Lagrangian::new(self, start, &best);
        let mut proof = self.no_proof();
        proof.improve(engine.proof_at_zero(&best));
        engine.most = best.parts.sum();
        if started {
            let candidate = self.point(engine.at.weights.clone());
            proof.improve(engine.proof());
            if candidate.parts.sum() < best.parts.sum() {
                best = candidate;
            }
            engine.most = best.parts.sum();
        }
        let (mut rounds, mut rows, mut stalled) = (0, 0, 0);
        let mut gap = best.gap(proof.bound);
        let mut stopped = false;
        while gap > tolerance && rounds < ROUNDS && stalled < STALLED && !stopped {
            rounds += 1;
            let reached = engine.steps(STEPS, 0.03 * (best.parts.sum() - proof.bound), stop);
            stopped = stop.asked();
            rows = engine.inside.len();
            let candidate = self.point(engine.candidate());
            proof.improve(engine.proof());
            let before = (gap, best.parts.sum());
            if candidate.parts.sum() < best.parts.sum() {
                best = candidate;
            }
            engine.most = best.parts.sum();
            gap = best.gap(proof.bound);
            stalled = if gap > 0.9 * before.0 && engine.most > 0.99 * before.1 { stalled + 1 } else { 0 };
            progress(rounds, rows, best.parts.sum(), gap);
            engine.end_round();
            if reached {
                engine.sharpen();
            } else {
                engine.samples = false;
            }
        }
        let found = Found { best, proof, rounds, rows, multipliers: engine.multipliers, stopped };
        if stopped { found } else { self.by_multipliers(found, tolerance, progress, stop) }
    }

    /// Continues by rounds that follow the multipliers until the relative gap is `tolerance`, or until progress ends.
    fn by_multipliers(
        &self,
        mut found: Found,
        tolerance: f64,
        progress: &mut dyn FnMut(usize, usize, f64, f64),
        stop: Stop<'_>,
    ) -> Found {
        let mut state = Between::at(found.best.weights.clone(), found.proof.multipliers.clone());
        let (mut gap, mut ended) = (found.best.gap(found.proof.bound), false);
        while gap > tolerance && !ended {
            let least = found.best.parts.sum();
            let accuracy = ACCURACY * (least - found.proof.bound).max(FINEST * tolerance * least);
            let Reached { point, proof, state: next, rows, solved, stopped, .. } = self.round(state, accuracy, stop);
            state = next;
            found.proof.improve(proof);
            if point.parts.sum() < least {
                found.best = point;
            }
            found.multipliers.clone_from(&state.multipliers);
            (found.rounds, found.rows, found.stopped) = (found.rounds + 1, rows, stopped);
            gap = found.best.gap(found.proof.bound);
            ended = stopped || found.rounds >= MOST_ROUNDS || solved && state.is_idle(gap);
            progress(found.rounds, rows, found.best.parts.sum(), gap);
        }
        found
    }

    /// One round by the multipliers, solved until the objective (scaled so that it is about 1) could fall by `accuracy`
    /// at most.
    pub(crate) fn round(&self, mut state: Between, accuracy: f64, stop: Stop<'_>) -> Reached {
        let at = self.point(state.weights.clone());
        let rough = if self.is_hard() { f64::INFINITY } else { ROUGH_SHARE * at.parts.sum() };
        let mut engine = Lagrangian::with(self, at, state.multipliers.clone());
        engine.follow_multipliers();
        engine.smooth(&state);
        match &state.held {
            Some(held) => engine.held.clone_from(held),
            None => engine.balance_multipliers(),
        }
        let solved = engine.steps(STEPS_WHOLE, accuracy, stop) || engine.slope().0 <= rough.min(ROUGH * accuracy);
        let rows = engine.inside.len();
        let point = self.point(engine.candidate());
        let proof = engine.proof();
        let missed = engine.missed(&point);
        let value = point.parts.sum() + missed;
        if solved {
            engine.end_round();
            let Lagrangian { at: Point { weights, .. }, multipliers, held, .. } = engine;
            let soft = !self.is_hard() || self.sums() > 0;
            let smoothing = if soft || missed > ENOUGH_MET * accuracy {
                (SHRINK_WHOLE * state.smoothing).max(SHARPEST_WHOLE)
            } else {
                state.smoothing
            };
            state = Between { weights, multipliers, held: Some(held), smoothing, ..state };
        } else if self.is_hard() {
            state.smoothing *= BLUNTER;
        } else {
            state.weights = engine.at.weights;
            state.smoothing /= SHRINK_WHOLE;
            state.nearness = (state.nearness / FARTHER).min(NEAR_CENTRE);
        }
        Reached { point, value, proof, state, rows, solved, stopped: stop.asked() }
    }
}

impl<'a> Lagrangian<'a> {
    fn new(program: &'a Program<'a>, start: WarmStart, zero: &Point) -> Self {
        let at = start.weights.map_or_else(|| zero.clone(), |weights| program.point(weights));
        let warm = start.multipliers.is_some();
        let mut engine = Self::with(program, at, start.multipliers.unwrap_or_default());
        let from = if warm { [WARM_FROM; 3] } else { [SILENCE_FROM, TARGETS_FROM, TARGETS_FROM] };
        engine.delta = from.map(|from| from * program.theta_0);
        engine.sigma = if warm { 500.0 } else { 1.0 } * engine.size(HELD_SHARE);
        engine.rho = if warm { 1e-3 } else { 0.1 } * engine.size(CENTRE_SHARE);
        if warm {
            engine.balance_multipliers();
        }
        engine
    }

    /// The Lagrangian at a point; how sharp it is remains to be set.
    fn with(program: &'a Program<'a>, at: Point, mut multipliers: Vec<f64>) -> Self {
        let (n, objective) = (program.trains(), program.objective);
        multipliers.resize(program.rows(), 0.0);
        let bounds = &objective.bounds;
        let widest = bounds.upper.iter().zip(&bounds.lower).fold(0.0_f64, |m, (u, l)| m.max(u.max(-l)));
        let zero = program.nearest_to_zero();
        let width = widest.min(FAR * program.typical_weight()).max(zero.iter().fold(0.0, |m, w| w.abs().max(m)));
        let scratch = cholesky_in_place_scratch::<f64>(n, Par::Seq, faer::Spec::default());
        Self {
            program,
            centre: at.weights.clone(),
            at,
            factors: vec![0.0; multipliers.len()],
            multipliers,
            held: vec![0.0; n],
            unit: program.slopes.map(|[low, high]| if low < high { high - low } else { 1.0 }),
            delta: [program.theta_0; 3],
            most: f64::INFINITY,
            width,
            sigma: 1.0,
            rho: 1.0,
            gradient: vec![0.0; n],
            inside: vec![],
            samples: true,
            hessian: vec![0.0; n * n],
            memory: MemBuffer::new(scratch),
        }
    }

    /// Sets by how much multipliers change over the smoothing to their root mean square, within their ranges.
    fn follow_multipliers(&mut self) {
        let squares: f64 = self.multipliers.iter().map(|m| m * m).sum();
        let count = self.multipliers.iter().filter(|m| **m != 0.0).count();
        let least = LEAST_UNIT / (self.program.theta_0 * self.program.targets.len() as f64);
        let mean = if squares > 0.0 { (squares / count as f64).sqrt().max(least) } else { 1.0 };
        self.unit = self.unit.map(|range| range.min(mean));
        self.samples = false;
    }

    /// The scale of `sigma` and `rho`: the slope of the l1 and l2 terms at a synapse, or a share of the targets' pull,
    /// over the scale of the weights.
    fn size(&mut self, share: f64) -> f64 {
        let (program, objective, n) = (self.program, self.program.objective, self.at.weights.len() as f64);
        self.slopes();
        let mut pull = vec![0.0; self.at.weights.len()];
        let silent = program.limit.len();
        for (k, ((row, _), factor)) in program.stored().zip(&self.factors[silent..]).enumerate() {
            let most = [objective.c, objective.b][program.kind(silent + k) - 1];
            add(&mut pull, factor.abs().max(most), row);
        }
        for target in program.targets.iter().take(self.at.behind.len()) {
            add(&mut pull, 2.0 * objective.b * objective.choice.kappa * target.threshold, target.behind);
        }
        let most = (dot(&pull, &pull) / n).sqrt();
        (objective.l1 + objective.l2 / n.sqrt()).max(share * most).max(1e-12) / self.width
    }

    /// Sets the smoothing of hard rows, and the other terms accordingly.
    fn smooth(&mut self, state: &Between) {
        self.delta = [state.smoothing * self.program.theta_0; 3];
        self.sigma = SILENCE_FROM / state.smoothing * self.size(state.held_share);
        self.rho = state.nearness * state.smoothing * self.size(CENTRE_SHARE);
    }

    /// Newton steps until the objective could fall by `accuracy` at most; returns whether that is so within `width`.
    fn steps(&mut self, most: usize, accuracy: f64, stop: Stop<'_>) -> bool {
        let (mut reached, mut finer) = (false, 0);
        for _ in 0..most {
            if stop.asked() {
                break;
            }
            let (near, anywhere) = self.slope();
            reached |= near <= accuracy;
            finer += usize::from(reached);
            if anywhere <= accuracy || finer > FINER || !self.step() {
                break;
            }
        }
        reached
    }

    /// How steeply the slope of a smoothed row changes, by kind of row.
    fn steep(&self) -> [f64; 3] {
        std::array::from_fn(|kind| self.unit[kind] / self.delta[kind])
    }

    /// Computes the slope of each smoothed row.
    fn slopes(&mut self) {
        let (program, steep) = (self.program, self.steep());
        let rows = self.factors.iter_mut().zip(&self.at.excess).zip(&self.multipliers);
        for (k, ((factor, &x), &multiplier)) in rows.enumerate() {
            let kind = program.kind(k);
            let [low, high] = program.slopes[kind];
            *factor = (multiplier + x * steep[kind]).clamp(low, high);
        }
    }

    /// Computes the gradient; returns how much the objective could fall along it within `width`, and within the bounds.
    fn slope(&mut self) -> (f64, f64) {
        let (program, o) = (self.program, self.program.objective);
        self.slopes();
        self.inside.clear();
        for (k, &factor) in self.factors.iter().enumerate() {
            let [low, high] = program.slopes[program.kind(k)];
            if low < factor && factor < high {
                self.inside.push(k);
            }
        }
        self.gradient.fill(0.0);
        program.add_rows(&self.factors, &mut self.gradient);
        program.add_slope_of_b(&self.at.behind, &mut self.gradient);
        match o.choice.norm {
            Norm::Square => add(&mut self.gradient, 2.0 * o.l2, &self.at.weights),
            Norm::Norm => {
                let pull = self.pull();
                add(&mut self.gradient, 1.0, &pull);
            }
        }
        let (mut near, mut anywhere) = (0.0, 0.0);
        for n in 0..self.at.weights.len() {
            let w = self.at.weights[n];
            self.gradient[n] += self.rho * (w - self.centre[n]) + self.penalty(n, w).0;
            let apart = o.bounds.upper[n] - o.bounds.lower[n];
            near += self.gradient[n].abs() * apart.min(2.0 * self.width);
            anywhere += self.gradient[n].abs() * apart;
        }
        (near, anywhere)
    }

    /// The smoothed norm of weights with this sum of squares, mV.
    fn length(&self, square: f64) -> f64 {
        square.sqrt().hypot(SHORT * self.width * self.delta[1] / self.program.theta_0)
    }

    /// The gradient of the smoothed norm.
    fn pull(&self) -> Vec<f64> {
        let factor = self.program.objective.l2 / self.length(dot(&self.at.weights, &self.at.weights));
        self.at.weights.iter().map(|w| factor * w).collect()
    }

    /// The term that holds weight `n` at 0 and within its bounds: its slope, whether it is active, and the value it
    /// holds to.
    fn penalty(&self, n: usize, w: f64) -> (f64, bool, f64) {
        let o = self.program.objective;
        let z = w + self.held[n] / self.sigma;
        let shift = o.l1 / self.sigma;
        let soft = (z - shift).max(0.0) + (z + shift).min(0.0);
        let at = soft.clamp(o.bounds.lower[n], o.bounds.upper[n]);
        let held = at != soft || (soft == 0.0 && shift > 0.0);
        // Not computed as sigma (z - at): z, at and w may be close and sigma large, which would lose digits.
        let slope = if held { self.held[n] + self.sigma * (w - at) } else { o.l1.copysign(z) };
        (slope, held, at)
    }

    /// Sets the multipliers of l1 and of the bounds so that the gradient is 0 at weights that are 0 or at a bound.
    fn balance_multipliers(&mut self) {
        self.slope();
        let o = self.program.objective;
        for n in 0..self.at.weights.len() {
            let w = self.at.weights[n];
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
        (0..self.at.weights.len()).map(|n| self.penalty(n, self.at.weights[n]).2).collect()
    }

    /// What the slopes of the hard rows count their distances from their limits as, at a point.
    fn missed(&self, at: &Point) -> f64 {
        let hard = |row: &usize| self.program.slopes[self.program.kind(*row)][1].is_infinite();
        let counted = (0..self.factors.len()).filter(|row| hard(row) && self.factors[*row] != 0.0);
        counted.map(|row| (self.factors[row] * at.excess[row]).abs()).sum()
    }

    /// Ends a round: sets the multipliers to the slopes found.
    fn end_round(&mut self) {
        self.slopes();
        self.multipliers.copy_from_slice(&self.factors);
        for n in 0..self.at.weights.len() {
            self.held[n] = self.penalty(n, self.at.weights[n]).0;
        }
        self.centre.copy_from_slice(&self.at.weights);
    }

    /// Reduces the smoothing, and weakens the proximal term.
    fn sharpen(&mut self) {
        let sharpest = SHARPEST * self.program.theta_0;
        self.delta = self.delta.map(|delta| (delta * SHRINK).max(sharpest));
        self.sigma /= SHRINK;
        self.rho *= SHRINK;
    }
}
