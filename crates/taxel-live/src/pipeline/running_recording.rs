//! One recording of a [`Live`](super::Live): a file, or this pipeline's part of another one's.

use std::ops::Deref;
use std::path::PathBuf;

use taxel_core::problem;
use taxel_core::wire::Registers;

use super::counters::{Counters, DecodingCounts};
use super::frame_block::read_message;
use super::options::Record;
use super::source::NamedSource;
use crate::Result;
use crate::capture::Batch;
use crate::recording::{
    BoardChange, BoardChangeKind, Cause, Counts, FrameEncoding, Header, RecordingCounts, SourceWriter, Writer,
    WriterOptions, now_ns,
};

/// The recording that was running, if any, and the counters after its last datagram.
pub(super) type EndedRecording = (Option<RunningRecording>, Counters);

/// One recording, from the beginning of its file to its end. Its times are those of the pipeline's clock.
pub(super) struct RunningRecording {
    file: RecordingFile,
    begin_registers: Option<Registers>,
    /// Whether its source sends frames.
    has_frames: bool,
    /// The counters at the recording's beginning, if it began while the pipeline was running.
    since: Option<Box<Counters>>,
    /// Where it begins on the board's clock, us, if it began while the pipeline was running and that is known.
    origin_us: Option<i64>,
}

enum RecordingFile {
    Own(Box<Writer>, PathBuf),
    /// A part of another pipeline's recording.
    Part(Box<SourceWriter>),
}

impl RunningRecording {
    fn new(file: RecordingFile, header: &Header, later: bool) -> Self {
        Self {
            file,
            begin_registers: header.registers,
            has_frames: header.frames.is_some(),
            since: later.then(Box::default),
            origin_us: None,
        }
    }

    /// Begins the file of a recording; `later`: while the pipeline runs.
    pub(super) fn create(record: &Record, header: Header, sources: &[NamedSource], later: bool) -> Result<Self> {
        let path = &record.path;
        if path.extension().is_none_or(|extension| extension != "mcap") {
            let name = path.display();
            return Err(problem!(
                "{name}: the name of a recording must end with .mcap; taxel convert makes other files of it"
            )
            .into());
        }
        let sources = sources.iter().map(NamedSource::header).collect::<taxel_core::Result<_>>()?;
        let mut header = Header { sources, ..header };
        for source in header.sources.iter_mut().filter(|source| source.frames.is_none()) {
            source.decoding.begun_later = later;
        }
        header.decoding.begun_later = later && header.frames.is_none();
        let options = WriterOptions { compression: record.compression, overwrite: record.overwrite };
        let writer = Box::new(Writer::create(path, &header, options)?);
        Ok(Self::new(RecordingFile::Own(writer, path.clone()), &header, later))
    }

    /// The part of another pipeline's recording that has this writer; `later`: begun while this pipeline runs.
    pub(super) fn part(writer: SourceWriter, header: &Header, later: bool) -> Self {
        Self::new(RecordingFile::Part(Box::new(writer)), header, later)
    }

    /// The writer of another source's part of this recording.
    pub(super) fn track_of(&self, name: &str) -> Result<SourceWriter> {
        match &self.file {
            RecordingFile::Own(writer, _) => writer.track(name),
            RecordingFile::Part(_) => Err(problem!("source {name}: a part of a recording has no sources").into()),
        }
    }

    /// Begins with the registers and the values that the taxels hold, at these counters.
    pub(super) fn begin(&mut self, now: &Counters, held: &[u16]) -> Result<()> {
        self.since = Some(Box::new(now.clone()));
        if let Some(registers) = &self.begin_registers {
            self.registers(now_ns(), registers)?;
        }
        // The first frame has all values.
        if self.has_frames { Ok(()) } else { self.held(now_ns(), now.board.board_us, held) }
    }

    /// Restarts the recording if it is still empty; returns whether it does.
    pub(super) fn restart_if_empty(&mut self, now: &Counters) -> bool {
        if self.has_content() {
            return false;
        }
        self.since = Some(Box::new(now.clone()));
        true
    }

    /// Whether any source passed data, or bytes that are in no line, or a note was written.
    fn has_content(&self) -> bool {
        matches!(&self.file, RecordingFile::Own(writer, _) if writer.has_content())
    }

    /// The counters at the recording's beginning, if it began while the pipeline was running; an error then ends only
    /// the recording.
    pub(super) fn since(&self) -> Option<&Counters> {
        self.since.as_deref()
    }

    /// Writes where the recording begins on the board's clock, us.
    pub(super) fn set_origin(&mut self, origin_us: i64) -> Result<()> {
        self.origin_us = Some(origin_us);
        self.state_origin()
    }

    fn state_origin(&self) -> Result<()> {
        let Some(origin_us) = self.origin_us else { return Ok(()) };
        let change = BoardChangeKind::Clock { origin_us };
        self.board_change(&BoardChange { at_ns: now_ns(), t_us: None, change })
    }

    /// Writes what arrived.
    pub(super) fn batch(&self, batch: &Batch) -> Result<()> {
        if self.has_frames {
            return write_frames(self, batch);
        }
        batch.iter().try_for_each(|(d, bytes)| self.datagram(d.arrived_ns, d.number, bytes))
    }

    /// Writes the losses so far, which an unfinished recording then states, and once more where it begins.
    pub(super) fn write_losses(&self, counters: &Counters) -> Result<()> {
        self.state_origin()?;
        self.counts(now_ns(), &self.losses(counters))
    }

    /// The losses, as the file states them.
    pub(super) fn losses(&self, counters: &Counters) -> RecordingCounts {
        losses(counters, self.since())
    }

    /// Closes the file and returns its path; a file that would hold nothing is removed.
    pub(super) fn finish(self, counters: &Counters) -> Result<Option<PathBuf>> {
        let lost = self.losses(counters);
        let nothing = !self.has_content() && (self.since.is_some() || counters.nothing_came());
        match self.file {
            RecordingFile::Part(track) => {
                track.end(lost);
                Ok(None)
            }
            RecordingFile::Own(writer, _) if nothing => writer.discard().map(|()| None),
            RecordingFile::Own(writer, path) => writer.finish(lost).map(|_| Some(path)),
        }
    }
}

/// It writes this pipeline's source.
impl Deref for RunningRecording {
    type Target = SourceWriter;

    fn deref(&self) -> &SourceWriter {
        match &self.file {
            RecordingFile::Own(writer, _) => writer,
            RecordingFile::Part(track) => track,
        }
    }
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

/// The losses, as recordings state them; with `since`, those since a recording began.
pub(super) fn losses(counters: &Counters, since: Option<&Counters>) -> RecordingCounts {
    // Datagrams that wait at the end belong to a later recording.
    let now = since.map_or_else(|| counters.clone(), |begun| counters.since(begun));
    if let Some(lines) = &now.lines {
        return RecordingCounts {
            received: now.capture.datagrams,
            recorded: now.decoding.decoded,
            dropped_by_queue: now.capture.dropped_by_queue,
            decoder: lines.faults.counts,
            doubtful_after_us: lines.faults.doubtful_after_us,
            ..RecordingCounts::default()
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
    RecordingCounts {
        received: now.capture.datagrams,
        recorded: now.decoding.decoded,
        dropped_by_kernel: now.capture.dropped_by_kernel,
        dropped_by_queue: now.capture.dropped_by_queue,
        stamped_when_read: now.capture.stamped_when_read,
        decoder,
        steps_back: now.decoding.wire_steps.clone(),
        missing: missing.filter(|n| *n > 0 || knows),
        ..RecordingCounts::default()
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
