//! What happens on the array, one act after the other: silence, bodies, frames.

use serde::{Deserialize, Serialize};

use super::{Contact, Scene, TouchKind};
use crate::{Error, Result};

/// Frames laid over the array, as a recording of another sensor gives them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FrameSequence {
    /// Frame after frame, row by row: the share of the way from rest to the ramp's end, 0 to 1.
    pub values: Vec<f32>,
    /// From one frame to the next, us; between them each taxel follows a straight line.
    pub period_us: f64,
}

/// One stretch of a board's input.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Act {
    /// Nothing touches the array.
    Silence {
        /// ms.
        ms: f64,
    },
    /// Bodies touch it.
    Scene(Scene),
    /// Frames are laid over it.
    Frames(FrameSequence),
}

impl FrameSequence {
    /// How many frames of `size` taxels there are, for a board whose own frames last `frame_us`.
    ///
    /// # Errors
    ///
    /// `Scene` where values are no whole frames, are no shares of the ramp, or follow each other faster than the board's frames.
    pub(super) fn count(&self, size: usize, frame_us: f64) -> Result<usize> {
        let count = self.values.len() / size;
        if count == 0 || self.values.len() != count * size {
            return Err(Error::scene(format!("{} values: must be whole frames of {size} values", self.values.len())));
        }
        if let Some(value) = self.values.iter().find(|v| !(0.0..=1.0).contains(*v)) {
            return Err(Error::scene(format!("frame value {value}: must be a share of the ramp, 0 to 1")));
        }
        if !(self.period_us.is_finite() && self.period_us >= frame_us) {
            let period = self.period_us;
            return Err(Error::scene(format!(
                "one frame every {period} us: must be {frame_us} us or more, the length of a frame of the board"
            )));
        }
        Ok(count)
    }

    /// The touch of the frames: from the last empty one before to the first empty one after all that are not.
    pub(super) fn contacts(&self, count: usize, size: usize) -> Vec<Contact> {
        let loaded = |k: usize| self.values[k * size..(k + 1) * size].iter().any(|v| *v > 0.0);
        let Some(first) = (0..count).find(|k| loaded(*k)) else { return vec![] };
        let last = (0..count).rev().find(|k| loaded(*k)).unwrap_or(first);
        vec![Contact {
            kind: TouchKind::Frames,
            start_us: first.saturating_sub(1) as f64 * self.period_us,
            stop_us: (last + 1) as f64 * self.period_us,
            speed_m_s: 0.0,
            peak_n: 0.0,
        }]
    }
}
