//! Blocks of 32 words with AVX-512 (F, BW, VL, VBMI, VBMI2) and BMI2.

use std::arch::x86_64::*;

use super::carried::{Carried, indices, value};
use crate::wire::decoder::filling::{FilledColumns, STREAMED};
use crate::wire::v1::{STAMP_US, WORD_BYTES};

const WORDS: usize = 32;
const BYTES: usize = WORDS * WORD_BYTES;

/// A block is loaded into three registers: bytes 0 to 63, 64 to 127, and 96 to 159. A word's bytes are fetched from the
/// first two in one permutation, and from the third for the words that extend beyond byte 127.
struct Fetch {
    front: [u8; 64],
    back: [u8; 64],
    /// Masks of the 64 bytes that are fetched from the front, and from the back.
    from_front: u64,
    from_back: u64,
}

impl Fetch {
    const fn new(bytes: [Option<u8>; 2]) -> Self {
        const NONE: u8 = 0xff;
        let front = indices(bytes, 0, 128, NONE);
        let tail: [u8; 64] = indices(bytes, 96, 64, NONE);
        let (mut from_front, mut from_back) = (0, 0);
        let mut k = 0;
        while k < 64 {
            if front[k] != NONE {
                from_front |= 1 << k;
            } else if tail[k] != NONE {
                from_back |= 1 << k;
            }
            k += 1;
        }
        Self { front, back: tail, from_front, from_back }
    }
}

/// 16-bit lanes: the low 14 bits of the value as two groups of seven, row and column, and the first byte.
static LOW: Fetch = Fetch::new([Some(2), Some(1)]);
static POSITION: Fetch = Fetch::new([Some(3), Some(4)]);
static HEAD: Fetch = Fetch::new([Some(0), None]);

/// For each 16-bit lane, the index of the lane below it, and of the lane above it.
static ONE_UP: [u8; 64] = shift_table(-1);
static ONE_DOWN: [u8; 64] = shift_table(1);

const fn shift_table(by: i32) -> [u8; 64] {
    let mut lanes = [0; 64];
    let mut k = 0;
    while k < WORDS {
        lanes[2 * k] = ((k as i32 + by) & 31) as u8;
        k += 1;
    }
    lanes
}

/// See [`super::blocks`].
///
/// # Safety
///
/// The machine must have the features below, and each column of `filling.room` at least `filling.rows + bytes.len() / 5`
/// entries.
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vbmi2,bmi2,lzcnt,popcnt")]
pub(super) unsafe fn blocks(
    bytes: &[u8],
    columns: u16,
    rows: u16,
    state: &mut Carried,
    filling: &mut FilledColumns<'_>,
) -> usize {
    // Each index table fills one register.
    // SAFETY: each is 64 bytes long.
    let table = |t: &[u8; 64]| unsafe { _mm512_loadu_si512(t.as_ptr().cast()) };
    let (low_front, low_back) = (table(&LOW.front), table(&LOW.back));
    let (position_front, position_back) = (table(&POSITION.front), table(&POSITION.back));
    let (head_front, head_back) = (table(&HEAD.front), table(&HEAD.back));
    let sevens = _mm512_set1_epi16(i16::from_le_bytes([1, 128]));
    let (last_column, last_row) =
        (_mm512_set1_epi16(columns.min(64) as i16 - 1), _mm512_set1_epi16(rows.min(64) as i16 - 1));
    let (one_up, one_down) = (table(&ONE_UP), table(&ONE_DOWN));

    let streamed = bytes.len() >= STREAMED;
    let mut at = 0;
    while at + BYTES <= bytes.len() {
        // SAFETY: `at + 160 <= bytes.len()`, and the loads end at 64, 128 and 160.
        let (a, b, c) = unsafe {
            let block = bytes.as_ptr().add(at);
            (
                _mm512_loadu_si512(block.cast()),
                _mm512_loadu_si512(block.add(64).cast()),
                _mm512_loadu_si512(block.add(96).cast()),
            )
        };
        let low = _mm512_maskz_permutex2var_epi8(LOW.from_front, a, low_front, b);
        let low = _mm512_mask_permutexvar_epi8(low, LOW.from_back, low_back, c);
        let position = _mm512_maskz_permutex2var_epi8(POSITION.from_front, a, position_front, b);
        let position = _mm512_mask_permutexvar_epi8(position, POSITION.from_back, position_back, c);
        let head = _mm512_maskz_permutex2var_epi8(HEAD.from_front, a, head_front, b);
        let head = _mm512_mask_permutexvar_epi8(head, HEAD.from_back, head_back, c);

        // Exactly the first bytes have their top bit set. No word is a marker, so none is contradictory either.
        let in_place = _mm512_test_epi16_mask(head, _mm512_set1_epi16(0x80)) == u32::MAX
            && _mm512_movepi8_mask(_mm512_or_si512(low, position)) == 0;
        let markers = _mm512_test_epi16_mask(head, _mm512_set1_epi16(0x08));
        let position = _mm512_and_si512(position, _mm512_set1_epi16(0x3f3f));
        let x = _mm512_and_si512(position, _mm512_set1_epi16(0x3f));
        let y = _mm512_srli_epi16::<8>(position);
        let outside = _mm512_cmpgt_epi16_mask(x, last_column) | _mm512_cmpgt_epi16_mask(y, last_row);
        if !in_place || markers | outside != 0 {
            break;
        }
        let values = _mm512_or_si512(_mm512_maddubs_epi16(sevens, low), _mm512_slli_epi16::<14>(head));
        let intensities = _mm512_test_epi16_mask(head, _mm512_set1_epi16(0x20));
        let polarity = _mm512_test_epi16_mask(head, _mm512_set1_epi16(0x40));
        let changes = !intensities;
        let count = changes.count_ones() as usize;

        // The rows are the block's changes, in order.
        let (stamps, xs, ys, ps);
        if intensities == 0 {
            (stamps, xs, ys, ps) = (values, x, y, polarity);
        } else {
            stamps = _mm512_maskz_compress_epi16(changes, values);
            xs = _mm512_maskz_compress_epi16(changes, x);
            ys = _mm512_maskz_compress_epi16(changes, y);
            ps = _pext_u32(polarity, changes);
        }
        // The stamps do not fall, so each is ahead of the latest time if it is ahead of the stamp before it.
        let base = state.latest as u16;
        let ahead = _mm512_sub_epi16(stamps, _mm512_set1_epi16(base as i16));
        let before = _mm512_maskz_permutexvar_epi16(u32::MAX << 1, one_up, ahead);
        let none = if count == WORDS { 0 } else { u32::MAX << count };
        let rising = _mm512_cmpge_epu16_mask(ahead, before) | none;
        let farthest = if count == 0 {
            0
        } else {
            let last = 31 - changes.leading_zeros() as usize;
            value(bytes, at + WORD_BYTES * last).wrapping_sub(base)
        };
        if rising != u32::MAX || farthest > state.largest_lead() {
            break;
        }

        let first = filling.rows;
        if intensities != 0 {
            // An intensity is paired if the word before it is a change of the same taxel.
            let position_before = _mm512_permutexvar_epi16(one_up, position);
            let same = _mm512_cmpeq_epi16_mask(position, position_before) & !1;
            let mut paired = intensities & (changes << 1) & same;
            let taxel = (u16::from(bytes[at + 3] & 0x3f), u16::from(bytes[at + 4] & 0x3f));
            if intensities & 1 != 0 && filling.open && filling.last_taxel() == taxel {
                paired |= 1;
            }
            if paired != 0 {
                filling.begin_pairs();
                if paired & 1 != 0 {
                    filling.room.ticks[first - 1].write(value(bytes, at));
                    filling.room.present[first - 1].write(true);
                }
            }
            if filling.paired {
                let next = _mm512_maskz_permutexvar_epi16(paired >> 1, one_down, values);
                let ticks = _mm512_maskz_compress_epi16(changes, next);
                let present = _mm256_maskz_set1_epi8(_pext_u32(paired >> 1, changes), 1);
                // SAFETY: at least 32 words are left, so 32 rows fit after `first`.
                unsafe {
                    _mm512_storeu_si512(filling.room.ticks.as_mut_ptr().add(first).cast(), ticks);
                    _mm256_storeu_si256(filling.room.present.as_mut_ptr().add(first).cast(), present);
                }
            }
            let found = u64::from(paired.count_ones());
            state.intensities += found;
            state.unpaired += u64::from(intensities.count_ones()) - found;
        } else if filling.paired {
            // SAFETY: as above.
            unsafe {
                _mm512_storeu_si512(filling.room.ticks.as_mut_ptr().add(first).cast(), _mm512_setzero_si512());
                _mm256_storeu_si256(filling.room.present.as_mut_ptr().add(first).cast(), _mm256_setzero_si256());
            }
        }
        let start = _mm512_set1_epi64(state.latest * STAMP_US);
        let time = |ahead: __m128i| {
            let ahead = _mm512_cvtepu16_epi64(ahead);
            _mm512_add_epi64(start, _mm512_mul_epu32(ahead, _mm512_set1_epi64(STAMP_US)))
        };
        // SAFETY: as above. Entries beyond the block's changes are overwritten by later rows, or never read.
        unsafe {
            let t: *mut __m512i = filling.room.t.as_mut_ptr().add(first).cast();
            let x: *mut __m512i = filling.room.x.as_mut_ptr().add(first).cast();
            let y: *mut __m512i = filling.room.y.as_mut_ptr().add(first).cast();
            let p: *mut __m256i = filling.room.p.as_mut_ptr().add(first).cast();
            let times = [
                time(_mm512_castsi512_si128(ahead)),
                time(_mm512_extracti32x4_epi32::<1>(ahead)),
                time(_mm512_extracti32x4_epi32::<2>(ahead)),
                time(_mm512_extracti32x4_epi32::<3>(ahead)),
            ];
            let ps = _mm256_maskz_set1_epi8(ps, 1);
            // Non-temporal stores pay off for whole cache lines only, which 32 rows fill; of fewer rows the rest is
            // overwritten later.
            if streamed && count == WORDS && [t, x, y].iter().all(|to| to.is_aligned()) && p.is_aligned() {
                for (k, times) in times.into_iter().enumerate() {
                    _mm512_stream_si512(t.add(k), times);
                }
                _mm512_stream_si512(x, xs);
                _mm512_stream_si512(y, ys);
                _mm256_stream_si256(p, ps);
            } else {
                for (k, times) in times.into_iter().enumerate() {
                    _mm512_storeu_si512(t.add(k), times);
                }
                _mm512_storeu_si512(x, xs);
                _mm512_storeu_si512(y, ys);
                _mm256_storeu_si256(p, ps);
            }
        }
        filling.rows = first + count;
        filling.open = changes >> 31 == 1;
        state.latest += i64::from(farthest);
        at += BYTES;
    }
    if streamed {
        // Orders the non-temporal stores before later stores, so that other threads see these rows as any others.
        _mm_sfence();
    }
    at
}
