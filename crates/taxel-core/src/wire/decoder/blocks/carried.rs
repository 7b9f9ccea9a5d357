//! The state that a loop over plain words carries, and how it reads a word.

use crate::wire::decoder::clock::{FARTHEST_BACK, TURN};
#[cfg(target_arch = "x86_64")]
use crate::wire::v1::WORD_BYTES;

/// Largest distance of a stamp ahead of the latest time that is not ambiguous: see [`FARTHEST_BACK`].
const FARTHEST_AHEAD: i64 = TURN - FARTHEST_BACK - 1;

/// The state of the block loop besides the rows.
pub(crate) struct Carried {
    /// Current time, in stamps: the latest time, or after a step back the time in the reordered stretch.
    pub(crate) latest: i64,
    /// The time up to which words are plain, in stamps.
    pub(crate) until: i64,
    /// Number of intensities with a change, and number without.
    pub(crate) intensities: u64,
    pub(crate) unpaired: u64,
}

impl Carried {
    /// Largest distance of a stamp ahead of the current time; 0 or more until `until` is passed.
    #[inline(always)]
    pub(super) fn largest_lead(&self) -> u16 {
        (self.until - self.latest).min(FARTHEST_AHEAD) as u16
    }
}

/// The 16-bit value of the word at `at`; the caller has checked that its bytes are in place.
#[inline(always)]
pub(super) fn value(bytes: &[u8], at: usize) -> u16 {
    u16::from(bytes[at]) << 14 | u16::from(bytes[at + 1]) << 7 | u16::from(bytes[at + 2])
}

/// The index of byte `j` of a stride-5 word: `indices[k]` for 16-bit lanes, with `otherwise` for `None`.
#[cfg(target_arch = "x86_64")]
pub(super) const fn indices<const N: usize>(bytes: [Option<u8>; 2], first: i32, below: i32, otherwise: u8) -> [u8; N] {
    let mut out = [otherwise; N];
    let mut k = 0;
    while k < N {
        if let Some(j) = bytes[k % 2] {
            let index = (k as i32 / 2) * WORD_BYTES as i32 + j as i32 - first;
            if index >= 0 && index < below {
                out[k] = index as u8;
            }
        }
        k += 1;
    }
    out
}
