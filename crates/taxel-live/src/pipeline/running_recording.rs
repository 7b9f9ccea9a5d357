//! One recording of a [`Live`](super::Live): to its own `.mcap`, to a part of another pipeline's, or to a raw `.lsa`.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, OnceLock, PoisonError, Weak};

use taxel_core::detect::Detection;
use taxel_core::encode::{Tare, Zeroing};
use taxel_core::wire::Registers;
use taxel_core::{Marker, problem};

use super::counters::{Counters, DecodingCounts};
use super::frame_block::read_message;
use super::options::Record;
use super::sink::OutputDetection;
use super::source::NamedSource;
use crate::Result;
use crate::capture::Batch;
use crate::locked::lock;
use crate::recording::{
    self, BoardChange, Cause, Counts, FrameEncoding, Header, LsaWriter, OutputFile, SourceWriter, Writer, now_ns,
};

/// One recording, from its reservation to its end. A raw `.lsa` contains bytes only: notes, markers and the like are
/// left out.
///
/// The file is locked from the reservation on. An existing file is replaced only when there is data to replace it: if
/// no data arrive, it stays.
pub(super) struct RunningRecording {
    record: Record,
    header: Header,
    has_notes: AtomicBool,
    /// Whether data arrived that the file cannot store, and whether any data arrived.
    refused: AtomicBool,
    has_data: AtomicBool,
    file: OnceLock<RecordingFile>,
    /// The reserved file until it is begun; locked by the caller who begins it.
    reserved: Mutex<Option<OutputFile>>,
    /// The counters at the recording's beginning, if it began while the pipeline was running.
    since: Option<Box<Counters>>,
    clock: Mutex<RecordingClock>,
    /// The pipeline that owns the file, if it is another one.
    host: Option<RecordingPart>,
}

/// The relation of the recording's clock, which begins with its first stamp, to the pipeline's.
#[derive(Clone, Copy)]
enum RecordingClock {
    /// The recording's clock is this many us behind.
    Behind(i64),
    /// The file is begun only when the offset is known, and states it in its header: its times are then those of the
    /// pipeline.
    Waits,
    /// The first stamp has not arrived.
    Unknown,
}

impl RecordingClock {
    /// The clock of a recording that begins while its source is received: stamps of a board begin anew, those of frames
    /// do not.
    fn beginning_later(header: &Header) -> Self {
        if header.frames.is_some() { Self::Behind(0) } else { Self::Unknown }
    }
}

enum RecordingFile {
    Mcap(Box<Writer>),
    /// A part of another pipeline's recording.
    Track(Box<SourceWriter>),
    /// The lock is needed for the borrow only: one thread writes.
    Lsa(Mutex<LsaWriter>),
}

impl RecordingFile {
    /// The writer of messages; a raw file has none.
    fn track(&self) -> Option<&SourceWriter> {
        match self {
            Self::Mcap(writer) => Some(writer),
            Self::Track(track) => Some(track),
            Self::Lsa(_) => None,
        }
    }
}

/// The pipeline whose recording contains the parts of others.
pub(super) trait Host: Send + Sync {
    /// Opens the part of another source.
    fn part(&self, name: &str) -> Result<SourceWriter>;
}

/// A source's part of a recording that another pipeline began.
#[derive(Clone)]
pub(super) struct RecordingPart {
    pub(super) host: Weak<dyn Host>,
    pub(super) name: String,
}

impl RecordingPart {
    /// Opens the part: the file is begun from then on.
    pub(super) fn open(&self) -> Result<SourceWriter> {
        let host = self.host.upgrade().ok_or_else(|| problem!("source {}: the recording has ended", self.name))?;
        host.part(&self.name)
    }
}

impl RunningRecording {
    fn new(record: &Record, header: Header) -> Self {
        Self {
            record: record.clone(),
            header,
            has_notes: AtomicBool::new(false),
            refused: AtomicBool::new(false),
            has_data: AtomicBool::new(false),
            file: OnceLock::new(),
            reserved: Mutex::default(),
            since: None,
            clock: Mutex::new(RecordingClock::Behind(0)),
            host: None,
        }
    }

    /// A part of another pipeline's recording.
    pub(super) fn join(host: RecordingPart, record: &Record, header: Header) -> Self {
        let name = host.name.clone();
        Self { host: Some(host), ..Self::new(record, Header { name, ..header }) }
    }

    /// A part of another pipeline's recording that begins while this pipeline's source is being received.
    pub(super) fn part_of(&self, host: RecordingPart, header: Header) -> Result<Self> {
        let track = self.track_of(&host.name)?;
        let clock = Mutex::new(RecordingClock::beginning_later(&header));
        let part = Self::join(host, &self.record, header);
        let file = OnceLock::from(RecordingFile::Track(Box::new(track)));
        Ok(Self { file, since: Some(Box::default()), clock, ..part })
    }

    /// The writer of another source's part of this recording.
    pub(super) fn track_of(&self, name: &str) -> Result<SourceWriter> {
        match self.create_once()? {
            RecordingFile::Mcap(writer) => writer.track(name),
            RecordingFile::Track(_) | RecordingFile::Lsa(_) => {
                Err(problem!("source {name}: only a .mcap file can contain several sources").into())
            }
        }
    }

    /// A recording from the pipeline's beginning: a new file is begun at once.
    pub(super) fn create(record: &Record, header: Header, sources: &[NamedSource]) -> Result<Self> {
        let (recording, file) = Self::open(record, header, sources)?;
        let new = file.is_new();
        *lock(&recording.reserved) = Some(file);
        if new {
            recording.create_once()?;
        }
        Ok(recording)
    }

    /// A recording that begins while the pipeline runs: the file is reserved now, and written later.
    pub(super) fn reserve(record: &Record, header: Header, sources: &[NamedSource]) -> Result<Self> {
        let (recording, file) = Self::open(record, header, sources)?;
        let recording = Self { since: Some(Box::default()), ..recording };
        if kind_of_name(&record.path)? == "lsa" {
            *lock(&recording.reserved) = Some(file);
            return Ok(recording);
        }
        // Without other sources the file waits for the board's first stamp, so that its times are the pipeline's.
        let for_clock = recording.header.sources.is_empty() && recording.header.frames.is_none();
        let writer = Writer::plan(file, &recording.header, record.compression, for_clock);
        let later = RecordingClock::beginning_later(&recording.header);
        let clock = Mutex::new(if for_clock { RecordingClock::Waits } else { later });
        Ok(Self { file: OnceLock::from(RecordingFile::Mcap(Box::new(writer))), clock, ..recording })
    }

    /// A recording whose file is opened and locked, but not changed.
    fn open(record: &Record, header: Header, sources: &[NamedSource]) -> Result<(Self, OutputFile)> {
        let sources = sources.iter().map(NamedSource::header).collect::<taxel_core::Result<_>>()?;
        let header = Header { sources, ..header };
        let (path, kind) = (&record.path, kind_of_name(&record.path)?);
        if !header.sources.is_empty() && kind != "mcap" {
            return Err(problem!("{}: only a .mcap file can contain several sources", path.display()).into());
        }
        if header.frames.is_some() && kind != "mcap" {
            return Err(problem!(
                "{}: a .lsa file contains only a board's bytes; record frames to a .mcap file",
                path.display()
            )
            .into());
        }
        header.check()?;
        let file = match kind {
            "mcap" => OutputFile::open(path, record.overwrite)?,
            _ => LsaWriter::reserve(path, record.overwrite)?,
        };
        Ok((Self::new(record, header), file))
    }

    /// Begins with the registers and the values that the taxels hold, at these counters.
    pub(super) fn begin(&mut self, now: &Counters, held: &[u16]) -> Result<()> {
        self.since = Some(Box::new(now.clone()));
        if let Some(registers) = &self.header.registers {
            self.registers(registers)?;
        }
        if self.header.frames.is_some() {
            // The first frame has all values.
            return Ok(());
        }
        let t_us = now.board.board_us.and_then(|t| self.timed(t));
        self.with_track(|track| track.held(now_ns(), t_us, held))
    }

    /// Restarts the recording if it is still empty; returns whether it does.
    pub(super) fn restart_if_empty(&mut self, now: &Counters) -> bool {
        if self.has_content() {
            return false;
        }
        self.since = Some(Box::new(now.clone()));
        if let Some(RecordingFile::Mcap(writer)) = self.file.get() {
            writer.set_started(now_ns());
        }
        true
    }

    /// Whether any source passed data, or bytes that are in no line, or a note was written.
    pub(super) fn has_content(&self) -> bool {
        let others = matches!(self.file.get(), Some(RecordingFile::Mcap(writer)) if writer.has_content());
        others || self.has_data.load(Ordering::Relaxed) || self.has_notes.load(Ordering::Relaxed)
    }

    /// The counters at the recording's beginning, if it began while the pipeline was running; an error then ends only
    /// the recording.
    pub(super) fn since(&self) -> Option<&Counters> {
        self.since.as_deref()
    }

    /// Sets the offset between a clock that begins with the recording's first stamp and the pipeline's, us; a file that
    /// waits for it can then be written.
    pub(super) fn set_origin(&mut self, origin_us: i64) -> Result<()> {
        let in_header = match self.file.get() {
            Some(RecordingFile::Mcap(writer)) => writer.begin(origin_us)?,
            _ => false,
        };
        *lock(&self.clock) = RecordingClock::Behind(if in_header { 0 } else { origin_us });
        Ok(())
    }

    /// Converts a time of the pipeline's clock to the recording's clock; none if the offset is not known yet.
    fn timed(&self, t: i64) -> Option<i64> {
        match *lock(&self.clock) {
            RecordingClock::Behind(us) => Some(t - us),
            RecordingClock::Waits => Some(t),
            RecordingClock::Unknown => None,
        }
    }

    /// Writes messages, which a raw file omits.
    fn with_track(&self, work: impl FnOnce(&SourceWriter) -> Result<()>) -> Result<()> {
        if kind_of_name(&self.record.path)? == "lsa" {
            return Ok(());
        }
        self.create_once()?.track().map_or(Ok(()), work)
    }

    /// Whether times of the pipeline's clock can be converted to the recording's.
    pub(super) fn is_timed(&self) -> bool {
        self.timed(0).is_some()
    }

    /// Creates the file unless that was done before; returns it.
    fn create_once(&self) -> Result<&RecordingFile> {
        let mut reserved = lock(&self.reserved);
        match self.file.get() {
            Some(file) => Ok(file),
            None => self.create_file(reserved.take()).map(|file| self.file.get_or_init(|| file)),
        }
    }

    /// Begins the file that was reserved, or this part in the file of the host.
    fn create_file(&self, reserved: Option<OutputFile>) -> Result<RecordingFile> {
        if let Some(host) = &self.host {
            return Ok(RecordingFile::Track(Box::new(host.open()?)));
        }
        let path = &self.record.path;
        let file = reserved.ok_or_else(|| problem!("{}: could not be begun", path.display()))?;
        Ok(match kind_of_name(path)? {
            "mcap" => {
                let writer = Writer::plan(file, &self.header, self.record.compression, false);
                writer.begin(self.header.decoding.origin_us)?;
                RecordingFile::Mcap(Box::new(writer))
            }
            _ => RecordingFile::Lsa(Mutex::new(LsaWriter::begin(file)?)),
        })
    }

    pub(super) fn datagrams(&self, batch: &Batch) -> Result<()> {
        self.has_data.store(true, Ordering::Relaxed);
        let file = self.create_once()?;
        if let (Some(_), Some(track)) = (&self.header.frames, file.track()) {
            return write_frames(track, batch);
        }
        if let Some(track) = file.track() {
            batch.iter().try_for_each(|(d, bytes)| track.datagram(d.arrived_ns, d.number, bytes))?;
        }
        if let RecordingFile::Lsa(writer) = file {
            let mut writer = lock(writer);
            batch.iter().try_for_each(|(_, bytes)| writer.bytes(bytes))?;
        }
        Ok(())
    }

    /// Writes the board's registers, valid from now on.
    pub(super) fn registers(&self, registers: &Registers) -> Result<()> {
        self.with_track(|track| track.registers(now_ns(), registers))
    }

    /// Refuses version 2 in a raw file: its bytes alone do not show where a datagram ends.
    pub(super) fn check_version(&self, version: u8) -> Result<()> {
        if version == 1 || kind_of_name(&self.record.path)? == "mcap" {
            return Ok(());
        }
        self.refused.store(true, Ordering::Relaxed);
        let path = self.record.path.display();
        Err(problem!(
            "{path}: a .lsa file contains only wire version 1, but the board uses version 2; record to a .mcap file"
        )
        .into())
    }

    pub(super) fn board_change(&self, change: &BoardChange) -> Result<()> {
        let t_us = change.t_us.and_then(|t| self.timed(t));
        self.with_track(|track| track.board_change(&BoardChange { t_us, ..*change }))
    }

    pub(super) fn marker(&self, marker: Marker) -> Result<()> {
        let Some(t) = self.timed(marker.t) else { return Ok(()) };
        self.with_track(|track| track.marker(now_ns(), Marker { t, ..marker }))
    }

    pub(super) fn detection(&self, output: &OutputDetection) -> Result<()> {
        let found = &output.detection;
        let (Some(t), Some(known)) = (self.timed(found.t), self.timed(found.known)) else { return Ok(()) };
        self.with_track(|track| track.detection(output.reported_ns, &Detection { t, known, ..found.clone() }))
    }

    /// Sets the rest that is subtracted from the previews from now on.
    pub(super) fn tare(&self, tare: &Tare) -> Result<()> {
        self.with_track(|track| {
            track.tare(tare);
            Ok(())
        })
    }

    pub(super) fn preview(&self, at_ns: i64, board_us: i64, columns: u16, held: &[u16]) -> Result<()> {
        // A file that is not begun has no previews.
        let has_begun = !matches!(self.create_once()?, RecordingFile::Mcap(writer) if !writer.has_begun());
        let Some(t_us) = self.timed(board_us).filter(|_| has_begun) else { return Ok(()) };
        self.with_track(|track| track.preview(at_ns, t_us, columns, held))
    }

    /// Writes the losses so far, which an unfinished recording then states; a raw file cannot store them.
    pub(super) fn counts(&self, counters: &Counters) -> Result<()> {
        let track = self.file.get().and_then(RecordingFile::track);
        track.map_or(Ok(()), |track| track.counts(now_ns(), &self.losses(counters)))
    }

    /// Passes buffered bytes to the system, so that they do not wait in memory for long; `.mcap` does so itself.
    pub(super) fn flush(&self) -> Result<()> {
        match self.file.get() {
            Some(RecordingFile::Mcap(_) | RecordingFile::Track(_)) | None => Ok(()),
            Some(RecordingFile::Lsa(writer)) => lock(writer).flush(),
        }
    }

    pub(super) fn note(&self, board_us: Option<i64>, text: &str) -> Result<()> {
        if kind_of_name(&self.record.path)? == "lsa" {
            return Err(problem!("a .lsa file cannot contain notes: record to a .mcap file").into());
        }
        self.has_notes.store(true, Ordering::Relaxed);
        self.with_track(|track| track.note(now_ns(), board_us.and_then(|t| self.timed(t)), text))
    }

    /// Writes a line of a source of frames that was not read.
    pub(super) fn unread_line(&self, arrived_ns: i64, text: &str) -> Result<()> {
        self.with_track(|track| track.unread_line(arrived_ns, text))
    }

    /// Writes a taxel's zeroing by a user.
    pub(super) fn zeroing(&self, zeroing: &Zeroing) -> Result<()> {
        if kind_of_name(&self.record.path)? == "lsa" {
            return Err(problem!("a .lsa file cannot contain the new rest of a taxel: record to a .mcap file").into());
        }
        let Some(t) = self.timed(zeroing.t) else { return Ok(()) };
        self.with_track(|track| track.zeroing(now_ns(), &Zeroing { t, ..*zeroing }))
    }

    /// The losses, as the file states them.
    pub(super) fn losses(&self, counters: &Counters) -> recording::RecordingCounts {
        losses(counters, self.since())
    }

    /// Closes the file and returns its path; a file that would hold nothing is removed.
    pub(super) fn finish(self, counters: &Counters) -> Result<Option<PathBuf>> {
        let lost = self.losses(counters);
        if let Some(host) = &self.host {
            if let Some(track) = self.file.get().and_then(RecordingFile::track) {
                track.end(&host.name, lost);
            }
            return Ok(None);
        }
        let nothing = !self.has_content() && (self.since.is_some() || counters.nothing_came());
        let refused = self.refused.into_inner();
        if nothing || (refused && !self.has_data.into_inner()) {
            match self.file.into_inner() {
                Some(RecordingFile::Mcap(writer)) => writer.discard()?,
                Some(RecordingFile::Lsa(writer)) => unpoisoned(writer).discard()?,
                Some(RecordingFile::Track(_)) | None => {}
            }
            let reserved = self.reserved.into_inner().unwrap_or_else(PoisonError::into_inner);
            return reserved.map_or(Ok(()), OutputFile::discard).map(|()| None);
        }
        match self.file.into_inner() {
            Some(RecordingFile::Mcap(writer)) => drop(writer.finish(lost)?),
            // Ended without an .lss, because the file is not complete.
            Some(RecordingFile::Lsa(writer)) if refused => unpoisoned(writer).end()?,
            Some(RecordingFile::Lsa(writer)) => unpoisoned(writer).finish()?,
            Some(RecordingFile::Track(_)) | None => {}
        }
        Ok(Some(self.record.path))
    }
}

fn unpoisoned(writer: Mutex<LsaWriter>) -> LsaWriter {
    writer.into_inner().unwrap_or_else(PoisonError::into_inner)
}

/// Writes the frames of a batch of messages.
fn write_frames(track: &SourceWriter, batch: &Batch) -> Result<()> {
    let mut frame: Vec<f32> = vec![];
    batch.iter().try_for_each(|(message, bytes)| {
        let (t, values) = read_message(bytes);
        frame.clear();
        frame.extend(values);
        track.frame(message.arrived_ns, message.number, t, &frame, FrameEncoding::choose(&frame))
    })
}

/// The kind of file, by its extension.
fn kind_of_name(path: &Path) -> Result<&str> {
    match path.extension().and_then(|e| e.to_str()) {
        Some(kind @ ("mcap" | "lsa")) => Ok(kind),
        _ => {
            let name = path.display();
            Err(problem!(
                "{name}: the name of a recording must end with .mcap (all data) or .lsa (only the board's bytes)"
            )
            .into())
        }
    }
}

/// The losses, as recordings state them; with `since`, those since a recording began.
pub(super) fn losses(counters: &Counters, since: Option<&Counters>) -> recording::RecordingCounts {
    // Datagrams that wait at the end belong to a later recording.
    let now = since.map_or_else(|| counters.clone(), |begun| counters.since(begun));
    if let Some(lines) = &now.lines {
        return recording::RecordingCounts {
            received: now.capture.datagrams,
            recorded: now.decoding.decoded,
            dropped_by_queue: now.capture.dropped_by_queue,
            decoder: lines.faults.counts,
            ..recording::RecordingCounts::default()
        };
    }
    let DecodingCounts { wire, wire_v2, totals, .. } = &now.decoding;
    let mut decoder = Counts::of_decoders(wire, wire_v2, totals);
    decoder.extend([
        (Cause::BetweenSenders, now.capture.changes_between_senders),
        (Cause::Addresses, now.capture.changes_of_address),
        (Cause::JumpedBefore, since.map_or(0, |begun| begun.decoding.totals.jumps)),
    ]);
    let missing = (wire_v2.datagrams > 0).then_some(wire_v2.missing);
    // Version 1 does not number datagrams: a recording with any of it cannot state that none is missing.
    let knows = now.decoding.wire_v2.intact > 0 && now.decoding.wire.bytes == 0;
    recording::RecordingCounts {
        received: now.capture.datagrams,
        recorded: now.decoding.decoded,
        dropped_by_kernel: now.capture.dropped_by_kernel,
        dropped_by_queue: now.capture.dropped_by_queue,
        stamped_when_read: now.capture.stamped_when_read,
        decoder,
        steps_back: now.decoding.wire_steps.clone(),
        missing: missing.filter(|n| *n > 0 || knows),
        ..recording::RecordingCounts::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_recording_of_nothing_but_version_2_says_that_nothing_is_missing() {
        let mut now = Counters::default();
        (now.decoding.wire_v2.datagrams, now.decoding.wire_v2.intact) = (100, 100);
        assert_eq!(losses(&now, None).missing, Some(0));
        assert_eq!(losses(&now, None).verdict().text(), "nothing lost");
        let begun = now.clone();
        // The board has sent version 1 since the recording began.
        now.decoding.wire.bytes = 50;
        assert_eq!(losses(&now, Some(&begun)).missing, None);
        (now.decoding.wire_v2.datagrams, now.decoding.wire_v2.intact) = (110, 110);
        assert_eq!(losses(&now, Some(&begun)).missing, None, "some of it");
        now.decoding.wire_v2.missing += 3;
        now.decoding.totals.refused += 25;
        let lost = losses(&now, Some(&begun));
        assert_eq!(lost.missing, Some(3));
        let verdict = lost.verdict();
        assert_eq!(verdict.counts[Cause::Refused], 25);
        // What the queue dropped is missing among the board's numbers too.
        now.capture.dropped_by_queue += 2;
        let lost = losses(&now, Some(&begun)).verdict().counts;
        assert_eq!((lost[Cause::QueueDropped], lost[Cause::OnTheWay]), (2, 1));
    }
}
