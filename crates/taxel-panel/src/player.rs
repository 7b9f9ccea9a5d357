//! The state of a source at a time that moves forward, and what one client sees beside it.

use std::sync::Arc;

use taxel_core::problem;
use taxel_live::Result;

use crate::block::Block;
use crate::columns::{COLUMN_US, LATE_US, SPAN, TimeColumns, column_of};
use crate::history::TaxelHistory;
use crate::index::Index;
use crate::state::{ArrayState, FORGET};

/// What a view shows of a source.
#[derive(Debug, Clone)]
pub struct ViewOptions {
    /// Width of a column of time, us ([`is_column`](crate::columns::is_column)).
    pub column_us: i64,
    /// The taxel whose history is shown.
    pub watched: Option<u32>,
}

impl ViewOptions {
    /// Columns of `column_us` without history.
    pub fn plain(column_us: i64) -> Self {
        Self { column_us, watched: None }
    }
}

/// A source at a time.
pub struct Player {
    index: Arc<Index>,
    /// The state at this time.
    pub state: ArrayState,
    /// The history of the watched taxel.
    pub(crate) history: Option<TaxelHistory>,
    /// The changes that were read last, how many of them were applied, and the number of the next block.
    block: Block,
    applied: usize,
    next: u64,
    /// The time shown, us.
    pub(crate) t: i64,
}

impl Player {
    /// Opens a source at `t` (us), limited to the range of the source. `whole` are raster and curves of the whole source, where its
    /// index does not have them.
    ///
    /// # Errors
    ///
    /// As [`Index::open`] and [`Index::next`]; `Core(Problem)` for a recording without events.
    pub fn open(index: &Arc<Index>, t: i64, options: &ViewOptions, whole: Option<&Arc<TimeColumns>>) -> Result<Self> {
        let (first, last) =
            index.range().ok_or_else(|| problem!("nothing to show: the recording contains no events"))?;
        let t = t.clamp(first, last);
        let whole = whole.or(index.whole.as_ref()).filter(|_| options.column_us >= COLUMN_US);
        let (unit_us, span) = (options.column_us.min(COLUMN_US), SPAN * options.column_us);
        let since = |us: i64| t.saturating_sub(us.max(FORGET * COLUMN_US) + LATE_US);
        let (from, next) = index.open(since(if whole.is_none() { span } else { 0 }))?;
        let mut state = ArrayState::new(&index.sensor, &from, unit_us, span / unit_us);
        if let (Some(whole), Some(latest)) = (whole, from.latest) {
            state = state.after(Arc::clone(whole), column_of(latest + LATE_US, unit_us));
        }
        let history = options.watched.map(|taxel| index.history(taxel, options.column_us, since(span), next));
        let (history, block) = (history.transpose()?, Block::default());
        let mut player = Self { index: Arc::clone(index), state, history, block, applied: 0, next, t };
        player.advance(t)?;
        Ok(player)
    }

    /// Moves to a later time, at most to the end; returns whether the end is still ahead.
    ///
    /// # Errors
    ///
    /// As [`Index::next`].
    pub fn advance(&mut self, t: i64) -> Result<bool> {
        let last = self.index.range().map_or(t, |(_, last)| last);
        self.follow(t.min(last))?;
        Ok(t < last)
    }

    /// Moves to a later time, also beyond the last event.
    ///
    /// # Errors
    ///
    /// As [`Index::next`].
    pub fn follow(&mut self, t: i64) -> Result<()> {
        loop {
            let ahead = &self.block.changes[self.applied..];
            let now = ahead.iter().position(|change| change.t > t).unwrap_or(ahead.len());
            let (now, later) = ahead.split_at(now);
            self.state.apply(now);
            self.history.iter_mut().for_each(|history| history.push(now));
            self.applied += now.len();
            if !later.is_empty() || !self.read()? {
                break;
            }
        }
        self.state.advance(t);
        self.t = self.t.max(t);
        Ok(())
    }

    /// Goes on to the next block; returns false at the end.
    fn read(&mut self) -> Result<bool> {
        self.state.end_block(&self.block);
        self.block.rest = None;
        let Some(block) = self.index.next(&mut self.next)? else { return Ok(false) };
        self.state.begin_block(&block);
        (self.block, self.applied) = (block, 0);
        Ok(true)
    }

    /// The next time stamp that has events, us.
    ///
    /// # Errors
    ///
    /// As [`Index::next`].
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
}
