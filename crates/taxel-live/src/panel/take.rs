//! One recording after another, as planned, and the board's own `record` register. It goes on when every page is closed.

use std::sync::Arc;
use std::time::{Duration, Instant};

use serde_json::json;

use super::hub::Hub;
use super::recorder::{Doing, Plan, RecorderState};
use crate::locked::lock;
use crate::pipeline::Record;
use crate::recording::Compression;

/// How often it says how far it is.
const TELL_EVERY: Duration = Duration::from_secs(1);

/// After the board was told to stop its marker is waited for so long.
const LAST_WORDS: Duration = Duration::from_millis(100);

/// REG7 while a recording runs (Table 5.5).
const RECORD: u32 = 1 << 16;

/// Begins; refused while the recorder is busy, and where the file is there already.
pub(super) fn start(hub: &Arc<Hub>, plan: Plan) -> Result<(), String> {
    let file = plan.file();
    let path = hub.place(&file).map_err(|error| error.to_string())?;
    if path.exists() {
        return Err(format!("{file}: exists already; name another, or another index"));
    }
    hub.recorder.plan(plan)?;
    tokio::spawn(run(Arc::clone(hub)));
    Ok(())
}

fn set(hub: &Hub, change: impl FnOnce(&mut RecorderState)) {
    change(&mut lock(&hub.recorder.state));
    hub.tell_all(&hub.recorder.said());
}

/// Waits until a time, or for ever, saying now and then how far it is; true where it was told to stop, or `broken`.
async fn wait(hub: &Hub, until: Option<Instant>, broken: impl Fn() -> bool) -> bool {
    let mut told = Instant::now();
    loop {
        let left = until.map_or(TELL_EVERY, |until| until.saturating_duration_since(Instant::now()));
        if left.is_zero() {
            return false;
        }
        let stopped = tokio::time::timeout(left.min(TELL_EVERY / 10), hub.recorder.stop.notified()).await.is_ok();
        if stopped || broken() {
            return true;
        }
        if told.elapsed() >= TELL_EVERY {
            told = Instant::now();
            hub.tell_all(&hub.recorder.said());
        }
    }
}

/// The board's own register, where there is a line to it.
async fn tell_board(hub: &Hub, record: bool) {
    if hub.state().control.is_none() {
        return;
    }
    let value = if record { RECORD } else { 0 };
    match hub.ask("command", json!({ "register": 7, "value": value })).await {
        Ok(_) => {
            hub.state().registers.record = record;
            hub.tell_all(&hub.registers());
        }
        Err(reason) => hub.tell_all(&json!({ "type": "warning", "text": format!("register record: {reason}") })),
    }
}

async fn run(hub: Arc<Hub>) {
    let recorder = &hub.recorder;
    loop {
        let (until, plan) = {
            let state = lock(&recorder.state);
            let (Doing::Countdown(until), Some(plan)) = (state.doing, state.plan.clone()) else { return };
            (until, plan)
        };
        hub.tell_all(&recorder.said());
        if wait(&hub, Some(until), || false).await {
            set(&hub, |state| state.doing = Doing::Idle);
            return;
        }
        let outcome = one(&hub, &plan).await;
        hub.tell_all(&hub.recordings());
        let mut next = false;
        set(&hub, |state| {
            state.doing = Doing::Idle;
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
                state.doing = Doing::Countdown(Instant::now() + plan.countdown);
            }
        });
        if !next {
            return;
        }
    }
}

/// One recording, from its start to its end.
async fn one(hub: &Arc<Hub>, plan: &Plan) -> Result<String, String> {
    let live = hub.live().ok_or("no board is listened to: nothing to record")?;
    let path = hub.place(&plan.file()).map_err(|error| error.to_string())?;
    let record = Record { path, compression: Compression::None, overwrite: false };
    let failed = || "failed within taxel; please report it".to_owned();
    let handle = live.handle.clone();
    let begun = tokio::task::spawn_blocking(move || handle.record(&record)).await;
    begun.map_err(|_| failed())?.map_err(|error| error.to_string())?;
    let since = Instant::now();
    set(hub, |state| state.doing = Doing::Recording(since));
    tell_board(hub, true).await;
    let noted = plan.label.as_ref().filter(|_| plan.ending == "mcap").map(|label| live.handle.entitle(label));
    if let Some(Err(error)) = noted {
        hub.tell_all(&json!({ "type": "warning", "text": format!("label: {error}") }));
    }
    let until = plan.length.map(|length| since + length);
    wait(hub, until, || !live.handle.records() || live.handle.is_over()).await;
    tell_board(hub, false).await;
    set(hub, |state| state.doing = Doing::Finishing);
    if hub.state().control.is_some() {
        tokio::time::sleep(LAST_WORDS).await;
    }
    let handle = live.handle.clone();
    let ended = tokio::task::spawn_blocking(move || handle.end_recording()).await.map_err(|_| failed())?;
    match ended.map_err(|error| error.to_string())? {
        (Some(_), verdict) => Ok(verdict),
        (None, _) => Err("nothing came while it recorded: no file was kept".to_owned()),
    }
}
