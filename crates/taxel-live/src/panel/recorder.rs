//! The recorder: countdown, length, numbers, and the board's own `record` register. It goes on when every page is closed.

use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tokio::sync::Notify;

use super::hub::{Hub, lock};
use crate::pipeline::Record;
use crate::recording::{Compression, numbered};

/// How often it says how far it is.
const TELL_EVERY: Duration = Duration::from_secs(1);

/// After the board was told to stop its marker is waited for so long.
const LAST_WORDS: Duration = Duration::from_millis(100);

/// REG7 while a recording runs (Table 5.5).
const RECORD: u32 = 1 << 16;

/// What is to be recorded.
#[derive(Debug, Clone)]
pub(super) struct Plan {
    pub(super) name: String,
    pub(super) index: Option<u32>,
    pub(super) ending: &'static str,
    pub(super) countdown: Duration,
    pub(super) length: Option<Duration>,
    pub(super) advance: bool,
    pub(super) label: Option<String>,
}

impl Plan {
    /// The file of the next recording.
    pub(super) fn file(&self) -> String {
        let plain = format!("{}.{}", self.name, self.ending);
        match self.index {
            Some(index) => numbered(plain.as_ref(), index).to_string_lossy().into_owned(),
            None => plain,
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum Doing {
    #[default]
    Idle,
    Countdown(Instant),
    Recording(Instant),
    Finishing,
}

#[derive(Debug, Default)]
struct State {
    doing: Doing,
    plan: Option<Plan>,
    last: Option<(String, String)>,
    error: Option<String>,
}

/// See the module.
#[derive(Debug, Default)]
pub(super) struct Recorder {
    state: Mutex<State>,
    stop: Notify,
}

impl Recorder {
    /// The file that is being recorded.
    pub(super) fn file(&self) -> Option<String> {
        let state = lock(&self.state);
        let records = matches!(state.doing, Doing::Recording(_) | Doing::Finishing);
        state.plan.as_ref().filter(|_| records).map(Plan::file)
    }

    /// Whether it does anything.
    pub(super) fn is_busy(&self) -> bool {
        lock(&self.state).doing != Doing::Idle
    }

    pub(super) fn said(&self) -> Value {
        let state = lock(&self.state);
        let plan = state.plan.as_ref();
        let length = plan.and_then(|plan| plan.length);
        let (name, left, seconds) = match state.doing {
            Doing::Idle => ("idle", None, None),
            Doing::Countdown(until) => ("countdown", Some(until.saturating_duration_since(Instant::now())), None),
            Doing::Recording(since) => {
                let passed = since.elapsed();
                ("recording", length.map(|length| length.saturating_sub(passed)), Some(passed.as_secs_f64()))
            }
            Doing::Finishing => ("finishing", None, None),
        };
        json!({
            "type": "recorder",
            "state": name,
            "name": plan.map(|plan| &plan.name),
            "index": plan.and_then(|plan| plan.index),
            "file": plan.filter(|_| state.doing != Doing::Idle).map(Plan::file),
            "label": plan.and_then(|plan| plan.label.as_ref()),
            "advance": plan.is_some_and(|plan| plan.advance),
            "left_s": left.map(|left| left.as_secs_f64()),
            "seconds": seconds,
            "length_s": length.map(|length| length.as_secs_f64()),
            "last": state.last.as_ref().map(|(file, verdict)| json!({ "file": file, "verdict": verdict })),
            "error": state.error,
        })
    }

    /// Begins; refused while it is busy, and where the file is there already.
    pub(super) fn start(&self, hub: &Arc<Hub>, plan: Plan) -> Result<(), String> {
        let file = plan.file();
        let path = hub.place(&file).map_err(|error| error.to_string())?;
        if path.exists() {
            return Err(format!("{file}: exists already; name another, or another index"));
        }
        let mut state = lock(&self.state);
        if state.doing != Doing::Idle {
            return Err("a recording runs already: stop it first".to_owned());
        }
        state.doing = Doing::Countdown(Instant::now() + plan.countdown);
        state.plan = Some(plan);
        state.error = None;
        drop(state);
        tokio::spawn(run(Arc::clone(hub)));
        Ok(())
    }

    /// Ends what it does.
    pub(super) fn end(&self) -> Result<(), String> {
        let mut state = lock(&self.state);
        if state.doing == Doing::Idle {
            return Err("nothing is recorded".to_owned());
        }
        if let Some(plan) = &mut state.plan {
            plan.advance = false;
        }
        drop(state);
        self.stop.notify_one();
        Ok(())
    }

    fn set(&self, hub: &Hub, change: impl FnOnce(&mut State)) {
        change(&mut lock(&self.state));
        hub.tell_all(&self.said());
    }

    /// Waits until a time, or for ever, saying now and then how far it is; true where it was told to stop, or `broken`.
    async fn wait(&self, hub: &Hub, until: Option<Instant>, broken: impl Fn() -> bool) -> bool {
        let mut told = Instant::now();
        loop {
            let left = until.map_or(TELL_EVERY, |until| until.saturating_duration_since(Instant::now()));
            if left.is_zero() {
                return false;
            }
            let stopped = tokio::time::timeout(left.min(TELL_EVERY / 10), self.stop.notified()).await.is_ok();
            if stopped || broken() {
                return true;
            }
            if told.elapsed() >= TELL_EVERY {
                told = Instant::now();
                hub.tell_all(&self.said());
            }
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
        if recorder.wait(&hub, Some(until), || false).await {
            recorder.set(&hub, |state| state.doing = Doing::Idle);
            return;
        }
        let outcome = one(&hub, &plan).await;
        hub.tell_all(&hub.recordings());
        let mut next = false;
        recorder.set(&hub, |state| {
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
    hub.recorder.set(hub, |state| state.doing = Doing::Recording(since));
    tell_board(hub, true).await;
    let noted = plan.label.as_ref().filter(|_| plan.ending == "mcap").map(|label| live.handle.note(label));
    if let Some(Err(error)) = noted {
        hub.tell_all(&json!({ "type": "warning", "text": format!("label: {error}") }));
    }
    let until = plan.length.map(|length| since + length);
    hub.recorder.wait(hub, until, || !live.handle.records() || live.handle.is_over()).await;
    tell_board(hub, false).await;
    hub.recorder.set(hub, |state| state.doing = Doing::Finishing);
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
