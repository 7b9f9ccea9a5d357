//! A body's trajectory as it is recorded, and how many steps it may have.

use crate::Error;

/// The most steps of a scene: 16 minutes in quarters of a frame of 5208 Hz, and 320 MB for each body.
pub(super) const MOST_STEPS: usize = 20_000_000;

/// A body's trajectory, sampled at even steps.
#[derive(Debug, Clone, Default)]
pub struct Track {
    /// Where its middle is, mm right of the first taxel.
    pub x_mm: Vec<f32>,
    /// Where, mm below the first taxel.
    pub y_mm: Vec<f32>,
    /// Depth of its lowest point below the foam's face, mm; negative above it.
    pub depth_mm: Vec<f32>,
    /// Force on the foam, N.
    pub force_n: Vec<f32>,
}

/// The error of a scene that has more than [`MOST_STEPS`].
pub(super) fn too_many(step_us: f64) -> Error {
    Error::Scene(format!("step is {step_us} us: must be longer, the scene has more than {MOST_STEPS} of them"))
}
