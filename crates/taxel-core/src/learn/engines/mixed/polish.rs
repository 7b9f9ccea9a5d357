//! Polishes a point near the optimum to rounding accuracy: one exact solve with zeros, bounds and binding rows as
//! equalities.
//!
//! The guess of what binds comes from the interior point. If signs come out wrong (a multiplier below 0, a weight
//! across 0 or a bound, a violated row), the guess is corrected and solved again.

use faer::Mat;

use super::dense::{Lu, add_gram, add_sum, times};
use super::program::{Guess, MET, PrimalDualPoint, Program, WeightState};
use crate::Stop;
use crate::learn::statement::Norm;
use crate::vectors::dot;

const MOST_GUESSES: usize = 12;
const MOST_REFINEMENTS: usize = 12;
/// Regularisation that makes a singular guess solvable. Refinement removes its effect, unless rows are more nearly
/// parallel than this; then the second, smaller value is tried.
const SOFT: [f64; 2] = [1e-11, 1e-15];
/// The residual of a guess's conditions, in units of about 1, at which they count as solved.
const SOLVED: f64 = 1e-13;
/// The share of the tolerance at which the gap is small enough.
const ENOUGH: f64 = 0.01;
/// The size above which multipliers and slopes of the wrong sign count as wrong.
const WRONG: f64 = 1e-11;

/// Solves for the guess and corrects it repeatedly; returns the best point that satisfies all rows and bounds, with its
/// guess.
pub(super) fn polish(
    program: &Program,
    near: &PrimalDualPoint,
    guess: Guess,
    tolerance: f64,
    stop: Stop<'_>,
) -> Option<(PrimalDualPoint, Guess)> {
    let mut polish = Polish::new(program, near, guess);
    let mut best: Option<(f64, PrimalDualPoint, Guess)> = None;
    let mut most = usize::MAX;
    for _ in 0..MOST_GUESSES {
        if stop.asked() {
            break;
        }
        polish.solve()?;
        let point = polish.point();
        if program.meets_rows(&point.weights) {
            let gap = program.gap(&point);
            if best.as_ref().is_none_or(|b| gap < b.0) {
                best = Some((gap, point, polish.guess.clone()));
            }
            if gap <= ENOUGH * tolerance {
                break;
            }
        }
        let exchanged = polish.exchange();
        if exchanged == 0 || exchanged > most {
            break;
        }
        // If the number of exchanges does not decrease, the search ends.
        most = 2 * exchanged;
    }
    best.map(|(_, point, guess)| (point, guess))
}

struct Polish<'a> {
    program: &'a Program,
    guess: Guess,
    /// The sign of each nonzero weight, which is its slope in l1.
    sign: Vec<f64>,
    w: Vec<f64>,
    equality: Vec<f64>,
    inequality: Vec<f64>,
}

impl<'a> Polish<'a> {
    fn new(program: &'a Program, near: &PrimalDualPoint, guess: Guess) -> Self {
        let w = near.weights.clone();
        let mut out = Self {
            program,
            sign: w.iter().map(|w| w.signum()).collect(),
            guess,
            w,
            equality: near.equality.clone(),
            inequality: near.inequality.clone(),
        };
        out.snap();
        out
    }

    /// Sets the weights that the guess fixes to their values.
    fn snap(&mut self) {
        for (k, state) in self.guess.states.iter().enumerate() {
            match state {
                WeightState::Free => {}
                WeightState::Zero => self.w[k] = 0.0,
                WeightState::Lower => self.w[k] = self.program.lower[k],
                WeightState::Upper => self.w[k] = self.program.upper[k],
            }
        }
        for (z, binding) in self.inequality.iter_mut().zip(&self.guess.binding) {
            if !binding {
                *z = 0.0;
            }
        }
    }

    fn pull(&self) -> Vec<f64> {
        self.program.pull(&self.w)
    }

    /// The gradient of all terms except l1.
    fn gradient(&self) -> Vec<f64> {
        let mut gradient = self.program.slope(&self.w);
        gradient.iter_mut().zip(self.pull()).for_each(|(g, p)| *g += p);
        add_sum(&self.program.equal, &self.equality, &mut gradient);
        add_sum(&self.program.below, &self.inequality, &mut gradient);
        gradient
    }

    fn point(&self) -> PrimalDualPoint {
        let program = self.program;
        PrimalDualPoint {
            weights: self
                .w
                .iter()
                .zip(program.lower.iter().zip(&program.upper))
                .map(|(w, (l, u))| w.clamp(*l, *u))
                .collect(),
            equality: self.equality.clone(),
            inequality: self.inequality.iter().map(|z| z.max(0.0)).collect(),
            pull: self.pull(),
        }
    }

    /// Newton steps on the conditions of the guess, until rounding stops progress. `None` if the result is not finite.
    fn solve(&mut self) -> Option<()> {
        let program = self.program;
        let n = program.width();
        let free: Vec<usize> = (0..n).filter(|&k| self.guess.states[k] == WeightState::Free).collect();
        let binding: Vec<usize> = (0..program.limit.len()).filter(|&i| self.guess.binding[i]).collect();
        let (f, p) = (free.len(), program.equal_to.len());
        let size = f + p + binding.len();
        let mut matrix = Mat::zeros(size, size);
        if program.lift > 0.0 {
            let columns: Vec<Vec<f64>> =
                program.behind.chunks_exact(n).map(|row| free.iter().map(|&k| row[k]).collect()).collect();
            let flat: Vec<f64> = columns.into_iter().flatten().collect();
            let mut gram = Mat::zeros(f, f);
            add_gram(&flat, f, 2.0 * program.lift, &mut gram);
            for j in 0..f {
                for i in j..f {
                    matrix[(i, j)] = gram[(i, j)];
                    matrix[(j, i)] = gram[(i, j)];
                }
            }
        }
        let length = dot(&self.w, &self.w).sqrt();
        if program.norm == Norm::Square {
            (0..f).for_each(|j| matrix[(j, j)] += 2.0 * program.l2);
        } else if program.l2 > 0.0 && length > 0.0 {
            let curve = program.l2 / length;
            for j in 0..f {
                let along = curve * self.w[free[j]] / (length * length);
                for i in 0..f {
                    matrix[(i, j)] -= along * self.w[free[i]];
                }
                matrix[(j, j)] += curve;
            }
        }
        let rows =
            program.equal.chunks_exact(n.max(1)).chain(binding.iter().map(|i| &program.below[i * n..(i + 1) * n]));
        for (i, row) in rows.enumerate() {
            for (j, &k) in free.iter().enumerate() {
                matrix[(f + i, j)] = row[k];
                matrix[(j, f + i)] = row[k];
            }
        }
        let mut least = f64::INFINITY;
        for soft in SOFT {
            let mut matrix = matrix.clone();
            (0..f).for_each(|j| matrix[(j, j)] += soft);
            (f..size).for_each(|j| matrix[(j, j)] -= soft);
            let before = (self.w.clone(), self.equality.clone(), self.inequality.clone());
            let off = self.refine(&Lu::new(matrix), &free, &binding);
            if off.is_none_or(|off| off >= least) {
                (self.w, self.equality, self.inequality) = before;
            }
            least = least.min(off.unwrap_or(f64::INFINITY));
            if least <= SOLVED {
                break;
            }
        }
        least.is_finite().then_some(())
    }

    /// Newton steps with these factors until rounding stops progress; returns the last residual.
    fn refine(&mut self, factors: &Lu, free: &[usize], binding: &[usize]) -> Option<f64> {
        let program = self.program;
        let (f, p) = (free.len(), program.equal_to.len());
        let mut least = f64::INFINITY;
        for _ in 0..MOST_REFINEMENTS {
            let gradient = self.gradient();
            let mut right = Vec::with_capacity(f + p + binding.len());
            right.extend(free.iter().map(|&k| -gradient[k] - program.l1 * self.sign[k]));
            right.extend(times(&program.equal, &self.w).iter().zip(&program.equal_to).map(|(u, e)| e - u));
            let below = times(&program.below, &self.w);
            right.extend(binding.iter().map(|&i| program.limit[i] - below[i]));
            let off = right.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
            if !off.is_finite() {
                return None;
            }
            let ended = off <= 1e-16 || off > 0.7 * least;
            least = least.min(off);
            if ended {
                break;
            }
            factors.solve(&mut right);
            free.iter().zip(&right).for_each(|(&k, d)| self.w[k] += d);
            self.equality.iter_mut().zip(&right[f..]).for_each(|(u, d)| *u += d);
            binding.iter().zip(&right[f + p..]).for_each(|(&i, d)| self.inequality[i] += d);
        }
        Some(least)
    }

    /// Exchanges rows and bounds with multipliers of the wrong sign; returns how many.
    fn exchange(&mut self) -> usize {
        let program = self.program;
        let gradient = self.gradient();
        let mut changed = 0;
        for (k, g) in gradient.into_iter().enumerate() {
            let (lower, upper) = (program.lower[k], program.upper[k]);
            if lower == upper {
                continue;
            }
            let split = program.l1 > 0.0 && lower < 0.0 && upper > 0.0;
            let state = self.guess.states[k];
            let next = match state {
                WeightState::Free if self.w[k] < lower => WeightState::Lower,
                WeightState::Free if self.w[k] > upper => WeightState::Upper,
                WeightState::Free if split && self.w[k] * self.sign[k] < 0.0 => WeightState::Zero,
                WeightState::Zero if g.abs() > program.l1 + WRONG => {
                    self.sign[k] = -g.signum();
                    WeightState::Free
                }
                WeightState::Lower if g + program.l1 * if lower < 0.0 { -1.0 } else { 1.0 } < -WRONG => {
                    self.sign[k] = if lower < 0.0 { -1.0 } else { 1.0 };
                    WeightState::Free
                }
                WeightState::Upper if g + program.l1 * if upper > 0.0 { 1.0 } else { -1.0 } > WRONG => {
                    self.sign[k] = if upper > 0.0 { 1.0 } else { -1.0 };
                    WeightState::Free
                }
                same => same,
            };
            if next != state {
                self.guess.states[k] = next;
                changed += 1;
            }
        }
        let below = times(&program.below, &self.w);
        for (i, u) in below.iter().enumerate() {
            let binding = &mut self.guess.binding[i];
            if *binding && self.inequality[i] < -WRONG {
                *binding = false;
                changed += 1;
            } else if !*binding && u - program.limit[i] > MET {
                *binding = true;
                changed += 1;
            }
        }
        self.snap();
        changed
    }
}
