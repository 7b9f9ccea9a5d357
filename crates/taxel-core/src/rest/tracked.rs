//! The rest of a sensor whose rest was not measured: found in a quiet stretch, and tracked from there on.
//!
//! A taxel's rest is held ([`Baseline::freeze`]) once it is known, so that a press that is held for long stays one: from a
//! given rest on; where none is given, from the first quiet stretch on; and from where it is set anew.
//!
//! Reading: a stretch is quiet if no taxel was further from its mean than the tracked rest calls far; on a grid, if no
//! three of nine neighbours were, so that bad taxels, which move alone or in pairs, do not count. It can be that of a
//! load that does not move: a taxel that lies far below its rest for a whole quiet stretch was loaded before, and its
//! rest is set anew.

use std::collections::HashMap;

use super::baseline::{Baseline, FAR_NOISE, stands_out_from};
use super::value::Value;

/// The shortest quiet stretch, us.
pub const QUIET_US: i64 = 500_000;

/// Number of taxels among a taxel and its 8 neighbours that a touch moves at least, on a grid.
pub const TOUCHED_TOGETHER: usize = 3;

/// The fewest samples of a quiet stretch: fewer do not show that it was quiet. At 4 Hz or less they take longer.
const LEAST_SAMPLES: u32 = 4;

/// The stretch being measured: statistics of each taxel's values less the first one.
#[derive(Debug, Clone, PartialEq)]
struct RestStretch {
    from: i64,
    samples: u32,
    first: Vec<f32>,
    least: Vec<f32>,
    greatest: Vec<f32>,
    sums: Vec<f32>,
    squares: Vec<f32>,
}

impl RestStretch {
    fn new(from: i64, first: &[f32]) -> Self {
        let zeros = || vec![0.0; first.len()];
        let (least, greatest, sums, squares) = (zeros(), zeros(), zeros(), zeros());
        Self { from, samples: 1, first: first.to_vec(), least, greatest, sums, squares }
    }

    fn take(&mut self, values: &[f32]) {
        self.samples += 1;
        for (taxel, value) in values.iter().enumerate() {
            let change = value - self.first[taxel];
            self.least[taxel] = self.least[taxel].min(change);
            self.greatest[taxel] = self.greatest[taxel].max(change);
            self.sums[taxel] += change;
            self.squares[taxel] += change * change;
        }
    }

    /// A taxel that has no value before this one had it throughout.
    fn begin(&mut self, taxel: usize, value: f32) {
        self.first[taxel] = value;
    }

    fn mean(&self, taxel: usize) -> f64 {
        f64::from(self.first[taxel]) + f64::from(self.sums[taxel] / self.samples as f32)
    }

    /// The median of the taxels' standard deviations on a grid, where a touch moves few of them; 0 for channels, each of
    /// which a load may move. A taxel without a value so far did not move.
    fn noise(&self, grid: TaxelGrid) -> f64 {
        let n = self.samples as f32;
        let variance = |(sum, squares): (&f32, &f32)| (squares - sum * sum / n).max(0.0) / n;
        let mut all: Vec<f32> = self.sums.iter().zip(&self.squares).map(variance).collect();
        if grid.is_channels() {
            return 0.0;
        }
        f64::from(*all.select_nth_unstable_by(grid.taxels / 2, f32::total_cmp).1).sqrt()
    }

    /// Whether it was quiet: see the module.
    fn is_quiet(&self, far: f64, known: &[bool], grid: TaxelGrid) -> bool {
        let moved = |taxel: usize| {
            let mean = self.mean(taxel) - f64::from(self.first[taxel]);
            known[taxel] && (f64::from(self.greatest[taxel]) - mean).max(mean - f64::from(self.least[taxel])) >= far
        };
        let mut moved = (0..known.len()).filter(|&taxel| moved(taxel));
        if grid.is_channels() {
            return moved.next().is_none();
        }
        let mut near = HashMap::new();
        for taxel in moved {
            for neighbour in grid.around(taxel, 1) {
                let together = near.entry(neighbour).or_insert(0);
                *together += 1;
                if *together >= TOUCHED_TOGETHER {
                    return false;
                }
            }
        }
        true
    }
}

/// An array of so many taxels in so many columns.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct TaxelGrid {
    pub taxels: usize,
    pub columns: usize,
}

impl TaxelGrid {
    /// Whether it is channels, in which no taxel has neighbours all around it.
    fn is_channels(self) -> bool {
        self.columns == 1 || self.taxels <= self.columns
    }

    /// A taxel and those up to `reach` rows and columns away.
    pub fn around(self, taxel: usize, reach: usize) -> impl Iterator<Item = usize> {
        let (row, column) = (taxel / self.columns, taxel % self.columns);
        let (top, bottom) = (row.saturating_sub(reach), (row + reach + 1).min(self.taxels / self.columns));
        let (left, right) = (column.saturating_sub(reach), (column + reach + 1).min(self.columns));
        (top..bottom).flat_map(move |y| (left..right).map(move |x| y * self.columns + x))
    }
}

/// The rest of each taxel, tracked as [`Baseline::tracked`] does and held once it is known; before the first quiet
/// stretch, from the taxels' first values on.
#[derive(Debug, Clone, PartialEq)]
pub struct TrackedRest {
    grid: TaxelGrid,
    noise_floor: f64,
    baseline: Baseline,
    /// The values to read: those of taxels without a value are their rest.
    values: Vec<f32>,
    /// Whether a taxel had a value so far, or its rest was given.
    known: Vec<bool>,
    /// Whether the rest of any taxel was given: then the quiet stretch found none of the others, which were loaded.
    rest_given: bool,
    stretch: Option<RestStretch>,
    far: f64,
    /// The first quiet stretch, us.
    quiet: Option<(i64, i64)>,
    /// The rest of each taxel in its first quiet stretch; [`Value::NO_REST`] before it.
    begins: Vec<f64>,
}

impl TrackedRest {
    /// The rest of an array with so many `columns`, from `begins` on ([`Value::NO_REST`] if unknown); `noise_floor` in
    /// the sensor's unit.
    #[must_use]
    pub fn new(columns: usize, noise_floor: f64, begins: Vec<f64>) -> Self {
        let n = begins.len();
        let far = stands_out_from(FAR_NOISE, 0.0, noise_floor);
        let known: Vec<bool> = begins.iter().map(|&rest| rest != f64::NO_REST).collect();
        let rest = begins.into_iter().map(|rest| if rest == f64::NO_REST { 0.0 } else { rest }).collect();
        let mut baseline = Baseline::tracked(rest, vec![far as f32; n]);
        (0..n).filter(|&taxel| known[taxel]).for_each(|taxel| baseline.freeze(taxel));
        let rest_given = known.contains(&true);
        let (grid, begins) = (TaxelGrid { taxels: n, columns: columns.max(1) }, vec![f64::NO_REST; n]);
        let values = vec![0.0; n];
        let (stretch, quiet) = (None, None);
        Self { grid, noise_floor, baseline, values, known, rest_given, stretch, far, quiet, begins }
    }

    /// Reads the next values, at `t` us, NaN for a taxel without one; returns them above the rest (negative below it).
    pub fn take(&mut self, t: i64, values: impl IntoIterator<Item = f32>) -> &[f32] {
        for (taxel, value) in values.into_iter().enumerate().take(self.known.len()) {
            if value.is_nan() {
                self.values[taxel] = self.baseline.values()[taxel] as f32;
                continue;
            }
            self.values[taxel] = value;
            if !self.known[taxel] {
                self.begin(taxel, value);
            }
        }
        match &mut self.stretch {
            Some(stretch) if stretch.from <= t => stretch.take(&self.values),
            _ => self.stretch = Some(RestStretch::new(t, &self.values)),
        }
        self.baseline.take(t, &self.values);
        let is_long = |stretch: &RestStretch| t - stretch.from >= QUIET_US && stretch.samples >= LEAST_SAMPLES;
        if self.stretch.as_ref().is_some_and(is_long) {
            self.end_stretch(t);
        }
        self.baseline.above()
    }

    /// Makes a taxel's first value its rest; [`TrackedRest::take`] does so for a taxel without a rest.
    pub fn begin(&mut self, taxel: usize, value: f32) {
        self.known[taxel] = true;
        self.baseline.begin(taxel, value.into());
        if let Some(stretch) = &mut self.stretch {
            stretch.begin(taxel, value);
        }
    }

    /// Ends the stretch at `t`: a quiet one sets rests.
    fn end_stretch(&mut self, t: i64) {
        let next = RestStretch::new(t, &self.values);
        let Some(stretch) = self.stretch.replace(next) else { return };
        // Noise above the noise floor would be events without end: a load that moves is no noise.
        let noise = stretch.noise(self.grid).min(self.noise_floor);
        let far = stands_out_from(FAR_NOISE, noise, self.noise_floor);
        let any = self.known.contains(&true);
        if !any || !stretch.is_quiet(far, &self.known, self.grid) {
            return;
        }
        let first = self.quiet.is_none();
        if first {
            self.quiet = Some((stretch.from, t));
        }
        if far != self.far {
            self.far = far;
            (0..self.known.len()).for_each(|taxel| self.baseline.set_far(taxel, far as f32));
        }
        for taxel in 0..self.known.len() {
            if !self.known[taxel] {
                continue;
            }
            let (mean, rest) = (stretch.mean(taxel), self.baseline.values()[taxel]);
            let load = mean - rest;
            let released = load <= -far;
            if released || first && load < far {
                self.baseline.set(taxel, mean);
            }
            if released || !self.rest_given {
                self.baseline.freeze(taxel);
            }
            let (rest, begins) = (self.baseline.values()[taxel], &mut self.begins[taxel]);
            if *begins == f64::NO_REST {
                *begins = rest;
            } else if released {
                *begins = begins.min(rest);
            }
        }
    }

    /// The rest of each taxel; `None` for one without any value so far.
    pub fn rests(&self) -> impl Iterator<Item = Option<f64>> {
        self.baseline.values().iter().zip(&self.known).map(|(&rest, &known)| known.then_some(rest))
    }

    /// The first quiet stretch so far, us.
    #[must_use]
    pub fn quiet(&self) -> Option<(i64, i64)> {
        self.quiet
    }

    /// The rest of each taxel in its first quiet stretch, or in a later one in which it was released: from where to track
    /// a recording that is read again; [`Value::NO_REST`] for a taxel without any.
    #[must_use]
    pub fn begins(&self) -> &[f64] {
        &self.begins
    }
}
