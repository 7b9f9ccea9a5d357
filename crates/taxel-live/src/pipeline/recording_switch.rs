//! Recordings that begin and end while the pipeline runs, of all its sources: those of `taxel record` and of the panel.

use std::collections::BTreeMap;
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex};

use crossbeam_channel as channel;
use taxel_core::problem;

use super::counters::{Counters, LiveSummary, SourceCounts};
use super::frame_input::LineCounts;
use super::options::Record;
use super::running_recording::{RunningRecording, losses};
use super::shared::{EndedRecording, PipelineRequest, PipelineShared};
use super::sources::{NumberStream, losses_of_lines};
use crate::capture::{FIREWALL, Origin};
use crate::locked::lock;
use crate::recording::{RecordingCounts, Verdict};
use crate::{Error, Result};

/// Starts and ends the recordings of a pipeline.
pub(super) struct RecordingSwitch {
    shared: Arc<PipelineShared>,
    /// The other sources of a recording, by name.
    pipelines: Vec<(String, Arc<PipelineShared>)>,
    numbers: Vec<(String, Arc<NumberStream>)>,
    /// Locked while one recording replaces another.
    replacing: Mutex<()>,
}

impl RecordingSwitch {
    pub(super) fn new(
        shared: Arc<PipelineShared>,
        pipelines: Vec<(String, Arc<PipelineShared>)>,
        numbers: Vec<(String, Arc<NumberStream>)>,
    ) -> Self {
        Self { shared, pipelines, numbers, replacing: Mutex::default() }
    }

    /// As [`Handle::record`](super::Handle::record).
    pub(super) fn record(&self, record: &Record) -> Result<Option<LiveSummary>> {
        if !self.shared.recording.runs.load(Ordering::Acquire) {
            // Returns an error that ended an earlier recording and that no call has returned yet.
            self.take_error()?;
        }
        let next = RunningRecording::create(record, self.shared.header()?, &self.shared.sources, true)?;
        self.replace(Some(next))
    }

    /// As [`Handle::end_recording`](super::Handle::end_recording).
    pub(super) fn end(&self) -> Result<LiveSummary> {
        self.replace(None)?.ok_or_else(|| problem!("nothing is recorded").into())
    }

    /// As [`Handle::records`](super::Handle::records).
    pub(super) fn run(&self) -> bool {
        let is_sound = |board: &Arc<PipelineShared>| lock(&board.recording.broken).is_none();
        self.shared.recording.runs.load(Ordering::Acquire) && self.pipelines.iter().all(|(_, board)| is_sound(board))
    }

    /// The error that ended a recording early, of this board or another one.
    fn take_error(&self) -> Result<()> {
        let all = self.pipelines.iter().map(|(_, board)| board).chain([&self.shared]);
        let errors: Vec<Error> = all.filter_map(|shared| lock(&shared.recording.broken).take()).collect();
        errors.into_iter().next().map_or(Ok(()), Err)
    }

    /// Ends the running recording and starts the next one, if there is one; returns how the first ended.
    fn replace(&self, next: Option<RunningRecording>) -> Result<Option<LiveSummary>> {
        let replacing = lock(&self.replacing);
        let mut sources = BTreeMap::new();
        let mut ended = vec![];
        for (name, board) in &self.pipelines {
            let header = board.header()?;
            let track = next.as_ref().map(|next| next.track_of(name)).transpose()?;
            let part = track.map(|track| RunningRecording::part(track, &header, true));
            let (recording, counts) = replace_of(board, part)?;
            let counters = recording
                .as_ref()
                .and_then(RunningRecording::since)
                .map_or_else(Counters::default, |s| counts.since(s));
            sources.insert(name.clone(), SourceCounts::Pipeline(Box::new(counters)));
            ended.push((recording, counts));
        }
        for (name, numbers) in &self.numbers {
            let track = next.as_ref().map(|next| next.track_of(name)).transpose()?;
            sources.insert(name.clone(), numbers.record_into(track));
        }
        let (recording, counters) = replace_of(&self.shared, next)?;
        // The parts must end before the whole recording.
        for (part, counts) in ended {
            part.map_or(Ok(None), |part| part.finish(&counts))?;
        }
        drop(replacing);
        self.take_error()?;
        let Some(recording) = recording else { return Ok(None) };
        let came =
            Counters { sources, ..recording.since().map_or_else(Counters::default, |since| counters.since(since)) };
        let lost = recording.losses(&counters);
        let path = recording.finish(&counters)?;
        let verdict =
            verdict(&self.shared.options.name, self.shared.receiver.origin(), &came, came.nothing_came(), &lost);
        let tare = self.shared.published().tare.clone();
        Ok(Some(LiveSummary { counters: came, verdict, path, tare }))
    }
}

/// Makes the decoding thread of one board record into `next`, or not at all; returns the recording that ran.
fn replace_of(shared: &PipelineShared, next: Option<RunningRecording>) -> Result<EndedRecording> {
    // Set before the request, so that the recording runs for callers that ask after this call.
    shared.recording.runs.fetch_or(next.is_some(), Ordering::AcqRel);
    let (answer, ended) = channel::bounded(1);
    shared.request(PipelineRequest::Record(next.map(Box::new), answer));
    let ended = shared.wait(&ended).and_then(std::convert::identity);
    if ended.is_err() {
        shared.recording.runs.store(lock(&shared.recording.running).is_some(), Ordering::Release);
    }
    ended
}

/// What was lost of each source, or that nothing arrived.
pub(super) fn verdict(
    name: &str,
    origin: &Origin,
    counters: &Counters,
    nothing: bool,
    lost: &RecordingCounts,
) -> Verdict {
    let of_source = |counters: &Counters, lost: &RecordingCounts| match &counters.lines {
        None => lost.verdict().doubtful(counters.decoding.totals.doubtful_after),
        Some(lines) => Verdict::of_lines(lost).doubtful(lines.faults.doubtful_after_us),
    };
    let verdict = if nothing {
        Verdict::nothing_arrived(nothing_arrived(origin, counters.seconds))
    } else {
        of_source(counters, lost)
    };
    let others = counters.sources.iter().map(|(name, counts)| {
        let verdict = match counts {
            SourceCounts::Pipeline(counts) => of_source(counts, &losses(counts, None)),
            SourceCounts::Numbers(counts) => {
                let LineCounts { lines, faults, .. } = &**counts;
                Verdict::of_lines(&losses_of_lines(*lines, faults)).doubtful(faults.doubtful_after_us)
            }
        };
        (name.clone(), verdict)
    });
    Verdict::combine(std::iter::once((name.to_owned(), verdict)).chain(others).collect())
}

/// What a user should check if nothing arrived.
fn nothing_arrived(origin: &Origin, seconds: f64) -> String {
    let ask = match origin {
        Origin::Udp(address) => {
            format!("does the board send to this machine, and to port {}?{FIREWALL}", address.port())
        }
        Origin::Frames(_) => "is the sensor connected, and does it send lines of numbers?".to_owned(),
    };
    format!("nothing arrived at {origin} in {seconds:.1} s: {ask}")
}
