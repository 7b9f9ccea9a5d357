//! The options of the pipeline. They are described here alone: `tools/messages.py` makes of them the arguments of Python's
//! `Live`, from which come the options of `taxel live`, and the panel shows those of the running session.
//!
//! The first paragraph of a description is the help of the command line; Python's reference has all of it. `commands` names
//! the commands that have an option (`taxel live` where it is left out), `flag` its name there, `metavar` its value, `typed`
//! what only the command line adds, and `python` the type in Python where it is not plain.

use std::path::PathBuf;

use serde::{Deserialize, Serialize, Serializer};
use taxel_core::Array;
use taxel_core::detect::FrameTime;
use taxel_core::wire::Registers;

use crate::capture::ReceiverOptions;
use crate::recording::Compression;

/// The options of a [`Live`](super::Live).
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct LiveOptions {
    /// The UDP port that the board sends to.
    ///
    /// 0 finds a free one, see `address`.
    #[cfg_attr(feature = "schema", schemars(extend("commands" = "live record bridge")))]
    pub port: u16,
    /// The address of this machine to listen on; 0.0.0.0: all.
    #[cfg_attr(feature = "schema", schemars(extend("commands" = "live record bridge")))]
    pub host: String,
    /// Receive a board of another computer instead: zenoh:HOST:PORT/NAME, as taxel bridge prints it there.
    ///
    /// Stop the `Live` before the `Remote`.
    #[cfg_attr(feature = "schema", schemars(extend(
        "commands" = "live record", "flag" = "--from", "metavar" = "ADDRESS", "python" = "Remote | None",
    )))]
    pub remote: Option<String>,
    /// Rows, columns and pitch of the sensor. Default: those of the remote board or of the readout, else 64x64x2.67.
    #[cfg_attr(feature = "schema", schemars(with = "Option<String>", extend(
        "commands" = "live record bridge", "metavar" = "ROWSxCOLUMNS[xMM]", "python" = "Array | None",
        "typed" = "As 24x20x5; without a pitch 2.67 mm, or unknown with --rate-hz.",
    )))]
    #[serde(skip_serializing)]
    pub array: Array,
    /// The board's registers: one of "5.2 kHz", "2 kHz", "20.8 kHz". Default: "5.2 kHz"; a remote board reports its own.
    ///
    /// The contents of the registers, or the name of a preset, of which a smaller array drives fewer lines. Default: those
    /// of a board of this array at reset.
    #[cfg_attr(feature = "schema", schemars(with = "Option<String>", extend(
        "commands" = "live record bridge", "flag" = "--preset", "python" = "str | Registers | None",
    )))]
    #[serde(skip_serializing)]
    pub registers: Registers,
    /// The board sends intensity differences.
    ///
    /// The panel's "delta intensity".
    #[cfg_attr(feature = "schema", schemars(extend("commands" = "live record bridge")))]
    pub differences: bool,
    /// A trained readout (JSON), as taxel train writes it, or a plain rule; the panel needs none.
    ///
    /// Without one nothing is detected.
    #[cfg_attr(feature = "schema", schemars(extend(
        "commands" = "live bridge", "metavar" = "FILE", "python" = "Readout | PlainRule | None",
    )))]
    #[serde(skip_serializing)]
    pub readout: Option<String>,
    /// Rest of the taxels: seconds at rest at the beginning, or the file of a saved tare (JSON).
    ///
    /// For a plain rule, or a readout whose encoder needs one: a tare, or how long to take a fresh one from the first event
    /// on, s, which ends early where the board marks a start. The board must be at rest then, with its noise floor at 0.
    #[cfg_attr(feature = "schema", schemars(with = "Option<String>", extend(
        "commands" = "live bridge", "python" = "Tare | float | None",
    )))]
    #[serde(skip_serializing)]
    pub tare: Option<StatedTare>,
    /// Record in a new file (.mcap or .lsa).
    ///
    /// `.mcap` holds all data, `.lsa` the raw bytes of the manual.
    #[cfg_attr(feature = "schema", schemars(extend(
        "commands" = "live bridge", "python" = "str | os.PathLike[str] | None",
    )))]
    #[serde(serialize_with = "shown")]
    pub record: Option<PathBuf>,
    /// Recordings begin and end while it runs (`record`, `end_recording`).
    ///
    /// Then none begins here, and `sources` are recorded while one runs.
    #[cfg_attr(feature = "schema", schemars(extend("commands" = "")))]
    pub record_later: bool,
    /// The board's name among the sources of the recording.
    #[cfg_attr(feature = "schema", schemars(extend("commands" = "record")))]
    pub name: String,
    /// Record another source too: a board (udp:HOST:PORT,array=16x16), or lines of numbers, as of an IMU
    /// (serial:PATH@BAUD or pipe:PATH, columns=t_us:ax:ay). May be repeated.
    ///
    /// By name, in a `.mcap`, each with its own clock: "udp:HOST:PORT,array=16x16,preset=2 kHz" is another board, which
    /// sends to that address of this machine; "serial:PATH@BAUD" and "pipe:PATH" are lines of numbers ("-" is the standard
    /// input); "given" are numbers that a program passes to `sample`. Of numbers ``columns=t_us:ax:ay`` names the columns of
    /// a line (default: those of the first line), and ``time=NAME:UNIT`` the column of its clock, where that is not called
    /// `t_us`, `time_ms` ...; "lsl:NAME" is a stream of the lab streaming layer. Without a clock, the time of a line is its
    /// arrival.
    #[cfg_attr(feature = "schema", schemars(extend(
        "commands" = "record", "flag" = "--source", "metavar" = "NAME=WHAT", "python" = "Mapping[str, str] | None",
    )))]
    pub sources: Vec<(String, String)>,
    /// Compression of a .mcap: none, lz4 or zstd.
    #[cfg_attr(feature = "schema", schemars(extend("commands" = "record")))]
    pub compression: String,
    /// Replace the file if it exists.
    #[cfg_attr(feature = "schema", schemars(extend("commands" = "record")))]
    pub overwrite: bool,
    /// How far, in frames, a readout stays behind the host's clock while no events arrive.
    #[cfg_attr(feature = "schema", schemars(range(min = 0)))]
    pub guard_frames: f64,
    /// At a gap in the sequence of version 2, frames to wait for what may only be late.
    #[cfg_attr(feature = "schema", schemars(range(min = 0), extend("commands" = "")))]
    pub gap_frames: f64,
    /// Print one line of JSON for each detection, and nothing else.
    #[cfg_attr(feature = "schema", schemars(extend("flag" = "--json")))]
    pub lines: bool,
    /// Send each detection as a line of --json to udp:HOST:PORT, pipe:PATH or serial:PATH@BAUD; may be repeated.
    ///
    /// UDP sends a datagram each; the named pipe must exist; "lsl:NAME" sends the label in a stream of markers of the lab
    /// streaming layer. Up to 1024 lines wait for a slow reader; lines without room, or without a reader, are lost and
    /// counted.
    #[cfg_attr(feature = "schema", schemars(extend("metavar" = "WHERE", "python" = "str | Sequence[str]")))]
    pub send: Vec<String>,
    /// How much may wait in the kernel, bytes.
    #[cfg_attr(feature = "schema", schemars(range(max = 2_147_483_647), extend("commands" = "")))]
    pub kernel_buffer_bytes: usize,
    /// How much may wait for the decoder, bytes.
    #[cfg_attr(feature = "schema", schemars(range(max = 2_147_483_647), extend("commands" = "")))]
    pub queue_bytes: usize,
    /// How many events may wait for the readout.
    #[cfg_attr(feature = "schema", schemars(range(max = 2_147_483_647), extend("commands" = "")))]
    pub readout_events: usize,
    /// Let the kernel hand over trains of datagrams in one piece (`UDP_GRO`).
    ///
    /// It then counts its drops in trains.
    #[cfg_attr(feature = "schema", schemars(extend("commands" = "")))]
    pub gro: bool,
}

fn shown<S: Serializer>(path: &Option<PathBuf>, to: S) -> Result<S::Ok, S::Error> {
    path.as_ref().map(|path| path.display().to_string()).serialize(to)
}

/// What a user states of the taxels' rest.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(untagged)]
pub enum StatedTare {
    /// How long a fresh tare is taken, s.
    Seconds(f64),
    /// The contents of a tare's file.
    Saved(String),
}

impl Default for LiveOptions {
    /// The first preset's registers, 5 frames' guard, no recording.
    fn default() -> Self {
        let ReceiverOptions { kernel_buffer_bytes, queue_bytes, gro } = ReceiverOptions::default();
        Self {
            port: 5208,
            host: "0.0.0.0".to_owned(),
            remote: None,
            array: Array::thesis(),
            registers: Registers::default(),
            differences: false,
            readout: None,
            tare: None,
            record: None,
            record_later: false,
            name: "board".to_owned(),
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
