//! Changes that can be looked at from any time on: the last minute while live, or a recording of any length.
//!
//! Both keep keyframes, from which reading on gives what reading from the beginning gives.

mod activity;
pub mod file;
mod rate;
pub mod ring;

use taxel_core::Array;

use super::lens::{Keyframe, Strip};
use crate::Result;
use crate::pipeline::Change;

pub use activity::Activity;

/// What comes next of a film.
#[derive(Debug)]
pub enum Next {
    /// Changes were appended.
    Changes,
    /// Changes are missing; the taxels hold this then, and so many events have come.
    Held(Vec<u16>, u64),
    /// Nothing more, as yet.
    End,
}

/// Reads on from a keyframe.
pub trait Reel: Send {
    /// Appends the next changes.
    ///
    /// # Errors
    ///
    /// `File` where the file cannot be read.
    fn next(&mut self, out: &mut Vec<Change>) -> Result<Next>;
}

/// See the module.
pub trait Film: Send + Sync {
    /// The sensor.
    fn array(&self) -> &Array;

    /// Changes up to it are none, ticks.
    fn floor(&self) -> u16;

    /// First and last time that can be shown, us; `None` where nothing came.
    fn range(&self) -> Option<(i64, i64)>;

    /// The last keyframe at or before a time, or the first, and what reads on from it.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` where there is none.
    fn open(&self, t: i64) -> Result<(Keyframe, Box<dyn Reel>)>;

    /// The keyframe before this one: its time, if there is one.
    fn earlier(&self, t: i64) -> Option<i64>;

    /// Raster and curves of all of it, where they are kept.
    fn strip(&self) -> Option<&Strip>;

    /// Events up to about a time.
    fn events_before(&self, t: i64) -> u64;
}
