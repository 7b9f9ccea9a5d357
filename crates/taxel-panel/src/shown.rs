//! A recording with its index, of events or of frames, and what is said of it.

use std::sync::Arc;

use serde_json::{Value, json};
use taxel_core::Array;

use crate::array_state::RestSource;
use crate::keyframe_index::KeyframeIndex;
use crate::keyframe_index::events::EventIndex;
use crate::keyframe_index::frames::{FrameArea, FrameIndex};
use crate::time_columns::{COLUMN_US, TimeColumns};

/// A label may lie so long before the first event or after the last one, us.
const LATE_LABEL_US: i64 = 1_000_000;

/// An indexed recording.
#[derive(Debug, Clone)]
pub enum Shown {
    /// Of a board's events.
    Events(Arc<EventIndex>),
    /// Of frames.
    Frames(Arc<FrameIndex>),
}

impl Shown {
    pub(crate) fn index(&self) -> Arc<dyn KeyframeIndex> {
        match self {
            Self::Events(index) => index.clone(),
            Self::Frames(index) => index.clone(),
        }
    }

    /// The sensor.
    #[must_use]
    pub fn array(&self) -> &Array {
        match self {
            Self::Events(index) => KeyframeIndex::array(&**index),
            Self::Frames(index) => KeyframeIndex::array(&**index),
        }
    }

    /// Time in the index of one us of the file: above 1 where frames are numbered, one a us.
    #[must_use]
    pub fn us(&self) -> i64 {
        match self {
            Self::Events(_) => 1,
            Self::Frames(index) => index.number_us.unwrap_or(1),
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

    /// What the `opened` message says of its values.
    #[must_use]
    pub fn opened(&self) -> Value {
        let index = self.index();
        let range = index.range();
        // The end of the column, which has all of its force.
        let touch = index.time_columns().and_then(TimeColumns::first_touch);
        let touch_us =
            touch.zip(range).map(|(column, (first, last))| ((column + 1) * COLUMN_US - 1).clamp(first, last));
        let (touch_us, events, preload_at, frames) = match self {
            Self::Events(index) => (touch_us, index.events(), index.preload_at.as_str(), None),
            Self::Frames(index) => {
                (touch_us.map(|t| index.frame_until(t).unwrap_or(t)), 0, "", Some(about_frames(index)))
            }
        };
        json!({
            "array": sensor(index.array()),
            "start_us": range.map(|(first, _)| first),
            "stop_us": range.map(|(_, last)| last),
            "touch_us": touch_us,
            "events": events,
            "frames": frames,
            "preload_at": preload_at,
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

/// What `opened` says of frames.
fn about_frames(index: &FrameIndex) -> Value {
    let source = |(area, rest, falls, preload_at): (&FrameArea, RestSource, bool, &str)| {
        json!({
            "name": area.name, "left": area.left, "rows": area.rows, "columns": area.columns,
            "rest": rest, "falls": falls, "preload_at": preload_at,
        })
    };
    json!({
        "count": index.count,
        "unit": index.unit,
        "step": index.step,
        "zero": index.zero,
        "floor": index.floor,
        "newtons": index.newtons,
        "number_us": index.number_us,
        "sources": index.areas().map(source).collect::<Vec<_>>(),
        "flickering": index.flickering().collect::<Vec<_>>(),
    })
}
