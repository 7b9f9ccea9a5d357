//! Writes the live format: accepts the data of each source of a recording, from any thread, without waiting for the
//! disk.
//!
//! A [`Writer`] encodes data as messages and adds them to a queue in memory ([`write_queue`]); a thread packs them into
//! chunks ([`chunk_writer`]) and writes the chunks to the file ([`record_file`]).

mod chunk_writer;
mod queue;
mod record_file;
mod write_queue;

use std::path::Path;
use std::sync::Arc;

use base64::Engine;
use base64::prelude::BASE64_STANDARD as STANDARD;
use serde_json::json;
use taxel_core::detect::Detection;
use taxel_core::encode::Zeroing;
use taxel_core::wire::Registers;
use taxel_core::{Marker, problem};

use super::frames::{FrameEncoding, message};
use super::{BoardChange, Header, OutputFile, RecordingCounts, Topic, WriterOptions};
use crate::Result;
use crate::locked::lock;
use write_queue::WriteQueue;

/// Capacity of the queue while the disk stalls, bytes; callers wait while it is full (0.6 s of the sensor's worst
/// case).
const QUEUE_BYTES: usize = 64 << 20;

/// Capacity of the queue for a caller who passes everything at once, bytes: small enough to stay in the caches, and
/// allocated only once.
const BULK_BYTES: usize = 4 << 20;

/// The largest datagram that UDP can carry.
const DATAGRAM_BYTES: usize = 65_507;

/// A recording that is being written; several threads may share it.
///
/// Dropped without [`Writer::finish`], it writes everything that it accepted, and the file states that it was not
/// finished.
pub struct Writer {
    /// The first source.
    track: SourceWriter,
    header: Header,
}

/// Writes one source of a recording; any thread may use it. A [`Writer`] is also the first source's.
pub struct SourceWriter {
    queue: Arc<WriteQueue>,
    /// Index of the source in the file.
    source: usize,
    name: String,
    /// Number of columns of the array.
    columns: u16,
    /// Number of cells in the array.
    taxels: usize,
}

impl std::ops::Deref for Writer {
    type Target = SourceWriter;

    fn deref(&self) -> &SourceWriter {
        &self.track
    }
}

impl Writer {
    /// Creates a recording with the header's source and the sources that it names; the file is readable from now on.
    ///
    /// # Errors
    ///
    /// As [`OutputFile::open`]; `File` if the file cannot be written; `Core(Problem)` if a source is not valid.
    pub fn create(path: &Path, header: &Header, options: WriterOptions) -> Result<Self> {
        let writer = Self::without_thread(path, header, options)?;
        writer.track.queue.start()?;
        Ok(writer)
    }

    /// As [`Writer::create`], but what is accepted waits in memory.
    fn without_thread(path: &Path, header: &Header, options: WriterOptions) -> Result<Self> {
        header.check()?;
        let file = OutputFile::open(path, options.overwrite)?;
        let queue = Arc::new(WriteQueue::open(file, header, options.compression)?);
        Ok(Self { track: SourceWriter::new(queue, 0, header), header: header.clone() })
    }

    /// The writer of a source.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` if the header contains no source of that name.
    pub fn track(&self, name: &str) -> Result<SourceWriter> {
        let mut sources = std::iter::once(&self.header).chain(&self.header.sources).enumerate();
        let Some((k, source)) = sources.find(|(_, source)| source.name == name) else {
            return Err(problem!("source {name:?}: the recording has no source with this name").into());
        };
        Ok(SourceWriter::new(Arc::clone(&self.track.queue), k, source))
    }

    /// Whether any source has passed data, a line that was not read, or a note.
    #[must_use]
    pub fn has_content(&self) -> bool {
        self.track.queue.lock().written.iter().any(|written| written.data > 0 || written.is_kept)
    }

    /// Ends the recording with the counts of the first source and the verdict; returns the final counts. The other
    /// sources must have ended before ([`SourceWriter::end`]).
    ///
    /// The file is synced to the disk when this returns.
    ///
    /// # Errors
    ///
    /// `File` if the disk is full or not available, in which case the file keeps everything that was written before.
    pub fn finish(self, counts: RecordingCounts) -> Result<RecordingCounts> {
        self.track.queue.finish(Some(counts.clone()))?;
        Ok(self.track.queue.lock().written[0].at_end(counts))
    }

    /// Ends an empty recording: removes the file.
    ///
    /// # Errors
    ///
    /// `File` if the file cannot be removed.
    pub fn discard(self) -> Result<()> {
        self.track.queue.abandon().map_or(Ok(()), OutputFile::discard)
    }
}

impl SourceWriter {
    /// The writer of the source with this index in the file.
    fn new(queue: Arc<WriteQueue>, source: usize, header: &Header) -> Self {
        Self { queue, source, name: header.name.clone(), columns: header.array.columns, taxels: header.array.len() }
    }

    /// Writes a frame that arrived at `arrived_ns` (ns since 1970), with its arrival number, its time (us) and the values of
    /// all taxels.
    ///
    /// # Errors
    ///
    /// As [`SourceWriter::datagram`].
    pub(crate) fn frame(
        &self,
        arrived_ns: i64,
        number: u64,
        t_us: i64,
        values: &[f32],
        encoding: FrameEncoding,
    ) -> Result<()> {
        let message = message(&self.name, t_us, self.columns, values, encoding);
        self.queue.push(self.source, Topic::Frames, (arrived_ns, number), &message, QUEUE_BYTES)
    }

    /// Writes frames, each with its time in the file (ns), its time by the board's clock (us) and the values of all
    /// taxels; `first` is the number of the first of them.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` where the columns do not fit each other or the array; else as [`SourceWriter::datagram`].
    pub fn frames(
        &self,
        first: u64,
        at_ns: &[i64],
        t_us: &[i64],
        values: &[f32],
        encoding: FrameEncoding,
    ) -> Result<()> {
        if at_ns.len() != t_us.len() || values.len() != t_us.len() * self.taxels {
            let (n, taxels) = (values.len(), self.taxels);
            return Err(problem!("{} frames of {taxels} taxels: {n} values", t_us.len()).into());
        }
        let frames = values.chunks_exact(self.taxels).zip(at_ns.iter().zip(t_us)).zip(first..);
        for ((frame, (&at_ns, &t_us)), number) in frames {
            let message = message(&self.name, t_us, self.columns, frame, encoding);
            self.queue.push(self.source, Topic::Frames, (at_ns, number), &message, BULK_BYTES)?;
        }
        Ok(())
    }

    /// Writes a line of a source of frames that was not read, as it arrived.
    ///
    /// # Errors
    ///
    /// As [`SourceWriter::datagram`].
    pub fn unread_line(&self, arrived_ns: i64, line: &str) -> Result<()> {
        self.queue.lock().written[self.source].is_kept = true;
        self.push_json(Topic::Lines, arrived_ns, &json!({ "line": line }))
    }

    /// Ends this source with the counts of what was received and lost; it must not be used afterwards.
    pub fn end(&self, counts: RecordingCounts) {
        let mut state = self.queue.lock();
        let counts = state.written[self.source].at_end(counts);
        state.ends.insert(self.name.clone(), counts);
    }

    /// Writes a datagram, with its arrival time by the host's clock (ns since 1970), arrival number and bytes.
    ///
    /// # Errors
    ///
    /// As [`SourceWriter::check`]; `Core` if there are more bytes than a datagram can have.
    pub fn datagram(&self, arrived_ns: i64, number: u64, bytes: &[u8]) -> Result<()> {
        self.datagram_at_most(arrived_ns, number, bytes, QUEUE_BYTES)
    }

    fn datagram_at_most(&self, arrived_ns: i64, number: u64, bytes: &[u8], most: usize) -> Result<()> {
        if bytes.len() > DATAGRAM_BYTES {
            return Err(problem!("datagram of {} bytes: UDP carries at most {DATAGRAM_BYTES}", bytes.len()).into());
        }
        self.queue.push(self.source, Topic::Datagrams, (arrived_ns, number), bytes, most)
    }

    /// Writes many datagrams: each begins in `bytes` at its entry of `offsets`, whose last one is where all end.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` where columns differ in length or name bytes that are not there; else as [`SourceWriter::datagram`].
    pub fn datagrams(&self, arrived_ns: &[i64], number: &[u64], offsets: &[i64], bytes: &[u8]) -> Result<()> {
        if number.len() != arrived_ns.len() || offsets.len() != arrived_ns.len() + 1 {
            let n = arrived_ns.len();
            return Err(problem!(
                "{n} arrival times: must come with {n} numbers of arrival, and with {} offsets into bytes",
                n + 1
            )
            .into());
        }
        for (k, two) in offsets.windows(2).enumerate() {
            let range = usize::try_from(two[0]).ok().zip(usize::try_from(two[1]).ok());
            let Some(datagram) = range.and_then(|(from, to)| bytes.get(from..to)) else {
                return Err(problem!("datagram {k}: bytes {} to {} are outside the given bytes", two[0], two[1]).into());
            };
            self.datagram_at_most(arrived_ns[k], number[k], datagram, BULK_BYTES)?;
        }
        Ok(())
    }

    /// Writes the board's registers, valid from now on.
    ///
    /// # Errors
    ///
    /// As [`SourceWriter::datagram`]; the same applies to the methods below.
    pub fn registers(&self, at_ns: i64, registers: &Registers) -> Result<()> {
        self.push_json(Topic::Registers, at_ns, &json!(registers))
    }

    /// Writes a start or stop marked by the board.
    ///
    /// # Errors
    ///
    /// As [`SourceWriter::datagram`].
    pub fn marker(&self, at_ns: i64, marker: Marker) -> Result<()> {
        self.push_json(Topic::Markers, at_ns, &json!({ "t_us": marker.t, "start": marker.start }))
    }

    /// Writes a user's note; `t_us` is the board's time if it is known.
    ///
    /// # Errors
    ///
    /// As [`SourceWriter::datagram`].
    pub fn note(&self, at_ns: i64, t_us: Option<i64>, text: &str) -> Result<()> {
        self.queue.lock().written[self.source].is_kept = true;
        self.push_json(Topic::Notes, at_ns, &log(at_ns, t_us, text))
    }

    /// Writes a taxel's zeroing by a user, as a note.
    ///
    /// # Errors
    ///
    /// As [`SourceWriter::datagram`].
    pub fn zeroing(&self, at_ns: i64, zeroing: &Zeroing) -> Result<()> {
        let Zeroing { t, x, y, rest, before } = *zeroing;
        let before_text = before.map_or_else(|| "unknown".to_owned(), |before| format!("{before:.1}"));
        let text = format!("zeroed row {y}, column {x}: its rest was {before_text} and is now {rest:.1} ticks");
        let mut note = log(at_ns, Some(t), &text);
        note["zeroed"] = json!({ "x": x, "y": y, "rest": rest, "before": before });
        self.push_json(Topic::Notes, at_ns, &note)
    }

    /// Writes a reset of the board, or a change of its version of the wire.
    ///
    /// # Errors
    ///
    /// As [`SourceWriter::datagram`].
    pub fn board_change(&self, change: &BoardChange) -> Result<()> {
        let value = serde_json::to_value(change).unwrap_or_default();
        self.push_json(Topic::Board, change.at_ns, &value)
    }

    /// Writes a detection of a readout; `at_ns` is the time of its output.
    ///
    /// # Errors
    ///
    /// As [`SourceWriter::datagram`].
    pub fn detection(&self, at_ns: i64, detection: &Detection) -> Result<()> {
        let Detection { label, t, known, slope, repaired } = detection;
        let value = json!({ "label": label, "t_us": t, "known_us": known, "slope": slope, "repaired": repaired });
        self.push_json(Topic::Detections, at_ns, &value)
    }

    /// Says whether what was accepted could be written so far.
    ///
    /// # Errors
    ///
    /// `File` if the disk is full or not available, or another program has taken the file.
    pub fn check(&self) -> Result<()> {
        self.queue.lock().check(&self.queue.path)
    }

    /// Writes the counts so far, so that an unfinished recording contains them too; to be called about once a second.
    ///
    /// # Errors
    ///
    /// As [`SourceWriter::datagram`].
    pub fn counts(&self, at_ns: i64, counts: &RecordingCounts) -> Result<()> {
        let counts = self.queue.lock().written[self.source].counts_so_far(counts.clone());
        self.push_json(Topic::Counts, at_ns, &json!(counts))
    }

    /// Writes a preview of the taxels' values, ticks, for viewers, in the form of frames.
    ///
    /// # Errors
    ///
    /// As [`SourceWriter::datagram`]; `Core(Problem)` if there is not one value a taxel.
    pub fn preview(&self, at_ns: i64, t_us: i64, ticks: &[u16]) -> Result<()> {
        if ticks.len() != self.taxels {
            return Err(problem!("preview of {} taxels: must be {}", ticks.len(), self.taxels).into());
        }
        let values: Vec<f32> = ticks.iter().map(|&ticks| ticks.into()).collect();
        let is_small = ticks.iter().all(|&ticks| ticks <= u8::MAX.into());
        let encoding = if is_small { FrameEncoding::Byte } else { FrameEncoding::Whole };
        let preview = message(&self.name, t_us, self.columns, &values, encoding);
        self.push(Topic::Pressure, at_ns, &preview)
    }

    /// Writes the taxels' values before the recording's first datagram, ticks by taxel index; 65 535 for a taxel
    /// without any event so far. Without this message, a recording that begins in mid-stream would know a taxel's value
    /// only after its next change.
    ///
    /// # Errors
    ///
    /// As [`SourceWriter::datagram`].
    pub fn held(&self, at_ns: i64, t_us: Option<i64>, ticks: &[u16]) -> Result<()> {
        let bytes: Vec<u8> = ticks.iter().flat_map(|value| value.to_le_bytes()).collect();
        let held = json!({ "t_us": t_us, "encoding": "uint16, little-endian", "ticks": STANDARD.encode(&bytes) });
        self.push_json(Topic::Held, at_ns, &held)
    }

    fn push_json(&self, topic: Topic, at_ns: i64, value: &serde_json::Value) -> Result<()> {
        self.push(topic, at_ns, value.to_string().as_bytes())
    }

    fn push(&self, topic: Topic, at_ns: i64, bytes: &[u8]) -> Result<()> {
        self.queue.push(self.source, topic, (at_ns, 0), bytes, QUEUE_BYTES)
    }
}

impl Drop for Writer {
    fn drop(&mut self) {
        if lock(&self.track.queue.thread).is_some() {
            // No caller remains to receive an error; the file itself states that it was not finished.
            let _ = self.track.queue.finish(None);
        }
    }
}

/// A message that viewers show as a line of text.
fn log(at_ns: i64, t_us: Option<i64>, text: &str) -> serde_json::Value {
    json!({
        "timestamp": { "sec": at_ns.max(0) / 1_000_000_000, "nsec": at_ns.max(0) % 1_000_000_000 }, "level": 2, "message": text, "name": "taxel", "file": "", "line": 0, "t_us": t_us,
    })
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::Ordering;

    use super::super::{LATE, Reader};
    use super::*;

    /// A writer whose thread was not started.
    fn alone(path: &Path) -> Writer {
        let header: Header = serde_json::from_value(json!({ "array": taxel_core::Array::thesis() })).unwrap();
        Writer::without_thread(path, &header, WriterOptions { overwrite: true, ..WriterOptions::default() }).unwrap()
    }

    #[test]
    fn a_writer_whose_thread_gets_no_processor_loses_at_most_what_is_not_late() {
        let path = std::env::temp_dir().join(format!("taxel-starved-{}.mcap", std::process::id()));
        let writer = alone(&path);
        for k in 0..20_u32 {
            writer.datagram(i64::from(k), u64::from(k), &[7; 1400]).unwrap();
            std::thread::sleep(LATE / 4);
        }
        // The file as a kill would leave it now: a late caller, at least one in ten, wrote everything before it.
        let left = Reader::open(&path).unwrap().remarks(taxel_core::Stop::never()).unwrap().0.datagrams;
        let waiting = writer.track.queue.lock().queue.messages.len() as u64;
        assert_eq!(left + waiting, 20);
        assert!(waiting < 10, "{waiting} wait");
        std::fs::remove_file(&path).unwrap();
    }

    #[test]
    fn while_the_disk_is_waited_for_callers_go_on() {
        let path = std::env::temp_dir().join(format!("taxel-stalled-{}.mcap", std::process::id()));
        let writer = alone(&path);
        writer.track.queue.at_disk.store(true, Ordering::Relaxed);
        // The thread that waits for the disk has locked the chunk writer: a caller that tried to lock it would block.
        let busy = lock(&writer.track.queue.writer);
        writer.datagram(0, 0, &[7; 1400]).unwrap();
        std::thread::sleep(LATE);
        writer.datagram(1, 1, &[7; 1400]).unwrap();
        assert_eq!(writer.track.queue.lock().queue.messages.len(), 2);
        drop(busy);
        std::fs::remove_file(&path).unwrap();
    }
}
