//! A foam layer bonded to the board: the pressures under bodies on its face, and the stress at its base.
//!
//! The layer's face is cut into cells, one or several along the pitch of taxels, over the array and beside it. Pressure on
//! one cell moves the faces of all others. Where a body has sunk by `t` into the layer at rest, pressures `p` leave the gap
//! `g = K p - t`, and contact demands `p >= 0`, `g >= 0` and `p g = 0` in each cell. `K` is [`surface_compliance`] at the
//! grid's wave numbers, tabulated once. A taxel senses the mean stress of its own cells.

use super::layer::{base_stress, surface_compliance};
use super::waves::Waves;
use super::{Foam, pitch_of};
use crate::{Array, Result, Stop};

mod cell;
mod descent;
mod plan;
mod spread;
mod sweep;
#[cfg(test)]
mod tests;

pub use cell::Cell;
use descent::{Descent, Plane};
use plan::CellPlane;
pub use plan::{check_cells, most_cells};
use spread::{PressureSpread, spread_pressure};
use sweep::{Influence, Sweep};

/// More cells than these, times those along a pitch, are solved by waves: a sweep costs their square, a convolution the
/// grid whatever is loaded. Up to these, sweeps keep up with the board's rate.
pub const MOST_SWEPT: usize = 600;
/// The most sweeps or iterations of a frame; the next frame begins at its result, and so reduces an error that is left.
const MOST_TURNS: usize = 400;

/// The layer over an array, and around it as far as its influence reaches.
#[derive(Debug)]
pub struct Bonded {
    foam: Foam,
    /// Cells along a pitch of taxels.
    per_pitch: usize,
    /// From one cell to the next, and where the array's first one lies.
    pitch_mm: f64,
    first_mm: f64,
    /// Cells, and those of them that lie beside the array on each side: whole taxels.
    rows: usize,
    columns: usize,
    margin: usize,
    array: (usize, usize),
    /// Displacement of a cell's face for 1 MPa on another one, mm: by rows and columns between them.
    influence: Vec<f64>,
    /// Share of a cell's pressure that arrives at a taxel: by the cell's row and column in its own taxel, then by rows
    /// and columns of taxels between them, up to `reach`.
    spread: Vec<f32>,
    reach: usize,
    waves: Waves,
    wide: usize,
    surface: Vec<f64>,
    base: Vec<f64>,
    /// Pressures of the last two touches that were solved, by cell.
    before: [Vec<f64>; 2],
    loaded: [Vec<u32>; 2],
    /// How far from the solution an iteration may end, as a share of the largest pressure.
    tolerance: f64,
    /// How far a linear layer would have to give way at each cell of the latest touch, mm, and its pressures, MPa.
    wanted: Vec<f64>,
    pressure: Vec<f64>,
    sweep: Sweep,
    descent: Descent,
}

impl Bonded {
    /// Tabulates a layer of `foam` over `array`, with so many cells along the pitch of its taxels.
    ///
    /// # Errors
    ///
    /// `Scene` where the foam makes no sense, or the cells are too many; `Interrupted`.
    pub fn new(foam: &Foam, array: &Array, cells_per_pitch: u16, stop: Stop<'_>) -> Result<Self> {
        foam.check()?;
        check_cells(foam, array, cells_per_pitch)?;
        let pitch_mm = pitch_of(array)?;
        let CellPlane { per_pitch, reach, margin, tall, wide } =
            CellPlane::new(foam, array, pitch_mm, usize::from(cells_per_pitch));
        let (pitch, thick) = (pitch_mm / f64::from(cells_per_pitch), foam.thickness_mm);
        let cells = |taxels: u16| (usize::from(taxels) + 2 * margin) * per_pitch;
        let (rows, columns) = (cells(array.rows), cells(array.columns));
        let mut waves = Waves::new(tall, wide, pitch);
        let per_mpa = thick / (foam.modulus_kpa * 1e-3);
        let surface = waves.kernel(|q| per_mpa * surface_compliance(q * thick, foam.poisson), stop)?;
        let base = waves.kernel(|q| base_stress(q * thick, foam.poisson), stop)?;
        let mut kernel_plane = |kernel: &[f64]| -> Result<Vec<f64>> {
            waves.plane.fill(0.0);
            waves.plane[0] = 1.0;
            waves.convolve(kernel, stop)?;
            Ok(waves.plane.clone())
        };
        let (near, through) = (kernel_plane(&surface)?, kernel_plane(&base)?);
        let at = |plane: &[f64], y: isize, x: isize| {
            plane[y.rem_euclid(tall as isize) as usize * wide + x.rem_euclid(wide as isize) as usize]
        };
        let (down, across) = (rows as isize - 1, columns as isize - 1);
        let mut influence = Vec::with_capacity((2 * rows - 1) * (2 * columns - 1));
        for y in -down..=down {
            stop.check()?;
            influence.extend((-across..=across).map(|x| at(&near, y, x)));
        }
        let (n, far) = (per_pitch as isize, reach as isize);
        let mut spread = Vec::with_capacity((per_pitch * (2 * reach + 1)).pow(2));
        for (row, column) in (0..n).flat_map(|row| (0..n).map(move |column| (row, column))) {
            stop.check()?;
            for (y, x) in (-far..=far).flat_map(|y| (-far..=far).map(move |x| (y * n - row, x * n - column))) {
                let cells = (y..y + n).flat_map(|y| (x..x + n).map(move |x| (y, x)));
                spread.push((cells.map(|(y, x)| at(&through, y, x)).sum::<f64>() / (n * n) as f64) as f32);
            }
        }
        Ok(Self {
            foam: foam.clone(),
            per_pitch,
            pitch_mm: pitch,
            first_mm: (pitch - pitch_mm) / 2.0,
            rows,
            columns,
            margin: margin * per_pitch,
            array: (usize::from(array.rows), usize::from(array.columns)),
            influence,
            spread,
            reach,
            waves,
            wide,
            surface,
            base,
            before: [vec![0.0; rows * columns], vec![0.0; rows * columns]],
            loaded: [vec![], vec![]],
            tolerance: 1e-4,
            wanted: vec![],
            pressure: vec![],
            sweep: Sweep::default(),
            descent: Descent::default(),
        })
    }

    /// The same, solved until no pressure moves by more than a share of the largest.
    #[must_use]
    pub fn to_within(mut self, tolerance: f64) -> Self {
        self.tolerance = tolerance;
        self
    }

    /// Rows and columns of the grid: the array's and the margin's.
    #[must_use]
    pub fn shape(&self) -> (usize, usize) {
        (self.rows, self.columns)
    }

    /// Where cell column or row `n` lies, mm right of or below the first taxel.
    #[must_use]
    pub fn cell_mm(&self, n: usize) -> f64 {
        (n as f64 - self.margin as f64) * self.pitch_mm + self.first_mm
    }

    /// The grid's columns or rows (`count` of them) from one position to another.
    #[must_use]
    pub fn between(&self, from_mm: f64, to_mm: f64, count: usize) -> std::ops::Range<usize> {
        let at = |mm: f64| ((mm - self.first_mm) / self.pitch_mm + self.margin as f64).clamp(-1.0, count as f64);
        let (first, last) = (at(from_mm).ceil().max(0.0) as usize, at(to_mm).floor());
        if last < 0.0 { 0..0 } else { first..((last as usize) + 1).min(count).max(first) }
    }

    /// How far above the face of the layer at rest a cell may lie and still be touched, as a share of how deep the
    /// deepest is: beside a body the layer bulges, more the less it can be compressed. Above the most that a dense
    /// solution of drawn bodies showed; a layer that keeps its volume rises by as much as it is pushed in.
    #[must_use]
    pub fn bulge(&self) -> f64 {
        let nu = self.foam.poisson;
        0.03 + 0.3 * nu + ((nu - 0.45) / 0.05).max(0.0).powi(3)
    }

    /// How far a wave of pressure pushes the face in, mm/MPa, by wave number in 1/mm.
    #[must_use]
    pub fn compliance(&self, wave: f64) -> f64 {
        let thick = self.foam.thickness_mm;
        thick / (self.foam.modulus_kpa * 1e-3) * surface_compliance(wave * thick, self.foam.poisson)
    }

    /// The share of a wave of pressure that arrives at the base, by wave number in 1/mm.
    #[must_use]
    pub fn base_share(&self, wave: f64) -> f64 {
        base_stress(wave * self.foam.thickness_mm, self.foam.poisson)
    }

    /// Rows and columns of the cells over the array.
    #[must_use]
    pub fn over_array(&self) -> (usize, usize) {
        (self.array.0 * self.per_pitch, self.array.1 * self.per_pitch)
    }

    /// Where their rows and columns lie, mm below and right of the first taxel.
    #[must_use]
    pub fn cells_mm(&self) -> (Vec<f64>, Vec<f64>) {
        let (rows, columns) = self.over_array();
        let positions = |count| (0..count).map(|n| self.cell_mm(n + self.margin)).collect();
        (positions(rows), positions(columns))
    }

    /// Cells that may be touched by a body that has sunk by `sunk_mm` at each cell over the array, row by row.
    #[must_use]
    pub fn cells_under(&self, sunk_mm: &[f64]) -> Vec<Cell> {
        let above = -self.bulge() * sunk_mm.iter().fold(0.0_f64, |a, b| a.max(*b));
        let (_, columns) = self.over_array();
        let at = |n: usize| (n + self.margin) as u32;
        let cell = |(k, sunk_mm): (usize, &f64)| Cell { x: at(k % columns), y: at(k / columns), sunk_mm: *sunk_mm };
        sunk_mm.iter().enumerate().map(cell).filter(|cell| cell.sunk_mm > above).collect()
    }

    /// The mean pressure on each taxel of the array, row by row, MPa, of pressures on cells.
    #[must_use]
    pub fn taxel_pressures(&self, cells: &[Cell], pressure: &[f64]) -> Vec<f64> {
        let ((rows, columns), n) = (self.array, self.per_pitch);
        let mut pressures = vec![0.0; rows * columns];
        for (cell, pressure) in cells.iter().zip(pressure) {
            let (x, y) = ((cell.x as usize).wrapping_sub(self.margin), (cell.y as usize).wrapping_sub(self.margin));
            if x < columns * n && y < rows * n {
                pressures[y / n * columns + x / n] += *pressure / (n * n) as f64;
            }
        }
        pressures
    }

    /// More cells than these are solved by waves.
    fn most_swept(&self) -> usize {
        MOST_SWEPT * self.per_pitch
    }

    /// Forgets what was touched before.
    pub fn forget(&mut self) {
        for (before, loaded) in self.before.iter_mut().zip(&mut self.loaded) {
            for index in loaded.drain(..) {
                before[index as usize] = 0.0;
            }
        }
    }

    /// Pressure on each of `cells` (in the order of rows, then columns), MPa.
    ///
    /// The iteration begins with an extrapolation of the last two touches.
    ///
    /// Foam that has collapsed gives way more, and foam that is dense less, than a linear layer: how far a body has sunk
    /// is replaced by how far it would have in a linear column under the same pressure. So the law is exact for a wide
    /// touch and for independent columns, and linear foam is the linear layer.
    ///
    /// # Errors
    ///
    /// `Interrupted`.
    pub fn press(&mut self, cells: &[Cell], stop: Stop<'_>) -> Result<&[f64]> {
        let linear = self.foam.thickness_mm / self.foam.modulus_kpa;
        self.wanted.clear();
        self.pressure.clear();
        for cell in cells {
            let sunk = cell.sunk_mm.min(self.foam.floor_mm());
            let stress = |sunk: f64| self.foam.stress_kpa(sunk / self.foam.thickness_mm);
            self.wanted.push(if sunk > 0.0 { linear * stress(sunk) } else { sunk });
            let index = cell.y as usize * self.columns + cell.x as usize;
            self.pressure.push((2.0 * self.before[0][index] - self.before[1][index]).max(0.0));
        }
        if cells.len() <= self.most_swept() {
            self.sweep(cells, stop)?;
        } else {
            self.descend(cells, stop)?;
        }
        self.remember(cells);
        Ok(&self.pressure)
    }

    fn sweep(&mut self, cells: &[Cell], stop: Stop<'_>) -> Result<()> {
        let grid = Influence { table: &self.influence, rows: self.rows, columns: self.columns };
        self.sweep.solve(grid, cells, &self.wanted, &mut self.pressure, (MOST_TURNS, self.tolerance), stop)
    }

    fn descend(&mut self, cells: &[Cell], stop: Stop<'_>) -> Result<()> {
        let plane = Plane { waves: &mut self.waves, wide: self.wide, surface: &self.surface };
        self.descent.solve(plane, cells, &self.wanted, &mut self.pressure, (MOST_TURNS, self.tolerance), stop)
    }

    fn remember(&mut self, cells: &[Cell]) {
        self.before.swap(0, 1);
        self.loaded.swap(0, 1);
        for index in self.loaded[0].drain(..) {
            self.before[0][index as usize] = 0.0;
        }
        for (cell, pressure) in cells.iter().zip(&self.pressure) {
            if *pressure > 0.0 {
                let index = cell.y as usize * self.columns + cell.x as usize;
                self.before[0][index] = *pressure;
                self.loaded[0].push(index as u32);
            }
        }
    }

    /// Stress that arrives at each taxel of the array, row by row, MPa, of pressures on cells; below 0 where it pulls.
    ///
    /// # Errors
    ///
    /// `Interrupted`.
    pub fn arrive(&mut self, cells: &[Cell], pressure: &[f64], out: &mut Vec<f32>, stop: Stop<'_>) -> Result<()> {
        let (rows, columns) = self.array;
        out.clear();
        out.resize(rows * columns, 0.0);
        let loaded = pressure.iter().filter(|p| **p > 0.0).count();
        let n = self.per_pitch;
        if loaded <= self.most_swept() {
            let margin = self.margin / n;
            let spread =
                PressureSpread { table: &self.spread, per_pitch: n, reach: self.reach, margin, array: self.array };
            for (cell, pressure) in cells.iter().zip(pressure) {
                if *pressure > 0.0 {
                    spread_pressure(spread, out, *cell, *pressure as f32);
                }
            }
            return Ok(());
        }
        self.waves.plane.fill(0.0);
        for (cell, pressure) in cells.iter().zip(pressure) {
            self.waves.plane[cell.y as usize * self.wide + cell.x as usize] = *pressure;
        }
        self.waves.convolve(&self.base, stop)?;
        for (y, row) in out.chunks_exact_mut(columns).enumerate() {
            for (x, stress) in row.iter_mut().enumerate() {
                let cells = (0..n).flat_map(|down| {
                    let from = (y * n + down + self.margin) * self.wide + x * n + self.margin;
                    &self.waves.plane[from..from + n]
                });
                *stress = (cells.sum::<f64>() / (n * n) as f64) as f32;
            }
        }
        Ok(())
    }

    /// How many taxels lie beneath.
    #[must_use]
    pub fn taxels(&self) -> usize {
        self.array.0 * self.array.1
    }

    /// From one cell to the next, mm.
    #[must_use]
    pub fn pitch_mm(&self) -> f64 {
        self.pitch_mm
    }

    /// The area of a cell, mm^2.
    #[must_use]
    pub fn area_mm2(&self) -> f64 {
        self.pitch_mm * self.pitch_mm
    }
}
