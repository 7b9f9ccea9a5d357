//! Touches that are narrower than the cells of the layer resolve.

use std::fmt;

use super::bonded::most_cells;
use super::{Scene, Track, pitch_of};
use crate::{Array, Result};

/// A touch that is narrow even at its deepest: its force is too small.
#[derive(Debug, Clone, PartialEq)]
pub struct Narrow {
    /// The body's number.
    pub body: usize,
    /// The touch's width at its deepest, mm.
    pub width_mm: f64,
    /// From one cell to the next, mm.
    pub cell_mm: f64,
    /// Cells along the pitch of taxels that would resolve it.
    pub cells_per_pitch: u16,
    /// The most cells along the pitch that the array and the foam allow.
    pub most: u16,
}

/// From so many cells across on the mean force of a touch is within 6 % of that on far finer ones (measured: balls,
/// cylinders, edges).
const ACROSS: f64 = 1.5;

impl Narrow {
    /// Finds the narrowest touch of a scene that its cells do not resolve.
    ///
    /// # Errors
    ///
    /// `Scene` if the pitch of the array is not known.
    pub(super) fn find(scene: &Scene, array: &Array, tracks: &[Track]) -> Result<Option<Self>> {
        let (most, pitch_mm) = (most_cells(&scene.foam, array)?, pitch_of(array)?);
        let of_body = |(n, track): (usize, &Track)| {
            // By depth and not by force: between two cells the narrowest touch makes no force at all.
            let deepest = track.depth_mm.iter().fold(0.0_f32, |deepest, depth| deepest.max(*depth));
            let width_mm = scene.bodies[n].shape.width_mm(f64::from(deepest));
            let enough = (ACROSS * pitch_mm / width_mm).ceil();
            (width_mm > 0.0 && enough > f64::from(scene.cells_per_pitch)).then(|| Self {
                body: n,
                width_mm,
                cell_mm: pitch_mm / f64::from(scene.cells_per_pitch),
                cells_per_pitch: enough as u16,
                most,
            })
        };
        Ok(tracks.iter().enumerate().filter_map(of_body).min_by(|a, b| a.width_mm.total_cmp(&b.width_mm)))
    }
}

impl fmt::Display for Narrow {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { body, width_mm, cell_mm, cells_per_pitch, most } = self;
        write!(
            f,
            "bodies[{body}]: at its largest, its touch is {width_mm:.2} mm wide, less than {ACROSS} cells of \
             {cell_mm:.2} mm"
        )?;
        write!(f, ", so the computed force is too small; cells_per_pitch = {cells_per_pitch} is enough")?;
        if cells_per_pitch > most {
            write!(f, ", but the maximum is {most}: use a smaller array.pitch_mm")
        } else {
            Ok(())
        }
    }
}
