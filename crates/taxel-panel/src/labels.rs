//! The labels of recordings, as the clients see them: each with a number that holds while the server runs.

use std::collections::HashMap;
use std::sync::Mutex;

use serde_json::{Value, json};
use taxel_live::locked::lock;

use super::handler::LabelRow;

/// A label of a recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Label {
    pub(super) id: u64,
    pub(super) row: LabelRow,
}

/// A change of the labels of a recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum LabelChange {
    Mark(LabelRow),
    Rename { id: u64, label: String },
    Move { id: u64, t_us: i64 },
    Delete { id: u64 },
}

impl LabelChange {
    /// The same change at a whole multiple of `us`: at a picture, where pictures are numbered.
    pub(super) fn at_whole(self, us: i64) -> Self {
        let whole = |t: i64| t.div_euclid(us) * us;
        match self {
            Self::Mark(row) => Self::Mark(LabelRow { t_us: whole(row.t_us), ..row }),
            Self::Move { id, t_us } => Self::Move { id, t_us: whole(t_us) },
            other => other,
        }
    }

    /// Applies it to the labels; a new one gets the number `next_id`.
    fn apply(self, labels: &mut Vec<Label>, next_id: u64) -> Result<(), String> {
        match self {
            Self::Mark(row) => labels.push(Label { id: next_id, row }),
            Self::Rename { id, label } => {
                let place = place_of(labels, id)?;
                labels[place].row.label = label;
            }
            Self::Move { id, t_us } => {
                let place = place_of(labels, id)?;
                labels[place].row.t_us = t_us;
            }
            Self::Delete { id } => drop(labels.remove(place_of(labels, id)?)),
        }
        Ok(())
    }
}

fn place_of(labels: &[Label], id: u64) -> Result<usize, String> {
    labels
        .iter()
        .position(|label| label.id == id)
        .ok_or_else(|| format!("label_id: there is no label {id}; it was deleted, perhaps by somebody else"))
}

/// The labels of the recordings that clients have opened, by the recordings' names.
#[derive(Debug, Default)]
pub(super) struct LabelTables(Mutex<Tables>);

#[derive(Debug, Default)]
struct Tables {
    labels: HashMap<String, Vec<Label>>,
    last_id: u64,
}

impl Tables {
    fn next_id(&mut self) -> u64 {
        self.last_id += 1;
        self.last_id
    }
}

/// Name of the file that holds the labels of a recording.
pub(super) fn file_of(recording: &str) -> String {
    let stem = recording.rsplit_once('.').map_or(recording, |(stem, _)| stem);
    format!("{stem}.notes.csv")
}

impl LabelTables {
    /// Number of labels of a recording, once they have been read.
    pub(super) fn count(&self, recording: &str) -> Option<usize> {
        lock(&self.0).labels.get(recording).map(Vec::len)
    }

    pub(super) fn get(&self, recording: &str) -> Vec<Label> {
        lock(&self.0).labels.get(recording).cloned().unwrap_or_default()
    }

    /// Replaces the labels of a recording by those of its file; unchanged ones keep their numbers.
    pub(super) fn replace(&self, recording: &str, rows: Vec<LabelRow>) {
        let mut tables = lock(&self.0);
        let mut before = tables.labels.remove(recording).unwrap_or_default();
        let mut labels = vec![];
        for row in rows {
            let same = before.iter().position(|label| label.row == row);
            let id = same.map_or_else(|| tables.next_id(), |place| before.swap_remove(place).id);
            labels.push(Label { id, row });
        }
        tables.labels.insert(recording.to_owned(), labels);
    }

    /// Removes the labels of a recording.
    pub(super) fn remove(&self, recording: &str) {
        lock(&self.0).labels.remove(recording);
    }

    /// Changes the labels of a recording. Returns them as they were, for [`LabelTables::restore`], and as they are now.
    ///
    /// # Errors
    ///
    /// Where there is no label of that number; then nothing is changed.
    pub(super) fn change(&self, recording: &str, change: LabelChange) -> Result<(Vec<Label>, Vec<LabelRow>), String> {
        let mut tables = lock(&self.0);
        let before = tables.labels.get(recording).cloned().unwrap_or_default();
        let mut labels = before.clone();
        let id = tables.next_id();
        change.apply(&mut labels, id)?;
        labels.sort_by_key(|label| label.row.t_us);
        let rows = labels.iter().map(|label| label.row.clone()).collect();
        tables.labels.insert(recording.to_owned(), labels);
        Ok((before, rows))
    }

    /// Sets the labels of a recording back to what they were.
    pub(super) fn restore(&self, recording: &str, before: Vec<Label>) {
        lock(&self.0).labels.insert(recording.to_owned(), before);
    }

    /// The `labels` message.
    pub(super) fn message(&self, recording: &str) -> Value {
        let one = |Label { id, row }: Label| json!({ "label_id": id, "label": row.label, "t_us": row.t_us, "source": row.source });
        let labels: Vec<_> = self.get(recording).into_iter().map(one).collect();
        json!({ "type": "labels", "name": recording, "path": file_of(recording), "labels": labels })
    }
}
