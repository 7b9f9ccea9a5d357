//! Arrays of numbers that are aligned to cache lines.

use super::eight::LANES;

/// Bytes of a cache line.
const LINE: usize = 64;

/// Numbers aligned to a cache line, so that no vector straddles two lines.
#[derive(Debug, Default)]
pub(crate) struct Aligned {
    /// Allocated a vector longer than needed, because the allocator does not align to cache lines;
    /// the numbers begin at `from`.
    numbers: Vec<f64>,
    from: usize,
    len: usize,
}

impl Aligned {
    /// Zeros, for which the operating system reserves no memory until they are written.
    pub(crate) fn zeros(len: usize) -> Self {
        let len = len.next_multiple_of(LANES);
        let numbers = vec![0.0; len + LANES];
        let from = numbers.as_ptr().align_offset(LINE).min(LANES);
        Self { numbers, from, len }
    }
}

impl Clone for Aligned {
    fn clone(&self) -> Self {
        let mut new = Self::zeros(self.len);
        new.copy_from_slice(self);
        new
    }
}

impl std::ops::Deref for Aligned {
    type Target = [f64];

    fn deref(&self) -> &[f64] {
        &self.numbers[self.from..self.from + self.len]
    }
}

impl std::ops::DerefMut for Aligned {
    fn deref_mut(&mut self) -> &mut [f64] {
        &mut self.numbers[self.from..self.from + self.len]
    }
}
