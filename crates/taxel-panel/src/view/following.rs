//! A view that follows a live source: what it shows beside the state that all clients share.

use taxel_live::Result;
use taxel_live::locked::lock;

use crate::columns::SPAN;
use crate::history::TaxelHistory;
use crate::live_source::LiveSource;
use crate::player::ViewOptions;
use crate::view::frame::{self, About};

/// What a client that follows a live source needs beside the shared state.
#[derive(Default)]
pub(super) struct Following {
    /// The history of the watched taxel, and the next block for it.
    history: Option<TaxelHistory>,
    next: u64,
}

impl Following {
    /// Begins the history before all columns that are shown.
    pub(super) fn begin(live: &LiveSource, options: &ViewOptions) -> Result<Self> {
        let (index, next) = (&live.index, live.index.end());
        let now = index.range().map_or(i64::MIN, |(_, latest)| latest);
        let since = now.saturating_sub(SPAN * options.column_us);
        let begin = |taxel| index.history(taxel, options.column_us, since, next);
        Ok(Self { history: options.watched.map(begin).transpose()?, next })
    }

    /// Reads what has arrived since the last call.
    pub(super) fn read(&mut self, live: &LiveSource) -> Result<()> {
        while let Some(block) = live.index.next(&mut self.next)? {
            self.history.iter_mut().for_each(|history| history.push(&block.changes));
        }
        Ok(())
    }

    /// Frame of the shared state, and its last column.
    pub(super) fn frame(&self, live: &LiveSource, about: About) -> (Vec<u8>, i64) {
        let mut state = lock(&live.state);
        state.update_curve();
        frame::write(&state, &state, self.history.as_ref(), about)
    }
}
