//! The condition of a file: how its recording ended, and which parts are damaged.

use serde::{Deserialize, Serialize};

use crate::recording::Counts;

/// How a recording ended, as the file states.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Ending {
    /// As planned.
    Finished {
        /// Counts of what was received and lost.
        counts: Counts,
    },
    /// Stopped because writing failed, with the operating system's error.
    Stopped(String),
}

/// The parts of a damaged file that were skipped.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Rebuilt {
    /// Whether the end of the file is missing: writing was killed, or the file was truncated.
    pub unfinished: bool,
    /// Number of bytes of an incomplete record at the end of the file.
    pub torn_bytes: u64,
    /// Number of places where the walk met an invalid record and resynchronised.
    pub gaps: u64,
    /// Number of bytes skipped there.
    pub skipped_bytes: u64,
    /// Number of chunks that were skipped because the unpacked size that they state exceeds the limit.
    pub large_chunks: u64,
}
