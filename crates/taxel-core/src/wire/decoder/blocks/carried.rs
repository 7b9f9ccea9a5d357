//! What a loop over plain words carries, and how it reads one.

use crate::wire::decoder::clock::{FARTHEST_BACK, TURN};
#[cfg(target_arch = "x86_64")]
use crate::wire::v1::WORD_BYTES;

/// Stamps ahead of the latest time that are surely ahead: see [`FARTHEST_BACK`].
const FARTHEST_AHEAD: i64 = TURN - FARTHEST_BACK - 1;

/// What the block loop carries besides rows.
pub(crate) struct Carried {
    /// The time come to, in stamps: the latest, or that of a stretch behind it.
    pub(crate) latest: i64,
    /// Up to which time the words are plain, in stamps.
    pub(crate) until: i64,
    /// Intensities that found their change, and those that did not.
    pub(crate) intensities: u64,
    pub(crate) unpaired: u64,
}

impl Carried {
    /// How far ahead of the time come to a stamp may lie; 0 or more as long as `until` is not passed.
    #[inline(always)]
    pub(super) fn farthest(&self) -> u16 {
        (self.until - self.latest).min(FARTHEST_AHEAD) as u16
    }
}

/// The 16 bits of value in the word at `at`; the bytes are in place, as the caller has checked.
#[inline(always)]
pub(super) fn value(bytes: &[u8], at: usize) -> u16 {
    u16::from(bytes[at]) << 14 | u16::from(bytes[at + 1]) << 7 | u16::from(bytes[at + 2])
}

/// Where byte `j` of a stride-5 word lies: `place(k)` for lanes of two bytes, `None` becoming `otherwise`.
#[cfg(target_arch = "x86_64")]
pub(super) const fn indices<const N: usize>(bytes: [Option<u8>; 2], first: i32, below: i32, otherwise: u8) -> [u8; N] {
    let mut out = [otherwise; N];
    let mut k = 0;
    while k < N {
        if let Some(j) = bytes[k % 2] {
            let place = (k as i32 / 2) * WORD_BYTES as i32 + j as i32 - first;
            if place >= 0 && place < below {
                out[k] = place as u8;
            }
        }
        k += 1;
    }
    out
}
