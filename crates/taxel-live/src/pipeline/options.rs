//! The options of the pipeline.

use std::path::PathBuf;

use taxel_core::Array;
use taxel_core::detect::FrameTime;
use taxel_core::wire::Registers;

use super::sending::Destination;
use super::source::Source;
use crate::capture::ReceiverOptions;
use crate::recording::Compression;

/// The options of a [`Live`](super::Live).
#[derive(Debug, Clone)]
pub struct LiveOptions {
    /// The sensor.
    pub array: Array,
    /// The board's registers, as far as they are known: they define the length of a frame.
    pub registers: Registers,
    /// Whether the board sends differences for intensities (the panel's "delta intensity").
    pub differences: bool,
    /// During silence the readout's time follows the host's clock from the latest datagram on, this number of frames behind it.
    pub guard_frames: f64,
    /// Number of frames for which time waits at a gap in the sequence of version 2: the missing datagrams may only be
    /// late.
    pub gap_frames: f64,
    /// Capacity of the queue before the readout, events.
    pub readout_events: usize,
    /// The socket and the queue behind it.
    pub capture: ReceiverOptions,
    /// The recording from the beginning, if any.
    pub record: Option<Record>,
    /// Whether recordings start and end while the pipeline runs ([`Live::record`](super::Live::record)); then none
    /// starts with it.
    pub record_later: bool,
    /// Destinations to which detections are sent as lines, in addition to the sinks.
    pub send: Vec<Destination>,
    /// The board's name in a recording.
    pub name: String,
    /// The other sources of the recording.
    pub sources: Vec<Source>,
}

impl LiveOptions {
    /// The default options for an array: the first preset's registers, 5 frames' guard, no recording.
    #[must_use]
    pub fn new(array: Array) -> Self {
        Self {
            array,
            registers: Registers::default(),
            differences: false,
            guard_frames: 5.0,
            gap_frames: 1.0,
            readout_events: 1 << 20,
            capture: ReceiverOptions::default(),
            record: None,
            record_later: false,
            send: vec![],
            name: "board".to_owned(),
            sources: vec![],
        }
    }

    /// The length of the board's frames, and the unit of their stamps, by its registers.
    #[must_use]
    pub fn frames(&self) -> FrameTime {
        FrameTime::on_wire(self.registers.frame_us(), self.registers.wire_version)
    }
}

/// The file of a recording: `.lsa` for the manual's raw bytes, `.mcap` for everything.
#[derive(Debug, Clone)]
pub struct Record {
    /// The file.
    pub path: PathBuf,
    /// Compression of the chunks of `.mcap`.
    pub compression: Compression,
    /// Whether an existing file may be replaced.
    pub overwrite: bool,
}
