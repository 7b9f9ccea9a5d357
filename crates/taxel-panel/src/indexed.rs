//! A recording of the folder with its index: of events or of pictures, and the messages about it.

use std::sync::Arc;
use std::time::Instant;

use serde_json::{Value, json};

use super::keyframe_index::KeyframeIndex;
use super::keyframe_index::pictures::PictureIndex;
use super::keyframe_index::recording::RecordingIndex;
use super::messages;
use super::time_columns::{COLUMN_US, TimeColumns};

/// A label may lie so long before the first event or after the last one, us.
const LATE_LABEL_US: i64 = 1_000_000;

/// An indexed recording.
#[derive(Debug, Clone)]
pub(super) enum Indexed {
    Events(Arc<RecordingIndex>),
    Pictures(Arc<PictureIndex>),
}

/// The recording that a client shows.
#[derive(Debug, Clone)]
pub(super) struct Shown {
    pub(super) name: String,
    /// Its trial, where the file holds several.
    pub(super) trial: Option<String>,
    pub(super) indexed: Indexed,
}

impl Indexed {
    pub(super) fn index(&self) -> Arc<dyn KeyframeIndex> {
        match self {
            Self::Events(index) => Arc::new(Arc::clone(index)),
            Self::Pictures(index) => Arc::new(Arc::clone(index)),
        }
    }

    /// The trial of its file that it is, where the file has several.
    pub(super) fn trial(&self) -> Option<&str> {
        match self {
            Self::Events(_) => None,
            Self::Pictures(index) => index.file.trial.as_deref(),
        }
    }

    /// Time in the index of one us of the file: above 1 where pictures are numbered, one a us.
    pub(super) fn us(&self) -> i64 {
        match self {
            Self::Events(_) => 1,
            Self::Pictures(index) => index.file.picture_us.unwrap_or(1),
        }
    }

    /// Refuses a label outside the recording: a late label of its last touch may lie a little after the last event.
    pub(super) fn check_label(&self, name: &str, t_us: i64) -> Result<(), String> {
        let Some((first, last)) = self.index().range() else { return Ok(()) };
        let late_us = match self {
            Self::Events(_) => LATE_LABEL_US,
            // A picture holds until the next one.
            Self::Pictures(index) => index.picture_us(),
        };
        let (beyond, end) = match (first - t_us, t_us - last) {
            (before, _) if before > late_us => (before, "before the begin"),
            (_, after) if after > late_us => (after, "after the end"),
            _ => return Ok(()),
        };
        #[allow(clippy::cast_precision_loss)]
        let far = match self.us() {
            1 => format!("{:.3} s", beyond as f64 / 1e6),
            us => format!("{} pictures", beyond / us),
        };
        Err(format!("a label {far} {end} of {name}: must lie within it"))
    }

    /// The `overview` message.
    pub(super) fn overview(&self, name: &str) -> Value {
        let (start, step, bins, events) = match self {
            Self::Events(index) => {
                let (start, step, events) = &index.event_rate;
                (*start, *step, events.len(), &events[..])
            }
            Self::Pictures(index) => {
                let (start, step, bins) = index.bins();
                (start, step, bins, &[][..])
            }
        };
        let index = self.index();
        let force = index.time_columns().map(|columns| columns.greatest_sums(start, step, bins, COLUMN_US));
        json!({
            "type": "overview", "source": name, "start_us": start, "step_us": step, "events": events,
            "force": force.unwrap_or_default(),
        })
    }

    /// The `opened` message; `bytes` is the size of the file, `train` the command that trains on its labels.
    pub(super) fn opened(&self, name: &str, bytes: u64, train: &str, begun: Instant) -> Value {
        let index = self.index();
        let range = index.range();
        // The end of the column, which has all of its force.
        let touch = index.time_columns().and_then(TimeColumns::first_touch);
        let touch_us =
            touch.zip(range).map(|(column, (first, last))| ((column + 1) * COLUMN_US - 1).clamp(first, last));
        let touch_us = match self {
            Self::Events(_) => touch_us,
            Self::Pictures(index) => touch_us.map(|t| index.picture_until(t).unwrap_or(t)),
        };
        let mut message = json!({
            "type": "opened",
            "name": name,
            "array": messages::array(index.array()),
            "start_us": range.map(|(first, _)| first),
            "stop_us": range.map(|(_, last)| last),
            "touch_us": touch_us,
            "bytes": bytes,
            "train": train,
            "index_ms": begun.elapsed().as_secs_f64() * 1e3,
        });
        let (remarks, more) = match self {
            Self::Events(index) => {
                let header = index.header();
                let more = json!({
                    "events": index.events,
                    "verdict": index.verdict,
                    "unfinished": index.unfinished,
                    "registers": header.registers,
                    "frame_us": header.registers.map(|registers| registers.frame_us()),
                    "pace": index.pace,
                    "on": index.on,
                    "pictures": null,
                });
                (&index.remarks, more)
            }
            Self::Pictures(index) => {
                let file = &index.file;
                let places = index.places().map(|(place, rest, falls, on)| {
                    json!({
                        "name": place.name, "left": place.left, "rows": place.rows, "columns": place.columns,
                        "rest": rest.name(), "falls": falls, "on": on,
                    })
                });
                let more = json!({
                    "events": 0,
                    "verdict": file.verdict,
                    "unfinished": false,
                    "registers": null,
                    "frame_us": null,
                    "pace": null,
                    "on": "",
                    "pictures": {
                        "count": index.pictures, "unit": file.unit, "step": index.step, "zero": index.zero, "floor": index.floor,
                        "newtons": index.newtons, "picture_us": file.picture_us, "sources": places.collect::<Vec<_>>(),
                        "flickering": index.flickering().collect::<Vec<_>>(),
                        "trial": file.trial, "trials": file.trials, "left_s": file.left_s,
                    },
                });
                (&file.remarks, more)
            }
        };
        let us = self.us();
        let note_sources = match self {
            Self::Events(_) => &[],
            Self::Pictures(index) => &index.file.note_sources[..],
        };
        let note_sources = note_sources.iter().map(String::as_str).chain(std::iter::repeat(""));
        let notes = remarks.notes.iter().zip(note_sources);
        let notes =
            notes.map(|(n, source)| json!({ "t_us": n.t_us.map(|t| t * us), "text": n.text, "source": source }));
        let detections = remarks.detections.iter().take(messages::MOST_DETECTIONS);
        let more_of_all = json!({
            "notes": notes.collect::<Vec<_>>(),
            "markers": remarks.markers.iter().map(|m| json!({ "t_us": m.t * us, "start": m.start })).collect::<Vec<_>>(),
            "zeroed": remarks.zeroings.iter().map(|(_, one)| messages::zeroing(one)).collect::<Vec<_>>(),
            "detections": detections
                .map(|(_, d)| json!({ "label": d.label, "t_us": d.t * us, "known_us": d.known * us }))
                .collect::<Vec<_>>(),
        });
        if let Value::Object(message) = &mut message {
            for part in [more, more_of_all] {
                if let Value::Object(part) = part {
                    message.extend(part);
                }
            }
        }
        message
    }
}
