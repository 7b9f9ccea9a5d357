//! A foam layer bonded to the board: which pressures hold bodies off it, and what of them arrives at its base.
//!
//! Pressure on one cell (a taxel, or one of the cells beside the array) moves the faces of all others. Where a body has
//! sunk by `t` into the layer at rest, pressures `p` leave the gap `g = K p - t`, and contact asks for `p >= 0`,
//! `g >= 0` and `p g = 0` in each cell. `K` is [`surface_compliance`] at the grid's wave numbers, tabulated once.

use super::Foam;
use super::layer::{base_stress, surface_compliance};
use super::waves::{Waves, fast_length};
use crate::vectors::wide;
use crate::{Array, Result};

/// The layer's influence has died within so many thicknesses; less than a per cent of the force arrives beyond.
const REACH: f64 = 4.0;
/// Planes are no longer than this where only a very thick layer's influence would ask for more, cells.
const LONGEST: usize = 1024;
/// Over-relaxation of a sweep.
const RELAXATION: f64 = 1.2;
/// More cells than these are solved by waves: a sweep costs their square, a convolution the grid whatever is loaded.
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
    pitch_mm: f64,
    rows: usize,
    columns: usize,
    margin: usize,
    array: (usize, usize),
    /// Displacement of a cell's face for 1 MPa on another one, mm: by rows and columns between them.
    influence: Vec<f64>,
    /// Share of a cell's pressure that arrives at a taxel: by rows and columns between them, up to `reach`.
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

impl Bonded {
    /// Tabulates a layer of `foam` over `array`.
    ///
    /// # Errors
    ///
    /// `Scene` where the foam makes no sense.
    pub fn new(foam: &Foam, array: &Array) -> Result<Self> {
        foam.check()?;
        let (pitch, thick) = (array.pitch_mm, foam.thickness_mm);
        let reach = (REACH * thick / pitch).ceil().max(1.0) as usize;
        let margin = reach.min(usize::from(array.rows.max(array.columns)));
        let (rows, columns) = (usize::from(array.rows) + 2 * margin, usize::from(array.columns) + 2 * margin);
        // The plane repeats: so far apart that no cell feels another's repetition, for a layer thinner than the plane.
        let apart = |n: usize| fast_length((n + reach).min(LONGEST.max(2 * n)));
        let (tall, wide) = (apart(rows), apart(columns));
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
        let table = |plane: &[f64], down: usize, across: usize| -> Vec<f64> {
            let (down, across) = (down as isize, across as isize);
            let between = |y: isize, x: isize| {
                plane[y.rem_euclid(tall as isize) as usize * wide + x.rem_euclid(wide as isize) as usize]
            };
            (-down..=down).flat_map(|y| (-across..=across).map(move |x| between(y, x))).collect()
        };
        let influence = table(&near, rows - 1, columns - 1);
        let spread = table(&through, reach, reach).into_iter().map(|share| share as f32).collect();
        Ok(Self {
            foam: foam.clone(),
            pitch_mm: pitch,
            rows,
            columns,
            margin,
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
        (n as f64 - self.margin as f64) * self.pitch_mm
    }

    /// The grid's columns or rows (`count` of them) from one place to another.
    #[must_use]
    pub fn between(&self, from_mm: f64, to_mm: f64, count: usize) -> std::ops::Range<usize> {
        let at = |mm: f64| (mm / self.pitch_mm + self.margin as f64).clamp(-1.0, count as f64);
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

    /// Cells that may be touched by a body that has sunk by `sunk_mm` at each taxel of the array, row by row.
    #[must_use]
    pub fn under(&self, sunk_mm: &[f64]) -> Vec<Cell> {
        let above = -self.bulge() * sunk_mm.iter().fold(0.0_f64, |a, b| a.max(*b));
        let (_, columns) = self.array;
        let at = |n: usize| (n + self.margin) as u32;
        let cell = |(k, sunk_mm): (usize, &f64)| Cell { x: at(k % columns), y: at(k / columns), sunk_mm: *sunk_mm };
        sunk_mm.iter().enumerate().map(cell).filter(|cell| cell.sunk_mm > above).collect()
    }

    /// The array's pressures, row by row, MPa, of pressures on cells.
    #[must_use]
    pub fn on_array(&self, cells: &[Cell], pressure: &[f64]) -> Vec<f64> {
        let (rows, columns) = self.array;
        let mut on = vec![0.0; rows * columns];
        for (cell, pressure) in cells.iter().zip(pressure) {
            let (x, y) = ((cell.x as usize).wrapping_sub(self.margin), (cell.y as usize).wrapping_sub(self.margin));
            if x < columns && y < rows {
                on[y * columns + x] = *pressure;
            }
        }
        on
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
        if cells.len() <= MOST_SWEPT {
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
        if loaded <= MOST_SWEPT {
            let spread = Spread { table: &self.spread, reach: self.reach, margin: self.margin, array: self.array };
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
            let from = (y + self.margin) * self.wide + self.margin;
            for (stress, arrived) in row.iter_mut().zip(&self.waves.plane[from..from + columns]) {
                *stress = *arrived as f32;
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

/// How a cell's pressure spreads over the taxels below.
#[derive(Clone, Copy)]
struct Spread<'a> {
    table: &'a [f32],
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
        let (rows, columns) = spread.array;
        let side = 2 * spread.reach + 1;
        // Taxel (x, y) is cell (x + margin, y + margin); the table's first entry is `reach` before the cell itself.
        let span = |at: usize, count: usize| {
            let first = at.saturating_sub(spread.margin + spread.reach);
            let last = (at + spread.reach + 1).saturating_sub(spread.margin).min(count);
            (first, last)
        };
        let (left, right) = span(cell.x as usize, columns);
        let (top, bottom) = span(cell.y as usize, rows);
        if left >= right {
            return;
        }
        for y in top..bottom {
            let down = y + spread.margin + spread.reach - cell.y as usize;
            let across = left + spread.margin + spread.reach - cell.x as usize;
            let from = down * side + across;
            let row = &spread.table[from..from + right - left];
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
        let layer = Bonded::new(&linear(50.0, 200.0, nu), &array).unwrap();
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
            let make = || Bonded::new(&foam, &array).unwrap().to_within(1e-9);
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
                let mut layer = Bonded::new(&linear(60.0, thick, nu), &array).unwrap().to_within(1e-7);
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
            let mut layer = Bonded::new(&foam, &array).unwrap().to_within(1e-6);
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
        for nu in [0.0, 0.3] {
            let mut layer = Bonded::new(&linear(60.0, 10.0, nu), &array).unwrap();
            let found = cells(&layer, 2.0, parabola(30.0, (80.0, 85.0)));
            let pressure = layer.press(&found).to_vec();
            let mut near = vec![];
            layer.arrive(&found, &pressure, &mut near);
            let (up, down) = (pressure.iter().sum::<f64>(), near.iter().map(|s| f64::from(*s)).sum::<f64>());
            assert!((down / up - 1.0).abs() < 1e-2, "nu {nu}: {down} of {up}");
        }
    }

    #[test]
    fn the_next_frame_begins_where_the_last_two_lead() {
        let mut layer = Bonded::new(&linear(60.0, 10.0, 0.0), &Array::thesis()).unwrap();
        let mut cold = Bonded::new(&linear(60.0, 10.0, 0.0), &Array::thesis()).unwrap().to_within(1e-9);
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
