//! Distances between spike trains, and between patterns of many trains.
//!
//! A metric is a value of [`Metric`]; [`Metric::distance`] compares two patterns, [`Metric::pairwise`] computes
//! matrices. A distance between trains is extended to patterns as the sum over trains with the same number; the metric
//! with `spatial` in its name uses other trains as well.

mod distance;
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

use distance::{Distance, Ready};
use pairwise::DistanceMatrix;

use crate::parameters::Described;
use crate::reading::{self, Unfit};
use crate::{Result, Stop, problem};

/// The registry: one line for each metric, `NAME: Kind`, with its file `metrics/NAME.rs` and `NAME` as its name in
/// JSON.
macro_rules! metrics {
    ($($(#[$about:meta])* $name:ident: $Kind:ident,)*) => {
        $(mod $name;)*
        $(pub use $name::$Kind;)*

        /// A metric with its parameters.
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
        #[serde(tag = "name", rename_all = "snake_case")]
        pub enum Metric {
            $($(#[$about])* $Kind($Kind),)*
        }

        /// The names of all metrics in JSON.
        pub const NAMES: &[&str] = &[$(stringify!($name)),*];

        impl Metric {
            fn kind(&self) -> &dyn Distance {
                match self { $(Self::$Kind(metric) => metric,)* }
            }

            /// Reads the parameters of the metric with this name; `None` if there is no such metric.
            fn read(name: &str, parameters: Value) -> Option<std::result::Result<Self, Unfit>> {
                $(if name == stringify!($name) {
                    return Some(reading::from_value(parameters).map(Self::$Kind));
                })*
                None
            }

            /// The parameters of a metric with their defaults and ranges, by the metric's name.
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

// Rustfmt does not find modules declared in a macro, so the Makefile lists their files for it.
metrics! {
    /// The least cost of turning one train into the other.
    victor_purpura: VictorPurpura,
    /// Euclidean distance between trains smoothed by an exponential.
    van_rossum: VanRossum,
    /// Euclidean distance between patterns smoothed in time and over the array.
    van_rossum_spatial: VanRossumSpatial,
}

impl Metric {
    /// Reads a metric from JSON: an object with the metric's `name`.
    ///
    /// # Errors
    ///
    /// `Problem`, naming the parameter.
    pub fn from_json(json: &str) -> Result<Self> {
        let mut parameters: Map<String, Value> = reading::from_text(json).map_err(|unfit| unfit.problem("metric"))?;
        let name = parameters.remove("name").unwrap_or_default();
        let name = name.as_str().unwrap_or_default();
        let Some(Described { defaults, required, .. }) = Self::described(name) else {
            let names: Vec<String> = NAMES.iter().map(|name| format!("'{name}'")).collect();
            return Err(problem!("metric"; " is '{name}': must be one of {}", names.join(", ")));
        };
        // A metric may contain the parameters of another type, whose reader ignores unknown keys, so all keys are
        // checked here.
        let known: Vec<&str> = required.iter().copied().chain(defaults.keys().map(String::as_str)).collect();
        if let Some(unknown) = parameters.keys().find(|key| !known.contains(&key.as_str())) {
            return Err(problem!(unknown.as_str(); " is not known: the parameters of {name} are {}", known.join(", ")));
        }
        Self::read(name, parameters.into())
            .ok_or_else(|| problem!("metric {name}: cannot be read"))?
            .map_err(|unfit| unfit.problem(name))
    }

    /// Checks every parameter.
    ///
    /// # Errors
    ///
    /// `Problem`, naming the parameter.
    pub fn check(&self) -> Result<()> {
        self.kind().check()
    }

    /// The distance between two patterns (the first of each side).
    ///
    /// # Errors
    ///
    /// `Problem` for parameters or times that are not valid, or different numbers of trains; `Interrupted`.
    pub fn distance(&self, a: &Patterns<'_>, b: &Patterns<'_>, stop: Stop<'_>) -> Result<f64> {
        self.prepare(a, Some(b))?.between((a, 0), (b, 0), stop)
    }

    /// The distances of all patterns of `a` to all of `b`, row by row; without `b`, among the patterns of `a`.
    ///
    /// # Errors
    ///
    /// Those of [`Self::distance`].
    pub fn pairwise(&self, a: &Patterns<'_>, b: Option<&Patterns<'_>>, work: &mut Work<'_>) -> Result<Vec<f64>> {
        let ready = self.prepare(a, b)?;
        let matrix = DistanceMatrix::new(a.count, b.map(|b| b.count));
        if !ready.fill(&matrix, a, b, work)? {
            matrix.each_pair(work, |i, j, stop| ready.between((a, i), (b.unwrap_or(a), j), stop))?;
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
        self.kind().ready(a, b)
    }
}
