//! A file, a pipe or the standard input that is read with a time limit.

#[cfg(any(not(unix), test))]
mod portable;
#[cfg(unix)]
mod unix;

use std::fs::File;
use std::io;
use std::path::Path;
use std::time::Duration;

#[cfg(not(unix))]
use portable::{FileReader, open, standard_input};
#[cfg(unix)]
use unix::{FileReader, open, standard_input};

/// A file that is read with a time limit.
#[derive(Debug)]
pub struct ReadableFile(FileReader);

impl ReadableFile {
    /// Opens a file or a named pipe, which may have no writer yet.
    ///
    /// # Errors
    ///
    /// Those of the system.
    pub fn open(path: &Path) -> io::Result<Self> {
        open(path).map(Self::new)
    }

    /// Opens the standard input, without the program's own buffer of it.
    ///
    /// # Errors
    ///
    /// Those of the system.
    pub fn standard_input() -> io::Result<Self> {
        standard_input().map(Self::new)
    }

    /// Reads an open file.
    #[must_use]
    pub fn new(file: File) -> Self {
        Self(FileReader::new(file))
    }

    /// Reads what there is, and waits for it if there is nothing; `None` if nothing came in time, 0 bytes at the end, where
    /// another program may still write.
    ///
    /// # Errors
    ///
    /// Those of the system.
    pub fn read(&mut self, bytes: &mut [u8], within: Duration) -> io::Result<Option<usize>> {
        self.0.read(bytes, within)
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write;
    use std::time::Instant;

    use super::*;

    type Read<'a> = &'a mut dyn FnMut(&mut [u8], Duration) -> io::Result<Option<usize>>;

    /// A pipe: nothing, what was written, in pieces where there is little room, and its end.
    fn check(mut writer: io::PipeWriter, read: Read<'_>) {
        let mut bytes = [0; 3];
        assert_eq!(read(&mut bytes, Duration::from_millis(1)).unwrap(), None);
        writer.write_all(b"12345").unwrap();
        let (mut received, begun) = (vec![], Instant::now());
        while received.len() < 5 && begun.elapsed() < Duration::from_secs(30) {
            let n = read(&mut bytes, Duration::from_secs(1)).unwrap().unwrap_or(0);
            received.extend_from_slice(&bytes[..n]);
        }
        assert_eq!(received, b"12345");
        drop(writer);
        assert_eq!(read(&mut bytes, Duration::from_secs(30)).unwrap(), Some(0));
    }

    fn pipe() -> (io::PipeWriter, File) {
        let (reader, writer) = io::pipe().expect("a pipe");
        #[cfg(unix)]
        let file = File::from(std::os::fd::OwnedFd::from(reader));
        #[cfg(windows)]
        let file = File::from(std::os::windows::io::OwnedHandle::from(reader));
        (writer, file)
    }

    #[test]
    fn a_pipe_is_read_with_a_time_limit() {
        let (writer, file) = pipe();
        let mut file = ReadableFile::new(file);
        check(writer, &mut |bytes, within| file.read(bytes, within));
    }

    #[test]
    fn a_pipe_is_read_by_a_thread_too() {
        let (writer, file) = pipe();
        let mut reader = portable::FileReader::new(file);
        check(writer, &mut |bytes, within| reader.read(bytes, within));
    }
}
