//! Playback: the state of a source at a time that moves forward, back, and from time stamp to time stamp.

use std::sync::Arc;

use taxel_core::problem;

use super::encoded_spikes::EncodedSpikes;
use crate::array_state::{ArrayState, FORGET};
use crate::keyframe_index::{Block, KeyframeIndex};
use crate::readout_encoders::ViewEncoder;
use crate::taxel_history::TaxelHistory;
use crate::time_columns::{COLUMN_US, LATE_US, SPAN, TimeColumns, column_of};
use taxel_core::held::UNKNOWN;
use taxel_live::Result;

/// Maximum number of changes that are decoded only for the history of a taxel and the spikes of an encoder.
const HISTORY_CHANGES: u64 = 2_000_000;

/// What a view shows of a source.
#[derive(Debug, Clone)]
pub struct ViewOptions {
    /// Width of a column of time, us ([`is_column`](crate::time_columns::is_column)).
    pub column_us: i64,
    /// The taxel whose history is shown.
    pub watched: Option<u32>,
    /// The encoder whose spikes are shown.
    pub encoder: Option<ViewEncoder>,
    /// Raster and curves of the whole source, where its keyframe index does not store them.
    pub all_columns: Option<Arc<TimeColumns>>,
}

impl ViewOptions {
    /// Columns of `column_us` without history and spikes.
    #[must_use]
    pub fn plain(column_us: i64) -> Self {
        Self { column_us, watched: None, encoder: None, all_columns: None }
    }

    /// Whether the columns are narrower than those that keyframe indices store.
    #[must_use]
    pub fn is_narrow(&self) -> bool {
        self.column_us < COLUMN_US
    }
}

/// A source at a time.
pub struct Player {
    index: Arc<dyn KeyframeIndex>,
    state: ArrayState,
    /// First column that the state has itself; earlier ones come from the whole source.
    first_of_view: i64,
    /// The changes that were read last, and how many of them were applied.
    block: Block,
    applied: usize,
    t: i64,
    history: Option<TaxelHistory>,
    spikes: Option<EncodedSpikes>,
    options: ViewOptions,
}

impl Player {
    /// Opens a source at `t` (us), limited to the range of the source.
    ///
    /// # Errors
    ///
    /// As [`KeyframeIndex::open`] and [`KeyframeIndex::block`]; `Core(Problem)` where the encoder does not fit the array, or
    /// the frames.
    pub fn open(index: Arc<dyn KeyframeIndex>, t: i64, options: ViewOptions) -> Result<Self> {
        let (first, last) =
            index.range().ok_or_else(|| problem!("nothing to show: the recording contains no events"))?;
        let t = t.clamp(first, last);
        let span = SPAN * options.column_us;
        let stored = !options.is_narrow() && (index.time_columns().is_some() || options.all_columns.is_some());
        let needs_changes = options.watched.is_some() || options.encoder.is_some();
        let dense = index.events_before(t).saturating_sub(index.events_before(t - span)) > HISTORY_CHANGES;
        let before = if stored && (!needs_changes || dense) { 0 } else { span };
        let (keyframe, next) = index.open(t.saturating_sub(before.max(FORGET * COLUMN_US) + LATE_US))?;
        let unit_us = options.column_us.min(COLUMN_US);
        let bytes = TimeColumns::bytes_for(index.array(), span / unit_us);
        let state = index.state(&keyframe, unit_us, bytes);
        let first_of_view = keyframe.latest.map_or(i64::MIN, |latest| column_of(latest + LATE_US, unit_us));
        let history = options.watched.map(|taxel| {
            let held = keyframe.held.get(taxel as usize).copied().unwrap_or(UNKNOWN);
            TaxelHistory::new(taxel, held, keyframe.latest, options.column_us)
        });
        let spikes = options.encoder.as_ref().map(|encoder| match Arc::clone(&index).frames() {
            Some(frames) => EncodedSpikes::of_frames(encoder, &frames, options.column_us, keyframe.latest),
            None => EncodedSpikes::new(encoder, index.array(), options.column_us, &keyframe.held, keyframe.latest),
        });
        let spikes = spikes.transpose()?;
        let block = Block { next, ..Block::default() };
        let mut player = Self { index, state, first_of_view, block, applied: 0, t, history, spikes, options };
        player.advance(t)?;
        Ok(player)
    }

    /// Moves to a later time, at most to the end; returns whether the end is still ahead.
    ///
    /// # Errors
    ///
    /// As [`KeyframeIndex::block`].
    pub fn advance(&mut self, t: i64) -> Result<bool> {
        let last = self.index.range().map_or(t, |(_, last)| last);
        self.follow(t.min(last))?;
        if let Some(spikes) = self.spikes.as_mut().filter(|_| t >= last) {
            // All events of the last time stamp have been applied too.
            spikes.advance(last + 1);
        }
        Ok(t < last)
    }

    /// Moves to a later time, also beyond the last event.
    ///
    /// # Errors
    ///
    /// As [`KeyframeIndex::block`].
    pub fn follow(&mut self, t: i64) -> Result<()> {
        loop {
            let ahead = &self.block.changes[self.applied..];
            let now = ahead.iter().position(|change| change.t > t).unwrap_or(ahead.len());
            let (now, later) = ahead.split_at(now);
            self.state.apply(now);
            if let Some(history) = &mut self.history {
                now.iter().for_each(|change| history.apply(change));
            }
            if let Some(spikes) = &mut self.spikes {
                spikes.push(now);
            }
            self.applied += now.len();
            if !later.is_empty() {
                break;
            }
            if !self.read()? {
                break;
            }
        }
        self.state.advance(t);
        if let Some(spikes) = &mut self.spikes {
            spikes.advance(t);
        }
        self.t = self.t.max(t);
        Ok(())
    }

    /// Reads the next changes, or what the index says of values and rest; returns false at the end.
    fn read(&mut self) -> Result<bool> {
        if let Some(rest) = self.block.rest.take() {
            self.state.set_rest(rest);
        }
        let Some(block) = self.index.block(self.block.next)? else { return Ok(false) };
        if let Some((held, events)) = &block.held {
            self.state.set_held(held, *events);
        }
        (self.block, self.applied) = (block, 0);
        Ok(true)
    }

    /// The next time stamp that has events, us.
    ///
    /// # Errors
    ///
    /// As [`KeyframeIndex::block`].
    pub fn next_stamp(&mut self) -> Result<Option<i64>> {
        loop {
            if let Some(change) = self.block.changes.get(self.applied) {
                return Ok(Some(change.t.max(self.t)));
            }
            if !self.read()? {
                return Ok(None);
            }
        }
    }

    /// The last time stamp before this one that has events, us.
    ///
    /// # Errors
    ///
    /// As [`KeyframeIndex::open`] and [`KeyframeIndex::block`].
    pub fn last_stamp(&self) -> Result<Option<i64>> {
        let mut from = self.t;
        loop {
            let (_, mut next) = self.index.open(from.saturating_sub(1))?;
            let mut found = None;
            'reading: while let Some(block) = self.index.block(next)? {
                for change in &block.changes {
                    if change.t >= self.t {
                        break 'reading;
                    }
                    found = found.max(Some(change.t));
                }
                next = block.next;
            }
            if found.is_some() {
                return Ok(found);
            }
            match self.index.keyframe_before(from.saturating_sub(1)) {
                Some(earlier) => from = earlier,
                None => return Ok(None),
            }
        }
    }

    /// The time shown, us.
    #[must_use]
    pub fn t(&self) -> i64 {
        self.t
    }

    /// The state at this time.
    #[must_use]
    pub fn state(&self) -> &ArrayState {
        &self.state
    }

    /// The keyframe index of the source.
    #[must_use]
    pub fn index(&self) -> &Arc<dyn KeyframeIndex> {
        &self.index
    }

    /// The state at this time, to change its rest or to update its curve.
    pub fn state_mut(&mut self) -> &mut ArrayState {
        &mut self.state
    }

    /// History of the watched taxel.
    #[must_use]
    pub fn history(&self) -> Option<&TaxelHistory> {
        self.history.as_ref()
    }

    pub(crate) fn spikes(&self) -> Option<&EncodedSpikes> {
        self.spikes.as_ref()
    }

    pub(crate) fn spikes_mut(&mut self) -> Option<&mut EncodedSpikes> {
        self.spikes.as_mut()
    }

    /// Raster and curves of the state, the first column that they hold, and those of the whole source for earlier columns.
    #[must_use]
    pub fn time_columns(&self) -> (&TimeColumns, i64, Option<&TimeColumns>) {
        let all_columns = if self.options.is_narrow() {
            None
        } else {
            self.options.all_columns.as_deref().or(self.index.time_columns())
        };
        (self.state.time_columns(), self.first_of_view, all_columns)
    }
}
