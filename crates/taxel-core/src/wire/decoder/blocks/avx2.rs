//! Blocks of 16 words with AVX2: all changes, or changes each followed by its intensity.

use std::arch::x86_64::*;

use super::carried::{Carried, indices, value};
use crate::wire::decoder::filling::Filling;
use crate::wire::v1::{STAMP_US, WORD_BYTES};

const WORDS: usize = 16;
const BYTES: usize = WORDS * WORD_BYTES;

/// Half a block is eight words in 40 bytes; three loads at these places hold words 0 to 2, 3 to 5, and 6 and 7 whole.
const LOADS: [usize; 3] = [0, 15, 24];

/// Where the two bytes of each 16-bit lane lie in the three loads; 0x80 makes a zero.
const fn fetch(bytes: [Option<u8>; 2]) -> [[u8; 16]; 3] {
    let mut shuffles = [[0x80; 16]; 3];
    let mut load = 0;
    while load < 3 {
        let places: [u8; 16] = indices(bytes, LOADS[load] as i32, 16, 0x80);
        // Each word from one load only.
        let words = [[0, 3], [3, 6], [6, 8]][load];
        let mut k = 2 * words[0];
        while k < 2 * words[1] {
            shuffles[load][k] = places[k];
            k += 1;
        }
        load += 1;
    }
    shuffles
}

static LOW: [[u8; 16]; 3] = fetch([Some(2), Some(1)]);
static PLACE: [[u8; 16]; 3] = fetch([Some(3), Some(4)]);
static HEAD: [[u8; 16]; 3] = fetch([Some(0), None]);

/// Bits of a byte mask that belong to the first bytes of 16-bit lanes.
const FIRSTS: u32 = 0x5555_5555;

/// See [`super::blocks`].
///
/// # Safety
///
/// The machine must have AVX2, and each column of `filling.room` at least `filling.rows + bytes.len() / 5` entries.
#[target_feature(enable = "avx2")]
pub(super) unsafe fn blocks(
    bytes: &[u8],
    columns: u16,
    rows: u16,
    state: &mut Carried,
    filling: &mut Filling<'_>,
) -> usize {
    // SAFETY: each table is 16 bytes long.
    let table = |t: &[u8; 16]| unsafe { _mm256_broadcastsi128_si256(_mm_loadu_si128(t.as_ptr().cast())) };
    let low_from = [table(&LOW[0]), table(&LOW[1]), table(&LOW[2])];
    let place_from = [table(&PLACE[0]), table(&PLACE[1]), table(&PLACE[2])];
    let head_from = [table(&HEAD[0]), table(&HEAD[1]), table(&HEAD[2])];
    let sevens = _mm256_set1_epi16(i16::from_le_bytes([1, 128]));
    let (last_column, last_row) =
        (_mm256_set1_epi16(columns.min(64) as i16 - 1), _mm256_set1_epi16(rows.min(64) as i16 - 1));
    let low_bits = |v: __m256i| _mm256_movemask_epi8(v) as u32;

    let mut at = 0;
    while at + BYTES <= bytes.len() {
        // SAFETY: `at + 80 <= bytes.len()`; the loads of the two halves end at 40 and 80.
        let load = |place: usize| unsafe {
            let half = bytes.as_ptr().add(at + place);
            let (first, second) = (_mm_loadu_si128(half.cast()), _mm_loadu_si128(half.add(BYTES / 2).cast()));
            _mm256_set_m128i(second, first)
        };
        let loads = [load(LOADS[0]), load(LOADS[1]), load(LOADS[2])];
        let gather = |from: &[__m256i; 3]| {
            let parts = [0, 1, 2].map(|k| _mm256_shuffle_epi8(loads[k], from[k]));
            _mm256_or_si256(_mm256_or_si256(parts[0], parts[1]), parts[2])
        };
        let (low, place, head) = (gather(&low_from), gather(&place_from), gather(&head_from));

        let in_place = low_bits(head) == FIRSTS && low_bits(_mm256_or_si256(low, place)) == 0;
        let markers = low_bits(_mm256_slli_epi16::<4>(head)) & FIRSTS;
        let intensities = low_bits(_mm256_slli_epi16::<2>(head)) & FIRSTS;
        let place = _mm256_and_si256(place, _mm256_set1_epi16(0x3f3f));
        let x = _mm256_and_si256(place, _mm256_set1_epi16(0x3f));
        let y = _mm256_srli_epi16::<8>(place);
        let outside = _mm256_or_si256(_mm256_cmpgt_epi16(x, last_column), _mm256_cmpgt_epi16(y, last_row));
        if !in_place || markers | low_bits(outside) != 0 {
            break;
        }
        let values = _mm256_or_si256(_mm256_maddubs_epi16(sevens, low), _mm256_slli_epi16::<14>(head));
        let base = state.latest as u16;
        let bases = _mm256_set1_epi16(base as i16);
        let start = _mm256_set1_epi64x(state.latest * STAMP_US);
        let time = |ahead: __m128i| {
            let ahead = _mm256_cvtepu16_epi64(ahead);
            _mm256_add_epi64(start, _mm256_mul_epu32(ahead, _mm256_set1_epi64x(STAMP_US)))
        };
        let polarity = _mm256_and_si256(_mm256_srli_epi16::<6>(head), _mm256_set1_epi16(1));
        let first = filling.rows;

        if intensities == 0 {
            // Stamps ahead of the latest time that do not fall are each ahead of the one before.
            let ahead = _mm256_sub_epi16(values, bases);
            let carried = _mm256_permute2x128_si256::<0x08>(ahead, ahead);
            let before = _mm256_alignr_epi8::<14>(ahead, carried);
            let rising = low_bits(_mm256_cmpeq_epi16(_mm256_max_epu16(ahead, before), ahead)) == u32::MAX;
            let farthest = value(bytes, at + WORD_BYTES * (WORDS - 1)).wrapping_sub(base);
            if !rising || farthest > state.farthest() {
                break;
            }
            let p = _mm_packus_epi16(_mm256_castsi256_si128(polarity), _mm256_extracti128_si256::<1>(polarity));
            let (early, late) = (_mm256_castsi256_si128(ahead), _mm256_extracti128_si256::<1>(ahead));
            // SAFETY: at least 16 words are left, so 16 rows fit after `first`.
            unsafe {
                let t = filling.room.t.as_mut_ptr().add(first).cast::<i64>();
                _mm256_storeu_si256(t.cast(), time(early));
                _mm256_storeu_si256(t.add(4).cast(), time(_mm_srli_si128::<8>(early)));
                _mm256_storeu_si256(t.add(8).cast(), time(late));
                _mm256_storeu_si256(t.add(12).cast(), time(_mm_srli_si128::<8>(late)));
                _mm256_storeu_si256(filling.room.x.as_mut_ptr().add(first).cast(), x);
                _mm256_storeu_si256(filling.room.y.as_mut_ptr().add(first).cast(), y);
                _mm_storeu_si128(filling.room.p.as_mut_ptr().add(first).cast(), p);
                if filling.paired {
                    _mm256_storeu_si256(filling.room.ticks.as_mut_ptr().add(first).cast(), _mm256_setzero_si256());
                    _mm_storeu_si128(filling.room.present.as_mut_ptr().add(first).cast(), _mm_setzero_si128());
                }
            }
            filling.rows = first + WORDS;
            filling.open = true;
            state.latest += i64::from(farthest);
        } else {
            // Lanes of 32 bits are a change and its intensity, where they alternate and name the same taxel.
            let alternate = intensities == 0x4444_4444;
            let other = _mm256_or_si256(_mm256_slli_epi32::<16>(place), _mm256_srli_epi32::<16>(place));
            let same = low_bits(_mm256_cmpeq_epi16(place, other)) == u32::MAX;
            if !alternate || !same {
                break;
            }
            let changes = |lanes: __m256i| {
                let low = _mm256_and_si256(lanes, _mm256_set1_epi32(0xffff));
                _mm_packus_epi32(_mm256_castsi256_si128(low), _mm256_extracti128_si256::<1>(low))
            };
            let ahead = changes(_mm256_sub_epi16(values, bases));
            let before = _mm_slli_si128::<2>(ahead);
            let rising = _mm_movemask_epi8(_mm_cmpeq_epi16(_mm_max_epu16(ahead, before), ahead)) == 0xffff;
            let farthest = value(bytes, at + WORD_BYTES * (WORDS - 2)).wrapping_sub(base);
            if !rising || farthest > state.farthest() {
                break;
            }
            filling.begin_pairs();
            let p = changes(polarity);
            // SAFETY: at least 16 words are left, so 8 rows fit after `first`.
            unsafe {
                let t = filling.room.t.as_mut_ptr().add(first).cast::<i64>();
                _mm256_storeu_si256(t.cast(), time(ahead));
                _mm256_storeu_si256(t.add(4).cast(), time(_mm_srli_si128::<8>(ahead)));
                _mm_storeu_si128(filling.room.x.as_mut_ptr().add(first).cast(), changes(x));
                _mm_storeu_si128(filling.room.y.as_mut_ptr().add(first).cast(), changes(y));
                _mm_storel_epi64(filling.room.p.as_mut_ptr().add(first).cast(), _mm_packus_epi16(p, p));
                let ticks = changes(_mm256_srli_epi32::<16>(values));
                _mm_storeu_si128(filling.room.ticks.as_mut_ptr().add(first).cast(), ticks);
                _mm_storel_epi64(filling.room.present.as_mut_ptr().add(first).cast(), _mm_set1_epi8(1));
            }
            filling.rows = first + WORDS / 2;
            filling.open = false;
            state.intensities += (WORDS / 2) as u64;
            state.latest += i64::from(farthest);
        }
        at += BYTES;
    }
    at
}
