//! The requests that do not concern the client's own view, and may take long: protocol.md, *From the client*.

pub(super) mod labels;
pub(super) mod opening;
mod recording;
pub(super) mod registers;

use std::sync::Arc;
use std::time::Duration;

use taxel_core::Array;
use taxel_core::encode::Encoder;
use taxel_core::held::UNKNOWN;
use taxel_live::locked::lock;
use taxel_live::pipeline::{SourcePreview, SourceText};
use taxel_live::ports::ports;

use super::handler::{Cut, Description, Detected, LabelRow, Mistake, TrainingResult};
use super::hub::Hub;
use super::hub::clients::Broadcast;
use super::hub::indexed::{Indexed, OpenRecording};
use super::hub::labels::{LabelChange, LabelHistory};
use super::hub::live_source::LiveSource;
use super::hub::recorder::RecordingPlan;
use super::protocol::messages::{FoundDetection, InterfaceAddress, Message};
use super::protocol::refusal::{Answer, Refusal};
use super::protocol::request::{DescribeRequest, Id, RecordRequest, Request, RestHow, Taxel};
use super::readout_encoders::ReadoutEncoders;

/// How long lines of a source are read to show them.
const PREVIEW: Duration = Duration::from_secs(2);

/// Carries out a request of a client with this history of changes; `shown` is the recording that it shows. Returns the message for that client alone.
///
/// # Errors
///
/// The refusal, after which nothing has changed.
pub(super) async fn carry_out(
    hub: Arc<Hub>,
    history: &LabelHistory,
    shown: Option<&OpenRecording>,
    request: Request,
) -> Answer<Option<Message>> {
    let change = |change| labels::change(&hub, history, shown, vec![change]);
    match request {
        Request::Set { values } => registers::set(&hub, &values).await?,
        Request::Read {} => registers::read(&hub).await?,
        Request::SendAll {} => registers::send_all(&hub).await?,
        Request::PresetApply { name } => registers::apply_preset(&hub, &name.0).await?,
        Request::PresetSave { name } => registers::save_preset(&hub, &name.0).await?,
        Request::PresetDelete { name } => registers::delete_preset(&hub, &name.0).await?,
        Request::Record(request) => record(&hub, request)?,
        Request::Stop {} => hub.recorder.end()?,
        Request::Note { text } => board(&hub)?.handle.note(&text.0)?,
        Request::Mark { label, t_us, source, replaces_us } => {
            let row = labels::row(shown, label, t_us.0, source);
            change(LabelChange::Mark(LabelRow { replaces_us: replaces_us.map(|t| t.0), ..row })).await?;
        }
        Request::Marks { labels } => {
            labels::change(&hub, history, shown, labels::marks(shown, labels.0)?).await?;
        }
        Request::Rename { label_id, label } => {
            change(LabelChange::Rename { id: number(label_id), label: label.0 }).await?
        }
        Request::Move { label_id, t_us } => change(LabelChange::Move { id: number(label_id), t_us: t_us.0 }).await?,
        Request::Delete { label_id } => change(LabelChange::Delete { id: number(label_id) }).await?,
        Request::Undo {} => labels::undo(&hub, history, shown).await?,
        Request::Health {} => return health(&hub, shown).await.map(Some),
        Request::Cut { start_us, stop_us, name } => {
            return cut(&hub, shown, (start_us.0, stop_us.0), &name.0).await.map(Some);
        }
        Request::Train {} => return train(&hub, shown).await.map(Some),
        Request::Training {} => {
            let text = hub.ask(|handlers| handlers.training.progress()).await?;
            return Ok(Some(Message::Training { text }));
        }
        Request::TrainStop {} => hub.ask(|handlers| handlers.training.end()).await?,
        Request::ReadOut { readout } => return read_out(&hub, shown, readout.0).await,
        Request::Recordings {} => return Ok(Some(hub.recordings_message().await)),
        Request::Rest { how } => rest(&hub, how)?,
        Request::Zero { taxels } => zero(&hub, taxels.0).await?,
        Request::Places {} => return places(&hub).await.map(Some),
        Request::ReadSource { source } => {
            check_restart(&hub)?;
            hub.ask(move |handlers| handlers.board.read_source(&source.0)).await?;
        }
        Request::PreviewSource { source } => return preview(source.0).await.map(Some),
        Request::SaveLayout { source, name } => return save_layout(&hub, source.0, &name.0).await.map(Some),
        Request::Topics { name } => {
            let path = hub.folder.file(&name.0)?;
            let topics = hub.ask(move |handlers| handlers.files.topics(&path)).await?;
            return Ok(Some(Message::Topics { name: name.0, topics }));
        }
        Request::Describe(request) => describe(&hub, request).await?,
        Request::DeltaIntensity { on } => {
            check_restart(&hub)?;
            hub.ask(move |handlers| handlers.board.set_differences(on)).await?;
        }
        Request::Listen { host, port } => {
            check_restart(&hub)?;
            hub.ask(move |handlers| handlers.board.listen(&host.0, port)).await?;
        }
        Request::Control { place } => control(&hub, place.map(|place| place.0)).await?,
        // The session's own.
        Request::Credit { .. }
        | Request::Watch { .. }
        | Request::Encode { .. }
        | Request::Zoom { .. }
        | Request::Seek { .. }
        | Request::Play { .. }
        | Request::Pause {}
        | Request::Step { .. }
        | Request::Live {}
        | Request::Open { .. }
        | Request::Overview {} => return Err(Refusal::bug("type:")),
    }
    Ok(None)
}

fn number(id: Id) -> u64 {
    id.0.unsigned_abs()
}

fn board(hub: &Hub) -> Answer<Arc<LiveSource>> {
    hub.live().ok_or_else(|| "no board is connected".into())
}

/// Whether the live source may restart: on another address, or with another meaning of intensities.
fn check_restart(hub: &Hub) -> Answer {
    if hub.recorder.is_busy() {
        return Err("a recording runs: stop it first".into());
    }
    if hub.live().is_none() {
        return Err("this panel shows recordings only: start it by taxel live --panel".into());
    }
    Ok(())
}

/// Connects the board's serial line, or disconnects it.
async fn control(hub: &Hub, address: Option<String>) -> Answer {
    let connected = {
        let address = address.clone();
        hub.ask(move |handlers| handlers.board.connect(address.as_deref())).await
    };
    let connects = address.is_some();
    {
        let mut board = hub.board();
        board.control = address.filter(|_| connected.is_ok());
        board.known = false;
    }
    hub.clients.send(Broadcast::Hello);
    connected?;
    if connects { registers::read(hub).await } else { Ok(()) }
}

async fn places(hub: &Hub) -> Answer<Message> {
    let serial = tokio::task::spawn_blocking(ports).await.map_err(|_| Refusal::bug("places:"))??;
    let addresses = hub.ask(|handlers| handlers.board.addresses()).await?;
    let addresses = addresses.into_iter().map(|(host, name)| InterfaceAddress { host, name }).collect();
    Ok(Message::Places { serial, addresses })
}

/// Reads what arrives from a source of lines.
async fn preview(source: String) -> Answer<Message> {
    let read = move || source.parse::<SourceText>().and_then(|source| SourcePreview::read(&source, PREVIEW));
    let found = tokio::task::spawn_blocking(read).await.map_err(|_| Refusal::bug("source:"))?;
    let SourcePreview { lines, source, about } = found?;
    Ok(Message::SourcePreview { lines, source, about })
}

async fn save_layout(hub: &Hub, source: String, name: &str) -> Answer<Message> {
    let name = format!("{}.layout.toml", name.trim().trim_end_matches(".layout.toml"));
    let out = hub.folder.file(&name).map_err(|error| Refusal::of_field("name", error))?;
    let command = hub.ask(move |handlers| handlers.files.save_layout(&source, &out)).await?;
    Ok(Message::LayoutSaved { name, command })
}

/// Writes what a client states of a recording beside it, so that it is read again.
async fn describe(hub: &Hub, request: DescribeRequest) -> Answer {
    let DescribeRequest { name, falls, rate_hz, size, topic, field } = request;
    let path = hub.folder.file(&name.0)?;
    let topic = topic.map(|topic| (topic.0, field.map(|field| field.0).unwrap_or_default()));
    let description = Description { falls, rate_hz: rate_hz.map(|rate| rate.0), size, topic };
    let file = path.clone();
    hub.ask(move |handlers| handlers.files.describe(&file, &description)).await?;
    hub.folder.forget_file(&path);
    Ok(())
}

fn rest(hub: &Hub, how: RestHow) -> Answer {
    let live = board(hub)?;
    let mut state = lock(&live.state);
    match how {
        RestHow::Now if state.held().iter().all(|&held| held == UNKNOWN) => {
            return Err("no events have arrived yet".into());
        }
        RestHow::Now => {
            let held = state.held().to_vec();
            state.set_rest(held);
        }
        RestHow::Lowest => state.track_rest(),
    }
    Ok(())
}

async fn zero(hub: &Hub, taxels: Vec<Taxel>) -> Answer {
    let live = board(hub)?;
    // The recording keeps the zeroing, and a disk may be slow.
    let zeroed = tokio::task::spawn_blocking(move || live.handle.zero(&taxels)).await;
    zeroed.map_err(|_| Refusal::bug("zero:"))??;
    Ok(())
}

fn record(hub: &Arc<Hub>, request: RecordRequest) -> Answer {
    let RecordRequest { name, index, countdown_s, length_s, advance, label, format } = request;
    let advance = advance.unwrap_or(false);
    if advance && (index.is_none() || length_s.is_none()) {
        return Err(Refusal::of_field("advance", "needs an index and a length"));
    }
    if hub.live().is_none() {
        return Err("nothing to record: no board is connected".into());
    }
    let plan = RecordingPlan {
        name: name.0,
        index: index.and_then(|index| u32::try_from(index.0).ok()),
        format: format.unwrap_or_default(),
        countdown: countdown_s.map_or(Duration::ZERO, |seconds| Duration::from_secs_f64(seconds.0)),
        length: length_s.map(|seconds| Duration::from_secs_f64(seconds.0)),
        advance,
        label: label.map(|label| label.0),
    };
    recording::start(hub, plan).map_err(|reason| Refusal { reason, field: Some("name".to_owned()) })
}

// ---------------------------------------------------------------------------------------------- training

/// Trains a readout on the labels of the recording that is shown.
async fn train(hub: &Hub, shown: Option<&OpenRecording>) -> Answer<Message> {
    let shown = shown.ok_or("train: open a recording with labels first")?;
    let (name, us) = (shown.name.clone(), shown.indexed.us());
    let readout = readout_of(&name);
    let (recording, out) = (hub.folder.file(&name)?, hub.folder.file(&readout)?);
    let TrainingResult { text, judged_on, scores, mistakes, next } =
        hub.ask(move |handlers| handlers.training.train(&recording, &out)).await?;
    hub.clients.send_message(&hub.recordings_message().await);
    let in_view = |mistake: Mistake| Mistake { t_us: mistake.t_us * us, ..mistake };
    let mistakes = mistakes.into_iter().map(in_view).collect();
    Ok(Message::Trained { name, readout, text, judged_on, scores, mistakes, next })
}

/// The name of the readout that is trained on a recording.
pub(super) fn readout_of(recording: &str) -> String {
    format!("{}.readout.json", recording.rsplit_once('.').map_or(recording, |(stem, _)| stem))
}

/// Runs a readout: on the recording that is shown, or on the live source from now on.
async fn read_out(hub: &Hub, shown: Option<&OpenRecording>, readout: String) -> Answer<Option<Message>> {
    let path = hub.folder.file(&readout).map_err(|error| Refusal::of_field("readout", error))?;
    let Some(OpenRecording { name, trial, .. }) = shown.cloned() else {
        check_restart(hub)?;
        hub.ask(move |handlers| handlers.board.read_out(&path)).await?;
        return Ok(None);
    };
    let recording = hub.folder.file(&name)?;
    let Detected { labels, encoder, detections } =
        hub.ask(move |handlers| handlers.training.detect(&recording, trial.as_deref(), &path)).await?;
    let found = |(label, t_us, known_us, source)| FoundDetection { label, t_us, known_us, source };
    let detections = detections.into_iter().map(found).collect();
    let encoder = encoder.as_deref().map(Encoder::from_json).transpose().map_err(taxel_live::Error::from)?;
    let encoders = encoder.map_or_else(ReadoutEncoders::default, ReadoutEncoders::from);
    Ok(Some(Message::Detections { source: name, readout, labels, encoders, detections }))
}

// ---------------------------------------------------------------------------------------------- health, cutting

/// Number of taxels that exist.
fn taxels(array: &Array) -> usize {
    array.exists.as_ref().map_or(array.len(), |exists| exists.iter().filter(|&&exists| exists).count())
}

async fn health(hub: &Hub, shown: Option<&OpenRecording>) -> Answer<Message> {
    let source = shown.map(|shown| shown.name.clone());
    let (array, activity) = match shown {
        Some(OpenRecording { indexed: Indexed::Events(index), .. }) => {
            (index.header().array.clone(), index.activity.clone())
        }
        Some(OpenRecording { name, trial, indexed: indexed @ Indexed::Frames(_) }) => {
            let (path, trial, taxels) = (hub.folder.file(name)?, trial.clone(), taxels(indexed.index().array()));
            let found = hub.ask(move |handlers| handlers.files.health_of_frames(&path, trial.as_deref())).await?;
            return Ok(Message::Health { source, taxels, active: taxels, found });
        }
        None => {
            let live = hub.live().ok_or("nothing is shown: open a recording first")?;
            let activity = lock(&live.activity).clone();
            (live.array().clone(), activity)
        }
    };
    let taxels = taxels(&array);
    let active = activity.events.iter().filter(|&&n| n > 0).count();
    let found = hub.ask(move |handlers| handlers.files.health(&array, &activity)).await?;
    Ok(Message::Health { source, taxels, active, found })
}

async fn cut(hub: &Hub, shown: Option<&OpenRecording>, (start_us, stop_us): (i64, i64), to: &str) -> Answer<Message> {
    let OpenRecording { name, trial, indexed } = shown.ok_or("cut: open a recording first")?.clone();
    if start_us >= stop_us {
        return Err(Refusal::of_field("stop_us", "must be after start_us"));
    }
    let (path, us) = (hub.folder.file(&name)?, indexed.us());
    let out = hub.folder.file(to).map_err(|error| Refusal::of_field("name", error))?;
    if out.exists() {
        return Err(Refusal::of_field("name", format!("{to}: exists already; choose another name")));
    }
    // The first frame from the start on, and the first after the end.
    let in_file = |t: i64| -(-t).div_euclid(us);
    let (start_us, stop_us) = (in_file(start_us), in_file(stop_us));
    let lost = hub
        .ask(move |handlers| {
            handlers.files.cut(&Cut { path: &path, trial: trial.as_deref(), out: &out, start_us, stop_us })
        })
        .await?;
    hub.clients.send_message(&hub.recordings_message().await);
    Ok(Message::Cut { name: to.to_owned(), lost })
}
