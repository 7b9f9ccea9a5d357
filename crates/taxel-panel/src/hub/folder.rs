//! The folder of recordings: which there are, and their keyframe indices.

use std::collections::HashMap;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, Weak};
use std::time::UNIX_EPOCH;

use taxel_core::detect::Detector;
use taxel_core::problem;
use taxel_live::locked::lock;
use taxel_live::{Error, Result};
use tokio::sync::OwnedMutexGuard;

use super::indexed::Indexed;
use crate::keyframe_index::frames::FrameIndex;
use crate::keyframe_index::recording::RecordingIndex;

/// Maximum number of recordings in a list.
const MOST_LISTED: usize = 1000;

/// A recording in the folder.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Listed {
    pub(crate) name: String,
    pub(crate) bytes: u64,
    pub(crate) modified_ns: u64,
}

/// A file, and its trial where it holds several.
pub(crate) type Key = (PathBuf, Option<String>);

/// The recordings of a folder, with the keyframe indices of those that were opened.
pub(crate) struct Folder {
    path: PathBuf,
    /// The indices in use, so that a recording is indexed once however many clients show it, with the sizes of the files.
    indices: Mutex<HashMap<Key, (u64, WeakIndex)>>,
    /// The index that was built last.
    last: Mutex<Option<Indexed>>,
    /// See [`Folder::turn`].
    turns: Mutex<HashMap<Key, Weak<tokio::sync::Mutex<()>>>>,
}

impl Folder {
    /// `path` is canonical.
    pub(crate) fn new(path: PathBuf) -> Self {
        Self { path, indices: Mutex::default(), last: Mutex::default(), turns: Mutex::default() }
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// The recordings of these names, newest first.
    pub(crate) fn list(&self, names: Vec<String>) -> Vec<Listed> {
        let mut files = vec![];
        for name in names.into_iter().filter(|name| checked_name(name).is_ok()) {
            let path = self.path.join(&name);
            let (Ok(about), Ok(bytes)) = (path.metadata(), size(&path)) else { continue };
            let modified = about.modified().ok().and_then(|at| at.duration_since(UNIX_EPOCH).ok());
            let modified_ns = modified.map_or(0, |since| u64::try_from(since.as_nanos()).unwrap_or(0));
            files.push(Listed { name, bytes, modified_ns });
        }
        files.sort_by_key(|file| std::cmp::Reverse(file.modified_ns));
        files.truncate(MOST_LISTED);
        files
    }

    /// The readouts and plain rules by name: the `.json` that begin as one.
    pub(crate) fn readouts(&self) -> Vec<String> {
        let names = std::fs::read_dir(&self.path).into_iter().flatten().flatten();
        let mut names: Vec<_> = names.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
        names.retain(|name| name.ends_with(".json") && checked_name(name).is_ok() && self.begins_as_readout(name));
        names.sort_unstable();
        names.truncate(MOST_LISTED);
        names
    }

    fn begins_as_readout(&self, name: &str) -> bool {
        let mut begin = Vec::with_capacity(256);
        let read = File::open(self.path.join(name)).is_ok_and(|file| file.take(256).read_to_end(&mut begin).is_ok());
        read && Detector::is_begun_by(&begin)
    }

    /// Path of a file in the folder, which need not exist. A link that somebody put there leads where it leads for every
    /// other program.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` for a name that leads out of the folder.
    pub(crate) fn file(&self, name: &str) -> Result<PathBuf> {
        checked_name(name)?;
        Ok(self.path.join(name))
    }

    /// Waits until no other client has this file indexed, which two would read twice.
    pub(crate) async fn turn(&self, key: &Key) -> OwnedMutexGuard<()> {
        let turn = {
            let mut turns = lock(&self.turns);
            turns.retain(|_, turn| turn.strong_count() > 0);
            turns.get(key).and_then(Weak::upgrade).unwrap_or_else(|| {
                let turn = Arc::default();
                turns.insert(key.clone(), Arc::downgrade(&turn));
                turn
            })
        };
        turn.lock_owned().await
    }

    /// An index that is in memory, of a file of this size.
    pub(crate) fn stored_index(&self, key: &Key, bytes: u64) -> Option<Indexed> {
        lock(&self.indices).get(key).filter(|(length, _)| *length == bytes).and_then(|(_, index)| index.upgrade())
    }

    /// Remembers an index for as long as it is shown; the last one for longer.
    pub(crate) fn remember(&self, key: Key, bytes: u64, indexed: &Indexed) {
        *lock(&self.last) = Some(indexed.clone());
        lock(&self.indices).insert(key, (bytes, WeakIndex::downgrade(indexed)));
    }

    /// Forgets an index, so that it is built anew.
    pub(crate) fn forget(&self, key: &Key) {
        lock(&self.indices).remove(key);
    }

    /// Forgets the indices of a file, of all of its trials.
    pub(crate) fn forget_file(&self, path: &Path) {
        lock(&self.indices).retain(|(file, _), _| file != path);
    }
}

/// Size of a recording, bytes: of a bag that is a folder that of its files.
///
/// # Errors
///
/// `Io` where it cannot be read.
pub(crate) fn size(path: &Path) -> Result<u64> {
    let failed = Error::file(path);
    let about = match std::fs::metadata(path) {
        Ok(about) if about.is_dir() => std::fs::read_dir(path),
        Ok(about) => return Ok(about.len()),
        Err(error) => Err(error),
    };
    let files = about.map_err(failed)?.flatten().filter_map(|entry| entry.metadata().ok());
    Ok(files.filter(std::fs::Metadata::is_file).map(|about| about.len()).sum())
}

/// An index that others hold.
enum WeakIndex {
    Events(Weak<RecordingIndex>),
    Frames(Weak<FrameIndex>),
}

impl WeakIndex {
    fn downgrade(indexed: &Indexed) -> Self {
        match indexed {
            Indexed::Events(index) => Self::Events(Arc::downgrade(index)),
            Indexed::Frames(index) => Self::Frames(Arc::downgrade(index)),
        }
    }

    fn upgrade(&self) -> Option<Indexed> {
        match self {
            Self::Events(index) => index.upgrade().map(Indexed::Events),
            Self::Frames(index) => index.upgrade().map(Indexed::Frames),
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
