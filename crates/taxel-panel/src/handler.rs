//! Requests that the server passes to the program that started it.
//!
//! They concern other parts of that program (the board's serial line, cutting, label tables, presets) and may block, so
//! the server makes them in threads of their own.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Serialize;
use taxel_core::Array;
use taxel_core::wire::Command;

use super::keyframe_index::Activity;
use super::keyframe_index::frames::FrameIndex;

/// The answer to a request, or the reason for a refusal in words for a person.
pub type Reply<T> = Result<T, String>;

/// New lines from the board's serial line, and the number of resets that the board has reported.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct BoardLines {
    /// The lines, oldest first.
    pub lines: Vec<String>,
    /// Resets so far.
    pub resets: u64,
}

/// A value in a preset of the user, whose file may have been edited by hand.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
#[cfg_attr(feature = "development", derive(schemars::JsonSchema), schemars(inline))]
pub enum PresetValue {
    /// Of a register of one bit.
    Flag(bool),
    /// Of any other register, in its own unit.
    Number(i64),
    /// Anything else in the file, which no register accepts.
    #[cfg_attr(feature = "development", schemars(skip))]
    Other(String),
}

/// A preset of the user: value by register name.
pub type UserPreset = BTreeMap<String, PresetValue>;

/// How a neuron, or the plain rule beside it, detects a label.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "development", derive(schemars::JsonSchema))]
pub struct LabelScore {
    /// The label.
    pub label: String,
    /// Whether it is the plain rule's.
    pub is_plain_rule: bool,
    /// Number of labels with a detection.
    pub found: u64,
    /// Number of labels without one.
    pub missed: u64,
    /// Number of detections without a label.
    #[serde(rename = "false")]
    pub wrong: u64,
    /// From the label until the detection is known, median, ms; null where none was found.
    pub delay_ms: Option<f64>,
}

/// A label without a detection of the neuron, or a detection without a label.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "development", derive(schemars::JsonSchema))]
pub struct Mistake {
    /// The label.
    pub label: String,
    /// Board time, us.
    pub t_us: i64,
    /// Whether a label was missed; else a detection is false.
    pub is_missed: bool,
    /// The sensor that it is of, where the recording has several; else empty.
    pub source: String,
    /// The trial that it is of, where the file holds several; else empty.
    pub trial: String,
}

/// What a training has made.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TrainingResult {
    /// How well the readout detects, in words.
    pub text: String,
    /// On which labels it was scored, in words.
    pub judged_on: String,
    /// The scores of each label, of the neuron and of the plain rule.
    pub scores: Vec<LabelScore>,
    /// What the neurons missed or detected falsely, with times as in the file.
    pub mistakes: Vec<Mistake>,
    /// The command that detects by it in a shell; empty if it cannot be relied on.
    pub next: String,
}

/// A field of a topic of a ROS bag that holds numbers.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "development", derive(schemars::JsonSchema))]
pub struct BagTopic {
    /// The topic.
    pub topic: String,
    /// The field; empty for a topic of images.
    pub field: String,
    /// Numbers in a message: rows and columns where the message states them.
    pub shape: Vec<u64>,
    /// Number of messages.
    pub messages: u64,
    /// Why it cannot be read; empty where it can.
    pub trouble: String,
}

/// What a layout file says of a recording; `None` is not changed.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Description {
    /// Whether values fall with pressure.
    pub falls: Option<bool>,
    /// Frames a second.
    pub rate_hz: Option<f64>,
    /// Rows and columns.
    pub size: Option<(u16, u16)>,
    /// The topic of a ROS bag, and its field (empty for none).
    pub topic: Option<(String, String)>,
}

/// The presets of the user.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct UserPresets {
    /// The file that holds them.
    pub path: PathBuf,
    /// The presets by name.
    pub presets: BTreeMap<String, UserPreset>,
}

/// A label of a recording.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "development", derive(schemars::JsonSchema))]
pub struct LabelRow {
    /// Its text; empty where a note of the recording is to count no more, and no label does in its place.
    pub label: String,
    /// Board time, us.
    pub t_us: i64,
    /// The source that it is of; empty for all of them.
    pub source: String,
    /// The trial that it is of, where the file holds several; empty for all of them.
    pub trial: String,
    /// Time of the recording's own note that it replaces, us.
    pub replaces_us: Option<i64>,
    /// Its time by the host's clock, ns since 1970, where its table has one and nobody has moved it since.
    #[serde(skip)]
    pub host_ns: Option<i64>,
}

/// A change of a table of labels: `new` in the place of `old`. Without `old` it marks a label, unless the table has it
/// already; without `new` it deletes one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LabelEdit {
    /// The label as it is known.
    pub old: Option<LabelRow>,
    /// The label as it is to be.
    pub new: Option<LabelRow>,
}

/// How times of a table of labels become those of the view.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LabelTimes {
    /// How long one us of the file is in the view: above 1 where frames are numbered.
    pub us: i64,
    /// The first time of the recording in the view, us, from which tables may count.
    pub begin_us: i64,
}

impl Default for LabelTimes {
    fn default() -> Self {
        Self { us: 1, begin_us: 0 }
    }
}

/// A table of labels as it was read.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct LabelTable {
    /// The labels of the recording, and the rows without a label that remove a note.
    pub rows: Vec<LabelRow>,
    /// The number of each request that was written, by which it can be undone; `None` where it changed nothing.
    pub changes: Vec<Option<u64>>,
}

/// What became of a request of label edits: the rows as they were written, one an edit, or why none of them was carried out.
pub type EditOutcome = Result<Vec<Option<LabelRow>>, String>;

/// Taxels (column, row) that do not work as they should.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "development", derive(schemars::JsonSchema))]
pub struct UnhealthyTaxels {
    /// That did nothing while they were touched, and hold 0 as far as is known.
    pub dead: Vec<(u16, u16)>,
    /// That did nothing while they were touched, and hold another value.
    pub stuck: Vec<(u16, u16)>,
    /// That change by themselves.
    pub noisy: Vec<(u16, u16)>,
    /// Number of taxels that were not touched enough to say.
    pub untested: u64,
}

/// What a readout found in a recording.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Detected {
    /// The readout's labels, in its order.
    pub labels: Vec<String>,
    /// Its encoder as JSON, with the tare that it read with; `None` of a plain rule.
    pub encoder: Option<String>,
    /// Label, time, when it was known, us, and which of several sensors it is of.
    pub detections: Vec<(String, i64, i64, String)>,
}

/// How much of a file is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Opening {
    /// The beginning of a large text table, so that something is shown soon; all of any other file.
    Beginning,
    /// All of it.
    Whole,
}

/// A file that the program that started the panel has read.
#[derive(Debug)]
pub enum ReadFile {
    /// Events: a `.mcap` that holds them.
    Events(PathBuf),
    /// Frames.
    Frames(FramesRead),
}

/// Frames that were read.
#[derive(Debug)]
pub struct FramesRead(pub Box<FrameIndex>);

/// The stretch of a recording that is to be cut out.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Cut<'a> {
    /// The recording.
    pub path: &'a Path,
    /// Its trial, where the file holds several.
    pub trial: Option<&'a str>,
    /// The new file.
    pub out: &'a Path,
    /// Start, us of the board's clock.
    pub start_us: i64,
    /// End, us of the board's clock.
    pub stop_us: i64,
}

/// Requests about the board: its serial line, and the source that receives its datagrams.
#[allow(clippy::missing_errors_doc)]
pub trait BoardRequests: Send + Sync {
    /// Sends a register command to the board; returns the value that the board reports.
    fn command(&self, command: Command) -> Reply<u32>;

    /// Asks the board for its greeting; returns the number of converter channels.
    fn channels(&self) -> Reply<u8>;

    /// Returns the lines that the board has sent since the last call.
    fn board_lines(&self) -> Reply<BoardLines>;

    /// Connects the board's serial line, or disconnects it.
    fn connect(&self, address: Option<&str>) -> Reply<()>;

    /// Receives the board's datagrams on another address.
    fn listen(&self, host: &str, port: u16) -> Reply<()>;

    /// Receives another source, as a text names it.
    fn read_source(&self, source: &str) -> Reply<()>;

    /// Interprets intensities as differences, or as values.
    fn set_differences(&self, on: bool) -> Reply<()>;

    /// Returns the IPv4 addresses of this machine, each with the name of its network interface.
    fn addresses(&self) -> Reply<Vec<(String, String)>>;

    /// Reads the live source out with this readout from now on.
    fn read_out(&self, readout: &Path) -> Reply<()>;
}

/// Requests about the recordings of the panel's folder.
#[allow(clippy::missing_errors_doc)]
pub trait FileRequests: Send + Sync {
    /// Finds taxels that are dead, stuck or noisy.
    fn health(&self, array: &Array, activity: &Activity) -> Reply<UnhealthyTaxels>;

    /// Returns the names of what is a recording in a folder.
    fn recordings(&self, folder: &Path) -> Reply<Vec<String>>;

    /// Reads a recording that is no file of a board's events.
    fn read(&self, path: &Path, trial: Option<&str>, opening: Opening) -> Reply<ReadFile>;

    /// Finds taxels of a recording of frames that are dead, stuck or noisy.
    fn health_of_frames(&self, path: &Path, trial: Option<&str>) -> Reply<UnhealthyTaxels>;

    /// Writes a stretch of a recording to a new file; returns what that file cannot hold.
    fn cut(&self, cut: &Cut<'_>) -> Reply<Vec<String>>;

    /// Returns the topics of a ROS bag that hold numbers, by their fields; none of any other file.
    fn topics(&self, path: &Path) -> Reply<Vec<BagTopic>>;

    /// Writes what is stated into the layout file beside a recording.
    fn describe(&self, path: &Path, description: &Description) -> Reply<()>;

    /// Writes a new layout file of a source of lines; returns the command that reads it live.
    fn save_layout(&self, source: &str, out: &Path) -> Reply<String>;
}

/// Requests about the tables of labels beside recordings. Times are those of the view.
#[allow(clippy::missing_errors_doc)]
pub trait LabelRequests: Send + Sync {
    /// Reads the labels of a recording from a table, which need not exist.
    fn read(&self, table: &Path, recording: &str, times: LabelTimes) -> Reply<LabelTable>;

    /// Carries out requests in one write of the table as it is now, each of them whole or not at all. Returns when the table
    /// was renamed into its place.
    fn change(
        &self,
        table: &Path,
        recording: &str,
        times: LabelTimes,
        requests: &[Vec<LabelEdit>],
    ) -> Reply<(Vec<EditOutcome>, LabelTable)>;

    /// Takes back a change by its number in [`LabelTable::changes`].
    fn undo(&self, table: &Path, recording: &str, times: LabelTimes, change: u64) -> Reply<LabelTable>;
}

/// Requests about readouts: training one on a recording, and running it on another.
#[allow(clippy::missing_errors_doc)]
pub trait TrainingRequests: Send + Sync {
    /// Trains a readout on the labels of a recording, and writes it to `out`.
    fn train(&self, recording: &Path, out: &Path) -> Reply<TrainingResult>;

    /// Returns what does the same in a shell.
    fn command(&self, recording: &Path, out: &Path) -> Reply<String>;

    /// Returns how far the training that runs is, in words; empty where it has reported nothing.
    fn progress(&self) -> Reply<String>;

    /// Ends the training that runs.
    fn end(&self) -> Reply<()>;

    /// Detections of a readout in a recording, or in a trial of one with several.
    fn detect(&self, recording: &Path, trial: Option<&str>, readout: &Path) -> Reply<Detected>;
}

/// Requests about the user's presets of the board's registers.
#[allow(clippy::missing_errors_doc)]
pub trait PresetRequests: Send + Sync {
    /// Reads the presets of the user.
    fn read(&self) -> Reply<UserPresets>;

    /// Writes the presets of the user.
    fn write(&self, presets: &BTreeMap<String, UserPreset>) -> Reply<()>;
}

/// What handles the requests of a panel, called from any thread, and several at a time. Every method returns the reason where
/// it cannot do what was asked.
pub struct RequestHandlers {
    /// About the board.
    pub board: Box<dyn BoardRequests>,
    /// About recordings.
    pub files: Box<dyn FileRequests>,
    /// About labels.
    pub labels: Box<dyn LabelRequests>,
    /// About readouts.
    pub training: Box<dyn TrainingRequests>,
    /// About presets.
    pub presets: Box<dyn PresetRequests>,
}
