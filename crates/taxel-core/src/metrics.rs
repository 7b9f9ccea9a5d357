//! Distances between spike trains, and between patterns of many trains.
//!
//! A metric is a value of [`Metric`]; [`Metric::distance`] takes two patterns, [`Metric::pairwise`] makes matrices. A
//! distance between two trains becomes one between patterns as the sum over trains of the same number; the metrics with
//! `spatial` or `multi_unit` in their names know of the other trains themselves.

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

/// The registry: a line a metric, `NAME: Kind`, whose file is `metrics/NAME.rs` and whose name in JSON is `NAME`.
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

        /// The names of all metrics, as JSON has them.
        pub const NAMES: &[&str] = &[$(stringify!($name)),*];

        impl Metric {
            fn law(&self) -> &dyn Law {
                match self { $(Self::$Kind(metric) => metric,)* }
            }

            /// Reads the parameters of the metric of a name; none if there is none of that name.
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

// Rustfmt finds no modules in a macro: the Makefile names their files to it.
metrics! {
    /// The cheapest way to turn one train into the other.
    victor_purpura: VictorPurpura,
    /// The same where a spike may also change its train.
    victor_purpura_multi_unit: VictorPurpuraMultiUnit,
    /// Euclidean distance of trains smoothed by an exponential.
    van_rossum: VanRossum,
    /// Time integral, or sum, of the absolute difference of trains smoothed by an exponential.
    van_rossum_absolute: VanRossumAbsolute,
    /// Euclidean distance of patterns smoothed in time and over the array.
    van_rossum_spatial: VanRossumSpatial,
    /// Sum over taxels and time of the absolute difference of patterns smoothed in time and over the array.
    van_rossum_spatial_absolute: VanRossumSpatialAbsolute,
    /// How much the intervals between spikes differ.
    isi_distance: IsiDistance,
    /// How far spikes are from their nearest ones, over the intervals between spikes.
    spike_distance: SpikeDistance,
}

impl Metric {
    /// Reads a metric from JSON: an object whose `name` says which.
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
        // A metric may hold another's parameters, whose reader would let unknown ones pass.
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
        match ready.fill(&matrix, a, b, work) {
            Some(filled) => filled?,
            None => matrix.each_pair(work, |i, j, stop| ready.between((a, i), (b.unwrap_or(a), j), stop))?,
        }
        Ok(matrix.finish())
    }

    /// Checks parameters and patterns; works out what all pairs share.
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
