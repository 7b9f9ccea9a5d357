//! Distances between spike trains, and between patterns of many trains.
//!
//! A metric is a value of [`Metric`]; [`Metric::distance`] takes two patterns, [`Metric::pairwise`] makes matrices. A
//! distance between two trains becomes one between patterns as the sum over trains of the same number; the metrics with
//! `spatial` or `multi_unit` in their names know of the other trains themselves.

mod edges;
mod isi_distance;
mod merged;
mod pairwise;
mod patterns;
mod spike_distance;
mod stored;
mod van_rossum;
mod van_rossum_absolute;
mod van_rossum_spatial;
mod van_rossum_spatial_absolute;
mod victor_purpura;
mod victor_purpura_multi_unit;

use serde::{Deserialize, Serialize};

pub use isi_distance::IsiDistance;
pub use pairwise::Work;
pub use patterns::Patterns;
pub use spike_distance::SpikeDistance;
pub use van_rossum::{Normalisation, VanRossum};
pub use van_rossum_absolute::VanRossumAbsolute;
pub use van_rossum_spatial::{OwnTrain, Smoothing, VanRossumSpatial};
pub use van_rossum_spatial_absolute::VanRossumSpatialAbsolute;
pub use victor_purpura::VictorPurpura;
pub use victor_purpura_multi_unit::VictorPurpuraMultiUnit;

use crate::vectors::Instructions;
use crate::{Result, Stop, problem};
use pairwise::Matrix;

/// A distance with its parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "name", rename_all = "snake_case")]
pub enum Metric {
    /// The cheapest way to turn one train into the other.
    VictorPurpura(VictorPurpura),
    /// The same where a spike may also change its train.
    VictorPurpuraMultiUnit(VictorPurpuraMultiUnit),
    /// Euclidean distance of trains smoothed by an exponential.
    VanRossum(VanRossum),
    /// Time integral, or sum, of the absolute difference of trains smoothed by an exponential.
    VanRossumAbsolute(VanRossumAbsolute),
    /// Euclidean distance of patterns smoothed in time and over the array.
    VanRossumSpatial(VanRossumSpatial),
    /// Sum over taxels and time of the absolute difference of patterns smoothed in time and over the array.
    VanRossumSpatialAbsolute(VanRossumSpatialAbsolute),
    /// How much the intervals between spikes differ.
    IsiDistance(IsiDistance),
    /// How far spikes are from their nearest ones, over the intervals between spikes.
    SpikeDistance(SpikeDistance),
}

impl Metric {
    /// Checks every parameter.
    ///
    /// # Errors
    ///
    /// `Problem`, naming the parameter.
    pub fn check(&self) -> Result<()> {
        match self {
            Self::VictorPurpura(m) => m.check(),
            Self::VictorPurpuraMultiUnit(m) => m.check(),
            Self::VanRossum(m) => m.check(),
            Self::VanRossumAbsolute(m) => m.check(),
            Self::VanRossumSpatial(m) => m.check(),
            Self::VanRossumSpatialAbsolute(m) => m.check(),
            Self::IsiDistance(m) => m.check(),
            Self::SpikeDistance(m) => m.check(),
        }
    }

    /// The distance between two patterns (the first of each side).
    ///
    /// # Errors
    ///
    /// `Problem` for parameters or times that make no sense, or another number of trains; `Interrupted`.
    pub fn distance(&self, a: &Patterns<'_>, b: &Patterns<'_>, stop: Stop<'_>) -> Result<f64> {
        self.prepare(a, Some(b))?.between((a, 0), (b, 0), stop)
    }

    /// The distances of all patterns of `a` from all of `b`, row by row; without `b` from each other.
    ///
    /// # Errors
    ///
    /// As [`Self::distance`].
    pub fn pairwise(&self, a: &Patterns<'_>, b: Option<&Patterns<'_>>, work: &mut Work<'_>) -> Result<Vec<f64>> {
        let ready = self.prepare(a, b)?;
        let matrix = Matrix::new(a.count, b.map(|b| b.count));
        match &ready {
            Ready::VictorPurpura(m) if m.has_reach() && work.instructions != Instructions::Plain => {
                m.fill(&matrix, a, b, work)?
            }
            Ready::VanRossum(m) => m.fill(&matrix, a, b, work)?,
            Ready::VanRossumSpatial(m, kernel) => m.fill(kernel, &matrix, a, b, work)?,
            _ => matrix.each_pair(work, |i, j, stop| ready.between((a, i), (b.unwrap_or(a), j), stop))?,
        }
        Ok(matrix.finish())
    }

    /// Checks parameters and patterns; works out what all pairs share.
    fn prepare(&self, a: &Patterns<'_>, b: Option<&Patterns<'_>>) -> Result<Ready<'_>> {
        self.check()?;
        a.check()?;
        if let Some(b) = b {
            b.check()?;
            if b.trains != a.trains {
                return Err(problem!(
                    "{} has {} trains, {} has {}: must be equally many",
                    a.name,
                    a.trains,
                    b.name,
                    b.trains
                ));
            }
        }
        Ok(match self {
            Self::VictorPurpura(m) => Ready::VictorPurpura(m),
            Self::VictorPurpuraMultiUnit(m) => Ready::VictorPurpuraMultiUnit(m),
            Self::VanRossum(m) => Ready::VanRossum(m),
            Self::VanRossumAbsolute(m) => Ready::VanRossumAbsolute(m),
            Self::VanRossumSpatial(m) => Ready::VanRossumSpatial(m, m.smoothing.laid_out(a, b)?),
            Self::VanRossumSpatialAbsolute(m) => Ready::VanRossumSpatialAbsolute(m, m.smoothing.laid_out(a, b)?),
            Self::IsiDistance(m) => Ready::IsiDistance(edges::window(m.window, a, b)?),
            Self::SpikeDistance(m) => Ready::SpikeDistance(edges::window(m.window, a, b)?),
        })
    }
}

/// A metric with what all pairs share.
enum Ready<'m> {
    VictorPurpura(&'m VictorPurpura),
    VictorPurpuraMultiUnit(&'m VictorPurpuraMultiUnit),
    VanRossum(&'m VanRossum),
    VanRossumAbsolute(&'m VanRossumAbsolute),
    VanRossumSpatial(&'m VanRossumSpatial, van_rossum_spatial::Kernel),
    VanRossumSpatialAbsolute(&'m VanRossumSpatialAbsolute, van_rossum_spatial::Kernel),
    IsiDistance(edges::Window),
    SpikeDistance(edges::Window),
}

/// A pattern: which of several.
type One<'p> = (&'p Patterns<'p>, usize);

impl Ready<'_> {
    /// The distance between two patterns.
    fn between(&self, a: One<'_>, b: One<'_>, stop: Stop<'_>) -> Result<f64> {
        match self {
            Self::VictorPurpura(m) => summed(a, b, stop, |a, b| m.between(a, b, stop)),
            Self::VictorPurpuraMultiUnit(m) => m.between(a, b, stop),
            Self::VanRossum(m) => summed(a, b, stop, |a, b| Ok(m.between(a, b))),
            Self::VanRossumAbsolute(m) => summed(a, b, stop, |a, b| Ok(m.between(a, b))),
            Self::VanRossumSpatial(m, kernel) => m.between(kernel, a, b, stop),
            Self::VanRossumSpatialAbsolute(m, kernel) => m.between(kernel, a, b, stop),
            Self::IsiDistance(window) => summed(a, b, stop, |a, b| Ok(isi_distance::between(a, b, *window))),
            Self::SpikeDistance(window) => summed(a, b, stop, |a, b| Ok(spike_distance::between(a, b, *window))),
        }
    }
}

/// The sum over trains of a distance between trains.
fn summed(
    (a, p): One<'_>,
    (b, q): One<'_>,
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

/// Refuses a cost below 0.
fn cost(name: &str, value: f64, unit: &str) -> Result<()> {
    if value >= 0.0 { Ok(()) } else { Err(problem!("{name} is {value}{unit}: must be 0 or more")) }
}

/// Reads a cost that may be infinite, which JSON has no number for: a number, or its name as text.
fn number_or_name<'de, D: serde::Deserializer<'de>>(deserializer: D) -> std::result::Result<f64, D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged)]
    enum Either {
        Number(f64),
        Name(String),
    }
    match Either::deserialize(deserializer)? {
        Either::Number(value) => Ok(value),
        Either::Name(name) => name.parse().map_err(serde::de::Error::custom),
    }
}
