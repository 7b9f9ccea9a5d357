//! The groups of lines that the board reads one after the other, and when each is read.

/// The board's lines are read in four groups a frame, each as the touch then is.
pub const GROUPS: usize = 4;

/// The delay of the fabric's response, us (thesis 4.4.1).
const FABRIC_US: f64 = 50.0;

/// When a group of lines is read that shows the touch of `GROUPS` steps a frame.
pub fn steps_before(frame: usize, group: usize, frame_us: f64) -> f64 {
    let lag = FABRIC_US / (frame_us / GROUPS as f64) - 0.5;
    ((GROUPS * frame + group) as f64 - lag).max(0.0)
}
