//! A view that follows a live source: what it shows beside the state that all clients share.

use std::sync::Arc;

use taxel_live::Result;
use taxel_live::locked::lock;

use crate::columns::SPAN;
use crate::live_source::LiveSource;
use crate::player::{HISTORY_CHANGES, Player, ViewOptions, Watched};
use crate::spikes::EncodedSpikes;
use crate::state::Keyframe;
use crate::view::frame::{self, About};

/// Narrow columns that lag this far behind restart from the last keyframe, which is less to decode, us.
const NARROW_LAG_US: i64 = 1_000_000;

/// What a client that follows a live source needs beside the shared state.
#[derive(Default)]
pub(super) struct Following {
    /// Beside the columns of the shared state, and the next block for it.
    watched: Watched,
    next: u64,
    /// The source in columns that are narrower.
    narrow: Option<Box<Player>>,
}

impl Following {
    /// Begins history and encoder before all columns that are shown.
    pub(super) fn begin(live: &LiveSource, options: &ViewOptions) -> Result<Self> {
        let index = &live.index;
        let now = index.range().map_or(i64::MIN, |(_, latest)| latest);
        let begin = now.saturating_sub(SPAN * options.column_us);
        let dense = options.encoder.is_some() && index.changes_between(begin, now) > HISTORY_CHANGES;
        let blank = || (Arc::new(Keyframe::blank(index.sensor.array.len())), index.end());
        let (from, next) = index.open(if dense { now } else { begin }).unwrap_or_else(|_| blank());
        let mut following = Self { watched: Watched::new(options, index, &from)?, next, narrow: None };
        following.read(live)?;
        Ok(following)
    }

    /// Reads what has arrived since the last call.
    pub(super) fn read(&mut self, live: &LiveSource) -> Result<()> {
        let latest = lock(&live.state).latest;
        while let Some(block) = live.index.next(&mut self.next)? {
            self.watched.push(&block.changes);
        }
        if let (Some(spikes), Some(t)) = (&mut self.watched.spikes, latest) {
            spikes.advance(t);
        }
        Ok(())
    }

    /// Encodes what has arrived; where columns are narrow, decodes up to the time of the shared state.
    pub(super) fn update(&mut self, live: &LiveSource, options: &ViewOptions) -> Result<()> {
        if !options.is_narrow() {
            return self.read(live);
        }
        let Some(t) = lock(&live.state).latest else { return Ok(()) };
        let mut narrow = match self.narrow.take() {
            Some(narrow) if narrow.t() + NARROW_LAG_US >= t && narrow.t() <= t => narrow,
            _ => Box::new(Player::open(&live.index, t, options, None)?),
        };
        narrow.follow(t)?;
        narrow.state.copy_rest(&lock(&live.state));
        self.narrow = Some(narrow);
        Ok(())
    }

    pub(super) fn spikes(&mut self) -> &mut Option<EncodedSpikes> {
        &mut self.narrow.as_mut().map_or(&mut self.watched, |narrow| &mut narrow.watched).spikes
    }

    /// Frame of the shared state, and its last column.
    pub(super) fn frame(&mut self, live: &LiveSource, about: About) -> (Vec<u8>, i64) {
        let mut state = lock(&live.state);
        state.update_curve();
        match &mut self.narrow {
            Some(narrow) => {
                narrow.state.update_curve();
                frame::write(&state, &narrow.state, &narrow.watched, about)
            }
            None => frame::write(&state, &state, &self.watched, about),
        }
    }
}
