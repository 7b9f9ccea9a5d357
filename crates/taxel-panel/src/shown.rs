//! A recording with its index, of events or of frames, and what is said of it.

use std::sync::Arc;

use serde_json::{Value, json};
use taxel_core::Array;

use crate::array_state::RestSource;
use crate::keyframe_index::KeyframeIndex;
use crate::keyframe_index::frames::{FrameArea, FrameIndex};
use crate::keyframe_index::recording::RecordingIndex;
use crate::time_columns::{COLUMN_US, TimeColumns};

/// A label may lie so long before the first event or after the last one, us.
const LATE_LABEL_US: i64 = 1_000_000;

/// Maximum number of detections of a recording in a message.
const MOST_DETECTIONS: usize = 10_000;

/// An indexed recording.
#[derive(Debug, Clone)]
pub enum Shown {
    /// Of a board's events.
    Events(Arc<RecordingIndex>),
    /// Of frames.
    Frames(Arc<FrameIndex>),
}

impl Shown {
    pub(crate) fn index(&self) -> Arc<dyn KeyframeIndex> {
        match self {
            Self::Events(index) => Arc::new(Arc::clone(index)),
            Self::Frames(index) => Arc::new(Arc::clone(index)),
        }
    }

    /// The sensor.
    #[must_use]
    pub fn array(&self) -> &Array {
        match self {
            Self::Events(index) => &index.header().array,
            Self::Frames(index) => KeyframeIndex::array(index),
        }
    }

    /// Time in the index of one us of the file: above 1 where frames are numbered, one a us.
    #[must_use]
    pub fn us(&self) -> i64 {
        match self {
            Self::Events(_) => 1,
            Self::Frames(index) => index.file.number_us.unwrap_or(1),
        }
    }

    /// First and last time, us, and how long before and after them a label may lie: a late label of its last touch may lie a little
    /// after the last event, and a frame holds until the next one.
    #[must_use]
    pub fn range(&self) -> (Option<(i64, i64)>, i64) {
        let late_us = match self {
            Self::Events(_) => LATE_LABEL_US,
            Self::Frames(index) => index.frame_us(),
        };
        (self.index().range(), late_us)
    }

    /// The `overview` message.
    #[must_use]
    pub fn overview(&self, name: &str) -> Value {
        let (start_us, step_us, bins, events) = match self {
            Self::Events(index) => {
                let (start, step, events) = &index.event_rate;
                (*start, *step, events.len(), events.clone())
            }
            Self::Frames(index) => {
                let (start, step, bins) = index.bins();
                (start, step, bins, vec![])
            }
        };
        let index = self.index();
        let force = index.time_columns().map(|columns| columns.greatest_sums(start_us, step_us, bins, COLUMN_US));
        json!({
            "type": "overview", "source": name, "start_us": start_us, "step_us": step_us, "events": events,
            "force": force.unwrap_or_default(),
        })
    }

    /// What the `opened` message says of its contents.
    #[must_use]
    pub fn opened(&self) -> Value {
        let index = self.index();
        let range = index.range();
        // The end of the column, which has all of its force.
        let touch = index.time_columns().and_then(TimeColumns::first_touch);
        let touch_us =
            touch.zip(range).map(|(column, (first, last))| ((column + 1) * COLUMN_US - 1).clamp(first, last));
        let (events, frames) = match self {
            Self::Events(index) => (Some(index), None),
            Self::Frames(index) => (None, Some(index)),
        };
        let registers = events.and_then(|index| index.header().registers);
        let (remarks, note_sources, detection_sources) = match self {
            Self::Events(index) => (&index.remarks, &[][..], &[][..]),
            Self::Frames(index) => {
                (&index.file.remarks, &index.file.note_sources[..], &index.file.detection_sources[..])
            }
        };
        let us = self.us();
        let notes =
            remarks.notes.iter().zip(then_none(note_sources)).map(
                |(note, source)| json!({ "t_us": note.t_us.map(|t| t * us), "text": note.text, "source": source }),
            );
        let found = remarks.detections.iter().take(MOST_DETECTIONS).zip(then_none(detection_sources));
        let detections = found.map(|((_, found), source)| {
            json!({ "label": found.label, "t_us": found.t * us, "known_us": found.known * us, "source": source })
        });
        let markers = remarks.markers.iter().map(|marker| json!({ "t_us": marker.t * us, "start": marker.start }));
        let zeroed = remarks.zeroings.iter().map(|(_, zeroing)| {
            json!({ "taxel": (zeroing.x, zeroing.y), "t_us": zeroing.t, "rest": zeroing.rest, "before": zeroing.before })
        });
        let verdict = match self {
            Self::Events(index) => &index.verdict,
            Self::Frames(index) => &index.file.verdict,
        };
        json!({
            "array": sensor(index.array()),
            "start_us": range.map(|(first, _)| first),
            "stop_us": range.map(|(_, last)| last),
            "touch_us": touch_us.map(|t| frames.and_then(|index| index.frame_until(t)).unwrap_or(t)),
            "events": events.map_or(0, |index| index.events),
            "frames": frames.map(|index| about_frames(index)),
            "verdict": verdict,
            "unfinished": events.is_some_and(|index| index.unfinished),
            "preload_at": events.map_or("", |index| index.preload_at.as_str()),
            "pace": events.and_then(|index| index.pace.clone()),
            "registers": registers,
            "frame_us": registers.map(|registers| registers.frame_us()),
            "markers": markers.collect::<Vec<_>>(),
            "notes": notes.collect::<Vec<_>>(),
            "zeroed": zeroed.collect::<Vec<_>>(),
            "detections": detections.collect::<Vec<_>>(),
        })
    }
}

/// A sensor in messages: as in files, but for a digit a taxel, row by row, that says which exist; null where all do.
pub(crate) fn sensor(array: &Array) -> Value {
    let digit = |&exists: &bool| if exists { '1' } else { '0' };
    let exists: Option<String> = array.exists.as_ref().map(|all| all.iter().map(digit).collect());
    let mut sensor = json!(Array { exists: None, ..array.clone() });
    sensor["exists"] = json!(exists);
    sensor
}

/// These sources, and then none.
fn then_none(sources: &[String]) -> impl Iterator<Item = String> {
    sources.iter().cloned().chain(std::iter::repeat(String::new()))
}

/// What `opened` says of frames.
fn about_frames(index: &FrameIndex) -> Value {
    let file = &index.file;
    let source = |(area, rest, falls, preload_at): (&FrameArea, RestSource, bool, &str)| {
        json!({
            "name": area.name, "left": area.left, "rows": area.rows, "columns": area.columns,
            "rest": rest.name(), "falls": falls, "preload_at": preload_at,
        })
    };
    json!({
        "count": index.count,
        "unit": file.unit,
        "step": index.step,
        "zero": index.zero,
        "floor": index.floor,
        "newtons": index.newtons,
        "number_us": file.number_us,
        "sources": index.areas().map(source).collect::<Vec<_>>(),
        "flickering": index.flickering().collect::<Vec<_>>(),
        "trial": file.trial,
        "trials": file.trials,
        "left_s": file.left_s,
    })
}
