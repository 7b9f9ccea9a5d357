//! Reads the live format, finished or not, whole or damaged.
//!
//! The index is rebuilt each time by walking from record to record (a few bytes each, milliseconds a gigabyte), so an
//! unfinished file needs nothing special: the official readers start from a summary at the end that it does not have.
//! Where a record makes no sense the walk goes on at the next chunk that does; what lies between is counted.

use std::collections::BTreeMap;
use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use mcap::records::{Record, op};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{MAGIC, parse_record};
use serde::Serialize;
use serde_json::Value;
use taxel_core::detect::Detection;
use taxel_core::encode::Zeroing;
use taxel_core::wire::{self, Decoder, Pairing, Registers};
use taxel_core::{Events, Marker, Stop, problem};

use super::mcap_writer::{BEGIN, END, unbase64};
use super::stream::Sampling;
use super::{BoardChange, Change, Counts, Header, Note, Samples, Topic, limits};
use crate::clock::leaves;
use crate::{Error, Result};

/// Opcode, length.
const RECORD_HEAD: u64 = 9;

/// A recording of the live format, opened.
#[derive(Debug, Clone)]
pub struct Reader {
    blocks: Arc<Blocks>,
    header: Arc<Header>,
    /// Which of the file's sources this reads.
    source: usize,
    ending: Option<Ending>,
    ends: Arc<BTreeMap<String, Counts>>,
    rebuilt: Rebuilt,
}

/// How a recording says that it ended.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Ending {
    /// As planned, with what was lost.
    Finished {
        /// What was received and lost.
        counts: Counts,
        /// The writer's line about it.
        verdict: String,
    },
    /// Writing failed: what the operating system said.
    Stopped(String),
}

/// What reading some blocks leaves for the next: the file's own channels, where numbers have come to.
#[derive(Debug, Clone, Default)]
pub struct Place {
    topics: BTreeMap<u16, Option<Topic>>,
    last: u64,
    in_datagrams: u64,
    bytes: Vec<u8>,
}

impl Place {
    /// The same place without the memory that reading uses again.
    #[must_use]
    pub fn kept(&self) -> Self {
        Self { bytes: vec![], topics: self.topics.clone(), ..*self }
    }
}

/// What had to be left out of a file, or put up with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Rebuilt {
    /// Whether the file lacks its end: writing was killed, or the file was cut.
    pub unfinished: bool,
    /// Bytes at the end of the file that belong to a record which is not whole.
    pub torn_bytes: u64,
    /// Places where the walk lost its way and found it again.
    pub gaps: u64,
    /// Bytes skipped there.
    pub skipped_bytes: u64,
    /// Chunks left out because they say that they unpack to more than a chunk may.
    pub large_chunks: u64,
}

/// One message as it stands in the file.
#[derive(Debug, Clone, Copy)]
pub struct Message<'a> {
    /// Its channel.
    pub topic: Topic,
    /// Our arrival number, of datagrams.
    pub number: u64,
    /// The host's clock, ns since 1970.
    pub at_ns: i64,
    /// The content.
    pub data: &'a [u8],
}

/// A recording's datagrams as they came, one after the other.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Datagrams {
    /// When each came, ns since 1970.
    pub arrived_ns: Vec<i64>,
    /// Our arrival number of each.
    pub number: Vec<u64>,
    /// Where each begins, and at last where all end.
    pub offsets: Vec<i64>,
    /// Their bytes.
    pub bytes: Vec<u8>,
}

/// A recording's datagrams as events, with what belongs to each datagram.
#[derive(Debug, Clone)]
pub struct Decoded {
    /// What changed, when.
    pub events: Events,
    /// What the decoder saw and dropped.
    pub counts: wire::Counts,
    /// What was heard and missed of version 2.
    pub version_2: wire::v2::Counts,
    /// When each datagram came, ns since 1970.
    pub arrived_ns: Vec<i64>,
    /// Our arrival number of each.
    pub number: Vec<u64>,
    /// The first event of each; with pairing by taxel all events come at the end.
    pub first: Vec<u64>,
    /// When each could leave the board at the earliest, us; `i64::MIN` where that is not known.
    pub left: Vec<i64>,
    /// Chunks that could not be used.
    pub bad_chunks: u64,
}

impl Decoded {
    fn empty(events: Events) -> Self {
        let (counts, version_2) = (wire::Counts::default(), wire::v2::Counts::default());
        Self {
            events,
            counts,
            version_2,
            arrived_ns: vec![],
            number: vec![],
            first: vec![],
            left: vec![],
            bad_chunks: 0,
        }
    }
}

/// All small messages of a recording.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Remarks {
    /// The board's registers as they were set, by time of the host, ns.
    pub registers: Vec<(i64, Registers)>,
    /// Starts and stops, as the board marked them.
    pub markers: Vec<Marker>,
    /// Notes of people.
    pub notes: Vec<Note>,
    /// Taxels that people zeroed, and when by the host's clock, ns.
    pub zeroings: Vec<(i64, Zeroing)>,
    /// What readouts said, and when by the host's clock, ns.
    pub detections: Vec<(i64, Detection)>,
    /// The last counts, from before the end.
    pub counts: Option<Counts>,
    /// How many datagrams there are, and their bytes.
    pub datagrams: u64,
    /// Bytes in them.
    pub datagram_bytes: u64,
    /// First and last arrival, ns since 1970.
    pub arrivals: Option<(i64, i64)>,
    /// How many pictures there are.
    pub pictures: u64,
    /// Resets of the board, and changes of its version of the wire.
    pub board: Vec<BoardChange>,
    /// How many lines of a stream there are.
    pub samples: u64,
    /// What the taxels held when the recording began, ticks by index, 65 535 where a taxel was not heard of; where it says.
    pub held: Option<Vec<u16>>,
}

impl Remarks {
    /// Takes the next message; of a datagram and a picture only that there is one.
    pub fn take(&mut self, message: &Message<'_>) {
        match message.topic {
            Topic::Datagrams => {
                self.datagrams += 1;
                self.datagram_bytes += message.data.len() as u64;
                let (first, last) = self.arrivals.unwrap_or((message.at_ns, message.at_ns));
                self.arrivals = Some((first.min(message.at_ns), last.max(message.at_ns)));
            }
            Topic::Pressure => self.pictures += 1,
            // A message that does not parse has a sound checksum: another program wrote it, and it is left alone.
            Topic::Registers => {
                if let Ok(said) = serde_json::from_slice(message.data) {
                    self.registers.push((message.at_ns, said));
                }
            }
            Topic::Markers => {
                if let Ok(said) = serde_json::from_slice::<Value>(message.data)
                    && let (Some(t), Some(start)) = (said["t_us"].as_i64(), said["start"].as_bool())
                {
                    self.markers.push(Marker { t, start });
                }
            }
            Topic::Notes => {
                if let Ok(said) = serde_json::from_slice::<Value>(message.data)
                    && let Some(text) = said["message"].as_str()
                {
                    let t_us = said["t_us"].as_i64();
                    if let Some(zeroing) = zeroing(t_us, &said["zeroed"]) {
                        self.zeroings.push((message.at_ns, zeroing));
                        return;
                    }
                    self.notes.push(Note { at_ns: message.at_ns, t_us, text: text.to_owned() });
                }
            }
            Topic::Detections => {
                if let Ok(said) = serde_json::from_slice::<Value>(message.data)
                    && let (Some(label), Some(t), Some(known)) =
                        (said["label"].as_str(), said["t_us"].as_i64(), said["known_us"].as_i64())
                {
                    // JSON has no NaN: a slope that is not known is written as null.
                    let slope = said["slope"].as_f64().unwrap_or(f64::NAN);
                    let (label, repaired) = (label.to_owned(), said["repaired"].as_bool().unwrap_or(false));
                    self.detections.push((message.at_ns, Detection { label, t, known, slope, repaired }));
                }
            }
            Topic::Held => {
                self.held = held(message.data).or(self.held.take());
            }
            Topic::Board => {
                if let Ok(said) = serde_json::from_slice::<BoardChange>(message.data) {
                    self.board.push(BoardChange { at_ns: message.at_ns, ..said });
                }
            }
            Topic::Samples => self.samples += 1,
            Topic::Counts => self.counts = serde_json::from_slice(message.data).ok().or(self.counts.take()),
        }
    }
}

/// What a message says that the taxels held, ticks by taxel index; 65 535 of one that was never heard of.
fn held(data: &[u8]) -> Option<Vec<u16>> {
    let said: Value = serde_json::from_slice(data).ok()?;
    let ticks = unbase64(said["ticks"].as_str()?)?;
    Some(ticks.chunks_exact(2).map(|two| u16::from_le_bytes([two[0], two[1]])).collect())
}

/// Tells a decoder what the taxels held before the recording's first datagram.
pub(crate) fn begin_with(receiver: &mut wire::Receiver, data: &[u8]) {
    if let Some(held) = held(data) {
        receiver.begin_with(held.iter().map(|ticks| (*ticks != u16::MAX).then_some(*ticks)));
    }
}

/// Marks events as repaired by their numbers; a number that is none of an event is left out.
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

/// The taxel that a note says to have been zeroed; `None` of any other note.
fn zeroing(t_us: Option<i64>, said: &Value) -> Option<Zeroing> {
    let whole = |key: &str| said[key].as_u64().and_then(|n| u16::try_from(n).ok());
    let (t, x, y) = (t_us?, whole("x")?, whole("y")?);
    Some(Zeroing { t, x, y, rest: said["rest"].as_f64()?, before: said["before"].as_f64() })
}

/// A chunk, or a run of records outside chunks (as other tools may write them).
#[derive(Debug, Clone, Copy)]
struct Block {
    offset: u64,
    length: u64,
    bare: bool,
}

impl Reader {
    /// Opens a file and rebuilds its index; a file that is still being written is read up to now.
    ///
    /// # Errors
    ///
    /// `File` where it cannot be read; `Core` (format) where it is no MCAP file, or not one of ours.
    pub fn open(path: &Path) -> Result<Self> {
        let file = File::open(path).map_err(Error::file(path))?;
        let length = file.metadata().map_err(Error::file(path))?.len();
        let mut walk = Walk::of(path, &file, length);
        walk.magic()?;
        walk.records()?;
        let Walk { begin, end, ending, ends, blocks, rebuilt, .. } = walk;
        let blocks = Blocks { path: path.to_owned(), file, length, places: blocks };
        // The copy beside the datagrams' channel has a checksum, the others have not.
        let Some(header) = blocks.header()?.or(end).or(begin) else {
            return Err(format(
                path,
                "an MCAP file without the header of a taxel recording (metadata record \"taxel\")",
            ));
        };
        header.check().map_err(|error| format(path, &format!("header: {error}")))?;
        let (blocks, header, ends) = (Arc::new(blocks), Arc::new(header), Arc::new(ends));
        Ok(Self { blocks, header, source: 0, ending, ends, rebuilt })
    }

    /// The names of the sources; the first is the one that this reads at first.
    pub fn sources(&self) -> impl Iterator<Item = &str> {
        std::iter::once(&*self.header).chain(&self.header.sources).map(|source| source.name.as_str())
    }

    /// The same recording as one of its sources has it.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` where there is none of that name.
    pub fn of_source(&self, name: &str) -> Result<Self> {
        let Some(source) = self.sources().position(|known| known == name) else {
            let known: Vec<&str> = self.sources().collect();
            let path = self.blocks.path.display();
            return Err(problem!("{path}: holds no source {name:?}; there are {}", known.join(", ")).into());
        };
        let ending = match &self.ending {
            Some(Ending::Finished { .. }) if source != 0 => {
                self.ends.get(name).map(|counts| Ending::Finished { counts: counts.clone(), verdict: counts.verdict() })
            }
            whole => whole.clone(),
        };
        Ok(Self { source, ending, ..self.clone() })
    }

    /// What the source says of itself.
    #[must_use]
    pub fn header(&self) -> &Header {
        if self.source == 0 { &self.header } else { &self.header.sources[self.source - 1] }
    }

    /// How it ended, where it says so.
    #[must_use]
    pub fn ending(&self) -> Option<&Ending> {
        self.ending.as_ref()
    }

    /// What opening had to put up with; what is wrong inside a chunk shows when it is read.
    #[must_use]
    pub fn rebuilt(&self) -> Rebuilt {
        self.rebuilt
    }

    /// Hands out all messages in the order of the file; a bad chunk is skipped. Gives how many were.
    ///
    /// # Errors
    ///
    /// `File` where the file cannot be read, `Core` where `take` says so or the caller stops.
    pub fn messages(&self, stop: Stop<'_>, mut take: impl FnMut(Message<'_>) -> Result<()>) -> Result<u64> {
        let (mut place, mut bad) = (Place::default(), 0);
        for block in 0..self.blocks() {
            stop.check()?;
            bad += u64::from(!self.block(block, &mut place, &mut take)?);
        }
        Ok(bad)
    }

    /// How many blocks (chunks) there are.
    #[must_use]
    pub fn blocks(&self) -> usize {
        self.blocks.places.len()
    }

    /// Hands out the messages of one block; `place` is what reading the blocks before it, or some of them, left. Gives
    /// whether the block is sound.
    ///
    /// # Errors
    ///
    /// As [`Reader::messages`].
    pub fn block(
        &self,
        block: usize,
        place: &mut Place,
        mut take: impl FnMut(Message<'_>) -> Result<()>,
    ) -> Result<bool> {
        let (block, most) = (self.blocks.places[block], limits::datagrams(self.blocks.length));
        let Place { topics, last, in_datagrams, bytes } = place;
        let mut wrong = None;
        let sound = self.blocks.records(block, bytes, |record| {
            match record {
                Record::Channel(channel) => {
                    topics.insert(channel.id, Topic::of_name(&channel.topic, self.source, &self.header().name));
                }
                Record::Message { header, data } => {
                    let topic = topics.get(&header.channel_id).copied();
                    if let Some(topic) = topic.unwrap_or_else(|| Topic::of_number(header.channel_id, self.source)) {
                        let mut number = u64::from(header.sequence);
                        if matches!(topic, Topic::Datagrams | Topic::Samples) {
                            number = unwrap(*last, header.sequence);
                            *last = number;
                            *in_datagrams += data.len() as u64;
                            if *in_datagrams > most {
                                wrong = Some(format(
                                    &self.blocks.path,
                                    &format!(
                                        "chunk at byte {}: the datagrams up to here unpack to more than {most} bytes \
                                         (100 times the file and 64 MiB)",
                                        block.offset
                                    ),
                                ));
                                return false;
                            }
                        }
                        let at_ns = i64::try_from(header.log_time).unwrap_or(i64::MAX);
                        wrong = take(Message { topic, number, at_ns, data: &data }).err();
                    }
                }
                _ => {}
            }
            wrong.is_none()
        })?;
        wrong.map_or(Ok(sound), Err)
    }

    /// Collects everything but the datagrams' bytes and the pictures. Gives how many chunks are bad, too.
    ///
    /// # Errors
    ///
    /// As [`Reader::messages`].
    pub fn remarks(&self, stop: Stop<'_>) -> Result<(Remarks, u64)> {
        let mut all = Remarks::default();
        let bad = self.messages(stop, |message| {
            all.take(&message);
            Ok(())
        })?;
        Ok((all, bad))
    }

    /// All datagrams as they came.
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
            }
            Ok(())
        })?;
        Ok(all)
    }

    /// All samples of a stream.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` where the source is a board; else as [`Reader::messages`].
    pub fn samples(&self, stop: Stop<'_>) -> Result<Samples> {
        let Some(stream) = &self.header().stream else {
            return Err(problem!("source {}: a board has no samples", self.header().name).into());
        };
        let mut sampling = Sampling::new(stream);
        self.messages(stop, |message| {
            if message.topic == Topic::Samples {
                sampling.take(message.at_ns, message.number, message.data);
            }
            Ok(())
        })?;
        Ok(sampling.finish())
    }

    /// Decodes all datagrams.
    ///
    /// # Errors
    ///
    /// As [`Reader::messages`].
    pub fn decode(&self, pairing: Pairing, stop: Stop<'_>) -> Result<Decoded> {
        let header = self.header();
        let array = header.array.clone();
        let decoder = Decoder::new(array.clone()).pairing(pairing).differences(header.difference);
        let mut sender = wire::Receiver::new(decoder, 1);
        let mut decoded = Decoded::empty(Events::empty(array));
        #[allow(clippy::cast_possible_truncation)]
        let frame_us = header.registers.map_or(0, |registers| registers.frame_us() as i64);
        let bad = self.messages(stop, |message| {
            if message.topic == Topic::Datagrams {
                let before = decoded.events.len();
                let arrived = Some(message.at_ns / 1000);
                let took = sender.push(message.data, arrived, &mut decoded.events);
                let last = decoded.events.t.get(before..).and_then(<[i64]>::last).copied();
                let left = leaves(&took, last, message.data.len(), frame_us).map_or(i64::MIN, |t| t + header.origin_us);
                decoded.left.push(left);
                decoded.arrived_ns.push(message.at_ns);
                decoded.number.push(message.number);
                decoded.first.push(before as u64);
            }
            if message.topic == Topic::Held {
                begin_with(&mut sender, message.data);
            }
            // What the host told the board cannot be seen from its datagrams.
            if message.topic == Topic::Board
                && let Ok(BoardChange { change: Change::Wire { version, asked: true }, .. }) =
                    serde_json::from_slice(message.data)
            {
                sender.expect(version, &mut decoded.events);
            }
            Ok(())
        })?;
        sender.finish_into(&mut decoded.events);
        mark_repaired(&mut decoded.events, &header.repaired);
        decoded.events.t.iter_mut().for_each(|t| *t += header.origin_us);
        decoded.events.markers.iter_mut().for_each(|m| m.t += header.origin_us);
        decoded.counts = *sender.counts();
        decoded.version_2 = sender.two().counts();
        decoded.bad_chunks = bad;
        Ok(decoded)
    }
}

/// Where the messages of a file are.
#[derive(Debug)]
struct Blocks {
    path: PathBuf,
    file: File,
    length: u64,
    places: Vec<Block>,
}

impl Blocks {
    /// The header's copy in the first chunk that has one.
    fn header(&self) -> Result<Option<Header>> {
        let (mut bytes, mut header) = (Vec::new(), None);
        for block in &self.places {
            self.records(*block, &mut bytes, |record| {
                if let Record::Channel(channel) = record {
                    header = channel.metadata.get("header").and_then(|text| serde_json::from_str(text).ok());
                }
                header.is_none()
            })?;
            if header.is_some() {
                break;
            }
        }
        Ok(header)
    }

    /// Hands out the records of a block until `take` gives false; gives whether the block is sound.
    fn records(&self, block: Block, bytes: &mut Vec<u8>, mut take: impl FnMut(Record<'_>) -> bool) -> Result<bool> {
        let Ok(length) = usize::try_from(block.length) else { return Ok(false) };
        bytes.resize(length, 0);
        self.file.read_exact_at(bytes, block.offset).map_err(Error::file(&self.path))?;
        let options = LinearReaderOptions::default()
            .with_skip_start_magic(true)
            .with_skip_end_magic(true)
            .with_prevalidate_chunk_crcs(true)
            .with_record_length_limit(length.max(limits::CHUNK as usize));
        let mut reader = LinearReader::new_with_options(options);
        let mut given = 0;
        while let Some(event) = reader.next_event() {
            match event {
                Ok(LinearReadEvent::ReadRequest(wanted)) => {
                    // At the end nothing is given: the reader ends there, or says what is missing.
                    let more = wanted.min(length - given);
                    reader.insert(more).copy_from_slice(&bytes[given..given + more]);
                    reader.notify_read(more);
                    given += more;
                }
                // Nothing else is looked at, and what nobody parses cannot be wrong.
                Ok(LinearReadEvent::Record { opcode, .. }) if !matches!(opcode, op::CHANNEL | op::MESSAGE) => {}
                Ok(LinearReadEvent::Record { data, opcode }) if !texts_fit(opcode, data) => return Ok(false),
                Ok(LinearReadEvent::Record { data, opcode }) => match parse_record(opcode, data) {
                    Ok(record) => {
                        if !take(record) {
                            return Ok(true);
                        }
                    }
                    Err(_) => return Ok(false),
                },
                Err(_) => return Ok(false),
            }
        }
        Ok(true)
    }
}

/// Whether the texts of a channel's or a metadata record end within it: the parser asks for their memory before it looks.
fn texts_fit(opcode: u8, data: &[u8]) -> bool {
    fn text(data: &[u8]) -> Option<&[u8]> {
        let (length, rest) = data.split_first_chunk::<4>()?;
        rest.get(u32::from_le_bytes(*length) as usize..)
    }
    /// A table of texts by name, as long as it says.
    fn table(data: &[u8]) -> Option<()> {
        let (length, rest) = data.split_first_chunk::<4>()?;
        let mut pairs = rest.get(..u32::from_le_bytes(*length) as usize)?;
        while !pairs.is_empty() {
            pairs = text(text(pairs)?)?;
        }
        Some(())
    }
    match opcode {
        // Two numbers of 16 bits, topic, encoding, table.
        op::CHANNEL => data.get(4..).and_then(text).and_then(text).and_then(table).is_some(),
        // Name, table.
        op::METADATA => text(data).and_then(table).is_some(),
        _ => true,
    }
}

/// The walk from record to record.
struct Walk<'a> {
    path: &'a Path,
    file: &'a File,
    length: u64,
    begin: Option<Header>,
    end: Option<Header>,
    ending: Option<Ending>,
    /// What the other sources said at their end.
    ends: BTreeMap<String, Counts>,
    blocks: Vec<Block>,
    /// What the chunks so far say that they unpack to, bytes.
    unpacked: u64,
    rebuilt: Rebuilt,
}

impl<'a> Walk<'a> {
    fn of(path: &'a Path, file: &'a File, length: u64) -> Self {
        let rebuilt = Rebuilt { unfinished: true, ..Rebuilt::default() };
        Self {
            path,
            file,
            length,
            begin: None,
            end: None,
            ending: None,
            ends: BTreeMap::new(),
            blocks: vec![],
            unpacked: 0,
            rebuilt,
        }
    }

    /// Up to `wanted` bytes at `offset`; fewer at the end of the file.
    fn bytes(&self, offset: u64, wanted: u64) -> Result<Vec<u8>> {
        let n = usize::try_from(wanted.min(self.length.saturating_sub(offset))).unwrap_or(0);
        let mut bytes = vec![0; n];
        self.file.read_exact_at(&mut bytes, offset).map_err(Error::file(self.path))?;
        Ok(bytes)
    }

    fn magic(&self) -> Result<()> {
        let start = self.bytes(0, MAGIC.len() as u64)?;
        if start == MAGIC {
            return Ok(());
        }
        if MAGIC.starts_with(&start) {
            let n = start.len();
            return Err(format(self.path, &format!("byte {n}: the file ends inside the MCAP magic, it holds nothing")));
        }
        let hex: Vec<String> = start.iter().take(4).map(|b| format!("{b:02X}")).collect();
        Err(format(self.path, &format!("byte 0: starts with {}, not with the MCAP magic (89 4D 43 41)", hex.join(" "))))
    }

    fn records(&mut self) -> Result<()> {
        let mut at = MAGIC.len() as u64;
        while at < self.length {
            let Some((opcode, length, size)) = self.sound(at)? else {
                match self.next_sound(at + 1)? {
                    Some(next) => {
                        self.rebuilt.gaps += 1;
                        self.rebuilt.skipped_bytes += next - at;
                        at = next;
                        continue;
                    }
                    None => {
                        self.rebuilt.torn_bytes = self.length - at;
                        return Ok(());
                    }
                }
            };
            match opcode {
                op::DATA_END => {
                    self.rebuilt.unfinished = false;
                    return Ok(());
                }
                op::METADATA => self.metadata(at, length)?,
                op::CHUNK if size.max(length) > u64::from(limits::CHUNK) => self.rebuilt.large_chunks += 1,
                op::CHUNK => {
                    self.unpacked += size;
                    let most = limits::unpacked(self.length);
                    if self.unpacked > most {
                        let said = "bytes (1000 times the file and 256 MiB)";
                        return Err(format(
                            self.path,
                            &format!(
                                "chunk at byte {at}: the chunks up to here say that they unpack to more than {most} {said}"
                            ),
                        ));
                    }
                    self.blocks.push(Block { offset: at, length: RECORD_HEAD + length, bare: false });
                }
                op::SCHEMA | op::CHANNEL | op::MESSAGE => match self.blocks.last_mut() {
                    Some(block) if block.bare && block.offset + block.length == at && block.length < 1 << 20 => {
                        block.length += RECORD_HEAD + length;
                    }
                    _ => self.blocks.push(Block { offset: at, length: RECORD_HEAD + length, bare: true }),
                },
                _ => {}
            }
            at += RECORD_HEAD + length;
        }
        Ok(())
    }

    /// Opcode and length of the record at `at`, where they make sense, and what it says that it unpacks to.
    fn sound(&self, at: u64) -> Result<Option<(u8, u64, u64)>> {
        let head = self.bytes(at, 80)?;
        let (Some(&opcode), Some(length)) = (head.first(), number(&head, 1)) else { return Ok(None) };
        let fits = at.checked_add(RECORD_HEAD).and_then(|a| a.checked_add(length)).is_some_and(|e| e <= self.length);
        // What may stand before the end of the data. A flipped bit in an opcode must not hide a chunk, so lengths that can
        // be checked are.
        let known = match opcode {
            op::CHUNK => chunk(&head, length).is_some(),
            op::MESSAGE_INDEX => head.get(11..15).is_some_and(|b| word(b) + 6 == length),
            op::METADATA => head.get(9..13).is_some_and(|b| word(b) + 8 <= length),
            op::DATA_END => length == 4,
            op::HEADER | op::SCHEMA | op::CHANNEL | op::MESSAGE | op::ATTACHMENT => true,
            _ => false,
        };
        let size = if opcode == op::CHUNK { chunk(&head, length).unwrap_or(0) } else { 0 };
        Ok((fits && known).then_some((opcode, length, size)))
    }

    /// The next place from `at` on where a chunk or a metadata record of ours stands.
    fn next_sound(&self, mut at: u64) -> Result<Option<u64>> {
        const WINDOW: u64 = 1 << 20;
        while at < self.length {
            let window = self.bytes(at, WINDOW)?;
            for (k, &byte) in window.iter().enumerate() {
                if byte != op::CHUNK && byte != op::METADATA {
                    continue;
                }
                let place = at + k as u64;
                if let Some((opcode, length, _)) = self.sound(place)? {
                    let ours = || -> Result<bool> {
                        Ok(length < limits::METADATA
                            && self.bytes(place + RECORD_HEAD + 4, BEGIN.len() as u64)? == BEGIN.as_bytes())
                    };
                    if opcode == op::CHUNK || ours()? {
                        return Ok(Some(place));
                    }
                }
            }
            at += window.len() as u64;
        }
        Ok(None)
    }

    fn metadata(&mut self, at: u64, length: u64) -> Result<()> {
        if length > limits::METADATA {
            return Ok(());
        }
        let body = self.bytes(at + RECORD_HEAD, length)?;
        if !texts_fit(op::METADATA, &body) {
            return Ok(());
        }
        let Ok(Record::Metadata(record)) = parse_record(op::METADATA, &body) else { return Ok(()) };
        let header = record.metadata.get("header").and_then(|text| serde_json::from_str(text).ok());
        match record.name.as_str() {
            BEGIN => self.begin = header,
            END => {
                self.end = header;
                let ends = record.metadata.iter().filter_map(|(key, text)| {
                    Some((key.strip_prefix("counts.")?.to_owned(), serde_json::from_str(text).ok()?))
                });
                self.ends = ends.collect();
                self.ending = match record.metadata.get("stopped") {
                    Some(why) => Some(Ending::Stopped(why.clone())),
                    None => record.metadata.get("counts").and_then(|text| serde_json::from_str(text).ok()).map(
                        |counts: Counts| Ending::Finished {
                            verdict: record.metadata.get("verdict").cloned().unwrap_or_else(|| counts.verdict()),
                            counts,
                        },
                    ),
                };
            }
            _ => {}
        }
        Ok(())
    }
}

/// What a chunk says that it unpacks to, where the lengths inside its header agree with the record's.
fn chunk(head: &[u8], length: u64) -> Option<u64> {
    // opcode 1, length 8, start 8, end 8, size 8, checksum 4, name of the compression, packed size 8
    const NAME: usize = 37;
    let name_bytes = head.get(NAME..NAME + 4).map(|b| word(b) as usize).filter(|&n| n <= 16)?;
    let packed = number(head, NAME + 4 + name_bytes)?;
    let rest = (NAME + 4 + name_bytes + 8) as u64 - RECORD_HEAD;
    if packed.checked_add(rest) == Some(length) { number(head, 25) } else { None }
}

/// The 64-bit number at `place`.
fn number(bytes: &[u8], place: usize) -> Option<u64> {
    bytes.get(place..place + 8).and_then(|b| b.try_into().ok()).map(u64::from_le_bytes)
}

/// The 32-bit number in four bytes.
fn word(bytes: &[u8]) -> u64 {
    bytes.iter().rev().fold(0, |word, &byte| word << 8 | u64::from(byte))
}

/// The number with these low 32 bits that is nearest to the last one.
fn unwrap(last: u64, low: u32) -> u64 {
    #[allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap)]
    let step = i64::from(low.wrapping_sub(last as u32) as i32);
    last.checked_add_signed(step).unwrap_or(u64::from(low))
}

/// An error about the content of a file.
fn format(path: &Path, said: &str) -> Error {
    taxel_core::Error::Format(format!("{}: {said}", path.display())).into()
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
