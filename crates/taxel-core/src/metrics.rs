//! Distances between spike trains, and between patterns of many trains.
//!
//! A metric is a value of [`Metric`]; [`Metric::distance`] compares two patterns, [`Metric::pairwise`] computes
//! matrices. A distance between two trains becomes one between patterns as the sum over trains of the same index; the
//! metrics with `spatial` or `multi_unit` in their names compare different trains too.

mod edges;
mod law;
pub mod matching;
mod merged;
mod pairwise;
mod patterns;
mod stored;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

pub use pairwise::Work;
pub use patterns::Patterns;
pub use van_rossum::Normalisation;
pub use van_rossum_spatial::{OwnTrain, Smoothing};

use law::{Law, Ready};
use pairwise::Matrix;

use crate::parameters::Described;
use crate::reading::{self, Unfit};
use crate::{Error, Result, Stop, problem};

/// The registry: one line per metric, `NAME: Kind`; the metric's file is `metrics/NAME.rs`, and its name in JSON is
/// `NAME`.
macro_rules! metrics {
    ($($(#[$about:meta])* $name:ident: $Kind:ident,)*) => {
        $(mod $name;)*
        $(pub use $name::$Kind;)*

        /// A distance with its parameters.
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
        #[serde(tag = "name", rename_all = "snake_case")]
        pub enum Metric {
            $($(#[$about])* $Kind($Kind),)*
        }

        /// The names of all metrics, as in JSON.
        pub const NAMES: &[&str] = &[$(stringify!($name)),*];

        impl Metric {
            fn law(&self) -> &dyn Law {
                match self { $(Self::$Kind(metric) => metric,)* }
            }

            /// Parses the parameters of the metric with this name; none if there is no such metric.
            fn read(name: &str, parameters: Value) -> Option<std::result::Result<Self, Unfit>> {
                $(if name == stringify!($name) {
                    return Some(reading::from_value(parameters).map(Self::$Kind));
                })*
                None
            }

            /// The parameters of a metric, by its name, with their defaults and ranges.
            #[must_use]
            pub fn described(name: &str) -> Option<Described> {
                $(if name == stringify!($name) {
                    return Some($Kind::described());
                })*
                None
            }
        }
    };
}

// Rustfmt does not find modules in a macro, so the Makefile passes it their files.
metrics! {
    /// The minimal cost of transforming one train into the other.
    victor_purpura: VictorPurpura,
    /// The minimal cost of the transformation if a spike may also change its train.
    victor_purpura_multi_unit: VictorPurpuraMultiUnit,
    /// Euclidean distance of trains smoothed by an exponential.
    van_rossum: VanRossum,
    /// Time integral, or sum, of the absolute difference of trains smoothed by an exponential.
    van_rossum_absolute: VanRossumAbsolute,
    /// Euclidean distance of patterns smoothed in time and over the array.
    van_rossum_spatial: VanRossumSpatial,
    /// Sum over taxels and time of the absolute difference of patterns smoothed in time and over the array.
    van_rossum_spatial_absolute: VanRossumSpatialAbsolute,
    /// The difference between interspike intervals.
    isi_distance: IsiDistance,
    /// The distance of spikes from their nearest ones in the other train, relative to the interspike intervals.
    spike_distance: SpikeDistance,
}

impl Metric {
    /// Parses a metric from JSON: an object whose `name` selects the metric.
    ///
    /// # Errors
    ///
    /// `Problem`, naming the parameter.
    pub fn from_json(json: &str) -> Result<Self> {
        let mut given: Map<String, Value> =
            reading::from_text(json).map_err(|unfit| Error::Problem(unfit.of("metric")))?;
        let name = given.remove("name").unwrap_or_default();
        let name = name.as_str().unwrap_or_default();
        let Some(Described { defaults, required, .. }) = Self::described(name) else {
            let names: Vec<String> = NAMES.iter().map(|name| format!("'{name}'")).collect();
            return Err(problem!("metric is '{name}': must be one of {}", names.join(", ")));
        };
        // A metric can contain another metric's parameters, whose deserialiser would accept unknown names.
        let known: Vec<&str> = required.iter().copied().chain(defaults.keys().map(String::as_str)).collect();
        if let Some(unknown) = given.keys().find(|key| !known.contains(&key.as_str())) {
            return Err(problem!("{unknown}: {name} takes {}", known.join(", ")));
        }
        Self::read(name, given.into())
            .ok_or_else(|| problem!("metric {name}: cannot be read"))?
            .map_err(|unfit| Error::Problem(unfit.of(name)))
    }

    /// Checks every parameter.
    ///
    /// # Errors
    ///
    /// `Problem`, naming the parameter.
    pub fn check(&self) -> Result<()> {
        self.law().check()
    }

    /// The distance between two patterns (the first of each side).
    ///
    /// # Errors
    ///
    /// `Problem` if parameters or times are not valid, or if the numbers of trains differ; `Interrupted`.
    pub fn distance(&self, a: &Patterns<'_>, b: &Patterns<'_>, stop: Stop<'_>) -> Result<f64> {
        self.prepare(a, Some(b))?.between((a, 0), (b, 0), stop)
    }

    /// The distances of all patterns of `a` from all of `b`, row by row; without `b` the distances among those of `a`.
    ///
    /// # Errors
    ///
    /// As [`Self::distance`].
    pub fn pairwise(&self, a: &Patterns<'_>, b: Option<&Patterns<'_>>, work: &mut Work<'_>) -> Result<Vec<f64>> {
        let ready = self.prepare(a, b)?;
        let matrix = Matrix::new(a.count, b.map(|b| b.count));
        match ready.fill(&matrix, a, b, work) {
            Some(filled) => filled?,
            None => matrix.each_pair(work, |i, j, stop| ready.between((a, i), (b.unwrap_or(a), j), stop))?,
        }
        Ok(matrix.finish())
    }

    /// Checks parameters and patterns, and computes what all pairs share.
    fn prepare(&self, a: &Patterns<'_>, b: Option<&Patterns<'_>>) -> Result<Box<dyn Ready + '_>> {
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
        self.law().ready(a, b)
    }
}
