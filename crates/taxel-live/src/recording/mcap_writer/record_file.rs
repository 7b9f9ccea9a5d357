//! The recording's file behind a small buffer, which knows how far the file holds whole records: after a failed write it is cut
//! there and closed soundly.

use std::io::{self, Seek, SeekFrom, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use mcap::records::op;

use crate::recording::OutputFile;
use crate::recording::metadata::END;

/// The file behind a small buffer that, unlike the standard library's, is thrown away when a write failed.
pub(super) struct RecordFile {
    pub(super) file: OutputFile,
    waiting: Vec<u8>,
    written: u64,
    /// How far the file holds whole records.
    whole: u64,
    at_disk: Arc<AtomicBool>,
}

/// From this size on bytes go to the file without a stay in the buffer.
const LARGE: usize = 1 << 14;

/// The largest piece that the operating system is given at once. It takes as large a block of memory for each as it finds: from
/// 256 KB on that cost 2 to 4 times the CPU (ext4, Linux 6.18).
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
        self.whole = self.written;
        Ok(())
    }
}

impl RecordFile {
    pub(super) fn new(file: OutputFile, at_disk: &Arc<AtomicBool>) -> Self {
        Self { file, waiting: Vec::new(), written: 0, whole: 0, at_disk: Arc::clone(at_disk) }
    }

    /// Waits until the disk has all.
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
        let outcome = bytes.chunks(PIECE).try_for_each(|piece| self.file.file().write_all(piece));
        self.at_disk.store(false, Ordering::Relaxed);
        outcome?;
        self.written += bytes.len() as u64;
        Ok(())
    }

    /// After a failed write: cuts what is torn off, and closes the file where the disk still has room for that.
    pub(super) fn salvage(self, why: &str) {
        let mut file = self.file.file();
        let mut close = |end: &[u8]| -> io::Result<()> {
            file.set_len(self.whole)?;
            file.seek(SeekFrom::Start(self.whole))?;
            file.write_all(end)
        };
        let with_reason = [stopped(why).as_slice(), CLOSING].concat();
        if close(&with_reason).is_err() && close(CLOSING).is_err() {
            // Not even that: the file then ends with its last whole chunk, which is all that our reader needs.
            let _ = close(&[]);
        }
    }
}

/// The shortest sound end of a file: the end of the data, a footer without a summary, the magic.
const CLOSING: &[u8] = b"\x0f\x04\0\0\0\0\0\0\0\0\0\0\0\
    \x02\x14\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\
    \x89MCAP0\r\n";

/// The metadata record of a recording that could not go on.
fn stopped(why: &str) -> Vec<u8> {
    let text = |s: &str| [&u32::try_from(s.len()).unwrap_or(0).to_le_bytes(), s.as_bytes()].concat();
    let pair = [text("stopped"), text(why)].concat();
    let body = [text(END), u32::try_from(pair.len()).unwrap_or(0).to_le_bytes().to_vec(), pair].concat();
    [vec![op::METADATA], (body.len() as u64).to_le_bytes().to_vec(), body].concat()
}
