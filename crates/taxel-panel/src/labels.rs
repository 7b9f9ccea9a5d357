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

impl LabelRow {
    /// Whether it only states that a note of the recording counts no more.
    fn is_removal(&self) -> bool {
        self.label.is_empty()
    }

    /// Whether it replaces the same note as another.
    fn replaces_note_of(&self, other: &Self) -> bool {
        let of = |row: &Self| (row.replaces_us, row.source.clone(), row.trial.clone());
        self.replaces_us.is_some() && of(self) == of(other)
    }

    /// With its times as a client sees them: one us of the file is `us` of the view.
    pub(super) fn in_view(self, us: i64) -> Self {
        Self { t_us: self.t_us * us, replaces_us: self.replaces_us.map(|t| t * us), ..self }
    }

    /// With its times as in the file.
    pub(super) fn in_file(self, us: i64) -> Self {
        Self { t_us: self.t_us / us, replaces_us: self.replaces_us.map(|t| t / us), ..self }
    }
}

impl LabelChange {
    /// The time that it sets, us.
    pub(super) fn t_us(&self) -> Option<i64> {
        match self {
            Self::Mark(row) => Some(row.t_us),
            Self::Move { t_us, .. } => Some(*t_us),
            Self::Rename { .. } | Self::Delete { .. } => None,
        }
    }

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
            Self::Mark(row) => {
                labels.retain(|label| !(label.row.is_removal() && label.row.replaces_note_of(&row)));
                // A label that is there already is not made again.
                if !labels.iter().any(|label| LabelRow { host_ns: None, ..label.row.clone() } == row) {
                    labels.push(Label { id: next_id, row });
                }
            }
            Self::Rename { id, label } => {
                let place = place_of(labels, id)?;
                labels[place].row.label = label;
            }
            Self::Move { id, t_us } => {
                let place = place_of(labels, id)?;
                labels[place].row.t_us = t_us;
                labels[place].row.host_ns = None;
            }
            Self::Delete { id } => {
                let place = place_of(labels, id)?;
                match labels[place].row.replaces_us {
                    // Else its note would count again.
                    Some(_) => labels[place].row.label.clear(),
                    None => drop(labels.remove(place)),
                }
            }
        }
        Ok(())
    }
}

fn place_of(labels: &[Label], id: u64) -> Result<usize, String> {
    labels
        .iter()
        .position(|label| label.id == id && !label.row.is_removal())
        .ok_or_else(|| format!("label_id: there is no label {id}; it was deleted, perhaps by another client"))
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
        let counted = |labels: &Vec<Label>| labels.iter().filter(|label| !label.row.is_removal()).count();
        lock(&self.0).labels.get(recording).map(counted)
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
        let one = |Label { id, row }: Label| {
            json!({
                "label_id": id, "label": row.label, "t_us": row.t_us, "source": row.source, "trial": row.trial,
                "replaces_us": row.replaces_us,
            })
        };
        let shown = self.get(recording).into_iter().filter(|label| !label.row.is_removal());
        let labels: Vec<_> = shown.map(one).collect();
        json!({ "type": "labels", "name": recording, "path": file_of(recording), "labels": labels })
    }
}
