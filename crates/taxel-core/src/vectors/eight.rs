//! Vectors of eight numbers.

/// The number of values in a vector of the widest kind.
pub(crate) const LANES: usize = 8;

/// Eight numbers in one or two of the machine's vector registers.
pub(crate) trait Vector: Copy {
    fn splat(value: f64) -> Self;
    fn load(from: &[f64; LANES]) -> Self;
    fn store(self, to: &mut [f64; LANES]);
    /// `a b + self`.
    fn add_product(self, a: Self, b: Self) -> Self;
    fn total(self) -> f64;
}

impl Vector for [f64; LANES] {
    #[inline(always)]
    fn splat(value: f64) -> Self {
        [value; LANES]
    }
    #[inline(always)]
    fn load(from: &[f64; LANES]) -> Self {
        *from
    }
    #[inline(always)]
    fn store(self, to: &mut [f64; LANES]) {
        *to = self;
    }
    #[inline(always)]
    fn add_product(self, a: Self, b: Self) -> Self {
        std::array::from_fn(|l| a[l] * b[l] + self[l])
    }
    #[inline(always)]
    fn total(self) -> f64 {
        let [a, b, c, d, e, f, g, h] = self;
        ((a + e) + (c + g)) + ((b + f) + (d + h))
    }
}

#[cfg(target_arch = "x86_64")]
pub(crate) use x86::{Ymm, Zmm};

#[cfg(target_arch = "x86_64")]
mod x86 {
    use std::arch::x86_64::*;

    use super::{LANES, Vector};

    /// A vector of AVX-512; constructed only in functions compiled for it.
    #[derive(Clone, Copy)]
    pub(crate) struct Zmm(__m512d);

    impl Vector for Zmm {
        #[inline(always)]
        fn splat(value: f64) -> Self {
            // SAFETY: `kernel!` names this type only where the machine has AVX-512F.
            Self(unsafe { _mm512_set1_pd(value) })
        }
        #[inline(always)]
        fn load(from: &[f64; LANES]) -> Self {
            // SAFETY: as above; eight numbers are read.
            Self(unsafe { _mm512_loadu_pd(from.as_ptr()) })
        }
        #[inline(always)]
        fn store(self, to: &mut [f64; LANES]) {
            // SAFETY: as above; eight numbers are written.
            unsafe { _mm512_storeu_pd(to.as_mut_ptr(), self.0) }
        }
        #[inline(always)]
        fn add_product(self, a: Self, b: Self) -> Self {
            // SAFETY: as above.
            Self(unsafe { _mm512_fmadd_pd(a.0, b.0, self.0) })
        }
        #[inline(always)]
        fn total(self) -> f64 {
            // SAFETY: as above.
            unsafe { _mm512_reduce_add_pd(self.0) }
        }
    }

    /// Two vectors of AVX2; constructed only in functions compiled for it.
    #[derive(Clone, Copy)]
    pub(crate) struct Ymm(__m256d, __m256d);

    impl Vector for Ymm {
        #[inline(always)]
        fn splat(value: f64) -> Self {
            // SAFETY: `kernel!` names this type only where the machine has AVX2 and FMA.
            let lanes = unsafe { _mm256_set1_pd(value) };
            Self(lanes, lanes)
        }
        #[inline(always)]
        fn load(from: &[f64; LANES]) -> Self {
            // SAFETY: as above; eight numbers are read.
            unsafe { Self(_mm256_loadu_pd(from.as_ptr()), _mm256_loadu_pd(from[4..].as_ptr())) }
        }
        #[inline(always)]
        fn store(self, to: &mut [f64; LANES]) {
            // SAFETY: as above; eight numbers are written.
            unsafe {
                _mm256_storeu_pd(to.as_mut_ptr(), self.0);
                _mm256_storeu_pd(to[4..].as_mut_ptr(), self.1);
            }
        }
        #[inline(always)]
        fn add_product(self, a: Self, b: Self) -> Self {
            // SAFETY: as above.
            unsafe { Self(_mm256_fmadd_pd(a.0, b.0, self.0), _mm256_fmadd_pd(a.1, b.1, self.1)) }
        }
        #[inline(always)]
        fn total(self) -> f64 {
            let mut lanes = [0.0; LANES];
            self.store(&mut lanes);
            lanes.total()
        }
    }
}

/// Numbers in groups of eight; an incomplete last group is left out.
#[inline(always)]
pub(crate) fn lines(numbers: &[f64]) -> &[[f64; LANES]] {
    numbers.as_chunks().0
}

/// Mutable [`lines`].
#[inline(always)]
pub(crate) fn lines_mut(numbers: &mut [f64]) -> &mut [[f64; LANES]] {
    numbers.as_chunks_mut().0
}
