//! The keyframe index of a recording of any length.
//!
//! A keyframe contains a copy of the decoder, so that decoding continues with its clock, sequence numbers and pending
//! events as they were.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use crossbeam_channel as channel;
use taxel_core::wire::{self, Decoder};
use taxel_core::{Array, Events, problem};

use super::event_rate::EventRate;
use super::{Activity, ChangeReader, KeyframeIndex, ReadOutcome};
use crate::array_state::{ArrayState, Keyframe};
use crate::time_columns::{COLUMN_US, TimeColumns, column_of};
use taxel_core::held::UNKNOWN;
use taxel_core::rest::{LOADED_TICKS, preload, preload_text};
use taxel_live::Result;
use taxel_live::clock::{BoardClock, Pace, leaves};
use taxel_live::pipeline::TaxelChange;
use taxel_live::recording::{
    Basis, Condition, Found, Header, ReadPosition, Reader, Remarks, Topic, Verdict, begin_with,
};

/// Memory that the keyframes of a recording may take, bytes.
const KEYFRAME_BYTES: usize = 128 << 20;
/// Memory that its raster and curves may take, bytes.
const TIME_COLUMN_BYTES: usize = 256 << 20;

/// Minimum distance between keyframes, bytes of the file.
const SPACING: u64 = 1 << 16;

/// Decoded blocks that may wait for the indexing thread.
const AHEAD: usize = 4;

/// A keyframe, and the decoder as it is before the next block.
#[derive(Debug)]
struct Key {
    block: usize,
    position: ReadPosition,
    decoder: wire::SenderDecoder,
    keyframe: Keyframe,
}

/// An indexed recording.
#[derive(Debug)]
pub struct RecordingIndex {
    path: PathBuf,
    reader: Reader,
    header: Header,
    keys: Vec<Key>,
    time_columns: Option<TimeColumns>,
    range: Option<(i64, i64)>,
    /// Number of events.
    pub events: u64,
    /// Number of events over time: start and width of a bin (us), counts.
    pub event_rate: (i64, i64, Vec<u64>),
    /// Event counts of each taxel.
    pub activity: Activity,
    /// Notes, markers, detections, registers.
    pub remarks: Remarks,
    /// The drift and the delays that its datagrams' arrivals show.
    pub pace: Option<Pace>,
    /// Where something lay in the quiet stretch that the rest is first taken from, for people; empty where nothing did.
    pub preload_at: String,
    /// One line that states what was lost.
    pub verdict: String,
    /// Whether the end of the file is missing.
    pub unfinished: bool,
}

impl RecordingIndex {
    /// Reads a recording once and indexes it.
    ///
    /// # Errors
    ///
    /// `File` where it cannot be read, `Core` where it is not a recording.
    pub fn open(path: &Path) -> Result<Arc<Self>> {
        Self::of_reader(path, Reader::open(path)?)
    }

    fn of_reader(path: &Path, reader: Reader) -> Result<Arc<Self>> {
        let (header, unfinished) = (reader.header().clone(), reader.rebuilt().unfinished);
        let header_array = header.array.clone();
        let mut index = Self {
            path: path.to_owned(),
            reader,
            header,
            keys: vec![],
            time_columns: None,
            range: None,
            events: 0,
            event_rate: (0, COLUMN_US, vec![]),
            activity: Activity::new(&header_array),
            remarks: Remarks::default(),
            pace: None,
            preload_at: String::new(),
            verdict: String::new(),
            unfinished,
        };
        index.build()?;
        Ok(Arc::new(index))
    }

    /// The index of a `.mcap` of a board's events; `None` for any other file, those of other programs among them.
    ///
    /// # Errors
    ///
    /// As [`RecordingIndex::open`].
    pub fn of_a_board(path: &Path) -> Result<Option<Arc<Self>>> {
        let is_mcap = path.extension().is_some_and(|ending| ending == "mcap");
        let reader = if is_mcap { Reader::open(path).ok() } else { None };
        let board = reader.filter(|reader| reader.header().frames.is_none());
        board.map(|reader| Self::of_reader(path, reader)).transpose()
    }

    /// The header of the file.
    #[must_use]
    pub fn header(&self) -> &Header {
        &self.header
    }

    fn noise_floor(&self) -> u16 {
        self.header.registers.map_or(0, |registers| registers.noise_floor.into())
    }

    fn decoder(&self) -> wire::SenderDecoder {
        let decoder = Decoder::new(self.header.array.clone()).differences(self.header.decoding.difference);
        wire::SenderDecoder::new(decoder, 1)
    }

    /// Decodes a block, with the pending events after the last one, and notes what else it holds. Returns the number of
    /// bytes decoded.
    fn block(
        &self,
        k: usize,
        position: &mut ReadPosition,
        decoder: &mut wire::SenderDecoder,
        events: &mut Events,
        mut beside: Option<&mut Contents>,
    ) -> Result<u64> {
        let mut bytes = 0;
        // A frame is shorter than a second.
        #[allow(clippy::cast_possible_truncation)]
        let frame_us = self.header.registers.map_or(0, |registers| registers.frame_us() as i64);
        let is_valid = self.reader.block(k, position, |message| {
            if message.topic == Topic::Datagrams {
                let before = events.len();
                let info = decoder.push(message.data, Some(message.at_ns / 1000), events);
                let last = events.t[before..].last().copied();
                let left = leaves(&info, last, message.data.len(), frame_us);
                if let (Some(contents), Some(left)) = (&mut beside, left) {
                    contents.clock.note(left, message.at_ns);
                }
                bytes += message.data.len() as u64;
            } else if message.topic == Topic::Held {
                begin_with(decoder, message.data);
            } else if message.topic == Topic::Pressure {
                return Ok(());
            }
            if let Some(contents) = &mut beside {
                contents.remarks.add(&message);
            }
            Ok(())
        })?;
        if let Some(contents) = beside {
            contents.bad_chunks += u64::from(!is_valid);
        }
        if k + 1 == self.reader.blocks() {
            decoder.finish_into(events);
        }
        Ok(bytes)
    }

    fn changes(&self, events: &Events, out: &mut Vec<TaxelChange>) {
        let columns = usize::from(self.header.array.columns);
        out.extend((0..events.len()).map(|k| {
            let ticks = match &events.intensity {
                Some(intensity) if intensity.present[k] => intensity.ticks[k],
                _ => UNKNOWN,
            };
            // A sensor has 2^22 taxels at most (recording's limits).
            #[allow(clippy::cast_possible_truncation)]
            let taxel = (usize::from(events.y[k]) * columns + usize::from(events.x[k])) as u32;
            TaxelChange {
                t: events.t[k] + self.header.decoding.origin_us,
                taxel,
                ticks,
                up: events.p[k],
                repaired: events.is_repaired(k),
            }
        }));
    }

    /// Reads the whole file once: another thread decodes, this one builds keyframes.
    fn build(&mut self) -> Result<()> {
        let taxels = self.header.array.len();
        let mut state = ArrayState::new(
            &self.header.array,
            self.noise_floor(),
            &Keyframe::blank(taxels),
            COLUMN_US,
            TIME_COLUMN_BYTES,
        );
        let mut keys: Vec<Key> = vec![];
        let (decoded, blocks) = channel::bounded(AHEAD);
        let index = &*self;
        let contents = std::thread::scope(|scope| {
            let decoding = scope.spawn(move || index.decode_all(&decoded));
            for DecodedBlock { key, thin, held, changes } in blocks {
                keys.extend(key.map(|(block, position, decoder)| Key {
                    block,
                    position,
                    decoder,
                    keyframe: state.keyframe(),
                }));
                if thin {
                    let mut odd = false;
                    keys.retain(|_| {
                        odd = !odd;
                        odd
                    });
                }
                if let Some(held) = held.filter(|_| state.events() == 0) {
                    // A recording begun in mid-stream starts with the held values, before all datagrams of the first block.
                    state.set_held(&held, 0);
                    if let Some(key) = keys.first_mut() {
                        key.keyframe = state.keyframe();
                    }
                }
                state.apply(&changes);
            }
            decoding.join().unwrap_or_else(|_| Err(problem!("indexing failed within taxel; please report it").into()))
        })?;
        self.keys = keys;
        self.events = state.events();
        self.range = contents.first.zip(state.latest());
        self.event_rate = contents.event_rate.into_bins();
        self.activity = contents.activity;
        self.remarks = contents.remarks;
        self.verdict = contents.verdict;
        self.pace = contents.clock.pace();
        let columns = usize::from(self.header.array.columns);
        self.preload_at = preload_text(&preload(&state.rests_less(), columns, LOADED_TICKS), columns, (0, 0));
        state.update_curve();
        let columns = state.time_columns().clone();
        let complete =
            columns.reach().zip(contents.first).is_none_or(|((begin, _), first)| begin <= column_of(first, COLUMN_US));
        self.time_columns = complete.then_some(columns);
        Ok(())
    }

    /// Decodes the whole file, block by block.
    fn decode_all(&self, to: &channel::Sender<DecodedBlock>) -> Result<Contents> {
        let taxels = self.header.array.len();
        let (mut decoder, mut position) = (self.decoder(), ReadPosition::default());
        // Beside the held values and how the rest is tracked, a decoder of version 2 stores the last 65 536 sequence
        // numbers.
        let each = 64 * taxels + (80 << 10);
        let (mut spacing, mut since, mut keys) = (SPACING, u64::MAX, 0);
        let mut events = Events::empty(self.header.array.clone());
        let mut contents = Contents {
            first: None,
            event_rate: EventRate::default(),
            activity: Activity::new(&self.header.array),
            remarks: Remarks::default(),
            clock: BoardClock::default(),
            bad_chunks: 0,
            verdict: String::new(),
        };
        for k in 0..self.reader.blocks() {
            let mut piece = DecodedBlock { key: None, thin: false, held: None, changes: vec![] };
            if since >= spacing {
                (since, keys) = (0, keys + 1);
                piece.key = Some((k, position.clone_counts(), decoder.clone()));
                if keys * each > KEYFRAME_BYTES {
                    (piece.thin, keys, spacing) = (true, keys.div_ceil(2), 2 * spacing);
                }
            }
            events.clear();
            let held_before = contents.remarks.held.is_some();
            let bytes = self.block(k, &mut position, &mut decoder, &mut events, Some(&mut contents))?;
            since = since.saturating_add(bytes);
            if !held_before {
                piece.held = contents.remarks.held.clone().filter(|held| held.len() == taxels);
                let known = piece.held.iter().flatten().enumerate();
                known.for_each(|(taxel, &ticks)| contents.activity.set_held(taxel, ticks));
            }
            self.changes(&events, &mut piece.changes);
            for change in &piece.changes {
                contents.activity.count(change);
            }
            for together in piece.changes.chunk_by(|change, next| change.t == next.t) {
                let t = together[0].t;
                contents.first = Some(contents.first.map_or(t, |first: i64| first.min(t)));
                contents.event_rate.add(t, together.len() as u64);
            }
            if to.send(piece).is_err() {
                break;
            }
        }
        contents.verdict = self.verdict_on(&contents, &decoder).text();
        Ok(contents)
    }

    /// What was lost, as `Recording.verdict` states it in Python.
    fn verdict_on(&self, contents: &Contents, decoder: &wire::SenderDecoder) -> Verdict {
        let decoded = Some(Found::of_sender(decoder, self.header.decoding.origin_us));
        let condition = self.reader.condition(&contents.remarks, contents.bad_chunks);
        Verdict::new(Basis::File(Box::new(Condition { decoded, ..condition })))
    }
}

/// A decoded block.
struct DecodedBlock {
    /// Where decoding can begin again: the block, and the reader and decoder before it.
    key: Option<(usize, ReadPosition, wire::SenderDecoder)>,
    /// The keyframes take too much memory: every second one is to be dropped.
    thin: bool,
    /// Held values at the start of the recording.
    held: Option<Vec<u16>>,
    changes: Vec<TaxelChange>,
}

/// Contents of a whole recording beside its changes.
struct Contents {
    first: Option<i64>,
    event_rate: EventRate,
    activity: Activity,
    remarks: Remarks,
    clock: BoardClock,
    bad_chunks: u64,
    verdict: String,
}

struct RecordingChanges {
    index: Arc<RecordingIndex>,
    block: usize,
    position: ReadPosition,
    decoder: wire::SenderDecoder,
    events: Events,
}

impl ChangeReader for RecordingChanges {
    fn read(&mut self, out: &mut Vec<TaxelChange>) -> Result<ReadOutcome> {
        if self.block >= self.index.reader.blocks() {
            return Ok(ReadOutcome::End);
        }
        self.events.clear();
        self.index.block(self.block, &mut self.position, &mut self.decoder, &mut self.events, None)?;
        self.block += 1;
        self.index.changes(&self.events, out);
        Ok(ReadOutcome::Changes)
    }
}

impl KeyframeIndex for Arc<RecordingIndex> {
    fn array(&self) -> &Array {
        &self.header.array
    }

    fn noise_floor(&self) -> u16 {
        RecordingIndex::noise_floor(self)
    }

    fn range(&self) -> Option<(i64, i64)> {
        self.range
    }

    fn open(&self, t: i64) -> Result<(Keyframe, Box<dyn ChangeReader>)> {
        let index = self.keys.partition_point(|key| key.keyframe.latest.is_none_or(|latest| latest <= t)).max(1) - 1;
        let Some(Key { block, position, decoder, keyframe }) = self.keys.get(index) else {
            return Err(problem!("{}: contains no events", self.path.display()).into());
        };
        let reader = RecordingChanges {
            index: Arc::clone(self),
            block: *block,
            position: position.clone(),
            decoder: decoder.clone(),
            events: Events::empty(self.header.array.clone()),
        };
        Ok((keyframe.clone(), Box::new(reader)))
    }

    fn keyframe_before(&self, t: i64) -> Option<i64> {
        self.keys.iter().rev().filter_map(|key| key.keyframe.latest).find(|&latest| latest < t)
    }

    fn time_columns(&self) -> Option<&TimeColumns> {
        self.time_columns.as_ref()
    }

    fn events_before(&self, t: i64) -> u64 {
        let index = self.keys.partition_point(|key| key.keyframe.latest.is_none_or(|latest| latest <= t)).max(1) - 1;
        self.keys.get(index).map_or(0, |key| key.keyframe.events)
    }
}

#[cfg(test)]
pub(crate) mod tests;
