//! Files that survive: the live format (MCAP) and the manual's raw `.lsa`.
//!
//! A recording keeps what came, not what our decoder made of it: raw datagrams with the host's arrival time and our own
//! arrival number. Beside them stand the board's registers, markers, notes, detections, counts of what was lost, and a
//! low-rate picture in a standard schema, so that any MCAP viewer shows something.
//!
//! A file is readable at any moment: a chunk reaches it whole, at the latest [`FLUSH_EVERY`] after its first datagram,
//! and the reader rebuilds the index by walking the records, whether the file was finished or not.

mod lsa;
mod mcap_reader;
mod mcap_writer;
mod topic;

use std::collections::BTreeMap;
use std::path::Path;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use serde::{Deserialize, Serialize};
use taxel_core::Array;

pub use lsa::{LsaWriter, numbered, read_lsa};
pub use mcap_reader::{Ending, Message, Reader, Rebuilt, Remarks};
pub use mcap_writer::Writer;
pub use topic::Topic;

/// How long a datagram waits at most until its chunk is closed and handed to the operating system.
///
/// Half of it is waited on average; the rest of the 100 ms that a kill may cost is left to compression and a busy machine.
pub const FLUSH_EVERY: Duration = Duration::from_millis(40);

/// What can be said when nothing was dropped between the socket and the file.
pub const NOTHING_LOST: &str = "nothing lost after arrival (version 1 of the wire cannot show what was lost before it)";

/// What a recording says of itself, from its first byte on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// The sensor.
    pub array: Array,
    /// REG0 to REG7 as the board holds them, where they are known.
    #[serde(default)]
    pub registers: Option<[u32; 8]>,
    /// Whether intensity words are differences (the board's option) instead of values.
    #[serde(default)]
    pub difference: bool,
    /// Where the datagrams came from: "udp 0.0.0.0:5208", a file's name ...
    #[serde(default)]
    pub source: String,
    /// The host's clock when the recording began, ns since 1970.
    #[serde(default)]
    pub started_ns: i64,
}

/// How a file is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Options {
    /// Of the chunks.
    pub compression: Compression,
    /// Whether an existing file may be replaced.
    pub overwrite: bool,
}

/// Compression of the chunks of a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Compression {
    /// Fastest.
    #[default]
    None,
    /// A tenth smaller on the worst case, a quarter of a core there.
    Lz4,
    /// Smallest.
    Zstd,
}

impl std::str::FromStr for Compression {
    type Err = taxel_core::Error;

    fn from_str(name: &str) -> taxel_core::Result<Self> {
        match name {
            "none" => Ok(Self::None),
            "lz4" => Ok(Self::Lz4),
            "zstd" => Ok(Self::Zstd),
            _ => Err(taxel_core::problem!("compression is {name:?}: must be none, lz4 or zstd")),
        }
    }
}

/// What happened to datagrams and bytes, by cause; the sums close.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Counts {
    /// Datagrams that the socket handed over.
    pub received: u64,
    /// Datagrams that this recording holds.
    pub recorded: u64,
    /// What the kernel dropped, its receive buffer being full: datagrams, or with `UDP_GRO` trains of them.
    pub dropped_by_kernel: u64,
    /// Datagrams that taxel dropped, its own queue being full.
    pub dropped_by_queue: u64,
    /// What the decoder could not use of the bytes that came, by cause.
    pub decoder: BTreeMap<String, u64>,
}

impl Counts {
    /// One line: nothing lost after arrival, or what was lost where.
    #[must_use]
    pub fn verdict(&self) -> String {
        let lost: Vec<String> = [
            ("messages dropped by the kernel", self.dropped_by_kernel),
            ("datagrams dropped by taxel", self.dropped_by_queue),
        ]
        .iter()
        .filter(|(_, n)| *n > 0)
        .map(|(what, n)| format!("{n} {what}"))
        .collect();
        let damage: Vec<String> = self
            .decoder
            .iter()
            .filter(|(_, n)| **n > 0)
            .map(|(cause, n)| format!("{n} {}", cause.replace('_', " ")))
            .collect();
        let mut line = if lost.is_empty() { NOTHING_LOST.to_owned() } else { format!("LOST: {}", lost.join(", ")) };
        if !damage.is_empty() {
            line = format!("{line}; in the bytes that came: {}", damage.join(", "));
        }
        line
    }
}

/// One detection as a recording keeps it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DetectionRecord {
    /// What.
    pub label: String,
    /// When the event was, us of the board's clock.
    pub t_us: i64,
    /// When it could first be said, us of the board's clock.
    pub known_us: i64,
    /// How steeply the potential crossed, mV/ms.
    pub slope: f64,
}

/// Something written down while recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Note {
    /// When, by the host's clock, ns since 1970.
    pub at_ns: i64,
    /// When, by the board's clock, us; where it was known.
    pub t_us: Option<i64>,
    /// What.
    pub text: String,
}

/// The host's clock, ns since 1970.
#[must_use]
pub fn now_ns() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_nanos()).unwrap_or(i64::MAX)
}

/// Opens a new file for writing; an existing one only where `overwrite` says so.
fn create(path: &Path, overwrite: bool) -> crate::Result<std::fs::File> {
    let mut options = std::fs::OpenOptions::new();
    options.write(true).read(true);
    if overwrite {
        options.create(true).truncate(true);
    } else {
        options.create_new(true);
    }
    options.open(path).map_err(crate::Error::file(path))
}
