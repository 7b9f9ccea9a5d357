//! How many cells a layer is cut into, and how large the plane is on which their influence is convolved.

use super::super::waves::fast_length;
use super::super::{Foam, pitch_of, within};
use crate::allowed::Range;
use crate::{Array, Error, Result};

/// Range of the layer's influence, in thicknesses; less than a per cent of the force arrives beyond.
const REACH: f64 = 4.0;
/// The longest plane, in cells, where only the influence of a very thick layer would need a longer one.
const LONGEST: usize = 1024;
/// Cells along a pitch: at most so many, on planes of so many cells; a plane of the largest takes some 300 MB.
const MOST_PER_PITCH: u16 = 16;
const LARGEST: usize = 4_000_000;
/// The plane's size in cells, and the taxels that it covers.
pub(super) struct CellPlane {
    /// Cells along a pitch of taxels.
    pub per_pitch: usize,
    /// How far the influence reaches, taxels.
    pub reach: usize,
    /// Taxels beside the array on each side.
    pub margin: usize,
    /// Rows of cells.
    pub tall: usize,
    /// Columns of cells.
    pub wide: usize,
}

impl CellPlane {
    pub fn new(foam: &Foam, array: &Array, pitch_mm: f64, per_pitch: usize) -> Self {
        let reach = (REACH * foam.thickness_mm / pitch_mm).ceil().max(1.0) as usize;
        let margin = reach.min(usize::from(array.rows.max(array.columns)));
        // The plane repeats: so far apart that no cell is moved by another's repetition, for a layer thinner than the plane.
        let apart = |taxels: u16| {
            let n = (usize::from(taxels) + 2 * margin) * per_pitch;
            fast_length((n + reach * per_pitch).min(LONGEST.max(2 * n)))
        };
        Self { per_pitch, reach, margin, tall: apart(array.rows), wide: apart(array.columns) }
    }

    fn fits(&self) -> bool {
        self.tall * self.wide <= LARGEST
    }
}

/// Refuses more cells along a pitch than the layer can be solved on.
///
/// # Errors
///
/// `Scene`, with how many can.
pub fn check_cells(foam: &Foam, array: &Array, cells_per_pitch: u16) -> Result<()> {
    let cells = f64::from(cells_per_pitch);
    within("scene", "cells_per_pitch", cells, "", Range::within(1.0, f64::from(MOST_PER_PITCH)))?;
    let most = most_cells(foam, array)?;
    if cells_per_pitch > most {
        return Err(Error::scene(format!(
            "scene: cells_per_pitch is {cells_per_pitch}: must be {most} or less on {} x {} taxels and {} mm of foam \
             (at most {LARGEST} cells in all)",
            array.rows, array.columns, foam.thickness_mm
        )));
    }
    Ok(())
}

/// The most cells along a pitch that the layer can be solved on.
///
/// # Errors
///
/// `Scene` if the pitch of the array is not known.
pub fn most_cells(foam: &Foam, array: &Array) -> Result<u16> {
    let pitch_mm = pitch_of(array)?;
    Ok((2..=MOST_PER_PITCH).rev().find(|n| CellPlane::new(foam, array, pitch_mm, usize::from(*n)).fits()).unwrap_or(1))
}
