//! Views of pictures of the whole array over time.

use crate::{Array, Result, problem};

/// Pictures in memory of a caller (a file, NumPy), who must not change them meanwhile; this crate never copies many.
#[derive(Debug, Clone, Copy)]
pub struct FramesView<'a> {
    /// The sensor.
    pub array: &'a Array,
    /// Time of each picture, us, ascending.
    pub t: &'a [i64],
    /// Values, picture after picture, row by row, in the sensor's unit.
    pub values: &'a [f32],
}

impl<'a> FramesView<'a> {
    /// Checks that the number of values is that of pictures times taxels.
    ///
    /// # Errors
    ///
    /// `Problem`, with the numbers.
    pub fn check(&self) -> Result<()> {
        let (n, taxels, values) = (self.t.len(), self.array.len(), self.values.len());
        if n.checked_mul(taxels) == Some(values) {
            return Ok(());
        }
        Err(problem!("frames: {values} values for {n} pictures of {taxels} taxels"))
    }

    /// Each picture with its time, us.
    pub fn iter(self) -> impl Iterator<Item = (i64, &'a [f32])> {
        self.t.iter().copied().zip(self.values.chunks_exact(self.array.len().max(1)))
    }
}
