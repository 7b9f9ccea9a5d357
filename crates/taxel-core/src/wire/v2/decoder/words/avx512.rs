//! Decodes blocks of up to 32 words with AVX-512 (F, BW, VL, VBMI2) and BMI2; a body's last block may be shorter.

use std::arch::x86_64::*;

use super::body::BodyReader;
use super::eight::{EIGHT, FULL, store_eight};
use crate::wire::columns::Room;
use crate::wire::v2::decoder::held::ValuesByLine;

const WORDS: usize = 32;

/// For each 16-bit lane, the last lane of the 128 bits before it, and lane 16.
static LAST_BEFORE: [u16; WORDS] = lanes(false);
static SIXTEENTH: [u16; WORDS] = lanes(true);

const fn lanes(sixteenth: bool) -> [u16; WORDS] {
    let mut out = [15; WORDS];
    let mut k = 8;
    while k < WORDS && !sixteenth {
        out[k] = (k / 8 * 8 - 1) as u16;
        k += 1;
    }
    out
}

/// The index of each lane.
static LANE: [u16; WORDS] = stepped(1, 0);

/// Lanes of the low and of the high halves of 32-bit words.
static LOW_HALVES: [u16; WORDS] = stepped(2, 0);
static HIGH_HALVES: [u16; WORDS] = stepped(2, 1);

const fn stepped(step: u16, first: u16) -> [u16; WORDS] {
    let mut out = [0; WORDS];
    let mut k = 0;
    while k < WORDS {
        out[k] = step * k as u16 + first;
        k += 1;
    }
    out
}

/// Lanes of a block, stored in memory.
#[repr(align(64))]
struct WordLanes([u16; WORDS]);

/// Constants of every block, in registers.
#[derive(Clone, Copy)]
struct Constants {
    last_before: __m512i,
    sixteenth: __m512i,
    low_halves: __m512i,
    high_halves: __m512i,
    lane: __m512i,
    stride: __m128i,
    row_mask: __m512i,
    columns: __m512i,
    rows: __m512i,
}

/// The words of a block, one per lane.
#[derive(Clone, Copy)]
struct Words {
    polarity: u32,
    skip: __m512i,
    value: __m512i,
    /// Mask of the control words: advances and times.
    controls: u32,
}

/// The events of a block, moved to the first lanes.
#[derive(Clone, Copy)]
struct BlockEvents {
    n: usize,
    /// Mask of the first `n` lanes.
    lanes: u32,
    position: __m512i,
    x: __m512i,
    y: __m512i,
    ticks: __m512i,
    p: u32,
}

impl Constants {
    #[inline]
    #[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vbmi2,bmi2,lzcnt,popcnt")]
    fn new(stride: u8, held: &ValuesByLine) -> Self {
        // SAFETY: each table is 64 bytes long.
        let table = |t: &[u16; WORDS]| unsafe { _mm512_loadu_si512(t.as_ptr().cast()) };
        Self {
            last_before: table(&LAST_BEFORE),
            sixteenth: table(&SIXTEENTH),
            low_halves: table(&LOW_HALVES),
            high_halves: table(&HIGH_HALVES),
            lane: table(&LANE),
            stride: _mm_cvtsi32_si128(i32::from(stride)),
            row_mask: _mm512_set1_epi16(((1_u32 << stride) - 1) as i16),
            columns: _mm512_set1_epi16(held.columns as i16),
            rows: _mm512_set1_epi16(held.rows as i16),
        }
    }

    /// Loads the words at an address, as many as `lanes` has bits.
    ///
    /// # Safety
    ///
    /// That many words must be readable there, of 4 bytes each if `VALUE` is 16, otherwise of 2.
    #[inline]
    #[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vbmi2,bmi2,lzcnt,popcnt")]
    unsafe fn words<const VALUE: u32>(&self, block: *const u8, lanes: u32) -> Words {
        let control = if VALUE == 8 { 0x7f } else { 0x7fff };
        // SAFETY: only the lanes of those words are read.
        let (head, value) = unsafe {
            if VALUE == 16 {
                let a = _mm512_maskz_loadu_epi32(lanes as u16, block.cast());
                let b = _mm512_maskz_loadu_epi32((lanes >> 16) as u16, block.wrapping_add(64).cast());
                (_mm512_permutex2var_epi16(a, self.high_halves, b), _mm512_permutex2var_epi16(a, self.low_halves, b))
            } else {
                (_mm512_maskz_loadu_epi16(lanes, block.cast()), _mm512_setzero_si512())
            }
        };
        let polarity = _mm512_movepi16_mask(head);
        let (skip, value) = if VALUE == 8 {
            let seven = _mm512_set1_epi16(0x7f);
            (_mm512_and_si512(_mm512_srli_epi16::<8>(head), seven), _mm512_and_si512(head, _mm512_set1_epi16(0xff)))
        } else {
            (_mm512_and_si512(head, _mm512_set1_epi16(0x7fff)), value)
        };
        let controls = _mm512_cmpeq_epi16_mask(skip, _mm512_set1_epi16(control)) & lanes;
        Words { polarity, skip, value, controls }
    }

    /// Prefix sums of the position's steps over the `taken` lanes, some of which are `advances`; sums saturate. With
    /// `few` there are at most 8 lanes.
    #[inline]
    #[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vbmi2,bmi2,lzcnt,popcnt")]
    fn sums<const VALUE: u32>(&self, words: &Words, taken: u32, advances: u32, few: bool) -> __m512i {
        let Words { skip, value, .. } = *words;
        let ones = _mm512_set1_epi16(1);
        let mut steps = _mm512_maskz_add_epi16(taken, skip, ones);
        // Branch-free for small words: a processor cannot predict which block of a scene has an advance.
        if VALUE == 8 || advances != 0 {
            let advance = if VALUE == 8 {
                _mm512_slli_epi16::<6>(_mm512_add_epi16(value, ones))
            } else {
                let small = _mm512_slli_epi16::<14>(_mm512_add_epi16(value, ones));
                let large = _mm512_cmpgt_epu16_mask(value, _mm512_set1_epi16(2));
                _mm512_mask_mov_epi16(small, large, _mm512_set1_epi16(-1))
            };
            steps = _mm512_mask_mov_epi16(steps, advances, advance);
        }
        steps = _mm512_adds_epu16(steps, _mm512_bslli_epi128::<2>(steps));
        steps = _mm512_adds_epu16(steps, _mm512_bslli_epi128::<4>(steps));
        steps = _mm512_adds_epu16(steps, _mm512_bslli_epi128::<8>(steps));
        if !few {
            let carried = _mm512_maskz_permutexvar_epi16(0xff00_ff00, self.last_before, steps);
            steps = _mm512_adds_epu16(steps, carried);
            let carried = _mm512_maskz_permutexvar_epi16(0xffff_0000, self.sixteenth, steps);
            steps = _mm512_adds_epu16(steps, carried);
        }
        steps
    }

    /// The events among the words, whose positions count from 1; none if an event is outside the array.
    #[inline]
    #[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vbmi2,bmi2,lzcnt,popcnt")]
    fn compress_events(&self, words: &Words, events: u32, from_1: __m512i) -> Option<BlockEvents> {
        let n = events.count_ones() as usize;
        let position = _mm512_maskz_compress_epi16(events, _mm512_sub_epi16(from_1, _mm512_set1_epi16(1)));
        let ticks = _mm512_maskz_compress_epi16(events, words.value);
        let p = _pext_u32(words.polarity, events);
        let lanes = _bzhi_u32(u32::MAX, n as u32);
        let (x, y) = (_mm512_srl_epi16(position, self.stride), _mm512_and_si512(position, self.row_mask));
        let outside = _mm512_cmpge_epu16_mask(x, self.columns) | _mm512_cmpge_epu16_mask(y, self.rows);
        (outside & lanes == 0).then_some(BlockEvents { n, lanes, position, x, y, ticks, p })
    }

    /// Stores the taxels' new values, of one or more events at time `t`.
    ///
    /// # Safety
    ///
    /// `found` must come from [`Self::compress_events`], with positions in `held`.
    #[inline]
    #[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vbmi2,bmi2,lzcnt,popcnt")]
    unsafe fn store(&self, found: &BlockEvents, t: i64, held: &mut ValuesByLine) {
        held.newest = t;
        // Lanes without an event repeat the last one, so that the loop has one of two lengths, which a processor can
        // predict.
        let repeated = _mm512_min_epu16(_mm512_set1_epi16(found.n as i16 - 1), self.lane);
        let indices = _mm512_permutexvar_epi16(repeated, found.position);
        let values = _mm512_permutexvar_epi16(repeated, found.ticks);
        if found.n > EIGHT {
            let (mut at, mut ticks) = (WordLanes([0; WORDS]), WordLanes([0; WORDS]));
            // SAFETY: both arrays are 64 bytes long and aligned to cache lines; the positions are those of events.
            unsafe {
                _mm512_store_si512(at.0.as_mut_ptr().cast(), indices);
                _mm512_store_si512(ticks.0.as_mut_ptr().cast(), values);
                store_many(&at, &ticks, t, held);
            }
            return;
        }
        // SAFETY: the positions are those of events.
        unsafe { store_eight(_mm512_castsi512_si128(indices), _mm512_castsi512_si128(values), t, held) }
    }
}

/// # Safety
///
/// The positions must be in `held`.
#[inline(never)]
unsafe fn store_many(indices: &WordLanes, values: &WordLanes, t: i64, held: &mut ValuesByLine) {
    for (&index, &value) in indices.0.iter().zip(&values.0) {
        // SAFETY: the caller guarantees this.
        unsafe {
            *held.values.get_unchecked_mut(usize::from(index)) = value;
            *held.since.get_unchecked_mut(usize::from(index)) = t;
        }
    }
}

/// Stores new values, valid from `t` on, of taxels whose positions are consecutive in `held`.
///
/// # Safety
///
/// The positions from `begin` on, as many as `lanes` has lanes, must be in `held`.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vbmi2,bmi2,lzcnt,popcnt")]
unsafe fn store_neighbours(begin: usize, lanes: u32, ticks: __m512i, t: i64, held: &mut ValuesByLine) {
    held.newest = t;
    let times = _mm512_set1_epi64(t);
    // SAFETY: the caller guarantees this.
    unsafe {
        _mm512_mask_storeu_epi16(held.values.as_mut_ptr().add(begin).cast(), lanes, ticks);
        let since = held.since.as_mut_ptr().add(begin);
        _mm512_mask_storeu_epi64(since, lanes as u8, times);
        _mm512_mask_storeu_epi64(since.wrapping_add(8), (lanes >> 8) as u8, times);
        _mm512_mask_storeu_epi64(since.wrapping_add(16), (lanes >> 16) as u8, times);
        _mm512_mask_storeu_epi64(since.wrapping_add(24), (lanes >> 24) as u8, times);
    }
}

impl BlockEvents {
    /// Writes the events, from row `first` on.
    ///
    /// # Safety
    ///
    /// 32 rows must fit after `first`: entries beyond the events are overwritten by later rows, or never read.
    #[inline]
    #[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vbmi2,bmi2,lzcnt,popcnt")]
    unsafe fn write<const VALUE: u32>(&self, t: i64, room: &mut Room<'_>, first: usize, paired: bool) {
        let times = _mm512_set1_epi64(t);
        // SAFETY: the caller guarantees this.
        unsafe {
            let to = room.t.as_mut_ptr().add(first).cast::<i64>();
            _mm512_storeu_si512(to.cast(), times);
            if self.n > EIGHT {
                _mm512_storeu_si512(to.add(8).cast(), times);
                _mm512_storeu_si512(to.add(16).cast(), times);
                _mm512_storeu_si512(to.add(24).cast(), times);
            }
            _mm512_storeu_si512(room.x.as_mut_ptr().add(first).cast(), self.x);
            _mm512_storeu_si512(room.y.as_mut_ptr().add(first).cast(), self.y);
            _mm256_storeu_si256(room.p.as_mut_ptr().add(first).cast(), _mm256_maskz_set1_epi8(self.p & self.lanes, 1));
            if paired {
                let present = _mm256_set1_epi8(i8::from(VALUE > 0));
                let ticks = if VALUE > 0 { self.ticks } else { _mm512_setzero_si512() };
                _mm512_storeu_si512(room.ticks.as_mut_ptr().add(first).cast(), ticks);
                _mm256_storeu_si256(room.present.as_mut_ptr().add(first).cast(), present);
            }
        }
    }
}

/// Decodes plain words with `VALUE` bits of value.
///
/// # Safety
///
/// The machine must have the features below; each column of `room` must have 32 entries more than the rows so far and
/// the remaining words together; `body.stride` must be that of `held`, which must have at most 65 536 positions.
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vbmi2,bmi2,lzcnt,popcnt")]
pub(super) unsafe fn blocks<const VALUE: u32>(
    body: &mut BodyReader<'_>,
    held: &mut ValuesByLine,
    room: &mut Room<'_>,
    paired: bool,
) {
    let bytes = if VALUE == 16 { 4 } else { 2 };
    let constants = Constants::new(body.stride, held);
    while body.bytes.len() - body.at >= bytes {
        if VALUE > 0 && body.t < held.newest || body.position >= i64::from(FULL) - 1 {
            return;
        }
        let count = ((body.bytes.len() - body.at) / bytes).min(WORDS);
        let lanes = u32::MAX >> (WORDS - count);
        // SAFETY: the body has `count` words from there on.
        let words = unsafe { constants.words::<VALUE>(body.bytes.as_ptr().add(body.at), lanes) };
        let times = words.controls & words.polarity;
        if times & 1 != 0 {
            let after = body.at + bytes;
            let offset = if VALUE == 16 { body.offset::<4>(after) } else { body.offset::<2>(after) };
            let Some(offset) = offset else { return };
            (body.t, body.position) = (body.base + i64::from(offset), -1);
            body.at = after + bytes;
            continue;
        }
        // Restricts the block to the words up to the next word of time, after which positions restart. In the usual
        // case there is no word of time, and the condition avoids waiting for the bit operations.
        let taken = if times == 0 { lanes } else { lanes & (times & times.wrapping_neg()).wrapping_sub(1) };
        let advances = words.controls & taken;
        let steps = constants.sums::<VALUE>(&words, taken, advances, count <= 8);
        let from_1 = _mm512_adds_epu16(steps, _mm512_set1_epi16((body.position + 1) as i16));
        // Steps are never negative, and other lanes add 0, so the last lane has the total.
        let end = if count > 8 { _mm512_extracti32x4_epi32::<3>(from_1) } else { _mm512_castsi512_si128(from_1) };
        let last = (_mm_extract_epi16::<7>(end) & 0xffff) as u16;
        if last == FULL {
            return;
        }
        let Some(found) = constants.compress_events(&words, taken & !words.controls, from_1) else { return };
        // SAFETY: the caller guarantees that 32 rows fit after the rows so far.
        unsafe { found.write::<VALUE>(body.t, room, body.rows, paired) };
        if VALUE > 0 && found.n > 0 {
            let begin = (_mm_cvtsi128_si32(_mm512_castsi512_si128(found.position)) & 0xffff) as usize;
            // SAFETY: the events are on the array, and so in `held`.
            unsafe {
                if found.n > EIGHT && advances == 0 && usize::from(last) == begin + found.n {
                    store_neighbours(begin, found.lanes, found.ticks, body.t, held);
                } else {
                    constants.store(&found, body.t, held);
                }
            }
        }
        if found.n > 0 {
            body.latest = body.latest.max(body.t);
        }
        body.rows += found.n;
        body.position = i64::from(last) - 1;
        body.at += bytes * taken.count_ones() as usize;
    }
}
