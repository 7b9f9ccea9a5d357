//! The two kinds of file that a [`Live`](super::Live) records to.

use std::fs::OpenOptions;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, OnceLock, PoisonError, Weak};

use taxel_core::detect::Detection;
use taxel_core::encode::{Tare, Zeroing};
use taxel_core::wire::Registers;
use taxel_core::{Marker, problem};

use super::counters::Counters;
use super::options::{LiveOptions, Record};
use super::said::Said;
use super::source::Source;
use crate::capture::{Batch, Origin};
use crate::locked::lock;
use crate::recording::{self, BoardChange, Header, LsaWriter, Track, Writer, now_ns};
use crate::{Error, Result};

/// A recording being written. Raw `.lsa` holds bytes and nothing else: what else there is to keep is left out of it.
///
/// A file that is to be replaced is touched when there is something to replace it with, and not before: where nothing
/// comes, it stays.
pub(super) struct Recorder {
    record: Record,
    header: Header,
    /// Whether there was no such file.
    new: bool,
    noted: AtomicBool,
    /// Whether something came that the file cannot hold, and whether anything is in it.
    refused: AtomicBool,
    begun: AtomicBool,
    kind: OnceLock<Kind>,
    /// Held by the one who opens the file.
    opening: Mutex<()>,
    guest: Option<Guest>,
    /// Whose file it is, where it is another's.
    host: Option<Part>,
}

/// A recording that was begun while listening. Its own clock begins with its first stamp, so the file is opened when that
/// is known; what comes before waits.
struct Guest {
    /// What had been counted when it began.
    since: Counters,
    waiting: Mutex<Vec<Entry>>,
    /// Its bytes.
    bytes: AtomicUsize,
}

/// What waits for a guest's file.
enum Entry {
    Datagram(i64, u64, Vec<u8>),
    Registers(i64, Registers),
    Board(BoardChange),
    Held(i64, Option<i64>, Vec<u16>),
    Note(i64, Option<i64>, String),
    Zeroing(i64, Zeroing),
    Marker(i64, Marker),
    Detection(i64, Detection),
    Tare(Box<Tare>),
}

/// What may wait for a guest's first event, bytes: heartbeats of a board of version 2 at rest for hours.
const MOST_WAITING: usize = 1 << 22;

enum Kind {
    Mcap(Box<Writer>),
    /// A part of another's.
    Track(Track),
    /// Locked for the borrow only: one thread writes.
    Lsa(Mutex<LsaWriter>),
}

impl Kind {
    /// Where more than bytes is kept.
    fn track(&self) -> Option<&Track> {
        match self {
            Self::Mcap(writer) => Some(writer),
            Self::Track(track) => Some(track),
            Self::Lsa(_) => None,
        }
    }
}

/// The pipeline whose recording it is.
pub(super) trait Host: Send + Sync {
    /// Opens another source's part of it.
    fn part(&self, name: &str) -> Result<Track>;

    /// Ends everything because of an error.
    fn fail(&self, error: Error);
}

/// A source's part of a recording that another pipeline began.
#[derive(Clone)]
pub(super) struct Part {
    pub(super) host: Weak<dyn Host>,
    pub(super) name: String,
}

impl Part {
    /// Opens it: the file is there from then on.
    pub(super) fn open(&self) -> Result<Track> {
        let host = self.host.upgrade().ok_or_else(|| problem!("source {}: the recording has ended", self.name))?;
        host.part(&self.name)
    }
}

impl Recorder {
    /// A part of another's recording.
    pub(super) fn join(host: Part, record: &Record, options: &LiveOptions, place: &Origin) -> Self {
        let name = host.name.clone();
        let board = Header::of_board(options.array.clone(), Some(options.registers), said_of(place), now_ns());
        Self {
            record: record.clone(),
            header: Header { name, ..board },
            new: false,
            noted: AtomicBool::new(false),
            refused: AtomicBool::new(false),
            begun: AtomicBool::new(false),
            kind: OnceLock::new(),
            opening: Mutex::new(()),
            guest: None,
            host: Some(host),
        }
    }

    /// Another source's part of this recording.
    pub(super) fn writer(&self, name: &str) -> Result<Track> {
        match self.kind()? {
            Kind::Mcap(writer) => writer.track(name),
            Kind::Track(_) | Kind::Lsa(_) => Err(problem!("source {name}: only a .mcap holds several sources").into()),
        }
    }

    pub(super) fn create(record: &Record, options: &LiveOptions, place: &Origin) -> Result<Self> {
        let board = Header::of_board(options.array.clone(), Some(options.registers), said_of(place), now_ns());
        let sources = options.sources.iter().map(Source::header).collect::<taxel_core::Result<_>>()?;
        let header = Header { difference: options.differences, name: options.name.clone(), sources, ..board };
        let path = &record.path;
        let new = !(record.overwrite && path.exists());
        let recorder = Self {
            record: record.clone(),
            header,
            new,
            noted: AtomicBool::new(false),
            refused: AtomicBool::new(false),
            begun: AtomicBool::new(false),
            kind: OnceLock::new(),
            opening: Mutex::new(()),
            guest: None,
            host: None,
        };
        if !recorder.header.sources.is_empty() && named(path)? != "mcap" {
            return Err(problem!("{}: only a .mcap holds several sources", path.display()).into());
        }
        if new {
            recorder.kind()?;
        } else {
            named(path)?;
            recording::replaceable(path)?;
            OpenOptions::new().write(true).open(path).map_err(Error::file(path))?;
        }
        Ok(recorder)
    }

    /// A recording that begins while listening: takes the name, so that nobody else can; the file is written later.
    pub(super) fn reserve(record: &Record, options: &LiveOptions, place: &Origin) -> Result<Self> {
        let path = &record.path;
        named(path)?;
        let done = path.with_extension("lss");
        if path.extension().is_some_and(|e| e == "lsa") && done.exists() {
            return Err(Error::file(&done)(std::io::Error::from_raw_os_error(libc::EEXIST)));
        }
        OpenOptions::new().write(true).create_new(true).open(path).map_err(Error::file(path))?;
        // What else is heard belongs to the recording that it was begun with.
        let options = LiveOptions { sources: vec![], ..options.clone() };
        let whole = Self::create(&Record { overwrite: true, ..record.clone() }, &options, place)?;
        let guest = Guest { since: Counters::default(), waiting: Mutex::default(), bytes: AtomicUsize::new(0) };
        Ok(Self { new: true, guest: Some(guest), ..whole })
    }

    /// Begins with the registers and what the taxels hold, by the counters of now.
    pub(super) fn begin(&mut self, now: &Counters, held: &[u16]) -> Result<()> {
        let Some(guest) = &mut self.guest else { return Ok(()) };
        guest.since = now.clone();
        if let Some(registers) = self.header.registers {
            self.push(Entry::Registers(now_ns(), registers))?;
        }
        self.push(Entry::Held(now_ns(), now.board_us, held.to_vec()))
    }

    /// Whether it was begun while listening: then it ends alone.
    pub(super) fn is_a_guest(&self) -> bool {
        self.guest.is_some()
    }

    /// Says by how much its own clock, which begins with its first stamp, is behind, us: now it can be written.
    pub(super) fn set_origin(&mut self, origin_us: i64) -> Result<()> {
        self.header.origin_us = origin_us;
        self.kind().map(drop)
    }

    /// Keeps it now, or when the file is open.
    fn push(&self, entry: Entry) -> Result<()> {
        if let (Some(guest), None) = (&self.guest, self.kind.get()) {
            let bytes = match &entry {
                Entry::Datagram(_, _, bytes) => bytes.len() + 64,
                _ => 64,
            };
            lock(&guest.waiting).push(entry);
            if guest.bytes.fetch_add(bytes, Ordering::Relaxed) + bytes > MOST_WAITING {
                self.kind()?;
            }
            return Ok(());
        }
        Self::write(self.kind()?, entry)
    }

    fn write(kind: &Kind, entry: Entry) -> Result<()> {
        match (kind, kind.track(), entry) {
            (_, Some(track), Entry::Datagram(at, number, bytes)) => track.datagram(at, number, &bytes),
            (Kind::Lsa(writer), _, Entry::Datagram(_, _, bytes)) => lock(writer).bytes(&bytes),
            (_, Some(track), Entry::Registers(at, registers)) => track.registers(at, &registers),
            (_, Some(track), Entry::Board(change)) => track.board_change(&change),
            (_, Some(track), Entry::Held(at, t_us, held)) => track.held(at, t_us, &held),
            (_, Some(track), Entry::Note(at, t_us, text)) => track.note(at, t_us, &text),
            (_, Some(track), Entry::Zeroing(at, zeroing)) => track.zeroing(at, &zeroing),
            (_, Some(track), Entry::Marker(at, marker)) => track.marker(at, marker),
            (_, Some(track), Entry::Detection(at, detection)) => track.detection(at, &detection),
            (_, Some(track), Entry::Tare(tare)) => {
                track.tare(&tare);
                Ok(())
            }
            (_, None, _) => Ok(()),
        }
    }

    /// The open file.
    fn kind(&self) -> Result<&Kind> {
        let _one = lock(&self.opening);
        if let Some(kind) = self.kind.get() {
            return Ok(kind);
        }
        if let Some(host) = &self.host {
            let track = host.open()?;
            return Ok(self.kind.get_or_init(|| Kind::Track(track)));
        }
        let Record { path, compression, overwrite } = &self.record;
        let kind = match named(path)? {
            "mcap" => {
                let how = recording::WriterOptions { compression: *compression, overwrite: *overwrite };
                Kind::Mcap(Box::new(Writer::create(path, &self.header, how)?))
            }
            _ => Kind::Lsa(Mutex::new(LsaWriter::create(path, *overwrite)?)),
        };
        if let Some(guest) = &self.guest {
            lock(&guest.waiting).drain(..).try_for_each(|entry| Self::write(&kind, entry))?;
        }
        Ok(self.kind.get_or_init(|| kind))
    }

    /// Whether the file waits for its first event.
    fn waits(&self) -> bool {
        self.guest.is_some() && self.kind.get().is_none()
    }

    pub(super) fn datagrams(&self, batch: &Batch) -> Result<()> {
        self.begun.store(true, Ordering::Relaxed);
        if self.waits() {
            let mut all = batch.iter();
            return all.try_for_each(|(d, bytes)| self.push(Entry::Datagram(d.arrived_ns, d.number, bytes.to_vec())));
        }
        let kind = self.kind()?;
        if let Some(track) = kind.track() {
            batch.iter().try_for_each(|(d, bytes)| track.datagram(d.arrived_ns, d.number, bytes))?;
        }
        if let Kind::Lsa(writer) = kind {
            let mut writer = lock(writer);
            batch.iter().try_for_each(|(_, bytes)| writer.bytes(bytes))?;
        }
        Ok(())
    }

    /// The board's registers as they are from now on.
    pub(super) fn registers(&self, registers: &Registers) -> Result<()> {
        self.push(Entry::Registers(now_ns(), *registers))
    }

    /// Raw bytes are of version 1: those of version 2 do not say where a datagram ends.
    pub(super) fn takes(&self, version: u8) -> Result<()> {
        if version == 1 || named(&self.record.path)? == "mcap" {
            return Ok(());
        }
        self.refused.store(true, Ordering::Relaxed);
        let path = self.record.path.display();
        Err(problem!("{path}: a .lsa holds wire version 1, and the board speaks version 2; record to a .mcap file")
            .into())
    }

    pub(super) fn board_change(&self, change: &BoardChange) -> Result<()> {
        self.push(Entry::Board(*change))
    }

    pub(super) fn marker(&self, marker: Marker) -> Result<()> {
        self.push(Entry::Marker(now_ns(), marker))
    }

    pub(super) fn detection(&self, said: &Said) -> Result<()> {
        self.push(Entry::Detection(said.said_ns, said.detection.clone()))
    }

    /// What is taken off the pictures from here on.
    pub(super) fn tare(&self, tare: &Tare) -> Result<()> {
        self.push(Entry::Tare(Box::new(tare.clone())))
    }

    pub(super) fn picture(&self, at_ns: i64, board_us: i64, columns: u16, held: &[u16]) -> Result<()> {
        if self.waits() {
            return Ok(());
        }
        self.kind()?.track().map_or(Ok(()), |track| track.picture(at_ns, board_us, columns, held))
    }

    /// What an unfinished recording will know of its losses; a raw one knows nothing, but its bytes reach the system.
    pub(super) fn so_far(&self, counters: &Counters) -> Result<()> {
        let track = self.kind.get().and_then(Kind::track);
        track.map_or(Ok(()), |track| track.counts(now_ns(), &self.losses(counters)))
    }

    /// Bytes must not wait in memory for long: `.mcap` sees to that itself.
    pub(super) fn flush(&self) -> Result<()> {
        match self.kind.get() {
            Some(Kind::Mcap(_) | Kind::Track(_)) | None => Ok(()),
            Some(Kind::Lsa(writer)) => writer.lock().unwrap_or_else(PoisonError::into_inner).flush(),
        }
    }

    pub(super) fn note(&self, board_us: Option<i64>, text: &str) -> Result<()> {
        if named(&self.record.path)? == "lsa" {
            return Err(problem!("a .lsa holds raw bytes and no notes: record to a .mcap file").into());
        }
        self.noted.store(true, Ordering::Relaxed);
        self.push(Entry::Note(now_ns(), board_us, text.to_owned()))
    }

    /// A taxel that a person zeroed.
    pub(super) fn zeroing(&self, zeroing: &Zeroing) -> Result<()> {
        if named(&self.record.path)? == "lsa" {
            return Err(problem!("a .lsa cannot keep that a taxel was zeroed: record to a .mcap file").into());
        }
        self.push(Entry::Zeroing(now_ns(), *zeroing))
    }

    /// What was lost, as the file keeps it.
    fn losses(&self, counters: &Counters) -> recording::Counts {
        losses(counters, self.guest.as_ref().map(|guest| &guest.since))
    }

    /// The same in a line.
    pub(super) fn verdict(&self, counters: &Counters) -> String {
        self.losses(counters).verdict()
    }

    /// Closes the file and says where it is; a file that would hold nothing is not kept.
    pub(super) fn finish(self, counters: &Counters) -> Result<Option<PathBuf>> {
        let lost = self.losses(counters);
        if let Some(host) = &self.host {
            if let Some(track) = self.kind.get().and_then(Kind::track) {
                track.end(&host.name, lost);
            }
            return Ok(None);
        }
        let others = matches!(self.kind.get(), Some(Kind::Mcap(writer)) if writer.holds_anything());
        let nothing = !others
            && match &self.guest {
                Some(guest) => counters.decoded == guest.since.decoded,
                None => counters.nothing_came(),
            };
        if (!nothing || self.noted.load(Ordering::Relaxed)) && self.waits() {
            self.kind()?;
        }
        let path = self.record.path;
        let refused = self.refused.into_inner();
        if (nothing && !self.noted.into_inner()) || (refused && !self.begun.into_inner()) {
            drop(self.kind);
            if self.new {
                std::fs::remove_file(&path).map_err(Error::file(&path))?;
            }
            return Ok(None);
        }
        match self.kind.into_inner() {
            Some(Kind::Mcap(writer)) => drop(writer.finish(lost)?),
            // Without its .lss, as it is not whole.
            Some(Kind::Lsa(writer)) if refused => {
                writer.into_inner().unwrap_or_else(PoisonError::into_inner).flush()?
            }
            Some(Kind::Lsa(writer)) => writer.into_inner().unwrap_or_else(PoisonError::into_inner).finish()?,
            Some(Kind::Track(_)) | None => {}
        }
        Ok(Some(path))
    }
}

/// Where datagrams come from, as files keep it.
fn said_of(place: &Origin) -> String {
    match place {
        Origin::Udp(address) => format!("udp {address}"),
        Origin::Bridge(name) => name.clone(),
    }
}

/// What kind of file a name says.
fn named(path: &Path) -> Result<&str> {
    match path.extension().and_then(|e| e.to_str()) {
        Some(kind @ ("mcap" | "lsa")) => Ok(kind),
        _ => {
            let name = path.display();
            Err(problem!("{name}: a recording is named .mcap (all that is known) or .lsa (raw bytes)").into())
        }
    }
}

/// What was lost, as recordings keep it; of one that began later, since then.
pub(super) fn losses(counters: &Counters, since: Option<&Counters>) -> recording::Counts {
    let none = Counters::default();
    let begun = since.unwrap_or(&none);
    let (capture, before) = (&counters.capture, &begun.capture);
    let damage = |now: &Counters| {
        let (second, missing) = recording::damage_of_version_2(&now.wire_v2).unzip();
        let mut decoder = recording::damage(&now.wire);
        decoder.extend(second.unwrap_or_default());
        (decoder, missing)
    };
    let ((mut decoder, missing), (earlier, missed)) = (damage(counters), damage(begun));
    for (cause, n) in &mut decoder {
        *n -= earlier.get(cause).copied().unwrap_or(0).min(*n);
    }
    let recorded = counters.decoded - begun.decoded;
    let dropped_by_queue = capture.dropped_by_queue - before.dropped_by_queue;
    recording::Counts {
        // What waits when it ends is none of its business.
        received: if since.is_some() { recorded + dropped_by_queue } else { capture.datagrams },
        recorded,
        dropped_by_kernel: capture.dropped_by_kernel - before.dropped_by_kernel,
        dropped_by_queue,
        decoder,
        missing: missing.map(|n| n.saturating_sub(missed.unwrap_or(0))),
        bridged: counters.bridged.map(|now| Box::new(now.since(&begun.bridged.unwrap_or_default()))),
        converted: None,
    }
}
