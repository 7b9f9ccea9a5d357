//! The folder of recordings: which there are, and their keyframe indices.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, Weak};
use std::time::UNIX_EPOCH;

use taxel_core::problem;
use taxel_live::locked::lock;
use taxel_live::{Error, Result};

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

/// See the module.
pub(super) struct Folder {
    path: PathBuf,
    /// The indices in use, so that a recording is indexed once however many clients show it.
    indices: Mutex<HashMap<PathBuf, Weak<RecordingIndex>>>,
}

impl Folder {
    /// `path` is canonical.
    pub(super) fn new(path: PathBuf) -> Self {
        Self { path, indices: Mutex::default() }
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// The recordings, newest first.
    pub(super) fn list(&self) -> Vec<Listed> {
        let mut files = vec![];
        for entry in std::fs::read_dir(&self.path).into_iter().flatten().flatten() {
            let name = entry.file_name().to_string_lossy().into_owned();
            let (Ok(about), true) = (entry.metadata(), name.ends_with(".mcap") || name.ends_with(".lsa")) else {
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

    /// The keyframe index of a recording, built unless a client shows it already.
    ///
    /// # Errors
    ///
    /// As [`Folder::file`] and [`RecordingIndex::open`].
    pub(super) async fn index(&self, name: &str) -> Result<Arc<RecordingIndex>> {
        let path = self.file(name)?;
        let length = std::fs::metadata(&path).map_err(Error::file(&path))?.len();
        let known = lock(&self.indices).get(&path).and_then(Weak::upgrade);
        if let Some(index) = known.filter(|index| index.bytes == length) {
            return Ok(index);
        }
        let file = path.clone();
        let index = tokio::task::spawn_blocking(move || RecordingIndex::open(&file)).await;
        let index = index.map_err(|_| problem!("{name}: failed within taxel; please report it"))??;
        lock(&self.indices).insert(path, Arc::downgrade(&index));
        Ok(index)
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
