//! Which change an intensity belongs to, where it is not the one before it.

use serde::{Deserialize, Serialize};

use super::filling::Change;
use crate::{Array, Events, Intensities};

/// Which change an intensity belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Pairing {
    /// The word directly before it, where that is a change of the same taxel. Reading: so the board sends them.
    #[default]
    Direct,
    /// The latest change of that taxel that has none yet, for boards that order otherwise. Every event waits for
    /// [`Decoder::finish`](super::Decoder::finish), for an intensity may come at any time: for whole recordings.
    Taxel,
}

/// Changes that wait for intensities from anywhere later in the stream.
#[derive(Debug, Clone)]
pub(super) struct ByTaxel {
    changes: Vec<Change>,
    ticks: Vec<Option<u16>>,
    /// For each change, the unpaired change of its taxel before it.
    before: Vec<Option<usize>>,
    /// For each taxel, its latest unpaired change.
    latest: Vec<Option<usize>>,
    columns: usize,
}

impl ByTaxel {
    pub(super) fn new(array: &Array) -> Self {
        Self {
            changes: vec![],
            ticks: vec![],
            before: vec![],
            latest: vec![None; array.len()],
            columns: array.columns.into(),
        }
    }

    pub(super) fn change(&mut self, change: Change) {
        let latest = &mut self.latest[usize::from(change.y) * self.columns + usize::from(change.x)];
        self.before.push(latest.replace(self.changes.len()));
        self.changes.push(change);
        self.ticks.push(None);
    }

    /// Whether there was a change to pair with.
    pub(super) fn intensity(&mut self, taxel: usize, ticks: u16) -> bool {
        let Some(k) = self.latest[taxel] else { return false };
        self.ticks[k] = Some(ticks);
        self.latest[taxel] = self.before[k];
        true
    }

    pub(super) fn finish_into(&mut self, out: &mut Events) {
        for (change, ticks) in self.changes.drain(..).zip(self.ticks.drain(..)) {
            append(out, change, ticks);
        }
        self.before.clear();
        self.latest.fill(None);
    }
}

/// Adds a change to events, with its intensity where it has one.
pub(super) fn append(out: &mut Events, change: Change, ticks: Option<u16>) {
    out.t.push(change.t);
    out.x.push(change.x);
    out.y.push(change.y);
    out.p.push(change.p);
    if ticks.is_some() || out.intensity.is_some() {
        let rows = out.t.len() - 1;
        let column =
            out.intensity.get_or_insert_with(|| Intensities { ticks: vec![0; rows], present: vec![false; rows] });
        column.ticks.push(ticks.unwrap_or(0));
        column.present.push(ticks.is_some());
    }
}
