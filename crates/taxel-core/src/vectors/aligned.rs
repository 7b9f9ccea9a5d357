//! Numbers on the border of a cache line.

use super::eight::LANES;

/// Bytes of a cache line.
const LINE: usize = 64;

/// Something that begins on a cache line's border.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub(crate) struct OnLine<T>(pub(crate) T);

/// Numbers on a cache line's border, so that no vector straddles two lines.
#[derive(Debug, Default)]
pub(crate) struct Aligned {
    /// With room before and behind, as the allocator knows no such border.
    numbers: Vec<f64>,
    from: usize,
    len: usize,
}

impl Aligned {
    /// Zeros, which take no memory from the machine until something is written there.
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
