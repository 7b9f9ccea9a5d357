//! Distances between spike trains, and between patterns of many trains.
//!
//! A metric is a value of [`Metric`]; [`Metric::distance`] compares two patterns, [`Metric::pairwise`] computes
//! matrices. A distance between trains is extended to patterns as the sum over trains with the same number; the metric
//! with `spatial` in its name uses other trains as well.

pub mod matching;
mod merged;
mod patterns;
mod van_rossum;
mod van_rossum_spatial;
mod victor_purpura;
mod work;

use std::sync::atomic::Ordering::Relaxed;

use rayon::prelude::*;
use serde_json::{Map, Value};

pub use patterns::Patterns;
pub use van_rossum::{Normalisation, VanRossum};
pub use van_rossum_spatial::{OwnTrain, VanRossumSpatial};
pub use victor_purpura::VictorPurpura;
pub use work::Work;

use patterns::{Pattern, Two};
use work::Running;

use crate::parameters::Described;
use crate::{Error, Result, Stop, problem, reading};

/// The names of all metrics in JSON; each has its file `metrics/NAME.rs`.
pub const NAMES: [&str; 3] = ["victor_purpura", "van_rossum", "van_rossum_spatial"];

/// A metric with its parameters.
#[derive(Debug, Clone, PartialEq)]
pub enum Metric {
    /// The least cost of turning one train into the other.
    VictorPurpura(VictorPurpura),
    /// Euclidean distance between trains smoothed by an exponential.
    VanRossum(VanRossum),
    /// Euclidean distance between patterns smoothed in time and over the array.
    VanRossumSpatial(VanRossumSpatial),
}

/// The distance between two patterns, with what all pairs share computed.
type Between<'m> = Box<dyn Fn(Pattern<'_>, Pattern<'_>, Stop<'_>) -> Result<f64> + Sync + 'm>;

impl Metric {
    /// The parameters of a metric with their defaults and ranges, by the metric's name.
    #[must_use]
    pub fn described(name: &str) -> Option<Described> {
        match name {
            "victor_purpura" => Some(VictorPurpura::described()),
            "van_rossum" => Some(VanRossum::described()),
            "van_rossum_spatial" => Some(VanRossumSpatial::described()),
            _ => None,
        }
    }

    /// Reads a metric from JSON: an object with the metric's `name`.
    ///
    /// # Errors
    ///
    /// `Problem`, naming the parameter.
    pub fn from_json(json: &str) -> Result<Self> {
        let mut parameters: Map<String, Value> = reading::from_text(json).map_err(|unfit| unfit.problem("metric"))?;
        let name = parameters.remove("name").unwrap_or_default();
        let name = name.as_str().unwrap_or_default();
        let parameters = Value::from(parameters);
        match name {
            "victor_purpura" => reading::from_value(parameters).map(Self::VictorPurpura),
            "van_rossum" => reading::from_value(parameters).map(Self::VanRossum),
            "van_rossum_spatial" => reading::from_value(parameters).map(Self::VanRossumSpatial),
            _ => {
                let names = NAMES.map(|name| format!("'{name}'")).join(", ");
                return Err(problem!("metric"; " is '{name}': must be one of {names}"));
            }
        }
        .map_err(|unfit| unfit.problem(name))
    }

    /// Checks every parameter.
    ///
    /// # Errors
    ///
    /// `Problem`, naming the parameter.
    pub fn check(&self) -> Result<()> {
        match self {
            Self::VictorPurpura(metric) => metric.check_ranges(),
            Self::VanRossum(metric) => metric.check_ranges(),
            Self::VanRossumSpatial(metric) => metric.check(),
        }
    }

    /// The distance between two patterns (the first of each side).
    ///
    /// # Errors
    ///
    /// `Problem` for parameters or times that are not valid, or different numbers of trains; `Interrupted`.
    pub fn distance(&self, a: &Patterns<'_>, b: &Patterns<'_>, stop: Stop<'_>) -> Result<f64> {
        self.prepare(&Two::new(a, Some(b)))?((a, 0), (b, 0), stop)
    }

    /// The distances of all patterns of `a` to all of `b`, row by row; without `b`, among the patterns of `a`.
    ///
    /// # Errors
    ///
    /// Those of [`Self::distance`]; `Problem` if the threads cannot be started.
    pub fn pairwise(&self, a: &Patterns<'_>, b: Option<&Patterns<'_>>, work: &mut Work<'_>) -> Result<Vec<f64>> {
        let two = Two::new(a, b);
        let between = self.prepare(&two)?;
        let mut distances = work.run(two.pairs(), |running| match self {
            Self::VictorPurpura(metric) if metric.q > 0.0 => metric.matrix(&two, running),
            Self::VanRossum(metric) => metric.matrix(&two, running),
            _ => pair_by_pair(&between, &two, running),
        })?;
        two.mirror(&mut distances);
        Ok(distances)
    }

    /// Checks parameters and patterns, and computes what all pairs share.
    fn prepare(&self, two: &Two<'_>) -> Result<Between<'_>> {
        self.check()?;
        two.check()?;
        Ok(match self {
            Self::VictorPurpura(metric) => {
                Box::new(|a, b, stop| sum_over_trains(a, b, stop, |a, b| metric.between(a, b, stop)))
            }
            Self::VanRossum(metric) => {
                Box::new(|a, b, stop| sum_over_trains(a, b, stop, |a, b| Ok(metric.between(a, b))))
            }
            Self::VanRossumSpatial(metric) => {
                let kernel = metric.kernel(two)?;
                Box::new(move |a, b, stop| metric.between(&kernel, a, b, stop))
            }
        })
    }
}

/// A matrix, one pair after the other.
fn pair_by_pair(between: &Between<'_>, two: &Two<'_>, running: &Running<'_>) -> Result<Vec<f64>> {
    let mut distances = two.zeros();
    distances.par_chunks_mut(two.width()).enumerate().try_for_each(|(i, row)| {
        for (j, cell) in row.iter_mut().enumerate().skip(two.first(i)) {
            running.stop.check()?;
            *cell = between((two.rows, i), (two.columns, j), running.stop)?;
            running.done.fetch_add(1, Relaxed);
        }
        Ok::<(), Error>(())
    })?;
    Ok(distances)
}

/// The sum over trains of a distance between trains.
fn sum_over_trains(
    (a, p): Pattern<'_>,
    (b, q): Pattern<'_>,
    stop: Stop<'_>,
    between: impl Fn(&[f64], &[f64]) -> Result<f64>,
) -> Result<f64> {
    let mut sum = 0.0;
    for n in 0..a.trains {
        stop.check()?;
        sum += between(a.train(p, n), b.train(q, n))?;
    }
    Ok(sum)
}
