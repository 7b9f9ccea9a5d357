//! Models each taxel as an FA-1 afferent (5.4.2), in the integer arithmetic of the logic (docs: *Registers*).

use crate::wire::Registers;
use crate::wire::registers::{POWER_LAW, POWER_LAW_FRACTION};

/// Fractional bits of `threshold_rest` and of the intensity word.
const WORD_FRACTION: u32 = 10;

/// What a taxel's afferent remembers.
#[derive(Debug, Clone, Copy)]
struct BoardAfferent {
    /// The compressed pressure (5.1) when the integral (5.3) was last reset.
    base: u32,
    /// The threshold (5.5).
    threshold: u32,
    /// The integral at its last spike.
    fired: i64,
}

/// The afferents by taxel; none before a taxel's first reading.
#[derive(Debug, Clone)]
pub(super) struct BoardAfferents(Vec<Option<BoardAfferent>>);

impl BoardAfferents {
    /// Afferents without a reading.
    pub(super) fn new(taxels: usize) -> Self {
        Self(vec![None; taxels])
    }

    /// Returns to the state before the first frame: the first reading of each taxel becomes its reference.
    pub(super) fn forget(&mut self) {
        self.0.fill(None);
    }

    /// Processes a taxel's next trip time (already limited to the ramp); returns whether the taxel fires.
    ///
    /// Its first one counts as what had always been.
    pub(super) fn sample(&mut self, taxel: usize, ticks: u16, registers: &Registers) -> bool {
        let rest = rest(registers);
        let share = |part: u16, total: u32| (u64::from(part) * u64::from(rest) / u64::from(total)) as u32;
        let pressure = pressure(ticks);
        let Some(BoardAfferent { base, threshold, fired }) = &mut self.0[taxel] else {
            self.0[taxel] = Some(BoardAfferent { base: pressure, threshold: rest, fired: 0 });
            return false;
        };
        let integral = i64::from(pressure) - i64::from(*base);
        if integral.unsigned_abs() > u64::from(*threshold) {
            *base = pressure;
            *threshold = threshold.saturating_add(share(registers.threshold_jump, 256));
            *fired = integral;
            return true;
        }
        *threshold = if *threshold > rest {
            threshold.saturating_sub(share(registers.threshold_decay.into(), 1024))
        } else {
            rest
        };
        false
    }

    /// The spike of a taxel that fired: its polarity, and its intensity word, the magnitude of the integral.
    pub(super) fn spike(&self, taxel: usize) -> (bool, u16) {
        let integral = self.0[taxel].map_or(0, |afferent| afferent.fired);
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
