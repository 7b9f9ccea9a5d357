//! The two kinds of file that a [`Live`](super::Live) records to.

use std::fs::OpenOptions;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
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
    /// What had been counted when it began, where that was while listening.
    since: Option<Box<Counters>>,
    clock: Mutex<Clock>,
    /// Whose file it is, where it is another's.
    host: Option<Part>,
}

/// How a recording's clock goes against the pipeline's.
#[derive(Clone, Copy)]
enum Clock {
    /// So far behind it, us.
    Behind(i64),
    /// As the pipeline's: its file waits until that can be said in it.
    Waits,
    /// Begins with its first stamp, which has not come.
    Unknown,
}

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
    fn of(record: &Record, header: Header) -> Self {
        Self {
            record: record.clone(),
            header,
            new: false,
            noted: AtomicBool::new(false),
            refused: AtomicBool::new(false),
            begun: AtomicBool::new(false),
            kind: OnceLock::new(),
            opening: Mutex::new(()),
            since: None,
            clock: Mutex::new(Clock::Behind(0)),
            host: None,
        }
    }

    /// A part of another's recording.
    pub(super) fn join(host: Part, record: &Record, options: &LiveOptions, place: &Origin) -> Self {
        let name = host.name.clone();
        let board = Header::of_board(options.array.clone(), Some(options.registers), said_of(place), now_ns());
        Self { host: Some(host), ..Self::of(record, Header { name, ..board }) }
    }

    /// A part of another's recording that begins while this one's board is listened to.
    pub(super) fn part_of(&self, host: Part, options: &LiveOptions, place: &Origin) -> Result<Self> {
        let track = self.writer(&host.name)?;
        let part = Self::join(host, &self.record, options, place);
        Ok(Self {
            kind: OnceLock::from(Kind::Track(track)),
            since: Some(Box::default()),
            clock: Mutex::new(Clock::Unknown),
            ..part
        })
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
        let recorder = Self { new, ..Self::of(record, header) };
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
        let kind = named(path)?;
        let new = !(record.overwrite && path.exists());
        if new {
            let done = path.with_extension("lss");
            if kind == "lsa" && done.exists() {
                return Err(Error::file(&done)(std::io::Error::from_raw_os_error(libc::EEXIST)));
            }
            OpenOptions::new().write(true).create_new(true).open(path).map_err(Error::file(path))?;
        }
        let whole = Self::create(&Record { overwrite: true, ..record.clone() }, options, place);
        let whole = whole.and_then(|whole| {
            if kind == "mcap" {
                // Where nothing else is heard it waits for the board's first stamp, so that its times are ours.
                let for_clock = whole.header.sources.is_empty();
                let how = recording::WriterOptions { compression: record.compression, overwrite: true };
                let writer = Writer::plan(path, &whole.header, how, for_clock)?;
                let clock = Mutex::new(if for_clock { Clock::Waits } else { Clock::Unknown });
                return Ok(Self { kind: OnceLock::from(Kind::Mcap(Box::new(writer))), clock, ..whole });
            }
            Ok(whole)
        });
        if new && whole.is_err() {
            // It was empty, and ours.
            let _ = std::fs::remove_file(path);
        }
        Ok(Self { new, since: Some(Box::default()), ..whole? })
    }

    /// Begins with the registers and what the taxels hold, by the counters of now.
    pub(super) fn begin(&mut self, now: &Counters, held: &[u16]) -> Result<()> {
        self.since = Some(Box::new(now.clone()));
        if let Some(registers) = &self.header.registers {
            self.registers(registers)?;
        }
        let t_us = now.board_us.and_then(|t| self.timed(t));
        self.track(|track| track.held(now_ns(), t_us, held))
    }

    /// Begins anew where nothing came into it yet; gives whether it does.
    pub(super) fn again(&mut self, now: &Counters) -> bool {
        if self.holds_anything() {
            return false;
        }
        self.since = Some(Box::new(now.clone()));
        if let Some(Kind::Mcap(writer)) = self.kind.get() {
            writer.started(now_ns());
        }
        true
    }

    /// Whether anything came of any source, or was noted.
    pub(super) fn holds_anything(&self) -> bool {
        let others = matches!(self.kind.get(), Some(Kind::Mcap(writer)) if writer.holds_anything());
        others || self.begun.load(Ordering::Relaxed) || self.noted.load(Ordering::Relaxed)
    }

    /// What had been counted when it began, where that was while listening: then it ends alone.
    pub(super) fn since(&self) -> Option<&Counters> {
        self.since.as_deref()
    }

    /// Says by how much a clock that begins with the recording's first stamp is behind ours, us: a file that waits for that can be
    /// written.
    pub(super) fn set_origin(&mut self, origin_us: i64) -> Result<()> {
        let said = match self.kind.get() {
            Some(Kind::Mcap(writer)) => writer.begin(origin_us)?,
            _ => false,
        };
        *lock(&self.clock) = Clock::Behind(if said { 0 } else { origin_us });
        Ok(())
    }

    /// A time of the pipeline's clock on the recording's; none where that is not known yet.
    fn timed(&self, t: i64) -> Option<i64> {
        match *lock(&self.clock) {
            Clock::Behind(us) => Some(t - us),
            Clock::Waits => Some(t),
            Clock::Unknown => None,
        }
    }

    /// Does something where more than bytes is kept.
    fn track(&self, work: impl FnOnce(&Track) -> Result<()>) -> Result<()> {
        if named(&self.record.path)? == "lsa" {
            return Ok(());
        }
        self.kind()?.track().map_or(Ok(()), work)
    }

    /// Whether times of the pipeline's clock can be said in it.
    pub(super) fn is_timed(&self) -> bool {
        self.timed(0).is_some()
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
        Ok(self.kind.get_or_init(|| kind))
    }

    pub(super) fn datagrams(&self, batch: &Batch) -> Result<()> {
        self.begun.store(true, Ordering::Relaxed);
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
        self.track(|track| track.registers(now_ns(), registers))
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
        let t_us = change.t_us.and_then(|t| self.timed(t));
        self.track(|track| track.board_change(&BoardChange { t_us, ..*change }))
    }

    pub(super) fn marker(&self, marker: Marker) -> Result<()> {
        let Some(t) = self.timed(marker.t) else { return Ok(()) };
        self.track(|track| track.marker(now_ns(), Marker { t, ..marker }))
    }

    pub(super) fn detection(&self, said: &Said) -> Result<()> {
        let found = &said.detection;
        let (Some(t), Some(known)) = (self.timed(found.t), self.timed(found.known)) else { return Ok(()) };
        self.track(|track| track.detection(said.said_ns, &Detection { t, known, ..found.clone() }))
    }

    /// What is taken off the pictures from here on.
    pub(super) fn tare(&self, tare: &Tare) -> Result<()> {
        self.track(|track| {
            track.tare(tare);
            Ok(())
        })
    }

    pub(super) fn picture(&self, at_ns: i64, board_us: i64, columns: u16, held: &[u16]) -> Result<()> {
        // Of a file that is not there yet nothing is to be seen.
        let there = !matches!(self.kind()?, Kind::Mcap(writer) if !writer.has_begun());
        let Some(t_us) = self.timed(board_us).filter(|_| there) else { return Ok(()) };
        self.track(|track| track.picture(at_ns, t_us, columns, held))
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
            Some(Kind::Lsa(writer)) => lock(writer).flush(),
        }
    }

    pub(super) fn note(&self, board_us: Option<i64>, text: &str) -> Result<()> {
        if named(&self.record.path)? == "lsa" {
            return Err(problem!("a .lsa holds raw bytes and no notes: record to a .mcap file").into());
        }
        self.noted.store(true, Ordering::Relaxed);
        self.track(|track| track.note(now_ns(), board_us.and_then(|t| self.timed(t)), text))
    }

    /// A taxel that a person zeroed.
    pub(super) fn zeroing(&self, zeroing: &Zeroing) -> Result<()> {
        if named(&self.record.path)? == "lsa" {
            return Err(problem!("a .lsa cannot keep that a taxel was zeroed: record to a .mcap file").into());
        }
        let Some(t) = self.timed(zeroing.t) else { return Ok(()) };
        self.track(|track| track.zeroing(now_ns(), &Zeroing { t, ..*zeroing }))
    }

    /// What was lost, as the file keeps it.
    pub(super) fn losses(&self, counters: &Counters) -> recording::Counts {
        losses(counters, self.since())
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
        let nothing = !self.holds_anything() && (self.since.is_some() || counters.nothing_came());
        let path = self.record.path;
        let refused = self.refused.into_inner();
        if nothing || (refused && !self.begun.into_inner()) {
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
    // What waits when it ends is none of its business.
    let now = since.map_or_else(|| counters.clone(), |begun| counters.since(begun));
    let mut decoder = recording::damage(&now.wire);
    decoder.insert("bytes_of_version_1_refused".to_owned(), now.wire_refused);
    let missing = recording::damage_of_version_2(&now.wire_v2).map(|(causes, missing)| {
        decoder.extend(causes);
        missing
    });
    // Of version 1 nobody knows what was sent: a recording that holds any of it cannot say that nothing is missing.
    let knows = now.wire_v2.intact > 0 && now.wire.bytes == 0;
    recording::Counts {
        received: now.capture.datagrams,
        recorded: now.decoded,
        dropped_by_kernel: now.capture.dropped_by_kernel,
        dropped_by_queue: now.capture.dropped_by_queue,
        decoder,
        missing: missing.filter(|n| *n > 0 || knows),
        bridged: now.bridged.map(Box::new),
        converted: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_recording_of_nothing_but_version_2_says_that_nothing_is_missing() {
        let mut now = Counters::default();
        (now.wire_v2.datagrams, now.wire_v2.intact) = (100, 100);
        assert_eq!(losses(&now, None).missing, Some(0));
        assert_eq!(losses(&now, None).verdict(), "nothing lost");
        let begun = now.clone();
        // Since it began the board has spoken version 1.
        now.wire.bytes = 50;
        assert_eq!(losses(&now, Some(&begun)).missing, None);
        (now.wire_v2.datagrams, now.wire_v2.intact) = (110, 110);
        assert_eq!(losses(&now, Some(&begun)).missing, None, "some of it");
        now.wire_v2.missing += 3;
        now.wire_refused += 25;
        let lost = losses(&now, Some(&begun));
        assert_eq!(lost.missing, Some(3));
        assert!(
            lost.verdict().ends_with("in the bytes that came: 25 bytes of version 1 refused"),
            "{}",
            lost.verdict()
        );
    }
}
