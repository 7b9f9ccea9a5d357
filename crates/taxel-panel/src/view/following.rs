//! A view that follows a live source: what it shows beside the state that all clients share.

use std::sync::Arc;

use taxel_live::Result;
use taxel_live::locked::lock;

use crate::columns::SPAN;
use crate::live_source::LiveSource;
use crate::player::{HISTORY_CHANGES, ViewOptions, Watched};
use crate::spikes::EncodedSpikes;
use crate::state::Keyframe;
use crate::view::frame::{self, About};

/// What a client that follows a live source needs beside the shared state.
#[derive(Default)]
pub(super) struct Following {
    /// Beside the columns of the shared state, and the next block for it.
    watched: Watched,
    next: u64,
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
        let mut following = Self { watched: Watched::new(options, index, &from)?, next };
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

    pub(super) fn spikes(&mut self) -> &mut Option<EncodedSpikes> {
        &mut self.watched.spikes
    }

    /// Frame of the shared state, and its last column.
    pub(super) fn frame(&self, live: &LiveSource, about: About) -> (Vec<u8>, i64) {
        let mut state = lock(&live.state);
        state.update_curve();
        frame::write(&state, &state, &self.watched, about)
    }
}
