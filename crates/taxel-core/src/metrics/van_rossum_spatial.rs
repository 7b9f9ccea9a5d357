//! The thesis' distance between patterns of an array: smoothed by an exponential in time and in the distance of taxels.

use serde::{Deserialize, Serialize};

use super::merged::merge_spikes;
use super::patterns::{Pattern, Two};
use super::van_rossum::Normalisation;
use crate::allowed::{Range, ranges};
use crate::parameters::Described;
use crate::{Array, Result, Stop, problem};

/// The Euclidean distance between two patterns smoothed in time and over the array: 5.12 as the norm that 5.10 names.
///
/// `g_m = f_m + sum over n of f_n exp(-d_mn / sigma)` (5.11), where `f_n` is train n smoothed as in 5.8 and `d_mn` the
/// distance of taxels m and n. Train n belongs to taxel n of the array; with several layers of trains (ON and OFF) each
/// is smoothed alone. The distance is the root of the sum over taxels of the integral over all time of
/// `(g_m(a) - g_m(b))^2`, in closed form: between spikes all differences are one exponential. Time O(spikes x taxels).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VanRossumSpatial {
    /// Time constant, ms; 0.4 in the thesis.
    #[serde(default = "thesis_tau")]
    pub tau: f64,
    /// Spatial constant, mm; 2 in the thesis.
    #[serde(default = "thesis_sigma")]
    pub sigma: f64,
    /// The positions of the taxels.
    pub array: Array,
    /// The number of times that a train counts at its own taxel.
    #[serde(default)]
    pub own_train: OwnTrain,
    /// The divisor of the integral.
    #[serde(default)]
    pub normalisation: Normalisation,
}

fn thesis_tau() -> f64 {
    0.4
}

fn thesis_sigma() -> f64 {
    2.0
}

/// The number of times that a train counts at its own taxel.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OwnTrain {
    /// As the first term and in the sum, at distance 0: 5.11 as printed.
    #[default]
    Twice,
    /// In the sum only.
    Once,
}

impl VanRossumSpatial {
    ranges! {
        tau: "ms", Range::ABOVE_0;
        sigma: "mm", Range::ABOVE_0;
    }

    /// The parameters with their defaults and ranges.
    #[must_use]
    pub fn described() -> Described {
        let defaults = serde_json::json!({
            "tau": thesis_tau(),
            "sigma": thesis_sigma(),
            "own_train": OwnTrain::default(),
            "normalisation": Normalisation::default(),
        });
        Described { required: vec!["array"], ..Described::by(&defaults, &[], Self::RANGES) }
    }

    pub(super) fn check(&self) -> Result<()> {
        self.check_ranges()?;
        self.array.check()?;
        self.array.pitch("the distance over the array").map(|_| ())
    }

    /// The kernel for these patterns; each train must have a taxel in the array.
    pub(super) fn kernel(&self, two: &Two<'_>) -> Result<SmoothingKernel> {
        let taxels = self.array.len();
        for side in [two.rows, two.columns] {
            if side.trains % taxels != 0 {
                return Err(problem!(
                    "{} has {} trains, but the array has {taxels} taxels: must be one train per taxel (or several for each)",
                    side.name,
                    side.trains
                ));
            }
            let Some(exists) = &self.array.exists else { continue };
            for (p, n) in (0..side.count).flat_map(|p| (0..side.trains).map(move |n| (p, n))) {
                if !exists[n % taxels] && !side.train(p, n).is_empty() {
                    return Err(problem!(
                        "{}: has spikes, but the array has no taxel at this place",
                        side.train_name(p, n)
                    ));
                }
            }
        }
        SmoothingKernel::new(self)
    }

    /// The distance between two patterns.
    pub(super) fn between(
        &self,
        kernel: &SmoothingKernel,
        a: Pattern<'_>,
        b: Pattern<'_>,
        stop: Stop<'_>,
    ) -> Result<f64> {
        Ok(self.normalisation.root(kernel.square(self.tau, a, b, stop)?, self.tau))
    }
}

/// The contribution of each taxel's spikes to every taxel's smoothed train.
pub(super) struct SmoothingKernel {
    rows: usize,
    columns: usize,
    exists: Option<Vec<bool>>,
    /// The contributions by offset, from row -(rows - 1) and column -(columns - 1) on: those of taxel n to one row of
    /// the array are consecutive.
    by_offset: Vec<f64>,
}

/// Heights are stored in units that grow with time, and rescaled when the power exceeds this.
const HIGHEST: f64 = 200.0;

impl SmoothingKernel {
    fn new(smoothing: &VanRossumSpatial) -> Result<Self> {
        let array = &smoothing.array;
        let pitch = array.pitch("the distance over the array")?;
        // In units of the columns' pitch.
        let down = pitch.rows / pitch.columns;
        let (rows, columns) = (usize::from(array.rows), usize::from(array.columns));
        let mut by_offset = Vec::with_capacity((2 * rows - 1) * (2 * columns - 1));
        for row in 0..2 * rows - 1 {
            for column in 0..2 * columns - 1 {
                let (dy, dx) = (row.abs_diff(rows - 1) as f64, column.abs_diff(columns - 1) as f64);
                let is_own = row + 1 == rows && column + 1 == columns && smoothing.own_train == OwnTrain::Twice;
                by_offset
                    .push((-dx.hypot(dy * down) * pitch.columns / smoothing.sigma).exp() + f64::from(u8::from(is_own)));
            }
        }
        Ok(Self { rows, columns, exists: array.exists.clone(), by_offset })
    }

    fn taxels(&self) -> usize {
        self.rows * self.columns
    }

    /// The contributions of a spike of taxel `n` to the taxels of row `row`.
    fn reach(&self, n: usize, row: usize) -> &[f64] {
        let (y, x) = (n / self.columns, n % self.columns);
        let start = (row + self.rows - 1 - y) * (2 * self.columns - 1) + self.columns - 1 - x;
        &self.by_offset[start..start + self.columns]
    }

    /// The squared distance between two patterns, in units of tau / 2: the sum over taxels of the squared differences at
    /// the beginning of each interval between steps, and of the time after the last one, by what the interval takes off.
    fn square(&self, tau: f64, (a, p): Pattern<'_>, (b, q): Pattern<'_>, stop: Stop<'_>) -> Result<f64> {
        let mut steps: Vec<(f64, usize, f64)> = Vec::new();
        for n in 0..a.trains {
            steps.extend(merge_spikes(a.train(p, n), b.train(q, n)).map(|(t, more)| (t, n, more)));
        }
        steps.sort_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
        // The difference at taxel m is `heights[m] exp(-(t - since) / tau)`.
        let mut heights = vec![0.0; a.trains];
        let mut since = steps.first().map_or(0.0, |&(t, ..)| t);
        let (mut square, mut sum, mut last) = (0.0, 0.0, since);
        for group in steps.chunk_by(|x, y| x.0 == y.0) {
            stop.check()?;
            let t = group[0].0;
            square -= sum * (-2.0 * (t - last) / tau).exp_m1();
            if (t - since) / tau > HIGHEST {
                let fallen = (-(t - since) / tau).exp();
                heights.iter_mut().for_each(|h| *h *= fallen);
                since = t;
            }
            let risen = ((t - since) / tau).exp();
            for &(_, n, more) in group {
                self.add(&mut heights, n, more * risen);
            }
            sum = self.total(&heights) / (risen * risen);
            last = t;
        }
        Ok(square + sum)
    }

    fn add(&self, heights: &mut [f64], n: usize, value: f64) {
        let layer = n / self.taxels();
        let n = n % self.taxels();
        let heights = &mut heights[layer * self.taxels()..(layer + 1) * self.taxels()];
        for (row, heights) in heights.chunks_exact_mut(self.columns).enumerate() {
            for (height, reach) in heights.iter_mut().zip(self.reach(n, row)) {
                *height += value * reach;
            }
        }
    }

    /// The sum of the squares of existing taxels.
    fn total(&self, heights: &[f64]) -> f64 {
        if let Some(exists) = &self.exists {
            return heights.iter().zip(exists.iter().cycle()).filter(|(_, exists)| **exists).map(|(&h, _)| h * h).sum();
        }
        // Eight independent sums, because a single sum would wait for each addition.
        let (eights, rest) = heights.as_chunks::<8>();
        let mut sums = [0.0; 8];
        for eight in eights {
            for (sum, &h) in sums.iter_mut().zip(eight) {
                *sum += h * h;
            }
        }
        sums.iter().sum::<f64>() + rest.iter().map(|&h| h * h).sum::<f64>()
    }
}
