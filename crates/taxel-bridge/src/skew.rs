//! The clock of this computer, which trials may set off.

use std::time::{SystemTime, UNIX_EPOCH};

/// Where a parcel's base time stands.
const BASE: std::ops::Range<usize> = 24..32;

/// By how much the clock of this computer is set off, for trials; by nothing else.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Skew {
    ahead_ns: i64,
    drift_ppm: f64,
    since_ns: i64,
}

impl Skew {
    /// Ahead by so much from now on, and running faster by `drift_ppm`.
    pub(crate) fn new(ahead_ns: i64, drift_ppm: f64) -> Self {
        Self { ahead_ns, drift_ppm, since_ns: now_ns() }
    }

    /// The time of now, ns since 1970.
    pub(crate) fn now_ns(self) -> i64 {
        self.of(now_ns())
    }

    /// What the clock shows at a time of the true one.
    #[allow(clippy::cast_precision_loss, clippy::cast_possible_truncation)]
    fn of(self, true_ns: i64) -> i64 {
        let drifted = (true_ns.saturating_sub(self.since_ns) as f64 * self.drift_ppm * 1e-6) as i64;
        true_ns.saturating_add(self.ahead_ns).saturating_add(drifted)
    }

    /// Sets a parcel's base time off. What is too short to hold one is no parcel, and its reader will say so.
    pub(crate) fn stamp(self, parcel: &mut [u8]) {
        if let Some(base) = parcel.get_mut(BASE) {
            let mut bytes = [0; 8];
            bytes.copy_from_slice(base);
            base.copy_from_slice(&self.of(i64::from_le_bytes(bytes)).to_le_bytes());
        }
    }
}

/// The clock of the system, ns since 1970.
pub(crate) fn now_ns() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_nanos()).unwrap_or(i64::MAX)
}
