//! What is said of a recording.

use serde_json::{Value, json};
use taxel_core::Array;

use crate::columns::{COLUMN_US, TimeColumns};
use crate::frame_values::{Frames, FramesOfSource};
use crate::index::Index;

/// A label may lie so long before the first event or after the last one, us.
const LATE_LABEL_US: i64 = 1_000_000;

impl Index {
    /// Time in the index of one us of the file: above 1 where frames are numbered, one a us.
    #[must_use]
    pub fn us(&self) -> i64 {
        self.sensor.frames.as_ref().and_then(|frames| frames.number_us).unwrap_or(1)
    }

    /// How long before the first time and after the last one a label may lie, us: a late label of its last touch may lie a little
    /// after the last event, and a frame holds until the next one.
    #[must_use]
    pub fn late_us(&self) -> i64 {
        self.sensor.frames.as_ref().map_or(LATE_LABEL_US, |frames| frames.frame_us)
    }

    /// The `overview` message of a recording, or of the past of a live source, which these columns hold.
    #[must_use]
    pub fn overview(&self, name: Option<&str>, columns: Option<&TimeColumns>) -> Value {
        let (start_us, step_us, events) = self.event_rate();
        let force = columns.map(|columns| columns.greatest_sums(start_us, step_us, events.len(), COLUMN_US));
        let events = if self.sensor.frames.is_some() { vec![] } else { events };
        json!({
            "type": "overview", "source": name, "start_us": start_us, "step_us": step_us, "events": events,
            "force": force.unwrap_or_default(),
        })
    }

    /// What the `opened` message says of the values of a recording.
    ///
    /// # Errors
    ///
    /// `File` where the temporary file cannot be read.
    pub fn opened(&self) -> taxel_live::Result<Value> {
        let (range, frames) = (self.range(), self.sensor.frames.as_ref());
        // The end of the column, which has all of its force; of frames the last one in it.
        let touch = self.whole.as_ref().and_then(|columns| columns.first_touch());
        let touch_us =
            touch.zip(range).map(|(column, (first, last))| ((column + 1) * COLUMN_US - 1).clamp(first, last));
        let touch_us = match touch_us {
            Some(t) if frames.is_some() => self.stamp_before(t + 1)?,
            touch_us => touch_us,
        };
        Ok(json!({
            "array": sensor(&self.sensor.array),
            "start_us": range.map(|(first, _)| first),
            "stop_us": range.map(|(_, last)| last),
            "touch_us": touch_us,
            "events": if frames.is_some() { 0 } else { self.changes() },
            "frames": frames.map(|frames| about_frames(frames, self.sensor.floor)),
            "preload_at": self.preload_at,
        }))
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
fn about_frames(frames: &Frames, floor: u16) -> Value {
    let source = |FramesOfSource { name, left, sensor, rest }: &FramesOfSource| {
        json!({
            "name": name, "left": left, "rows": sensor.rows, "columns": sensor.columns,
            "rest": rest.source, "falls": rest.falls, "preload_at": rest.preload_at,
        })
    };
    json!({
        "count": frames.count,
        "unit": frames.unit,
        "step": frames.steps.size,
        "zero": frames.steps.zero,
        "floor": floor,
        "newtons": frames.newtons,
        "number_us": frames.number_us,
        "sources": frames.sources.iter().map(source).collect::<Vec<_>>(),
    })
}
