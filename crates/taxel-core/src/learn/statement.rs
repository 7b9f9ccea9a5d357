//! The stated problem, equations 6.9 to 6.14: what each row asks of the weights, and what the objective is made of.

mod bounds;
mod certificate;
mod examples;
mod grid;
mod relaxed;
mod rows;
mod silence;

pub use bounds::{Bound, bounds_of, check_bounds};
pub use certificate::{Bounds, Certificate};
pub(crate) use examples::{check_example, check_examples, check_heard, check_pattern, check_some_target, check_trains};
pub(crate) use grid::{Layout, SilentRows, TargetRow, target_rows};
pub(crate) use relaxed::{Point, Tangents};
pub use rows::{Margin, Row, Stated, Statement};
pub(crate) use silence::{Peak, Silence};
