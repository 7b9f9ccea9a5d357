//! Writes the live format without ever making the way wait for the disk.
//!
//! Callers append to a queue in memory; a thread of its own takes the queue when it fills a chunk, at the latest every
//! [`FLUSH_EVERY`](super::FLUSH_EVERY), and hands chunks to the operating system in whole records. Chunks are built in memory (the crate's
//! buffered mode) because its direct mode goes back to fill in lengths: a kill in between would leave a length of 2e16.
//!
//! On a busy machine that thread may get no processor for seconds, and a kill would take all that waits for it. So a caller
//! who finds the queue [`LATE`](super::LATE) writes it himself: whoever has something to give has a processor to write it with. Only
//! where the thread waits for the disk do callers go on without it, as long as there is room.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Instant;

use mcap::records::{MessageHeader, Metadata, op};
use mcap::write::NoSeek;
use mcap::{McapError, WriteOptions};
use serde_json::json;
use taxel_core::detect::Detection;
use taxel_core::encode::{Tare, Zeroing};
use taxel_core::wire::Registers;
use taxel_core::{Marker, problem};

use super::picture::Pictures;
use super::{BoardChange, Compression, Counts, FLUSH_EVERY, Header, LATE, Stream, Topic, WriterOptions, create};
use crate::locked::lock;
use crate::{Error, Result};

/// A chunk is closed when it is this large, or when the queue is empty.
const CHUNK_BYTES: usize = 1 << 20;

/// How much may wait in memory when the disk stalls; then callers wait too (0.6 s of the sensor's worst case).
const QUEUE_BYTES: usize = 64 << 20;

/// How much may wait of who gives all at once: memory that stays in the caches, and is not asked for anew.
const BULK_BYTES: usize = 4 << 20;

/// The largest datagram that UDP can carry.
const DATAGRAM_BYTES: usize = 65_507;

/// Name of the metadata record at the beginning of a recording.
pub(super) const BEGIN: &str = "taxel";
/// Name of the metadata record at its end.
pub(super) const END: &str = "taxel.end";

/// What may wait in memory for the clock of a recording that is not at its file yet, bytes: heartbeats of a board of version 2
/// at rest for hours.
const WAITING_BYTES: usize = 1 << 22;

/// A recording being written; one may be fed from several threads.
///
/// Dropped without [`Writer::finish`], it keeps everything that was given, and says that it was not finished; one that has not
/// begun its file leaves none.
pub struct Writer {
    /// The first source.
    track: Track,
    header: Header,
}

/// One source's part of a recording being written; fed from any thread. A [`Writer`] is the first one's.
pub struct Track {
    path: PathBuf,
    shared: Arc<Shared>,
    /// Which of the file's sources.
    source: usize,
    stream: Option<Stream>,
    /// Columns of the array.
    columns: usize,
    pictures: Mutex<Pictures>,
}

impl std::ops::Deref for Writer {
    type Target = Track;

    fn deref(&self) -> &Track {
        &self.track
    }
}

struct Shared {
    /// How the file is begun, as long as it is not.
    plan: Mutex<Option<Plan>>,
    /// Held by who writes; taken before `state` where both are. `None` before the file is begun, and once writing is over.
    pen: Mutex<Option<Pen>>,
    thread: Mutex<Option<JoinHandle<Result<()>>>>,
    /// Whether who writes waits for the operating system.
    at_disk: Arc<AtomicBool>,
    state: Mutex<Pending>,
    /// Wakes the thread: the end has come, or the queue fills a chunk.
    work: Condvar,
    /// Wakes callers: there is room in the queue again, or no hope.
    room: Condvar,
}

/// A file that is not begun yet.
struct Plan {
    header: Header,
    how: WriterOptions,
}

#[derive(Default)]
struct Pending {
    queue: Queue,
    /// Whether the file is begun; until then everything waits.
    begun: bool,
    /// Whether the file waits for the board's clock ([`Writer::begin`]), and not only for something to keep.
    for_clock: bool,
    /// Datagrams and samples of each source.
    recorded: Vec<u64>,
    /// What each source but the first said at its end.
    ends: BTreeMap<String, Counts>,
    /// How the recording ends: set once.
    end: Option<Option<Counts>>,
    /// What broke the writing; nothing is taken after it.
    broken: Option<Broken>,
}

/// What the operating system said when a write failed; `io::Error` itself cannot be said twice.
#[derive(Clone)]
struct Broken {
    code: Option<i32>,
    text: String,
}

#[derive(Default)]
struct Queue {
    messages: Vec<Queued>,
    bytes: Vec<u8>,
    /// When the first of them came.
    since: Option<Instant>,
}

struct Queued {
    channel: u16,
    number: u32,
    at_ns: u64,
    bytes: usize,
}

impl Queue {
    fn is_empty(&self) -> bool {
        self.messages.is_empty()
    }

    fn is_late(&self) -> bool {
        self.since.is_some_and(|since| since.elapsed() >= LATE)
    }

    fn clear(&mut self) {
        self.messages.clear();
        self.bytes.clear();
        self.since = None;
    }
}

impl Writer {
    /// Begins a recording of the header's source and of those that it names; the file is readable from here on.
    ///
    /// # Errors
    ///
    /// `File` where the file exists (and `overwrite` is not set), or cannot be created or written; `Core(Problem)` for sources
    /// that make no sense.
    pub fn create(path: &Path, header: &Header, options: WriterOptions) -> Result<Self> {
        let writer = Self::plan(path, header, options, false)?;
        writer.begin(header.origin_us)?;
        Ok(writer)
    }

    /// As [`Writer::create`], but the file is touched with the first datagram or sample; or, where it waits `for_clock`, with
    /// [`Writer::begin`]. What is given before waits.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` for sources that make no sense.
    pub fn plan(path: &Path, header: &Header, how: WriterOptions, for_clock: bool) -> Result<Self> {
        header.check()?;
        let recorded = vec![0; header.sources.len() + 1];
        let shared = Arc::new(Shared {
            plan: Mutex::new(Some(Plan { header: header.clone(), how })),
            pen: Mutex::default(),
            thread: Mutex::default(),
            at_disk: Arc::new(AtomicBool::new(false)),
            state: Mutex::new(Pending { recorded, for_clock, ..Pending::default() }),
            work: Condvar::new(),
            room: Condvar::new(),
        });
        let track = Track {
            path: path.to_owned(),
            shared,
            source: 0,
            stream: header.stream.clone(),
            columns: header.array.columns.into(),
            pictures: Mutex::default(),
        };
        Ok(Self { track, header: header.clone() })
    }

    /// Begins the file of [`Writer::plan`] with what is added to decoded times, us ([`Header::origin_us`]); gives whether that came
    /// in time, before it was begun with the header's.
    ///
    /// # Errors
    ///
    /// As [`Writer::create`].
    pub fn begin(&self, origin_us: i64) -> Result<bool> {
        self.shared.begin(&self.track.path, Some(origin_us))
    }

    /// Whether the file is begun.
    #[must_use]
    pub fn has_begun(&self) -> bool {
        self.shared.lock().begun
    }

    /// Says when it was begun, ns since 1970, where its file is not.
    pub fn started(&self, at_ns: i64) {
        if let Some(plan) = &mut *lock(&self.shared.plan) {
            plan.header.started_ns = at_ns;
        }
    }

    /// Another source's part.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` where the header named none of that name.
    pub fn track(&self, name: &str) -> Result<Track> {
        let named = self.header.sources.iter().position(|source| source.name == name);
        let Some(k) = named else {
            return Err(problem!("source {name:?}: the recording has none of that name").into());
        };
        Ok(Track {
            path: self.track.path.clone(),
            shared: Arc::clone(&self.track.shared),
            source: k + 1,
            stream: self.header.sources[k].stream.clone(),
            columns: self.header.sources[k].array.columns.into(),
            pictures: Mutex::default(),
        })
    }

    /// Whether any source has given anything.
    #[must_use]
    pub fn holds_anything(&self) -> bool {
        self.shared.lock().recorded.iter().any(|&n| n > 0)
    }

    /// Ends the recording with what was lost of the first source and a verdict line, which it gives back; the other sources
    /// have ended before ([`Track::end`]).
    ///
    /// The file is on the disk when this returns.
    ///
    /// # Errors
    ///
    /// `File` where the disk is full or gone; the file keeps everything that was written before.
    pub fn finish(self, counts: Counts) -> Result<Counts> {
        self.begin(self.header.origin_us)?;
        let counts = {
            let mut state = self.shared.lock();
            let counts = Counts { recorded: state.recorded[0], ..counts };
            state.end = Some(Some(counts.clone()));
            counts
        };
        self.shared.work.notify_all();
        self.join()?;
        Ok(counts)
    }

    fn join(&self) -> Result<()> {
        let thread = lock(&self.shared.thread).take();
        match thread.map(JoinHandle::join) {
            None => Ok(()),
            Some(Ok(outcome)) => outcome,
            Some(Err(panic)) => std::panic::resume_unwind(panic),
        }
    }
}

impl Track {
    /// Keeps numbers of a stream as they came, one for each of its columns: arrival by the host's clock (ns since 1970), our
    /// arrival number.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` where the source is no stream, or has other columns; else as [`Track::datagram`].
    pub fn sample(&self, arrived_ns: i64, number: u64, values: &[f64]) -> Result<()> {
        let Some(stream) = self.stream.as_ref().filter(|stream| stream.takes(values)) else {
            let n = self.stream.as_ref().map_or(0, |stream| stream.columns.len());
            return Err(problem!("{} values: the source has {n} columns", values.len()).into());
        };
        self.push(Topic::Samples, arrived_ns, number, stream.message(values).to_string().as_bytes())
    }

    /// Keeps a line of a stream that could not be read, as it came.
    ///
    /// # Errors
    ///
    /// As [`Track::datagram`].
    pub fn strange_line(&self, arrived_ns: i64, number: u64, line: &str) -> Result<()> {
        self.push(Topic::Samples, arrived_ns, number, json!({ "line": line }).to_string().as_bytes())
    }

    /// Says what was received and lost of this source, at its end; nothing is taken of it afterwards.
    pub fn end(&self, name: &str, counts: Counts) {
        let mut state = self.shared.lock();
        let recorded = state.recorded[self.source];
        state.ends.insert(name.to_owned(), Counts { recorded, ..counts });
    }

    /// Keeps a datagram as it came: arrival by the host's clock (ns since 1970), our arrival number, bytes.
    ///
    /// # Errors
    ///
    /// `File` where an earlier write failed: the disk is full, or gone. `Core` where the bytes are more than a datagram
    /// can be.
    pub fn datagram(&self, arrived_ns: i64, number: u64, bytes: &[u8]) -> Result<()> {
        self.datagram_at_most(arrived_ns, number, bytes, QUEUE_BYTES)
    }

    fn datagram_at_most(&self, arrived_ns: i64, number: u64, bytes: &[u8], most: usize) -> Result<()> {
        if bytes.len() > DATAGRAM_BYTES {
            return Err(problem!("datagram of {} bytes: UDP carries at most {DATAGRAM_BYTES}", bytes.len()).into());
        }
        self.push_at_most(Topic::Datagrams, arrived_ns, number, bytes, most)
    }

    /// Keeps many datagrams: each begins in `bytes` where `offsets` say, whose last entry says where all end.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` where columns differ in length or name bytes that are not there; else as [`Track::datagram`].
    pub fn datagrams(&self, arrived_ns: &[i64], number: &[u64], offsets: &[i64], bytes: &[u8]) -> Result<()> {
        if number.len() != arrived_ns.len() || offsets.len() != arrived_ns.len() + 1 {
            let n = arrived_ns.len();
            return Err(problem!("{n} arrivals: need {n} numbers and {} offsets", n + 1).into());
        }
        for (k, two) in offsets.windows(2).enumerate() {
            let range = usize::try_from(two[0]).ok().zip(usize::try_from(two[1]).ok());
            let Some(datagram) = range.and_then(|(from, to)| bytes.get(from..to)) else {
                return Err(problem!("datagram {k}: bytes {} to {} are not there", two[0], two[1]).into());
            };
            self.datagram_at_most(arrived_ns[k], number[k], datagram, BULK_BYTES)?;
        }
        Ok(())
    }

    /// Keeps the board's registers, as they are from now on.
    ///
    /// # Errors
    ///
    /// As [`Track::datagram`], also below.
    pub fn registers(&self, at_ns: i64, registers: &Registers) -> Result<()> {
        self.push_json(Topic::Registers, at_ns, &json!(registers))
    }

    /// Keeps a start or stop that the board marked.
    ///
    /// # Errors
    ///
    /// As [`Track::datagram`].
    pub fn marker(&self, at_ns: i64, marker: Marker) -> Result<()> {
        self.push_json(Topic::Markers, at_ns, &json!({ "t_us": marker.t, "start": marker.start }))
    }

    /// Keeps a note of a person; `t_us` is the board's time where it is known.
    ///
    /// # Errors
    ///
    /// As [`Track::datagram`].
    pub fn note(&self, at_ns: i64, t_us: Option<i64>, text: &str) -> Result<()> {
        self.push_json(Topic::Notes, at_ns, &log(at_ns, t_us, text))
    }

    /// Keeps that a person zeroed a taxel, as a note that says so.
    ///
    /// # Errors
    ///
    /// As [`Track::datagram`].
    pub fn zeroing(&self, at_ns: i64, zeroing: &Zeroing) -> Result<()> {
        let Zeroing { t, x, y, rest, before } = *zeroing;
        let before_said = before.map_or_else(|| "unknown".to_owned(), |before| format!("{before:.1}"));
        let text = format!("zeroed row {y}, column {x}: rest {before_said} to {rest:.1} ticks");
        let mut note = log(at_ns, Some(t), &text);
        note["zeroed"] = json!({ "x": x, "y": y, "rest": rest, "before": before });
        self.pictures().zero(usize::from(y) * self.columns + usize::from(x), rest);
        self.push_json(Topic::Notes, at_ns, &note)
    }

    /// Keeps a reset of the board, or a change of its version of the wire.
    ///
    /// # Errors
    ///
    /// As [`Track::datagram`].
    pub fn board_change(&self, change: &BoardChange) -> Result<()> {
        let said = serde_json::to_value(change).unwrap_or_default();
        self.push_json(Topic::Board, change.at_ns, &said)
    }

    /// Keeps what a readout said; `at_ns` is when it said so.
    ///
    /// # Errors
    ///
    /// As [`Track::datagram`].
    pub fn detection(&self, at_ns: i64, detection: &Detection) -> Result<()> {
        let Detection { label, t, known, slope, repaired } = detection;
        let said = json!({ "label": label, "t_us": t, "known_us": known, "slope": slope, "repaired": repaired });
        self.push_json(Topic::Detections, at_ns, &said)
    }

    /// Keeps what was received and lost so far, so that an unfinished recording knows too; call it about once a second.
    ///
    /// # Errors
    ///
    /// As [`Track::datagram`].
    pub fn counts(&self, at_ns: i64, counts: &Counts) -> Result<()> {
        self.push_json(Topic::Counts, at_ns, &json!(counts))
    }

    /// Takes a tare's rest off the pictures from here on; before, the lowest value that each taxel held so far.
    pub fn tare(&self, tare: &Tare) {
        self.pictures().tare(tare);
    }

    fn pictures(&self) -> MutexGuard<'_, Pictures> {
        lock(&self.pictures)
    }

    /// Keeps a picture of held values for viewers: 8 bits above rest, the largest of the last 10 s being white. The
    /// message says what was taken off and how many ticks are white.
    ///
    /// # Errors
    ///
    /// As [`Track::datagram`]; `Core` where `ticks` are not rows of `columns`.
    pub fn picture(&self, at_ns: i64, t_us: i64, columns: u16, ticks: &[u16]) -> Result<()> {
        let columns = usize::from(columns);
        if columns == 0 || ticks.is_empty() || !ticks.len().is_multiple_of(columns) {
            let n = ticks.len();
            return Err(problem!("picture of {n} taxels, {columns} a row: must be whole rows").into());
        }
        let grey = self.pictures().take(t_us, ticks);
        let picture = json!({
            "timestamp": time(at_ns), "frame_id": "taxel", "width": columns, "height": ticks.len() / columns,
            "encoding": "mono8", "step": columns, "data": base64(&grey.bytes), "t_us": t_us,
            "rest": grey.rest, "full_ticks": grey.full,
        });
        self.push_json(Topic::Pressure, at_ns, &picture)
    }

    /// Keeps what the taxels hold before the recording's first datagram, ticks by taxel index; 65 535 of one that was
    /// never heard of. A recording that begins in mid-stream would else know a taxel from its next change on.
    ///
    /// # Errors
    ///
    /// As [`Track::datagram`].
    pub fn held(&self, at_ns: i64, t_us: Option<i64>, ticks: &[u16]) -> Result<()> {
        let bytes: Vec<u8> = ticks.iter().flat_map(|value| value.to_le_bytes()).collect();
        let held = json!({ "t_us": t_us, "encoding": "uint16, little-endian", "ticks": base64(&bytes) });
        self.push_json(Topic::Held, at_ns, &held)
    }

    fn push_json(&self, topic: Topic, at_ns: i64, value: &serde_json::Value) -> Result<()> {
        self.push(topic, at_ns, 0, value.to_string().as_bytes())
    }

    fn push(&self, topic: Topic, at_ns: i64, number: u64, bytes: &[u8]) -> Result<()> {
        self.push_at_most(topic, at_ns, number, bytes, QUEUE_BYTES)
    }

    /// Waits while `most` bytes or more wait.
    fn push_at_most(&self, topic: Topic, at_ns: i64, number: u64, bytes: &[u8], most: usize) -> Result<()> {
        let mut state = self.shared.lock();
        while state.begun && state.queue.bytes.len() >= most && state.broken.is_none() {
            self.shared.work.notify_all();
            state = self.shared.room.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        if let Some(broken) = &state.broken {
            return Err(broken.clone().named(&self.path));
        }
        if state.end.is_some() {
            return Err(problem!("{}: the recording has ended", self.path.display()).into());
        }
        let before = state.queue.bytes.len();
        state.queue.bytes.extend_from_slice(bytes);
        if state.begun && before < CHUNK_BYTES && state.queue.bytes.len() >= CHUNK_BYTES {
            self.shared.work.notify_all();
        }
        // The format's number has 32 bits; the reader unwraps it.
        #[allow(clippy::cast_possible_truncation)]
        let number = number as u32;
        let at_ns = u64::try_from(at_ns).unwrap_or(0);
        state.queue.messages.push(Queued { channel: topic.channel(self.source), number, at_ns, bytes: bytes.len() });
        state.queue.since.get_or_insert_with(Instant::now);
        let data = matches!(topic, Topic::Datagrams | Topic::Samples);
        state.recorded[self.source] += u64::from(data);
        if !state.begun {
            if data && (!state.for_clock || state.queue.bytes.len() > WAITING_BYTES) {
                drop(state);
                self.shared.begin(&self.path, None)?;
            }
            return Ok(());
        }
        if !state.queue.is_late() || self.shared.at_disk.load(Ordering::Relaxed) {
            return Ok(());
        }
        drop(state);
        self.shared.drain(&self.path)
    }
}

impl Drop for Writer {
    fn drop(&mut self) {
        if lock(&self.shared.thread).is_some() {
            self.shared.lock().end.get_or_insert(None);
            self.shared.work.notify_all();
            // Nobody is left to hear of it; the file says itself that it was not finished.
            let _ = self.join();
        }
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, Pending> {
        lock(&self.state)
    }

    fn pen(&self) -> MutexGuard<'_, Option<Pen>> {
        lock(&self.pen)
    }

    /// Begins the file, once; gives whether it was this call that did.
    fn begin(self: &Arc<Self>, path: &Path, origin_us: Option<i64>) -> Result<bool> {
        // Held until the file is there: who comes second finds it begun.
        let mut planned = lock(&self.plan);
        let Some(Plan { header, how }) = planned.take() else {
            return self.lock().broken.clone().map_or(Ok(false), |broken| Err(broken.named(path)));
        };
        let header = Header { origin_us: origin_us.unwrap_or(header.origin_us), ..header };
        let begun = self.open(path, &header, how);
        if let Err(error) = &begun {
            self.lock().broken = Some(Broken::again(error));
            self.room.notify_all();
        }
        begun.map(|()| true)
    }

    fn open(self: &Arc<Self>, path: &Path, header: &Header, how: WriterOptions) -> Result<()> {
        self.set_out(path, header, how)?;
        let (shared, to) = (Arc::clone(self), path.to_owned());
        let thread = std::thread::Builder::new().name("taxel-record".to_owned()).spawn(move || shared.write(&to));
        *lock(&self.thread) = Some(thread.map_err(Error::file(path))?);
        Ok(())
    }

    /// The file without the thread that writes it.
    fn set_out(&self, path: &Path, header: &Header, how: WriterOptions) -> Result<()> {
        let file = create(path, how.overwrite)?;
        let pen = Pen::begin(file, header, how.compression, &self.at_disk).map_err(|e| Broken::of(e).named(path))?;
        *self.pen() = Some(pen);
        let mut state = self.lock();
        state.begun = true;
        // What waited for the file is as new as the file.
        if state.queue.since.is_some() {
            state.queue.since = Some(Instant::now());
        }
        Ok(())
    }

    /// The thread's whole life: write the queue, wait.
    fn write(&self, path: &Path) -> Result<()> {
        before_others();
        loop {
            let began = Instant::now();
            self.drain(path)?;
            let state = self.lock();
            if let (true, Some(end)) = (state.queue.is_empty(), state.end.clone()) {
                drop(state);
                return self.end(end.as_ref(), path);
            }
            if state.end.is_none() && state.queue.bytes.len() < CHUNK_BYTES {
                let rest = FLUSH_EVERY.saturating_sub(began.elapsed());
                drop(self.work.wait_timeout(state, rest).unwrap_or_else(PoisonError::into_inner));
            }
        }
    }

    /// Takes the queue and writes it: order is kept, since the pen is held from before the one to after the other.
    fn drain(&self, path: &Path) -> Result<()> {
        let mut pen = self.pen();
        let Some(writing) = pen.as_mut() else {
            // Broken meanwhile, and said so; or at its end, and then nothing is given any more.
            return self.lock().broken.clone().map_or(Ok(()), |broken| Err(broken.named(path)));
        };
        std::mem::swap(&mut self.lock().queue, &mut writing.taken);
        self.room.notify_all();
        match writing.write() {
            Ok(()) => Ok(()),
            Err(error) => Err(self.broke(error, pen.take().map(Pen::sheet), path)),
        }
    }

    /// Writes the end, and waits for the disk.
    fn end(&self, counts: Option<&Counts>, path: &Path) -> Result<()> {
        let Some(mut pen) = self.pen().take() else { return Ok(()) };
        let ends = std::mem::take(&mut self.lock().ends);
        if let Err(error) = pen.end(counts, &ends) {
            return Err(self.broke(error, Some(pen.sheet()), path));
        }
        let mut sheet = pen.sheet();
        match sheet.flush().and_then(|()| sheet.file.sync_all()) {
            Ok(()) => Ok(()),
            Err(error) => Err(self.broke(error.into(), Some(sheet), path)),
        }
    }

    /// Tells callers of an error, and leaves a file that can be read.
    fn broke(&self, error: McapError, sheet: Option<RecordFile>, path: &Path) -> Error {
        let broken = Broken::of(error);
        if let Some(sheet) = sheet {
            sheet.salvage(&broken.text);
        }
        self.lock().broken = Some(broken.clone());
        self.room.notify_all();
        broken.named(path)
    }
}

impl Broken {
    /// What is said again of an error that was given.
    fn again(error: &Error) -> Self {
        match error {
            Error::File { source, .. } => Self { code: source.raw_os_error(), text: source.to_string() },
            other => Self { code: None, text: other.to_string() },
        }
    }

    fn of(error: McapError) -> Self {
        match error {
            McapError::Io(error) => {
                let said = error.to_string();
                let text = said.split(" (os error").next().unwrap_or(&said).to_owned();
                Self { code: error.raw_os_error(), text }
            }
            other => Self { code: None, text: other.to_string() },
        }
    }

    fn named(self, path: &Path) -> Error {
        let source = match self.code {
            Some(code) => io::Error::from_raw_os_error(code),
            None => io::Error::other(self.text),
        };
        Error::File { path: path.to_owned(), source }
    }
}

/// The file behind a small buffer that, unlike the standard library's, is thrown away when a write failed.
struct RecordFile {
    file: File,
    waiting: Vec<u8>,
    written: u64,
    /// How far the file holds whole records.
    whole: u64,
    at_disk: Arc<AtomicBool>,
}

/// From here on bytes go to the file without a stay in the buffer.
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
    fn hand_over(&mut self) -> io::Result<()> {
        let waiting = std::mem::take(&mut self.waiting);
        let outcome = self.put(&waiting);
        self.waiting = waiting;
        self.waiting.clear();
        outcome
    }

    fn put(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.at_disk.store(true, Ordering::Relaxed);
        let outcome = bytes.chunks(PIECE).try_for_each(|piece| self.file.write_all(piece));
        self.at_disk.store(false, Ordering::Relaxed);
        outcome?;
        self.written += bytes.len() as u64;
        Ok(())
    }

    /// After a failed write: cuts what is torn off, and closes the file where the disk still has room for that.
    fn salvage(mut self, why: &str) {
        let mut close = |end: &[u8]| -> io::Result<()> {
            self.file.set_len(self.whole)?;
            self.file.seek(SeekFrom::Start(self.whole))?;
            self.file.write_all(end)
        };
        let said = [stopped(why).as_slice(), CLOSING].concat();
        if close(&said).is_err() && close(CLOSING).is_err() {
            // Not even that: the file then ends with its last whole chunk, which is all that our reader needs.
            let _ = close(&[]);
        }
    }
}

/// The crate's writer with what a recording is about.
struct Pen {
    mcap: mcap::Writer<NoSeek<RecordFile>>,
    header: Header,
    /// What is being written; its memory is the queue's of the next time.
    taken: Queue,
}

impl Pen {
    fn begin(
        file: File,
        header: &Header,
        compression: Compression,
        at_disk: &Arc<AtomicBool>,
    ) -> std::result::Result<Self, McapError> {
        let options = WriteOptions::new()
            .profile("taxel")
            .library(concat!("taxel ", env!("CARGO_PKG_VERSION")))
            .compression(match compression {
                Compression::None => None,
                Compression::Lz4 => Some(mcap::Compression::Lz4),
                Compression::Zstd => Some(mcap::Compression::Zstd),
            })
            .compression_level(u32::from(compression == Compression::Zstd))
            .compression_threads(0)
            // Each chunk has its own checksum.
            .calculate_data_section_crc(false)
            .disable_seeking(true)
            .chunk_size(Some(2 * CHUNK_BYTES as u64));
        let sheet = RecordFile { file, waiting: Vec::new(), written: 0, whole: 0, at_disk: Arc::clone(at_disk) };
        let mcap = options.create(NoSeek::new(sheet))?;
        let mut pen = Self { mcap, header: header.clone(), taken: Queue::default() };
        let said = BTreeMap::from([("header".to_owned(), json!(header).to_string())]);
        pen.mcap.write_metadata(&Metadata { name: BEGIN.to_owned(), metadata: said.clone() })?;
        for (k, source) in std::iter::once(header).chain(&header.sources).enumerate() {
            for topic in Topic::of_source(source.stream.is_some()) {
                let schema = match topic.schema() {
                    None => 0,
                    Some((name, text)) => pen.mcap.add_schema(name, "jsonschema", text.as_bytes())?,
                };
                // Once more where a checksum guards it.
                let more = if k == 0 && topic == Topic::Datagrams { said.clone() } else { BTreeMap::new() };
                let (number, name) = (topic.channel(k), topic.channel_name(k, &source.name));
                pen.mcap.add_channel_with_id(number, schema, &name, topic.encoding(), &more)?;
            }
        }
        pen.mcap.flush()?;
        Ok(pen)
    }

    /// Packs messages into chunks and hands each to the operating system: from then on a kill cannot take it.
    fn write(&mut self) -> std::result::Result<(), McapError> {
        let (mut at, mut chunk) = (0, 0);
        for message in &self.taken.messages {
            let header = MessageHeader {
                channel_id: message.channel,
                sequence: message.number,
                log_time: message.at_ns,
                publish_time: message.at_ns,
            };
            self.mcap.write_to_known_channel(&header, &self.taken.bytes[at..at + message.bytes])?;
            at += message.bytes;
            chunk += MESSAGE_BYTES + message.bytes;
            if chunk >= CHUNK_BYTES {
                self.mcap.flush()?;
                chunk = 0;
            }
        }
        self.taken.clear();
        if chunk > 0 { self.mcap.flush() } else { Ok(()) }
    }

    /// Writes what was lost and the summary, and waits until the disk has all.
    fn end(
        &mut self,
        counts: Option<&Counts>,
        others: &BTreeMap<String, Counts>,
    ) -> std::result::Result<(), McapError> {
        if let Some(counts) = counts {
            let mut end = BTreeMap::from([
                ("verdict".to_owned(), counts.verdict()),
                ("counts".to_owned(), json!(counts).to_string()),
                ("header".to_owned(), json!(self.header).to_string()),
                ("stopped_ns".to_owned(), super::now_ns().to_string()),
            ]);
            end.extend(others.iter().map(|(name, counts)| (format!("counts.{name}"), json!(counts).to_string())));
            self.mcap.write_metadata(&Metadata { name: END.to_owned(), metadata: end })?;
        }
        self.mcap.flush()?;
        self.mcap.finish()?;
        Ok(())
    }

    fn sheet(self) -> RecordFile {
        self.mcap.into_inner().into_inner()
    }
}

/// Puts the calling thread before others on a busy machine, where the system allows it (the superuser, or `LimitNICE`).
fn before_others() {
    // SAFETY: a system call on numbers; on Linux 0 means the calling thread alone. Where it is refused nothing changes.
    unsafe { libc::setpriority(libc::PRIO_PROCESS, 0, -10) };
}

/// Bytes of a message record besides its content.
const MESSAGE_BYTES: usize = 31;

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

/// What a viewer shows as a line of text.
fn log(at_ns: i64, t_us: Option<i64>, text: &str) -> serde_json::Value {
    json!({
        "timestamp": time(at_ns), "level": 2, "message": text, "name": "taxel", "file": "", "line": 0, "t_us": t_us,
    })
}

fn time(at_ns: i64) -> serde_json::Value {
    json!({ "sec": at_ns.max(0) / 1_000_000_000, "nsec": at_ns.max(0) % 1_000_000_000 })
}

/// Base64 with padding (RFC 4648, section 4), as JSON schemas want bytes.
fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for three in bytes.chunks(3) {
        let word = (0..3).fold(0, |word, k| word << 8 | u32::from(three.get(k).copied().unwrap_or(0)));
        for k in 0..4 {
            let digit = DIGITS[(word >> (18 - 6 * k) & 63) as usize];
            text.push(if k <= three.len() { char::from(digit) } else { '=' });
        }
    }
    text
}

/// Bytes of base64 with padding; `None` where it is none.
pub(super) fn unbase64(text: &str) -> Option<Vec<u8>> {
    let digit = |c: u8| match c {
        b'A'..=b'Z' => Some(c - b'A'),
        b'a'..=b'z' => Some(c - b'a' + 26),
        b'0'..=b'9' => Some(c - b'0' + 52),
        b'+' => Some(62),
        b'/' => Some(63),
        _ => None,
    };
    let text = text.as_bytes();
    let digits = text.iter().rposition(|&c| c != b'=').map_or(0, |last| last + 1);
    if !text.len().is_multiple_of(4) || text.len() - digits > 2 {
        return None;
    }
    let mut bytes = Vec::with_capacity(text.len() / 4 * 3);
    for four in text[..digits].chunks(4) {
        let word =
            four.iter().try_fold(0_u32, |word, &c| Some(word << 6 | u32::from(digit(c)?)))? << (6 * (4 - four.len()));
        bytes.extend_from_slice(&word.to_be_bytes()[1..four.len()]);
    }
    Some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header() -> Header {
        serde_json::from_value(json!({ "array": taxel_core::Array::thesis() })).unwrap()
    }

    /// A writer whose thread has not begun.
    fn alone(path: &Path, how: WriterOptions) -> Writer {
        let writer = Writer::plan(path, &header(), how, false).unwrap();
        let plan = lock(&writer.shared.plan).take().unwrap();
        writer.shared.set_out(path, &plan.header, how).unwrap();
        writer
    }

    #[test]
    fn a_writer_whose_thread_gets_no_processor_loses_at_most_what_is_not_late() {
        let path = std::env::temp_dir().join(format!("taxel-starved-{}.mcap", std::process::id()));
        let how = WriterOptions { overwrite: true, ..WriterOptions::default() };
        let writer = alone(&path, how);
        for k in 0..20_u32 {
            writer.datagram(i64::from(k), u64::from(k), &[7; 1400]).unwrap();
            std::thread::sleep(LATE / 4);
        }
        // What a kill would leave now. The last that was late, at the latest one in ten, took all before it along.
        let left = super::super::Reader::open(&path).unwrap().remarks(taxel_core::Stop::never()).unwrap().0.datagrams;
        let waiting = writer.shared.lock().queue.messages.len() as u64;
        assert_eq!(left + waiting, 20);
        assert!(waiting < 10, "{waiting} wait");
        std::fs::remove_file(&path).unwrap();
    }

    #[test]
    fn while_the_disk_is_waited_for_callers_go_on() {
        let path = std::env::temp_dir().join(format!("taxel-stalled-{}.mcap", std::process::id()));
        let how = WriterOptions { overwrite: true, ..WriterOptions::default() };
        let writer = alone(&path, how);
        writer.shared.at_disk.store(true, Ordering::Relaxed);
        // The pen is held by who waits for the disk: a caller who wanted it would wait forever.
        let pen = writer.shared.pen();
        writer.datagram(0, 0, &[7; 1400]).unwrap();
        std::thread::sleep(LATE);
        writer.datagram(1, 1, &[7; 1400]).unwrap();
        assert_eq!(writer.shared.lock().queue.messages.len(), 2);
        drop(pen);
        std::fs::remove_file(&path).unwrap();
    }

    #[test]
    fn base64_gives_the_vectors_of_the_standard() {
        let vectors = ["", "", "f", "Zg==", "fo", "Zm8=", "foo", "Zm9v", "foob", "Zm9vYg==", "fooba", "Zm9vYmE="];
        for pair in vectors.chunks(2) {
            assert_eq!(base64(pair[0].as_bytes()), pair[1]);
            assert_eq!(unbase64(pair[1]).as_deref(), Some(pair[0].as_bytes()));
        }
    }
}
