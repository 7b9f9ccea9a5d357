//! The taxels' values at rest: given, tracked or found, and what of a value is above it.

mod baseline;
mod followed;
mod preload;
mod steps;
mod tracked;
mod value;

pub use baseline::{Baseline, FAR_NOISE, FAR_S, HELD_S, NEAR_S, Waiting, stands_out_from};
pub use followed::{FollowedRest, Following, LeftFloor};
pub use preload::{LOADED_TICKS, preload, preload_text};
pub use steps::ValueSteps;
pub(crate) use tracked::TaxelGrid;
pub use tracked::{QUIET_US, TOUCHED_TOGETHER, TrackedRest};
pub use value::{FORCE_UNITS, NOISE_FLOOR, Rest, TIMES_NOISE, Value, above_noise, step_of, touched_from};
