//! Pictures of the whole array over time.

use crate::{Array, Result, problem};

/// Pictures over time, one row-major picture after the other.
#[derive(Debug, Clone, PartialEq)]
pub struct Frames {
    /// The sensor.
    pub array: Array,
    /// us, one a picture, ascending.
    pub t: Vec<i64>,
    /// `t.len() * array.len()` values.
    pub values: Vec<f32>,
    /// Of the values: "ticks", "N", "kPa", "counts" ...
    pub unit: String,
}

impl Frames {
    /// The picture at place `k`.
    #[must_use]
    pub fn picture(&self, k: usize) -> &[f32] {
        let n = self.array.len();
        &self.values[k * n..(k + 1) * n]
    }

    /// Checks sizes and that times ascend.
    ///
    /// # Errors
    ///
    /// `Problem`, naming the place.
    pub fn check(&self) -> Result<()> {
        if self.values.len() != self.t.len() * self.array.len() {
            return Err(problem!(
                "frames: {} values for {} pictures of {} taxels: must be their product",
                self.values.len(),
                self.t.len(),
                self.array.len()
            ));
        }
        match self.t.windows(2).position(|w| w[1] <= w[0]) {
            Some(k) => {
                Err(problem!("frames: t[{}] is {} us, not after t[{k}] = {} us", k + 1, self.t[k + 1], self.t[k]))
            }
            None => Ok(()),
        }
    }
}
