//! The messages to clients, but for frames. They are described here alone: `tools/messages.py` makes of them the types of the
//! page.

use std::collections::BTreeMap;

use serde::Serialize;
use serde_json::{Value, json};
use taxel_core::Array;
use taxel_core::encode;
use taxel_core::wire::Registers;
use taxel_live::Quantiles;
use taxel_live::clock::Pace;
use taxel_live::pipeline::{Arrival, LiveOptions, OutputDetection};
use taxel_live::ports::Port;

use super::refusal::Refusal;
use crate::handler::{BagTopic, LabelRow, LabelScore, Mistake, UnhealthyTaxels, UserPreset};
use crate::readout_encoders::ReadoutEncoders;

/// A message of the server.
#[derive(Debug, Clone, Serialize)]
#[serde(tag = "type", rename_all = "snake_case")]
#[cfg_attr(feature = "development", derive(schemars::JsonSchema))]
// A message is made, written as text, and dropped.
#[allow(clippy::large_enum_variant)]
pub(crate) enum Message {
    /// The server and what it shows; sent again when any of it changes (`listen`, `delta_intensity`, `control`).
    Hello {
        /// 1.
        protocol: u32,
        /// taxel's version.
        taxel: &'static str,
        /// False: no board, recordings only (`taxel view`).
        live: bool,
        array: Option<ArrayInfo>,
        /// The options of the session by their names in Python, except sensor, registers, readout and tare; null without a board.
        #[cfg_attr(feature = "development", schemars(with = "Option<serde_json::Map<String, Value>>"))]
        options: Option<Box<LiveOptions>>,
        /// Where datagrams are received.
        udp: Option<String>,
        /// What else may keep datagrams from the server, in words that are added to why none arrived; empty if nothing.
        firewall: &'static str,
        /// Where frames of numbers are read; null of a board.
        lines: Option<String>,
        /// That source as a text states it, with all of its keys; null of a board.
        source: Option<String>,
        /// The names of the live sources: first the one that is shown and read out, then those that are only recorded; empty
        /// without a board.
        sources: Vec<String>,
        /// The values of those frames, after the first one; null of a board, whose values are ticks.
        frames: Option<LiveFrames>,
        /// Whether intensities are differences; null without a board.
        delta_intensity: Option<bool>,
        /// The board's serial line; null: registers cannot be written.
        control: Option<String>,
        /// The folder of the recordings.
        folder: String,
        /// The recording to show first.
        open: Option<String>,
        /// The labels of the readout that runs.
        readout: Option<Vec<String>>,
        /// The names of its encoders; empty without a readout, and of a plain rule.
        #[cfg_attr(feature = "development", schemars(with = "Vec<String>"))]
        readout_encoders: ReadoutEncoders,
        /// The names of the encoders.
        encoders: &'static [&'static str],
        /// Width of a column of time, us.
        column_us: i64,
        /// The narrowest and the widest that `zoom` takes, us.
        columns_us: (i64, i64),
        /// Columns of time in a frame, at most.
        time_columns: i64,
        /// Bytes of a request, at most.
        most_message_bytes: usize,
        /// Credits that the server counts, at most.
        most_credits: u32,
    },
    /// The registers that the board holds, or is assumed to hold; at the beginning and after every change.
    Registers {
        /// False: they were not read from the board; they are the preset that was named on the command line, or what the board
        /// held before a reset (a new session of version 2, or its greeting on the serial line), until they are read again, which
        /// is at once.
        known: bool,
        /// Whether they were stated at the start (`--preset`, or `--rate-hz` with `--bits`).
        stated: bool,
        /// Every field of `registers.js` in its unit; those of one bit are true or false.
        #[cfg_attr(feature = "development", schemars(with = "shapes::Registers"))]
        values: Registers,
        /// The preset that holds the same, the user's or built-in, whatever the version of the wire.
        preset: Option<String>,
        /// How long a frame takes, us.
        frame_us: f64,
        warnings: Vec<String>,
    },
    /// The presets that the board can hold.
    Presets {
        built_in: Vec<&'static str>,
        /// Those of the user, which hold every field.
        user: BTreeMap<String, UserPreset>,
        /// The file of the user's: a table a preset, which can be edited by hand.
        path: String,
    },
    /// Counts of the live source, 4 times a second; what is not known is null.
    Counters {
        at_ns: i64,
        /// Since the source began.
        seconds: f64,
        board_us: Option<i64>,
        events: u64,
        events_per_s: Option<f64>,
        bytes_per_s: Option<f64>,
        datagrams_per_s: Option<f64>,
        /// Follows from the registers; null where they are neither known nor stated.
        frames_per_s: Option<f64>,
        /// Whether datagrams arrive.
        arrival: Arrival,
        /// Null in the first quarter of a second.
        pace: Option<Pace>,
        /// What is wrong if, after a gap, the rest of the taxels of frames differs from the tare.
        rest_shift: Option<String>,
        /// Whether the values of frames fall under touch, so that no pressure is shown.
        falls: bool,
        lost: Lost,
        /// Datagrams that wait.
        queue: u64,
        latency: Latency,
        wire_version: u8,
        marked_start: Option<bool>,
        taring: bool,
        detections: u64,
        /// From and to where a live view may seek (60 s, or what 512 MB hold), us; null before the first event.
        reach_us: Option<(i64, i64)>,
        reach_bytes: usize,
        viewers: usize,
        /// Frames sent to this client.
        sent_frames_per_s: f64,
        /// Whether the source has ended, by an error or its owner.
        ended: bool,
    },
    /// A detection, as it is reported; after the greeting the latest that were reported before.
    Detection {
        label: String,
        t_us: i64,
        known_us: i64,
        reported_us: i64,
        /// From known to reported, us.
        latency_us: i64,
        /// How steeply the potential crosses the threshold; null for a rule.
        slope_mv_per_ms: Option<f64>,
    },
    /// At most 60 times a second, after `encode`: the spikes since the last message; after a seek those of the stretch that is
    /// shown. An encoder that begins in the middle begins with the held values.
    Spikes {
        encoder: String,
        /// Whether its parameters are those of the readout that reads what is shown; else they are those of the request, and the
        /// defaults.
        of_readout: bool,
        trains: usize,
        signed: bool,
        latency_ms: f64,
        t_ms: Vec<f64>,
        train: Vec<u32>,
        value: Vec<f32>,
        /// Number of the others, where there are more than the 4096 newest.
        left_out: usize,
    },
    /// All taxels of the live source that were zeroed, each as it was last; sent when that has changed.
    Zeroed { taxels: Vec<Zeroing> },
    /// A line from the board's serial line.
    BoardLine { at_ns: i64, text: String },
    /// Where a board can be, when asked. Pseudo-terminals are in no list: type their name.
    Places {
        /// Serial ports that the system knows, USB devices first.
        serial: Vec<Port>,
        /// The IPv4 addresses of the machine.
        addresses: Vec<InterfaceAddress>,
    },
    /// The lines that arrive from a source, on request.
    SourcePreview {
        /// The last lines that arrived.
        lines: Vec<String>,
        /// The source with what the lines show added to it: array, lines of a frame, time.
        source: String,
        /// What the lines seem to be, in words.
        about: String,
    },
    /// A layout file was written.
    LayoutSaved {
        name: String,
        /// The command that reads the source in a shell.
        command: String,
    },
    /// When asked: the fields with numbers of the topics of a ROS bag; empty of any other file.
    Topics { name: String, topics: Vec<BagTopic> },
    /// The recorder, on each change and once a second while it counts or records.
    Recorder {
        state: RecorderPhase,
        name: Option<String>,
        /// The one in use, or the next when idle.
        index: Option<u32>,
        file: Option<String>,
        label: Option<String>,
        advance: bool,
        /// To the start of a countdown, or to the end of a recording.
        left_s: Option<f64>,
        seconds: Option<f64>,
        length_s: Option<f64>,
        last: Option<LastRecording>,
        /// Why the last one ended or did not begin.
        error: Option<String>,
    },
    /// When asked and when the folder has changed by this server.
    Recordings {
        folder: String,
        /// A ROS 2 bag that is a folder counts as one file.
        files: Vec<FileInfo>,
        /// The folder's readouts and plain rules (`.json`).
        readouts: Vec<String>,
    },
    /// A training has ended.
    Trained {
        name: String,
        readout: String,
        /// How well the readout detects, in words.
        text: String,
        /// On which labels it was scored: held-out ones, or those that it was trained on.
        judged_on: String,
        /// The neuron of each label, and the plain rule beside it where there is one.
        scores: Vec<LabelScore>,
        /// The labels that neurons missed, and their false detections, among the labels that `scores` count.
        mistakes: Vec<Mistake>,
        /// The command that detects by it in a shell; empty if it cannot be relied on.
        next: String,
    },
    /// When asked: the latest progress of the training that runs, first after 2 s; empty before, and where none
    /// runs.
    Training { text: String },
    /// When asked: what a readout found in a recording.
    Detections {
        source: String,
        readout: String,
        /// The readout's, in its order.
        labels: Vec<String>,
        /// The names of the readout's encoders; empty of a plain rule.
        #[cfg_attr(feature = "development", schemars(with = "Vec<String>"))]
        encoders: ReadoutEncoders,
        detections: Vec<FoundDetection>,
    },
    /// The answer to `open`, before its first frame; `labels` and `transport` follow.
    Opened {
        name: String,
        array: ArrayInfo,
        /// Null where it holds no events, as `stop_us`.
        start_us: Option<i64>,
        stop_us: Option<i64>,
        /// The time of the greatest force in the first touch; null where there is no force.
        touch_us: Option<i64>,
        /// 0 of frames.
        events: u64,
        bytes: u64,
        /// The command that trains on its labels.
        train: String,
        frames: Option<FrameRecording>,
        /// What was lost; empty where a file of frames does not say.
        verdict: String,
        unfinished: bool,
        /// Of events, where something lay in the quiet stretch that the rest is first taken from, as of a source of frames.
        preload_at: String,
        /// The pace of the recorded arrivals, where the recording holds them.
        pace: Option<Pace>,
        #[cfg_attr(feature = "development", schemars(with = "Option<shapes::Registers>"))]
        registers: Option<Registers>,
        /// How long a frame takes, where the recording holds the registers.
        frame_us: Option<f64>,
        markers: Vec<Marker>,
        notes: Vec<RecordedNote>,
        zeroed: Vec<Zeroing>,
        detections: Vec<FoundDetection>,
        /// How long reading it took.
        index_ms: f64,
    },
    /// How much of a large text table is read, 0 to 1, as its first lines let expect.
    Loading { name: String, share: f64 },
    /// Events, and the greatest sum of ticks above rest, over time, for the strip: 1000 bins at most.
    Overview {
        /// Null for the live one.
        source: Option<String>,
        start_us: i64,
        step_us: i64,
        /// Empty of frames.
        events: Vec<u64>,
        /// Empty where the recording is too long for its curves to be stored.
        force: Vec<u32>,
    },
    /// When a view's state changes by itself or by request.
    Transport { source: Option<String>, state: ViewState, speed: f64, t_us: Option<i64> },
    /// With `opened`, and to all clients that show that recording when they change.
    Labels {
        name: String,
        /// The table beside the recording.
        path: String,
        labels: Vec<Label>,
    },
    /// By the rules of `taxel.Recording` health (`taxel info`). A taxel is reported dead or stuck only where its neighbours were
    /// touched three times or more, or are known to rest above 0 and it is known to hold 0; or stuck where it holds the greatest
    /// value of all while its neighbours move.
    Health {
        source: Option<String>,
        taxels: usize,
        /// Taxels with events.
        active: usize,
        #[serde(flatten)]
        found: UnhealthyTaxels,
    },
    /// `lost` is what the new file's kind cannot hold.
    Cut { name: String, lost: Vec<String> },
    /// After the messages about everything that the request changed.
    Done {
        #[cfg_attr(feature = "development", schemars(with = "shapes::Id"))]
        id: Value,
    },
    /// Nothing has changed.
    Refused {
        #[cfg_attr(feature = "development", schemars(with = "Option<shapes::Id>"))]
        id: Value,
        /// The `type` of the request.
        #[serde(rename = "what")]
        request: String,
        reason: String,
        /// The register or key at fault.
        field: Option<String>,
    },
    /// Text for the user; the client need not do anything.
    Warning { text: String },
}

impl Message {
    /// The text that is sent.
    pub(crate) fn text(&self) -> String {
        json!(self).to_string()
    }

    pub(crate) fn refused(id: Value, request: String, Refusal { reason, field }: Refusal) -> Self {
        Self::Refused { id, request, reason, field }
    }

    pub(crate) fn warning(text: impl std::fmt::Display) -> Self {
        Self::Warning { text: text.to_string() }
    }

    pub(crate) fn detection(output: &OutputDetection) -> Self {
        let OutputDetection { detection, reported_us, .. } = output;
        Self::Detection {
            label: detection.label.clone(),
            t_us: detection.t,
            known_us: detection.known,
            reported_us: *reported_us,
            latency_us: reported_us - detection.known,
            slope_mv_per_ms: (!detection.slope.is_nan()).then_some(detection.slope),
        }
    }

    pub(crate) fn zeroed<'a>(zeroed: impl IntoIterator<Item = &'a encode::Zeroing>) -> Self {
        Self::Zeroed { taxels: zeroed.into_iter().map(Zeroing::from).collect() }
    }
}

/// A sensor.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "development", derive(schemars::JsonSchema))]
pub(crate) struct ArrayInfo {
    // Pitch and places are as in files.
    #[serde(flatten)]
    #[cfg_attr(feature = "development", schemars(with = "shapes::Array"))]
    array: Array,
    /// A digit a taxel, 0 or 1, row by row; null where all exist.
    exists: Option<String>,
}

impl From<&Array> for ArrayInfo {
    fn from(array: &Array) -> Self {
        let digit = |&exists: &bool| if exists { '1' } else { '0' };
        let exists = array.exists.as_ref().map(|all| all.iter().map(digit).collect());
        Self { array: Array { exists: None, ..array.clone() }, exists }
    }
}

/// Counts of lost data, by cause.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "development", derive(schemars::JsonSchema))]
pub(crate) struct Lost {
    /// Messages; `null` where the system does not count them.
    pub(crate) kernel: Option<u64>,
    /// Datagrams.
    pub(crate) queue: u64,
    /// Datagrams of version 2 that never arrived intact.
    pub(crate) wire: u64,
    /// Bytes that were not valid words.
    pub(crate) damaged: u64,
    /// Taxels outside the array.
    pub(crate) outside: u64,
    /// Events that found no room before the readout.
    pub(crate) readout: u64,
    /// Events that only the panel's curves and its past lack: its held values are right again within 0.1 s.
    pub(crate) panel: u64,
}

#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "development", derive(schemars::JsonSchema))]
pub(crate) struct Latency {
    pub(crate) decode: Quantiles,
    /// Of detections, from known to reported.
    pub(crate) report: Quantiles,
}

/// A taxel that was zeroed.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "development", derive(schemars::JsonSchema))]
pub(crate) struct Zeroing {
    taxel: (u16, u16),
    t_us: i64,
    /// Its rest now, ticks.
    rest: f64,
    /// The readout's rest of it before; null where it uses none.
    before: Option<f64>,
}

impl From<&encode::Zeroing> for Zeroing {
    fn from(&encode::Zeroing { t, x, y, rest, before }: &encode::Zeroing) -> Self {
        Self { taxel: (x, y), t_us: t, rest, before }
    }
}

/// An IPv4 address and its network interface.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "development", derive(schemars::JsonSchema))]
pub(crate) struct InterfaceAddress {
    pub(crate) host: String,
    pub(crate) name: String,
}

/// What the recorder does.
#[derive(Debug, Clone, Copy, Serialize)]
#[serde(rename_all = "snake_case")]
#[cfg_attr(feature = "development", derive(schemars::JsonSchema), schemars(inline))]
pub(crate) enum RecorderPhase {
    Idle,
    Countdown,
    Recording,
    Finishing,
}

/// The last recording.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "development", derive(schemars::JsonSchema))]
pub(crate) struct LastRecording {
    pub(crate) file: String,
    pub(crate) verdict: String,
}

/// A recording of the folder.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "development", derive(schemars::JsonSchema))]
pub(crate) struct FileInfo {
    pub(crate) name: String,
    pub(crate) bytes: u64,
    pub(crate) modified_ns: u64,
    /// Number of its labels, once they have been read.
    pub(crate) labels: Option<usize>,
}

/// A detection in a recording.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "development", derive(schemars::JsonSchema))]
pub(crate) struct FoundDetection {
    pub(crate) label: String,
    pub(crate) t_us: i64,
    pub(crate) known_us: i64,
    /// Which of several sensors it is of; empty of a single one.
    pub(crate) source: String,
}

/// The values of a live source of frames.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "development", derive(schemars::JsonSchema))]
pub(crate) struct LiveFrames {
    pub(crate) unit: String,
    /// A value is `(ticks - zero) * step`.
    pub(crate) step: f64,
    pub(crate) zero: u16,
    /// Time of the first frame, us: seconds are shown since then where times are those since 1970.
    pub(crate) begin_us: i64,
}

/// A recording of frames.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "development", derive(schemars::JsonSchema))]
pub(crate) struct FrameRecording {
    pub(crate) count: u64,
    pub(crate) unit: String,
    /// A value is `(ticks - zero) * step`.
    pub(crate) step: f64,
    pub(crate) zero: u16,
    /// Steps above rest up to which a taxel is not loaded.
    pub(crate) floor: u16,
    /// The force of 1 in the sums of the curves, N, where values are in kPa and the area of each taxel is known: each counts by
    /// its area; else null, and 1 is a step.
    pub(crate) newtons: Option<f64>,
    /// A number where the frames have no times: frame k is then at k times that many us, in all messages; show the number,
    /// no seconds. Tables of labels hold the numbers.
    pub(crate) number_us: Option<i64>,
    pub(crate) sources: Vec<FrameSourceInfo>,
    /// Taxels that never count as above rest.
    pub(crate) flickering: Vec<(usize, usize)>,
    pub(crate) trial: Option<String>,
    /// The trials of a file with several.
    pub(crate) trials: Vec<String>,
    /// These are only the frames at the beginning of a large text table, and reading it all takes about so many seconds;
    /// `loading` follows each second, and then `opened` again, with all of it, at the same time of the view.
    pub(crate) left_s: Option<f64>,
}

/// A source of frames; sources are side by side in `array`.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "development", derive(schemars::JsonSchema))]
pub(crate) struct FrameSourceInfo {
    pub(crate) name: String,
    /// Its first column.
    pub(crate) left: u16,
    pub(crate) rows: u16,
    pub(crate) columns: u16,
    /// `given`: 0, as the unit is one of force or pressure; `quiet`: that of a quiet stretch, tracked from there; `none`: nothing
    /// was quiet, the values are above 0.
    #[cfg_attr(feature = "development", schemars(with = "shapes::RestSource"))]
    pub(crate) rest: &'static str,
    /// Whether values fall from that of a quiet stretch, so that less may mean more pressure.
    pub(crate) falls: bool,
    /// Where something lay in that stretch and was taken away later, as text (`rows 2 to 4, columns 5 to 7 (up to 41 above
    /// rest)`); empty where nothing did.
    pub(crate) preload_at: String,
}

/// A marker of the board's own recording.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "development", derive(schemars::JsonSchema))]
pub(crate) struct Marker {
    pub(crate) t_us: i64,
    pub(crate) start: bool,
}

/// A note of a recording.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "development", derive(schemars::JsonSchema))]
pub(crate) struct RecordedNote {
    /// Null where it is about the whole recording.
    pub(crate) t_us: Option<i64>,
    pub(crate) text: String,
    /// Empty for all sources.
    pub(crate) source: String,
}

/// What a view does.
#[derive(Debug, Clone, Copy, Serialize)]
#[serde(rename_all = "snake_case")]
#[cfg_attr(feature = "development", derive(schemars::JsonSchema), schemars(inline))]
pub(crate) enum ViewState {
    /// The live source.
    Following,
    Playing,
    Paused,
}

/// A label of a recording.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "development", derive(schemars::JsonSchema))]
pub(crate) struct Label {
    /// Valid as long as the server runs.
    pub(crate) label_id: u64,
    #[serde(flatten)]
    pub(crate) row: LabelRow,
}

/// What types of the core look like as JSON.
#[cfg(feature = "development")]
#[allow(dead_code, missing_docs)]
mod shapes {
    use std::collections::BTreeMap;

    use schemars::JsonSchema;

    pub(crate) type Registers = BTreeMap<String, crate::protocol::limited::RegisterValue>;

    #[derive(JsonSchema)]
    pub(crate) struct Array {
        rows: u16,
        columns: u16,
        /// A number of mm, or a pair for rows and columns; null where it is not known. A pitch of 1 mm is a pair.
        pitch_mm: Option<PitchShape>,
        name: String,
        /// Only where they are known instead of a pitch.
        #[schemars(default, skip_serializing_if = "Option::is_none")]
        places: Option<TaxelPlaces>,
        /// Only where taxels have names, as the columns of a table: a text a taxel row by row, "" for one without.
        #[serde(skip_serializing_if = "Option::is_none")]
        names: Option<Vec<String>>,
    }

    #[derive(JsonSchema)]
    #[schemars(untagged, inline)]
    enum PitchShape {
        Square(f64),
        Pair(f64, f64),
    }

    /// The place of each taxel, row by row.
    #[derive(JsonSchema)]
    struct TaxelPlaces {
        x: Vec<f64>,
        y: Vec<f64>,
        /// Where it is known.
        area: Option<Vec<f64>>,
        /// Null where it is unknown.
        unit: Option<Unit>,
    }

    #[derive(JsonSchema)]
    #[schemars(rename_all = "snake_case", inline)]
    enum Unit {
        Mm,
    }

    #[derive(JsonSchema)]
    #[schemars(rename_all = "snake_case", inline)]
    pub(crate) enum RestSource {
        Given,
        Quiet,
        None,
    }

    #[derive(JsonSchema)]
    #[schemars(untagged, inline)]
    pub(crate) enum Id {
        Number(i64),
        Text(String),
    }
}
