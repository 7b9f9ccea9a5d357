//! The load on a sensor, or on a part of it, as sums from which single taxels can be taken away again.

use super::centre::Coordinates;
use super::weights::Weights;
use crate::columns::{Curve, NOTHING};

/// Sums over taxels, modulo 2^64: a decrease wraps, and the sums are right.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Load {
    /// By their weights.
    sum: u64,
    /// The sum over the taxels that are loaded, and that times their coordinates.
    loaded: u64,
    loaded_x: u64,
    loaded_y: u64,
    area: u32,
}

impl Load {
    /// A taxel that was `before` ticks above rest is `now`; it is loaded above the noise floor.
    #[inline(always)]
    pub(crate) fn change(
        &mut self,
        taxel: usize,
        (before, now): (u16, u16),
        floor: u16,
        at: &Coordinates,
        weights: &Weights,
    ) {
        let less = |now: u16, before: u16| u64::from(now).wrapping_sub(before.into());
        let more = less(now, before);
        self.sum = self.sum.wrapping_add(weights.weighed(taxel, more));
        let loaded = |above: u16| if above > floor { above } else { 0 };
        let (before, now) = (loaded(before), loaded(now));
        let ((x, y), more) = (at.get(taxel), less(now, before));
        self.loaded = self.loaded.wrapping_add(more);
        self.loaded_x = self.loaded_x.wrapping_add(more.wrapping_mul(x));
        self.loaded_y = self.loaded_y.wrapping_add(more.wrapping_mul(y));
        self.area = self.area + u32::from(now > 0) - u32::from(before > 0);
    }

    /// Its curve: the sum, the area and the centre of the loaded taxels.
    pub(crate) fn curve(&self, at: &Coordinates, weights: &Weights) -> Curve {
        if self.sum == 0 {
            return NOTHING;
        }
        let (x, y) = at.centre(self.loaded, self.loaded_x, self.loaded_y);
        Curve { sum: weights.sum(self.sum), area: self.area, x, y }
    }
}
