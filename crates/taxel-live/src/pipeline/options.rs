//! The options of the pipeline.

use std::net::SocketAddr;
use std::path::PathBuf;

use serde::Deserialize;
use taxel_core::Array;
use taxel_core::detect::FrameTime;
use taxel_core::wire::Registers;

use super::source::{FrameLayout, FrameSource, NamedSource};
use crate::address::of_host;
use crate::capture::Origin;
use crate::recording::{Compression, Decoding, Header, now_ns};

/// Where a board is received if nothing else is stated.
pub const PORT: u16 = 5208;
const HOST: &str = "0.0.0.0";

/// The options of a [`Live`](super::Live), which Python declares and documents, with their defaults (`taxel.live.LiveOptions`).
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LiveOptions {
    /// The UDP port that the board sends to; 0 finds a free one.
    pub port: Option<u16>,
    /// The address of this machine to listen on for a board.
    pub host: Option<String>,
    /// Rows, columns and pitch of the sensor.
    pub array: Array,
    /// The board's registers.
    pub registers: Registers,
    /// The board sends intensity differences.
    pub differences: bool,
    /// A trained readout or a plain rule, as its file's text.
    pub readout: Option<String>,
    /// Rest of the taxels.
    pub tare: Option<StatedTare>,
    /// Record in a new .mcap file.
    pub record: Option<PathBuf>,
    /// Recordings begin and end while the pipeline runs, and none when it begins.
    pub record_later: bool,
    /// The board's name among the sources of the recording.
    pub name: String,
    /// The frames of numbers that are received instead of a board.
    pub input: Option<FrameSource>,
    /// Further sources, which are only recorded.
    pub sources: Vec<NamedSource>,
    /// Compression of the recording: none, lz4 or zstd.
    pub compression: String,
    /// Replace output files that exist already.
    pub overwrite: bool,
    /// How far, in frames, a readout stays behind the host's clock while no events arrive; each kind of source has a default.
    pub guard_frames: Option<f64>,
    /// Print one line of JSON for each detection.
    pub lines: bool,
    /// Where each detection is sent as a line of JSON.
    pub send: Vec<String>,
    /// How many events may wait for the readout; for tests.
    #[serde(skip, default = "readout_events")]
    pub readout_events: usize,
}

fn readout_events() -> usize {
    1 << 20
}

/// What a user states of the taxels' rest.
#[derive(Debug, Clone, Deserialize)]
#[serde(untagged)]
pub enum StatedTare {
    /// How long a fresh tare is taken, s.
    Seconds(f64),
    /// The contents of a tare's file.
    Saved(String),
}

impl LiveOptions {
    /// The layout of the frames of numbers that are received; `None` of a board.
    #[must_use]
    pub fn layout(&self) -> Option<&FrameLayout> {
        self.input.as_ref().map(|frames| &frames.layout)
    }

    /// The length of the source's frames, and the unit of their stamps: as its frames are laid out, or by its registers.
    #[must_use]
    pub fn frame_time(&self) -> FrameTime {
        match self.layout() {
            Some(layout) => layout.frame_us.unwrap_or_default().into(),
            None => FrameTime::on_wire(self.registers.frame_us(), self.registers.wire_version),
        }
    }

    /// The header of a recording of this source alone, which is received from `origin`.
    pub(super) fn header(&self, origin: &Origin) -> taxel_core::Result<Header> {
        let (array, name) = (self.array.clone(), self.name.clone());
        let source = match origin {
            Origin::Udp(address) => format!("udp {address}"),
            Origin::Frames(place) => place.clone(),
        };
        if let Some(layout) = self.layout() {
            return Header::of_frames(&name, array, layout.properties(), source, now_ns());
        }
        let decoding = Decoding { difference: self.differences, ..Decoding::default() };
        Ok(Header { decoding, name, ..Header::of_board(array, Some(self.registers), source, now_ns()) })
    }

    /// The address to receive a board on.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` if there is no such host.
    pub fn address(&self) -> crate::Result<SocketAddr> {
        of_host(self.host.as_deref().unwrap_or(HOST), self.port.unwrap_or(PORT))
    }

    /// The recording from the beginning, if any.
    ///
    /// # Errors
    ///
    /// `Problem` if there is no such compression.
    pub fn recording(&self) -> taxel_core::Result<Option<Record>> {
        let compression = self.compression.parse()?;
        Ok(self.record.clone().map(|path| Record { path, compression, overwrite: self.overwrite }))
    }
}

/// The file of a recording.
#[derive(Debug, Clone)]
pub struct Record {
    /// The file.
    pub path: PathBuf,
    /// Compression of the chunks.
    pub compression: Compression,
    /// Whether an existing file may be replaced.
    pub overwrite: bool,
}
