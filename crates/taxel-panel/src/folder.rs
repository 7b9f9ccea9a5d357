//! The folder of recordings: which there are, and their keyframe indices.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, Weak};
use std::time::UNIX_EPOCH;

use taxel_core::problem;
use taxel_live::Result;
use taxel_live::locked::lock;

use super::indexed::Indexed;
use super::keyframe_index::pictures::PictureIndex;
use super::keyframe_index::recording::RecordingIndex;

/// Maximum number of recordings in a list.
const MOST_LISTED: usize = 1000;

/// A recording in the folder.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Listed {
    pub(super) name: String,
    pub(super) bytes: u64,
    pub(super) modified_ns: u64,
}

/// Endings of recordings, those of other makers' files among them.
const ENDINGS: [&str; 12] =
    [".mcap", ".lsa", ".npz", ".h5", ".csv", ".csv.gz", ".txt", ".txt.gz", ".asc", ".asf", ".lst", ".hea"];

/// Endings of the names of tables beside recordings, which are none.
const TABLES: [&str; 5] = ["notes.csv", "labels.csv", "events.csv", "steps.csv", "trials.csv"];

/// A file, and its trial where it holds several.
pub(super) type Key = (PathBuf, Option<String>);

/// See the module.
pub(super) struct Folder {
    path: PathBuf,
    /// The indices in use, so that a recording is indexed once however many clients show it, with the sizes of the files.
    indices: Mutex<HashMap<Key, (u64, WeakIndex)>>,
    /// The index that was built last.
    last: Mutex<Option<Indexed>>,
}

impl Folder {
    /// `path` is canonical.
    pub(super) fn new(path: PathBuf) -> Self {
        Self { path, indices: Mutex::default(), last: Mutex::default() }
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// The recordings, newest first.
    pub(super) fn list(&self) -> Vec<Listed> {
        let mut files = vec![];
        for entry in std::fs::read_dir(&self.path).into_iter().flatten().flatten() {
            let name = entry.file_name().to_string_lossy().into_owned();
            let (Ok(about), true) = (entry.metadata(), may_be_recording(&name)) else {
                continue;
            };
            if !about.is_file() || checked_name(&name).is_err() {
                continue;
            }
            let modified = about.modified().ok().and_then(|at| at.duration_since(UNIX_EPOCH).ok());
            let modified_ns = modified.map_or(0, |since| u64::try_from(since.as_nanos()).unwrap_or(0));
            files.push(Listed { name, bytes: about.len(), modified_ns });
        }
        files.sort_by_key(|file| std::cmp::Reverse(file.modified_ns));
        files.truncate(MOST_LISTED);
        files
    }

    /// The readouts by name: files that end in `readout.json`.
    pub(super) fn readouts(&self) -> Vec<String> {
        let names = std::fs::read_dir(&self.path).into_iter().flatten().flatten();
        let mut names: Vec<_> = names.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
        names.retain(|name| name.ends_with("readout.json") && checked_name(name).is_ok());
        names.sort_unstable();
        names.truncate(MOST_LISTED);
        names
    }

    /// Path of a file in the folder, which need not exist.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` for a name that leads out of the folder.
    pub(super) fn file(&self, name: &str) -> Result<PathBuf> {
        checked_name(name)?;
        let path = self.path.join(name);
        // A link may lead out of the folder.
        match path.canonicalize() {
            Ok(real) if !real.starts_with(&self.path) => {
                Err(problem!("{name}: lies outside the folder {}", self.path.display()).into())
            }
            _ => Ok(path),
        }
    }

    /// An index that is in memory, of a file of this size.
    pub(super) fn known(&self, key: &Key, bytes: u64) -> Option<Indexed> {
        lock(&self.indices).get(key).filter(|(length, _)| *length == bytes).and_then(|(_, index)| index.upgrade())
    }

    /// Remembers an index for as long as it is shown; the last one for longer.
    pub(super) fn remember(&self, key: Key, bytes: u64, indexed: &Indexed) {
        *lock(&self.last) = Some(indexed.clone());
        lock(&self.indices).insert(key, (bytes, WeakIndex::of(indexed)));
    }

    /// Forgets an index, so that it is built anew.
    pub(super) fn forget(&self, key: &Key) {
        lock(&self.indices).remove(key);
    }
}

/// Whether a file may be a recording, by its name.
fn may_be_recording(name: &str) -> bool {
    let lower = name.to_lowercase();
    ENDINGS.iter().any(|ending| lower.ends_with(ending)) && !TABLES.iter().any(|table| lower.ends_with(table))
}

/// An index that others hold.
enum WeakIndex {
    Events(Weak<RecordingIndex>),
    Pictures(Weak<PictureIndex>),
}

impl WeakIndex {
    fn of(indexed: &Indexed) -> Self {
        match indexed {
            Indexed::Events(index) => Self::Events(Arc::downgrade(index)),
            Indexed::Pictures(index) => Self::Pictures(Arc::downgrade(index)),
        }
    }

    fn upgrade(&self) -> Option<Indexed> {
        match self {
            Self::Events(index) => index.upgrade().map(Indexed::Events),
            Self::Pictures(index) => index.upgrade().map(Indexed::Pictures),
        }
    }
}

/// Refuses names of files that could lie outside a folder.
fn checked_name(name: &str) -> Result<()> {
    let fits = |c: char| c.is_alphanumeric() || " ._-".contains(c);
    let count = name.chars().count();
    if !(1..=110).contains(&count) || name.starts_with('.') || !name.chars().all(fits) {
        let shown: String = name.chars().take(40).collect();
        return Err(problem!(
            "name {shown:?}: must be 1 to 100 letters, digits, spaces, '.', '_' or '-', not beginning with '.'"
        )
        .into());
    }
    Ok(())
}
