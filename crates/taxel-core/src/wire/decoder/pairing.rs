//! Pairs intensities with changes other than the word before.

use serde::{Deserialize, Serialize};

use super::filling::PendingChange;
use crate::{Array, Events, Intensities};

/// Which change an intensity belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Pairing {
    /// The word directly before it, if that word is a change of the same taxel. Reading: the board sends them in this
    /// order.
    #[default]
    Direct,
    /// The latest change of the taxel that has no intensity yet, for boards with another order. An intensity may arrive
    /// at any time, so all events wait until [`Decoder::finish`](super::Decoder::finish): for whole recordings.
    Taxel,
}

/// Changes that wait for an intensity from anywhere later in the stream.
#[derive(Debug, Clone)]
pub(super) struct UnpairedChanges {
    changes: Vec<PendingChange>,
    ticks: Vec<Option<u16>>,
    /// For each change, the previous unpaired change of its taxel.
    before: Vec<Option<usize>>,
    /// For each taxel, its latest unpaired change.
    latest: Vec<Option<usize>>,
    columns: usize,
}

impl UnpairedChanges {
    pub(super) fn new(array: &Array) -> Self {
        Self {
            changes: vec![],
            ticks: vec![],
            before: vec![],
            latest: vec![None; array.len()],
            columns: array.columns.into(),
        }
    }

    pub(super) fn change(&mut self, change: PendingChange) {
        let latest = &mut self.latest[usize::from(change.y) * self.columns + usize::from(change.x)];
        self.before.push(latest.replace(self.changes.len()));
        self.changes.push(change);
        self.ticks.push(None);
    }

    /// Pairs an intensity; returns whether there was an unpaired change of its taxel.
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

/// Appends a change to events, with its intensity if it has one.
pub(super) fn append(out: &mut Events, change: PendingChange, ticks: Option<u16>) {
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
