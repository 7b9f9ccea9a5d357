//! Opens the recordings of the folder: indexes them once however many clients show them, the text tables first in part.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use taxel_core::problem;
use taxel_live::Result;
use taxel_live::recording::Reader;

use crate::handler::{FramesRead, Opening, ReadFile, Reply};
use crate::hub::Hub;
use crate::hub::clients::Broadcast;
use crate::hub::folder::size;
use crate::hub::indexed::Indexed;
use crate::keyframe_index::recording::RecordingIndex;
use crate::protocol::messages::Message;
use crate::protocol::refusal::words;

/// How often the progress of reading a file is sent.
const PROGRESS_EVERY: Duration = Duration::from_secs(1);

/// The index of a recording of the folder, built unless it is in memory; of a file with several trials that of `trial`, or
/// of the first. Of a large text table only the beginning at first: the whole is read in the background, and all who show
/// it then get it ([`Broadcast::Whole`]).
///
/// # Errors
///
/// As [`Folder::file`](crate::hub::folder::Folder::file); the reader's reason where it is no recording.
pub(crate) async fn index(hub: &Arc<Hub>, name: &str, trial: Option<&str>) -> Result<Indexed> {
    let path = hub.folder.file(name)?;
    let bytes = size(&path)?;
    let key = (path.clone(), trial.map(str::to_owned));
    let _turn = hub.folder.turn(&key).await;
    if let Some(known) = hub.folder.stored_index(&key, bytes) {
        return Ok(known);
    }
    let file = path.clone();
    let failed = || problem!("{name}: failed within taxel; please report it");
    let asked = hub.options().open_by_handler && hub.options().open.as_deref() == Some(name);
    let board = tokio::task::spawn_blocking(move || if asked { Ok(None) } else { of_a_board(&file) });
    let board = board.await.map_err(|_| failed())??;
    let indexed = match board {
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

/// The index of a file of a board's events; `None` for any other file, an MCAP file of other programs among them.
fn of_a_board(path: &Path) -> Result<Option<Arc<RecordingIndex>>> {
    let events = match path.extension().and_then(|ending| ending.to_str()) {
        Some("mcap") => Reader::open(path).is_ok_and(|recording| recording.header().frames.is_none()),
        Some("lsa") => true,
        _ => false,
    };
    if events { RecordingIndex::open(path).map(Some) } else { Ok(None) }
}

/// Reads a file by the program that started the panel; also returns how long the rest of the file takes, s.
async fn read(hub: &Hub, path: &Path, trial: Option<&str>, opening: Opening) -> Result<(Indexed, Option<f64>)> {
    let (file, trial) = (path.to_owned(), trial.map(str::to_owned));
    let answer: Reply<ReadFile> = hub.ask(move |handlers| handlers.files.read(&file, trial.as_deref(), opening)).await;
    match answer.map_err(|reason| problem!("{reason}"))? {
        ReadFile::Events(mcap) => {
            let index = tokio::task::spawn_blocking(move || RecordingIndex::open(&mcap)).await;
            let index = index.map_err(|_| problem!("{}: failed within taxel; please report it", path.display()))??;
            Ok((Indexed::Events(index), None))
        }
        ReadFile::Frames(FramesRead(index)) => {
            let left_s = index.file.left_s;
            Ok((Indexed::Frames(Arc::new(*index)), left_s))
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
                hub.clients.send_message(&Message::Loading { name: name.clone(), share });
            }
        }
    };
    match outcome {
        Ok((indexed, _)) => {
            hub.folder.remember(key.clone(), bytes, &indexed);
            hub.clients.send_message(&Message::Loading { name: name.clone(), share: 1.0 });
            hub.clients.send(Broadcast::Whole(name));
        }
        Err(error) => {
            hub.folder.forget(&key);
            hub.clients.send_message(&Message::warning(format!(
                "{}; only the beginning of the recording is shown",
                words(&error)
            )));
        }
    }
}
