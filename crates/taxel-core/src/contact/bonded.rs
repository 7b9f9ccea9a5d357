//! A foam layer bonded to the board: which pressures hold bodies off it, and what of them arrives at its base.
//!
//! The layer's face is cut into cells, one or several along the pitch of taxels, over the array and beside it. Pressure on
//! one cell moves the faces of all others. Where a body has sunk by `t` into the layer at rest, pressures `p` leave the gap
//! `g = K p - t`, and contact asks for `p >= 0`, `g >= 0` and `p g = 0` in each cell. `K` is [`surface_compliance`] at the
//! grid's wave numbers, tabulated once. A taxel feels the mean of what arrives at its own cells.

use super::Foam;
use super::layer::{base_stress, surface_compliance};
use super::waves::{Waves, fast_length};
use super::within;
use crate::allowed::Range;
use crate::vectors::wide;
use crate::{Array, Error, Result};

/// The layer's influence has died within so many thicknesses; less than a per cent of the force arrives beyond.
const REACH: f64 = 4.0;
/// Planes are no longer than this where only a very thick layer's influence would ask for more, cells.
const LONGEST: usize = 1024;
/// Cells along a pitch: at most so many, on planes of so many cells; a plane of the largest takes some 300 MB.
const MOST_PER_PITCH: u16 = 16;
const LARGEST: usize = 4_000_000;
/// Over-relaxation of a sweep.
const RELAXATION: f64 = 1.2;
/// More cells than these, times those along a pitch, are solved by waves: a sweep costs their square, a convolution the
/// grid whatever is loaded. Up to these, sweeps hold the board's rate.
pub const MOST_SWEPT: usize = 600;
/// Sweeps and iterations end here at the latest; what a frame misses, the next one, which begins there, catches up.
const MOST_TURNS: usize = 400;

/// A cell that a body may touch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cell {
    /// Column and row of the grid.
    pub x: u32,
    /// Row.
    pub y: u32,
    /// How far the body has sunk below the face of the layer at rest, mm; below 0 where it is still above.
    pub sunk_mm: f64,
}

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
    /// How far from the solution a turn may end, as a share of the largest pressure.
    tolerance: f64,
    work: Work,
}

/// What one solution needs, kept from frame to frame.
#[derive(Debug, Default)]
struct Work {
    /// What a linear layer would have to give way to, mm.
    wanted: Vec<f64>,
    pressure: Vec<f64>,
    pushed: Vec<f64>,
    runs: Vec<Run>,
    gap: Vec<f64>,
    way: Vec<f64>,
    at: Vec<usize>,
}

/// Neighbouring cells of one row.
#[derive(Debug, Clone, Copy)]
struct Run {
    first: usize,
    count: usize,
    x: usize,
    y: usize,
}

/// How many cells a plane has, by sides, and what it is made of.
struct Plan {
    per_pitch: usize,
    /// In taxels: how far the influence reaches, and what lies beside the array on each side.
    reach: usize,
    margin: usize,
    tall: usize,
    wide: usize,
}

impl Plan {
    fn of(foam: &Foam, array: &Array, per_pitch: usize) -> Self {
        let reach = (REACH * foam.thickness_mm / array.pitch_mm).ceil().max(1.0) as usize;
        let margin = reach.min(usize::from(array.rows.max(array.columns)));
        // The plane repeats: so far apart that no cell feels another's repetition, for a layer thinner than the plane.
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

/// Refuses more cells along a pitch than can be reckoned with.
///
/// # Errors
///
/// `Scene`, with how many can.
pub fn check_cells(foam: &Foam, array: &Array, cells_per_pitch: u16) -> Result<()> {
    let cells = f64::from(cells_per_pitch);
    within("scene", "cells_per_pitch", cells, "", Range::within(1.0, f64::from(MOST_PER_PITCH)))?;
    let most = most_cells(foam, array);
    if cells_per_pitch > most {
        return Err(Error::Scene(format!(
            "scene: cells_per_pitch is {cells_per_pitch}: must be {most} or less on {} x {} taxels and {} mm of foam, where \
             more would make more than {LARGEST} cells",
            array.rows, array.columns, foam.thickness_mm
        )));
    }
    Ok(())
}

/// The most cells along a pitch that can be reckoned with.
pub(super) fn most_cells(foam: &Foam, array: &Array) -> u16 {
    (2..=MOST_PER_PITCH).rev().find(|n| Plan::of(foam, array, usize::from(*n)).fits()).unwrap_or(1)
}

impl Bonded {
    /// Tabulates a layer of `foam` over `array`, with so many cells along the pitch of its taxels.
    ///
    /// # Errors
    ///
    /// `Scene` where the foam makes no sense, or the cells are too many.
    pub fn new(foam: &Foam, array: &Array, cells_per_pitch: u16) -> Result<Self> {
        foam.check()?;
        check_cells(foam, array, cells_per_pitch)?;
        let Plan { per_pitch, reach, margin, tall, wide } = Plan::of(foam, array, usize::from(cells_per_pitch));
        let (pitch, thick) = (array.pitch_mm / f64::from(cells_per_pitch), foam.thickness_mm);
        let of = |taxels: u16| (usize::from(taxels) + 2 * margin) * per_pitch;
        let (rows, columns) = (of(array.rows), of(array.columns));
        let mut waves = Waves::new(tall, wide, pitch);
        let per_mpa = thick / (foam.modulus_kpa * 1e-3);
        let surface = waves.kernel(|q| per_mpa * surface_compliance(q * thick, foam.poisson));
        let base = waves.kernel(|q| base_stress(q * thick, foam.poisson));
        let mut of_one = |kernel: &[f64]| {
            waves.plane.fill(0.0);
            waves.plane[0] = 1.0;
            waves.convolve(kernel);
            waves.plane.clone()
        };
        let (near, through) = (of_one(&surface), of_one(&base));
        let on = |plane: &[f64], y: isize, x: isize| {
            plane[y.rem_euclid(tall as isize) as usize * wide + x.rem_euclid(wide as isize) as usize]
        };
        let (down, across) = (rows as isize - 1, columns as isize - 1);
        let influence = (-down..=down).flat_map(|y| (-across..=across).map(move |x| (y, x)));
        let influence = influence.map(|(y, x)| on(&near, y, x)).collect();
        let (n, far) = (per_pitch as isize, reach as isize);
        let mut spread = Vec::with_capacity((per_pitch * (2 * reach + 1)).pow(2));
        for (row, column) in (0..n).flat_map(|row| (0..n).map(move |column| (row, column))) {
            for (y, x) in (-far..=far).flat_map(|y| (-far..=far).map(move |x| (y * n - row, x * n - column))) {
                let own = (y..y + n).flat_map(|y| (x..x + n).map(move |x| (y, x)));
                spread.push((own.map(|(y, x)| on(&through, y, x)).sum::<f64>() / (n * n) as f64) as f32);
            }
        }
        Ok(Self {
            foam: foam.clone(),
            per_pitch,
            pitch_mm: pitch,
            first_mm: (pitch - array.pitch_mm) / 2.0,
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
            work: Work::default(),
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
    pub fn place_mm(&self, n: usize) -> f64 {
        (n as f64 - self.margin as f64) * self.pitch_mm + self.first_mm
    }

    /// The grid's columns or rows (`count` of them) from one place to another.
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
        let places = |count| (0..count).map(|n| self.place_mm(n + self.margin)).collect();
        (places(rows), places(columns))
    }

    /// Cells that may be touched by a body that has sunk by `sunk_mm` at each cell over the array, row by row.
    #[must_use]
    pub fn under(&self, sunk_mm: &[f64]) -> Vec<Cell> {
        let above = -self.bulge() * sunk_mm.iter().fold(0.0_f64, |a, b| a.max(*b));
        let (_, columns) = self.over_array();
        let at = |n: usize| (n + self.margin) as u32;
        let cell = |(k, sunk_mm): (usize, &f64)| Cell { x: at(k % columns), y: at(k / columns), sunk_mm: *sunk_mm };
        sunk_mm.iter().enumerate().map(cell).filter(|cell| cell.sunk_mm > above).collect()
    }

    /// The mean pressure on each taxel of the array, row by row, MPa, of pressures on cells.
    #[must_use]
    pub fn on_array(&self, cells: &[Cell], pressure: &[f64]) -> Vec<f64> {
        let ((rows, columns), n) = (self.array, self.per_pitch);
        let mut on = vec![0.0; rows * columns];
        for (cell, pressure) in cells.iter().zip(pressure) {
            let (x, y) = ((cell.x as usize).wrapping_sub(self.margin), (cell.y as usize).wrapping_sub(self.margin));
            if x < columns * n && y < rows * n {
                on[y / n * columns + x / n] += *pressure / (n * n) as f64;
            }
        }
        on
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

    /// Pressure on each of `cells` (in the order of rows, then columns), MPa. Begins where the last two touches lead.
    ///
    /// Foam that has collapsed gives way more, and foam that is dense less, than a linear layer: how far a body has sunk
    /// is replaced by how far it would have in a linear column under the same pressure. So the law is exact for a wide
    /// touch and for independent columns, and linear foam is the linear layer.
    pub fn press(&mut self, cells: &[Cell]) -> &[f64] {
        let linear = self.foam.thickness_mm / self.foam.modulus_kpa;
        let Work { wanted, pressure, .. } = &mut self.work;
        wanted.clear();
        pressure.clear();
        for cell in cells {
            let sunk = cell.sunk_mm.min(self.foam.floor_mm());
            wanted.push(if sunk > 0.0 { linear * self.foam.stress_kpa(sunk / self.foam.thickness_mm) } else { sunk });
            let index = cell.y as usize * self.columns + cell.x as usize;
            pressure.push((2.0 * self.before[0][index] - self.before[1][index]).max(0.0));
        }
        if cells.len() <= self.most_swept() {
            self.sweep(cells);
        } else {
            self.descend(cells);
        }
        self.remember(cells);
        &self.work.pressure
    }

    fn remember(&mut self, cells: &[Cell]) {
        self.before.swap(0, 1);
        self.loaded.swap(0, 1);
        for index in self.loaded[0].drain(..) {
            self.before[0][index as usize] = 0.0;
        }
        for (cell, pressure) in cells.iter().zip(&self.work.pressure) {
            if *pressure > 0.0 {
                let index = cell.y as usize * self.columns + cell.x as usize;
                self.before[0][index] = *pressure;
                self.loaded[0].push(index as u32);
            }
        }
    }

    /// Projected Gauss-Seidel on the cells, with the influence between each two of them.
    fn sweep(&mut self, cells: &[Cell]) {
        let Work { wanted, pressure, pushed, runs, .. } = &mut self.work;
        runs.clear();
        for (k, cell) in cells.iter().enumerate() {
            let (x, y) = (cell.x as usize, cell.y as usize);
            match runs.last_mut() {
                Some(run) if run.y == y && run.x + run.count == x => run.count += 1,
                _ => runs.push(Run { first: k, count: 1, x, y }),
            }
        }
        pushed.clear();
        pushed.resize(cells.len(), 0.0);
        let grid = Influence { table: &self.influence, rows: self.rows, columns: self.columns };
        for (cell, pressure) in cells.iter().zip(pressure.iter()) {
            if *pressure > 0.0 {
                grid.push(pushed, runs, *cell, *pressure);
            }
        }
        for _ in 0..MOST_TURNS {
            let (moved, largest) = grid.turn(cells, runs, wanted, pressure, pushed);
            if moved <= self.tolerance * largest {
                break;
            }
        }
    }

    /// Conjugate gradients on the cells that are pressed, with the influence of all by waves (Polonsky and Keer 1999).
    fn descend(&mut self, cells: &[Cell]) {
        let Work { wanted, pressure, pushed, gap, way, at, .. } = &mut self.work;
        at.clear();
        at.extend(cells.iter().map(|cell| cell.y as usize * self.wide + cell.x as usize));
        let waves = &mut self.waves;
        let mut carried = |from: &[f64], to: &mut Vec<f64>| {
            waves.plane.fill(0.0);
            for (k, value) in at.iter().zip(from) {
                waves.plane[*k] = *value;
            }
            waves.convolve(&self.surface);
            to.clear();
            to.extend(at.iter().map(|k| waves.plane[*k]));
        };
        way.clear();
        way.resize(cells.len(), 0.0);
        let (mut last, mut keeps, mut known) = (1.0, 0.0, false);
        // The layer's stiffness under a wide touch: what a gap that is left is worth.
        let stiffness = 1.0 / self.surface[0];
        for _ in 0..MOST_TURNS {
            if !known {
                carried(pressure, gap);
                for (gap, wanted) in gap.iter_mut().zip(wanted.iter()) {
                    *gap -= wanted;
                }
            }
            if pressure.iter().all(|p| *p == 0.0) {
                // Nothing is pressed yet: begin where a wide touch would.
                for (pressure, gap) in pressure.iter_mut().zip(gap.iter()) {
                    *pressure = (-gap * stiffness).max(0.0);
                }
                if pressure.iter().all(|p| *p == 0.0) {
                    return;
                }
                continue;
            }
            let held = |k: usize, pressure: &[f64]| pressure[k] > 0.0;
            let size: f64 = (0..gap.len()).filter(|k| held(*k, pressure)).map(|k| gap[k] * gap[k]).sum();
            for k in 0..gap.len() {
                way[k] = if held(k, pressure) { gap[k] + keeps * size / last * way[k] } else { 0.0 };
            }
            last = size;
            carried(way, pushed);
            let (mut down, mut bend) = (0.0, 0.0);
            for k in (0..gap.len()).filter(|k| held(*k, pressure)) {
                down += gap[k] * way[k];
                bend += pushed[k] * way[k];
            }
            if bend <= 0.0 {
                return;
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
                    // Overlap where nothing presses: it joins, and directions begin anew.
                    pressure[k] = -step * gap[k];
                    (keeps, known) = (0.0, false);
                }
                moved = moved.max((pressure[k] - was).abs());
                largest = largest.max(pressure[k]);
            }
            if moved <= self.tolerance * largest {
                return;
            }
            if known {
                for (gap, pushed) in gap.iter_mut().zip(pushed.iter()) {
                    *gap -= step * pushed;
                }
            }
        }
    }

    /// Stress that arrives at each taxel of the array, row by row, MPa, of pressures on cells; below 0 where it pulls.
    pub fn arrive(&mut self, cells: &[Cell], pressure: &[f64], out: &mut Vec<f32>) {
        let (rows, columns) = self.array;
        out.clear();
        out.resize(rows * columns, 0.0);
        let loaded = pressure.iter().filter(|p| **p > 0.0).count();
        let n = self.per_pitch;
        if loaded <= self.most_swept() {
            let margin = self.margin / n;
            let spread = Spread { table: &self.spread, per_pitch: n, reach: self.reach, margin, array: self.array };
            for (cell, pressure) in cells.iter().zip(pressure) {
                if *pressure > 0.0 {
                    spread.add(out, *cell, *pressure as f32);
                }
            }
            return;
        }
        self.waves.plane.fill(0.0);
        for (cell, pressure) in cells.iter().zip(pressure) {
            self.waves.plane[cell.y as usize * self.wide + cell.x as usize] = *pressure;
        }
        self.waves.convolve(&self.base);
        for (y, row) in out.chunks_exact_mut(columns).enumerate() {
            for (x, stress) in row.iter_mut().enumerate() {
                let own = (0..n).flat_map(|down| {
                    let from = (y * n + down + self.margin) * self.wide + x * n + self.margin;
                    &self.waves.plane[from..from + n]
                });
                *stress = (own.sum::<f64>() / (n * n) as f64) as f32;
            }
        }
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

/// How cells move each other.
#[derive(Clone, Copy)]
struct Influence<'a> {
    table: &'a [f64],
    rows: usize,
    columns: usize,
}

impl Influence<'_> {
    #[inline(always)]
    fn row(&self, run: Run, cell: Cell) -> &[f64] {
        let (down, across) = (self.rows - 1 + run.y - cell.y as usize, self.columns - 1 + run.x - cell.x as usize);
        let from = down * (2 * self.columns - 1) + across;
        &self.table[from..from + run.count]
    }

    #[inline(always)]
    fn push(&self, pushed: &mut [f64], runs: &[Run], cell: Cell, by: f64) {
        for run in runs {
            let row = self.row(*run, cell);
            for (pushed, influence) in pushed[run.first..run.first + run.count].iter_mut().zip(row) {
                *pushed += by * influence;
            }
        }
    }

    /// One sweep; how far the pressure moved that moved most, and the largest.
    fn turn(
        self,
        cells: &[Cell],
        runs: &[Run],
        wanted: &[f64],
        pressure: &mut [f64],
        pushed: &mut [f64],
    ) -> (f64, f64) {
        turn(self, cells, runs, wanted, pressure, pushed)
    }
}

wide! {
    fn turn(grid: Influence<'_>, cells: &[Cell], runs: &[Run], wanted: &[f64], pressure: &mut [f64], pushed: &mut [f64]) -> (f64, f64) {
        let own = grid.table[grid.table.len() / 2];
        let (mut moved, mut largest) = (0.0_f64, 0.0_f64);
        for k in 0..cells.len() {
            let before = pressure[k];
            let after = (before - RELAXATION * (pushed[k] - wanted[k]) / own).max(0.0);
            if after != before {
                pressure[k] = after;
                grid.push(pushed, runs, cells[k], after - before);
                moved = moved.max((after - before).abs());
            }
            largest = largest.max(after);
        }
        (moved, largest)
    }
}

/// How a cell's pressure spreads over the taxels below; reach and margin in taxels.
#[derive(Clone, Copy)]
struct Spread<'a> {
    table: &'a [f32],
    per_pitch: usize,
    reach: usize,
    margin: usize,
    array: (usize, usize),
}

impl Spread<'_> {
    fn add(self, out: &mut [f32], cell: Cell, pressure: f32) {
        add(self, out, cell, pressure);
    }
}

wide! {
    fn add(spread: Spread<'_>, out: &mut [f32], cell: Cell, pressure: f32) {
        let ((rows, columns), n) = (spread.array, spread.per_pitch);
        let side = 2 * spread.reach + 1;
        // The cell's taxel, and which of its cells it is. Taxel (x, y) of the array is (x + margin, y + margin); a table's
        // first entry is `reach` before the cell's own.
        let (own_x, own_y) = (cell.x as usize / n, cell.y as usize / n);
        let which = cell.y as usize % n * n + cell.x as usize % n;
        let table = &spread.table[which * side * side..(which + 1) * side * side];
        let span = |at: usize, count: usize| {
            let first = at.saturating_sub(spread.margin + spread.reach);
            let last = (at + spread.reach + 1).saturating_sub(spread.margin).min(count);
            (first, last)
        };
        let (left, right) = span(own_x, columns);
        let (top, bottom) = span(own_y, rows);
        if left >= right {
            return;
        }
        for y in top..bottom {
            let down = y + spread.margin + spread.reach - own_y;
            let across = left + spread.margin + spread.reach - own_x;
            let from = down * side + across;
            let row = &table[from..from + right - left];
            for (stress, share) in out[y * columns + left..y * columns + right].iter_mut().zip(row) {
                *stress += pressure * share;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::rngs::StdRng;
    use rand::{Rng, SeedableRng};

    /// Foam that stays linear however far it is pressed in these tests.
    fn linear(modulus_kpa: f64, thickness_mm: f64, poisson: f64) -> Foam {
        Foam { modulus_kpa, thickness_mm, poisson, yield_strain: 0.9, densification_strain: 0.99, ..Foam::default() }
    }

    /// Cells below a height over the place (x, y), sunk by a depth; and those that the layer may bulge to.
    fn cells(layer: &Bonded, depth: f64, height: impl Fn(f64, f64) -> f64) -> Vec<Cell> {
        let (rows, columns) = layer.shape();
        let above = -layer.bulge() * depth;
        let mut found = vec![];
        for y in 0..rows {
            for x in 0..columns {
                let sunk_mm = depth - height(layer.place_mm(x), layer.place_mm(y));
                if sunk_mm > above {
                    found.push(Cell { x: x as u32, y: y as u32, sunk_mm });
                }
            }
        }
        found
    }

    fn parabola(radius: f64, at: (f64, f64)) -> impl Fn(f64, f64) -> f64 {
        move |x, y| ((x - at.0).powi(2) + (y - at.1).powi(2)) / (2.0 * radius)
    }

    #[test]
    fn a_ball_on_a_thick_layer_is_pressed_as_hertz_says() {
        // a / h is 0.03 here: the layer is a half-space to 2 %, less what a pitch of a / 10 leaves.
        let (radius, depth, nu) = (40.0_f64, 0.9_f64, 0.3_f64);
        let array = Array::new(72, 72, 0.4, "fine").unwrap();
        let layer = Bonded::new(&linear(50.0, 200.0, nu), &array, 1).unwrap();
        let mut layer = layer.to_within(1e-7);
        let found = cells(&layer, depth, parabola(radius, (14.2, 14.2)));
        let force: f64 = layer.press(&found).iter().sum::<f64>() * layer.area_mm2();
        let stiff = 0.05 / (1.0 - nu * nu);
        let hertz = 4.0 / 3.0 * stiff * radius.sqrt() * depth.powf(1.5);
        assert!((force / hertz - 1.0).abs() < 0.03, "{force} N, Hertz {hertz}");
        let peak = layer.press(&found).iter().fold(0.0_f64, |a, b| a.max(*b));
        let expected = 2.0 * stiff / std::f64::consts::PI * (depth / radius).sqrt();
        assert!((peak / expected - 1.0).abs() < 0.03, "{peak} MPa, Hertz {expected}");
    }

    #[test]
    fn sweeps_and_gradients_agree_and_meet_the_conditions_of_contact() {
        let mut draw = StdRng::seed_from_u64(5);
        for round in 0..24 {
            let nu = [0.0, 0.1, 0.3, 0.45, 0.49][round % 5];
            let thick = [2.0, 10.0, 40.0][round % 3];
            let array = Array::new(24, 30, draw.random_range(1.0..4.0), "drawn").unwrap();
            let foam = linear(10f64.powf(draw.random_range(0.5..3.0)), thick, nu);
            let make = || Bonded::new(&foam, &array, 1).unwrap().to_within(1e-9);
            let (mut swept, mut descended) = (make(), make());
            // One to three bodies, round or edged, from far too flat to a needle, some over the array's edge.
            let span = array.pitch_mm * 26.0;
            let bodies: Vec<(f64, f64, f64, f64)> = (0..draw.random_range(1..4))
                .map(|_| {
                    let at = (draw.random_range(-5.0..span), draw.random_range(-5.0..span));
                    (at.0, at.1, 10f64.powf(draw.random_range(0.0..3.0)), draw.random_range(0.0..1.0))
                })
                .collect();
            let depth = thick * 10f64.powf(draw.random_range(-4.0..-0.7));
            let found = cells(&swept, depth, |x, y| {
                bodies
                    .iter()
                    .map(|(bx, by, radius, edge)| {
                        let (dx, dy) = (x - bx, y - by);
                        edge * dx.abs() * 0.3 + (1.0 - edge) * (dx * dx + dy * dy) / (2.0 * radius)
                    })
                    .fold(f64::INFINITY, f64::min)
            });
            if found.len() < 2 || found.len() > MOST_SWEPT || found.iter().all(|cell| cell.sunk_mm <= 0.0) {
                continue;
            }
            let pressure = swept.press(&found).to_vec();
            descended.work.wanted.clone_from(&swept.work.wanted);
            descended.work.pressure = vec![0.0; found.len()];
            descended.descend(&found);
            let peak = pressure.iter().fold(0.0_f64, |a, b| a.max(*b));
            for (a, b) in pressure.iter().zip(&descended.work.pressure) {
                assert!((a - b).abs() < 1e-4 * peak, "round {round}, nu {nu}: {a} against {b}, peak {peak}");
            }
            // Gaps of every cell of the grid, those that were no candidates too.
            let grid = Influence { table: &swept.influence, rows: swept.rows, columns: swept.columns };
            let all: Vec<Run> =
                (0..swept.rows).map(|y| Run { first: y * swept.columns, count: swept.columns, x: 0, y }).collect();
            let mut pushed = vec![0.0; swept.rows * swept.columns];
            for (cell, p) in found.iter().zip(&pressure) {
                grid.push(&mut pushed, &all, *cell, *p);
            }
            for (k, (cell, p)) in found.iter().zip(&pressure).enumerate() {
                let gap = pushed[cell.y as usize * swept.columns + cell.x as usize] - swept.work.wanted[k];
                assert!(*p >= 0.0 && gap > -1e-5 * depth, "round {round}: gap {gap} of {depth}");
                assert!(p * gap.abs() < 1e-5 * peak * depth, "round {round}: {p} MPa at a gap of {gap}");
            }
        }
    }

    #[test]
    fn no_cell_outside_the_candidates_is_entered() {
        // The worst: a nearly incompressible layer bulges beside the body, the more the thinner it is beside the touch.
        for (nu, thick) in
            [(0.0, 10.0), (0.1, 10.0), (0.3, 10.0), (0.45, 10.0), (0.49, 10.0), (0.49, 1.0), (0.499, 1.5)]
        {
            let array = Array::new(40, 40, 1.5, "bulging").unwrap();
            for (radius, depth) in [(20.0, 0.05 * thick), (35.0, 0.2 * thick), (300.0, 0.1 * thick)] {
                let mut layer = Bonded::new(&linear(60.0, thick, nu), &array, 1).unwrap().to_within(1e-7);
                let shape = parabola(radius, (29.0, 30.0));
                let found = cells(&layer, depth, &shape);
                let pressure = layer.press(&found).to_vec();
                let (rows, columns) = layer.shape();
                layer.waves.plane.fill(0.0);
                for (cell, p) in found.iter().zip(&pressure) {
                    layer.waves.plane[cell.y as usize * layer.wide + cell.x as usize] = *p;
                }
                let surface = layer.surface.clone();
                layer.waves.convolve(&surface);
                for y in 0..rows {
                    for x in 0..columns {
                        let gap = layer.waves.plane[y * layer.wide + x] + shape(layer.place_mm(x), layer.place_mm(y));
                        assert!(gap > (1.0 - 2e-3) * depth, "nu {nu}, R {radius}: {} at {x}, {y}", gap - depth);
                    }
                }
            }
        }
    }

    #[test]
    fn a_wide_flat_touch_follows_the_foams_own_law() {
        // Far from its rim a wide punch presses a confined layer; without widening that is the column itself.
        let foam = Foam::default();
        let array = Array::new(60, 60, 2.0, "wide").unwrap();
        for depth in [0.3, 2.0, 6.0, 9.2] {
            let mut layer = Bonded::new(&foam, &array, 1).unwrap().to_within(1e-6);
            let found =
                cells(
                    &layer,
                    depth,
                    |x, y| if (8.0..110.0).contains(&x) && (8.0..110.0).contains(&y) { 0.0 } else { 1e3 },
                );
            let pressure = layer.press(&found).to_vec();
            let centre = found
                .iter()
                .position(|c| layer.place_mm(c.x as usize) == 60.0 && layer.place_mm(c.y as usize) == 60.0)
                .unwrap();
            let law = 1e-3 * foam.stress_kpa(depth / foam.thickness_mm);
            assert!((pressure[centre] / law - 1.0).abs() < 2e-3, "{depth} mm: {} against {law}", pressure[centre]);
            let mut base = vec![];
            layer.arrive(&found, &pressure, &mut base);
            assert!((f64::from(base[30 * 60 + 30]) / law - 1.0).abs() < 3e-3);
        }
    }

    #[test]
    fn all_of_the_force_arrives_at_the_base() {
        let array = Array::thesis();
        for (nu, per_pitch) in [(0.0, 1), (0.3, 1), (0.0, 2), (0.3, 3)] {
            let mut layer = Bonded::new(&linear(60.0, 10.0, nu), &array, per_pitch).unwrap();
            let found = cells(&layer, 2.0, parabola(30.0, (80.0, 85.0)));
            let pressure = layer.press(&found).to_vec();
            let mut near = vec![];
            layer.arrive(&found, &pressure, &mut near);
            let up = pressure.iter().sum::<f64>() * layer.area_mm2();
            let down = near.iter().map(|s| f64::from(*s)).sum::<f64>() * array.pitch_mm.powi(2);
            assert!((down / up - 1.0).abs() < 1e-2, "nu {nu}, {per_pitch}: {down} of {up} N");
            let on = layer.on_array(&found, &pressure).iter().sum::<f64>() * array.pitch_mm.powi(2);
            assert!((on / up - 1.0).abs() < 1e-9, "nu {nu}, {per_pitch}: {on} of {up} N");
        }
    }

    #[test]
    fn cells_along_a_pitch_are_the_grid_of_as_many_taxels_and_a_taxel_feels_their_mean() {
        let foam = linear(60.0, 3.0, 0.2);
        for n in [2_u16, 3] {
            let array = Array::new(16, 20, 1.5, "coarse").unwrap();
            let pitch = 1.5 / f64::from(n);
            let fine = Array::new(16 * n, 20 * n, pitch, "fine").unwrap();
            let mut cut = Bonded::new(&foam, &array, n).unwrap().to_within(1e-8);
            let mut small = Bonded::new(&foam, &fine, 1).unwrap().to_within(1e-8);
            // The array's first cell lies before its first taxel.
            let first = (pitch - 1.5) / 2.0;
            let touch = cells(&cut, 0.3, parabola(6.0, (14.0, 9.0)));
            let same = cells(&small, 0.3, parabola(6.0, (14.0 - first, 9.0 - first)));
            assert_eq!(touch.len(), same.len());
            let pressure = cut.press(&touch).to_vec();
            let expected = small.press(&same).to_vec();
            let peak = expected.iter().fold(0.0_f64, |a, b| a.max(*b));
            for (a, b) in pressure.iter().zip(&expected) {
                assert!((a - b).abs() < 1e-4 * peak, "{n}: {a} against {b}");
            }
            let (mut felt, mut by_cell) = (vec![], vec![]);
            cut.arrive(&touch, &pressure, &mut felt);
            small.arrive(&same, &expected, &mut by_cell);
            let (side, columns) = (usize::from(n), 20 * usize::from(n));
            let most = felt.iter().fold(0.0_f32, |a, b| a.max(*b));
            for (k, stress) in felt.iter().enumerate() {
                let (y, x) = (k / 20 * side, k % 20 * side);
                let mean = (0..side * side).map(|c| by_cell[(y + c / side) * columns + x + c % side]).sum::<f32>()
                    / (side * side) as f32;
                assert!((stress - mean).abs() < 1e-3 * most, "{n}, taxel {k}: {stress} against {mean}");
            }
            // By waves, as of many cells, and cell by cell.
            let (mut whole, many) = (vec![], vec![1e-3; cut.over_array().0 * cut.over_array().1]);
            let all = cut.under(&many);
            assert!(all.len() > cut.most_swept());
            cut.arrive(&all, &many, &mut whole);
            let (mut sum, mut part) = (vec![0.0_f32; felt.len()], vec![]);
            for some in all.chunks(cut.most_swept()) {
                cut.arrive(some, &many[..some.len()], &mut part);
                sum.iter_mut().zip(&part).for_each(|(sum, part)| *sum += part);
            }
            for (k, (a, b)) in whole.iter().zip(&sum).enumerate() {
                assert!((a - b).abs() < 2e-2 * 1e-3, "{n}, taxel {k}: {a} against {b}");
            }
        }
    }

    #[test]
    fn more_cells_than_can_be_reckoned_with_are_refused_with_how_many_can() {
        let said = |array: &Array, n: u16| check_cells(&Foam::default(), array, n).unwrap_err().to_string();
        let (thesis, large) = (Array::thesis(), Array::new(256, 256, 2.67, "large").unwrap());
        assert!(said(&thesis, 0).contains("cells_per_pitch is 0") && said(&thesis, 17).contains("from 1 to 16"));
        check_cells(&Foam::default(), &thesis, 16).unwrap();
        let most = most_cells(&Foam::default(), &large);
        assert!((2..16).contains(&most) && said(&large, 16).contains(&format!("must be {most} or less")));
    }

    #[test]
    fn the_next_frame_begins_where_the_last_two_lead() {
        let mut layer = Bonded::new(&linear(60.0, 10.0, 0.0), &Array::thesis(), 1).unwrap();
        let mut cold = Bonded::new(&linear(60.0, 10.0, 0.0), &Array::thesis(), 1).unwrap().to_within(1e-9);
        for k in 1..60 {
            let depth = 0.02 * f64::from(k);
            let found = cells(&layer, depth, parabola(35.0, (80.0, 80.0)));
            let warm = layer.press(&found).to_vec();
            cold.forget();
            let exact = cold.press(&found).to_vec();
            let peak = exact.iter().fold(0.0_f64, |a, b| a.max(*b));
            for (a, b) in warm.iter().zip(&exact) {
                assert!((a - b).abs() < 2e-3 * peak, "frame {k}: {a} against {b}");
            }
        }
    }
}
