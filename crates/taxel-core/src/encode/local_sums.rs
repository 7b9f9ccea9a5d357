//! Sums over 3 x 3 taxels of values above a baseline, in units of each taxel's own noise.

use super::blocks::{BLOCK, Block, in_blocks};
use super::loaded::Paired;
use super::tare::Tare;
use crate::rest::{Baseline, FAR_NOISE, Value, Waiting, stands_out_from};
use crate::vectors::wide;
use crate::{Array, Result};

/// Values are clipped at this many units of noise before they are summed, so that no stuck taxel, and no pair of them,
/// has a sum above [`OUTSTANDING`].
const CLIP: f64 = 3.0;

/// A taxel stands out if its sum is above this.
const OUTSTANDING: f32 = 4.0;

/// Number of taxels that are compared at once; divides a block.
const LANES: usize = 16;

/// The cells of a grid: the taxels of an array with a border of one empty cell around each row, in which the neighbours
/// of any taxel lie at the same distances.
#[derive(Debug, Clone)]
struct CellGrid {
    array: Array,
    rows: usize,
    columns: usize,
    /// Distance from a cell to the one below it.
    stride: usize,
    /// Number of cells, whole blocks.
    cells: usize,
}

impl CellGrid {
    fn new(array: &Array) -> Self {
        let (rows, columns) = (usize::from(array.rows), usize::from(array.columns));
        let stride = columns + 1;
        // The last row's sums are computed in whole lanes, beyond the border below it.
        let cells = ((rows + 2) * stride + 2 + LANES).next_multiple_of(BLOCK);
        Self { array: array.clone(), rows, columns, stride, cells }
    }

    /// The cell of the taxel with this index in the array.
    fn cell(&self, taxel: usize) -> usize {
        (taxel / self.columns + 1) * self.stride + taxel % self.columns + 1
    }

    /// The cell of each existing taxel with its index in the array.
    fn taxels(&self) -> impl Iterator<Item = (usize, usize)> {
        (0..self.array.len()).filter(|&taxel| self.array.has(taxel)).map(|taxel| (self.cell(taxel), taxel))
    }

    /// Copies the values of a frame into the cells.
    fn spread(&self, frame: &[f32], cells: &mut [f32]) {
        for (row, values) in frame.chunks_exact(self.columns).take(self.rows).enumerate() {
            cells[self.cell(row * self.columns)..][..self.columns].copy_from_slice(values);
        }
    }
}

/// The noise of each cell; a cell without a taxel, or with one whose rest is not known, is left out of all sums.
#[derive(Clone)]
struct CellNoise {
    floor: f64,
    /// Standard deviation of each taxel's values at rest, at least the smallest allowed; `None` of cells left out.
    sd: Vec<Option<f64>>,
    least: f64,
    /// The largest size of a value in a sum: [`CLIP`] units of noise; 0 in cells left out.
    clip: Vec<f32>,
    /// From where a value belongs to the total; infinite in cells left out.
    large: Vec<f32>,
    /// 1 over the noise of the sum around each cell; 0 in cells left out.
    per_noise: Vec<f32>,
}

impl CellNoise {
    fn new(grid: &CellGrid, sd: Vec<Option<f64>>, least: f64, floor: f64) -> Self {
        // The unit of a cell's values: the taxel's noise and that of the board's floor, within which a value can hide.
        let unit = |cell: usize| sd[cell].map_or(0.0, |sd| (sd * sd + floor * floor / 4.0).sqrt());
        let row = |cell: usize| {
            let [left, middle, right] = [cell - 1, cell, cell + 1].map(|cell| unit(cell).powi(2));
            (left + right) + middle
        };
        let around = |cell: usize| (row(cell - grid.stride) + row(cell + grid.stride)) + row(cell);
        let cells = || sd.iter().enumerate();
        Self {
            clip: cells().map(|(cell, _)| (CLIP * unit(cell)) as f32).collect(),
            large: cells().map(|(_, sd)| sd.map_or(f32::INFINITY, |sd| (FAR_NOISE * sd) as f32)).collect(),
            per_noise: cells().map(|(cell, sd)| sd.map_or(0.0, |_| around(cell).sqrt().recip() as f32)).collect(),
            floor,
            least,
            sd,
        }
    }

    /// From where a cell stands out by `times` its noise; infinite in cells left out.
    fn stands_out_from(&self, cell: usize, times: f64) -> f64 {
        self.sd[cell].map_or(f64::INFINITY, |sd| stands_out_from(times, sd, self.floor))
    }

    /// The same with a cell that counts from now on, whose rest was not known.
    fn with(&self, cell: usize, grid: &CellGrid) -> Self {
        let mut sd = self.sd.clone();
        sd[cell] = Some(self.least);
        Self::new(grid, sd, self.least, self.floor)
    }
}

/// Sums of values above a baseline, and of those below it.
#[derive(Clone, Copy, Default)]
pub(super) struct SumPair {
    /// The largest sum over 3 x 3 clipped values, in units of its noise, at least 0; above and below.
    pub(super) largest: [f64; 2],
    /// The number of taxels whose sum is above 4 units of its noise.
    pub(super) places: f64,
    /// The number of taxels that stand out and have a neighbour that does; above and below.
    pub(super) area: [f64; 2],
    /// The sum of the values of 5 or more times their taxel's noise; above and below.
    pub(super) total: [f64; 2],
}

wide! {
    /// Clips the values; returns the sums of those that are large, above and below.
    fn clip(above: &[Block], limits: &[Block], large: &[Block], clipped: &mut [Block]) -> [f64; 2] {
        // Added in f64, in which sums of f32 hardly ever round: they do not depend on the order of the taxels.
        let (mut over, mut under) = ([0.0; LANES], [0.0; LANES]);
        for (((above, limits), large), clipped) in above.iter().zip(limits).zip(large).zip(clipped) {
            let mut any = 0;
            for lane in 0..BLOCK {
                let (value, limit) = (above[lane], limits[lane]);
                any |= u32::from(value.abs() >= large[lane]);
                let least = if value > -limit { value } else { -limit };
                clipped[lane] = if least < limit { least } else { limit };
            }
            if any == 0 {
                continue;
            }
            for (above, large) in above.as_chunks::<LANES>().0.iter().zip(large.as_chunks::<LANES>().0) {
                for lane in 0..LANES {
                    let value = above[lane];
                    over[lane] += f64::from(if value >= large[lane] { value } else { 0.0 });
                    under[lane] += f64::from(if -value >= large[lane] { -value } else { 0.0 });
                }
            }
        }
        [over, under].map(|lanes| lanes.iter().sum())
    }
}

wide! {
    /// The sum of each cell, the one above it and the one below it; the outer ones first, so that a turned array has the
    /// same sums.
    fn vertically(up: &[f32], middle: &[f32], down: &[f32], sums: &mut [f32]) {
        for (((sum, up), middle), down) in sums.iter_mut().zip(up).zip(middle).zip(down) {
            *sum = (up + down) + middle;
        }
    }
}

/// The largest and the smallest of numbers, and how many are outstanding.
type Extremes = (f32, f32, u32);

wide! {
    /// Extremes of the sums of three neighbours, in units of their noise, and 0.
    fn horizontally(left: &[f32], middle: &[f32], right: &[f32], per_noise: &[f32]) -> Extremes {
        let (mut largest, mut smallest, mut outstanding) = ([0.0_f32; LANES], [0.0_f32; LANES], [0_u32; LANES]);
        let groups = left.as_chunks::<LANES>().0.iter().zip(middle.as_chunks::<LANES>().0);
        let groups = groups.zip(right.as_chunks::<LANES>().0).zip(per_noise.as_chunks::<LANES>().0);
        for (((left, middle), right), per_noise) in groups {
            for lane in 0..LANES {
                let sum = ((left[lane] + right[lane]) + middle[lane]) * per_noise[lane];
                largest[lane] = if sum > largest[lane] { sum } else { largest[lane] };
                smallest[lane] = if sum < smallest[lane] { sum } else { smallest[lane] };
                outstanding[lane] += u32::from(sum > OUTSTANDING);
            }
        }
        (
            largest.into_iter().fold(0.0, f32::max),
            smallest.into_iter().fold(0.0, f32::min),
            outstanding.into_iter().sum(),
        )
    }
}

/// A baseline, and what is above and below it.
#[derive(Clone)]
struct Side {
    baseline: Baseline,
    /// Taxels that stand out above, and, where they are wanted, below.
    above: Paired,
    below: Option<Paired>,
    /// Number of times its noise from which a taxel stands out.
    times: f64,
    clipped: Vec<f32>,
    vertical: Vec<f32>,
}

impl Side {
    fn new(grid: &CellGrid, noise: &CellNoise, baseline: Baseline, times: f64, below: bool) -> Self {
        let paired = || Paired::new(grid.rows + 2, grid.stride);
        let zeros = vec![0.0; grid.cells];
        let (above, below) = (paired(), below.then(paired));
        let mut new = Self { baseline, above, below, times, clipped: zeros.clone(), vertical: zeros };
        for (cell, _) in grid.taxels() {
            new.changed(noise, cell);
        }
        new
    }

    /// Reads a cell's noise.
    fn changed(&mut self, noise: &CellNoise, cell: usize) {
        let from = noise.stands_out_from(cell, self.times);
        for paired in [Some(&mut self.above), self.below.as_mut()].into_iter().flatten() {
            paired.set_from(cell, from);
        }
    }

    fn take(&mut self, t: i64, values: &[f32], grid: &CellGrid, noise: &CellNoise) -> SumPair {
        let above = self.baseline.take(t, values);
        let total =
            clip(in_blocks(above), in_blocks(&noise.clip), in_blocks(&noise.large), self.clipped.as_chunks_mut().0);
        for (block, above) in in_blocks(above)[..self.above.blocks()].iter().enumerate() {
            self.above.take_block(block, above);
            if let Some(below) = &mut self.below {
                below.take_block(block, &above.map(|value| -value));
            }
        }
        // From the cell before the first taxel to the one after the last.
        let (stride, first) = (grid.stride, grid.stride);
        let n = (grid.rows * stride).next_multiple_of(LANES);
        let from = |cell: usize, n: usize| &self.clipped[cell..cell + n];
        let sums = &mut self.vertical[first..first + n + 2];
        vertically(from(first - stride, n + 2), from(first, n + 2), from(first + stride, n + 2), sums);
        let per_noise = &noise.per_noise[first + 1..first + 1 + n];
        let (largest, smallest, places) = horizontally(&sums[..n], &sums[1..=n], &sums[2..], per_noise);
        SumPair {
            largest: [f64::from(largest), f64::from(-smallest)],
            places: f64::from(places),
            area: [self.above.area(), self.below.as_ref().map_or(0, Paired::area)].map(f64::from),
            total,
        }
    }
}

/// Sums above a rest, tracked or measured, and above any running means.
#[derive(Clone)]
pub(super) struct LocalSums {
    grid: CellGrid,
    noise: CellNoise,
    sides: Vec<Side>,
    values: Vec<f32>,
    waiting: Waiting,
}

impl LocalSums {
    /// Starts from a tare; `running_us` are the time constants of running means.
    pub(super) fn new(
        array: &Array,
        tare: &Tare,
        (least, floor): (f64, f64),
        tracked: bool,
        running_us: &[f64],
    ) -> Result<Self> {
        let (rest, measured, grid) = (tare.rest_of(array)?, tare.place_noise(), CellGrid::new(array));
        let (mut begins, mut sd) = (vec![f64::NO_REST; grid.cells], vec![None; grid.cells]);
        for (cell, taxel) in grid.taxels() {
            begins[cell] = rest.values()[taxel];
            sd[cell] = (begins[cell] != f64::NO_REST).then(|| measured[taxel].max(least));
        }
        let noise = CellNoise::new(&grid, sd, least, floor);
        let baseline = if tracked {
            let far = (0..grid.cells).map(|cell| noise.stands_out_from(cell, FAR_NOISE) as f32).collect();
            Baseline::tracked(begins, far)
        } else {
            Baseline::measured(begins)
        };
        let mut sides = vec![Side::new(&grid, &noise, baseline, 3.0, false)];
        for &tau in running_us {
            sides.push(Side::new(&grid, &noise, Baseline::running(grid.cells, tau), 4.0, true));
        }
        Ok(Self { values: vec![0.0; grid.cells], grid, noise, sides, waiting: Waiting::default() })
    }

    /// Reads the values of all taxels, row by row, at `t` us; gives `each` the sums above the rest, then those above each running mean.
    pub(super) fn take(&mut self, t: i64, frame: &[f32], mut each: impl FnMut(SumPair)) {
        self.grid.spread(frame, &mut self.values);
        self.waiting.fill(&mut self.values, self.sides[0].baseline.values());
        for side in &mut self.sides {
            each(side.take(t, &self.values, &self.grid, &self.noise));
        }
    }

    /// Sets the rest of the taxel with this index in the array, if it exists.
    pub(super) fn set_rest(&mut self, taxel: usize, rest: f64) {
        if !self.grid.array.has(taxel) {
            return;
        }
        let cell = self.grid.cell(taxel);
        if self.noise.sd[cell].is_none() {
            self.noise = self.noise.with(cell, &self.grid);
        }
        for side in &mut self.sides {
            side.changed(&self.noise, cell);
        }
        let baseline = &mut self.sides[0].baseline;
        baseline.set(cell, rest);
        baseline.set_far(cell, self.noise.stands_out_from(cell, FAR_NOISE) as f32);
    }

    /// The rest of the taxel with this index in the array; `None` if it is not known.
    pub(super) fn rest(&self, taxel: usize) -> Option<f64> {
        let cell = self.grid.cell(taxel);
        self.noise.sd[cell].map(|_| self.sides[0].baseline.values()[cell])
    }
}
