//! Rows that enter the active set.

use super::kernels::{add_rows, rows_times};
use super::{BLOCK, DEPENDENT, DualActiveSet};
use crate::vectors::dot;

/// Below this, a squared pivot is computed again from the vector itself, because `1 - |d|^2` has lost its digits.
const DOUBTFUL: f64 = 1e-5;
/// The product above which two rows, scaled to length 1, count as nearly identical.
const ALIKE: f64 = 0.999;

impl DualActiveSet {
    /// Replaces active rows by nearly identical fresh ones.
    ///
    /// Without this, cuts at a peak that moves slightly between rounds would enter and leave in turns. The dual may
    /// fall, but no row is lost, and `solve` ends above where it began.
    pub(super) fn replace_similar(&mut self, fresh: &[usize]) {
        let mut entering = Vec::new();
        let mut leaves = vec![false; self.active.len()];
        for &slot in fresh.iter().filter(|slot| !self.is_equality(**slot)) {
            let products = &self.gram[slot * self.gram_stride..][..self.rows.len()];
            let others = self.active.iter().enumerate().filter(|(k, row)| !leaves[*k] && !self.is_equality(**row));
            let nearest = others.max_by(|a, b| products[*a.1].total_cmp(&products[*b.1]));
            if let Some((k, _)) = nearest.filter(|(_, row)| products[**row] >= ALIKE) {
                leaves[k] = true;
                entering.push(slot);
            }
        }
        if entering.is_empty() {
            return;
        }
        let leaving: Vec<usize> = (0..leaves.len()).filter(|&k| leaves[k]).collect();
        self.deactivate(&leaving, None);
        self.activate(&entering);
        self.drop_negative();
    }

    /// The products of a row with the active ones, in their order, padded to whole lines.
    pub(super) fn products(&self, slot: usize) -> Vec<f64> {
        let row = &self.gram[slot * self.gram_stride..][..self.gram_stride];
        let mut out = vec![0.0; self.factor.padded_length()];
        for (value, &slot) in out.iter_mut().zip(&self.active) {
            *value = row[slot];
        }
        out
    }

    /// Activates these rows with multiplier 0, except rows that (nearly) depend on others.
    pub(super) fn activate(&mut self, slots: &[usize]) {
        for block in slots.chunks(BLOCK) {
            let block: Vec<usize> = block.iter().copied().filter(|&slot| self.positions[slot].is_none()).collect();
            let stride = self.factor.padded_length();
            let mut g: Vec<f64> = block.iter().flat_map(|&slot| self.products(slot)).collect();
            let (gram, wide) = (&self.gram, self.gram_stride);
            let products = |&slot: &usize| block.iter().map(move |&other| gram[slot * wide + other]);
            let mut inner_products: Vec<f64> = block.iter().flat_map(products).collect();
            let limits: Vec<f64> = block.iter().map(|&slot| self.rows[slot].limit).collect();
            for k in self.factor.append(&mut g, stride, &mut inner_products, &limits, DOUBTFUL, self.lower.len()) {
                self.positions[block[k]] = Some(self.active.len());
                self.active.push(block[k]);
            }
        }
    }

    /// Activates these rows with their multipliers, and no others: in blocks first, then the nearly dependent ones one by
    /// one with exact pivots.
    pub(super) fn restore(&mut self, slots: &[usize], multipliers: &[f64]) {
        self.deactivate_all();
        self.activate(slots);
        for &slot in slots {
            if self.positions[slot].is_none() {
                let mut d = self.products(slot);
                self.factor.forward(&mut d);
                let (pivot, _) = self.pivot(slot, &d);
                if pivot > DEPENDENT[self.dependent] && self.active.len() < self.lower.len() {
                    self.factor.push(&d, pivot.sqrt(), self.rows[slot].limit);
                    self.positions[slot] = Some(self.active.len());
                    self.active.push(slot);
                }
            }
        }
        for &slot in &self.active {
            self.multipliers[slot] = multipliers[slot];
        }
    }

    /// The squared pivot of a row whose `L^-1 g` is `d`, and its coordinates r in terms of the active rows.
    pub(super) fn pivot(&self, slot: usize, d: &[f64]) -> (f64, Vec<f64>) {
        let mut r = d.to_vec();
        self.factor.backward(&mut r);
        let length = self.gram[slot * self.gram_stride + slot];
        let pivot = length - dot(d, d);
        if pivot >= DOUBTFUL || self.active.is_empty() {
            return (pivot, r);
        }
        let rest = |r: &[f64]| {
            let mut z = self.coefficients[slot * self.stride..][..self.stride].to_vec();
            let by: Vec<f64> = r[..self.active.len()].iter().map(|r| -r).collect();
            add_rows(&self.coefficients, self.stride, &self.active, &by, &mut z);
            z
        };
        let mut z = rest(&r);
        for _ in 0..2 {
            let mut change = vec![0.0; self.factor.padded_length()];
            rows_times(&self.coefficients, self.stride, &self.active, &z, &mut change[..self.active.len()]);
            self.factor.forward(&mut change);
            self.factor.backward(&mut change);
            for (r, change) in r.iter_mut().zip(&change) {
                *r += change;
            }
            z = rest(&r);
        }
        (dot(&z, &z), r)
    }

    /// One step of Goldfarb and Idnani: activates a violated row, and deactivates rows whose multiplier reaches 0 on the way.
    ///
    /// Returns a ray by slot if neither is possible.
    pub(super) fn step(&mut self, slot: usize, sign: f64, mut violation: f64) -> Option<Vec<f64>> {
        let mut d = self.products(slot);
        self.factor.forward(&mut d);
        loop {
            let (pivot, r) = self.pivot(slot, &d);
            let dependent = pivot <= DEPENDENT[self.dependent] || self.active.len() >= self.lower.len();
            let mut length = if dependent { f64::INFINITY } else { violation / pivot };
            let mut against = None;
            let largest = r.iter().fold(0.0, |largest: f64, r| largest.max(r.abs()));
            for (position, (&held, r)) in self.active.iter().zip(&r).enumerate() {
                let r = sign * r;
                if r > 1e-13 * largest && !self.is_equality(held) {
                    let until = self.multipliers[held].max(0.0) / r;
                    if until < length {
                        (length, against) = (until, Some(position));
                    }
                }
            }
            if length.is_infinite() {
                let mut ray = vec![0.0; self.rows.len()];
                for (&held, r) in self.active.iter().zip(&r) {
                    ray[held] = if self.is_equality(held) { -sign * r } else { (-sign * r).max(0.0) };
                }
                ray[slot] = sign;
                return Some(ray);
            }
            for (&held, r) in self.active.iter().zip(&r) {
                self.multipliers[held] -= length * sign * r;
            }
            self.multipliers[slot] += length * sign;
            let Some(position) = against else {
                self.factor.push(&d, pivot.sqrt(), self.rows[slot].limit);
                self.positions[slot] = Some(self.active.len());
                self.active.push(slot);
                return None;
            };
            violation -= length * pivot;
            self.deactivate(&[position], Some(&mut d));
        }
    }
}
