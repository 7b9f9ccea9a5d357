//! Plain stretches of a stream, many words at a time, with what instructions the machine has.
//!
//! Words are plain when all their bytes are in place, they are changes and intensities on the array, and their stamps do
//! not fall. Anything else stops the loop, and the decoder takes the next word by itself: it alone says what damage,
//! markers and steps back mean, so every set of instructions gives the same events and counts.

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod scalar;

use super::Sheet;
use crate::wire::v1::WORD_BYTES;

/// Words of the longest block.
const BLOCK_WORDS: usize = 32;

/// Stamps ahead of the latest time that are surely ahead: see [`super::FARTHEST_BACK`].
const FARTHEST_AHEAD: u16 = (super::TURN - super::FARTHEST_BACK - 1) as u16;

/// Vector instructions that a decoder may use.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Instructions {
    /// None: word by word, on any machine.
    Scalar,
    /// AVX2: clean changes, and changes that alternate with their intensities.
    Avx2,
    /// AVX-512 with VBMI and VBMI2: any mix.
    Avx512,
}

/// What the block loop carries besides rows.
pub(super) struct State {
    /// The latest time, in stamps.
    pub(super) latest: i64,
    /// Intensities that found their change, and those that did not.
    pub(super) intensities: u64,
    pub(super) unpaired: u64,
}

impl Instructions {
    /// All, from the plainest.
    pub const ALL: [Self; 3] = [Self::Scalar, Self::Avx2, Self::Avx512];

    /// The best that this machine has.
    #[must_use]
    pub fn best() -> Self {
        Self::ALL.into_iter().rev().find(|i| i.present()).unwrap_or(Self::Scalar)
    }

    /// Whether this machine has them.
    #[must_use]
    pub fn present(self) -> bool {
        match self {
            Self::Scalar => true,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => is_x86_feature_detected!("avx2"),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => {
                is_x86_feature_detected!("avx512f")
                    && is_x86_feature_detected!("avx512bw")
                    && is_x86_feature_detected!("avx512vl")
                    && is_x86_feature_detected!("avx512vbmi")
                    && is_x86_feature_detected!("avx512vbmi2")
                    && is_x86_feature_detected!("bmi2")
                    && is_x86_feature_detected!("lzcnt")
                    && is_x86_feature_detected!("popcnt")
            }
            #[cfg(not(target_arch = "x86_64"))]
            _ => false,
        }
    }

    /// Decodes plain words from the start of `bytes` into `sheet`, up to the first that is not plain; gives how many
    /// bytes they had.
    pub(super) fn plain(
        self,
        bytes: &[u8],
        columns: u16,
        rows: u16,
        state: &mut State,
        sheet: &mut Sheet<'_>,
    ) -> usize {
        let mut done = 0;
        loop {
            done += self.blocks(&bytes[done..], columns, rows, state, sheet);
            // An odd number, so that pairs that lie across the blocks' edges come to lie inside.
            let most = if self == Self::Scalar { usize::MAX } else { BLOCK_WORDS - 1 };
            let words = scalar::words(&bytes[done..], columns, rows, state, sheet, most);
            done += words * WORD_BYTES;
            if words < most {
                return done;
            }
        }
    }

    /// As [`Self::plain`], whole blocks only.
    #[cfg_attr(not(target_arch = "x86_64"), allow(unused_variables))]
    fn blocks(self, bytes: &[u8], columns: u16, rows: u16, state: &mut State, sheet: &mut Sheet<'_>) -> usize {
        let room = &sheet.room;
        let most = sheet.rows + bytes.len() / WORD_BYTES;
        assert!(
            [room.x.len(), room.y.len(), room.ticks.len()].iter().all(|&n| n >= most)
                && [room.p.len(), room.present.len()].iter().all(|&n| n >= most)
                && room.t.len() >= most,
            "columns too short"
        );
        match self {
            Self::Scalar => 0,
            // SAFETY: `Decoder::instructions` and `best` let a set through only where the machine has it, and every
            // column has room for as many rows more as there are words in `bytes`, as just asserted.
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => unsafe { avx2::blocks(bytes, columns, rows, state, sheet) },
            // SAFETY: as above.
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => unsafe { avx512::blocks(bytes, columns, rows, state, sheet) },
            #[cfg(not(target_arch = "x86_64"))]
            _ => 0,
        }
    }
}

/// The 16 bits of value in the word at `at`; the bytes are in place, as the caller has checked.
#[inline(always)]
fn value(bytes: &[u8], at: usize) -> u16 {
    u16::from(bytes[at]) << 14 | u16::from(bytes[at + 1]) << 7 | u16::from(bytes[at + 2])
}

/// Where byte `j` of a stride-5 word lies: `place(k)` for lanes of two bytes, `None` becoming `otherwise`.
#[cfg(target_arch = "x86_64")]
const fn indices<const N: usize>(bytes: [Option<u8>; 2], first: i32, below: i32, otherwise: u8) -> [u8; N] {
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
