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
    if (4..=EVEN).contains(&bytes.len()) && Instructions::Avx512.present() && is_x86_feature_detected!("sse4.2") {
        // SAFETY: the machine has these (and so F, which BW needs), and there are 4 to 64 bytes.
        return unsafe { even(bytes) };
    }
    #[cfg(target_arch = "x86_64")]
    if (8..LONG).contains(&bytes.len()) && is_x86_feature_detected!("sse4.2") {
        // SAFETY: the machine has SSE 4.2, as was just asked, and there are 8 bytes or more.
        return unsafe { short(bytes) };
    }
    crc32c::crc32c(bytes)
}

/// Eight steps for whatever length, the bytes behind zeros, as [`short`] explains.
///
/// # Safety
///
/// There must be 4 to [`EVEN`] bytes.
#[cfg(target_arch = "x86_64")]
#[inline]
#[target_feature(enable = "avx512f,avx512bw,sse4.2")]
pub(super) unsafe fn even(bytes: &[u8]) -> u32 {
    use std::arch::x86_64::{
        _mm_crc32_u64, _mm512_maskz_loadu_epi8, _mm512_maskz_set1_epi8, _mm512_storeu_si512, _mm512_xor_si512,
    };
    let there = u64::MAX << (EVEN - bytes.len());
    let turned = there & !(there << 4);
    let mut words = [0_u64; EVEN / 8];
    // SAFETY: the lanes that are read are the bytes, which end where the 64 end; `words` has 64.
    unsafe {
        let lanes = _mm512_maskz_loadu_epi8(there, bytes.as_ptr_range().end.wrapping_sub(EVEN).cast());
        let lanes = _mm512_xor_si512(lanes, _mm512_maskz_set1_epi8(turned, -1));
        _mm512_storeu_si512(words.as_mut_ptr().cast(), lanes);
    }
    !(words.iter().fold(0, |sum, &word| _mm_crc32_u64(sum, word)) as u32)
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
