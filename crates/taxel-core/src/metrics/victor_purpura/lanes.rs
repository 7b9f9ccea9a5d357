//! One train against as many others, side by side, as four of the machine's vectors hold.
//!
//! The same operations in the same order as for one pair, so the same bits; lanes differ only in which pairs they look
//! at for nothing, as a step looks at all that are near enough in any lane.

#[cfg(target_arch = "x86_64")]
use std::arch::x86_64::*;

use crate::{Result, Stop, problem};

/// Vector instructions that matrices may use.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Vectors {
    /// None: pair by pair, on any machine.
    None,
    /// AVX2: 16 pairs side by side.
    Avx2,
    /// AVX-512: 32 pairs side by side.
    Avx512,
}

impl Vectors {
    /// All, from the narrowest.
    pub const ALL: [Self; 3] = [Self::None, Self::Avx2, Self::Avx512];

    /// The widest that this machine has.
    #[must_use]
    pub fn best() -> Self {
        Self::ALL.into_iter().rev().find(|v| v.present()).unwrap_or(Self::None)
    }

    /// Whether this machine has them.
    #[must_use]
    pub fn present(self) -> bool {
        match self {
            Self::None => true,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => is_x86_feature_detected!("avx2"),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => is_x86_feature_detected!("avx512f"),
            #[cfg(not(target_arch = "x86_64"))]
            _ => false,
        }
    }

    /// How many pairs go side by side.
    pub(super) fn lanes(self) -> usize {
        match self {
            Self::None => 1,
            Self::Avx2 => 16,
            Self::Avx512 => 32,
        }
    }
}

/// Trains side by side: spike j of each, then spike j + 1.
pub(super) struct Block {
    lanes: usize,
    /// By spike and lane; behind a lane's last spike there are infinite times.
    times: Vec<f64>,
    /// By spike: the earliest and the latest of all lanes.
    first: Vec<f64>,
    last: Vec<f64>,
    lengths: Vec<usize>,
}

impl Block {
    /// As many trains as there are lanes, or fewer; the last one fills the lanes left over. There must be one.
    pub(super) fn new(lanes: usize, trains: &[&[f64]]) -> Self {
        let lane = |l: usize| trains[l.min(trains.len() - 1)];
        let longest = (0..lanes).map(|l| lane(l).len()).max().unwrap_or(0);
        let mut times = vec![f64::INFINITY; longest * lanes];
        for l in 0..lanes {
            for (j, &t) in lane(l).iter().enumerate() {
                times[j * lanes + l] = t;
            }
        }
        let extreme = |of: fn(f64, f64) -> f64, begin: f64| {
            times.chunks_exact(lanes).map(|row| row.iter().copied().fold(begin, of)).collect()
        };
        Self {
            lanes,
            first: extreme(f64::min, f64::INFINITY),
            last: extreme(f64::max, f64::NEG_INFINITY),
            lengths: (0..lanes).map(|l| lane(l).len()).collect(),
            times,
        }
    }

    /// The distance of `a` from each train; `q` is above 0 and finite, `cost` is room that is used again.
    #[cfg_attr(not(target_arch = "x86_64"), allow(unused_variables))]
    pub(super) fn distances(
        &self,
        vectors: Vectors,
        a: &[f64],
        q: f64,
        reach: f64,
        cost: &mut Vec<f64>,
        stop: Stop<'_>,
    ) -> Result<Vec<f64>> {
        let longest = self.first.len();
        cost.resize((longest + 1) * self.lanes, 0.0);
        assert!(
            vectors.present() && vectors.lanes() == self.lanes && self.times.len() == longest * self.lanes,
            "lanes must be the machine's"
        );
        let hi = match vectors {
            // SAFETY: the machine has AVX2, lanes are 4 vectors of it, and times and costs hold as many rows as there
            // are spikes, and one more: all just asserted or made so.
            #[cfg(target_arch = "x86_64")]
            Vectors::Avx2 => unsafe { avx2(self, a, q, reach, cost, stop) },
            // SAFETY: as above, with AVX-512.
            #[cfg(target_arch = "x86_64")]
            Vectors::Avx512 => unsafe { avx512(self, a, q, reach, cost, stop) },
            _ => Err(problem!("vectors: {vectors:?} puts no pairs side by side on this machine")),
        }?;
        let of = |(lane, &length): (usize, &usize)| {
            let column = length.min(hi);
            cost[column * self.lanes + lane] + (length - column) as f64
        };
        Ok(self.lengths.iter().enumerate().map(of).collect())
    }
}

/// Vectors of doubles, as the machine has them.
///
/// # Safety
///
/// What is called must be compiled into a function that has the vector's instructions, on a machine that has them; `load`
/// and `store` touch [`Vector::LANES`] doubles.
#[cfg(target_arch = "x86_64")]
trait Vector: Copy {
    const LANES: usize;
    unsafe fn all(x: f64) -> Self;
    unsafe fn load(from: *const f64) -> Self;
    unsafe fn store(self, to: *mut f64);
    unsafe fn plus(self, other: Self) -> Self;
    unsafe fn times(self, other: Self) -> Self;
    unsafe fn away(self, other: Self) -> Self;
    unsafe fn lesser(self, other: Self) -> Self;
}

/// A [`Vector`] by the names of its instructions.
#[cfg(target_arch = "x86_64")]
macro_rules! vector {
    ($kind:ident, $lanes:literal, $all:ident, $load:ident, $store:ident, $add:ident, $mul:ident, $sub:ident, $abs:expr, $min:ident) => {
        impl Vector for $kind {
            const LANES: usize = $lanes;
            #[inline(always)]
            unsafe fn all(x: f64) -> Self {
                // SAFETY: as the trait demands; the same for all below.
                unsafe { $all(x) }
            }
            #[inline(always)]
            unsafe fn load(from: *const f64) -> Self {
                // SAFETY: see `all`.
                unsafe { $load(from) }
            }
            #[inline(always)]
            unsafe fn store(self, to: *mut f64) {
                // SAFETY: see `all`.
                unsafe { $store(to, self) }
            }
            #[inline(always)]
            unsafe fn plus(self, other: Self) -> Self {
                // SAFETY: see `all`.
                unsafe { $add(self, other) }
            }
            #[inline(always)]
            unsafe fn times(self, other: Self) -> Self {
                // SAFETY: see `all`.
                unsafe { $mul(self, other) }
            }
            #[inline(always)]
            unsafe fn away(self, other: Self) -> Self {
                // SAFETY: see `all`.
                unsafe { $abs($sub(self, other)) }
            }
            #[inline(always)]
            unsafe fn lesser(self, other: Self) -> Self {
                // SAFETY: see `all`.
                unsafe { $min(self, other) }
            }
        }
    };
}

#[cfg(target_arch = "x86_64")]
vector!(
    __m512d,
    8,
    _mm512_set1_pd,
    _mm512_loadu_pd,
    _mm512_storeu_pd,
    _mm512_add_pd,
    _mm512_mul_pd,
    _mm512_sub_pd,
    _mm512_abs_pd,
    _mm512_min_pd
);
#[cfg(target_arch = "x86_64")]
vector!(
    __m256d,
    4,
    _mm256_set1_pd,
    _mm256_loadu_pd,
    _mm256_storeu_pd,
    _mm256_add_pd,
    _mm256_mul_pd,
    _mm256_sub_pd,
    |x| _mm256_andnot_pd(_mm256_set1_pd(-0.0), x),
    _mm256_min_pd
);

/// See [`against`].
///
/// # Safety
///
/// See [`against`]; the machine must have AVX2.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
unsafe fn avx2(block: &Block, a: &[f64], q: f64, reach: f64, cost: &mut [f64], stop: Stop<'_>) -> Result<usize> {
    // SAFETY: as the caller promises.
    unsafe { against::<__m256d>(block, a, q, reach, cost, stop) }
}

/// See [`against`].
///
/// # Safety
///
/// See [`against`]; the machine must have AVX-512.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f")]
unsafe fn avx512(block: &Block, a: &[f64], q: f64, reach: f64, cost: &mut [f64], stop: Stop<'_>) -> Result<usize> {
    // SAFETY: as the caller promises.
    unsafe { against::<__m512d>(block, a, q, reach, cost, stop) }
}

/// Vectors side by side: enough that none waits for its own last result.
#[cfg(target_arch = "x86_64")]
const SIDE: usize = 4;

/// Fills the costs of turning all of `a` into the first spikes of each lane, for numbers of spikes up to the one that it
/// gives; see [`super::VictorPurpura::between`] for what is left out.
///
/// # Safety
///
/// It must be compiled into a function that has the vector's instructions, on a machine that has them. `block.lanes` must
/// be `SIDE` vectors, `block.times` hold that many entries for each of `block.first`, and `cost` for one more.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
unsafe fn against<V: Vector>(
    block: &Block,
    a: &[f64],
    q: f64,
    reach: f64,
    cost: &mut [f64],
    stop: Stop<'_>,
) -> Result<usize> {
    let lanes = SIDE * V::LANES;
    let (spikes, times, cost) = (block.first.len(), block.times.as_ptr(), cost.as_mut_ptr());
    // SAFETY: every place is a row up to `spikes` of `cost`, or below it of `times`, and a vector of the `SIDE` in it.
    unsafe {
        let (one, q) = (V::all(1.0), V::all(q));
        for s in 0..SIDE {
            V::all(0.0).store(cost.add(s * V::LANES));
        }
        let (mut lo, mut hi) = (0, 0);
        for (i, &t) in a.iter().enumerate() {
            if i % 64 == 0 {
                stop.check()?;
            }
            while hi < spikes && block.first[hi] <= t + reach {
                for s in 0..SIDE {
                    let place = cost.add(hi * lanes + s * V::LANES);
                    V::load(place).plus(one).store(place.add(lanes));
                }
                hi += 1;
            }
            while lo < hi && block.last[lo] < t - reach {
                lo += 1;
            }
            let from = V::all(t);
            let mut diagonal = [one; SIDE];
            let mut left = [one; SIDE];
            for s in 0..SIDE {
                let place = cost.add(lo * lanes + s * V::LANES);
                diagonal[s] = V::load(place);
                left[s] = diagonal[s].plus(one);
                left[s].store(place);
            }
            for j in lo..hi {
                for s in 0..SIDE {
                    let at = j * lanes + s * V::LANES;
                    let moved = diagonal[s].plus(q.times(from.away(V::load(times.add(at)))));
                    let place = cost.add(at + lanes);
                    diagonal[s] = V::load(place);
                    left[s] = moved.lesser(diagonal[s].lesser(left[s]).plus(one));
                    left[s].store(place);
                }
            }
        }
        Ok(hi)
    }
}
