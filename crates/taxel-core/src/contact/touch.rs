//! The ground truth of a touch: its kind, when it began and ended, its speed and peak force.

use serde::{Deserialize, Serialize};

/// The kind of a touch.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TouchKind {
    /// The first impact after the drop.
    First,
    /// A later impact.
    Bounce,
    /// Pressed by hand, and lifted.
    Hand,
    /// An impact after which the ball stayed until a hand lifted it.
    Rest,
    /// Set down, rolling, and lifted.
    Roll,
    /// Set down, sliding, and lifted.
    Slide,
    /// A touch of recorded frames that are played over the array.
    Frames,
}

/// One touch: from the moment when force leaves zero to that when it returns there.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Contact {
    /// Its kind.
    pub kind: TouchKind,
    /// Force leaves zero, us.
    pub start_us: f64,
    /// Force returns to zero, us.
    pub stop_us: f64,
    /// The body's speed towards the foam as it began, m/s.
    pub speed_m_s: f64,
    /// The largest force, N; 0 where it is not known.
    pub peak_n: f64,
}
