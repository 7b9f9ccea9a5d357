//! CRC-32C (Castagnoli), with one way for all short datagrams.

/// The CRC-32C of bytes.
#[inline]
pub(super) fn crc32c(bytes: &[u8]) -> u32 {
    #[cfg(target_arch = "x86_64")]
    if (short::REGISTER..=short::MOST).contains(&bytes.len()) && is_x86_feature_detected!("sse4.2") {
        // SAFETY: the machine has SSE 4.2, and the length is in the range.
        return unsafe { short::crc32c(bytes) };
    }
    ::crc32c::crc32c(bytes)
}

#[cfg(target_arch = "x86_64")]
mod short {
    use std::arch::x86_64::{_mm_crc32_u64, _mm_cvtsi128_si64, _mm_extract_epi64, _mm_loadu_si128, _mm_shuffle_epi8};

    /// Size of a register, bytes.
    pub(super) const REGISTER: usize = 16;

    /// Longest message, bytes, to which zeros before it extend every other: the datagrams of a scene vary in length, and no
    /// processor can predict a branch on it.
    pub(super) const MOST: usize = 3 * REGISTER;

    /// The sum from which to begin, by the number of zeros before the message: after these it is all ones.
    static BEFORE_ZEROS: [u32; MOST - REGISTER + 1] = {
        let mut out = [u32::MAX; MOST - REGISTER + 1];
        let mut zeros = 1;
        while zeros < out.len() {
            let (mut sum, mut bit) = (out[zeros - 1], 0);
            while bit < 8 {
                // One step backwards: the top bit shows whether the polynomial was added.
                sum = if sum >> 31 == 1 { (sum ^ 0x82f6_3b78) << 1 | 1 } else { sum << 1 };
                bit += 1;
            }
            out[zeros] = sum;
            zeros += 1;
        }
        out
    };

    /// Indices for `pshufb`: those from index `16 - k` on move a register's bytes back by `k` bytes, with zeros before
    /// them.
    static TO_BACK: [u8; 2 * REGISTER] = {
        let mut out = [0x80; 2 * REGISTER];
        let mut k = 0;
        while k < REGISTER {
            out[REGISTER + k] = k as u8;
            k += 1;
        }
        out
    };

    /// The CRC-32C of a message.
    ///
    /// # Safety
    ///
    /// There must be [`REGISTER`] to [`MOST`] bytes.
    #[inline]
    #[target_feature(enable = "sse4.2")]
    pub(super) unsafe fn crc32c(bytes: &[u8]) -> u32 {
        let zeros = MOST - bytes.len();
        let mut sum = u64::from(BEFORE_ZEROS[zeros]);
        for at in (0..MOST).step_by(REGISTER) {
            let (from, moved) = (at.saturating_sub(zeros), zeros.saturating_sub(at).min(REGISTER));
            // SAFETY: `from` is at most a register's size before the end of `bytes`, as `at` is before that of the extended
            // message; the table has a register's bytes from each of its indices 0 to 16 on.
            let lanes = unsafe {
                let lanes = _mm_loadu_si128(bytes.as_ptr().add(from).cast());
                _mm_shuffle_epi8(lanes, _mm_loadu_si128(TO_BACK.as_ptr().add(REGISTER - moved).cast()))
            };
            sum = _mm_crc32_u64(sum, _mm_cvtsi128_si64(lanes) as u64);
            sum = _mm_crc32_u64(sum, _mm_extract_epi64::<1>(lanes) as u64);
        }
        !(sum as u32)
    }
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng, rngs::StdRng};

    use super::*;

    #[test]
    fn short_ones_are_the_crates() {
        let mut random = StdRng::seed_from_u64(1);
        for length in 0..100 {
            let bytes: Vec<u8> = (0..length).map(|_| random.random()).collect();
            assert_eq!(crc32c(&bytes), ::crc32c::crc32c(&bytes), "{length} bytes");
        }
    }
}
