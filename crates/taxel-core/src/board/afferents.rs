//! Each taxel as an FA-1 afferent (5.4.2), in the whole numbers that the logic has: the registers' page says which.

use crate::wire::Registers;
use crate::wire::registers::{POWER_LAW, POWER_LAW_FRACTION};

/// Bits behind the point of `threshold_rest` and of the intensity word.
const TOLD_FRACTION: u32 = 10;

/// Integrals and thresholds of all taxels.
#[derive(Debug, Clone, Default)]
pub(super) struct Afferents {
    /// By taxel: compressed pressure (5.1) where the integral (5.3) was last reset; none before the first frame.
    base: Vec<u32>,
    /// By taxel: the threshold (5.5).
    threshold: Vec<u32>,
}

impl Afferents {
    /// Forgets everything: the next frame counts as what had always been.
    pub(super) fn forget(&mut self) {
        self.base.clear();
    }

    /// Takes the trip time of a taxel (already held within the ramp), frame by frame; the integral where it fires.
    pub(super) fn sample(&mut self, taxel: usize, ticks: u16, registers: &Registers) -> Option<i64> {
        let rest = u32::from(registers.threshold_rest) << (POWER_LAW_FRACTION - TOLD_FRACTION);
        let share = |part: u16, whole: u32| (u64::from(part) * u64::from(rest) / u64::from(whole)) as u32;
        let pressure = POWER_LAW[usize::from(ticks).min(POWER_LAW.len() - 1)];
        let (base, threshold) = (&mut self.base[taxel], &mut self.threshold[taxel]);
        let integral = i64::from(pressure) - i64::from(*base);
        if integral.unsigned_abs() > u64::from(*threshold) {
            *base = pressure;
            *threshold = threshold.saturating_add(share(registers.threshold_jump, 256));
            return Some(integral);
        }
        *threshold = if *threshold > rest {
            threshold.saturating_sub(share(registers.threshold_decay.into(), 1024))
        } else {
            rest
        };
        None
    }

    /// Begins with the pressures of a frame, where this is the first.
    pub(super) fn begin(&mut self, ticks: &[u16], registers: &Registers) {
        if self.base.is_empty() {
            let table = |&t: &u16| POWER_LAW[usize::from(t.min(registers.ramp)).min(POWER_LAW.len() - 1)];
            self.base = ticks.iter().map(table).collect();
            let rest = u32::from(registers.threshold_rest) << (POWER_LAW_FRACTION - TOLD_FRACTION);
            self.threshold = vec![rest; ticks.len()];
        }
    }
}

/// The intensity word of a spike: how large the integral was.
pub(super) fn told(integral: i64) -> u16 {
    (integral.unsigned_abs() >> (POWER_LAW_FRACTION - TOLD_FRACTION)).min(u16::MAX.into()) as u16
}
