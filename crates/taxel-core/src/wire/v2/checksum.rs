//! CRC-32C (Castagnoli), with fast paths for short datagrams.

#[cfg(target_arch = "x86_64")]
use crate::vectors::Instructions;

/// From this length on, bytes, the crate's implementation is faster: it computes several strands in parallel.
#[cfg(target_arch = "x86_64")]
const LONG: usize = 192;

/// Longest message that is summed without a branch, bytes: the datagrams of a scene vary in length, which would cause
/// branch mispredictions.
#[cfg(target_arch = "x86_64")]
pub(super) const EVEN: usize = 64;

/// A datagram's bytes but for its checksum, and that checksum; it must have four bytes.
#[inline(always)]
pub(super) fn split_checksum(datagram: &[u8]) -> (&[u8], u32) {
    let (body, sum) = datagram.split_at(datagram.len() - 4);
    (body, u32::from_le_bytes([sum[0], sum[1], sum[2], sum[3]]))
}

/// The CRC-32C of bytes.
#[inline]
pub(super) fn crc32c(bytes: &[u8]) -> u32 {
    #[cfg(target_arch = "x86_64")]
    if (REGISTER..=EVEN).contains(&bytes.len()) && Instructions::Avx2.present() && is_x86_feature_detected!("sse4.2") {
        // SAFETY: the machine has these, and there are 16 to 64 bytes.
        return unsafe { even(bytes) };
    }
    #[cfg(target_arch = "x86_64")]
    if (8..LONG).contains(&bytes.len()) && is_x86_feature_detected!("sse4.2") {
        // SAFETY: the machine has SSE 4.2, as was just checked, and there are 8 bytes or more.
        return unsafe { short(bytes) };
    }
    crc32c::crc32c(bytes)
}

/// Size of a register, bytes.
#[cfg(target_arch = "x86_64")]
const REGISTER: usize = 16;

/// Initial value of the CRC register, by the number of zero bytes before the message: after these zeros the register is
/// all ones.
#[cfg(target_arch = "x86_64")]
static BEFORE_ZEROS: [u32; EVEN - REGISTER + 1] = {
    let mut out = [u32::MAX; EVEN - REGISTER + 1];
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
#[cfg(target_arch = "x86_64")]
static TO_BACK: [u8; 2 * REGISTER] = {
    let mut out = [0x80; 2 * REGISTER];
    let mut k = 0;
    while k < REGISTER {
        out[REGISTER + k] = k as u8;
        k += 1;
    }
    out
};

/// The CRC-32C in eight steps at any length: zeros before the message extend it to [`EVEN`] bytes.
///
/// # Safety
///
/// There must be 16 to [`EVEN`] bytes.
#[cfg(target_arch = "x86_64")]
#[inline]
#[target_feature(enable = "ssse3,sse4.1,sse4.2")]
pub(super) unsafe fn even(bytes: &[u8]) -> u32 {
    use std::arch::x86_64::{_mm_crc32_u64, _mm_cvtsi128_si64, _mm_extract_epi64, _mm_loadu_si128, _mm_shuffle_epi8};
    let zeros = EVEN - bytes.len();
    let mut sum = u64::from(BEFORE_ZEROS[zeros]);
    for at in (0..EVEN).step_by(REGISTER) {
        let (from, moved) = (at.saturating_sub(zeros), zeros.saturating_sub(at).min(REGISTER));
        // SAFETY: `from` is at least 0 and at most 16 bytes before the end of `bytes`, as `at` is before the end of the
        // 64 bytes; the table has 16 bytes from each of its indices 0 to 16 on.
        let lanes = unsafe {
            let lanes = _mm_loadu_si128(bytes.as_ptr().add(from).cast());
            _mm_shuffle_epi8(lanes, _mm_loadu_si128(TO_BACK.as_ptr().add(REGISTER - moved).cast()))
        };
        sum = _mm_crc32_u64(sum, _mm_cvtsi128_si64(lanes) as u64);
        sum = _mm_crc32_u64(sum, _mm_extract_epi64::<1>(lanes) as u64);
    }
    !(sum as u32)
}

/// One strand, eight bytes at a time. Zeros before a message do not change a CRC that begins at 0, and beginning with
/// all ones is equivalent to inverting the message's first 32 bits. So the bytes that do not fill a group of eight are
/// processed first, with zeros before them.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "sse4.2")]
fn short(bytes: &[u8]) -> u32 {
    use std::arch::x86_64::_mm_crc32_u64;
    let eight = |at: usize| {
        let mut word = [0; 8];
        word.copy_from_slice(&bytes[at..at + 8]);
        u64::from_le_bytes(word)
    };
    let first = eight(0) ^ 0xffff_ffff;
    // The `odd` bytes before the first group of eight; the inverted bits that do not fit into them are applied to that
    // group.
    let odd = bytes.len() % 8;
    let (mut sum, mut at) = (0, odd);
    if odd > 0 {
        sum = _mm_crc32_u64(0, first << (64 - 8 * odd));
        sum = _mm_crc32_u64(sum, eight(odd) ^ 0xffff_ffff_u64.checked_shr(8 * odd as u32).unwrap_or(0));
    } else {
        sum = _mm_crc32_u64(sum, first);
    }
    at += 8;
    while at < bytes.len() {
        sum = _mm_crc32_u64(sum, eight(at));
        at += 8;
    }
    !(sum as u32)
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng, rngs::StdRng};

    use super::*;

    #[test]
    fn the_checksum_is_castagnolis() {
        assert_eq!(crc32c(b"123456789"), 0xe306_9283);
    }

    #[test]
    fn short_ones_are_the_crates() {
        let mut random = StdRng::seed_from_u64(1);
        for length in 0..300 {
            let bytes: Vec<u8> = (0..length).map(|_| random.random()).collect();
            assert_eq!(crc32c(&bytes), ::crc32c::crc32c(&bytes), "{length} bytes");
        }
    }
}
