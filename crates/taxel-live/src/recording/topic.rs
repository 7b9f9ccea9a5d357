//! The channels of a recording, with their schemas.

use serde::{Deserialize, Serialize};

use super::causes::Cause;

/// A channel of a recording. Its number is the same in every file, so that a file is readable even if its first chunk,
/// which contains the channel records, is damaged.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[repr(u16)]
pub enum Topic {
    /// Raw datagrams of the board, of either version of the wire.
    Datagrams = 1,
    /// The board's register file, when it was set.
    Registers = 2,
    /// Starts and stops, as marked by the board.
    Markers = 3,
    /// Notes written by users.
    Notes = 4,
    /// Detections of a readout.
    Detections = 5,
    /// Counts of what was received and lost so far.
    Counts = 6,
    /// The low-rate preview.
    Pressure = 7,
    /// The taxels' values at the beginning of the recording.
    Held = 8,
    /// Resets of the board, and changes of its version of the wire.
    Board = 9,
    /// Frames at full rate.
    Frames = 11,
    /// Lines of a source of frames that were not read, as they came.
    Lines = 12,
}

/// Difference of the channel numbers of one source from those of the source before it in the file.
const NEXT_SOURCE: u16 = 16;

impl Topic {
    /// All channels, by number.
    pub const ALL: [Self; 11] = [
        Self::Datagrams,
        Self::Registers,
        Self::Markers,
        Self::Notes,
        Self::Detections,
        Self::Counts,
        Self::Pressure,
        Self::Held,
        Self::Board,
        Self::Frames,
        Self::Lines,
    ];

    /// The channel's name in a file.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Datagrams => "/datagrams",
            Self::Registers => "/registers",
            Self::Markers => "/markers",
            Self::Notes => "/notes",
            Self::Detections => "/detections",
            Self::Counts => "/counts",
            Self::Pressure => "/pressure",
            Self::Held => "/held",
            Self::Board => "/board",
            Self::Frames => "/frames",
            Self::Lines => "/lines",
        }
    }

    /// The encoding of the channel's messages.
    pub(super) fn encoding(self) -> &'static str {
        match self {
            Self::Datagrams => "taxel.wire.v1",
            Self::Frames | Self::Pressure => "protobuf",
            _ => "json",
        }
    }

    /// Name, encoding and text of the schema of the channel's messages; datagrams have none, because they are the board's
    /// own bytes.
    pub(super) fn schema(self) -> Option<(&'static str, &'static str, &'static [u8])> {
        let (name, text) = match self {
            Self::Datagrams => return None,
            // A `FileDescriptorSet` of protobuf: foxglove/RawImage.proto and the time stamp that it uses.
            Self::Frames | Self::Pressure => {
                return Some(("foxglove.RawImage", "protobuf", include_bytes!("schemas/RawImage.bin")));
            }
            Self::Registers => ("taxel.Registers", include_str!("schemas/Registers.json")),
            Self::Markers => ("taxel.Marker", include_str!("schemas/Marker.json")),
            Self::Notes => ("foxglove.Log", include_str!("schemas/Log.json")),
            Self::Detections => ("taxel.Detection", include_str!("schemas/Detection.json")),
            Self::Counts => ("taxel.Counts", include_str!("schemas/Counts.json")),
            Self::Held => ("taxel.Held", include_str!("schemas/Held.json")),
            Self::Board => ("taxel.Board", include_str!("schemas/Board.json")),
            Self::Lines => ("taxel.Line", include_str!("schemas/Line.json")),
        };
        Some((name, "jsonschema", text.as_bytes()))
    }

    /// Whether the channel holds what a source sends: datagrams or frames.
    pub(super) fn is_data(self) -> bool {
        matches!(self, Self::Datagrams | Self::Frames)
    }

    /// The cause of messages of the channel that a file has lost; none where nothing is lost by them.
    pub(super) fn lost_in_file(self) -> Option<Cause> {
        Some(match self {
            Self::Datagrams | Self::Frames => Cause::DataInFile,
            Self::Registers => Cause::RegistersInFile,
            Self::Markers => Cause::MarkersInFile,
            Self::Notes => Cause::NotesInFile,
            Self::Detections => Cause::DetectionsInFile,
            Self::Held => Cause::HeldInFile,
            Self::Board => Cause::ChangesInFile,
            Self::Lines => Cause::LinesInFile,
            // Later counts include them, and datagrams the values of low-rate previews.
            Self::Counts | Self::Pressure => return None,
        })
    }

    /// The number of the channel in a file; `source` is the index of the source.
    pub(super) fn channel(self, source: usize) -> u16 {
        u16::try_from(source).unwrap_or(u16::MAX).saturating_mul(NEXT_SOURCE).saturating_add(self as u16)
    }

    /// The name of the channel in a file; for the first source it is the topic's name alone, but for frames.
    pub(super) fn channel_name(self, source: usize, named: &str) -> String {
        if self == Self::Frames {
            return format!("{}/{named}", self.name());
        }
        if source == 0 { self.name().to_owned() } else { format!("/{named}{}", self.name()) }
    }

    /// The topic of a channel with this name, if the channel belongs to the source.
    pub(super) fn of_name(name: &str, source: usize, named: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|topic| topic.channel_name(source, named) == name)
    }

    /// The topic of a channel with this number in a file of ours, if the channel belongs to the source.
    pub(super) fn of_number(number: u16, source: usize) -> Option<Self> {
        Self::ALL.into_iter().find(|t| t.channel(source) == number)
    }
}
