//! The queue of messages in memory, and the thread that writes them, so that no recording thread waits for the disk.
//!
//! The thread empties the queue whenever it fills a chunk, and at the latest every [`FLUSH_EVERY`]. On a busy machine
//! the thread may not be scheduled for seconds, and a kill would lose everything in the queue. Therefore a caller that
//! finds the queue [late](Queue::is_late) writes it itself: a caller that adds a message is being scheduled. Only while
//! the writing thread waits for the disk do callers continue without writing, as long as the queue has room.

use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Instant;

use mcap::McapError;
use taxel_core::problem;

use super::chunk_writer::{CHUNK_BYTES, ChunkWriter};
use super::queue::{MessageQueue, QueuedMessage};
use super::record_file::RecordFile;
use crate::locked::lock;
use crate::recording::{Compression, FLUSH_EVERY, Header, OutputFile, RecordingCounts, Topic};
use crate::{Error, Result};

/// The queue of a recording, and the state of its file: being written, or closed.
pub(super) struct WriteQueue {
    pub(super) path: PathBuf,
    /// Locked by the thread that writes; if both locks are needed, before `state`. `None` after the file's end.
    pub(super) writer: Mutex<Option<ChunkWriter>>,
    pub(super) thread: Mutex<Option<JoinHandle<Result<()>>>>,
    /// Whether the thread that writes waits for the operating system.
    pub(super) at_disk: Arc<AtomicBool>,
    state: Mutex<Pending>,
    /// Wakes the thread: the recording ends, or the queue fills a chunk.
    work: Condvar,
    /// Wakes callers: the queue has room again, or writing has failed.
    room: Condvar,
}

#[derive(Default)]
pub(super) struct Pending {
    pub(super) queue: MessageQueue,
    /// What was written of each source.
    pub(super) written: Vec<Written>,
    /// The final counts of each source except the first.
    pub(super) ends: BTreeMap<String, RecordingCounts>,
    /// How the recording ends; set once. The inner `None` is an end without finishing.
    end: Option<Option<RecordingCounts>>,
    /// Why writing failed; nothing is queued after it.
    failure: Option<WriteFailure>,
}

impl Pending {
    /// Why writing failed, if it has.
    pub(super) fn check(&self, path: &Path) -> Result<()> {
        self.failure.clone().map_or(Ok(()), |failure| Err(failure.of_file(path)))
    }
}

/// What was written of a source.
#[derive(Debug, Clone, Default)]
pub(super) struct Written {
    /// Number of datagrams, lines and frames.
    pub(super) data: u64,
    /// Number of other messages whose loss a verdict tells.
    others: BTreeMap<Topic, u64>,
    /// Whether a recording with nothing else is kept, for a note or for bytes that are in no line.
    pub(super) is_kept: bool,
}

impl Written {
    fn add(&mut self, topic: Topic) {
        if topic.is_data() {
            self.data += 1;
        } else if topic.lost_in_file().is_some() {
            *self.others.entry(topic).or_default() += 1;
        }
    }

    /// Counts that state what a reader must find: all but the number of datagrams, which a caller counts while it records.
    pub(super) fn counts_so_far(&self, counts: RecordingCounts) -> RecordingCounts {
        RecordingCounts { messages: self.others.clone(), ..counts }
    }

    /// The same at the end.
    pub(super) fn at_end(&self, counts: RecordingCounts) -> RecordingCounts {
        RecordingCounts { recorded: self.data, ..self.counts_so_far(counts) }
    }
}

/// The operating system's error of a failed write, which every later call returns; `io::Error` itself cannot be copied.
#[derive(Clone)]
struct WriteFailure {
    code: Option<i32>,
    text: String,
}

impl WriteQueue {
    /// Begins the file, without the thread that writes it.
    pub(super) fn open(file: OutputFile, header: &Header, compression: Compression) -> Result<Self> {
        let (path, at_disk) = (file.path().to_owned(), Arc::new(AtomicBool::new(false)));
        let writer = ChunkWriter::begin(file, header, compression, &at_disk)
            .map_err(|error| WriteFailure::new(error).of_file(&path))?;
        let written = vec![Written::default(); header.sources.len() + 1];
        Ok(Self {
            path,
            writer: Mutex::new(Some(writer)),
            thread: Mutex::default(),
            at_disk,
            state: Mutex::new(Pending { written, ..Pending::default() }),
            work: Condvar::new(),
            room: Condvar::new(),
        })
    }

    /// Starts the thread that writes.
    pub(super) fn start(self: &Arc<Self>) -> Result<()> {
        let queue = Arc::clone(self);
        let thread = std::thread::Builder::new().name("taxel-record".to_owned()).spawn(move || queue.run());
        *lock(&self.thread) = Some(thread.map_err(Error::file(&self.path))?);
        Ok(())
    }

    pub(super) fn lock(&self) -> MutexGuard<'_, Pending> {
        lock(&self.state)
    }

    /// Adds a message of a source; waits while the queue contains `most` bytes or more.
    pub(super) fn push(
        &self,
        source: usize,
        topic: Topic,
        (at_ns, number): (i64, u64),
        bytes: &[u8],
        most: usize,
    ) -> Result<()> {
        let mut state = self.lock();
        while state.queue.bytes.len() >= most && state.failure.is_none() {
            self.work.notify_all();
            state = self.room.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        state.check(&self.path)?;
        if state.end.is_some() {
            return Err(problem!("{}: the recording has ended", self.path.display()).into());
        }
        let before = state.queue.bytes.len();
        state.queue.bytes.extend_from_slice(bytes);
        if before < CHUNK_BYTES && state.queue.bytes.len() >= CHUNK_BYTES {
            self.work.notify_all();
        }
        state.written[source].add(topic);
        // The number in the format has 32 bits; the reader unwraps it.
        #[allow(clippy::cast_possible_truncation)]
        let number = number as u32;
        let at_ns = u64::try_from(at_ns).unwrap_or(0);
        state.queue.messages.push(QueuedMessage { channel: topic.channel(source), number, at_ns, bytes: bytes.len() });
        state.queue.since.get_or_insert_with(Instant::now);
        if !state.queue.is_late() || self.at_disk.load(Ordering::Relaxed) {
            return Ok(());
        }
        drop(state);
        self.drain()
    }

    /// Ends the recording, with the counts of its first source if it is finished, and waits for the thread; the file is
    /// then on the disk.
    pub(super) fn finish(&self, counts: Option<RecordingCounts>) -> Result<()> {
        {
            let mut state = self.lock();
            let counts = counts.map(|counts| state.written[0].at_end(counts));
            state.end.get_or_insert(counts);
        }
        self.work.notify_all();
        let thread = lock(&self.thread).take();
        match thread.map(JoinHandle::join) {
            None => Ok(()),
            Some(Ok(outcome)) => outcome,
            Some(Err(panic)) => std::panic::resume_unwind(panic),
        }
    }

    /// Ends without an end record, and returns the file.
    pub(super) fn abandon(&self) -> Option<OutputFile> {
        let file = lock(&self.writer).take().map(|writer| writer.into_file().file);
        // Without a chunk writer the thread ends at once.
        let _ = self.finish(None);
        file
    }

    /// The writing thread: writes the queue, and waits for more.
    fn run(&self) -> Result<()> {
        raise_priority();
        loop {
            let began = Instant::now();
            self.drain()?;
            let state = self.lock();
            if let (true, Some(end)) = (state.queue.is_empty(), state.end.clone()) {
                drop(state);
                return self.close(end.as_ref());
            }
            if state.end.is_none() && state.queue.bytes.len() < CHUNK_BYTES {
                let rest = FLUSH_EVERY.saturating_sub(began.elapsed());
                drop(self.work.wait_timeout(state, rest).unwrap_or_else(PoisonError::into_inner));
            }
        }
    }

    /// Writes all that waits, in order: the writer is locked from before the one to after the other.
    fn drain(&self) -> Result<()> {
        let mut slot = lock(&self.writer);
        let Some(writer) = slot.as_mut() else {
            // Writing has failed meanwhile, with the error in the queue; or the file was abandoned, and what still waits
            // for it is not written.
            let mut state = self.lock();
            state.queue = MessageQueue::default();
            return state.check(&self.path);
        };
        std::mem::swap(&mut self.lock().queue, &mut writer.batch);
        self.room.notify_all();
        match writer.write() {
            Ok(()) => Ok(()),
            Err(error) => Err(self.fail(error, slot.take().map(ChunkWriter::into_file))),
        }
    }

    /// Writes the end, and waits for the disk.
    fn close(&self, counts: Option<&RecordingCounts>) -> Result<()> {
        let Some(mut writer) = lock(&self.writer).take() else { return Ok(()) };
        let ends = std::mem::take(&mut self.lock().ends);
        if let Err(error) = writer.end(counts, &ends) {
            return Err(self.fail(error, Some(writer.into_file())));
        }
        let mut file = writer.into_file();
        if let Err(error) = file.sync() {
            return Err(self.fail(error.into(), Some(file)));
        }
        Ok(())
    }

    /// Stores an error for later callers, and leaves a readable file.
    fn fail(&self, error: McapError, file: Option<RecordFile>) -> Error {
        let failure = WriteFailure::new(error);
        if let Some(file) = file {
            file.salvage(&failure.text);
        }
        self.lock().failure = Some(failure.clone());
        self.room.notify_all();
        failure.of_file(&self.path)
    }
}

impl WriteFailure {
    fn new(error: McapError) -> Self {
        match error {
            McapError::Io(error) => {
                let message = error.to_string();
                let text = message.split(" (os error").next().unwrap_or(&message).to_owned();
                Self { code: error.raw_os_error(), text }
            }
            other => Self { code: None, text: other.to_string() },
        }
    }

    fn of_file(self, path: &Path) -> Error {
        let source = match self.code {
            Some(code) => io::Error::from_raw_os_error(code),
            None => io::Error::other(self.text),
        };
        Error::File { path: path.to_owned(), source }
    }
}

/// Raises the calling thread's priority on a busy machine, if the system allows it (the superuser, or `LimitNICE`).
#[cfg(target_os = "linux")]
fn raise_priority() {
    // SAFETY: a system call with numbers only; on Linux 0 selects the calling thread. If the call is refused, nothing
    // changes.
    unsafe { libc::setpriority(libc::PRIO_PROCESS, 0, -10) };
}

/// Elsewhere the priority stays.
#[cfg(not(target_os = "linux"))]
fn raise_priority() {}
