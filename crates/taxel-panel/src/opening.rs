//! Opens the recordings of the folder: indexes them once however many clients show them, the text tables first in part.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use taxel_core::problem;
use taxel_live::recording::Reader;
use taxel_live::{Error, Result};

use super::clients::Broadcast;
use super::handler::{Opening, PicturesRead, ReadFile, Reply};
use super::hub::Hub;
use super::keyframe_index::KeyframeIndex;
use super::keyframe_index::pictures::PictureIndex;
use super::keyframe_index::recording::RecordingIndex;
use super::messages;
use super::time_columns::{COLUMN_US, TimeColumns};

/// How often the progress of reading a file is sent.
const PROGRESS_EVERY: Duration = Duration::from_secs(1);

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

/// The index of a recording of the folder, built unless it is in memory; of a file with several trials that of `trial`, or
/// of the first. Of a large text table only the beginning at first: the whole is read in the background, and all who show
/// it then get it ([`Broadcast::Whole`]).
///
/// # Errors
///
/// As [`Folder::file`](super::folder::Folder::file); the reader's reason where it is no recording.
pub(super) async fn index(hub: &Arc<Hub>, name: &str, trial: Option<&str>) -> Result<Indexed> {
    let path = hub.folder.file(name)?;
    let bytes = std::fs::metadata(&path).map_err(Error::file(&path))?.len();
    let key = (path.clone(), trial.map(str::to_owned));
    if let Some(known) = hub.folder.known(&key, bytes) {
        return Ok(known);
    }
    let file = path.clone();
    let failed = || problem!("{name}: failed within taxel; please report it");
    let own = tokio::task::spawn_blocking(move || of_a_board(&file)).await.map_err(|_| failed())??;
    let indexed = match own {
        Some(index) => Indexed::Events(index),
        None => {
            let (indexed, left_s) = read(hub, &path, trial, Opening::Beginning).await?;
            if let Some(left_s) = left_s {
                tokio::spawn(read_whole(Arc::clone(hub), name.to_owned(), key.clone(), bytes, left_s));
            }
            indexed
        }
    };
    hub.folder.remember(key, bytes, &indexed);
    Ok(indexed)
}

/// The index of a file of a board's events; `None` for any other file.
fn of_a_board(path: &Path) -> Result<Option<Arc<RecordingIndex>>> {
    let events = match path.extension().and_then(|ending| ending.to_str()) {
        Some("mcap") => Reader::open(path)?.header().pictures.is_none(),
        Some("lsa") => true,
        _ => false,
    };
    if events { RecordingIndex::open(path).map(Some) } else { Ok(None) }
}

/// Reads a file by the program that started the panel; also returns how long the rest of the file takes, s.
async fn read(hub: &Hub, path: &Path, trial: Option<&str>, opening: Opening) -> Result<(Indexed, Option<f64>)> {
    let (file, trial) = (path.to_owned(), trial.map(str::to_owned));
    let answer: Reply<ReadFile> = hub.ask(move |handler| handler.read(&file, trial.as_deref(), opening)).await;
    match answer.map_err(|reason| problem!("{reason}"))? {
        ReadFile::Events(mcap) => {
            let index = tokio::task::spawn_blocking(move || RecordingIndex::open(&mcap)).await;
            let index = index.map_err(|_| problem!("{}: failed within taxel; please report it", path.display()))??;
            Ok((Indexed::Events(index), None))
        }
        ReadFile::Pictures(PicturesRead(index)) => {
            let left_s = index.file.left_s;
            Ok((Indexed::Pictures(Arc::new(*index)), left_s))
        }
    }
}

/// Reads the whole of a file whose beginning is shown, with progress for the clients.
async fn read_whole(hub: Arc<Hub>, name: String, key: (PathBuf, Option<String>), bytes: u64, left_s: f64) {
    let begun = Instant::now();
    let reading = read(&hub, &key.0, key.1.as_deref(), Opening::Whole);
    tokio::pin!(reading);
    let outcome = loop {
        tokio::select! {
            outcome = &mut reading => break outcome,
            () = tokio::time::sleep(PROGRESS_EVERY) => {
                let share = (begun.elapsed().as_secs_f64() / left_s.max(1.0)).min(0.99);
                hub.clients.send_json(&json!({ "type": "loading", "name": name, "share": share }));
            }
        }
    };
    match outcome {
        Ok((indexed, _)) => {
            hub.folder.remember(key.clone(), bytes, &indexed);
            hub.clients.send_json(&json!({ "type": "loading", "name": name, "share": 1.0 }));
            hub.clients.send(Broadcast::Whole(name));
        }
        Err(error) => {
            hub.folder.forget(&key);
            hub.clients.send_json(&messages::warning(format!("{error}; only its beginning is shown")));
        }
    }
}
