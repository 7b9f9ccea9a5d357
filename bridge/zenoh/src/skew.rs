//! The clock of this computer, with an offset for tests.

use std::time::{SystemTime, UNIX_EPOCH};

/// Position of the base time in a parcel.
const BASE: std::ops::Range<usize> = 24..32;

/// Offset and drift of the published clock, for tests; both are 0 otherwise.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Skew {
    ahead_ns: i64,
    drift_ppm: f64,
    since_ns: i64,
}

impl Skew {
    /// A clock that is ahead by this from now on, and runs faster by `drift_ppm`.
    pub(crate) fn new(ahead_ns: i64, drift_ppm: f64) -> Self {
        Self { ahead_ns, drift_ppm, since_ns: now_ns() }
    }

    /// The current time, ns since 1970.
    pub(crate) fn now_ns(self) -> i64 {
        self.of(now_ns())
    }

    /// The time of this clock at a time of the system clock.
    #[allow(clippy::cast_precision_loss, clippy::cast_possible_truncation)]
    fn of(self, true_ns: i64) -> i64 {
        let drifted = (true_ns.saturating_sub(self.since_ns) as f64 * self.drift_ppm * 1e-6) as i64;
        true_ns.saturating_add(self.ahead_ns).saturating_add(drifted)
    }

    /// Adds the offset to the base time of a parcel. Bytes that are too short for one stay; the reader refuses them.
    pub(crate) fn stamp(self, parcel: &mut [u8]) {
        if let Some(base) = parcel.get_mut(BASE) {
            let mut bytes = [0; 8];
            bytes.copy_from_slice(base);
            base.copy_from_slice(&self.of(i64::from_le_bytes(bytes)).to_le_bytes());
        }
    }
}

/// The system clock, ns since 1970.
pub(crate) fn now_ns() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_nanos()).unwrap_or(i64::MAX)
}
