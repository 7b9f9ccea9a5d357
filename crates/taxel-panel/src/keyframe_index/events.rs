//! The keyframe index of a recording's events: decoded once, and read on from what the array held before some of them.

use std::path::Path;

use crossbeam_channel as channel;
use taxel_core::held::UNKNOWN;
use taxel_core::rest::{LOADED_TICKS, preload, preload_text};
use taxel_core::{Array, Events, EventsView, Stop, problem};
use taxel_live::Result;
use taxel_live::pipeline::TaxelChange;
use taxel_live::recording::{DecodedRecording, Reader, Remarks, Topic};

use super::change_blocks::ChangeBlocks;
use super::event_rate::EventRate;
use super::{Activity, Block, KeyframeIndex};
use crate::array_state::{ArrayState, Keyframe};
use crate::time_columns::{COLUMN_US, TimeColumns, column_of};

/// Memory that the keyframes of a recording may take, bytes.
const KEYFRAME_BYTES: usize = 128 << 20;
/// Memory that its raster and curves may take, bytes.
const TIME_COLUMN_BYTES: usize = 256 << 20;

/// Events in a block, before which there may be a keyframe.
const EVENTS: usize = 1 << 16;

/// Decoded blocks that may wait for the indexing thread.
const AHEAD: usize = 4;

/// The events of a recording, indexed.
#[derive(Debug)]
pub struct EventIndex {
    array: Array,
    noise_floor: u16,
    blocks: ChangeBlocks,
    /// What the array held before a block, ascending.
    keys: Vec<(usize, Keyframe)>,
    time_columns: Option<TimeColumns>,
    range: Option<(i64, i64)>,
    /// Number of events over time: start and width of a bin (us), counts.
    pub event_rate: (i64, i64, Vec<u64>),
    /// Where something lay in the quiet stretch that the rest is first taken from, for people; empty where nothing did.
    pub preload_at: String,
}

/// Where the changes of a recording are kept.
#[derive(Debug, Clone, Copy)]
pub struct Kept<'a> {
    /// As many bytes as may be in memory.
    pub memory: u64,
    /// More are in a temporary file in this folder, or in that of the system where this one cannot be written.
    pub folder: &'a Path,
}

impl EventIndex {
    /// Decodes the datagrams of a board and indexes their events. Returns also what else there is in the recording, and what
    /// decoding found.
    ///
    /// # Errors
    ///
    /// `File` where the recording cannot be read; `Core(Problem)` where the temporary file cannot be made or has no room.
    pub fn of_board(reader: &Reader, kept: Kept<'_>) -> Result<(Self, Remarks, DecodedRecording)> {
        let header = reader.header();
        let noise_floor = header.registers.map_or(0, |registers| registers.noise_floor.into());
        let mut indexing = Indexing::new(&header.array, noise_floor, kept);
        let (decoded, pieces) = channel::bounded(AHEAD);
        let (remarks, rest, rate) = std::thread::scope(|scope| {
            let decoding = scope.spawn(move || decode(reader, &decoded));
            pieces.into_iter().try_for_each(|piece| match piece {
                Piece::Held(held) => {
                    indexing.begin_with(&held);
                    Ok(())
                }
                Piece::Changes(changes) => indexing.push(changes),
            })?;
            decoding.join().unwrap_or_else(|_| Err(problem!("indexing failed within taxel; please report it").into()))
        })?;
        Ok((indexing.finish(rate), remarks, rest))
    }

    /// Indexes events, before which the taxels held these values, if that is known.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` for events outside the array, and where the temporary file cannot be made or has no room.
    pub fn of_events(events: EventsView<'_>, held: Option<&[u16]>, noise_floor: u16, kept: Kept<'_>) -> Result<Self> {
        events.check()?;
        let mut indexing = Indexing::new(events.array, noise_floor, kept);
        indexing.begin_with(held.unwrap_or_default());
        let mut rate = EventRate::default();
        events.pieces(EVENTS).try_for_each(|piece| {
            let changes = changes(piece);
            rate.add(&changes);
            indexing.push(changes)
        })?;
        Ok(indexing.finish(rate))
    }

    /// Number of events.
    #[must_use]
    pub fn events(&self) -> u64 {
        self.blocks.changes()
    }

    /// Counts by which dead, stuck and noisy taxels are found.
    ///
    /// # Errors
    ///
    /// `File` where the temporary file cannot be read.
    pub fn activity(&self) -> Result<Activity> {
        let mut activity = Activity::new(&self.array);
        let begin = self.keys.first().map_or(&[][..], |(_, keyframe)| &keyframe.held);
        begin.iter().enumerate().for_each(|(taxel, &ticks)| activity.set_held(taxel, ticks));
        for block in 0..self.blocks.len() {
            self.blocks.read(block)?.iter().flatten().for_each(|change| activity.count(change));
        }
        Ok(activity)
    }

    /// The last keyframe at or before `t`, or the first one.
    fn key(&self, t: i64) -> Option<&(usize, Keyframe)> {
        let after = self.keys.partition_point(|(_, keyframe)| keyframe.latest.is_none_or(|latest| latest <= t));
        self.keys.get(after.max(1) - 1)
    }
}

/// What a recording holds, in the order of the file.
enum Piece {
    /// The values that taxels held before its first event.
    Held(Vec<u16>),
    Changes(Vec<TaxelChange>),
}

/// Decodes a recording, and passes its events on in blocks; counts them over time.
fn decode(reader: &Reader, to: &channel::Sender<Piece>) -> Result<(Remarks, DecodedRecording, EventRate)> {
    let send = |piece| -> Result<()> { to.send(piece).map_err(|_| problem!("indexing ended early").into()) };
    let (mut remarks, mut begun, mut rate) = (Remarks::default(), false, EventRate::default());
    let mut flush = |events: &mut Events| {
        let changes = changes(events.view());
        rate.add(&changes);
        events.clear();
        send(Piece::Changes(changes))
    };
    let mut decoded = reader.decode_each(Stop::never(), |message, events| {
        remarks.add(message);
        if message.topic == Topic::Held && !begun && events.is_empty() {
            send(Piece::Held(remarks.held.clone().unwrap_or_default()))?;
        }
        if events.len() >= EVENTS {
            begun = true;
            flush(events)?;
        }
        Ok(())
    })?;
    flush(&mut decoded.events)?;
    Ok((remarks, decoded, rate))
}

fn changes(events: EventsView<'_>) -> Vec<TaxelChange> {
    let columns = usize::from(events.array.columns);
    let change = |k: usize| TaxelChange {
        t: events.t[k],
        // A sensor has 2^22 taxels at most (the limits of recordings).
        #[allow(clippy::cast_possible_truncation)]
        taxel: (usize::from(events.y[k]) * columns + usize::from(events.x[k])) as u32,
        ticks: events
            .intensity
            .filter(|intensity| intensity.present[k])
            .map_or(UNKNOWN, |intensity| intensity.ticks[k]),
        up: events.p[k],
        repaired: events.is_repaired(k),
    };
    (0..events.len()).map(change).collect()
}

/// An index that is being built.
struct Indexing {
    array: Array,
    noise_floor: u16,
    blocks: ChangeBlocks,
    keys: Vec<(usize, Keyframe)>,
    /// Blocks from one keyframe to the next.
    spacing: usize,
    state: ArrayState,
}

impl Indexing {
    fn new(array: &Array, noise_floor: u16, kept: Kept<'_>) -> Self {
        let blank = Keyframe::blank(array.len());
        Self {
            array: array.clone(),
            noise_floor,
            blocks: ChangeBlocks::new(kept.folder, kept.memory),
            keys: vec![],
            spacing: 1,
            state: ArrayState::new(array, noise_floor, &blank, COLUMN_US, TIME_COLUMN_BYTES),
        }
    }

    /// Sets the values that the taxels held before the first event; none where they do not fit the array.
    fn begin_with(&mut self, held: &[u16]) {
        if held.len() == self.array.len() {
            self.state.set_held(held, 0);
        }
    }

    fn push(&mut self, changes: Vec<TaxelChange>) -> Result<()> {
        if self.blocks.len().is_multiple_of(self.spacing) {
            self.keys.push((self.blocks.len(), self.state.keyframe()));
            // Beside the held values it stores how the rest is tracked.
            if self.keys.len() * 64 * self.array.len() > KEYFRAME_BYTES {
                self.spacing *= 2;
                self.keys.retain(|(block, _)| block.is_multiple_of(self.spacing));
            }
        }
        self.state.apply(&changes);
        self.blocks.push(changes)
    }

    fn finish(self, rate: EventRate) -> EventIndex {
        let (Self { array, noise_floor, blocks, keys, mut state, .. }, first) = (self, rate.earliest);
        let columns = usize::from(array.columns);
        state.update_curve();
        let stored = state.time_columns().clone();
        let complete = stored.reach().zip(first).is_none_or(|((begin, _), first)| begin <= column_of(first, COLUMN_US));
        EventIndex {
            array,
            noise_floor,
            blocks,
            keys,
            time_columns: complete.then_some(stored),
            range: first.zip(state.latest()),
            event_rate: rate.into_bins(),
            preload_at: preload_text(&preload(&state.rests_less(), columns, LOADED_TICKS), columns, (0, 0)),
        }
    }
}

impl KeyframeIndex for EventIndex {
    fn array(&self) -> &Array {
        &self.array
    }

    fn noise_floor(&self) -> u16 {
        self.noise_floor
    }

    fn range(&self) -> Option<(i64, i64)> {
        self.range
    }

    fn open(&self, t: i64) -> Result<(Keyframe, u64)> {
        let (block, keyframe) = self.key(t).ok_or_else(|| problem!("the recording contains no events"))?;
        Ok((keyframe.clone(), *block as u64))
    }

    fn block(&self, number: u64) -> Result<Option<Block>> {
        let changes = self.blocks.read(usize::try_from(number).unwrap_or(usize::MAX))?;
        Ok(changes.map(|changes| Block { next: number + 1, changes, ..Block::default() }))
    }

    fn keyframe_before(&self, t: i64) -> Option<i64> {
        self.keys.iter().rev().filter_map(|(_, keyframe)| keyframe.latest).find(|&latest| latest < t)
    }

    fn time_columns(&self) -> Option<&TimeColumns> {
        self.time_columns.as_ref()
    }

    fn events_before(&self, t: i64) -> u64 {
        self.key(t).map_or(0, |(_, keyframe)| keyframe.events)
    }
}

#[cfg(test)]
pub(crate) mod tests;
