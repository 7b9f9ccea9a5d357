//! Multipliers in terms of the rows as stated, and the proof that the rows contradict each other.

use super::DualActiveSet;
use super::kernels::add_rows;
use super::rows::{ConstraintKind, Multipliers, Ray};

impl DualActiveSet {
    /// Converts multipliers by slot to multipliers of the rows as stated.
    pub(super) fn multipliers_by_row(&self, by_slot: &[f64]) -> Multipliers {
        let mut out = Multipliers::new();
        for &slot in &self.live {
            let u = by_slot[slot] / self.rows[slot].length;
            match self.rows[slot].kind {
                ConstraintKind::Equality(id) if u != 0.0 => out.push((id, u)),
                ConstraintKind::Inequality(id) if u > 0.0 => out.push((id, u)),
                _ => {}
            }
        }
        out.sort_by_key(|&(id, _)| id);
        out
    }

    /// The ray as a proof, if it is one: the multipliers of bounds are left out, and the gap must exceed
    /// rounding.
    pub(super) fn proof(&self, by_slot: Vec<f64>) -> Option<Ray> {
        let bounds = |slot: usize| matches!(self.rows[slot].kind, ConstraintKind::Lower(_) | ConstraintKind::Upper(_));
        let slots: Vec<usize> = self.live.iter().copied().filter(|&s| by_slot[s] != 0.0 && !bounds(s)).collect();
        let by: Vec<f64> =
            slots.iter().map(|&s| if self.is_equality(s) { by_slot[s] } else { by_slot[s].max(0.0) }).collect();
        let mut g = vec![0.0; self.stride];
        add_rows(&self.coefficients, self.stride, &slots, &by, &mut g);
        let (mut least, mut size, mut widest) = (0.0, 0.0, 0.0_f64);
        for (n, &g) in g[..self.lower.len()].iter().enumerate().filter(|(_, g)| **g != 0.0) {
            let (low, high) = (self.lower[n] * g, self.upper[n] * g);
            least += low.min(high);
            size += low.abs().max(high.abs());
            widest = widest.max(self.lower[n].abs()).max(self.upper[n].abs());
        }
        let mut rounding = 0.0;
        for (&slot, &by) in slots.iter().zip(&by) {
            least -= by * self.rows[slot].limit;
            size += (by * self.rows[slot].limit).abs();
            rounding += by.abs();
        }
        rounding *= f64::EPSILON * widest * (self.lower.len() as f64).sqrt();
        (least > 1e-12 * size + rounding).then(|| Ray { multipliers: self.multipliers_by_row(&by_slot), gap: least })
    }
}
