//! Reads the live format, finished or not, whole or damaged.
//!
//! The index is rebuilt at each opening by walking from record to record (a few bytes each, milliseconds per gigabyte),
//! so an unfinished file needs no special case: the official readers depend on a summary at the end, which it lacks. At
//! an invalid record the walk continues at the next valid chunk; the bytes between are counted.

mod blocks;
mod message;
mod remarks;
mod walk;

use std::collections::BTreeMap;
use std::fs::File;
use std::path::Path;
use std::sync::Arc;

use mcap::records::Record;
use taxel_core::wire::{self, Decoder};
use taxel_core::{Events, Stop, problem};

use super::{
    BoardChange, BoardChangeKind, Cause, Condition, Counts, FileEnding, Found, Frames, Header, Rebuilt,
    RecordingCounts, Topic, limits,
};
use crate::clock::leaves;
use crate::{Error, Result};
use blocks::Blocks;
pub use message::Message;
pub use remarks::Remarks;
use remarks::begin_with;
use walk::FileWalk;

/// An open recording in the live format.
#[derive(Debug, Clone)]
pub struct Reader {
    blocks: Arc<Blocks>,
    header: Arc<Header>,
    /// Index of the source that this reader reads.
    source: usize,
    ending: Option<FileEnding>,
    ends: Arc<BTreeMap<String, RecordingCounts>>,
    rebuilt: Rebuilt,
    /// How many bytes of a source may be in memory at once.
    memory: u64,
}

/// State between blocks: the file's channels, and the last arrival number.
#[derive(Debug, Default)]
struct ReadPosition {
    topics: BTreeMap<u16, Option<Topic>>,
    last: u64,
    bytes: Vec<u8>,
}

/// A recording's datagrams as they arrived, stored one after the other.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Datagrams {
    /// Arrival time of each datagram, ns since 1970.
    pub arrived_ns: Vec<i64>,
    /// Arrival number of each datagram.
    pub number: Vec<u64>,
    /// Where each datagram begins, and where the last one ends.
    pub offsets: Vec<i64>,
    /// The bytes of all datagrams.
    pub bytes: Vec<u8>,
}

/// The events decoded from a recording, and the properties of each of its datagrams.
#[derive(Debug, Clone)]
pub struct DecodedRecording {
    /// The decoded events.
    pub events: Events,
    /// Counts of the decoder of version 1.
    pub counts: wire::Counts,
    /// Counts of the decoder of version 2.
    pub version_2: wire::v2::Counts,
    /// Arrival time of each datagram, ns since 1970.
    pub arrived_ns: Vec<i64>,
    /// Earliest time at which each datagram could leave the board, us; `i64::MIN` if it is not known.
    pub left: Vec<i64>,
    /// What the decoder could not use, as a verdict states it.
    pub found: Found,
    /// Number of chunks that could not be read.
    pub bad_chunks: u64,
}

impl DecodedRecording {
    fn empty(events: Events) -> Self {
        let (counts, version_2) = (wire::Counts::default(), wire::v2::Counts::default());
        Self { events, counts, version_2, arrived_ns: vec![], left: vec![], found: Found::default(), bad_chunks: 0 }
    }
}

/// Marks the events with these indices as repaired; indices beyond the events are ignored.
fn mark_repaired(events: &mut Events, numbers: &[u64]) {
    if numbers.is_empty() || events.is_empty() {
        return;
    }
    let n = events.len();
    let marks = events.repaired.get_or_insert_with(|| vec![false; n]);
    for &number in numbers {
        if let Some(mark) = usize::try_from(number).ok().and_then(|number| marks.get_mut(number)) {
            *mark = true;
        }
    }
}

impl Reader {
    /// Opens a file and rebuilds its index; of a file that is still being written, the part written so far is read.
    ///
    /// # Errors
    ///
    /// `File` if it cannot be read; `Core` (format) if it is not an MCAP file, or not one of ours.
    pub fn open(path: &Path) -> Result<Self> {
        let file = File::open(path).map_err(Error::file(path))?;
        let length = file.metadata().map_err(Error::file(path))?.len();
        let mut walk = FileWalk::new(path, &file, length);
        walk.magic()?;
        walk.records()?;
        let FileWalk { begin, end, ending, ends, blocks, rebuilt, .. } = walk;
        let blocks = Blocks { path: path.to_owned(), file, blocks };
        // The copy of the header in the chunk of the datagrams' channel has a checksum; the other copies have none.
        let Some(header) = blocks.header()?.or(end).or(begin) else {
            return Err(Error::format(
                path,
                "is not a taxel recording: the header (metadata record \"taxel\") of this MCAP file is missing",
            ));
        };
        let (blocks, header, ends) = (Arc::new(blocks), Arc::new(header), Arc::new(ends));
        let mut reader = Self { blocks, header, source: 0, ending, ends, rebuilt, memory: u64::MAX };
        for source in (0..=reader.header.sources.len()).rev() {
            reader.source = source;
            if let Some(origin_us) = reader.stated_origin()? {
                let header = Arc::make_mut(&mut reader.header);
                let header = if source == 0 { header } else { &mut header.sources[source - 1] };
                header.decoding.origin_us = origin_us;
            }
        }
        reader.header.check().map_err(|error| Error::format(path, &format!("header: {error}")))?;
        Ok(reader)
    }

    /// Where the source begins on its board's clock, us, if it was begun while the board was received and says it.
    fn stated_origin(&self) -> Result<Option<i64>> {
        let (mut position, mut origin) = (ReadPosition::default(), None);
        let blocks = if self.header().decoding.begun_later { self.blocks() } else { 0 };
        for block in 0..blocks {
            self.block(block, &mut position, |message| {
                if message.topic == Topic::Board
                    && let Ok(BoardChange { change: BoardChangeKind::Clock { origin_us }, .. }) =
                        serde_json::from_slice(message.data)
                {
                    origin.get_or_insert(origin_us);
                }
                Ok(())
            })?;
            if origin.is_some() {
                break;
            }
        }
        Ok(origin)
    }

    /// The names of the sources; the reader starts with the first.
    pub fn sources(&self) -> impl Iterator<Item = &str> {
        std::iter::once(&*self.header).chain(&self.header.sources).map(|source| source.name.as_str())
    }

    /// A reader of another source of the same file.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` if there is no source of that name.
    pub fn of_source(&self, name: &str) -> Result<Self> {
        let Some(source) = self.sources().position(|known| known == name) else {
            let known: Vec<&str> = self.sources().collect();
            let path = self.blocks.path.display();
            return Err(problem!("{path}: has no source {name:?}; the sources are {}", known.join(", ")).into());
        };
        let ending = match &self.ending {
            Some(FileEnding::Finished { .. }) if source != 0 => {
                self.ends.get(name).cloned().map(|counts| FileEnding::Finished { counts: Box::new(counts) })
            }
            ending => ending.clone(),
        };
        Ok(Self { source, ending, ..self.clone() })
    }

    /// The same reader, where a function that returns all of a source may return at most `memory` bytes.
    #[must_use]
    pub fn within(&self, memory: u64) -> Self {
        Self { memory, ..self.clone() }
    }

    /// Refuses more bytes of a source than may be in memory.
    fn fits(&self, subject: &str, size: usize) -> Result<()> {
        limits::in_memory(&self.blocks.path, subject, size as u64, self.memory)
    }

    /// The source's header.
    #[must_use]
    pub fn header(&self) -> &Header {
        if self.source == 0 { &self.header } else { &self.header.sources[self.source - 1] }
    }

    /// How the recording ended, if the file states it.
    #[must_use]
    pub fn ending(&self) -> Option<&FileEnding> {
        self.ending.as_ref()
    }

    /// Damage found at opening; damage inside a chunk is found when the chunk is read.
    #[must_use]
    pub fn rebuilt(&self) -> Rebuilt {
        self.rebuilt
    }

    /// What is known of the file and of this source's messages, of which `remarks` were found, with so many bad chunks.
    #[must_use]
    pub fn condition(&self, remarks: &Remarks, bad_chunks: u64) -> Condition {
        let data = if self.header().frames.is_some() { Topic::Frames } else { Topic::Datagrams };
        let read = |topic: Topic| remarks.messages.get(&topic).copied().unwrap_or(0);
        // A source of which nothing came has no counts in a file that was finished.
        let is_silent = self.source > 0 && read(data) == 0 && !self.rebuilt.unfinished;
        let silent = is_silent.then(|| FileEnding::Finished { counts: Box::default() });
        let ending = self.ending.clone().or(silent);
        // The recorder's own counts say how many messages there were, the last ones before the end how many at least.
        let counts = match &ending {
            Some(FileEnding::Finished { counts }) => Some(&**counts),
            _ => remarks.counts.as_ref(),
        };
        let recorded = |topic: Topic| match &ending {
            Some(FileEnding::Finished { counts }) if topic == data => Some(counts.recorded),
            _ => counts.and_then(|counts| counts.messages.get(&topic)).copied(),
        };
        let mut in_file = Counts::default();
        for topic in Topic::ALL {
            if let (Some(cause), Some(recorded)) = (topic.lost_in_file(), recorded(topic)) {
                in_file[cause] += recorded.saturating_sub(read(topic));
                // Notes may have been added since.
                in_file[Cause::RepeatedInFile] += if topic == data { read(topic).saturating_sub(recorded) } else { 0 };
            }
        }
        Condition {
            ending,
            rebuilt: self.rebuilt,
            bad_chunks,
            in_file,
            messages: read(data),
            so_far: remarks.counts.clone(),
            converted: self.header().conversion.converted.clone().map(Box::new),
            decoded: None,
            lines: data != Topic::Datagrams,
            origin_us: self.header().decoding.origin_us,
        }
    }

    /// Passes all messages to `take` in the order of the file; skips bad chunks, and returns their number.
    ///
    /// # Errors
    ///
    /// `File` if the file cannot be read, `Core` if `take` returns it or the caller stops.
    pub fn messages(&self, stop: Stop<'_>, mut take: impl FnMut(Message<'_>) -> Result<()>) -> Result<u64> {
        let (mut position, mut bad) = (ReadPosition::default(), 0);
        for block in 0..self.blocks() {
            stop.check()?;
            bad += u64::from(!self.block(block, &mut position, &mut take)?);
        }
        Ok(bad)
    }

    /// Number of blocks (chunks).
    fn blocks(&self) -> usize {
        self.blocks.blocks.len()
    }

    /// Passes the messages of one block to `take`; `position` is the state after earlier blocks, all or some of them.
    /// Returns whether the block is valid.
    fn block(
        &self,
        block: usize,
        position: &mut ReadPosition,
        mut take: impl FnMut(Message<'_>) -> Result<()>,
    ) -> Result<bool> {
        let ReadPosition { topics, last, bytes } = position;
        let mut wrong = None;
        let is_valid = self.blocks.records(self.blocks.blocks[block], bytes, |record| {
            match record {
                Record::Channel(channel) => {
                    topics.insert(channel.id, Topic::of_name(&channel.topic, self.source, &self.header().name));
                }
                Record::Message { header, data } => {
                    let topic = topics.get(&header.channel_id).copied();
                    if let Some(topic) = topic.unwrap_or_else(|| Topic::of_number(header.channel_id, self.source)) {
                        let mut number = u64::from(header.sequence);
                        if topic == Topic::Datagrams {
                            number = unwrap(*last, header.sequence);
                            *last = number;
                        }
                        let at_ns = i64::try_from(header.log_time).unwrap_or(i64::MAX);
                        wrong = take(Message { topic, number, at_ns, data: &data }).err();
                    }
                }
                _ => {}
            }
            wrong.is_none()
        })?;
        wrong.map_or(Ok(is_valid), Err)
    }

    /// Collects everything except the datagrams' bytes and the frames; also returns the number of bad chunks.
    ///
    /// # Errors
    ///
    /// `Core` (format) if it is more than may be in memory; otherwise as [`Reader::messages`].
    pub fn remarks(&self, stop: Stop<'_>) -> Result<(Remarks, u64)> {
        let (mut all, mut size) = (Remarks::default(), 0);
        let bad = self.messages(stop, |message| {
            all.add(&message);
            if !message.topic.is_data() && message.topic != Topic::Pressure {
                size += limits::OBJECTS * message.data.len();
                self.fits("notes, detections and similar", size)?;
            }
            Ok(())
        })?;
        Ok((all, bad))
    }

    /// All datagrams as they arrived.
    ///
    /// # Errors
    ///
    /// As [`Reader::messages`].
    pub fn datagrams(&self, stop: Stop<'_>) -> Result<Datagrams> {
        let mut all = Datagrams { arrived_ns: vec![], number: vec![], offsets: vec![0], bytes: vec![] };
        self.messages(stop, |message| {
            if message.topic == Topic::Datagrams {
                all.arrived_ns.push(message.at_ns);
                all.number.push(message.number);
                all.bytes.extend_from_slice(message.data);
                all.offsets.push(i64::try_from(all.bytes.len()).unwrap_or(i64::MAX));
                self.fits("datagrams", all.bytes.len() + 24 * all.number.len())?;
            }
            Ok(())
        })?;
        Ok(all)
    }

    /// All frames of a source of frames.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` if the source is another; `Core` (format) if there are more than can be read; otherwise as
    /// [`Reader::messages`].
    pub fn frames(&self, stop: Stop<'_>) -> Result<Frames> {
        let Header { name, array, frames, .. } = self.header();
        if frames.is_none() {
            return Err(problem!("source {name}: contains no frames").into());
        }
        let mut all = Frames::default();
        self.messages(stop, |message| {
            if message.topic == Topic::Frames {
                let values = array.len() + all.values.len();
                self.fits("frames", 4 * values + 16 * values / array.len())?;
                all.push(message.at_ns, message.data, array.rows, array.columns);
            }
            Ok(())
        })?;
        Ok(all)
    }

    /// Decodes all datagrams.
    ///
    /// # Errors
    ///
    /// As [`Reader::messages`].
    pub fn decode(&self, stop: Stop<'_>) -> Result<DecodedRecording> {
        let mut datagrams = 0;
        let mut decoded = self.decode_each(stop, |message, events| {
            datagrams += usize::from(message.topic == Topic::Datagrams);
            self.fits("events", events.size() + 16 * datagrams)
        })?;
        mark_repaired(&mut decoded.events, &self.header().decoding.repaired);
        Ok(decoded)
    }

    /// Decodes all datagrams; passes each message to `take` with the events that were decoded up to it, which `take` may remove:
    /// those that are left are in the result.
    ///
    /// # Errors
    ///
    /// As [`Reader::messages`].
    pub fn decode_each(
        &self,
        stop: Stop<'_>,
        mut take: impl FnMut(&Message<'_>, &mut Events) -> Result<()>,
    ) -> Result<DecodedRecording> {
        let header = self.header();
        let array = header.array.clone();
        let decoder = Decoder::new(array.clone()).differences(header.decoding.difference);
        let mut sender = wire::SenderDecoder::new(decoder, 1);
        let mut decoded = DecodedRecording::empty(Events::empty(array));
        let origin_us = header.decoding.origin_us;
        #[allow(clippy::cast_possible_truncation)]
        let frame_us = header.registers.map_or(0, |registers| registers.frame_us() as i64);
        decoded.bad_chunks = self.messages(stop, |message| {
            let events = &mut decoded.events;
            let before = (events.len(), events.markers.len());
            if message.topic == Topic::Datagrams {
                let arrived = Some(message.at_ns / 1000);
                let info = sender.push(message.data, arrived, events);
                let last = events.t.get(before.0..).and_then(<[i64]>::last).copied();
                let left = leaves(&info, last, message.data.len(), frame_us).map_or(i64::MIN, |t| t + origin_us);
                decoded.left.push(left);
                decoded.arrived_ns.push(message.at_ns);
            }
            if message.topic == Topic::Held {
                begin_with(&mut sender, message.data);
            }
            // The datagrams do not show commands from the host to the board.
            if message.topic == Topic::Board
                && let Ok(BoardChange { change: BoardChangeKind::Wire { version, asked: true }, .. }) =
                    serde_json::from_slice(message.data)
            {
                sender.expect(version, events);
            }
            move_later(events, before, origin_us);
            take(&message, events)
        })?;
        let before = (decoded.events.len(), decoded.events.markers.len());
        sender.finish_into(&mut decoded.events);
        move_later(&mut decoded.events, before, origin_us);
        decoded.counts = *sender.counts();
        decoded.version_2 = sender.version_2().counts();
        decoded.found = Found::of_sender(&sender, origin_us);
        Ok(decoded)
    }
}

/// Adds `us` to the times of the events and the markers from these indices on.
fn move_later(events: &mut Events, from: (usize, usize), us: i64) {
    events.t[from.0..].iter_mut().for_each(|t| *t += us);
    events.markers[from.1..].iter_mut().for_each(|marker| marker.t += us);
}

/// The number with these low 32 bits that is closest to the last one.
fn unwrap(last: u64, low: u32) -> u64 {
    #[allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap)]
    let step = i64::from(low.wrapping_sub(last as u32) as i32);
    last.checked_add_signed(step).unwrap_or(u64::from(low))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrival_numbers_go_on_beyond_32_bits() {
        let mut last = u64::from(u32::MAX) - 1;
        for expected in [u64::from(u32::MAX), 1 << 32, (1 << 32) + 1] {
            #[allow(clippy::cast_possible_truncation)]
            let low = expected as u32;
            last = unwrap(last, low);
            assert_eq!(last, expected);
        }
    }
}
