//! The recording's file behind a small buffer. It tracks the end of the last whole record: after a failed write the
//! file is truncated there and closed with a valid end. Each write, and each flush without one, first looks whether
//! another program has taken the file.

use std::io::{self, Seek, SeekFrom, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use mcap::records::op;

use crate::recording::OutputFile;
use crate::recording::metadata::END;

/// The file behind a small buffer that, unlike the standard library's, is discarded after a failed write.
pub(super) struct RecordFile {
    pub(super) file: OutputFile,
    waiting: Vec<u8>,
    written: u64,
    /// End of the last whole record in the file.
    complete: u64,
    /// Whether another program has written into the file or shortened it: it is left to that program then.
    is_of_another: bool,
    at_disk: Arc<AtomicBool>,
}

/// Writes of at least this size bypass the buffer, bytes.
const LARGE: usize = 1 << 14;

/// Largest piece that is passed to the operating system at once, bytes. The system allocates a contiguous block for
/// each piece; from 256 KB on that cost 2 to 4 times the CPU (ext4, Linux 6.18).
const PIECE: usize = 1 << 17;

impl Write for RecordFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if bytes.len() < LARGE {
            self.waiting.extend_from_slice(bytes);
        } else {
            self.hand_over()?;
            self.put(bytes)?;
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.hand_over()?;
        self.complete = self.written;
        Ok(())
    }
}

impl RecordFile {
    pub(super) fn new(file: OutputFile, at_disk: &Arc<AtomicBool>) -> Self {
        Self { file, waiting: Vec::new(), written: 0, complete: 0, is_of_another: false, at_disk: Arc::clone(at_disk) }
    }

    /// Waits until everything is on the disk.
    pub(super) fn sync(&mut self) -> io::Result<()> {
        self.flush()?;
        self.file.file().sync_all()
    }

    fn hand_over(&mut self) -> io::Result<()> {
        let waiting = std::mem::take(&mut self.waiting);
        let outcome = self.put(&waiting);
        self.waiting = waiting;
        self.waiting.clear();
        outcome
    }

    fn put(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.at_disk.store(true, Ordering::Relaxed);
        let outcome =
            self.check().and_then(|()| bytes.chunks(PIECE).try_for_each(|piece| self.file.file().write_all(piece)));
        self.at_disk.store(false, Ordering::Relaxed);
        outcome?;
        self.written += bytes.len() as u64;
        Ok(())
    }

    /// Checks that no other program has taken the file away or changed its length; a device has none.
    fn check(&mut self) -> io::Result<()> {
        let about = self.file.file().metadata()?;
        self.is_of_another = about.is_file() && about.len() != self.written;
        let what = match (self.is_of_another, !about.is_file() || self.file.is_in_place(&about)) {
            (true, _) => "shortened or overwrote",
            (false, false) => "removed, renamed or replaced",
            (false, true) => return Ok(()),
        };
        Err(io::Error::other(format!("another program {what} this file while it was recorded")))
    }

    /// After a failed write: truncates an incomplete record, and writes a valid end if the disk has room for it.
    pub(super) fn salvage(self, why: &str) {
        if self.is_of_another {
            return;
        }
        let mut file = self.file.file();
        let mut close = |end: &[u8]| -> io::Result<()> {
            file.set_len(self.complete)?;
            file.seek(SeekFrom::Start(self.complete))?;
            file.write_all(end)
        };
        let with_reason = [stop_record(why).as_slice(), CLOSING].concat();
        if close(&with_reason).is_err() && close(CLOSING).is_err() {
            // Even the short end could not be written: the file then ends with its last whole chunk, which is all that
            // our reader needs.
            let _ = close(&[]);
        }
    }
}

/// The shortest valid end of a file: the end of the data, a footer without a summary, the magic bytes.
const CLOSING: &[u8] = b"\x0f\x04\0\0\0\0\0\0\0\0\0\0\0\
    \x02\x14\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\
    \x89MCAP0\r\n";

/// The metadata record of a recording that had to stop, with the reason.
fn stop_record(why: &str) -> Vec<u8> {
    let text = |s: &str| [&u32::try_from(s.len()).unwrap_or(0).to_le_bytes(), s.as_bytes()].concat();
    let pair = [text("stopped"), text(why)].concat();
    let body = [text(END), u32::try_from(pair.len()).unwrap_or(0).to_le_bytes().to_vec(), pair].concat();
    [vec![op::METADATA], (body.len() as u64).to_le_bytes().to_vec(), body].concat()
}
