//! Keyframe indices: the changes of a source, readable from any time on.
//!
//! A source is the last minute of a live board ([`live`]) or a recording of any length, of events ([`events`]) or of frames
//! ([`frames`]). All store keyframes. Going on from a keyframe gives the same as going on from the beginning.

mod activity;
mod change_blocks;
mod event_rate;
pub mod events;
pub mod frames;
pub mod live;
mod stepped_frames;

use std::sync::Arc;

use taxel_core::Array;
use taxel_live::Result;
use taxel_live::pipeline::TaxelChange;

use super::array_state::{ArrayState, Keyframe};
use super::time_columns::TimeColumns;

pub use activity::Activity;

/// Changes that follow one another.
#[derive(Debug, Default)]
pub struct Block {
    /// Number of the next block.
    pub next: u64,
    /// Where changes are missing before these: the values held after the gap, and the number of events up to there.
    pub held: Option<(Vec<u16>, u64)>,
    /// The changes.
    pub changes: Vec<TaxelChange>,
    /// The rest of each taxel after these changes, where it is another from there on.
    pub rest: Option<Vec<u16>>,
}

/// The frames of several sources, one by one.
pub trait FrameSources: Send + Sync {
    /// The sensor that joins those of all sources.
    fn array(&self) -> &Array;

    /// Whether the frames are numbered, as their times are not known.
    fn numbered(&self) -> bool;

    /// The sensor of each source.
    fn sensors(&self) -> Vec<Array>;

    /// Number of frames of a source up to a time, us.
    fn until(&self, source: usize, t: i64) -> usize;

    /// A frame of a source: its time (us), and its values in the unit, NaN where one is missing; whole values are those of
    /// the file, others differ by half a step at most. `None` after the last one.
    fn frame(&self, source: usize, k: usize) -> Option<(i64, Vec<f32>)>;
}

/// Keyframes of a source and the changes that follow them.
pub trait KeyframeIndex: Send + Sync {
    /// The sensor.
    fn array(&self) -> &Array;

    /// The noise floor, ticks above rest.
    fn noise_floor(&self) -> u16;

    /// The frames, if it holds such: then the rest is that of the keyframe and of [`Block::rest`], and a change without a
    /// value is a value that is missing from then on.
    fn frames(self: Arc<Self>) -> Option<Arc<dyn FrameSources>> {
        None
    }

    /// The state of the array that begins with a keyframe, in columns of time of this width (us) that take so many bytes.
    fn state(&self, from: &Keyframe, column_us: i64, time_column_bytes: usize) -> ArrayState {
        ArrayState::new(self.array(), self.noise_floor(), from, column_us, time_column_bytes)
    }

    /// First and last time with events, us; `None` without events.
    fn range(&self) -> Option<(i64, i64)>;

    /// The last keyframe at or before `t` (us), or the first one, and the number of the block of changes that follows it.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` where there is no keyframe.
    fn open(&self, t: i64) -> Result<(Keyframe, u64)>;

    /// The changes of a block; `None` where no further one is indexed yet.
    ///
    /// # Errors
    ///
    /// `File` where a temporary file cannot be read.
    fn block(&self, number: u64) -> Result<Option<Block>>;

    /// Time of the last keyframe before `t`, us.
    fn keyframe_before(&self, t: i64) -> Option<i64>;

    /// Raster and curves of the whole source, where they are stored.
    fn time_columns(&self) -> Option<&TimeColumns>;

    /// Number of events up to the last keyframe at or before `t`.
    fn events_before(&self, t: i64) -> u64;
}
