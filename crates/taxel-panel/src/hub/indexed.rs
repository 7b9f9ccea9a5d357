//! A recording of the folder with its index: of events or of frames, and the messages about it.

use std::sync::Arc;
use std::time::Instant;

use crate::array_state::RestSource;
use crate::handler::LabelTimes;
use crate::keyframe_index::KeyframeIndex;
use crate::keyframe_index::frames::{FrameArea, FrameIndex};
use crate::keyframe_index::recording::RecordingIndex;
use crate::protocol::messages::{FoundDetection, FrameRecording, FrameSourceInfo, Marker, Message, RecordedNote};
use crate::time_columns::{COLUMN_US, TimeColumns};

/// A label may lie so long before the first event or after the last one, us.
const LATE_LABEL_US: i64 = 1_000_000;

/// Maximum number of detections of a recording in a message.
const MOST_DETECTIONS: usize = 10_000;

/// An indexed recording.
#[derive(Debug, Clone)]
pub(crate) enum Indexed {
    Events(Arc<RecordingIndex>),
    Frames(Arc<FrameIndex>),
}

/// The recording that a client shows.
#[derive(Debug, Clone)]
pub(crate) struct OpenRecording {
    pub(crate) name: String,
    /// Its trial, where the file holds several.
    pub(crate) trial: Option<String>,
    pub(crate) indexed: Indexed,
}

impl Indexed {
    pub(crate) fn index(&self) -> Arc<dyn KeyframeIndex> {
        match self {
            Self::Events(index) => Arc::new(Arc::clone(index)),
            Self::Frames(index) => Arc::new(Arc::clone(index)),
        }
    }

    /// The trial of its file that it is, where the file has several.
    pub(crate) fn trial(&self) -> Option<&str> {
        match self {
            Self::Events(_) => None,
            Self::Frames(index) => index.file.trial.as_deref(),
        }
    }

    /// Time in the index of one us of the file: above 1 where frames are numbered, one a us.
    pub(crate) fn us(&self) -> i64 {
        match self {
            Self::Events(_) => 1,
            Self::Frames(index) => index.file.number_us.unwrap_or(1),
        }
    }

    /// How times of its labels become those of the index.
    pub(crate) fn label_times(&self) -> LabelTimes {
        let begin_us = self.index().range().map_or(0, |(first, _)| first);
        LabelTimes { us: self.us(), begin_us }
    }

    /// Refuses a label outside the recording: a late label of its last touch may lie a little after the last event.
    pub(crate) fn check_label(&self, name: &str, t_us: i64) -> Result<(), String> {
        let Some((first, last)) = self.index().range() else { return Ok(()) };
        let late_us = match self {
            Self::Events(_) => LATE_LABEL_US,
            // A frame holds until the next one.
            Self::Frames(index) => index.frame_us(),
        };
        let (beyond, end) = match (first - t_us, t_us - last) {
            (before, _) if before > late_us => (before, "before the beginning"),
            (_, after) if after > late_us => (after, "after the end"),
            _ => return Ok(()),
        };
        #[allow(clippy::cast_precision_loss)]
        let far = match self.us() {
            1 => format!("{:.3} s", beyond as f64 / 1e6),
            us => format!("{} frames", beyond / us),
        };
        Err(format!("a label is {far} {end} of {name}: must be within the recording"))
    }

    /// The `overview` message.
    pub(crate) fn overview(&self, name: &str) -> Message {
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
        Message::Overview { source: Some(name.to_owned()), start_us, step_us, events, force: force.unwrap_or_default() }
    }

    /// The `opened` message; `bytes` is the size of the file, `train` the command that trains on its labels.
    pub(crate) fn opened(&self, name: &str, bytes: u64, train: String, begun: Instant) -> Message {
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
        let notes = remarks.notes.iter().zip(then_none(note_sources)).map(|(note, source)| RecordedNote {
            t_us: note.t_us.map(|t| t * us),
            text: note.text.clone(),
            source,
        });
        let found = remarks.detections.iter().take(MOST_DETECTIONS).zip(then_none(detection_sources));
        let detections = found.map(|((_, found), source)| FoundDetection {
            label: found.label.clone(),
            t_us: found.t * us,
            known_us: found.known * us,
            source,
        });
        Message::Opened {
            name: name.to_owned(),
            array: index.array().into(),
            start_us: range.map(|(first, _)| first),
            stop_us: range.map(|(_, last)| last),
            touch_us: touch_us.map(|t| frames.and_then(|index| index.frame_until(t)).unwrap_or(t)),
            events: events.map_or(0, |index| index.events),
            bytes,
            train,
            frames: frames.map(|index| about_frames(index)),
            verdict: match self {
                Self::Events(index) => index.verdict.clone(),
                Self::Frames(index) => index.file.verdict.clone(),
            },
            unfinished: events.is_some_and(|index| index.unfinished),
            preload_at: events.map_or_else(String::new, |index| index.preload_at.clone()),
            pace: events.and_then(|index| index.pace.clone()),
            registers,
            frame_us: registers.map(|registers| registers.frame_us()),
            markers: remarks.markers.iter().map(|marker| Marker { t_us: marker.t * us, start: marker.start }).collect(),
            notes: notes.collect(),
            zeroed: remarks.zeroings.iter().map(|(_, zeroing)| zeroing.into()).collect(),
            detections: detections.collect(),
            index_ms: begun.elapsed().as_secs_f64() * 1e3,
        }
    }
}

/// These sources, and then none.
fn then_none(sources: &[String]) -> impl Iterator<Item = String> {
    sources.iter().cloned().chain(std::iter::repeat(String::new()))
}

/// What `opened` says of frames.
fn about_frames(index: &FrameIndex) -> FrameRecording {
    let file = &index.file;
    let source = |(area, rest, falls, preload_at): (&FrameArea, RestSource, bool, &str)| FrameSourceInfo {
        name: area.name.clone(),
        left: area.left,
        rows: area.rows,
        columns: area.columns,
        rest: rest.name(),
        falls,
        preload_at: preload_at.to_owned(),
    };
    FrameRecording {
        count: index.count,
        unit: file.unit.clone(),
        step: index.step,
        zero: index.zero,
        floor: index.floor,
        newtons: index.newtons,
        number_us: file.number_us,
        sources: index.areas().map(source).collect(),
        flickering: index.flickering().collect(),
        trial: file.trial.clone(),
        trials: file.trials.clone(),
        left_s: file.left_s,
    }
}
