//! A view that follows a live source: what it shows beside the state that all clients share.

use std::sync::Arc;

use taxel_live::Result;
use taxel_live::locked::lock;

use crate::live_source::LiveSource;
use crate::readout_encoders::ViewEncoder;
use crate::taxel_history::TaxelHistory;
use crate::time_columns::{COLUMN_US, column_of};
use crate::view::encoded_spikes::EncodedSpikes;
use crate::view::frame::{self, About};
use crate::view::player::{Player, ViewOptions};

/// Narrow columns that lag this far behind restart from the last keyframe, which is less to decode, us.
const NARROW_LAG_US: i64 = 1_000_000;

/// What a client that follows a live source needs beside the shared state.
#[derive(Default)]
pub(super) struct Following {
    /// History of the watched taxel, and the next piece to apply.
    history: Option<(TaxelHistory, u64)>,
    /// Spikes of the encoder, and the next piece to encode.
    spikes: Option<(EncodedSpikes, u64)>,
    /// Columns of time narrower than those of the shared state.
    narrow: Option<Box<Player>>,
}

impl Following {
    /// Drops the history and the narrow columns, which restart with the next frame.
    pub(super) fn restart(&mut self) {
        (self.history, self.narrow) = (None, None);
    }

    /// Drops the history, which restarts with the next frame.
    pub(super) fn restart_history(&mut self) {
        self.history = None;
    }

    pub(super) fn stop_encoding(&mut self) {
        self.spikes = None;
    }

    /// Begins to encode from now on.
    pub(super) fn start_encoding(&mut self, live: &LiveSource, encoder: &ViewEncoder, column_us: i64) -> Result<()> {
        let state = lock(&live.state);
        let spikes = EncodedSpikes::new(encoder, live.array(), column_us, state.held(), state.latest())?;
        self.spikes = Some((spikes, live.index.next_piece()));
        Ok(())
    }

    /// Encodes what has arrived since the last call.
    pub(super) fn encode(&mut self, live: &LiveSource) -> Option<&mut EncodedSpikes> {
        let (spikes, next) = self.spikes.as_mut()?;
        *next = live.index.changes_from(*next, |changes| spikes.push(changes));
        if let Some(t) = lock(&live.state).latest() {
            spikes.advance(t);
        }
        Some(spikes)
    }

    /// Decodes narrow columns up to the time of the shared state, where columns are that narrow.
    pub(super) fn update_narrow(&mut self, live: Option<&Arc<LiveSource>>, column_us: i64) -> Result<()> {
        let Some(live) = live.filter(|_| column_us < COLUMN_US) else {
            self.narrow = None;
            return Ok(());
        };
        let Some(t) = lock(&live.state).latest() else { return Ok(()) };
        let mut narrow = match self.narrow.take() {
            Some(narrow) if narrow.t() + NARROW_LAG_US >= t && narrow.t() <= t => narrow,
            _ => Box::new(Player::open(Arc::new(live.index.clone()), t, ViewOptions::plain(column_us))?),
        };
        narrow.follow(t)?;
        narrow.state_mut().copy_rest(&lock(&live.state));
        self.narrow = Some(narrow);
        Ok(())
    }

    /// Frame of the shared state, its last column, and the number of its rest where it contains it.
    pub(super) fn frame(
        &mut self,
        live: &LiveSource,
        about: About,
        needs_rest: impl FnOnce(u64) -> bool,
    ) -> (Vec<u8>, i64, Option<u64>) {
        if let Some(watched) = about.watched {
            let (history, next) = self.history.get_or_insert_with(|| live.index.history(watched, about.column_us));
            *next = live.index.changes_from(*next, |changes| changes.iter().for_each(|change| history.apply(change)));
        }
        let mut state = lock(&live.state);
        let rests = Some(state.rests()).filter(|rests| needs_rest(*rests));
        let about = About { with_rest: rests.is_some(), ..about };
        let columns = live.array().columns;
        let history = self.history.as_ref().map(|(history, _)| history);
        let spikes = self.spikes.as_ref().map(|(spikes, _)| spikes);
        let narrow = self.narrow.as_deref_mut();
        // The state may have moved on since the narrow columns were decoded: those in between are sent again.
        let decoded = narrow.as_ref().map_or(i64::MAX, |narrow| column_of(narrow.t(), about.column_us));
        let (bytes, last) = frame::of_state(&mut state, narrow, columns, history, spikes, about);
        (bytes, last.min(decoded), rests)
    }
}
