//! State of the recorder: what is recorded, and how far it is.

use std::sync::Mutex;
use std::time::{Duration, Instant};

use taxel_live::locked::lock;
use taxel_live::recording::numbered;
use tokio::sync::Notify;

use crate::protocol::messages::{LastRecording, Message, RecorderPhase};
use crate::protocol::request::RecordingFormat;

/// What is to be recorded.
#[derive(Debug, Clone)]
pub(crate) struct RecordingPlan {
    pub(crate) name: String,
    /// Number of the next recording, appended to the name.
    pub(crate) index: Option<u32>,
    pub(crate) format: RecordingFormat,
    pub(crate) countdown: Duration,
    pub(crate) length: Option<Duration>,
    /// Whether the next recording begins by itself.
    pub(crate) advance: bool,
    pub(crate) label: Option<String>,
}

impl RecordingFormat {
    /// Ending of the file's name.
    fn ending(self) -> &'static str {
        match self {
            Self::Mcap => "mcap",
            Self::Lsa => "lsa",
        }
    }
}

impl RecordingPlan {
    /// Name of the next file.
    pub(crate) fn file(&self) -> String {
        let plain = format!("{}.{}", self.name, self.format.ending());
        match self.index {
            Some(index) => numbered(plain.as_ref(), index).to_string_lossy().into_owned(),
            None => plain,
        }
    }
}

/// What the recorder does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum Phase {
    #[default]
    Idle,
    /// The recording begins at this time.
    Countdown(Instant),
    /// The recording began at this time.
    Recording(Instant),
    Finishing,
}

#[derive(Debug, Default)]
pub(crate) struct RecorderState {
    pub(crate) phase: Phase,
    pub(crate) plan: Option<RecordingPlan>,
    /// File and verdict of the last recording.
    pub(crate) last: Option<(String, String)>,
    /// Why the last recording ended early or did not begin.
    pub(crate) error: Option<String>,
}

/// Starts and ends recordings, and tells clients how far the present one is.
#[derive(Debug, Default)]
pub(crate) struct RecorderControl {
    pub(crate) state: Mutex<RecorderState>,
    pub(crate) stop: Notify,
}

impl RecorderControl {
    /// The file that is being recorded.
    pub(crate) fn file(&self) -> Option<String> {
        let state = lock(&self.state);
        let records = matches!(state.phase, Phase::Recording(_) | Phase::Finishing);
        state.plan.as_ref().filter(|_| records).map(RecordingPlan::file)
    }

    pub(crate) fn is_busy(&self) -> bool {
        lock(&self.state).phase != Phase::Idle
    }

    /// The `recorder` message.
    pub(crate) fn message(&self) -> Message {
        let state = lock(&self.state);
        let plan = state.plan.as_ref();
        let length = plan.and_then(|plan| plan.length);
        let (phase, left, seconds) = match state.phase {
            Phase::Idle => (RecorderPhase::Idle, None, None),
            Phase::Countdown(until) => {
                (RecorderPhase::Countdown, Some(until.saturating_duration_since(Instant::now())), None)
            }
            Phase::Recording(since) => {
                let passed = since.elapsed();
                (
                    RecorderPhase::Recording,
                    length.map(|length| length.saturating_sub(passed)),
                    Some(passed.as_secs_f64()),
                )
            }
            Phase::Finishing => (RecorderPhase::Finishing, None, None),
        };
        Message::Recorder {
            state: phase,
            name: plan.map(|plan| plan.name.clone()),
            index: plan.and_then(|plan| plan.index),
            file: plan.filter(|_| state.phase != Phase::Idle).map(RecordingPlan::file),
            label: plan.and_then(|plan| plan.label.clone()),
            advance: plan.is_some_and(|plan| plan.advance),
            left_s: left.map(|left| left.as_secs_f64()),
            seconds,
            length_s: length.map(|length| length.as_secs_f64()),
            last: state.last.clone().map(|(file, verdict)| LastRecording { file, verdict }),
            error: state.error.clone(),
        }
    }

    /// Begins the countdown of a recording.
    ///
    /// # Errors
    ///
    /// Refused while the recorder is busy.
    pub(crate) fn plan(&self, plan: RecordingPlan) -> Result<(), String> {
        let mut state = lock(&self.state);
        if state.phase != Phase::Idle {
            return Err("a recording runs already: stop it first".to_owned());
        }
        state.phase = Phase::Countdown(Instant::now() + plan.countdown);
        state.plan = Some(plan);
        state.error = None;
        Ok(())
    }

    /// Ends the recording or its countdown, and a series of recordings.
    ///
    /// # Errors
    ///
    /// Refused while the recorder is idle.
    pub(crate) fn end(&self) -> Result<(), String> {
        let mut state = lock(&self.state);
        if state.phase == Phase::Idle {
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
