//! What the recorder does and is to do: countdown, length, numbers.

use std::sync::Mutex;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tokio::sync::Notify;

use crate::locked::lock;
use crate::recording::numbered;

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
pub(super) enum Doing {
    #[default]
    Idle,
    Countdown(Instant),
    Recording(Instant),
    Finishing,
}

#[derive(Debug, Default)]
pub(super) struct RecorderState {
    pub(super) doing: Doing,
    pub(super) plan: Option<Plan>,
    pub(super) last: Option<(String, String)>,
    pub(super) error: Option<String>,
}

/// See the module.
#[derive(Debug, Default)]
pub(super) struct Recorder {
    pub(super) state: Mutex<RecorderState>,
    pub(super) stop: Notify,
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

    /// Takes what is to be recorded; refused while it is busy.
    pub(super) fn plan(&self, plan: Plan) -> Result<(), String> {
        let mut state = lock(&self.state);
        if state.doing != Doing::Idle {
            return Err("a recording runs already: stop it first".to_owned());
        }
        state.doing = Doing::Countdown(Instant::now() + plan.countdown);
        state.plan = Some(plan);
        state.error = None;
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
}
