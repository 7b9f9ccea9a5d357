//! Models each taxel as an FA-1 afferent (5.4.2), in the integer arithmetic of the logic (docs: *Registers*).

use crate::wire::Registers;
use crate::wire::registers::{POWER_LAW, POWER_LAW_FRACTION};

/// Fractional bits of `threshold_rest` and of the intensity word.
const WORD_FRACTION: u32 = 10;

/// Integrals and thresholds of all taxels.
#[derive(Debug, Clone, Default)]
pub(super) struct Afferents {
    /// By taxel: the compressed pressure (5.1) when the integral (5.3) was last reset; empty before the first frame.
    base: Vec<u32>,
    /// By taxel: the threshold (5.5).
    threshold: Vec<u32>,
    /// By taxel: the integral at its last spike.
    fired: Vec<i64>,
}

impl Afferents {
    /// Returns to the state before the first frame; the next frame's pressures become the reference.
    pub(super) fn forget(&mut self) {
        self.base.clear();
    }

    /// Processes a taxel's next trip time (already limited to the ramp); returns whether the taxel fires.
    pub(super) fn sample(&mut self, taxel: usize, ticks: u16, registers: &Registers) -> bool {
        let rest = rest(registers);
        let share = |part: u16, whole: u32| (u64::from(part) * u64::from(rest) / u64::from(whole)) as u32;
        let pressure = pressure(ticks);
        let (base, threshold) = (&mut self.base[taxel], &mut self.threshold[taxel]);
        let integral = i64::from(pressure) - i64::from(*base);
        if integral.unsigned_abs() > u64::from(*threshold) {
            *base = pressure;
            *threshold = threshold.saturating_add(share(registers.threshold_jump, 256));
            self.fired[taxel] = integral;
            return true;
        }
        *threshold = if *threshold > rest {
            threshold.saturating_sub(share(registers.threshold_decay.into(), 1024))
        } else {
            rest
        };
        false
    }

    /// Initialises the state with the pressures of the first frame; does nothing later.
    pub(super) fn begin(&mut self, ticks: &[u16], registers: &Registers) {
        if self.base.is_empty() {
            self.base = ticks.iter().map(|&t| pressure(t.min(registers.ramp))).collect();
            self.threshold = vec![rest(registers); ticks.len()];
            self.fired = vec![0; ticks.len()];
        }
    }

    /// The spike of a taxel that fired: its polarity, and its intensity word, the magnitude of the integral.
    pub(super) fn spike(&self, taxel: usize) -> (bool, u16) {
        let integral = self.fired[taxel];
        let size = integral.unsigned_abs() >> (POWER_LAW_FRACTION - WORD_FRACTION);
        (integral > 0, size.min(u16::MAX.into()) as u16)
    }
}

/// The threshold at rest.
fn rest(registers: &Registers) -> u32 {
    u32::from(registers.threshold_rest) << (POWER_LAW_FRACTION - WORD_FRACTION)
}

/// Compressed pressure (5.1) of a trip time.
fn pressure(ticks: u16) -> u32 {
    POWER_LAW[usize::from(ticks).min(POWER_LAW.len() - 1)]
}
