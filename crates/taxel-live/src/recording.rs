//! Recording files, which stay readable after a crash: MCAP.
//!
//! A recording contains the datagrams as they arrived, not decoded events, with the host's arrival time and an arrival
//! number. It also contains the board's registers, markers, notes, detections, counts of what was lost, and a low-rate
//! preview in a standard schema, so that any MCAP viewer shows something.
//!
//! A file is readable at any time: chunks are written whole, at the latest [`FLUSH_EVERY`] after their first datagram,
//! and the reader rebuilds the index by walking the records, whether the file was finished or not.

mod causes;
mod frames;
mod limits;
mod mcap_reader;
mod mcap_writer;
mod metadata;
mod output;
mod stream;
mod topic;
mod verdict;

use std::time::Duration;

use serde::{Deserialize, Serialize};
use taxel_core::wire::Registers;
use taxel_core::{Array, problem};

pub use crate::host_clock::now_ns;
pub use causes::{Cause, CauseKind, Counts};
pub use frames::{FrameEncoding, FrameProperties, Frames};
pub use mcap_reader::{Datagrams, DecodedRecording, Message, Reader, Remarks};
pub use mcap_writer::{SourceWriter, Writer};
pub use output::OutputFile;
pub use stream::StreamFaults;
pub use topic::Topic;
pub use verdict::{
    Basis, Condition, FileEnding, Found, NOTHING_LOST, Rebuilt, RecordingCounts, RecordingStatus, Verdict,
};

/// Longest time that a datagram waits until its chunk is closed and passed to the operating system.
///
/// The average wait is half of it; the rest of the 100 ms that a kill may cost is reserved for compression and a busy
/// machine.
pub const FLUSH_EVERY: Duration = Duration::from_millis(20);

/// From one low-rate frame to the next: in recordings where something comes, as the pipeline publishes them, and to other computers.
pub const LOW_RATE_EVERY: Duration = Duration::from_millis(100);

/// Age of the oldest queued message at which the writing thread counts as starved of the processor: the next caller
/// writes the queue.
pub const LATE: Duration = Duration::from_millis(40);

/// The properties of a recording, stored at its beginning.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// The sensor.
    pub array: Array,
    /// The board's registers at the beginning, if they are known.
    #[serde(default)]
    pub registers: Option<Registers>,
    /// The array that those registers drive, if the recording contains a part of it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub driven: Option<Array>,
    /// What a conversion states of the recording that it was made of.
    #[serde(flatten)]
    pub conversion: Conversion,
    /// How the datagrams are decoded.
    #[serde(flatten)]
    pub decoding: Decoding,
    /// The origin of the datagrams: "udp 0.0.0.0:5208", a file's name, and so on.
    #[serde(default)]
    pub source: String,
    /// The host's clock when the recording began, ns since 1970.
    #[serde(default)]
    pub started_ns: i64,
    /// Name of this source among the sources of its file.
    #[serde(default = "board", skip_serializing_if = "is_board")]
    pub name: String,
    /// Where the sensor lies.
    #[serde(flatten)]
    pub placement: Placement,
    /// For a source of frames, their unit and more; none for a board.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frames: Option<FrameProperties>,
    /// The other sources of the file: frames on the same clock, any other with a clock of its own.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sources: Vec<Header>,
}

/// What a conversion states of the recording that it was made of.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Conversion {
    /// What conversions to this file left out, one line each.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub lost: Vec<String>,
    /// What else there is to know of the recording, one line each: by whose times it is, what it was converted from.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub remarks: Vec<String>,
    /// The verdict of the recording that this one was converted from: here, so that a file that was cut still states it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub converted: Option<Verdict>,
    /// The counts of that recording, by cause, as its reader gives them.
    #[serde(default, skip_serializing_if = "serde_json::Map::is_empty")]
    pub counts: serde_json::Map<String, serde_json::Value>,
}

/// How the datagrams of a recording are decoded.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Decoding {
    /// The numbers of events that a state gave, in a file made of events whose datagrams do not state it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub repaired: Vec<u64>,
    /// Whether intensity words are differences (the board's option) instead of values.
    #[serde(default)]
    pub difference: bool,
    /// Added to decoded times, us: in a converted file whole turns of the board's 6.5536 s counter before the first
    /// stamp. In a recording that began while its board was received, a message states it
    /// ([`BoardChangeKind::Clock`]), and the file's header is read with it.
    #[serde(default)]
    pub origin_us: i64,
    /// Whether the recording began while its board was received.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub begun_later: bool,
}

/// Where a sensor lies.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Placement {
    /// The side of the body that the sensor is of, "left" or "right"; empty if it is unknown.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub side: String,
    /// Where on the sensor the heel lies, "top" or "bottom"; empty if it is unknown.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub heel: String,
}

/// The default name of a source.
fn board() -> String {
    "board".to_owned()
}

fn is_board(name: &str) -> bool {
    name == "board"
}

/// The options of a writer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct WriterOptions {
    /// Compression of the chunks.
    pub compression: Compression,
    /// Whether an existing file may be replaced.
    pub overwrite: bool,
}

/// Compression of the chunks of a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Compression {
    /// No compression, the fastest.
    #[default]
    None,
    /// A tenth smaller in the worst case, in which it uses a quarter of a core.
    Lz4,
    /// The smallest files.
    Zstd,
}

impl std::str::FromStr for Compression {
    type Err = taxel_core::Error;

    fn from_str(name: &str) -> taxel_core::Result<Self> {
        match name {
            "none" => Ok(Self::None),
            "lz4" => Ok(Self::Lz4),
            "zstd" => Ok(Self::Zstd),
            _ => Err(taxel_core::problem!("compression"; " is {name:?}: must be none, lz4 or zstd")),
        }
    }
}

impl Header {
    /// The channels of the source: a board, or frames.
    fn topics(&self) -> impl Iterator<Item = Topic> {
        let frames = self.frames.is_some();
        let belongs = move |topic: &Topic| match topic {
            Topic::Frames => frames,
            // Any viewer shows frames.
            Topic::Datagrams | Topic::Pressure => !frames,
            _ => true,
        };
        Topic::ALL.into_iter().filter(belongs)
    }

    /// Checks the properties that a file states.
    pub(crate) fn check(&self) -> taxel_core::Result<()> {
        self.array.check()?;
        let (rows, columns) = (self.array.rows, self.array.columns);
        if self.array.len() > limits::TAXELS {
            return Err(problem!("the sensor has {rows} x {columns} taxels; must have at most {}", limits::TAXELS));
        }
        if !(-limits::TIME_US..=limits::TIME_US).contains(&self.decoding.origin_us) {
            return Err(problem!("origin_us"; " is {}: must be within 142 years of 0", self.decoding.origin_us));
        }
        if let Some(frames) = &self.frames {
            frames.check(&self.name, self.array.columns)?;
        }
        let driven = self.driven.as_ref().unwrap_or(&self.array);
        driven.check()?;
        self.registers.map_or(Ok(()), |registers| registers.check_fit(driven))?;
        if self.sources.len() >= limits::SOURCES {
            return Err(problem!("{} sources; must be at most {} in a file", self.sources.len() + 1, limits::SOURCES));
        }
        let mut names = vec![&self.name];
        for source in &self.sources {
            check_name(&source.name)?;
            if names.contains(&&source.name) {
                return Err(problem!("source {:?}: two sources have this name", source.name));
            }
            names.push(&source.name);
            if !source.sources.is_empty() {
                return Err(problem!("source {:?}: contains sources itself", source.name));
            }
            source.check()?;
        }
        check_name(&self.name)
    }

    /// The header of a recording of a board.
    #[must_use]
    pub fn of_board(array: Array, registers: Option<Registers>, source: String, started_ns: i64) -> Self {
        Self {
            array,
            registers,
            driven: None,
            conversion: Conversion::default(),
            decoding: Decoding::default(),
            source,
            started_ns,
            name: board(),
            placement: Placement::default(),
            frames: None,
            sources: vec![],
        }
    }

    /// The header of a source of frames.
    ///
    /// # Errors
    ///
    /// `Problem` if the name or a property is not valid.
    pub fn of_frames(
        name: &str,
        array: Array,
        frames: FrameProperties,
        source: String,
        started_ns: i64,
    ) -> taxel_core::Result<Self> {
        let board = Self::of_board(array, None, source, started_ns);
        let header = Self { name: name.to_owned(), frames: Some(frames), ..board };
        header.check()?;
        Ok(header)
    }
}

/// Checks a source's name, which becomes part of the names of its channels.
fn check_name(name: &str) -> taxel_core::Result<()> {
    let fits = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    if name.is_empty() || name.len() > 64 || !name.chars().all(fits) {
        return Err(problem!("source {name:?}: a name must have at most 64 letters, digits, _ and -"));
    }
    Ok(())
}

/// A note written during a recording.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Note {
    /// Time by the host's clock, ns since 1970.
    pub at_ns: i64,
    /// Time by the board's clock, us, if it was known.
    pub t_us: Option<i64>,
    /// Text of the note.
    pub text: String,
}

/// A reset of the board, or a change of its version, during a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct BoardChange {
    /// Time by the host's clock at which the change was noticed, ns since 1970.
    #[serde(skip)]
    pub at_ns: i64,
    /// The board's time, us, which continues over the change; none if it was not known.
    pub t_us: Option<i64>,
    /// Kind of the change.
    #[serde(flatten)]
    pub change: BoardChangeKind,
}

/// Kind of a [`BoardChange`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "change", rename_all = "lowercase")]
pub enum BoardChangeKind {
    /// The board was reset: its taxels' values are unknown until their next event.
    Reset,
    /// No change, but where the recording begins on the board's clock: added to the times that a decoder finds which
    /// begins with its first datagram.
    Clock {
        /// What is added, us.
        origin_us: i64,
    },
    /// The board changed its version of the wire.
    Wire {
        /// The version from here on.
        version: u8,
        /// Whether the host commanded it; else its datagrams showed it.
        asked: bool,
    },
}
