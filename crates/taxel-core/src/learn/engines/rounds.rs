//! The minimum of 6.14 by rounds of row generation, with a proven gap.
//!
//! Nearly all of the million silent rows of a long recording do not matter. A round gives each hinge one of three
//! states by its value at the best weights so far: *off* (counted as 0), *on* (counted as its linear part), or, near
//! its kink, *kept* (the whole hinge enters the cone program). Off and on are below the hinge, so the cone program's
//! objective is below 6.14 and equals it at those weights: its minimum is a lower bound, and a step towards it
//! decreases 6.14. An exact line search on 6.14 keeps the step from overshooting where hinges change their state.

use super::cone_program::{ConeProgram, HardRows, Hinges};
use crate::learn::statement::{Norm, Objective, Relaxed, RelaxedPoint, RelaxedProof, Tangents};
use crate::vectors::add;
use crate::{Error, Result, Stop};

/// The rows of the first program: targets, and every 4th ms of the 60 ms before them, for a number of targets that
/// keeps it small.
const START_NEAR_MS: f64 = 60.0;
const START_STRIDE_MS: f64 = 4.0;
const START_ROWS: usize = 500;
/// The largest number of rows in later programs.
const MOST_ROWS: usize = 2000;
/// A hinge is kept if it is within this share of `theta_0` of its kink.
const NEAR: f64 = 0.006;
/// The smallest tolerance that the cone solver can reach.
const FINEST: f64 = 1e-12;
/// Rounds end without a proof if the objective falls by less than this, relatively, even at the finest tolerance, or
/// after `MOST_ROUNDS` rounds.
const STALLED: f64 = 1e-10;
const MOST_ROUNDS: usize = 500;

/// The result of the rounds, proven or not.
pub(crate) struct Rounds {
    pub(crate) best: RelaxedPoint,
    pub(crate) proof: RelaxedProof,
    pub(crate) rounds: usize,
    pub(crate) rows: usize,
    /// The multiplier of each row as a share: of D's weight from 0 to 1, of the kink of C from its lower slope up to 1
    /// more.
    pub(crate) shares: Vec<f64>,
    pub(crate) stopped: bool,
}

/// The state of a hinge.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum HingeState {
    Off,
    On,
    Kept,
}

/// The hinges that enter the cone program.
struct KeptHinges {
    /// The numbers of their rows: silent rows, then targets.
    rows: Vec<usize>,
    hinges: Hinges,
    /// The gradient of all linear parts: hinges that are on, the `-x` of 6.12, B's mixed term.
    linear: Vec<f64>,
}

impl Relaxed {
    /// Minimises 6.14 (scaled so that it is about 1) from a point with a known lower bound, or from a small program of
    /// its own.
    ///
    /// # Errors
    ///
    /// `Problem` if the cone solver finds no answer.
    pub(crate) fn by_rounds(
        &self,
        objective: &Objective,
        tolerance: f64,
        start: (RelaxedPoint, RelaxedProof, bool),
        progress: &mut dyn FnMut(usize, usize, f64, f64),
        stop: Stop<'_>,
    ) -> Result<Rounds> {
        let mut accuracy = (0.001 * tolerance).min(1e-7);
        let (mut best, mut proof, near_best) = start;
        let objective = &objective.within_reach(best.parts.sum());
        let (mut rounds, mut rows, near) = (0, 0, NEAR * self.theta_0);
        let mut shares = vec![0.0; best.excess.len()];
        let solve = |kept: &KeptHinges, accuracy| match self.program(objective, kept).solve(1.0, accuracy, stop) {
            Err(Error::Interrupted) => Ok(None),
            answer => answer.map(Some),
        };
        if !near_best && let Some(answer) = solve(&self.start(objective), 1e-6)? {
            best = self.best_between(objective, best, answer.weights);
        }
        loop {
            let states = self.states(&best, near);
            let kept = self.kept(objective, &states);
            let Some(answer) = solve(&kept, accuracy)? else {
                return Ok(Rounds { best, proof, rounds, rows, shares, stopped: true });
            };
            (rounds, rows) = (rounds + 1, kept.rows.len());
            let trial = self.point(objective, answer.weights.clone());
            let mut multipliers = self.slopes(objective, &states);
            for (&row, multiplier) in kept.rows.iter().zip(answer.multipliers) {
                multipliers[row] = multiplier;
            }
            // The program contained |x| of 6.12 as 2 max(x, 0) - x, or max(-x, 0) as max(x, 0) - x.
            multipliers[self.silent.len()..].iter_mut().for_each(|m| *m -= objective.c);
            let at = Tangents {
                weights: &trial.weights,
                excess: &trial.excess,
                behind: &trial.behind,
                multipliers: &multipliers,
                pull: &answer.pull,
            };
            let proven = self.proof(objective, &at, best.parts.sum());
            if proven.bound > proof.bound {
                proof = proven;
                shares = multipliers;
                for (row, share) in shares.iter_mut().enumerate() {
                    *share /= self.hinge_weight(objective, row).max(f64::MIN_POSITIVE);
                }
            }
            let before = best.parts.sum();
            best = self.best_between(objective, best, answer.weights);
            let (least, gap) = (best.parts.sum(), best.gap(proof.bound));
            progress(rounds, rows, least, gap);
            let stalled = before - least <= STALLED * least;
            if gap <= tolerance || (stalled && accuracy < FINEST) || rounds == MOST_ROUNDS {
                return Ok(Rounds { best, proof, rounds, rows, shares, stopped: false });
            }
            if stalled {
                accuracy *= 0.01;
            }
        }
    }

    /// The best point on the line from `from` to `to`.
    fn best_between(&self, objective: &Objective, from: RelaxedPoint, to: Vec<f64>) -> RelaxedPoint {
        let end = self.point(objective, to);
        let silent = self.silent.len();
        let above = objective.kink_of_c().0 - objective.c;
        // The derivative of 6.14 at the share `s` of the line.
        let slope = |s: f64| {
            let mut sum = 0.0;
            let (mut along, mut square) = (0.0, 0.0);
            for (&a, &b) in from.weights.iter().zip(&end.weights) {
                let (w, d) = (a + s * (b - a), b - a);
                sum += objective.l1
                    * if w > 0.0 {
                        d
                    } else if w < 0.0 {
                        -d
                    } else {
                        d.abs()
                    };
                along += w * d;
                square += w * w;
            }
            sum += objective.l2
                * match objective.norm {
                    Norm::Square => 2.0 * along,
                    Norm::Norm if square > 0.0 => along / square.sqrt(),
                    Norm::Norm => 0.0,
                };
            for (&a, &b) in from.behind.iter().zip(&end.behind) {
                sum += 2.0 * objective.b * objective.counts_in_b(a + s * (b - a)) * (b - a);
            }
            let pairs = || from.excess.iter().zip(&end.excess);
            for (&a, &b) in pairs().skip(silent) {
                let x = a + s * (b - a);
                sum += if x > 0.0 { above * (b - a) } else { objective.c * (a - b) };
            }
            let rise = |(&a, &b): (&f64, &f64)| if a + s * (b - a) > 0.0 { b - a } else { 0.0 };
            sum + objective.d * pairs().take(silent).filter(|p| p.0.is_finite()).map(rise).sum::<f64>()
        };
        if slope(1.0) <= 0.0 {
            return if end.parts.sum() < from.parts.sum() { end } else { from };
        }
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..40 {
            let middle = f64::midpoint(low, high);
            if slope(middle) > 0.0 {
                high = middle;
            } else {
                low = middle;
            }
        }
        let at = |s: f64| from.weights.iter().zip(&end.weights).map(|(a, b)| a + s * (b - a)).collect();
        let middle = self.point(objective, at(low));
        [middle, end].into_iter().fold(from, |best, p| if p.parts.sum() < best.parts.sum() { p } else { best })
    }

    /// The state of each hinge at these weights.
    fn states(&self, point: &RelaxedPoint, near: f64) -> Vec<HingeState> {
        let mut distances: Vec<f64> = point.excess.iter().map(|x| x.abs()).filter(|&x| x <= near).collect();
        let near = if distances.len() > MOST_ROWS {
            *distances.select_nth_unstable_by(MOST_ROWS, f64::total_cmp).1
        } else {
            near
        };
        let state = |&x: &f64| match x {
            x if x > near => HingeState::On,
            x if x >= -near => HingeState::Kept,
            _ => HingeState::Off,
        };
        point.excess.iter().map(state).collect()
    }

    /// The slope of each hinge that is not kept.
    fn slopes(&self, objective: &Objective, states: &[HingeState]) -> Vec<f64> {
        let slope = |(row, &state)| if state == HingeState::On { self.hinge_weight(objective, row) } else { 0.0 };
        states.iter().enumerate().map(slope).collect()
    }

    /// The weight of a hinge; the |x| of 6.12 is `2 max(x, 0) - x`, and `max(-x, 0)` is `max(x, 0) - x`.
    pub(super) fn hinge_weight(&self, objective: &Objective, row: usize) -> f64 {
        if row < self.silent.len() { objective.d } else { objective.kink_of_c().0 }
    }

    fn kept(&self, objective: &Objective, states: &[HingeState]) -> KeptHinges {
        let rows: Vec<usize> = (0..states.len()).filter(|&row| states[row] == HingeState::Kept).collect();
        let slopes = self.slopes(objective, states);
        let mixed = objective.mixed_factor();
        let mut linear = vec![0.0; self.trains];
        self.silent.add_sum(&slopes[..self.silent.len()], &mut linear);
        for (target, slope) in self.targets.iter().zip(&slopes[self.silent.len()..]) {
            add(&mut linear, slope - objective.c, target.at);
            add(&mut linear, mixed * target.threshold, target.behind);
        }
        let weight = rows.iter().map(|&row| self.hinge_weight(objective, row)).collect();
        KeptHinges { hinges: self.hinges(&rows, weight), rows, linear }
    }

    fn hinges(&self, rows: &[usize], weight: Vec<f64>) -> Hinges {
        let (silent, targets) = rows.split_at(rows.partition_point(|&row| row < self.silent.len()));
        let targets = || targets.iter().map(|row| self.targets.row(row - self.silent.len()));
        let mut coefficients = self.silent.coefficients(silent);
        targets().for_each(|target| coefficients.extend_from_slice(target.at));
        let limit = silent.iter().map(|&row| self.silent.limit[row]).chain(targets().map(|t| t.threshold)).collect();
        Hinges { rows: coefficients, limit, weight }
    }

    /// The first program: some targets, evenly chosen, and every 4th ms before them; each row is weighted for those
    /// left out.
    fn start(&self, objective: &Objective) -> KeptHinges {
        let stride = (START_STRIDE_MS / self.silent.step_ms).round().max(1.0) as usize;
        let targets = self.targets.names.iter().zip(&self.targets.times);
        let near: Vec<_> = targets.map(|(name, &t)| self.silent.before(name.0, t, START_NEAR_MS)).collect();
        let of_a_target = near.iter().map(|rows| rows.len().div_ceil(stride)).max().unwrap_or(0) + 1;
        let spacing = (self.targets.len() * of_a_target).div_ceil(START_ROWS).max(1);
        let mut rows = Vec::new();
        for before in near.iter().step_by(spacing) {
            rows.extend(before.clone().rev().step_by(stride).filter(|&row| self.silent.limit[row].is_finite()));
        }
        rows.sort_unstable();
        rows.dedup();
        let mixed = objective.mixed_factor();
        let mut weight = vec![objective.d * (stride * spacing) as f64; rows.len()];
        let mut linear = vec![0.0; self.trains];
        for (k, target) in self.targets.iter().enumerate() {
            if k % spacing == 0 {
                rows.push(self.silent.len() + k);
                weight.push(objective.kink_of_c().0 * spacing as f64);
                add(&mut linear, -objective.c * spacing as f64, target.at);
            }
            add(&mut linear, mixed * target.threshold, target.behind);
        }
        KeptHinges { hinges: self.hinges(&rows, weight), rows, linear }
    }

    fn program<'a>(&'a self, objective: &'a Objective, kept: &'a KeptHinges) -> ConeProgram<'a> {
        ConeProgram {
            linear: &kept.linear,
            l1: objective.l1,
            l2: objective.l2,
            norm: objective.norm,
            quadratic: objective.b,
            behind: &self.targets.behind,
            kinks: objective.kinks_of_b(&self.targets),
            gram: &self.gram,
            bounds: objective.bounds.lower.iter().zip(&objective.bounds.upper).map(|(l, u)| [*l, *u]).collect(),
            hinges: &kept.hinges,
            hard: HardRows::default(),
        }
    }
}
