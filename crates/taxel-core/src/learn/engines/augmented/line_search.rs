//! The exact line search along a Newton step, on which the Lagrangian is piecewise quadratic.

use super::Lagrangian;
use crate::learn::statement::{Norm, Sides};
use crate::vectors::{add, dot};

/// A full step is taken if the slope along it has fallen to `WHOLE` at its end; a search ends when it has fallen to
/// `EXACT`.
const WHOLE: f64 = 0.05;
const EXACT: f64 = 1e-3;

/// A kink on the searched line: its slope at the start, the change of that, how the row rises, and the kind of row.
struct PassedKink {
    slope: f64,
    change: f64,
    rise: f64,
    kind: usize,
}

impl Lagrangian<'_> {
    pub(super) fn move_along(&mut self, direction: &[f64]) -> bool {
        let (program, o) = (self.program, self.program.objective);
        let mut rise = vec![0.0; program.limit.len()];
        if program.slopes[0] != [0.0; 2] {
            program.silent.potential(direction, &mut rise);
        }
        rise.extend(program.stored().map(|(row, _)| dot(row, direction)));
        let squared = program.targets.iter().take(self.at.behind.len());
        let lift: Vec<f64> = squared.map(|row| dot(row.behind, direction)).collect();
        let smooth = {
            let against: f64 =
                self.at.weights.iter().zip(&self.centre).zip(direction).map(|((w, c), d)| (w - c) * d).sum();
            let square = dot(direction, direction);
            let (mut from, mut bend) = (self.rho * against, self.rho * square);
            if o.choice.sides_b == Sides::Both {
                from += 2.0 * o.b * dot(&self.at.behind, &lift);
                bend += 2.0 * o.b * dot(&lift, &lift);
            }
            if o.choice.norm == Norm::Square {
                from += 2.0 * o.l2 * dot(&self.at.weights, direction);
                bend += 2.0 * o.l2 * square;
            }
            (from, bend)
        };
        let start = dot(&self.gradient, direction);
        let mut end = 1.0;
        let t = loop {
            let (passing, steady) = self.passing(&rise, end);
            let slope = |t: f64| self.slope_along(t, direction, smooth, steady, &passing, &lift);
            let (mut low, mut at_low, mut high, mut at_high) = (0.0, start, end, slope(end));
            if at_high <= WHOLE * start.abs() {
                if end < 64.0 && at_high < -0.5 * start.abs() {
                    end *= 4.0;
                    continue;
                }
                break end;
            }
            let mut t = high;
            // The Illinois method: a secant that halves the value of an end retained twice.
            for _ in 0..60 {
                t = low + (high - low) * (at_low / (at_low - at_high)).clamp(1e-3, 0.999);
                let slope_at = slope(t);
                if slope_at.abs() <= EXACT * start.abs() || high - low <= 1e-12 * high {
                    break;
                }
                if slope_at > 0.0 {
                    (high, at_high) = (t, slope_at);
                    at_low *= 0.5;
                } else {
                    (low, at_low) = (t, slope_at);
                    at_high *= 0.5;
                }
            }
            break t;
        };
        // A direction that is not finite makes the weights NaN even with a step of 0.
        if !(t.is_finite() && start.is_finite()) {
            return false;
        }
        add(&mut self.at.weights, t, direction);
        self.at.excess.iter_mut().zip(&rise).for_each(|(x, r)| *x += t * r);
        add(&mut self.at.behind, t, &lift);
        true
    }

    /// The kinks that a step of length `end` crosses, and the slope of all rows that stay beyond their kinks.
    fn passing(&self, rise: &[f64], end: f64) -> (Vec<PassedKink>, f64) {
        let steep = self.steep();
        let mut passing = Vec::new();
        let mut steady = 0.0;
        let rows = self.at.excess.iter().zip(rise).zip(&self.multipliers);
        for (k, ((&x, &rise), &multiplier)) in rows.enumerate() {
            let kind = self.program.kind(k);
            let [low, high] = self.program.slopes[kind];
            let (slope, change) = (multiplier + x * steep[kind], rise * steep[kind]);
            let to = slope + end * change;
            if slope.max(to) <= low {
                steady += low * rise;
            } else if slope.min(to) >= high {
                steady += high * rise;
            } else {
                passing.push(PassedKink { slope, change, rise, kind });
            }
        }
        (passing, steady)
    }

    fn slope_along(
        &self,
        t: f64,
        direction: &[f64],
        smooth: (f64, f64),
        steady: f64,
        passing: &[PassedKink],
        lift: &[f64],
    ) -> f64 {
        let mut sum = smooth.0 + t * smooth.1 + steady;
        let o = self.program.objective;
        if o.choice.sides_b == Sides::Below {
            for (&x, &l) in self.at.behind.iter().zip(lift) {
                sum += 2.0 * o.b * (x + t * l).min(0.0) * l;
            }
        }
        for p in passing {
            let [low, high] = self.program.slopes[p.kind];
            sum += p.rise * (p.slope + t * p.change).clamp(low, high);
        }
        let (mut along, mut square) = (0.0, 0.0);
        for (n, (&w, &d)) in self.at.weights.iter().zip(direction).enumerate() {
            let weight = w + t * d;
            sum += self.penalty(n, weight).0 * d;
            along += weight * d;
            square += weight * weight;
        }
        if o.choice.norm == Norm::Norm {
            sum += o.l2 * along / self.length(square);
        }
        sum
    }
}
