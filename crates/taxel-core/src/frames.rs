//! Views of frames: values of the whole array over time.

use crate::{Array, Result, Stop, problem};

/// Frames in memory of a caller (a file, NumPy), who must not change them meanwhile; this crate never copies many.
#[derive(Debug, Clone, Copy)]
pub struct FramesView<'a> {
    /// The sensor.
    pub array: &'a Array,
    /// Time of each frame, us, ascending.
    pub t: &'a [i64],
    /// Values, frame after frame, row by row, in the sensor's unit.
    pub values: &'a [f32],
}

impl<'a> FramesView<'a> {
    /// Checks that there is a value for each taxel of each frame.
    ///
    /// # Errors
    ///
    /// `Problem`, with the numbers.
    pub fn check(&self) -> Result<()> {
        let (n, taxels, values) = (self.t.len(), self.array.len(), self.values.len());
        if n.checked_mul(taxels) == Some(values) {
            return Ok(());
        }
        Err(problem!("frames: {values} values for {n} frames of {taxels} taxels"))
    }

    /// Each frame with its time, us.
    pub fn iter(self) -> impl Iterator<Item = (i64, &'a [f32])> {
        self.t.iter().copied().zip(self.values.chunks_exact(self.array.len().max(1)))
    }

    /// The changes of each taxel from frame to frame; one from or to a NaN has no direction and is none.
    ///
    /// # Errors
    ///
    /// If the caller stops.
    pub fn changes(self, stop: Stop<'_>) -> Result<ChangeCounts> {
        let taxels = self.array.len();
        let mut changes = ChangeCounts { number: vec![0; taxels], same_direction: vec![0; taxels] };
        let mut last = vec![0_i8; taxels];
        for ((_, before), (_, frame)) in self.iter().zip(self.iter().skip(1)) {
            stop.check()?;
            let counts = changes.number.iter_mut().zip(&mut changes.same_direction).zip(&mut last);
            for ((&value, &before), ((number, same_direction), last)) in frame.iter().zip(before).zip(counts) {
                let way = i8::from(value > before) - i8::from(value < before);
                *number += u32::from(way != 0);
                *same_direction += u32::from(way != 0 && way == *last);
                *last = if way == 0 { *last } else { way };
            }
        }
        Ok(changes)
    }
}

/// The changes of each taxel of frames.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ChangeCounts {
    /// Number of changes.
    pub number: Vec<u32>,
    /// Number of those in the direction of the taxel's change before.
    pub same_direction: Vec<u32>,
}
