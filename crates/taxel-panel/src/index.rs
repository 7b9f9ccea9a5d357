//! The index of a source: the changes of a recording, or the latest of a live board, readable from any time on.
//!
//! It stores the changes in blocks, and keyframes: what the array held before some of the blocks. Going on from a keyframe gives
//! the same as going on from the beginning. Of a block of a recording it also has the least and the greatest value of each taxel, so
//! that a window of hours is drawn without its changes.

use std::collections::VecDeque;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard};

use taxel_core::held::UNKNOWN;
use taxel_core::problem;
use taxel_core::rest::{LOADED_TICKS, preload, preload_text};
use taxel_live::Result;
use taxel_live::locked::lock;
use taxel_live::pipeline::TaxelChange;

use crate::activity::Activity;
use crate::block::Block;
use crate::change_file::{BYTES, ChangeFile, TaxelExtent};
use crate::columns::{COLUMN_US, TimeColumns, column_of};
use crate::event_rate::EventRate;
use crate::history::TaxelHistory;
use crate::state::{ArrayState, Keyframe, Sensor};

/// Memory that the keyframes of a recording may take, bytes.
const KEYFRAME_BYTES: usize = 128 << 20;
/// Memory that its raster and curves may take, bytes.
const TIME_COLUMN_BYTES: i64 = 256 << 20;

/// Changes in a block of a recording.
pub(crate) const CHANGES: usize = 1 << 16;

/// What of a source is kept.
#[derive(Debug)]
pub enum Kept {
    /// All of a recording. Changes beyond so many bytes of memory are in a temporary file in this folder, or in that of the system
    /// where this one cannot be written.
    All {
        /// As many bytes as may be in memory.
        memory: u64,
        /// Where the temporary file is.
        folder: PathBuf,
    },
    /// The latest of a live source.
    Latest {
        /// For how long, us.
        us: i64,
        /// How much memory they may take, bytes.
        bytes: usize,
    },
}

/// A block, whose changes and extents are in memory or in the file.
#[derive(Debug)]
struct StoredBlock {
    block: Block,
    /// Number of its changes, and the first and last time of them, us.
    len: usize,
    range: Option<(i64, i64)>,
    /// By taxel; none of a live source, and of a block that has fewer changes than the array has taxels.
    extents: Option<Vec<TaxelExtent>>,
    /// Where it begins in the file, if it is there.
    place: Option<u64>,
}

#[derive(Debug)]
struct Store {
    blocks: VecDeque<StoredBlock>,
    /// Number of the first block.
    first: u64,
    /// The keyframes before blocks of these numbers, ascending. The first block has one.
    keys: VecDeque<(u64, Arc<Keyframe>)>,
    /// Of a recording a block in so many may have a keyframe.
    spacing: u64,
    /// Memory that blocks and keyframes take.
    bytes: usize,
    changes: u64,
    file: Option<ChangeFile>,
    rate: EventRate,
    range: Option<(i64, i64)>,
}

/// The changes of a source, with keyframes.
#[derive(Debug)]
pub struct Index {
    /// The sensor.
    pub sensor: Arc<Sensor>,
    /// Raster and curves of a whole recording, where they do not take too much memory.
    pub whole: Option<Arc<TimeColumns>>,
    /// Where something lay in the quiet stretch that the rest of a recording is first taken from, for people; empty where nothing did.
    pub preload_at: String,
    kept: Kept,
    store: Mutex<Store>,
}

impl Index {
    /// An empty index.
    pub(crate) fn new(sensor: Arc<Sensor>, kept: Kept) -> Self {
        let store = Store {
            blocks: VecDeque::new(),
            first: 0,
            keys: VecDeque::new(),
            spacing: 1,
            bytes: 0,
            changes: 0,
            file: None,
            rate: EventRate::default(),
            range: None,
        };
        Self { sensor, whole: None, preload_at: String::new(), kept, store: Mutex::new(store) }
    }

    fn store(&self) -> MutexGuard<'_, Store> {
        lock(&self.store)
    }

    /// Appends a block, before which the array was in this state, if that is known.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` where the temporary file cannot be made or has no room.
    pub(crate) fn push(&self, key: Option<Keyframe>, block: Block) -> Result<()> {
        let store = &mut *self.store();
        let number = store.first + store.blocks.len() as u64;
        if let Some(key) = key.filter(|_| number.is_multiple_of(store.spacing)) {
            store.bytes += key.bytes();
            store.keys.push_back((number, Arc::new(key)));
        }
        let taxels = self.sensor.array.len();
        let has_extents = matches!(self.kept, Kept::All { .. }) && block.changes.len() >= taxels;
        let times = || block.changes.iter().map(|change| change.t);
        let stored = StoredBlock {
            len: block.changes.len(),
            range: times().min().zip(times().max()),
            extents: has_extents.then(|| extents(&block.changes, taxels)),
            place: None,
            block,
        };
        if let Some((first, last)) = stored.range {
            let (begin, end) = store.range.unwrap_or((first, last));
            store.range = Some((begin.min(first), end.max(last)));
        }
        store.changes += stored.len as u64;
        store.bytes += stored.bytes();
        match &self.kept {
            Kept::All { memory, folder } => {
                store.rate.add(&stored.block.changes);
                store.blocks.push_back(stored);
                store.thin();
                if store.file.is_some() || store.changes * BYTES as u64 > *memory {
                    let file = store.file.take().map_or_else(|| ChangeFile::new(folder), Ok)?;
                    store.write(file)?;
                }
            }
            Kept::Latest { us, bytes } => {
                store.blocks.push_back(stored);
                store.forget(*us, *bytes);
            }
        }
        Ok(())
    }

    /// The last keyframe at or before `t` (us), or the first one, and the number of the block that follows it.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` where there is no keyframe.
    pub(crate) fn open(&self, t: i64) -> Result<(Arc<Keyframe>, u64)> {
        let store = self.store();
        let (number, key) = store.key(t).ok_or_else(|| problem!("no events yet"))?;
        Ok((Arc::clone(key), *number))
    }

    /// The block of a number, which counts up; where that one is forgotten, the first one, after a gap. `None` where no further one
    /// is there yet.
    ///
    /// # Errors
    ///
    /// `File` where the temporary file cannot be read.
    pub(crate) fn next(&self, number: &mut u64) -> Result<Option<Block>> {
        let store = self.store();
        let at = (*number).max(store.first);
        let Some(StoredBlock { block, len, place, .. }) = store.at(at) else { return Ok(None) };
        let mut block = block.clone();
        if let Some((file, begin)) = store.file.as_ref().zip(*place) {
            block.changes = Arc::new(file.changes(begin, *len)?);
        }
        if let Some((_, key)) = store.keys.front().filter(|_| at > *number) {
            block.held = Some((key.held.clone(), key.events));
        }
        *number = at + 1;
        Ok(Some(block))
    }

    /// The number of the next block.
    pub(crate) fn end(&self) -> u64 {
        let store = self.store();
        store.first + store.blocks.len() as u64
    }

    /// First and last time with events, us; `None` without events.
    #[must_use]
    pub fn range(&self) -> Option<(i64, i64)> {
        self.store().range
    }

    /// The last time stamp before `t` that has events, us.
    ///
    /// # Errors
    ///
    /// As [`Index::open`] and [`Index::next`].
    pub(crate) fn stamp_before(&self, t: i64) -> Result<Option<i64>> {
        let mut from = t.saturating_sub(1);
        loop {
            let (_, mut next) = self.open(from)?;
            let mut found = None;
            while let Some(block) = self.next(&mut next)? {
                let earlier = block.changes.iter().map(|change| change.t).take_while(|&at| at < t);
                found = found.max(earlier.max());
                if block.changes.iter().any(|change| change.t >= t) {
                    break;
                }
            }
            let earlier = self.store().keys.iter().rev().filter_map(|(_, key)| key.latest).find(|&key| key < from);
            match (found, earlier) {
                (None, Some(earlier)) => from = earlier,
                _ => return Ok(found),
            }
        }
    }

    /// What a taxel held in columns of `column_us` us, from `since` (us) on or a little before, up to the block of this number. Only
    /// blocks in which it changes and that several columns share are read: of others the extents say all.
    ///
    /// # Errors
    ///
    /// `File` where the temporary file cannot be read.
    pub(crate) fn history(&self, taxel: u32, column_us: i64, since: i64, until: u64) -> Result<TaxelHistory> {
        let Ok((from, mut next)) = self.open(since) else {
            return Ok(TaxelHistory::new(taxel, UNKNOWN, None, column_us));
        };
        let mut history = TaxelHistory::new(taxel, from.held[taxel as usize], from.latest, column_us);
        while next < until {
            match self.extent(next, taxel as usize)? {
                Some((_, [_, _, UNKNOWN])) => next += 1,
                Some(((first, last), extent)) if column_of(first, column_us) == column_of(last, column_us) => {
                    history.extend(first, extent);
                    next += 1;
                }
                _ => match self.next(&mut next)? {
                    Some(block) => history.push(&block.changes),
                    None => break,
                },
            }
        }
        Ok(history)
    }

    /// First and last time of a block that has extents, us, and that of a taxel.
    fn extent(&self, number: u64, taxel: usize) -> Result<Option<((i64, i64), TaxelExtent)>> {
        let store = self.store();
        let Some(StoredBlock { len, range, extents: Some(extents), place, .. }) = store.at(number) else {
            return Ok(None);
        };
        let extent = match store.file.as_ref().zip(*place) {
            Some((file, begin)) => file.extent(begin, *len, taxel)?,
            None => extents[taxel],
        };
        Ok(range.map(|range| (range, extent)))
    }

    /// Number of changes.
    pub(crate) fn changes(&self) -> u64 {
        self.store().changes
    }

    /// Number of events over time: start and width of a bin (us), counts.
    pub(crate) fn event_rate(&self) -> (i64, i64, Vec<u64>) {
        let store = self.store();
        if matches!(self.kept, Kept::All { .. }) {
            return store.rate.bins();
        }
        let blocks: Vec<_> = store.blocks.iter().map(|stored| Arc::clone(&stored.block.changes)).collect();
        drop(store);
        let mut rate = EventRate::default();
        blocks.iter().for_each(|changes| rate.add(changes));
        rate.bins()
    }

    /// Counts by which dead, stuck and noisy taxels are found.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` where there is no keyframe; `File` where the temporary file cannot be read.
    pub fn activity(&self) -> Result<Activity> {
        let mut activity = Activity::new(&self.sensor.array);
        let (begin, mut next) = self.open(i64::MIN)?;
        activity.set_held(&begin.held);
        while let Some(block) = self.next(&mut next)? {
            block.held.iter().for_each(|(held, _)| activity.set_held(held));
            block.changes.iter().for_each(|change| activity.count(change));
        }
        Ok(activity)
    }
}

impl StoredBlock {
    fn bytes(&self) -> usize {
        let values =
            self.block.rest.as_ref().map_or(0, Vec::len) + self.block.held.as_ref().map_or(0, |(held, _)| held.len());
        size_of::<Self>() + self.in_memory() + values * size_of::<u16>()
    }

    /// Memory that its changes and extents take.
    fn in_memory(&self) -> usize {
        self.block.changes.len() * BYTES + self.extents.iter().flatten().count() * size_of::<TaxelExtent>()
    }
}

/// The extent of each taxel among changes.
fn extents(changes: &[TaxelChange], taxels: usize) -> Vec<TaxelExtent> {
    let mut all = vec![[u16::MAX, 0, UNKNOWN]; taxels];
    for &TaxelChange { taxel, ticks, .. } in changes.iter().filter(|change| change.ticks != UNKNOWN) {
        let [least, greatest, last] = &mut all[taxel as usize];
        (*least, *greatest, *last) = (ticks.min(*least), ticks.max(*greatest), ticks);
    }
    all
}

impl Store {
    fn at(&self, number: u64) -> Option<&StoredBlock> {
        number.checked_sub(self.first).and_then(|at| self.blocks.get(usize::try_from(at).ok()?))
    }

    fn key(&self, t: i64) -> Option<&(u64, Arc<Keyframe>)> {
        let until = |(_, key): &&(u64, Arc<Keyframe>)| key.latest.is_none_or(|latest| latest <= t);
        self.keys.iter().rev().find(until).or(self.keys.front())
    }

    /// Drops keyframes that take too much memory.
    fn thin(&mut self) {
        if self.keys.back().is_some_and(|(_, key)| self.keys.len() * key.bytes() > KEYFRAME_BYTES) {
            self.spacing *= 2;
            self.keys.retain(|(number, _)| number.is_multiple_of(self.spacing));
        }
    }

    /// Moves the changes that are in memory to the file.
    fn write(&mut self, mut file: ChangeFile) -> Result<()> {
        let from = self.blocks.partition_point(|stored| stored.place.is_some());
        for stored in self.blocks.range_mut(from..) {
            self.bytes -= stored.in_memory();
            let changes = std::mem::take(&mut stored.block.changes);
            stored.place =
                Some(file.push(&changes, &stored.extents.iter_mut().flat_map(std::mem::take).collect::<Vec<_>>())?);
        }
        self.file = Some(file);
        Ok(())
    }

    /// Drops the oldest blocks up to a keyframe, so that the first one always has one.
    fn forget(&mut self, us: i64, bytes: usize) {
        while let Some((second, key)) = self.keys.get(1) {
            let age = key.latest.zip(self.range).map_or(0, |(since, (_, now))| now - since);
            if age <= us && self.bytes <= bytes {
                return;
            }
            let gone = usize::try_from(second - self.first).unwrap_or(usize::MAX);
            let (second, since) = (*second, key.latest);
            let blocks: usize = self.blocks.drain(..gone).map(|stored| stored.bytes()).sum();
            let keys = self.keys.pop_front().map_or(0, |(_, key)| key.bytes());
            self.bytes -= blocks + keys;
            self.first = second;
            self.range = self.range.map(|(first, last)| (since.unwrap_or(first), last));
        }
    }
}

/// A recording that is being indexed.
#[derive(Debug)]
pub(crate) struct Indexing {
    index: Index,
    state: ArrayState,
}

impl Indexing {
    /// Begins with what the array held before the first change.
    pub(crate) fn new(sensor: Sensor, from: &Keyframe, kept: Kept) -> Self {
        let sensor = Arc::new(sensor);
        let most = TimeColumns::columns_in(TIME_COLUMN_BYTES, &sensor.array, sensor.curves());
        Self { state: ArrayState::new(&sensor, from, COLUMN_US, most), index: Index::new(sensor, kept) }
    }

    /// Sets the values that the taxels held before the first change; none where they do not fit the array.
    pub fn begin_with(&mut self, held: &[u16]) {
        if held.len() == self.index.sensor.array.len() {
            self.state.begin_block(&Block { held: Some((held.to_vec(), 0)), ..Block::default() });
        }
    }

    /// Appends a block.
    ///
    /// # Errors
    ///
    /// As [`Index::push`].
    pub(crate) fn push(&mut self, block: Block) -> Result<()> {
        let key = self.state.keyframe();
        self.state.take(&block);
        self.index.push(Some(key), block)
    }

    /// The index, complete.
    #[must_use]
    pub fn finish(self) -> Index {
        let Self { mut index, mut state } = self;
        state.update_curve();
        let (whole, columns) = (state.columns().clone(), usize::from(index.sensor.array.columns));
        let first = index.range().map(|(first, _)| column_of(first, COLUMN_US));
        let complete = whole.reach().zip(first).is_none_or(|((begin, _), first)| begin <= first);
        index.whole = complete.then(|| Arc::new(whole));
        index.preload_at = preload_text(&preload(&state.rests_less(), columns, LOADED_TICKS), columns, (0, 0));
        index
    }
}

#[cfg(test)]
mod tests;
