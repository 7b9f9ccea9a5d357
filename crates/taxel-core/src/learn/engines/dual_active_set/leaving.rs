//! Rows that leave the active set.

use super::DualActiveSet;

impl DualActiveSet {
    /// Deactivates every row.
    pub(super) fn deactivate_all(&mut self) {
        for slot in std::mem::take(&mut self.active) {
            self.positions[slot] = None;
            self.multipliers[slot] = 0.0;
        }
        self.factor.clear();
    }

    /// Deactivates the rows at these positions (ascending); `d`, the vector of a row not yet active, is rotated with them.
    pub(super) fn deactivate(&mut self, positions: &[usize], d: Option<&mut Vec<f64>>) {
        self.factor.remove(positions, d);
        for &position in positions {
            let slot = self.active[position];
            self.positions[slot] = None;
            self.multipliers[slot] = 0.0;
        }
        let positions = &self.positions;
        self.active.retain(|&slot| positions[slot].is_some());
        for (position, &slot) in self.active.iter().enumerate() {
            self.positions[slot] = Some(position);
        }
    }

    /// Finds an optimum over some of the active rows: repeatedly deactivates all whose multipliers would turn negative.
    pub(super) fn drop_negative(&mut self) {
        loop {
            let optimum = self.factor.optimum();
            let negative = |&k: &usize| optimum[k] < 0.0 && !self.is_equality(self.active[k]);
            let negative: Vec<usize> = (0..optimum.len()).filter(negative).collect();
            if negative.is_empty() {
                for (&slot, u) in self.active.iter().zip(optimum) {
                    self.multipliers[slot] = u;
                }
                return;
            }
            self.deactivate(&negative, None);
        }
    }

    /// Like `drop_negative`, but moves each time only until the first multiplier reaches 0, so that the dual only
    /// rises.
    pub(super) fn ascend(&mut self) {
        loop {
            let optimum = self.factor.optimum();
            let mut length: f64 = 1.0;
            for (&slot, &to) in self.active.iter().zip(&optimum) {
                let from = self.multipliers[slot];
                if to < 0.0 && !self.is_equality(slot) {
                    length = length.min(from / (from - to));
                }
            }
            let mut falling = Vec::new();
            for (k, (&slot, &to)) in self.active.iter().zip(&optimum).enumerate() {
                let from = self.multipliers[slot];
                self.multipliers[slot] = from + length * (to - from);
                if to < 0.0 && !self.is_equality(slot) && from / (from - to) <= length {
                    falling.push(k);
                }
            }
            if falling.is_empty() {
                return;
            }
            self.deactivate(&falling, None);
        }
    }
}
