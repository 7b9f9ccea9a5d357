//! CRC-32C (Castagnoli), which short datagrams want quickly too.

#[cfg(target_arch = "x86_64")]
use crate::vectors::Instructions;

/// From so many bytes on the crate's way, several strands at once, is the faster one.
#[cfg(target_arch = "x86_64")]
const LONG: usize = 192;

/// No more bytes are summed without a branch, which lengths of a scene's datagrams would make the processor guess wrong.
#[cfg(target_arch = "x86_64")]
pub(super) const EVEN: usize = 64;

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
        // SAFETY: the machine has SSE 4.2, as was just asked, and there are 8 bytes or more.
        return unsafe { short(bytes) };
    }
    crc32c::crc32c(bytes)
}

/// Bytes of a register.
#[cfg(target_arch = "x86_64")]
const REGISTER: usize = 16;

/// A register with which a sum begins, by how many zero bytes come before the message: all ones are left behind those.
#[cfg(target_arch = "x86_64")]
static BEFORE_ZEROS: [u32; EVEN - REGISTER + 1] = {
    let mut out = [u32::MAX; EVEN - REGISTER + 1];
    let mut zeros = 1;
    while zeros < out.len() {
        let (mut sum, mut bit) = (out[zeros - 1], 0);
        while bit < 8 {
            // A step back: the top bit shows whether the polynomial was added.
            sum = if sum >> 31 == 1 { (sum ^ 0x82f6_3b78) << 1 | 1 } else { sum << 1 };
            bit += 1;
        }
        out[zeros] = sum;
        zeros += 1;
    }
    out
};

/// From place `16 - k` on: a register's bytes moved `k` places to the back (`pshufb`), zeros before them.
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

/// Eight steps for whatever length: the message behind so many zeros that they are [`EVEN`] bytes together.
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
        // SAFETY: `from` is at most 16 before the end of the bytes, as `at` is before that of the 64, and 0 at least; the table has
        // 16 bytes from place 0 to 16 on.
        let lanes = unsafe {
            let lanes = _mm_loadu_si128(bytes.as_ptr().add(from).cast());
            _mm_shuffle_epi8(lanes, _mm_loadu_si128(TO_BACK.as_ptr().add(REGISTER - moved).cast()))
        };
        sum = _mm_crc32_u64(sum, _mm_cvtsi128_si64(lanes) as u64);
        sum = _mm_crc32_u64(sum, _mm_extract_epi64::<1>(lanes) as u64);
    }
    !(sum as u32)
}

/// One strand of eight bytes at a time. Zeros before a message do not change a sum that begins at 0, and beginning at all ones
/// is the same as turning the message's first 32 bits over: so the bytes that are no whole eight come first, behind zeros.
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
    // Of `odd` bytes before the first whole eight; the turned bits that do not fit go into those.
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
