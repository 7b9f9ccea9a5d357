//! The small messages of a recording: registers, markers, notes, detections, counts, and others.

use std::collections::BTreeMap;

use base64::Engine;
use base64::prelude::BASE64_STANDARD as STANDARD;
use serde_json::Value;
use taxel_core::Marker;
use taxel_core::detect::Detection;
use taxel_core::encode::Zeroing;
use taxel_core::held::UNKNOWN;
use taxel_core::wire::{self, Registers};

use super::message::Message;
use crate::recording::{BoardChange, BoardChangeKind, Note, RecordingCounts, Topic};

/// All small messages of a recording.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Remarks {
    /// The board's registers each time they were set, with the host's time, ns.
    pub registers: Vec<(i64, Registers)>,
    /// Starts and stops, as marked by the board.
    pub markers: Vec<Marker>,
    /// Notes written by users.
    pub notes: Vec<Note>,
    /// Taxels that users zeroed, with the host's time, ns.
    pub zeroings: Vec<(i64, Zeroing)>,
    /// Detections, with the host's time at which they were recorded, ns.
    pub detections: Vec<(i64, Detection)>,
    /// The last counts before the end of the recording.
    pub counts: Option<RecordingCounts>,
    /// Number of datagrams.
    pub datagrams: u64,
    /// Number of bytes in the datagrams.
    pub datagram_bytes: u64,
    /// Times of the first and the last arrival, ns since 1970.
    pub arrivals: Option<(i64, i64)>,
    /// Number of messages of each channel.
    pub messages: BTreeMap<Topic, u64>,
    /// Resets of the board, and changes of its version of the wire.
    pub board: Vec<BoardChange>,
    /// The taxels' values at the beginning of the recording, ticks by index, 65 535 for a taxel without any event so
    /// far; none if the recording does not state them.
    pub held: Option<Vec<u16>>,
}

impl Remarks {
    /// Adds a message; datagrams and frames are only counted.
    pub fn add(&mut self, message: &Message<'_>) {
        *self.messages.entry(message.topic).or_default() += 1;
        match message.topic {
            Topic::Datagrams => {
                self.datagrams += 1;
                self.datagram_bytes += message.data.len() as u64;
                let (first, last) = self.arrivals.unwrap_or((message.at_ns, message.at_ns));
                self.arrivals = Some((first.min(message.at_ns), last.max(message.at_ns)));
            }
            Topic::Pressure | Topic::Frames | Topic::Lines => {}
            // The checksum of a message that does not parse is valid, so another program wrote the message; it is
            // ignored.
            Topic::Registers => {
                if let Ok(value) = serde_json::from_slice(message.data) {
                    self.registers.push((message.at_ns, value));
                }
            }
            Topic::Markers => {
                if let Ok(value) = serde_json::from_slice::<Value>(message.data)
                    && let (Some(t), Some(start)) = (value["t_us"].as_i64(), value["start"].as_bool())
                {
                    self.markers.push(Marker { t, start });
                }
            }
            Topic::Notes => {
                if let Ok(value) = serde_json::from_slice::<Value>(message.data)
                    && let Some(text) = value["message"].as_str()
                {
                    let t_us = value["t_us"].as_i64();
                    if let Some(zeroing) = zeroing(t_us, &value["zeroed"]) {
                        self.zeroings.push((message.at_ns, zeroing));
                        return;
                    }
                    self.notes.push(Note { at_ns: message.at_ns, t_us, text: text.to_owned() });
                }
            }
            Topic::Detections => {
                if let Ok(value) = serde_json::from_slice::<Value>(message.data)
                    && let (Some(label), Some(t), Some(known)) =
                        (value["label"].as_str(), value["t_us"].as_i64(), value["known_us"].as_i64())
                {
                    // JSON has no NaN: an unknown slope is written as null.
                    let slope = value["slope"].as_f64().unwrap_or(f64::NAN);
                    let (label, repaired) = (label.to_owned(), value["repaired"].as_bool().unwrap_or(false));
                    self.detections.push((message.at_ns, Detection { label, t, known, slope, repaired }));
                }
            }
            Topic::Held => {
                self.held = held(message.data).or(self.held.take());
            }
            Topic::Board => {
                if let Ok(value) = serde_json::from_slice::<BoardChange>(message.data)
                    && !matches!(value.change, BoardChangeKind::Clock { .. })
                {
                    self.board.push(BoardChange { at_ns: message.at_ns, ..value });
                }
            }
            Topic::Counts => self.counts = serde_json::from_slice(message.data).ok().or(self.counts.take()),
        }
    }
}

/// The taxels' values in a message of the channel `held`, ticks by taxel index; 65 535 for a taxel without any event so
/// far.
fn held(data: &[u8]) -> Option<Vec<u16>> {
    let value: Value = serde_json::from_slice(data).ok()?;
    let ticks = STANDARD.decode(value["ticks"].as_str()?).ok()?;
    Some(ticks.chunks_exact(2).map(|two| u16::from_le_bytes([two[0], two[1]])).collect())
}

/// Passes the taxels' values before the recording's first datagram to a decoder.
pub(super) fn begin_with(decoder: &mut wire::SenderDecoder, data: &[u8]) {
    if let Some(held) = held(data) {
        decoder.begin_with(held.iter().map(|ticks| (*ticks != UNKNOWN).then_some(*ticks)));
    }
}

/// The zeroing that a note states; `None` of any other note.
fn zeroing(t_us: Option<i64>, value: &Value) -> Option<Zeroing> {
    let number = |key: &str| value[key].as_u64().and_then(|n| u16::try_from(n).ok());
    let (t, x, y) = (t_us?, number("x")?, number("y")?);
    Some(Zeroing { t, x, y, rest: value["rest"].as_f64()?, before: value["before"].as_f64() })
}
