//! Convolution of pressures on a grid with a kernel, by Fourier transforms.

use std::f64::consts::PI;
use std::fmt;
use std::sync::Arc;

use realfft::num_complex::Complex;
use realfft::{ComplexToReal, RealFftPlanner, RealToComplex};
use rustfft::{Fft, FftPlanner};

use crate::{Result, Stop};

/// A real plane and its Fourier transform, with the plans to go from one to the other.
pub(super) struct Waves {
    rows: usize,
    columns: usize,
    pitch_mm: f64,
    to_waves: Arc<dyn RealToComplex<f64>>,
    from_waves: Arc<dyn ComplexToReal<f64>>,
    down: Arc<dyn Fft<f64>>,
    up: Arc<dyn Fft<f64>>,
    /// The plane, row by row; convolved in place.
    pub plane: Vec<f64>,
    /// By wave along the rows, then by wave along the columns.
    spectrum: Vec<Complex<f64>>,
    line: Vec<Complex<f64>>,
    scratch: Vec<Complex<f64>>,
}

impl fmt::Debug for Waves {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Waves({} x {})", self.rows, self.columns)
    }
}

impl Waves {
    pub fn new(rows: usize, columns: usize, pitch_mm: f64) -> Self {
        let mut real = RealFftPlanner::new();
        let mut complex = FftPlanner::new();
        let (to_waves, from_waves) = (real.plan_fft_forward(columns), real.plan_fft_inverse(columns));
        let (down, up) = (complex.plan_fft_forward(rows), complex.plan_fft_inverse(rows));
        let waves = columns / 2 + 1;
        let scratch = [
            to_waves.get_scratch_len(),
            from_waves.get_scratch_len(),
            down.get_inplace_scratch_len(),
            up.get_inplace_scratch_len(),
        ];
        let zero = Complex::new(0.0, 0.0);
        Self {
            rows,
            columns,
            pitch_mm,
            to_waves,
            from_waves,
            down,
            up,
            plane: vec![0.0; rows * columns],
            spectrum: vec![zero; waves * rows],
            line: vec![zero; waves],
            scratch: vec![zero; scratch.into_iter().max().unwrap_or(0)],
        }
    }

    /// A kernel that depends on the wave number alone (1/mm), as [`Waves::convolve`] takes it.
    ///
    /// # Errors
    ///
    /// `Interrupted`.
    pub fn kernel(&self, spectrum: impl Fn(f64) -> f64, stop: Stop<'_>) -> Result<Vec<f64>> {
        let step = |n: usize| 2.0 * PI / (n as f64 * self.pitch_mm);
        let (along, across) = (step(self.columns), step(self.rows));
        let mut kernel = Vec::with_capacity(self.spectrum.len());
        for x in 0..=self.columns / 2 {
            stop.check()?;
            for y in 0..self.rows {
                let y = y.min(self.rows - y);
                kernel.push(spectrum((x as f64 * along).hypot(y as f64 * across)));
            }
        }
        Ok(kernel)
    }

    /// Convolves the plane with a kernel; the plane repeats beyond its edges.
    ///
    /// # Errors
    ///
    /// `Interrupted`: the plane then holds no result.
    pub fn convolve(&mut self, kernel: &[f64], stop: Stop<'_>) -> Result<()> {
        let Self { rows, columns, .. } = *self;
        for (y, row) in self.plane.chunks_exact_mut(columns).enumerate() {
            self.to_waves
                .process_with_scratch(row, &mut self.line, &mut self.scratch[..self.to_waves.get_scratch_len()])
                .expect("lengths are the plan's");
            for (x, value) in self.line.iter().enumerate() {
                self.spectrum[x * rows + y] = *value;
            }
        }
        stop.check()?;
        self.down.process_with_scratch(&mut self.spectrum, &mut self.scratch);
        let scale = 1.0 / (rows * columns) as f64;
        for (value, factor) in self.spectrum.iter_mut().zip(kernel) {
            *value *= factor * scale;
        }
        stop.check()?;
        self.up.process_with_scratch(&mut self.spectrum, &mut self.scratch);
        stop.check()?;
        for (y, row) in self.plane.chunks_exact_mut(columns).enumerate() {
            for (x, value) in self.line.iter_mut().enumerate() {
                *value = self.spectrum[x * rows + y];
            }
            // The first and, of an even length, the last wave of a real plane are real; rounding errors there are set to 0.
            self.line[0].im = 0.0;
            if columns.is_multiple_of(2) {
                self.line[columns / 2].im = 0.0;
            }
            self.from_waves
                .process_with_scratch(&mut self.line, row, &mut self.scratch[..self.from_waves.get_scratch_len()])
                .expect("lengths are the plan's");
        }
        Ok(())
    }
}

/// The next length that has no prime factor above 5: fast to transform.
pub(super) fn fast_length(at_least: usize) -> usize {
    let smooth = |mut n: usize| {
        for prime in [2, 3, 5] {
            while n.is_multiple_of(prime) {
                n /= prime;
            }
        }
        n == 1
    };
    (at_least.max(2)..).find(|n| smooth(*n)).unwrap_or(at_least)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_wave_is_scaled_by_its_kernel() {
        for (rows, columns) in [(12, 20), (15, 9), (2, 5)] {
            let mut waves = Waves::new(rows, columns, 2.0);
            let (kx, ky) = (2 % (columns / 2 + 1), 1);
            let q = |n: usize, k: usize| 2.0 * PI * k as f64 / (n as f64 * 2.0);
            let at = |x: usize, y: usize| (2.0 * (q(columns, kx) * x as f64 + q(rows, ky) * y as f64)).cos();
            let plane: Vec<f64> = (0..rows * columns).map(|k| at(k % columns, k / columns)).collect();
            waves.plane.clone_from(&plane);
            let kernel = waves.kernel(|q| 1.0 / (1.0 + q * q), Stop::never()).unwrap();
            waves.convolve(&kernel, Stop::never()).unwrap();
            let expected = 1.0 / (1.0 + q(columns, kx).powi(2) + q(rows, ky).powi(2));
            for (got, was) in waves.plane.iter().zip(&plane) {
                assert!((got - expected * was).abs() < 1e-12, "{rows} x {columns}");
            }
        }
    }

    #[test]
    fn a_fast_length_is_the_next_one() {
        assert_eq!([2, 7, 88, 97, 128].map(fast_length), [2, 8, 90, 100, 128]);
    }
}
