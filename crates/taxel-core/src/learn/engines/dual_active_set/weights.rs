//! The weights that belong to the multipliers, and the excess of each row.

use super::DualActiveSet;
use super::kernels::{add_rows, rows_times};
use super::rows::{ConstraintKind, TOLERANCE};

/// Active rows are refined until they are satisfied to this, as stated or scaled to length 1.
const REFINED: f64 = 2e-14;

impl DualActiveSet {
    pub(super) fn is_equality(&self, slot: usize) -> bool {
        matches!(self.rows[slot].kind, ConstraintKind::Equality(_))
    }

    pub(super) fn violation(&self, slot: usize) -> f64 {
        if self.is_equality(slot) { self.excess[slot].abs() } else { self.excess[slot] }
    }

    pub(super) fn is_met(&self, slot: usize) -> bool {
        self.violation(slot) <= self.rows[slot].tolerance()
    }

    /// `-A'u` over the active rows A and their multipliers u.
    pub(super) fn combine_rows(&self) -> Vec<f64> {
        let by: Vec<f64> = self.active.iter().map(|&slot| -self.multipliers[slot]).collect();
        let mut weights = vec![0.0; self.stride];
        add_rows(&self.coefficients, self.stride, &self.active, &by, &mut weights);
        weights
    }

    /// The excess of the active rows, in their order, padded to whole lines.
    pub(super) fn residuals(&self, weights: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; self.factor.padded_length()];
        rows_times(&self.coefficients, self.stride, &self.active, weights, &mut out[..self.active.len()]);
        for (value, &slot) in out.iter_mut().zip(&self.active) {
            *value -= self.rows[slot].limit;
        }
        out
    }

    /// Computes the weights and every row's excess; refines the active rows if they need it, and fully if `last`.
    pub(super) fn update_weights(&mut self, last: bool) {
        let enough = if last { REFINED } else { 0.1 * TOLERANCE };
        let mut worst = f64::INFINITY;
        for round in 0..4 {
            self.weights = self.combine_rows();
            self.update_excess();
            let off = |&slot: &usize| self.excess[slot].abs() * self.rows[slot].length.max(1.0);
            let now = self.active.iter().map(off).fold(0.0, f64::max);
            if now <= enough || now > 0.5 * worst || round == 3 {
                break;
            }
            worst = now;
            self.refine();
        }
        if last {
            self.project_weights();
        }
    }

    /// Projects the weights onto the active rows, because large multipliers round their sum by more than the rows'
    /// tolerance.
    pub(super) fn project_weights(&mut self) {
        let lengths: Vec<f64> = self.active.iter().map(|&slot| self.rows[slot].length.max(1.0)).collect();
        let off = |residuals: &[f64]| residuals.iter().zip(&lengths).map(|(r, l)| r.abs() * l).fold(0.0, f64::max);
        let mut change = self.residuals(&self.weights);
        let mut now = off(&change);
        for _ in 0..4 {
            if now <= REFINED {
                break;
            }
            self.factor.forward(&mut change);
            self.factor.backward(&mut change);
            let by: Vec<f64> = change[..self.active.len()].iter().map(|change| -change).collect();
            let mut weights = self.weights.clone();
            add_rows(&self.coefficients, self.stride, &self.active, &by, &mut weights);
            change = self.residuals(&weights);
            let then = off(&change);
            if then >= now {
                break;
            }
            (self.weights, now) = (weights, then);
        }
        self.update_excess();
    }

    /// Computes the excess of every row.
    pub(super) fn update_excess(&mut self) {
        let mut values = vec![0.0; self.live.len()];
        rows_times(&self.coefficients, self.stride, &self.live, &self.weights, &mut values);
        for (value, &slot) in values.iter().zip(&self.live) {
            self.excess[slot] = value - self.rows[slot].limit;
        }
    }

    /// The violated rows and bounds with their excess, worst first.
    pub(super) fn violated(&mut self) -> Vec<(usize, f64)> {
        let mut found: Vec<(usize, f64)> = Vec::new();
        for n in 0..self.lower.len() {
            for upper in [false, true] {
                let over = if upper { self.weights[n] - self.upper[n] } else { self.lower[n] - self.weights[n] };
                if over > TOLERANCE && self.bounds[n][usize::from(upper)].is_none() {
                    self.bound(n, upper);
                }
            }
        }
        for &slot in &self.live {
            if self.positions[slot].is_none() && !self.is_met(slot) {
                found.push((slot, self.excess[slot]));
            }
        }
        found.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
        found
    }

    /// Corrects the active multipliers by the residuals of the active rows, and deactivates rows whose multiplier turns negative.
    pub(super) fn refine(&mut self) {
        let mut change = self.residuals(&self.weights);
        self.factor.forward(&mut change);
        self.factor.backward(&mut change);
        for (&slot, change) in self.active.iter().zip(&change) {
            self.multipliers[slot] += change;
        }
        let negative = |&k: &usize| self.multipliers[self.active[k]] < 0.0 && !self.is_equality(self.active[k]);
        let negative: Vec<usize> = (0..self.active.len()).filter(negative).collect();
        self.deactivate(&negative, None);
    }
}
