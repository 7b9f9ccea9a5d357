//! The force of foam on a body that sinks straight in.

use super::body::Body;
use super::bonded::{Bonded, Cell, MOST_SWEPT};
use super::{BodyShape, Foam};
use crate::{Result, Stop};

/// Depths at which a table holds the force, evenly spaced in the square root of depth.
const DEPTHS: usize = 160;
/// Neighbours on each side over which the table is smoothed.
const SMOOTH: usize = 2;
/// Places within a cell (columns, rows) at which the force of a body is worked out: spread evenly, two in no row.
const POINTS: [(f64, f64); 9] = [
    (0.056, 0.5),
    (0.167, 0.833),
    (0.278, 0.167),
    (0.389, 0.611),
    (0.5, 0.944),
    (0.611, 0.278),
    (0.722, 0.722),
    (0.833, 0.056),
    (0.944, 0.389),
];

/// Elastic force by how far a body's middle has come down since it touched.
///
/// A body that deforms (`stiffness_n_mm`) is a spring in series: it comes down by the foam's depth and its own compression.
#[derive(Debug, Clone)]
pub struct Push {
    /// How far the body has come down, mm, its face's depth in the foam, mm, and force, N; all rise.
    entries: Vec<[f64; 3]>,
}

impl Push {
    /// The law of a body on `foam`, which `layer` is, bonded.
    ///
    /// # Errors
    ///
    /// `Interrupted`.
    pub fn new(foam: &Foam, body: &Body, layer: &mut Bonded, stop: Stop<'_>) -> Result<Self> {
        let give = body.stiffness_n_mm.map_or(0.0, f64::recip);
        let (mut sinking, shape, at) = (Sinking::default(), &body.shape, (body.x_mm, body.y_mm));
        // The rim of a touch moves from cell to cell, so that force has steps that come from the grid alone: the mean over
        // points within a cell removes them.
        let mut forces = |depth: f64| -> Result<f64> {
            sinking.find(layer, &[(shape, at, depth)]);
            // With many cells the rim is a small part: one point is enough.
            let many = sinking.cells.len() > MOST_SWEPT;
            let points = if many { &POINTS[4..5] } else { &POINTS[..] };
            let mut sum = 0.0;
            for (right, down) in points {
                let point = (at.0 + (right - 0.5) * layer.pitch_mm(), at.1 + (down - 0.5) * layer.pitch_mm());
                sinking.find(layer, &[(shape, point, depth)]);
                if !many {
                    layer.forget();
                }
                let pressure: f64 = layer.press(&sinking.cells, stop)?.iter().sum();
                sum += pressure * layer.area_mm2();
            }
            Ok(sum / points.len() as f64)
        };
        let depth = |k: usize| foam.floor_mm() * (k as f64 / (DEPTHS - 1) as f64).powi(2);
        let force =
            (0..DEPTHS).map(|k| if k == 0 { Ok(0.0) } else { forces(depth(k)) }).collect::<Result<Vec<f64>>>()?;
        let mut entries = vec![[0.0; 3]];
        for k in 1..DEPTHS {
            // Force is nearly a power of depth, so that the mean of its logarithm over neighbours adds little bias.
            let around = SMOOTH.min(k - 1).min(DEPTHS - 1 - k);
            let logs: f64 = (k - around..=k + around).map(|n| force[n].max(f64::MIN_POSITIVE).ln()).sum();
            let smooth = if force[k - around] > 0.0 { (logs / (2 * around + 1) as f64).exp() } else { force[k] };
            // Force never falls with depth.
            let smooth = smooth.max(entries[k - 1][2]);
            entries.push([depth(k) + give * smooth, depth(k), smooth]);
        }
        Ok(Self { entries })
    }

    /// Force, N, and how it grows, N/mm, of a body that has come down so far.
    #[must_use]
    pub fn force(&self, down_mm: f64) -> (f64, f64) {
        if down_mm <= 0.0 {
            return (0.0, 0.0);
        }
        let entries = &self.entries;
        let ([from, _, low], [to, _, high]) = around(entries, 0, down_mm);
        let share = ((down_mm - from) / (to - from)).min(1.0);
        let after = entries.partition_point(|e| e[0] < down_mm).clamp(1, entries.len() - 1);
        // A dashpot's force depends on the slope, which therefore must not jump from entry to entry.
        let (before, next) = (slope(entries, after - 1), slope(entries, after));
        (low + (high - low) * share, before + (next - before) * share)
    }

    /// Force where the face lies at a depth, N.
    #[must_use]
    pub fn force_at_depth(&self, depth_mm: f64) -> f64 {
        self.force(self.down_of_depth_mm(depth_mm)).0
    }

    /// Depth of the body's face in the foam at a displacement, mm; equal to the displacement above the foam.
    #[must_use]
    pub fn depth_mm(&self, down_mm: f64) -> f64 {
        if down_mm <= 0.0 {
            return down_mm;
        }
        let ([from, low, _], [to, high, _]) = around(&self.entries, 0, down_mm);
        low + (high - low) * ((down_mm - from) / (to - from)).min(1.0)
    }

    /// How far down a force holds the body, mm.
    #[must_use]
    pub fn down_mm(&self, force_n: f64) -> f64 {
        let ([from, _, low], [to, _, high]) = around(&self.entries, 2, force_n);
        if high > low { from + (to - from) * ((force_n - low) / (high - low)).clamp(0.0, 1.0) } else { to }
    }

    /// How far down a body's middle is whose face lies at a depth, mm.
    #[must_use]
    pub fn down_of_depth_mm(&self, depth_mm: f64) -> f64 {
        let ([from, low, _], [to, high, _]) = around(&self.entries, 1, depth_mm);
        from + (to - from) * ((depth_mm - low) / (high - low)).clamp(0.0, 1.0)
    }

    /// How far down a body is that has gone through all of the foam, mm.
    #[must_use]
    pub fn floor_mm(&self) -> f64 {
        self.entries[self.entries.len() - 1][0]
    }
}

/// How force grows at an entry, N/mm: over both sides of it.
fn slope(entries: &[[f64; 3]], k: usize) -> f64 {
    let (before, after) = (entries[k.saturating_sub(1)], entries[(k + 1).min(entries.len() - 1)]);
    (after[2] - before[2]) / (after[0] - before[0])
}

/// The entries between which a value of one column lies; the last two beyond them.
fn around(entries: &[[f64; 3]], column: usize, value: f64) -> ([f64; 3], [f64; 3]) {
    let after = entries.partition_point(|e| e[column] < value).clamp(1, entries.len() - 1);
    (entries[after - 1], entries[after])
}

/// Which cells bodies have sunk into, and whose each is.
#[derive(Debug, Default)]
pub(super) struct Sinking {
    pub cells: Vec<Cell>,
    pub whose: Vec<u32>,
    /// By cell of the grid: how far, and whose.
    grid: Vec<(f64, u32)>,
}

impl Sinking {
    /// Finds them of bodies given by shape, position of the middle and depth of the lowest point, all in mm.
    pub fn find(&mut self, layer: &Bonded, bodies: &[(&BodyShape, (f64, f64), f64)]) {
        let (rows, columns) = layer.shape();
        let nothing = (f64::NEG_INFINITY, 0);
        self.grid.resize(rows * columns, nothing);
        let (mut left, mut right, mut top, mut bottom) = (columns, 0, rows, 0);
        for (n, (shape, (x, y), depth)) in bodies.iter().enumerate() {
            if *depth <= 0.0 {
                continue;
            }
            let above = -layer.bulge() * depth;
            let (rx, ry) = shape.reach_mm(depth - above);
            let across = layer.between(x - rx, x + rx, columns);
            for row in layer.between(y - ry, y + ry, rows) {
                for column in across.clone() {
                    let height = shape.height_mm(layer.cell_mm(column) - x, layer.cell_mm(row) - y);
                    let at = &mut self.grid[row * columns + column];
                    if depth - height > above.max(at.0) {
                        *at = (depth - height, n as u32);
                    }
                }
                (top, bottom) = (top.min(row), bottom.max(row + 1));
            }
            (left, right) = (left.min(across.start), right.max(across.end));
        }
        self.cells.clear();
        self.whose.clear();
        for y in top..bottom {
            for x in left..right {
                let at = &mut self.grid[y * columns + x];
                if at.0 > f64::NEG_INFINITY {
                    self.cells.push(Cell { x: x as u32, y: y as u32, sunk_mm: at.0 });
                    self.whose.push(at.1);
                    *at = nothing;
                }
            }
        }
    }
}
