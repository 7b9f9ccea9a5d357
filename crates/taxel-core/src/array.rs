//! The geometry of a sensor.

use serde::{Deserialize, Serialize};

use crate::allowed::above_0;
use crate::{Result, problem};

/// The geometry of a sensor: rows, columns, the pitch between taxels, and which taxels exist.
///
/// A taxel's index is `row * columns + column`; `x` is the column, `y` the row.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Array {
    /// Number of rows, from top to bottom.
    pub rows: u16,
    /// Number of columns, from left to right.
    pub columns: u16,
    /// Distance between the centres of neighbours, mm.
    pub pitch_mm: f64,
    /// Name of the sensor.
    pub name: String,
    /// Which taxels exist, by index; `None` if all do.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub exists: Option<Vec<bool>>,
}

impl Array {
    /// An array whose taxels all exist.
    ///
    /// # Errors
    ///
    /// `Problem` if there is no row or no column, or the pitch is not above 0.
    pub fn new(rows: u16, columns: u16, pitch_mm: f64, name: &str) -> Result<Self> {
        if rows == 0 || columns == 0 {
            return Err(problem!("array of {rows} x {columns} taxels: needs 1 row and 1 column or more"));
        }
        above_0("pitch_mm", pitch_mm, "")?;
        Ok(Self { rows, columns, pitch_mm, name: name.to_owned(), exists: None })
    }

    /// The thesis' array: 64 x 64 taxels, 2.67 mm apart (chapter 4).
    #[must_use]
    pub fn thesis() -> Self {
        Self { rows: 64, columns: 64, pitch_mm: 2.67, name: "thesis 64x64".to_owned(), exists: None }
    }

    /// Checks an array that a file or a caller described.
    ///
    /// # Errors
    ///
    /// `Problem` if there is no row or no column, the pitch is not above 0, or `exists` has another length.
    pub fn check(&self) -> Result<()> {
        Self::new(self.rows, self.columns, self.pitch_mm, "")?;
        match &self.exists {
            Some(exists) if exists.len() != self.len() => {
                Err(problem!("exists has {} entries for {} x {} taxels", exists.len(), self.rows, self.columns))
            }
            _ => Ok(()),
        }
    }

    /// Number of places in the grid, whether a taxel exists there or not.
    #[must_use]
    pub fn len(&self) -> usize {
        usize::from(self.rows) * usize::from(self.columns)
    }

    /// Always false: an array has at least one taxel.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The index of the taxel at column `x`, row `y`; both must be on the array.
    #[must_use]
    pub fn index(&self, x: u16, y: u16) -> usize {
        usize::from(y) * usize::from(self.columns) + usize::from(x)
    }
}
