//! The requests that do not concern the client's own view, and may take long: docs/panel-protocol.md, *From the client*.

use std::sync::Arc;
use std::time::Duration;

use serde_json::{Value, json};
use taxel_core::Array;
use taxel_core::held::UNKNOWN;
use taxel_live::locked::lock;
use taxel_live::ports::ports;

use super::clients::Broadcast;
use super::handler::{Cut, Detected, UnhealthyTaxels};
use super::hub::Hub;
use super::indexed::{Indexed, Shown};
use super::live_source::LiveSource;
use super::recorder::{RecordingFormat, RecordingPlan};
use super::request::{Answer, Refusal, Request};
use super::{label_requests, recording_session, registers};

/// Carries out a request; `shown` is the recording that the client shows. Returns the message for that client alone.
///
/// # Errors
///
/// The refusal, after which nothing has changed.
pub(super) async fn carry_out(
    hub: Arc<Hub>,
    what: &str,
    shown: Option<&Shown>,
    request: Request<'_>,
) -> Answer<Option<Value>> {
    match what {
        "set" => registers::set(&hub, &request).await?,
        "read" => registers::read(&hub).await?,
        "send_all" => registers::send_all(&hub).await?,
        "preset_apply" => registers::apply_preset(&hub, request.text("name", 60)?).await?,
        "preset_save" => registers::save_preset(&hub, request.text("name", 60)?).await?,
        "preset_delete" => registers::delete_preset(&hub, request.text("name", 60)?).await?,
        "record" => record(&hub, &request)?,
        "stop" => hub.recorder.end()?,
        "note" => board(&hub)?.handle.note(request.text("text", 200)?)?,
        "mark" | "marks" | "rename" | "move" | "delete" => {
            let changes = label_requests::changes(what, shown, &request)?;
            label_requests::change(&hub, shown, changes).await?;
        }
        "settle" => label_requests::settle(&hub, shown, &request).await?,
        "health" => return health(&hub, shown).await.map(Some),
        "cut" => return cut(&hub, shown, &request).await.map(Some),
        "train" => return train(&hub, shown).await.map(Some),
        "training" => {
            let text = hub.ask(|handlers| handlers.training.progress()).await?;
            return Ok(Some(json!({ "type": "training", "text": text })));
        }
        "train_stop" => hub.ask(|handlers| handlers.training.end()).await?,
        "read_out" => return read_out(&hub, shown, &request).await,
        "recordings" => return Ok(Some(hub.recordings_message().await)),
        "rest" => rest(&hub, &request)?,
        "zero" => zero(&hub, &request).await?,
        "places" => return places(&hub).await.map(Some),
        "delta_intensity" => {
            check_restart(&hub)?;
            let on = request.flag("on")?;
            hub.ask(move |handlers| handlers.board.set_differences(on)).await?;
        }
        "listen" => {
            check_restart(&hub)?;
            let (host, port) = (request.text("host", 255)?.to_owned(), request.whole("port", 0, 65_535)?);
            let port = u16::try_from(port).unwrap_or(u16::MAX);
            hub.ask(move |handlers| handlers.board.listen(&host, port)).await?;
        }
        "control" => control(&hub, &request).await?,
        _ => return Err(format!("type {what:?} is none of the protocol's").into()),
    }
    Ok(None)
}

fn board(hub: &Hub) -> Answer<Arc<LiveSource>> {
    hub.live().ok_or_else(|| "no board is listened to".into())
}

/// Whether the live source may restart: on another address, or with another meaning of intensities.
fn check_restart(hub: &Hub) -> Answer {
    if hub.recorder.is_busy() {
        return Err("a recording runs: stop it first".into());
    }
    if hub.live().is_none() {
        return Err("this panel shows recordings only: begin it with taxel live --panel".into());
    }
    Ok(())
}

/// Connects the board's serial line, or disconnects it.
async fn control(hub: &Hub, request: &Request<'_>) -> Answer {
    let place = request.optional_text("place", 255)?.map(str::to_owned);
    let connected = {
        let place = place.clone();
        hub.ask(move |handlers| handlers.board.connect(place.as_deref())).await
    };
    let connects = place.is_some();
    {
        let mut board = hub.board();
        board.control = place.filter(|_| connected.is_ok());
        board.known = false;
    }
    hub.clients.send(Broadcast::Hello);
    connected?;
    if connects { registers::read(hub).await } else { Ok(()) }
}

async fn places(hub: &Hub) -> Answer<Value> {
    let serial = tokio::task::spawn_blocking(ports).await.map_err(|_| Refusal::bug("places:"))??;
    let addresses = hub.ask(|handlers| handlers.board.addresses()).await?;
    let addresses: Vec<_> = addresses.into_iter().map(|(host, name)| json!({ "host": host, "name": name })).collect();
    Ok(json!({ "type": "places", "serial": serial, "addresses": addresses }))
}

fn rest(hub: &Hub, request: &Request<'_>) -> Answer {
    let live = board(hub)?;
    let mut state = lock(&live.state);
    match request.get("how").and_then(Value::as_str) {
        Some("now") if state.held().iter().all(|&held| held == UNKNOWN) => Err("no events have arrived yet".into()),
        Some("now") => {
            let held = state.held().to_vec();
            state.set_rest(held);
            Ok(())
        }
        Some("lowest") => {
            state.track_rest();
            Ok(())
        }
        _ => Err(Refusal::of("how", "must be now or lowest")),
    }
}

async fn zero(hub: &Hub, request: &Request<'_>) -> Answer {
    let (live, taxels) = (board(hub)?, request.taxels("taxels")?);
    // The recording keeps the zeroing, and a disk may be slow.
    let zeroed = tokio::task::spawn_blocking(move || live.handle.zero(&taxels)).await;
    zeroed.map_err(|_| Refusal::bug("zero:"))??;
    Ok(())
}

fn record(hub: &Arc<Hub>, request: &Request<'_>) -> Answer {
    let name = request.text("name", 100)?;
    let index = if request.has("index") { Some(request.whole("index", 0, 999_999)?) } else { None };
    let length = if request.has("length_s") { Some(request.number("length_s", 0.01, 86_400.0)?) } else { None };
    let countdown = if request.has("countdown_s") { request.number("countdown_s", 0.0, 60.0)? } else { 0.0 };
    let format = match request.get("format").and_then(Value::as_str) {
        None | Some("mcap") => RecordingFormat::Mcap,
        Some("lsa") => RecordingFormat::Lsa,
        Some(_) => return Err(Refusal::of("format", "must be mcap or lsa")),
    };
    let advance = request.optional_flag("advance")?;
    if advance && (index.is_none() || length.is_none()) {
        return Err(Refusal::of("advance", "needs an index and a length"));
    }
    if hub.live().is_none() {
        return Err("no board is listened to: nothing to record".into());
    }
    let plan = RecordingPlan {
        name: name.to_owned(),
        index: index.and_then(|index| u32::try_from(index).ok()),
        format,
        countdown: Duration::from_secs_f64(countdown),
        length: length.map(Duration::from_secs_f64),
        advance,
        label: request.optional_text("label", 200)?.map(str::to_owned),
    };
    recording_session::start(hub, plan).map_err(|reason| Refusal { reason, field: Some("name".to_owned()) })
}

// ---------------------------------------------------------------------------------------------- training

/// Trains a readout on the labels of the recording that is shown.
async fn train(hub: &Hub, shown: Option<&Shown>) -> Answer<Value> {
    let name = &shown.ok_or("train: open a recording with labels first")?.name;
    let readout = readout_of(name);
    let (recording, out) = (hub.folder.file(name)?, hub.folder.file(&readout)?);
    let text = hub.ask(move |handlers| handlers.training.train(&recording, &out)).await?;
    hub.clients.send_json(&hub.recordings_message().await);
    Ok(json!({ "type": "trained", "name": name, "readout": readout, "text": text }))
}

/// The name of the readout that is trained on a recording.
pub(super) fn readout_of(recording: &str) -> String {
    format!("{}.readout.json", recording.rsplit_once('.').map_or(recording, |(stem, _)| stem))
}

/// Runs a readout: on the recording that is shown, or on the live source from now on.
async fn read_out(hub: &Hub, shown: Option<&Shown>, request: &Request<'_>) -> Answer<Option<Value>> {
    let readout = request.text("readout", 110)?;
    let path = hub.folder.file(readout).map_err(|error| Refusal::of("readout", error))?;
    let Some(Shown { name, trial, .. }) = shown.cloned() else {
        check_restart(hub)?;
        hub.ask(move |handlers| handlers.board.read_out(&path)).await?;
        return Ok(None);
    };
    let recording = hub.folder.file(&name)?;
    let Detected { labels, detections } =
        hub.ask(move |handlers| handlers.training.detect(&recording, trial.as_deref(), &path)).await?;
    let one = |(label, t, known)| json!({ "label": label, "t_us": t, "known_us": known });
    let found: Vec<_> = detections.into_iter().map(one).collect();
    Ok(Some(json!({
        "type": "detections", "source": name, "readout": readout, "labels": labels, "detections": found,
    })))
}

// ---------------------------------------------------------------------------------------------- health, cutting

/// Number of taxels that exist.
fn taxels(array: &Array) -> usize {
    array.exists.as_ref().map_or(array.len(), |exists| exists.iter().filter(|&&one| one).count())
}

async fn health(hub: &Hub, shown: Option<&Shown>) -> Answer<Value> {
    let name = shown.map(|shown| shown.name.as_str());
    let (array, activity) = match shown {
        Some(Shown { indexed: Indexed::Events(index), .. }) => (index.header().array.clone(), index.activity.clone()),
        Some(Shown { name, trial, indexed: indexed @ Indexed::Pictures(_) }) => {
            let (path, trial, taxels) = (hub.folder.file(name)?, trial.clone(), taxels(indexed.index().array()));
            let found = hub.ask(move |handlers| handlers.files.health_of_pictures(&path, trial.as_deref())).await?;
            let UnhealthyTaxels { dead, stuck, noisy, untold } = found;
            return Ok(json!({
                "type": "health", "source": name, "taxels": taxels, "heard": taxels, "dead": dead, "stuck": stuck,
                "noisy": noisy, "untold": untold,
            }));
        }
        None => {
            let live = hub.live().ok_or("nothing is shown")?;
            let activity = lock(&live.activity).clone();
            (live.array().clone(), activity)
        }
    };
    let taxels = taxels(&array);
    let with_events = activity.events.iter().filter(|&&n| n > 0).count();
    let UnhealthyTaxels { dead, stuck, noisy, untold } =
        hub.ask(move |handlers| handlers.files.health(&array, &activity)).await?;
    Ok(json!({
        "type": "health", "source": name, "taxels": taxels, "heard": with_events, "dead": dead, "stuck": stuck,
        "noisy": noisy, "untold": untold,
    }))
}

async fn cut(hub: &Hub, shown: Option<&Shown>, request: &Request<'_>) -> Answer<Value> {
    let Shown { name, trial, indexed } = shown.ok_or("cut: open a recording first")?.clone();
    let (start_us, stop_us) = (request.time("start_us")?, request.time("stop_us")?);
    if start_us >= stop_us {
        return Err(Refusal::of("stop_us", "must lie after start_us"));
    }
    let to = request.text("name", 100)?;
    let (path, us) = (hub.folder.file(&name)?, indexed.us());
    let out = hub.folder.file(to).map_err(|error| Refusal::of("name", error))?;
    if out.exists() {
        return Err(Refusal::of("name", format!("{to} exists already; name another")));
    }
    // The first picture from the start on, and the first after the end.
    let in_file = |t: i64| -(-t).div_euclid(us);
    let (start_us, stop_us) = (in_file(start_us), in_file(stop_us));
    let lost = hub
        .ask(move |handlers| {
            handlers.files.cut(&Cut { path: &path, trial: trial.as_deref(), out: &out, start_us, stop_us })
        })
        .await?;
    hub.clients.send_json(&hub.recordings_message().await);
    Ok(json!({ "type": "cut", "name": to, "lost": lost }))
}
