//! Requests that change labels. Those that wait for the same table are written together, each whole or not at all; a table
//! that another window or program has changed is read again.

use std::sync::Arc;
use std::time::Duration;

use tokio::sync::oneshot;

use crate::handler::{EditOutcome, LabelRow, LabelTable, LabelTimes};
use crate::hub::Hub;
use crate::hub::clients::Broadcast;
use crate::hub::indexed::OpenRecording;
use crate::hub::labels::{LabelChange, LabelHistory, NumberedEdit, Stamp, WaitingChanges, file_of};
use crate::protocol::limited::{OneOrMore, Text};
use crate::protocol::limits::MOST_MARKS;
use crate::protocol::messages::Message;
use crate::protocol::refusal::{Answer, Refusal};
use crate::protocol::request::MarkedTimes;

/// How often the tables that were opened are checked for changes of other programs.
const FOLLOW_EVERY: Duration = Duration::from_millis(300);

// ---------------------------------------------------------------------------------------------- reading

/// Reads the labels of a recording from their file.
pub(crate) async fn read(hub: &Hub, recording: &str, times: LabelTimes) -> Answer {
    let known = hub.labels.count(recording).is_some();
    if reread(hub, recording, stamp(hub, recording), times).await? && known {
        // The other clients that show it have an older list.
        hub.clients.send(Broadcast::Labels(recording.to_owned()));
    }
    Ok(())
}

/// What changes with the table; `None` where there is none.
fn stamp(hub: &Hub, recording: &str) -> Option<Stamp> {
    let about = hub.folder.file(&file_of(recording)).ok()?.metadata().ok()?;
    Some((about.modified().ok()?, about.len()))
}

/// Returns whether the labels have changed.
async fn reread(hub: &Hub, recording: &str, stamp: Option<Stamp>, times: LabelTimes) -> Answer<bool> {
    let _turn = hub.labels.turn(recording).await;
    // Also where it cannot be read now: it is read again when it has changed.
    hub.labels.opens(recording, stamp, times);
    let table = hub.folder.file(&file_of(recording))?;
    let name = recording.to_owned();
    let (read, exists) =
        hub.ask(move |handlers| Ok((handlers.labels.read(&table, &name, times)?, table.exists()))).await?;
    Ok(hub.labels.replace(recording, exists.then_some(read)))
}

/// Reads tables again that have changed; never returns.
pub(crate) async fn follow(hub: Arc<Hub>) {
    loop {
        tokio::time::sleep(FOLLOW_EVERY).await;
        for (recording, times) in hub.labels.opened() {
            let stamp = stamp(&hub, &recording);
            if hub.labels.stamp(&recording) == stamp {
                continue;
            }
            match reread(&hub, &recording, stamp, times).await {
                Ok(true) => hub.clients.send(Broadcast::Labels(recording)),
                Ok(false) => {}
                Err(refusal) => hub.clients.send_message(&Message::warning(refusal.reason)),
            }
        }
    }
}

// ---------------------------------------------------------------------------------------------- changing

/// A label of the trial that is shown.
pub(crate) fn row(shown: Option<&OpenRecording>, label: Text<200>, t_us: i64, source: Option<Text<64>>) -> LabelRow {
    let source = source.map(|source| source.0).unwrap_or_default();
    let trial = shown.and_then(|shown| shown.indexed.trial()).unwrap_or_default().to_owned();
    LabelRow { label: label.0, t_us, source, trial, replaces_us: None, host_ns: None }
}

/// The changes of `marks`: several labels, each at one time or more.
pub(crate) fn marks(shown: Option<&OpenRecording>, labels: Vec<MarkedTimes>) -> Answer<Vec<LabelChange>> {
    let mut changes = vec![];
    for MarkedTimes { label, t_us: OneOrMore(times), source, replaces_us } in labels {
        if replaces_us.as_ref().is_some_and(|replaced| replaced.0.len() != times.len()) {
            return Err(Refusal::of_field("replaces_us", "must have one time for each time in t_us"));
        }
        if changes.len() + times.len() > MOST_MARKS {
            return Err(Refusal::of_field("labels", format!("must be at most {MOST_MARKS} labels at a time")));
        }
        let row = row(shown, label, 0, source);
        changes.extend(times.iter().enumerate().map(|(k, t_us)| {
            let replaces_us = replaces_us.as_ref().map(|replaced| replaced.0[k].0);
            LabelChange::Mark(LabelRow { t_us: t_us.0, replaces_us, ..row.clone() })
        }));
    }
    Ok(changes)
}

/// The recording that is shown or being recorded.
fn recording_of(hub: &Hub, shown: Option<&OpenRecording>) -> Answer<(String, LabelTimes)> {
    let name = shown.map(|shown| shown.name.clone()).or_else(|| hub.recorder.file());
    let name = name.ok_or("a label needs a recording: open a recording, or start one")?;
    Ok((name, shown.map(|shown| shown.indexed.label_times()).unwrap_or_default()))
}

/// Changes labels of the recording that is shown or being recorded; returns when the table with all of the changes is in its place.
pub(crate) async fn change(
    hub: &Hub,
    history: &LabelHistory,
    shown: Option<&OpenRecording>,
    changes: Vec<LabelChange>,
) -> Answer {
    let (name, times) = recording_of(hub, shown)?;
    let changes: Vec<_> = changes.into_iter().map(|change| change.at_whole(times.us)).collect();
    for (shown, t_us) in changes.iter().filter_map(|change| shown.zip(change.t_us())) {
        let outside = |reason| Refusal { reason, field: Some("t_us".to_owned()) };
        shown.indexed.check_label(&name, t_us).map_err(outside)?;
    }
    let (answer, written) = oneshot::channel();
    hub.labels.wait(&name, WaitingChanges { changes, answer });
    {
        let _turn = hub.labels.turn(&name).await;
        write_waiting(hub, &name, times).await;
    }
    let change = written.await.unwrap_or_else(|_| Err(Refusal::bug("labels:")))?;
    change.into_iter().for_each(|change| history.add(&name, change));
    Ok(())
}

/// Writes all changes that wait for a table, and answers them.
async fn write_waiting(hub: &Hub, name: &str, times: LabelTimes) {
    let waiting = hub.labels.take_waiting(name);
    // Another request may have written them with its own.
    if waiting.is_empty() {
        return;
    }
    let edits = hub.labels.edits(name, &waiting);
    let answers = match write(hub, name, times, edits).await {
        Ok(answers) => answers,
        Err(refusal) => vec![Err(refusal); waiting.len()],
    };
    for (changes, answer) in waiting.into_iter().zip(answers) {
        // The client may have left in the meantime.
        let _ = changes.answer.send(answer);
    }
}

async fn write(
    hub: &Hub,
    name: &str,
    times: LabelTimes,
    edits: Vec<Result<Vec<NumberedEdit>, String>>,
) -> Answer<Vec<Answer<Option<u64>>>> {
    let table = hub.folder.file(&file_of(name))?;
    let of_request = |edits: &Vec<NumberedEdit>| edits.iter().map(|(_, edit)| edit.clone()).collect();
    let requests: Vec<Vec<_>> = edits.iter().flatten().map(of_request).collect();
    let recording = name.to_owned();
    let (outcomes, read): (Vec<EditOutcome>, LabelTable) =
        hub.ask(move |handlers| handlers.labels.change(&table, &recording, times, &requests)).await?;
    let mut outcomes = outcomes.into_iter().zip(read.changes.clone());
    let mut answers = vec![];
    for request in edits {
        let failed = || (Err("failed".to_owned()), None);
        let outcome = request.map(|numbered| (numbered, outcomes.next().unwrap_or_else(failed)));
        answers.push(match outcome {
            Ok((numbered, (Ok(rows), change))) => {
                let numbers = numbered.into_iter().map(|(id, _)| id);
                hub.labels.renumber(name, numbers.zip(rows).filter_map(|(id, row)| Some((id?, row))));
                Ok(change)
            }
            Ok((_, (Err(reason), _))) | Err(reason) => Err(reason.into()),
        });
    }
    take(hub, name, times, read);
    Ok(answers)
}

/// Shows a table as it was written.
fn take(hub: &Hub, name: &str, times: LabelTimes, read: LabelTable) {
    hub.labels.replace(name, Some(read));
    hub.labels.follows(name, times);
    hub.clients.send(Broadcast::Labels(name.to_owned()));
}

/// Takes back the last change of labels that a client made in the recording that is shown or being recorded.
pub(crate) async fn undo(hub: &Hub, history: &LabelHistory, shown: Option<&OpenRecording>) -> Answer {
    let (name, times) = recording_of(hub, shown)?;
    let change =
        history.take_last(&name).ok_or("nothing to undo: no label of this recording was changed in this window")?;
    let table = hub.folder.file(&file_of(&name))?;
    let _turn = hub.labels.turn(&name).await;
    let recording = name.clone();
    let read = hub.ask(move |handlers| handlers.labels.undo(&table, &recording, times, change)).await?;
    take(hub, &name, times, read);
    Ok(())
}
