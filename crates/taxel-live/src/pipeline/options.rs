//! The options of the pipeline. They are described here alone: `tools/messages.py` makes of them the arguments of Python's
//! `Live`, from which come the options of `taxel live`, and the panel shows those of the running session.
//!
//! The first paragraph of a description is the help of the command line; Python's reference has all of it. `commands` names
//! the commands that have an option (`taxel live` where it is left out), `flag` its name there, `metavar` its value, `typed`
//! what only the command line adds, and `python` the type in Python where it is not plain.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

use serde::{Deserialize, Serialize, Serializer};
use taxel_core::detect::FrameTime;
use taxel_core::wire::Registers;
use taxel_core::{Array, Stop, problem};

use super::source::{FirstLineWait, SourceText};
use crate::address::of_host;
use crate::capture::ReceiverOptions;
use crate::recording::Compression;

/// Where a board is received if nothing else is stated.
pub const PORT: u16 = 5208;
const HOST: &str = "0.0.0.0";

/// Declares the options with their defaults; `KEY = VALUE` after one is what its schema says beside.
macro_rules! options {
    ($(#[$about:meta])* pub struct $name:ident {
        $($(#[$attribute:meta])* $field:ident: $kind:ty = $default:expr $(, $key:literal = $value:literal)*;)*
    }) => {
        $(#[$about])*
        pub struct $name {
            $($(#[$attribute])* $(#[cfg_attr(feature = "schema", schemars(extend($key = $value)))])* pub $field: $kind,)*
        }

        impl Default for $name {
            fn default() -> Self {
                Self { $($field: $default,)* }
            }
        }
    };
}

options! {
    /// The options of a [`Live`](super::Live).
    #[derive(Debug, Clone, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    #[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
    pub struct LiveOptions {
        /// The UDP port that the board sends to. Default: 5208, unless --source names what to receive.
        ///
        /// 0 finds a free one, see `address`.
        port: Option<u16> = None, "commands" = "live record";
        /// The address of this machine to listen on for a board; 0.0.0.0: all.
        host: Option<String> = None, "commands" = "live record";
        /// Rows, columns and pitch of the sensor. Default: those of the readout, else 64x64x2.67.
        #[cfg_attr(feature = "schema", schemars(with = "Option<String>"))]
        #[serde(skip_serializing)]
        array: Array = Array::thesis(), "commands" = "live record", "metavar" = "ROWSxCOLUMNS[xMM]",
            "python" = "Array | None", "typed" = "For example 24x20x5. Default pitch: 2.67 mm, or unknown with --rate-hz.";
        /// The board's registers, by a preset: one of `taxel.wire.PRESETS`. Default: those of a board of this array
        /// at reset.
        ///
        /// Or their contents. A smaller array drives fewer lines of a preset.
        #[cfg_attr(feature = "schema", schemars(with = "Option<String>"))]
        #[serde(skip_serializing)]
        registers: Registers = Registers::default(), "commands" = "live record", "flag" = "--preset",
            "python" = "str | Registers | None";
        /// The board sends intensity differences.
        ///
        /// The panel's "delta intensity".
        differences: bool = false, "commands" = "live record";
        /// A trained readout or a plain rule; without one nothing is detected.
        #[serde(skip_serializing)]
        readout: Option<String> = None, "metavar" = "FILE",
            "python" = "Readout | PlainRule | None", "typed" = "taxel train writes such files (JSON).";
        /// Rest of the taxels: a saved tare, or the seconds at rest at the beginning, from which a fresh tare is taken.
        ///
        /// For a plain rule, or a readout whose encoder needs one: a tare, or how long to take a fresh one from the first event
        /// on, s, which ends early where the board marks a start. The board must be at rest then, with its noise floor at 0.
        #[cfg_attr(feature = "schema", schemars(with = "Option<String>"))]
        #[serde(skip_serializing)]
        tare: Option<StatedTare> = None, "python" = "Tare | float | None", "metavar" = "FILE|SECONDS",
            "typed" = "A recording of the sensor at rest (taxel cut) can be used instead of a saved tare.";
        /// Record in a new file (.mcap or .lsa).
        ///
        /// `.mcap` holds all data, `.lsa` the raw bytes of the manual.
        #[serde(serialize_with = "shown")]
        record: Option<PathBuf> = None, "python" = "str | os.PathLike[str] | None";
        /// Let `record` and `end_recording` begin and end recordings while the `Live` runs.
        ///
        /// Then none begins when the `Live` begins; `sources` are recorded while a recording runs.
        record_later: bool = false, "commands" = "";
        /// The board's name among the sources of the recording.
        name: String = "board".to_owned(), "commands" = "record";
        /// The source to receive: [NAME=]KIND:PLACE and, after commas, KEY=VALUE; for example lines:-,array=16x16 or
        /// serial:COM3,array=16x16. It sends frames of numbers, is a board (board:HOST:PORT), or is a further source of a
        /// recording.
        ///
        /// "board:HOST:PORT" is a board that sends to that address of this machine (array=ROWSxCOLUMNS, preset=NAME). Lines of
        /// numbers come from "serial:PLACE" (baud=), "lines:PATH" (a pipe, or a file that grows; "-" is the standard input),
        /// "lines+tcp:HOST:PORT" (connects), "lines+udp:HOST:PORT" (listens) and "given", what a program passes to `sample`. With
        /// ``array=`` they are frames: a line each, or ``frame_lines=16``, or up to an empty line (``frame_end=blank``).
        /// ``time=COLUMN:ms`` is the column of the time (by name, or by number from 1; ``time=A+B`` adds seconds and
        /// nanoseconds; without it the time of arrival), ``columns=A:B:C`` names the columns, ``leave_out=A:B`` are those without
        /// values, ``unit=``, ``falls=`` (true, or the number that readings are subtracted from) and ``rate=`` (frames a second;
        /// default: measured). Lines without an array, as of an IMU, are recorded with the first source. "lsl:NAME" is a
        /// stream of the lab streaming layer.
        sources: Vec<String> = vec![], "commands" = "live record", "flag" = "--source",
            "metavar" = "[NAME=]KIND:PLACE", "python" = "Mapping[str, str] | str | Sequence[str] | None",
            "typed" = "May be repeated.";
        /// How long each source of lines may be silent before its first line, s.
        ///
        /// A source of which the array, the columns and the rate are stated may be silent longer: it starts without a line.
        first_line_s: f64 = 3.0, "commands" = "", "minimum" = 0;
        /// Compression of a .mcap: none, lz4 or zstd.
        compression: String = "none".to_owned(), "commands" = "record";
        /// Replace output files that exist already.
        overwrite: bool = false, "commands" = "live record";
        /// How far, in frames, a readout stays behind the host's clock while no events arrive.
        guard_frames: f64 = 5.0, "minimum" = 0;
        /// With version 2 of the wire: how many frames to wait at a gap in the sequence: the data may only be late.
        gap_frames: f64 = 1.0, "commands" = "", "minimum" = 0;
        /// Print one line of JSON for each detection, and nothing else.
        lines: bool = false, "flag" = "--json";
        /// Send each detection as a line of JSON to serial:PLACE, lines:PATH (a named pipe), lines+tcp:HOST:PORT or
        /// lines+udp:HOST:PORT.
        ///
        /// UDP sends a datagram each, TCP connects; the named pipe must exist; ``,baud=`` may follow a serial port; "lsl:NAME" sends the label in a stream of markers of the lab
        /// streaming layer. Up to 1024 lines wait for a slow reader; lines without room, or without a reader, are lost and
        /// counted. Without a readout nothing is sent until one is chosen on the page.
        send: Vec<String> = vec![], "metavar" = "WHERE", "python" = "str | Sequence[str]", "typed" = "May be repeated.";
        /// How much received data may wait in the operating system, bytes.
        kernel_buffer_bytes: usize = ReceiverOptions::default().kernel_buffer_bytes, "commands" = "",
            "maximum" = 2_147_483_647;
        /// How much received data may wait for the decoder, bytes.
        queue_bytes: usize = ReceiverOptions::default().queue_bytes, "commands" = "", "maximum" = 2_147_483_647;
        /// How many events may wait for the readout.
        readout_events: usize = 1 << 20, "commands" = "", "maximum" = 2_147_483_647;
        /// Let the kernel join several datagrams and hand them over together (`UDP_GRO`).
        ///
        /// Then each joined piece that the kernel drops counts as one.
        gro: bool = ReceiverOptions::default().gro, "commands" = "";
    }
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

    /// The sources that are stated.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` if a text is none of a source, or two have one name.
    pub(super) fn source_texts(&self) -> crate::Result<Vec<SourceText>> {
        let texts = self.sources.iter().map(|text| text.parse()).collect::<crate::Result<Vec<SourceText>>>()?;
        for (k, text) in texts.iter().enumerate() {
            let name = text.name();
            if texts[..k].iter().any(|earlier| earlier.name() == name) {
                let text = &text.text;
                return Err(problem!(
                    "source {text:?}: two sources have the name {name}; begin one of them with another NAME="
                )
                .into());
            }
        }
        Ok(texts)
    }

    /// How long each source of lines may be silent, unless asked to stop.
    ///
    /// # Errors
    ///
    /// `Problem` if that is no time.
    pub(super) fn first_line_wait<'a>(&self, stop: Stop<'a>) -> taxel_core::Result<FirstLineWait<'a>> {
        let seconds = self.first_line_s;
        let most = Duration::try_from_secs_f64(seconds)
            .map_err(|_| problem!("first_line_s"; " is {seconds} s: must be 0 or more"))?;
        Ok(FirstLineWait { most, stop })
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
