//! A recording of the folder with its index: of events or of pictures, and the messages about it.

use std::sync::Arc;
use std::time::Instant;

use serde_json::{Value, json};

use super::keyframe_index::KeyframeIndex;
use super::keyframe_index::pictures::PictureIndex;
use super::keyframe_index::recording::RecordingIndex;
use super::messages;
use super::time_columns::{COLUMN_US, TimeColumns};

/// An indexed recording.
#[derive(Debug, Clone)]
pub(super) enum Indexed {
    Events(Arc<RecordingIndex>),
    Pictures(Arc<PictureIndex>),
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

    /// The `opened` message; `bytes` is the size of the file.
    pub(super) fn opened(&self, name: &str, bytes: u64, begun: Instant) -> Value {
        let index = self.index();
        let range = index.range();
        // The end of the column, which has all of its force.
        let touch = index.time_columns().and_then(TimeColumns::first_touch);
        let touch_us =
            touch.zip(range).map(|(column, (first, last))| ((column + 1) * COLUMN_US - 1).clamp(first, last));
        let mut message = json!({
            "type": "opened",
            "name": name,
            "array": messages::array(index.array()),
            "start_us": range.map(|(first, _)| first),
            "stop_us": range.map(|(_, last)| last),
            "touch_us": touch_us,
            "bytes": bytes,
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
                    "pictures": null,
                });
                (&index.remarks, more)
            }
            Self::Pictures(index) => {
                let file = &index.file;
                let places = index.places().map(|place| {
                    json!({ "name": place.name, "left": place.left, "rows": place.rows, "columns": place.columns })
                });
                let more = json!({
                    "events": 0,
                    "verdict": file.verdict,
                    "unfinished": false,
                    "registers": null,
                    "frame_us": null,
                    "pictures": {
                        "count": index.pictures, "unit": file.unit, "step": index.step, "zero": index.zero,
                        "picture_us": file.picture_us, "sources": places.collect::<Vec<_>>(),
                        "trial": file.trial, "trials": file.trials, "left_s": file.left_s,
                    },
                });
                (&file.remarks, more)
            }
        };
        let us = self.us();
        let detections = remarks.detections.iter().take(messages::MOST_DETECTIONS);
        let more_of_all = json!({
            "notes": remarks.notes.iter().map(|n| json!({ "t_us": n.t_us.map(|t| t * us), "text": n.text })).collect::<Vec<_>>(),
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
