//! The working set: its rows by slot, and their Gram matrix (the products of all pairs).

use super::kernels::products;
use super::rows::{ConstraintKind, RowId, WorkingRow};
use super::{BLOCK, DualActiveSet};
use crate::vectors::{Aligned, LANES, dot};
use crate::{Result, problem};

/// The number of rows for which memory is allocated at first, if that many can be active; growth beyond it
/// copies the rows.
const AT_FIRST: usize = 1024;

impl DualActiveSet {
    /// Adds a row as stated.
    pub(super) fn add(&mut self, kind: fn(RowId) -> ConstraintKind, coefficients: &[f64], limit: f64) -> Result<RowId> {
        if coefficients.len() != self.lower.len() {
            return Err(problem!("row: {} coefficients for {} weights", coefficients.len(), self.lower.len()));
        }
        if !(limit.is_finite() && coefficients.iter().all(|a| a.is_finite())) {
            return Err(problem!("row: a coefficient or the limit is not finite"));
        }
        let length = dot(coefficients, coefficients).sqrt();
        let length = if length > 0.0 { length } else { 1.0 };
        let id = RowId(self.added);
        self.added += 1;
        let slot = self.slot(WorkingRow { kind: kind(id), length, limit: limit / length });
        for (to, a) in self.coefficients[slot * self.stride..].iter_mut().zip(coefficients) {
            *to = a / length;
        }
        self.fresh.push(slot);
        Ok(id)
    }

    /// Puts a row into a free slot, with coefficients of 0.
    pub(super) fn slot(&mut self, row: WorkingRow) -> usize {
        let slot = self.free.pop().unwrap_or(self.rows.len());
        if slot == self.rows.len() {
            self.rows.push(row);
            self.positions.push(None);
            self.multipliers.push(0.0);
            self.excess.push(0.0);
            if self.coefficients.len() < self.rows.len() * self.stride {
                let mut coefficients = Aligned::zeros(self.capacity(self.rows.len()) * self.stride);
                coefficients[..self.coefficients.len()].copy_from_slice(&self.coefficients);
                self.coefficients = coefficients;
            }
        } else {
            self.coefficients[slot * self.stride..][..self.stride].fill(0.0);
        }
        self.rows[slot] = row;
        let at = self.live.partition_point(|&s| s < slot);
        self.live.insert(at, slot);
        slot
    }

    /// The number of slots to allocate when `slots` are in use.
    pub(super) fn capacity(&self, slots: usize) -> usize {
        (slots + slots / 2 + 64).max(self.lower.len().min(AT_FIRST))
    }

    /// Enlarges the Gram matrix to the number of slots.
    pub(super) fn enlarge_gram(&mut self) {
        let slots = self.rows.len();
        if slots <= self.gram_stride {
            return;
        }
        let stride = self.capacity(slots).next_multiple_of(LANES);
        let stride = if stride.is_multiple_of(64) { stride + LANES } else { stride };
        let mut gram = Aligned::zeros(stride * stride);
        for (new, old) in gram.chunks_exact_mut(stride).zip(self.gram.chunks_exact(self.gram_stride.max(1))) {
            new[..self.gram_stride].copy_from_slice(old);
        }
        (self.gram, self.gram_stride) = (gram, stride);
    }

    /// Computes the products of the fresh rows with all rows, in one matrix product; returns the fresh rows.
    pub(super) fn extend_gram(&mut self) -> Vec<usize> {
        self.enlarge_gram();
        let fresh = std::mem::take(&mut self.fresh);
        let (slots, stride) = (self.rows.len(), self.stride);
        for fresh in fresh.chunks(4 * BLOCK) {
            let mut rows = Aligned::zeros(fresh.len() * stride);
            for (row, &slot) in rows.chunks_exact_mut(stride).zip(fresh) {
                row.copy_from_slice(&self.coefficients[slot * stride..][..stride]);
            }
            let mut sums = vec![0.0; fresh.len() * slots];
            products(&rows, &self.coefficients[..slots * stride], stride, &mut sums, slots);
            for (&slot, sums) in fresh.iter().zip(sums.chunks_exact(slots)) {
                self.gram[slot * self.gram_stride..][..slots].copy_from_slice(sums);
            }
            for partner in 0..slots {
                for (k, &slot) in fresh.iter().enumerate() {
                    self.gram[partner * self.gram_stride + slot] = sums[k * slots + partner];
                }
            }
        }
        fresh
    }

    /// The slot of a bound's row, which is added if there is none yet.
    pub(super) fn bound(&mut self, n: usize, upper: bool) -> usize {
        if let Some(slot) = self.bounds[n][usize::from(upper)] {
            return slot;
        }
        let (kind, sign, limit) = if upper {
            (ConstraintKind::Upper(n), 1.0, self.upper[n])
        } else {
            (ConstraintKind::Lower(n), -1.0, -self.lower[n])
        };
        let slot = self.slot(WorkingRow { kind, length: 1.0, limit });
        self.bounds[n][usize::from(upper)] = Some(slot);
        self.coefficients[slot * self.stride + n] = sign;
        self.enlarge_gram();
        for partner in 0..self.rows.len() {
            let product = sign * self.coefficients[partner * self.stride + n];
            self.gram[slot * self.gram_stride + partner] = product;
            self.gram[partner * self.gram_stride + slot] = product;
        }
        self.excess[slot] = sign * self.weights[n] - limit;
        slot
    }
}
