//! Keyframe indices: the changes of a source, readable from any time on.
//!
//! A source is the last minute of a live board ([`live`]) or a recording of any length ([`recording`]). Both store
//! keyframes. Decoding on from a keyframe gives the same as decoding from the beginning.

mod activity;
mod event_rate;
pub mod frames;
pub mod live;
pub mod recording;
mod stepped_frames;

use std::sync::Arc;

use taxel_core::Array;
use taxel_live::Result;
use taxel_live::pipeline::TaxelChange;

use super::array_state::{Keyframe, RestSource};
use super::load::Weights;
use super::time_columns::TimeColumns;

pub use activity::Activity;

/// Result of [`ChangeReader::read`].
#[derive(Debug)]
pub enum ReadOutcome {
    /// Changes were appended.
    Changes,
    /// Changes are missing; these are the values held after the gap, and the number of events up to there.
    Held(Vec<u16>, u64),
    /// The rest of each taxel from here on.
    Rest(Vec<u16>),
    /// No further change is indexed yet.
    End,
}

/// Reads the changes that follow a keyframe.
pub trait ChangeReader: Send {
    /// Appends the next changes.
    ///
    /// # Errors
    ///
    /// `File` where the file cannot be read.
    fn read(&mut self, out: &mut Vec<TaxelChange>) -> Result<ReadOutcome>;
}

/// The frames of several sources, one by one.
pub trait FrameSources: Send + Sync {
    /// The sensor that joins those of all sources.
    fn array(&self) -> &Array;

    /// Whether the frames are numbered, as their times are not known.
    fn numbered(&self) -> bool;

    /// Where the rest of the sources comes from; none where they differ.
    fn rest_source(&self) -> RestSource;

    /// Steps above rest that count as none in the sums.
    fn sum_floor(&self) -> u16;

    /// How much each taxel counts in the sum.
    fn weights(&self) -> &Weights;

    /// Number of the source of each column of the array; empty where there is one, or more than have a curve each.
    fn source_of(&self) -> Arc<[usize]>;

    /// The most that noise adds up to, ticks above rest: of all sources, and of each.
    fn noise(&self) -> (u32, Vec<u32>);

    /// The sensor of each source.
    fn sensors(&self) -> Vec<Array>;

    /// Number of frames of a source up to a time, us.
    fn until(&self, source: usize, t: i64) -> usize;

    /// A frame of a source: its time (us), and its values in the unit, NaN where one is missing; whole values are those of
    /// the file, others differ by half a step at most. `None` after the last one.
    fn frame(&self, source: usize, k: usize) -> Option<(i64, Vec<f32>)>;
}

/// Keyframes of a source and what reads on from them.
pub trait KeyframeIndex: Send + Sync {
    /// The sensor.
    fn array(&self) -> &Array;

    /// The noise floor, ticks above rest.
    fn noise_floor(&self) -> u16;

    /// The frames, if it holds such: then the rest is that of the keyframe and of [`ReadOutcome::Rest`], and a change without a
    /// value is a value that is missing from then on.
    fn frames(&self) -> Option<Arc<dyn FrameSources>> {
        None
    }

    /// First and last time with events, us; `None` without events.
    fn range(&self) -> Option<(i64, i64)>;

    /// The last keyframe at or before `t` (us), or the first one, and a reader of the changes that follow it.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` where there is no keyframe.
    fn open(&self, t: i64) -> Result<(Keyframe, Box<dyn ChangeReader>)>;

    /// Time of the last keyframe before `t`, us.
    fn keyframe_before(&self, t: i64) -> Option<i64>;

    /// Raster and curves of the whole source, where they are stored.
    fn time_columns(&self) -> Option<&TimeColumns>;

    /// Number of events up to the last keyframe at or before `t`.
    fn events_before(&self, t: i64) -> u64;
}
