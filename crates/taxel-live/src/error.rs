//! The errors of this crate.

use std::path::{Path, PathBuf};

use taxel_core::Place;

/// An error of the core, or an error of files and sockets with its place.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// An error of `taxel-core`.
    #[error(transparent)]
    Core(#[from] taxel_core::Error),
    /// A file that could not be read or written.
    #[error("{}: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        source: std::io::Error,
    },
    /// A detection that could not be delivered.
    #[error("detections: {0}")]
    Sink(std::io::Error),
    /// A socket or a serial line that could not be opened or used.
    #[error("{place}: {source}")]
    Socket {
        /// The address, or the serial port.
        place: String,
        /// The error of the operating system.
        source: std::io::Error,
    },
}

/// The result of each function in this crate that can fail.
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// Adds the file's path to an error of the operating system.
    pub fn file(path: &Path) -> impl FnOnce(std::io::Error) -> Self + '_ {
        move |source| Self::File { path: path.to_owned(), source }
    }

    /// An error about the content of a file.
    pub(crate) fn format(path: &Path, text: &str) -> Self {
        taxel_core::Error::format(text).at(Place::file(path)).into()
    }

    /// Adds the part of an input that an error of the core is about; other errors name their place.
    #[must_use]
    pub(crate) fn in_part(self, part: &str) -> Self {
        match self {
            Self::Core(error) => Self::Core(error.in_part(part)),
            error => error,
        }
    }

    /// Adds the address, or the serial port, to an error of the operating system.
    pub fn socket(place: impl ToString) -> impl FnOnce(std::io::Error) -> Self {
        let place = place.to_string();
        move |source| Self::Socket { place, source }
    }
}
