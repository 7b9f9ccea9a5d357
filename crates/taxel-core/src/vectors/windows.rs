//! Short windows of numbers, read from many places at once.

/// Where windows of `N` numbers begin in a slice, in rows of `L` windows.
///
/// How far they reach is known, so that reading asks once a row, not once a window.
#[derive(Debug, Clone, Default)]
pub(crate) struct Windows<const N: usize, const L: usize> {
    starts: Vec<[u32; L]>,
    /// No window ends behind this.
    end: usize,
}

impl<const N: usize, const L: usize> Windows<N, L> {
    /// Adds a row.
    pub(crate) fn push(&mut self, starts: [u32; L]) {
        self.end = starts.iter().map(|&start| start as usize + N).fold(self.end, usize::max);
        self.starts.push(starts);
    }

    /// Where those of a row begin.
    pub(crate) fn starts(&self, row: usize) -> &[u32; L] {
        &self.starts[row]
    }

    /// Reads the windows of a row.
    #[inline(always)]
    pub(crate) fn read(&self, row: usize, from: &[f32]) -> [[f32; N]; L] {
        assert!(self.end <= from.len(), "windows must lie within what they are read from");
        let mut read = [[0.0; N]; L];
        for (read, &start) in read.iter_mut().zip(&self.starts[row]) {
            // SAFETY: `push` saw that every window ends by `end`, which was just seen to be within `from`; an array of
            // f32 may stand wherever an f32 may.
            *read = unsafe { from.as_ptr().add(start as usize).cast::<[f32; N]>().read() };
        }
        read
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_are_read_up_to_the_last_number_and_no_farther() {
        let from: Vec<f32> = (0..9).map(|k| k as f32).collect();
        let mut windows = Windows::<4, 3>::default();
        windows.push([0, 5, 2]);
        windows.push([5, 5, 1]);
        assert_eq!(windows.read(0, &from), [[0.0, 1.0, 2.0, 3.0], [5.0, 6.0, 7.0, 8.0], [2.0, 3.0, 4.0, 5.0]]);
        assert_eq!(windows.read(1, &from)[2], [1.0, 2.0, 3.0, 4.0]);
        // Any row is refused where one window of any row would lie outside.
        assert!(std::panic::catch_unwind(|| windows.read(0, &from[..8])).is_err());
    }
}
