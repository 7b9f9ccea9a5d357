//! Decodes plain words eight at a time, in 128-bit registers, with AVX2: most datagrams of a scene have no more.

use std::arch::x86_64::*;

use crate::vectors::TO_FRONT;
use crate::wire::columns::Columns;
use crate::wire::v2::HEADER_BYTES;
use crate::wire::v2::decoder::held::ValuesByLine;

/// Number of words.
pub(super) const EIGHT: usize = 8;

/// Size of a register, bytes; the header before a body is at least as long.
const REGISTER: usize = 16;
const _: () = assert!(HEADER_BYTES >= REGISTER);

/// Positions count from 1 in 16 bits, and sums saturate at this value; words that reach it are decoded one by one.
pub(super) const FULL: u16 = u16::MAX;

/// Indices for `pshufb`: those from index `k` on move the first `16 - k` bytes of a register to the front, with zeros
/// after them.
static TO_START: [u8; 2 * REGISTER] = {
    let mut out = [0x80; 2 * REGISTER];
    let mut k = 0;
    while k < REGISTER {
        out[k] = k as u8;
        k += 1;
    }
    out
};

/// Masks: from index `8 - k` on, `k` lanes of ones, then zeros.
static FIRST_LANES: [u32; 2 * EIGHT] = {
    let mut out = [0; 2 * EIGHT];
    let mut k = 0;
    while k < EIGHT {
        out[k] = u32::MAX;
        k += 1;
    }
    out
};

/// Decodes words with `VALUE` bits of value that begin at `at` and end a datagram without its trailer, changes at a time `t`
/// that is not before any stored one, up to the first eight of which one is not plain: a word of time, or an event outside
/// the array. `passed` is the position before them, counted from 1; returns both behind the words that were decoded.
///
/// # Safety
///
/// The machine must have the features below. The array must have fewer positions than [`FULL`], and its stride be the
/// body's. A header must lie before the words. The columns must have room for a row a word and [`EIGHT`] more.
#[target_feature(enable = "avx2,bmi1,popcnt")]
pub(super) unsafe fn words<const VALUE: u32>(
    bytes: &[u8],
    mut at: usize,
    mut passed: u16,
    t: i64,
    held: &mut ValuesByLine,
    out: &mut Columns<'_>,
) -> (usize, u16) {
    let size = if VALUE == 16 { 4 } else { 2 };
    let mut n = out.rows;
    loop {
        let count = ((bytes.len() - at) / size).min(EIGHT);
        if count == 0 {
            break;
        }
        // SAFETY: this many words are left, behind a header; the caller guarantees the condition on the array.
        let eight = unsafe { Eight::read::<VALUE>(bytes, at, count, passed, held) };
        let Some(eight) = eight else { break };
        // SAFETY: as the caller guarantees, 8 rows fit after those so far; the events are on the array, and so in `held`.
        unsafe {
            eight.write::<VALUE>(t, out, n);
            if VALUE > 0 && eight.n > 0 {
                eight.store(t, held);
            }
        }
        (at, passed, n) = (at + size * count, eight.passed, n + eight.n);
    }
    out.rows = n;
    (at, passed)
}

/// The events among up to eight plain words, moved to the first lanes.
#[derive(Clone, Copy)]
struct Eight {
    n: usize,
    /// Position after the last word, from which the positions of the next words count.
    passed: u16,
    position: __m128i,
    x: __m128i,
    y: __m128i,
    ticks: __m128i,
    p: __m128i,
}

impl Eight {
    /// Reads `count` words, at most eight; `passed` is the position before them. None if a word is of time, or if an event
    /// is outside the array.
    ///
    /// # Safety
    ///
    /// The machine must have the features below. `count` words, of 4 bytes each if `VALUE` is 16, otherwise of 2, must
    /// begin at `at`, with a header's bytes before them. The array must have fewer than 65 535 positions, the value at
    /// which sums saturate.
    #[inline]
    #[target_feature(enable = "avx2,bmi1,popcnt")]
    unsafe fn read<const VALUE: u32>(
        bytes: &[u8],
        at: usize,
        count: usize,
        passed: u16,
        held: &ValuesByLine,
    ) -> Option<Self> {
        // SAFETY: of words of 4 bytes only the lanes of those words are read, by a mask of eight of 16 entries from 0
        // to 8 on. Of words of 2 bytes, the 16 bytes up to the last word's end are read; bytes before the first word
        // belong to the header. The shuffle's table has 16 bytes from each index 0 to 16 on.
        unsafe {
            let words = bytes.as_ptr().add(at);
            let lanes = _mm_cmpgt_epi16(_mm_set1_epi16(count as i16), _mm_setr_epi16(0, 1, 2, 3, 4, 5, 6, 7));
            if VALUE == 16 {
                let mask = _mm256_loadu_si256(FIRST_LANES.as_ptr().add(EIGHT - count).cast());
                let words = _mm256_maskload_epi32(words.cast(), mask);
                let halves = |v| _mm_packus_epi32(_mm256_castsi256_si128(v), _mm256_extracti128_si256::<1>(v));
                let value = halves(_mm256_blend_epi16::<0xaa>(words, _mm256_setzero_si256()));
                return Self::of_halves::<16>(halves(_mm256_srli_epi32::<16>(words)), value, lanes, passed, held);
            }
            let ending = _mm_loadu_si128(words.add(2 * count).sub(REGISTER).cast());
            let to_start = _mm_loadu_si128(TO_START.as_ptr().add(REGISTER - 2 * count).cast());
            Self::of_halves::<VALUE>(_mm_shuffle_epi8(ending, to_start), _mm_setzero_si128(), lanes, passed, held)
        }
    }

    /// Decodes the words' halves with polarity and skip, and the values if the halves have none; lanes outside `lanes`
    /// are zero.
    #[inline]
    #[target_feature(enable = "avx2,bmi1,popcnt")]
    fn of_halves<const VALUE: u32>(
        head: __m128i,
        value: __m128i,
        lanes: __m128i,
        passed: u16,
        held: &ValuesByLine,
    ) -> Option<Self> {
        let (zero, ones) = (_mm_setzero_si128(), _mm_set1_epi16(1));
        let (control, skip, value) = if VALUE == 8 {
            let seven = _mm_set1_epi16(0x7f);
            (seven, _mm_and_si128(_mm_srli_epi16::<8>(head), seven), _mm_and_si128(head, _mm_set1_epi16(0xff)))
        } else {
            let fifteen = _mm_set1_epi16(0x7fff);
            (fifteen, _mm_and_si128(head, fifteen), value)
        };
        let advances = _mm_cmpeq_epi16(skip, control);
        if _mm_testz_si128(advances, _mm_and_si128(head, _mm_set1_epi16(i16::MIN))) == 0 {
            return None;
        }
        // Branch-free: a processor cannot predict which datagram of a scene has an advance.
        let advance = if VALUE == 8 {
            _mm_slli_epi16::<6>(_mm_add_epi16(value, ones))
        } else {
            let small = _mm_cmpeq_epi16(_mm_subs_epu16(value, _mm_set1_epi16(2)), zero);
            _mm_blendv_epi8(_mm_set1_epi16(-1), _mm_slli_epi16::<14>(_mm_add_epi16(value, ones)), small)
        };
        // Sums saturate, and no position of the arrays allowed here equals the saturated value.
        let steps = _mm_blendv_epi8(_mm_add_epi16(skip, ones), advance, advances);
        let mut sums = _mm_and_si128(steps, lanes);
        sums = _mm_adds_epu16(sums, _mm_bslli_si128::<2>(sums));
        sums = _mm_adds_epu16(sums, _mm_bslli_si128::<4>(sums));
        sums = _mm_adds_epu16(sums, _mm_bslli_si128::<8>(sums));
        sums = _mm_adds_epu16(sums, _mm_set1_epi16(passed as i16));
        // Steps are never negative, and lanes without a word add 0, so the last lane has the total.
        let passed = _mm_extract_epi16::<7>(sums) as u16;
        let events = _mm_movemask_epi8(_mm_packs_epi16(_mm_andnot_si128(advances, lanes), zero)) as usize;
        // SAFETY: the mask has eight bits, and each entry of the table 16 bytes.
        let front = unsafe { _mm_loadu_si128(TO_FRONT.as_ptr().add(events & 0xff).cast()) };
        let position = _mm_shuffle_epi8(_mm_sub_epi16(sums, ones), front);
        let ticks = _mm_shuffle_epi8(value, front);
        let p = _mm_shuffle_epi8(_mm_srli_epi16::<15>(head), front);
        let x = _mm_srl_epi16(position, _mm_cvtsi32_si128(i32::from(held.stride)));
        let y = _mm_and_si128(position, _mm_set1_epi16(((1_u32 << held.stride) - 1) as i16));
        // Lanes without an event repeat the last event, or are 0 if there is none. Positions ascend, so that none is behind
        // the last column if the last one is not.
        let rows = _mm_set1_epi16(held.rows as i16);
        let outside = _mm_cmpeq_epi16(_mm_max_epu16(y, rows), y);
        let n = events.count_ones() as usize;
        let inside = usize::from(passed) <= held.values.len() && _mm_testz_si128(outside, outside) == 1;
        inside.then_some(Self { n, passed, position, x, y, ticks, p })
    }

    /// Writes the events from row `n` on.
    ///
    /// # Safety
    ///
    /// The machine must have the features below. 8 rows must fit from there on; entries beyond the events are
    /// overwritten by later rows, or never read.
    #[inline]
    #[target_feature(enable = "avx2")]
    unsafe fn write<const VALUE: u32>(&self, t: i64, out: &mut Columns<'_>, n: usize) {
        let times = _mm256_set1_epi64x(t);
        // SAFETY: the caller guarantees this.
        unsafe {
            let to = out.t.as_mut_ptr().add(n);
            _mm256_storeu_si256(to.cast(), times);
            _mm256_storeu_si256(to.add(4).cast(), times);
            _mm_storeu_si128(out.x.as_mut_ptr().add(n).cast(), self.x);
            _mm_storeu_si128(out.y.as_mut_ptr().add(n).cast(), self.y);
            _mm_storel_epi64(out.p.as_mut_ptr().add(n).cast(), _mm_packus_epi16(self.p, self.p));
            if out.paired {
                _mm_storeu_si128(out.ticks.as_mut_ptr().add(n).cast(), self.ticks);
                _mm_storel_epi64(out.present.as_mut_ptr().add(n).cast(), _mm_set1_epi8(i8::from(VALUE > 0)));
            }
        }
    }

    /// Stores the taxels' new values, of one or more events at time `t`.
    ///
    /// # Safety
    ///
    /// The machine must have the features below; `held` must be the one passed to [`Self::read`].
    #[inline]
    #[target_feature(enable = "avx2")]
    unsafe fn store(&self, t: i64, held: &mut ValuesByLine) {
        held.newest = t;
        // Extracts the lanes from registers: loads from memory would wait for the store. Lanes without an event repeat the
        // last one, so that no branch depends on the number of events, which no processor can predict.
        let halves = |lanes| [_mm_cvtsi128_si64(lanes) as u64, _mm_extract_epi64::<1>(lanes) as u64];
        for (positions, values) in halves(self.position).into_iter().zip(halves(self.ticks)) {
            for shift in [0, 16, 32, 48] {
                let position = usize::from((positions >> shift) as u16);
                // SAFETY: the positions are those of events on the array.
                unsafe {
                    *held.values.get_unchecked_mut(position) = (values >> shift) as u16;
                    *held.since.get_unchecked_mut(position) = t;
                }
            }
        }
    }
}
