//! The labels of recordings, as the clients see them: each with a number that holds while the server runs.

use std::collections::HashMap;
use std::sync::{Arc, Mutex};
use std::time::SystemTime;

use taxel_live::locked::lock;
use tokio::sync::{OwnedMutexGuard, oneshot};

use crate::handler::{LabelEdit, LabelRow, LabelTable, LabelTimes};
use crate::protocol::messages::{Label, Message};
use crate::protocol::refusal::Answer;

/// Maximum number of changes that a client can take back.
const MOST_CHANGES: usize = 1000;

/// A change of the labels of a recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum LabelChange {
    Mark(LabelRow),
    Rename { id: u64, label: String },
    Move { id: u64, t_us: i64 },
    Delete { id: u64 },
}

impl LabelRow {
    /// Whether it only states that a note of the recording counts no more.
    fn is_removal(&self) -> bool {
        self.label.is_empty()
    }
}

impl LabelChange {
    /// The time that it sets, us.
    pub(crate) fn t_us(&self) -> Option<i64> {
        match self {
            Self::Mark(row) => Some(row.t_us),
            Self::Move { t_us, .. } => Some(*t_us),
            Self::Rename { .. } | Self::Delete { .. } => None,
        }
    }

    /// The same change at a whole multiple of `us`: at a frame, where frames are numbered.
    pub(crate) fn at_whole(self, us: i64) -> Self {
        let rounded = |t: i64| t.div_euclid(us) * us;
        match self {
            Self::Mark(row) => Self::Mark(LabelRow { t_us: rounded(row.t_us), ..row }),
            Self::Move { id, t_us } => Self::Move { id, t_us: rounded(t_us) },
            change => change,
        }
    }

    /// The change of the table's rows. `labels` are those as this and the changes before it leave them.
    fn edit(self, labels: &mut Vec<Label>) -> Result<NumberedEdit, String> {
        let (id, index) = match self {
            Self::Mark(row) => return Ok((None, LabelEdit { old: None, new: Some(row) })),
            Self::Rename { id, .. } | Self::Move { id, .. } | Self::Delete { id } => (id, index_of(labels, id)?),
        };
        let old = labels[index].row.clone();
        let new = match self {
            Self::Rename { label, .. } => Some(LabelRow { label, ..old.clone() }),
            Self::Move { t_us, .. } => Some(LabelRow { t_us, host_ns: None, ..old.clone() }),
            // Without the row that replaces it, its note would count again.
            _ => old.replaces_us.map(|_| LabelRow { label: String::new(), ..old.clone() }),
        };
        set(labels, id, new.clone());
        Ok((Some(id), LabelEdit { old: Some(old), new }))
    }
}

/// An edit, and the number of the label that it changes.
pub(crate) type NumberedEdit = (Option<u64>, LabelEdit);

fn index_of(labels: &[Label], id: u64) -> Result<usize, String> {
    labels.iter().position(|label| label.label_id == id && !label.row.is_removal()).ok_or_else(|| {
        format!("label_id: label {id} does not exist; it was deleted or changed, perhaps by another client or program")
    })
}

/// Gives a label another row, or removes it.
fn set(labels: &mut Vec<Label>, id: u64, row: Option<LabelRow>) {
    match row {
        Some(row) => labels.iter_mut().filter(|label| label.label_id == id).for_each(|label| label.row = row.clone()),
        None => labels.retain(|label| label.label_id != id),
    }
}

/// A request that waits to be written with others.
pub(crate) struct WaitingChanges {
    pub(crate) changes: Vec<LabelChange>,
    /// Gets the number of the change; `None` where it changed nothing.
    pub(crate) answer: oneshot::Sender<Answer<Option<u64>>>,
}

/// The newest changes of labels that a client made, by the recordings' names and their numbers in
/// [`LabelTable::changes`](crate::handler::LabelTable::changes).
#[derive(Default)]
pub(crate) struct LabelHistory(Mutex<Vec<(String, u64)>>);

impl LabelHistory {
    pub(crate) fn add(&self, recording: &str, change: u64) {
        let mut changes = lock(&self.0);
        changes.push((recording.to_owned(), change));
        let excess = changes.len().saturating_sub(MOST_CHANGES);
        changes.drain(..excess);
    }

    /// Takes the last change of a recording out.
    pub(crate) fn take_last(&self, recording: &str) -> Option<u64> {
        let mut changes = lock(&self.0);
        let index = changes.iter().rposition(|(name, _)| name == recording)?;
        Some(changes.remove(index).1)
    }
}

/// The labels of the recordings that clients have opened, by the recordings' names.
#[derive(Default)]
pub(crate) struct LabelTables(Mutex<Tables>);

#[derive(Default)]
struct Tables {
    tables: HashMap<String, KnownTable>,
    last_id: u64,
}

/// A table as it was read last.
#[derive(Default)]
struct KnownTable {
    /// `None` where there is no table, or none was read.
    labels: Option<Vec<Label>>,
    /// That of the file before it was read.
    stamp: Option<Stamp>,
    /// Those of the view that opened it last; `None` where none has.
    times: Option<LabelTimes>,
    waiting: Vec<WaitingChanges>,
    turn: Arc<tokio::sync::Mutex<()>>,
}

/// What changes with a file: its last change, and its size.
pub(crate) type Stamp = (SystemTime, u64);

/// Name of the file that holds the labels of a recording.
pub(crate) fn file_of(recording: &str) -> String {
    let stem = recording.rsplit_once('.').map_or(recording, |(stem, _)| stem);
    format!("{stem}.notes.csv")
}

impl LabelTables {
    fn with<T>(&self, recording: &str, action: impl FnOnce(&mut KnownTable) -> T) -> T {
        action(lock(&self.0).tables.entry(recording.to_owned()).or_default())
    }

    /// Number of labels of a recording, once they have been read.
    pub(crate) fn count(&self, recording: &str) -> Option<usize> {
        let counted = |labels: &Vec<Label>| labels.iter().filter(|label| !label.row.is_removal()).count();
        lock(&self.0).tables.get(recording)?.labels.as_ref().map(counted)
    }

    /// The recordings whose tables were opened.
    pub(crate) fn opened(&self) -> Vec<(String, LabelTimes)> {
        let known = lock(&self.0);
        known.tables.iter().filter_map(|(name, table)| Some((name.clone(), table.times?))).collect()
    }

    /// Waits until no other request reads or writes the table of a recording.
    pub(crate) async fn turn(&self, recording: &str) -> OwnedMutexGuard<()> {
        let turn = self.with(recording, |table| Arc::clone(&table.turn));
        turn.lock_owned().await
    }

    pub(crate) fn stamp(&self, recording: &str) -> Option<Stamp> {
        self.with(recording, |table| table.stamp)
    }

    /// Notes that a table is read now, with its stamp.
    pub(crate) fn opens(&self, recording: &str, stamp: Option<Stamp>, times: LabelTimes) {
        self.with(recording, |table| (table.stamp, table.times) = (stamp, Some(times)));
    }

    /// Notes that a table that was written is followed from now on, as of a recording that runs.
    pub(crate) fn follows(&self, recording: &str, times: LabelTimes) {
        self.with(recording, |table| table.times = Some(times));
    }

    /// Adds changes to those that are written next.
    pub(crate) fn wait(&self, recording: &str, waiting: WaitingChanges) {
        self.with(recording, |table| table.waiting.push(waiting));
    }

    pub(crate) fn take_waiting(&self, recording: &str) -> Vec<WaitingChanges> {
        self.with(recording, |table| std::mem::take(&mut table.waiting))
    }

    /// The edits of requests, each made on what those before it leave.
    pub(crate) fn edits(&self, recording: &str, waiting: &[WaitingChanges]) -> Vec<Result<Vec<NumberedEdit>, String>> {
        let mut labels = self.with(recording, |table| table.labels.clone().unwrap_or_default());
        let mut edits = |waiting: &WaitingChanges| {
            let before = labels.clone();
            let made = waiting.changes.iter().map(|change| change.clone().edit(&mut labels)).collect();
            if Result::<Vec<NumberedEdit>, _>::is_err(&made) {
                labels = before;
            }
            made
        };
        waiting.iter().map(&mut edits).collect()
    }

    /// Notes the rows that labels have now, before [`LabelTables::replace`], so that they keep their numbers.
    pub(crate) fn renumber(&self, recording: &str, rows: impl IntoIterator<Item = (u64, Option<LabelRow>)>) {
        self.with(recording, |table| {
            let Some(labels) = &mut table.labels else { return };
            rows.into_iter().for_each(|(id, row)| set(labels, id, row));
        });
    }

    /// Replaces the labels of a recording by those of its table, `None` where there is none; unchanged ones keep their numbers.
    /// Returns whether anything has changed.
    pub(crate) fn replace(&self, recording: &str, read: Option<LabelTable>) -> bool {
        let mut known = lock(&self.0);
        let Tables { tables, last_id } = &mut *known;
        let table = tables.entry(recording.to_owned()).or_default();
        let mut before = table.labels.clone().unwrap_or_default();
        let mut number = |row: LabelRow| {
            let same = before.iter().position(|label| label.row == row);
            let id = same.map(|index| before.remove(index).label_id).unwrap_or_else(|| {
                *last_id += 1;
                *last_id
            });
            Label { label_id: id, row }
        };
        let labels: Option<Vec<Label>> = read.map(|read| read.rows.into_iter().map(&mut number).collect());
        let same = table.labels == labels;
        table.labels = labels;
        !same
    }

    /// The `labels` message.
    pub(crate) fn message(&self, recording: &str) -> Message {
        self.with(recording, |table| {
            let shown = table.labels.iter().flatten().filter(|label| !label.row.is_removal());
            Message::Labels { name: recording.to_owned(), path: file_of(recording), labels: shown.cloned().collect() }
        })
    }
}
