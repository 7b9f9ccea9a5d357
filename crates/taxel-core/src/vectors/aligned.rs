//! Arrays of numbers, aligned to cache lines.

use super::eight::LANES;

/// Size of a cache line, bytes.
const LINE: usize = 64;

/// A value aligned to a cache line.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub(crate) struct OnLine<T>(pub(crate) T);

/// Numbers aligned to cache lines, so that no vector load crosses two lines.
#[derive(Debug, Default)]
pub(crate) struct Aligned {
    /// Padded at both ends, because the allocator does not align to cache lines.
    numbers: Vec<f64>,
    from: usize,
    len: usize,
}

impl Aligned {
    /// Zeros; the system allocates their memory only when it is written.
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
