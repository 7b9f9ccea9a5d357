//! The options of the pipeline.

use std::net::SocketAddr;
use std::path::PathBuf;

use serde::Deserialize;
use taxel_core::Array;
use taxel_core::detect::FrameTime;
use taxel_core::wire::Registers;

use super::source::{FrameSource, NamedSource};
use crate::address::of_host;
use crate::capture::ReceiverOptions;
use crate::recording::Compression;

/// Where a board is received if nothing else is stated.
pub const PORT: u16 = 5208;
const HOST: &str = "0.0.0.0";

/// The options of a [`Live`](super::Live), which Python declares and documents (`taxel.live.LiveOptions`).
#[derive(Debug, Clone, Deserialize)]
#[serde(default, deny_unknown_fields)]
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
    /// How far, in frames, a readout stays behind the host's clock while no events arrive.
    pub guard_frames: f64,
    /// With version 2 of the wire: how many frames to wait at a gap in the sequence.
    pub gap_frames: f64,
    /// Print one line of JSON for each detection.
    pub lines: bool,
    /// Where each detection is sent as a line of JSON.
    pub send: Vec<String>,
    /// How much received data may wait in the operating system, bytes.
    pub kernel_buffer_bytes: usize,
    /// How much received data may wait for the decoder, bytes.
    pub queue_bytes: usize,
    /// How many events may wait for the readout.
    pub readout_events: usize,
    /// Let the kernel join several datagrams and hand them over together (`UDP_GRO`).
    pub gro: bool,
}

impl Default for LiveOptions {
    fn default() -> Self {
        let ReceiverOptions { kernel_buffer_bytes, queue_bytes, gro } = ReceiverOptions::default();
        Self {
            port: None,
            host: None,
            array: Array::thesis(),
            registers: Registers::default(),
            differences: false,
            readout: None,
            tare: None,
            record: None,
            record_later: false,
            name: "board".to_owned(),
            input: None,
            sources: vec![],
            compression: "none".to_owned(),
            overwrite: false,
            guard_frames: 5.0,
            gap_frames: 1.0,
            lines: false,
            send: vec![],
            kernel_buffer_bytes,
            queue_bytes,
            readout_events: 1 << 20,
            gro,
        }
    }
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
    /// The default options for an array.
    #[must_use]
    pub fn new(array: Array) -> Self {
        Self { array, ..Self::default() }
    }

    /// The length of the board's frames, and the unit of their stamps, by its registers.
    #[must_use]
    pub fn frames(&self) -> FrameTime {
        FrameTime::on_wire(self.registers.frame_us(), self.registers.wire_version)
    }

    /// The address to receive a board on.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` if there is no such host.
    pub fn address(&self) -> crate::Result<SocketAddr> {
        of_host(self.host.as_deref().unwrap_or(HOST), self.port.unwrap_or(PORT))
    }

    /// The socket and the queue behind it.
    #[must_use]
    pub fn capture(&self) -> ReceiverOptions {
        let &Self { kernel_buffer_bytes, queue_bytes, gro, .. } = self;
        ReceiverOptions { kernel_buffer_bytes, queue_bytes, gro }
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
