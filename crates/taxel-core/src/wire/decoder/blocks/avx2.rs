//! Blocks of 16 words with AVX2: changes alone, or changes and intensities in any order.

use std::arch::x86_64::*;

use super::scalar::Carried;
use crate::vectors::TO_FRONT;
use crate::wire::columns::Columns;
use crate::wire::v1::{STAMP_US, WORD_BYTES};

const WORDS: usize = 16;
const BYTES: usize = WORDS * WORD_BYTES;

/// Half a block is eight words in 40 bytes; loads at these offsets hold words 0 to 2, 3 to 5, and 6 and 7 whole.
const LOADS: [usize; 3] = [0, 15, 24];

/// For each 16-bit lane, the positions of its two bytes in each of the three loads; 0x80 selects zero.
const fn fetch(bytes: [Option<usize>; 2]) -> [[u8; 16]; 3] {
    let mut shuffles = [[0x80; 16]; 3];
    let mut load = 0;
    while load < 3 {
        // The words that are read from this load; each word is read from one load only.
        let words = [[0, 3], [3, 6], [6, 8]][load];
        let mut k = 2 * words[0];
        while k < 2 * words[1] {
            if let Some(j) = bytes[k % 2] {
                shuffles[load][k] = (k / 2 * WORD_BYTES + j - LOADS[load]) as u8;
            }
            k += 1;
        }
        load += 1;
    }
    shuffles
}

static LOW: [[u8; 16]; 3] = fetch([Some(2), Some(1)]);
static POSITION: [[u8; 16]; 3] = fetch([Some(3), Some(4)]);
static HEAD: [[u8; 16]; 3] = fetch([Some(0), None]);

/// Mask of the low byte of each 16-bit lane, in a mask with one bit per byte.
const FIRSTS: u32 = 0x5555_5555;

/// The intensities of a block whose words are change, intensity, change, intensity, and so on.
const ALTERNATE: u32 = FIRSTS & 0xcccc_cccc;

/// The paired intensities of a block whose words are intensity, change, intensity, change, and so on.
const SPLIT_PAIRS: u32 = 0x5555;

/// Selected 16-bit lanes of a block, moved to the front of each half, and the number of lanes selected in each half.
struct SelectedLanes {
    early: usize,
    late: usize,
    shuffle: __m256i,
}

impl SelectedLanes {
    /// Selects the lanes of a 16-bit mask.
    #[inline]
    #[target_feature(enable = "avx2,popcnt")]
    fn new(lanes: u32) -> Self {
        let halves = [lanes & 0xff, lanes >> 8 & 0xff];
        // SAFETY: each entry of the table is 16 bytes long.
        let [early, late] = halves.map(|half| unsafe { _mm_loadu_si128(TO_FRONT[half as usize].as_ptr().cast()) });
        let [first, second] = halves.map(|half| half.count_ones() as usize);
        Self { early: first, late: second, shuffle: _mm256_set_m128i(late, early) }
    }

    /// Moves the selected lanes of a vector to the front of each half.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn look_up(&self, lanes: __m256i) -> [__m128i; 2] {
        let lanes = _mm256_shuffle_epi8(lanes, self.shuffle);
        [_mm256_castsi256_si128(lanes), _mm256_extracti128_si256::<1>(lanes)]
    }
}

/// Shifts the 16-bit lanes up by one; lane 0 becomes the last lane of `before`.
#[inline]
#[target_feature(enable = "avx2")]
fn shift_lane_up(before: __m256i, lanes: __m256i) -> __m256i {
    _mm256_alignr_epi8::<14>(lanes, _mm256_permute2x128_si256::<0x21>(before, lanes))
}

/// Packs 16-bit lanes, each all zeros or all ones, into one bit per lane.
#[inline]
#[target_feature(enable = "avx2")]
fn mask(lanes: __m256i) -> u32 {
    let bytes = _mm_packs_epi16(_mm256_castsi256_si128(lanes), _mm256_extracti128_si256::<1>(lanes));
    _mm_movemask_epi8(bytes) as u32
}

/// Whether each 32-bit lane holds two words of the same taxel.
#[inline]
#[target_feature(enable = "avx2")]
fn paired_lanes(position: __m256i) -> bool {
    let swapped = _mm256_or_si256(_mm256_slli_epi32::<16>(position), _mm256_srli_epi32::<16>(position));
    _mm256_movemask_epi8(_mm256_cmpeq_epi16(position, swapped)) == -1
}

/// See [`super::blocks`].
///
/// # Safety
///
/// The machine must have AVX2 and POPCNT, and `out` room for a row per word of `bytes`.
#[target_feature(enable = "avx2,popcnt")]
pub(super) unsafe fn blocks(
    bytes: &[u8],
    columns: u16,
    rows: u16,
    state: &mut Carried,
    out: &mut Columns<'_>,
) -> usize {
    // SAFETY: each table is 16 bytes long.
    let table = |t: &[u8; 16]| unsafe { _mm256_broadcastsi128_si256(_mm_loadu_si128(t.as_ptr().cast())) };
    let low_from = [table(&LOW[0]), table(&LOW[1]), table(&LOW[2])];
    let position_from = [table(&POSITION[0]), table(&POSITION[1]), table(&POSITION[2])];
    let head_from = [table(&HEAD[0]), table(&HEAD[1]), table(&HEAD[2])];
    let sevens = _mm256_set1_epi16(i16::from_le_bytes([1, 128]));
    let (last_column, last_row) =
        (_mm256_set1_epi16(columns.min(64) as i16 - 1), _mm256_set1_epi16(rows.min(64) as i16 - 1));
    let low_bits = |v: __m256i| _mm256_movemask_epi8(v) as u32;
    let (zero, ones) = (_mm256_setzero_si256(), _mm256_set1_epi16(1));
    let last_lane = _mm256_set1_epi16(i16::from_le_bytes([14, 15]));

    // State from the word before a block: its taxel, and whether it is a change whose intensity may be the block's
    // first word. That intensity is written with the next block, or after the last one.
    let (x, y) = if out.open { out.last_taxel() } else { (0, 0) };
    let mut position_before = _mm256_set1_epi16((x | y << 8) as i16);
    let mut open = u32::from(out.open);

    let mut at = 0;
    while at + BYTES <= bytes.len() {
        // SAFETY: `at + 80 <= bytes.len()`; the loads of the two halves end at 40 and 80.
        let load = |start: usize| unsafe {
            let half = bytes.as_ptr().add(at + start);
            let (first, second) = (_mm_loadu_si128(half.cast()), _mm_loadu_si128(half.add(BYTES / 2).cast()));
            _mm256_set_m128i(second, first)
        };
        let loads = [load(LOADS[0]), load(LOADS[1]), load(LOADS[2])];
        let gather = |from: &[__m256i; 3]| {
            let parts = [0, 1, 2].map(|k| _mm256_shuffle_epi8(loads[k], from[k]));
            _mm256_or_si256(_mm256_or_si256(parts[0], parts[1]), parts[2])
        };
        let (low, position, head) = (gather(&low_from), gather(&position_from), gather(&head_from));

        let in_place = low_bits(head) == FIRSTS && low_bits(_mm256_or_si256(low, position)) == 0;
        let markers = low_bits(_mm256_slli_epi16::<4>(head)) & FIRSTS;
        let position = _mm256_and_si256(position, _mm256_set1_epi16(0x3f3f));
        let x = _mm256_and_si256(position, _mm256_set1_epi16(0x3f));
        let y = _mm256_srli_epi16::<8>(position);
        let outside = _mm256_or_si256(_mm256_cmpgt_epi16(x, last_column), _mm256_cmpgt_epi16(y, last_row));
        if !in_place || markers | low_bits(outside) != 0 {
            break;
        }
        let values = _mm256_or_si256(_mm256_maddubs_epi16(sevens, low), _mm256_slli_epi16::<14>(head));
        let intensities = low_bits(_mm256_slli_epi16::<2>(head)) & FIRSTS;
        let polarity = _mm256_and_si256(_mm256_srli_epi16::<6>(head), ones);
        let base = state.latest as u16;
        let ahead = _mm256_sub_epi16(values, _mm256_set1_epi16(base as i16));
        let start = _mm256_set1_epi64x(state.latest * STAMP_US);
        let time = |ahead: __m128i| {
            let ahead = _mm256_cvtepu16_epi64(ahead);
            _mm256_add_epi64(start, _mm256_mul_epu32(ahead, _mm256_set1_epi64x(STAMP_US)))
        };
        let first = out.rows;

        let farthest;
        if intensities == 0 {
            // The stamps do not fall, so each is ahead of the latest time if it is ahead of the stamp before it.
            let before = shift_lane_up(zero, ahead);
            let rising = low_bits(_mm256_cmpeq_epi16(_mm256_max_epu16(ahead, before), ahead)) == u32::MAX;
            farthest = (_mm256_extract_epi16::<15>(values) as u16).wrapping_sub(base);
            if !rising || farthest > state.largest_lead() {
                break;
            }
            let p = _mm_packus_epi16(_mm256_castsi256_si128(polarity), _mm256_extracti128_si256::<1>(polarity));
            let (early, late) = (_mm256_castsi256_si128(ahead), _mm256_extracti128_si256::<1>(ahead));
            // SAFETY: at least 16 words are left, so 16 rows fit after `first`; a row precedes it if `open` is set.
            unsafe {
                let t = out.t.as_mut_ptr().add(first);
                _mm256_storeu_si256(t.cast(), time(early));
                _mm256_storeu_si256(t.add(4).cast(), time(_mm_srli_si128::<8>(early)));
                _mm256_storeu_si256(t.add(8).cast(), time(late));
                _mm256_storeu_si256(t.add(12).cast(), time(_mm_srli_si128::<8>(late)));
                _mm256_storeu_si256(out.x.as_mut_ptr().add(first).cast(), x);
                _mm256_storeu_si256(out.y.as_mut_ptr().add(first).cast(), y);
                _mm_storeu_si128(out.p.as_mut_ptr().add(first).cast(), p);
                if out.paired {
                    let row = first - open as usize;
                    _mm256_storeu_si256(out.ticks.as_mut_ptr().add(row).cast(), zero);
                    _mm_storeu_si128(out.present.as_mut_ptr().add(row).cast(), _mm_setzero_si128());
                }
            }
            out.rows = first + WORDS;
            open = 1;
        } else if intensities == ALTERNATE && paired_lanes(position) {
            let changes = |lanes: __m256i| {
                let low = _mm256_and_si256(lanes, _mm256_set1_epi32(0xffff));
                _mm_packus_epi32(_mm256_castsi256_si128(low), _mm256_extracti128_si256::<1>(low))
            };
            let ahead = changes(ahead);
            let before = _mm_slli_si128::<2>(ahead);
            let rising = _mm_movemask_epi8(_mm_cmpeq_epi16(_mm_max_epu16(ahead, before), ahead)) == 0xffff;
            farthest = (_mm256_extract_epi16::<14>(values) as u16).wrapping_sub(base);
            if !rising || farthest > state.largest_lead() {
                break;
            }
            out.begin_pairs();
            if open == 1 {
                out.clear_intensity();
            }
            let p = changes(polarity);
            // SAFETY: at least 16 words are left, so 8 rows fit after `first`.
            unsafe {
                let t = out.t.as_mut_ptr().add(first);
                _mm256_storeu_si256(t.cast(), time(ahead));
                _mm256_storeu_si256(t.add(4).cast(), time(_mm_srli_si128::<8>(ahead)));
                _mm_storeu_si128(out.x.as_mut_ptr().add(first).cast(), changes(x));
                _mm_storeu_si128(out.y.as_mut_ptr().add(first).cast(), changes(y));
                _mm_storel_epi64(out.p.as_mut_ptr().add(first).cast(), _mm_packus_epi16(p, p));
                let ticks = changes(_mm256_srli_epi32::<16>(values));
                _mm_storeu_si128(out.ticks.as_mut_ptr().add(first).cast(), ticks);
                _mm_storel_epi64(out.present.as_mut_ptr().add(first).cast(), _mm_set1_epi8(1));
            }
            out.rows = first + WORDS / 2;
            open = 0;
            state.intensities += (WORDS / 2) as u64;
        } else {
            let intensity = _mm256_srai_epi16::<15>(_mm256_slli_epi16::<10>(head));
            let change = _mm256_cmpeq_epi16(intensity, zero);
            let changes = mask(change);
            // The stamps do not fall, so each that is ahead of the latest time is the greatest so far.
            let ahead = _mm256_and_si256(change, ahead);
            let mut greatest = _mm256_max_epu16(ahead, _mm256_bslli_epi128::<2>(ahead));
            greatest = _mm256_max_epu16(greatest, _mm256_bslli_epi128::<4>(greatest));
            greatest = _mm256_max_epu16(greatest, _mm256_bslli_epi128::<8>(greatest));
            let half = _mm256_permute2x128_si256::<0x08>(greatest, greatest);
            greatest = _mm256_max_epu16(greatest, _mm256_shuffle_epi8(half, last_lane));
            let rising = _mm256_or_si256(_mm256_cmpeq_epi16(greatest, ahead), intensity);
            farthest = _mm256_extract_epi16::<15>(greatest) as u16;
            if low_bits(rising) != u32::MAX || farthest > state.largest_lead() {
                break;
            }
            // An intensity is paired if the word before it is a change of the same taxel.
            let same = _mm256_cmpeq_epi16(position, shift_lane_up(position_before, position));
            let behind_change = shift_lane_up(_mm256_set1_epi16(-(open as i16)), change);
            let pair = _mm256_and_si256(_mm256_and_si256(intensity, behind_change), same);
            let pairs = mask(pair);
            if pairs == SPLIT_PAIRS {
                // From the next word on, the block consists of whole pairs, which a faster path decodes: `blocks` first
                // decodes an odd number of words one by one.
                break;
            }
            let found = pairs.count_ones();
            if found != 0 && !out.paired {
                out.begin_pairs();
            }
            let rows = SelectedLanes::new(changes);
            let ([t_early, t_late], [early, late]) = (rows.look_up(ahead), rows.look_up(position));
            let [p_early, p_late] = rows.look_up(polarity);
            let (columns, row_bits) = (_mm_set1_epi16(0x3f), |position| _mm_srli_epi16::<8>(position));
            // SAFETY: at least 16 words are left, so 16 rows fit after `first`: up to 8 for each half.
            unsafe {
                let t = out.t.as_mut_ptr().add(first);
                let x = out.x.as_mut_ptr().add(first);
                let y = out.y.as_mut_ptr().add(first);
                let p = out.p.as_mut_ptr().add(first);
                _mm256_storeu_si256(t.cast(), time(t_early));
                _mm256_storeu_si256(t.add(4).cast(), time(_mm_srli_si128::<8>(t_early)));
                _mm256_storeu_si256(t.add(rows.early).cast(), time(t_late));
                _mm256_storeu_si256(t.add(rows.early + 4).cast(), time(_mm_srli_si128::<8>(t_late)));
                _mm_storeu_si128(x.cast(), _mm_and_si128(early, columns));
                _mm_storeu_si128(x.add(rows.early).cast(), _mm_and_si128(late, columns));
                _mm_storeu_si128(y.cast(), row_bits(early));
                _mm_storeu_si128(y.add(rows.early).cast(), row_bits(late));
                _mm_storel_epi64(p.cast(), _mm_packus_epi16(p_early, p_early));
                _mm_storel_epi64(p.add(rows.early).cast(), _mm_packus_epi16(p_late, p_late));
            }
            if out.paired {
                // For each change, from the open one before the block on, the lane after it: its intensity, or none.
                let behind = SelectedLanes::new(changes << 1 | open);
                let [ticks_early, ticks_late] = behind.look_up(_mm256_and_si256(values, pair));
                let [there_early, there_late] = behind.look_up(_mm256_srli_epi16::<15>(pair));
                // SAFETY: as above; if a change is open, a row precedes `first`.
                unsafe {
                    let ticks = out.ticks.as_mut_ptr().add(first - open as usize);
                    let present = out.present.as_mut_ptr().add(first - open as usize);
                    _mm_storeu_si128(ticks.cast(), ticks_early);
                    _mm_storeu_si128(ticks.add(behind.early).cast(), ticks_late);
                    _mm_storel_epi64(present.cast(), _mm_packus_epi16(there_early, there_early));
                    _mm_storel_epi64(present.add(behind.early).cast(), _mm_packus_epi16(there_late, there_late));
                }
            }
            out.rows = first + rows.early + rows.late;
            open = changes >> 15;
            state.intensities += u64::from(found);
            state.unpaired += u64::from(WORDS as u32 - changes.count_ones() - found);
        }
        position_before = position;
        state.latest += i64::from(farthest);
        at += BYTES;
    }
    out.open = open == 1;
    if out.open && out.paired {
        out.clear_intensity();
    }
    at
}
