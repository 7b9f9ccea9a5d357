//! Pressures on many cells: conjugate gradients whose influence is a convolution (Polonsky and Keer 1999).

use super::super::waves::Waves;
use super::cell::Cell;
use crate::{Result, Stop};

/// The vectors of a solution, whose memory is used again by the next one.
#[derive(Debug, Default)]
pub(super) struct Descent {
    pushed: Vec<f64>,
    gap: Vec<f64>,
    way: Vec<f64>,
    at: Vec<usize>,
}

/// The plane on which the influence is convolved.
pub(super) struct Plane<'a> {
    pub waves: &'a mut Waves,
    /// Cells in a row of the plane.
    pub wide: usize,
    /// How far each wave of pressure pushes the face in.
    pub surface: &'a [f64],
}

impl Descent {
    /// Descends until no pressure moves by more than `tolerance` of the largest, or `turns` are over. `wanted` is how far
    /// each face must give way, mm; `pressure`, MPa, holds the start, then the result.
    ///
    /// # Errors
    ///
    /// `Interrupted`.
    pub fn solve(
        &mut self,
        plane: Plane<'_>,
        cells: &[Cell],
        wanted: &[f64],
        pressure: &mut [f64],
        (turns, tolerance): (usize, f64),
        stop: Stop<'_>,
    ) -> Result<()> {
        let (Self { pushed, gap, way, at }, Plane { waves, wide, surface }) = (self, plane);
        at.clear();
        at.extend(cells.iter().map(|cell| cell.y as usize * wide + cell.x as usize));
        let mut carried = |from: &[f64], to: &mut Vec<f64>| -> Result<()> {
            waves.plane.fill(0.0);
            for (k, value) in at.iter().zip(from) {
                waves.plane[*k] = *value;
            }
            waves.convolve(surface, stop)?;
            to.clear();
            to.extend(at.iter().map(|k| waves.plane[*k]));
            Ok(())
        };
        way.clear();
        way.resize(cells.len(), 0.0);
        let (mut last, mut keeps, mut known) = (1.0, 0.0, false);
        // The layer's stiffness under a wide touch turns a remaining gap into a pressure.
        let stiffness = 1.0 / surface[0];
        for _ in 0..turns {
            if !known {
                carried(pressure, gap)?;
                for (gap, wanted) in gap.iter_mut().zip(wanted) {
                    *gap -= wanted;
                }
            }
            if pressure.iter().all(|p| *p == 0.0) {
                // Without pressures from before, begin with those of a wide touch.
                for (pressure, gap) in pressure.iter_mut().zip(gap.iter()) {
                    *pressure = (-gap * stiffness).max(0.0);
                }
                if pressure.iter().all(|p| *p == 0.0) {
                    return Ok(());
                }
                continue;
            }
            let held = |k: usize, pressure: &[f64]| pressure[k] > 0.0;
            let size: f64 = (0..gap.len()).filter(|k| held(*k, pressure)).map(|k| gap[k] * gap[k]).sum();
            for k in 0..gap.len() {
                way[k] = if held(k, pressure) { gap[k] + keeps * size / last * way[k] } else { 0.0 };
            }
            last = size;
            carried(way, pushed)?;
            let (mut down, mut bend) = (0.0, 0.0);
            for k in (0..gap.len()).filter(|k| held(*k, pressure)) {
                down += gap[k] * way[k];
                bend += pushed[k] * way[k];
            }
            if bend <= 0.0 {
                return Ok(());
            }
            let step = down / bend;
            let (mut moved, mut largest) = (0.0_f64, 0.0_f64);
            keeps = 1.0;
            // As long as no cell leaves or joins, gaps follow the pressures in proportion.
            known = true;
            for k in 0..gap.len() {
                let was = pressure[k];
                known &= was >= step * way[k];
                pressure[k] = (was - step * way[k]).max(0.0);
                if pressure[k] == 0.0 && gap[k] < 0.0 {
                    // A cell without pressure overlaps the body: it joins the contact, and the search directions begin anew.
                    pressure[k] = -step * gap[k];
                    (keeps, known) = (0.0, false);
                }
                moved = moved.max((pressure[k] - was).abs());
                largest = largest.max(pressure[k]);
            }
            if moved <= tolerance * largest {
                return Ok(());
            }
            if known {
                for (gap, pushed) in gap.iter_mut().zip(pushed.iter()) {
                    *gap -= step * pushed;
                }
            }
        }
        Ok(())
    }
}
