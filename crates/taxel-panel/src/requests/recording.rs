//! One recording after another as planned, with the board's own `record` register. It continues without clients.

use std::sync::Arc;
use std::time::{Duration, Instant};

use taxel_core::wire::Command;
use taxel_live::capture::FIREWALL;
use taxel_live::locked::lock;
use taxel_live::pipeline::{LiveSummary, Record};
use taxel_live::recording::Compression;

use crate::hub::Hub;
use crate::hub::recorder::{Phase, RecorderState, RecordingPlan};
use crate::protocol::messages::Message;
use crate::protocol::request::RecordingFormat;

/// How often progress is sent to the clients.
const PROGRESS_EVERY: Duration = Duration::from_secs(1);

/// Waits so long for the board's stop marker after the register was written.
const STOP_MARKER_WITHIN: Duration = Duration::from_millis(100);

/// Value of REG7 while a recording runs (Table 5.5).
const RECORD: u32 = 1 << 16;

/// Begins as planned.
///
/// # Errors
///
/// Refused while the recorder is busy, and where the file exists.
pub(crate) fn start(hub: &Arc<Hub>, plan: RecordingPlan) -> Result<(), String> {
    let file = plan.file();
    let path = hub.folder.file(&file).map_err(|error| error.to_string())?;
    if path.exists() {
        return Err(format!("{file}: exists already; choose another name or index"));
    }
    hub.recorder.plan(plan)?;
    tokio::spawn(run(Arc::clone(hub)));
    Ok(())
}

fn set(hub: &Hub, change: impl FnOnce(&mut RecorderState)) {
    change(&mut lock(&hub.recorder.state));
    hub.clients.send_message(&hub.recorder.message());
}

/// Waits until a time, or without limit, and reports progress; true where it was stopped or `broken` before.
async fn wait(hub: &Hub, until: Option<Instant>, broken: impl Fn() -> bool) -> bool {
    let mut reported = Instant::now();
    loop {
        let left = until.map_or(PROGRESS_EVERY, |until| until.saturating_duration_since(Instant::now()));
        if left.is_zero() {
            return false;
        }
        let stopped = tokio::time::timeout(left.min(PROGRESS_EVERY / 10), hub.recorder.stop.notified()).await.is_ok();
        if stopped || broken() {
            return true;
        }
        if reported.elapsed() >= PROGRESS_EVERY {
            reported = Instant::now();
            hub.clients.send_message(&hub.recorder.message());
        }
    }
}

/// Writes the board's register `record`, where the serial line is connected.
async fn write_record_register(hub: &Hub, record: bool) {
    if hub.board().control.is_none() {
        return;
    }
    let command = Command { register: 7, value: if record { RECORD } else { 0 } };
    match hub.ask(move |handlers| handlers.board.command(command)).await {
        Ok(_) => {
            hub.board().registers.record = record;
            hub.clients.send_message(&hub.registers_message());
        }
        Err(reason) => hub.clients.send_message(&Message::warning(format!("register record: {reason}"))),
    }
}

async fn run(hub: Arc<Hub>) {
    let recorder = &hub.recorder;
    loop {
        let (until, plan) = {
            let state = lock(&recorder.state);
            let (Phase::Countdown(until), Some(plan)) = (state.phase, state.plan.clone()) else { return };
            (until, plan)
        };
        hub.clients.send_message(&recorder.message());
        if wait(&hub, Some(until), || false).await {
            set(&hub, |state| state.phase = Phase::Idle);
            return;
        }
        let outcome = record(&hub, &plan).await;
        hub.clients.send_message(&hub.recordings_message().await);
        let mut next = false;
        set(&hub, |state| {
            state.phase = Phase::Idle;
            match outcome {
                Ok(verdict) => {
                    state.last = Some((plan.file(), verdict));
                    if let Some(plan) = &mut state.plan {
                        plan.index = plan.index.map(|index| index.saturating_add(1));
                        next = plan.advance && plan.index.is_some();
                    }
                }
                Err(reason) => state.error = Some(reason),
            }
            if next {
                state.phase = Phase::Countdown(Instant::now() + plan.countdown);
            }
        });
        if !next {
            return;
        }
    }
}

/// Makes one recording; returns its verdict.
async fn record(hub: &Arc<Hub>, plan: &RecordingPlan) -> Result<String, String> {
    let live = hub.live().ok_or("nothing to record: no board is connected")?;
    let path = hub.folder.file(&plan.file()).map_err(|error| error.to_string())?;
    let record = Record { path, compression: Compression::None, overwrite: false };
    let failed = || "failed within taxel; please report it".to_owned();
    if live.handle.is_recording() {
        return Err("a recording runs already: stop it first".to_owned());
    }
    let handle = live.handle.clone();
    let begun = tokio::task::spawn_blocking(move || handle.record(&record)).await;
    begun.map_err(|_| failed())?.map_err(|error| error.to_string())?;
    let since = Instant::now();
    set(hub, |state| state.phase = Phase::Recording(since));
    write_record_register(hub, true).await;
    let noted =
        plan.label.as_ref().filter(|_| plan.format == RecordingFormat::Mcap).map(|label| live.handle.entitle(label));
    if let Some(Err(error)) = noted {
        hub.clients.send_message(&Message::warning(format!("label: {error}")));
    }
    let until = plan.length.map(|length| since + length);
    wait(hub, until, || !live.handle.records() || live.handle.is_over()).await;
    write_record_register(hub, false).await;
    set(hub, |state| state.phase = Phase::Finishing);
    if hub.board().control.is_some() {
        tokio::time::sleep(STOP_MARKER_WITHIN).await;
    }
    let handle = live.handle.clone();
    let ended = tokio::task::spawn_blocking(move || handle.end_recording()).await.map_err(|_| failed())?;
    match ended.map_err(|error| error.to_string())? {
        LiveSummary { path: Some(_), verdict, .. } => Ok(verdict.text),
        LiveSummary { path: None, .. } => {
            Err(format!("no datagrams arrived during the recording{FIREWALL}: no file was written"))
        }
    }
}
