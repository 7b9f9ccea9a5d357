//! Short windows of consecutive numbers, gathered from many positions at once.

/// The number of windows in a row.
pub(crate) const ROW: usize = 16;

/// The number of values in a window.
pub(crate) const WIDE: usize = 4;

/// The start positions of windows of [`WIDE`] numbers in a slice, in rows of [`ROW`].
///
/// The furthest end is stored, so that a read checks its bounds once per row, not once per window.
#[derive(Debug, Clone, Default)]
pub(crate) struct Windows {
    starts: Vec<[u32; ROW]>,
    /// The largest end position of any window.
    end: usize,
}

impl Windows {
    /// Adds a row.
    pub(crate) fn push(&mut self, starts: [u32; ROW]) {
        self.end = starts.iter().map(|&start| start as usize + WIDE).fold(self.end, usize::max);
        self.starts.push(starts);
    }

    /// The start positions of a row's windows.
    pub(crate) fn starts(&self, row: usize) -> &[u32; ROW] {
        &self.starts[row]
    }

    /// Pointers to the windows of a row, checked to be within `from`.
    #[inline(always)]
    fn within(&self, row: usize, from: &[f32]) -> [*const f32; ROW] {
        assert!(self.end <= from.len(), "each window must be within the given values");
        // SAFETY: by `push`, every window ends at or before `end`, which the assertion shows to be
        // within `from`.
        self.starts[row].map(|start| unsafe { from.as_ptr().add(start as usize) })
    }

    /// Reads the windows of a row, transposed: the first number of each window, the second of each,
    /// and so on.
    #[inline(always)]
    pub(crate) fn read(&self, row: usize, from: &[f32]) -> [[f32; ROW]; WIDE] {
        // SAFETY: `within` checked the windows; an array of f32 has the alignment of an f32.
        let read = self.within(row, from).map(|at| unsafe { at.cast::<[f32; WIDE]>().read() });
        std::array::from_fn(|k| std::array::from_fn(|lane| read[lane][k]))
    }

    /// [`read`](Self::read) in 8 shuffles, instead of the 16 shuffles and 16 blends that the compiler
    /// generates.
    #[cfg(target_arch = "x86_64")]
    #[inline]
    #[target_feature(enable = "avx512f")]
    pub(crate) fn read_avx512(&self, row: usize, from: &[f32]) -> [[f32; ROW]; WIDE] {
        use std::arch::x86_64::*;

        let at = self.within(row, from);
        let mut every_fourth = [_mm512_setzero_ps(); 4];
        for (k, windows) in every_fourth.iter_mut().enumerate() {
            // SAFETY: `within` checked the windows, and the loads need no alignment.
            let (a, b, c, d) = unsafe {
                (_mm_loadu_ps(at[k]), _mm_loadu_ps(at[k + 4]), _mm_loadu_ps(at[k + 8]), _mm_loadu_ps(at[k + 12]))
            };
            *windows = _mm512_insertf32x4::<1>(_mm512_castps128_ps512(a), b);
            *windows = _mm512_insertf32x4::<3>(_mm512_insertf32x4::<2>(*windows, c), d);
        }
        let [a, b, c, d] = every_fourth;
        let (ab, cd) = (_mm512_castps_pd(_mm512_unpacklo_ps(a, b)), _mm512_castps_pd(_mm512_unpacklo_ps(c, d)));
        let (first, second) = (_mm512_unpacklo_pd(ab, cd), _mm512_unpackhi_pd(ab, cd));
        let (ab, cd) = (_mm512_castps_pd(_mm512_unpackhi_ps(a, b)), _mm512_castps_pd(_mm512_unpackhi_ps(c, d)));
        let (third, fourth) = (_mm512_unpacklo_pd(ab, cd), _mm512_unpackhi_pd(ab, cd));
        let mut columns = [[0.0; ROW]; WIDE];
        for (column, numbers) in columns.iter_mut().zip([first, second, third, fourth]) {
            // SAFETY: sixteen numbers are written.
            unsafe { _mm512_storeu_ps(column.as_mut_ptr(), _mm512_castpd_ps(numbers)) };
        }
        columns
    }

    /// [`read`](Self::read) in 16 shuffles of 256 bits.
    #[cfg(target_arch = "x86_64")]
    #[inline]
    #[target_feature(enable = "avx2")]
    pub(crate) fn read_avx2(&self, row: usize, from: &[f32]) -> [[f32; ROW]; WIDE] {
        use std::arch::x86_64::*;

        let at = self.within(row, from);
        let mut columns = [[0.0; ROW]; WIDE];
        for half in [0, ROW / 2] {
            // SAFETY: `within` checked the windows, and the loads need no alignment.
            let [a, b, c, d] = std::array::from_fn(|k| unsafe {
                let (early, late) = (_mm_loadu_ps(at[half + k]), _mm_loadu_ps(at[half + k + 4]));
                _mm256_set_m128(late, early)
            });
            let (ab, cd) = (_mm256_castps_pd(_mm256_unpacklo_ps(a, b)), _mm256_castps_pd(_mm256_unpacklo_ps(c, d)));
            let (first, second) = (_mm256_unpacklo_pd(ab, cd), _mm256_unpackhi_pd(ab, cd));
            let (ab, cd) = (_mm256_castps_pd(_mm256_unpackhi_ps(a, b)), _mm256_castps_pd(_mm256_unpackhi_ps(c, d)));
            let (third, fourth) = (_mm256_unpacklo_pd(ab, cd), _mm256_unpackhi_pd(ab, cd));
            for (column, numbers) in columns.iter_mut().zip([first, second, third, fourth]) {
                // SAFETY: eight numbers are written.
                unsafe { _mm256_storeu_ps(column[half..half + ROW / 2].as_mut_ptr(), _mm256_castpd_ps(numbers)) };
            }
        }
        columns
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_are_read_up_to_the_last_number_and_no_farther() {
        let from: Vec<f32> = (0..21).map(|k| k as f32).collect();
        let mut windows = Windows::default();
        let rows: [[u32; ROW]; 2] =
            [std::array::from_fn(|lane| lane as u32 * 7 % 18), std::array::from_fn(|lane| 17 - lane as u32)];
        for row in rows {
            windows.push(row);
        }
        for (row, starts) in rows.iter().enumerate() {
            let wanted = std::array::from_fn(|k| starts.map(|start| from[start as usize + k]));
            assert_eq!(windows.read(row, &from), wanted);
            #[cfg(target_arch = "x86_64")]
            if crate::vectors::Instructions::Avx2.present() {
                // SAFETY: the machine has AVX2.
                assert_eq!(unsafe { windows.read_avx2(row, &from) }, wanted);
            }
            #[cfg(target_arch = "x86_64")]
            if crate::vectors::Instructions::Avx512.present() {
                // SAFETY: the machine has AVX-512.
                assert_eq!(unsafe { windows.read_avx512(row, &from) }, wanted);
            }
        }
        // Any row is refused if a window of any row ends outside the slice.
        assert!(std::panic::catch_unwind(|| windows.read(0, &from[..20])).is_err());
    }
}
