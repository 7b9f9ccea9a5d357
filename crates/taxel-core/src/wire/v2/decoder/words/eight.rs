//! Up to eight words at once, in registers of 128 bits, with AVX-512 (F, BW, VL, VBMI2) and BMI2: most datagrams of a scene
//! have no more.

use std::arch::x86_64::*;

use crate::wire::columns::Room;
use crate::wire::v2::decoder::held::Held;

/// Words.
pub(crate) const EIGHT: usize = 8;

/// The events among up to eight plain words, the first ones in the first lanes.
#[derive(Clone, Copy)]
pub(crate) struct Eight {
    pub(crate) n: usize,
    /// Positions up to here were passed: those of the next words count from it.
    pub(crate) passed: u16,
    position: __m128i,
    x: __m128i,
    y: __m128i,
    ticks: __m128i,
    p: u32,
}

impl Eight {
    /// Reads `count` words that begin at a place, the first eight of them, behind so many positions; none where one is of time, or an
    /// event lies outside the array.
    ///
    /// # Safety
    ///
    /// The machine must have the features below. That many words, of 4 bytes each where `VALUE` is 16 and of 2 else, must lie
    /// there. The array must have fewer than 65 535 positions, at which sums stop.
    #[inline]
    #[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi2,bmi2,popcnt")]
    pub(crate) unsafe fn read<const VALUE: u32>(
        words: *const u8,
        count: usize,
        passed: u16,
        held: &Held,
    ) -> Option<Self> {
        let lanes = _bzhi_u32(0xff, count.min(EIGHT) as u32) as __mmask8;
        let one = _mm_set1_epi16(1);
        // SAFETY: only the lanes of those words are read.
        let (head, value) = unsafe {
            if VALUE == 16 {
                let both = _mm256_maskz_loadu_epi32(lanes, words.cast());
                (_mm256_cvtepi32_epi16(_mm256_srli_epi32::<16>(both)), _mm256_cvtepi32_epi16(both))
            } else {
                (_mm_maskz_loadu_epi16(lanes, words.cast()), _mm_setzero_si128())
            }
        };
        let polarity = _mm_movepi16_mask(head);
        let (control, skip, value) = if VALUE == 8 {
            let seven = _mm_set1_epi16(0x7f);
            (seven, _mm_and_si128(_mm_srli_epi16::<8>(head), seven), _mm_and_si128(head, _mm_set1_epi16(0xff)))
        } else {
            let fifteen = _mm_set1_epi16(0x7fff);
            (fifteen, _mm_and_si128(head, fifteen), value)
        };
        let advances = _mm_mask_cmpeq_epi16_mask(lanes, skip, control);
        if advances & polarity != 0 {
            return None;
        }
        // Without a branch: in a scene no processor predicts which datagram has an advance.
        let advance = if VALUE == 8 {
            _mm_slli_epi16::<6>(_mm_add_epi16(value, one))
        } else {
            let large = _mm_cmpgt_epu16_mask(value, _mm_set1_epi16(2));
            _mm_mask_mov_epi16(_mm_slli_epi16::<14>(_mm_add_epi16(value, one)), large, _mm_set1_epi16(-1))
        };
        // A sum that is too large stays too large: it is the position of none of these arrays.
        let mut sums = _mm_mask_mov_epi16(_mm_maskz_add_epi16(lanes, skip, one), advances, advance);
        sums = _mm_adds_epu16(sums, _mm_bslli_si128::<2>(sums));
        sums = _mm_adds_epu16(sums, _mm_bslli_si128::<4>(sums));
        sums = _mm_adds_epu16(sums, _mm_bslli_si128::<8>(sums));
        sums = _mm_adds_epu16(sums, _mm_set1_epi16(passed as i16));
        // No step is below 0, and lanes without a word add none: the last one has the sum.
        let passed = _mm_extract_epi16::<7>(sums) as u16;
        let events = lanes & !advances;
        let position = _mm_maskz_compress_epi16(events, _mm_sub_epi16(sums, one));
        let ticks = _mm_maskz_compress_epi16(events, value);
        let p = _pext_u32(u32::from(polarity), u32::from(events));
        let x = _mm_srl_epi16(position, _mm_cvtsi32_si128(i32::from(held.stride)));
        let y = _mm_and_si128(position, _mm_set1_epi16(((1_u32 << held.stride) - 1) as i16));
        // Lanes without an event are at 0, which is on any array.
        let outside = _mm_cmpge_epu16_mask(x, _mm_set1_epi16(held.columns as i16))
            | _mm_cmpge_epu16_mask(y, _mm_set1_epi16(held.rows as i16));
        (outside == 0).then_some(Self { n: events.count_ones() as usize, passed, position, x, y, ticks, p })
    }

    /// Writes the events from a row on.
    ///
    /// # Safety
    ///
    /// The machine must have the features below. 8 rows must fit behind `first`, with intensities where they are `paired`: what lies
    /// beyond the events is written again by later rows, or never read.
    #[inline]
    #[target_feature(enable = "avx512f,avx512bw,avx512vl")]
    pub(crate) unsafe fn write<const VALUE: u32>(&self, t: i64, room: &mut Room<'_>, first: usize, paired: bool) {
        // SAFETY: the caller's promise; a bool is a byte of 0 or 1.
        unsafe {
            _mm512_storeu_si512(room.t.as_mut_ptr().add(first).cast(), _mm512_set1_epi64(t));
            _mm_storeu_si128(room.x.as_mut_ptr().add(first).cast(), self.x);
            _mm_storeu_si128(room.y.as_mut_ptr().add(first).cast(), self.y);
            _mm_storel_epi64(room.p.as_mut_ptr().add(first).cast(), _mm_maskz_set1_epi8(self.p as __mmask16, 1));
            if paired {
                _mm_storeu_si128(room.ticks.as_mut_ptr().add(first).cast(), self.ticks);
                let present = _mm_set1_epi8(i8::from(VALUE > 0));
                _mm_storel_epi64(room.present.as_mut_ptr().add(first).cast(), present);
            }
        }
    }

    /// Notes what the taxels of the events, one or more, hold from `t` on.
    ///
    /// # Safety
    ///
    /// The machine must have the features below; `held` must be the one that was read with.
    #[inline]
    #[target_feature(enable = "avx512f,avx512bw,avx512vl")]
    pub(crate) unsafe fn hold(&self, t: i64, held: &mut Held) {
        held.newest = t;
        // Lanes without an event repeat the last one, so that no branch depends on how many there are: no processor predicts that.
        let lane = _mm_setr_epi16(0, 1, 2, 3, 4, 5, 6, 7);
        let repeated = _mm_min_epu16(_mm_set1_epi16(self.n as i16 - 1), lane);
        let places = _mm_permutexvar_epi16(repeated, self.position);
        let values = _mm_permutexvar_epi16(repeated, self.ticks);
        // SAFETY: they are the places of events on the array.
        unsafe { hold_eight(places, values, t, held) }
    }
}

/// Notes what taxels hold from `t` on.
///
/// # Safety
///
/// The machine must have SSE 4.1; all eight places must be in `held`.
#[inline]
#[target_feature(enable = "sse4.1")]
pub(super) unsafe fn hold_eight(places: __m128i, values: __m128i, t: i64, held: &mut Held) {
    // Not by way of memory, for which the loads would wait.
    let halves = |lanes| [_mm_cvtsi128_si64(lanes) as u64, _mm_extract_epi64::<1>(lanes) as u64];
    for (places, values) in halves(places).into_iter().zip(halves(values)) {
        for shift in [0, 16, 32, 48] {
            let place = usize::from((places >> shift) as u16);
            // SAFETY: the caller's promise.
            unsafe {
                *held.values.get_unchecked_mut(place) = (values >> shift) as u16;
                *held.since.get_unchecked_mut(place) = t;
            }
        }
    }
}
