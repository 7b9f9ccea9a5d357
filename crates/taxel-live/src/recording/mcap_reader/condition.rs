//! The condition of a file: how its recording ended, and what is damaged.

use serde::Serialize;

use crate::recording::Counts;

/// How a recording ended, as it states.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Ending {
    /// As planned, with what was lost.
    Finished {
        /// What was received and lost.
        counts: Counts,
        /// The writer's line about it.
        verdict: String,
    },
    /// Writing failed: the operating system's error.
    Stopped(String),
}

/// What had to be left out of a damaged file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Rebuilt {
    /// Whether the file lacks its end: writing was killed, or the file was cut.
    pub unfinished: bool,
    /// Bytes at the end of the file that belong to a record which is not whole.
    pub torn_bytes: u64,
    /// Places where the walk lost its way and found it again.
    pub gaps: u64,
    /// Bytes skipped there.
    pub skipped_bytes: u64,
    /// Chunks left out because they state that they unpack to more than a chunk may.
    pub large_chunks: u64,
}
