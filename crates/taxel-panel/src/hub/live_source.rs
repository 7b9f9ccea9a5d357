//! A live source: copies of a board's events from the pipeline, and the state and the keyframe index made of them.

use std::collections::VecDeque;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use crossbeam_channel as channel;
use taxel_core::Array;
use taxel_core::detect::Detector;
use taxel_core::encode::Tare;
use taxel_core::held::UNKNOWN;
use taxel_core::rest::ValueSteps;
use taxel_live::Result;
use taxel_live::clock::Offset;
use taxel_live::locked::lock;
use taxel_live::pipeline::{Counters, Handle, LiveOptions, OutputDetection, StatedTare, ViewerEvents};
use taxel_live::recording::now_ns;

use super::clients::MOST_WAITING;
use crate::array_state::{ArrayState, Keyframe};
use crate::keyframe_index::live::{LiveIndex, REACH_US};
use crate::keyframe_index::{Activity, KeyframeIndex};
use crate::protocol::messages::{Latency, LiveFrames, Lost, Message};
use crate::readout_encoders::ReadoutEncoders;
use crate::time_columns::{COLUMN_US, TimeColumns};

/// The time shown follows the host's clock this far behind it while no events arrive, ns: events arrive within that.
const BEHIND_NS: i64 = 40_000_000;

/// A source this far behind the time shown has stalled, us; less is network delay and error of the clocks.
const STALLED_US: i64 = 200_000;

/// Maximum number of detections that a client that connects later receives.
const MOST_LATEST: usize = 300;

/// A live source with the state and the keyframe index that its events make.
pub(crate) struct LiveSource {
    pub(crate) handle: Handle,
    events: Mutex<ViewerEvents>,
    detections: channel::Receiver<OutputDetection>,
    /// The latest of them, oldest first, for clients that connect later.
    latest_detections: Mutex<VecDeque<OutputDetection>>,
    pub(crate) state: Mutex<ArrayState>,
    pub(crate) index: LiveIndex,
    pub(crate) activity: Mutex<Activity>,
    /// The labels of the readout that runs.
    pub(crate) labels: Option<Vec<String>>,
    /// The encoders of that readout, without a tare that is measured.
    encoders: ReadoutEncoders,
    /// Events that found no room in the queue from the pipeline.
    missing: AtomicU64,
    /// Whether the state has the rest that was given with the readout.
    rested: AtomicBool,
    /// Number of zeroings that the state has applied.
    zeroings: AtomicU64,
    silence: Mutex<SilentTime>,
    /// The steps of the values of frames of numbers, as clients know them.
    steps: Mutex<Option<ValueSteps>>,
}

/// Where the board's time is while no events arrive.
#[derive(Debug, Default)]
struct SilentTime {
    /// Arrival (ns since 1970) and board time (us) of the latest event.
    latest: Option<(i64, i64)>,
    /// How far a stalled source is behind the host's clock, us.
    behind_us: i64,
}

/// The labels and the encoders of a live source's readout; a plain rule has no encoder. A tare that is measured is not known yet.
fn labels_and_encoders(options: &LiveOptions) -> taxel_core::Result<Option<(Vec<String>, ReadoutEncoders)>> {
    let Some(readout) = &options.readout else { return Ok(None) };
    Ok(Some(match (Detector::from_json(readout)?, &options.tare) {
        (Detector::PlainRule(rule), _) => (rule.labels.into_iter().flatten().collect(), ReadoutEncoders::default()),
        (Detector::Readout(readout), tare) => {
            let encoder = match tare {
                Some(StatedTare::Saved(tare)) => readout.encoder.with_tare(&Tare::from_json(tare)?),
                _ => readout.encoder,
            };
            (readout.neurons.into_keys().collect(), encoder.into())
        }
    }))
}

/// What arrived since the last call of [`LiveSource::receive`].
#[derive(Default)]
pub(crate) struct ReceivedState {
    /// A new frame can be shown.
    pub(crate) frame: bool,
    /// The board was reset.
    pub(crate) reset: bool,
    /// Taxels were zeroed.
    pub(crate) zeroed: bool,
    /// New detections.
    pub(crate) detections: Vec<OutputDetection>,
}

impl LiveSource {
    /// # Errors
    ///
    /// `Core(Problem)` where the source has ended.
    pub(crate) fn new(handle: Handle, noise_floor: u8) -> Result<Self> {
        let (detections, events) = (handle.detections(MOST_WAITING), handle.events()?);
        let options = handle.options();
        let (labels, encoders) = labels_and_encoders(options)?.unzip();
        let array = options.array.clone();
        let blank = Keyframe::blank(array.len());
        // Enough for all that a view of the past can show, at the widest columns too.
        let bytes = TimeColumns::bytes_for(&array, REACH_US / COLUMN_US);
        Ok(Self {
            state: Mutex::new(ArrayState::new(&array, noise_floor.into(), &blank, COLUMN_US, bytes)),
            activity: Mutex::new(Activity::new(&array)),
            index: LiveIndex::new(array, noise_floor.into()),
            events: Mutex::new(events),
            labels,
            encoders: encoders.unwrap_or_default(),
            handle,
            detections,
            latest_detections: Mutex::default(),
            missing: AtomicU64::new(0),
            rested: AtomicBool::new(false),
            zeroings: AtomicU64::new(0),
            silence: Mutex::default(),
            steps: Mutex::default(),
        })
    }

    pub(crate) fn array(&self) -> &Array {
        self.index.array()
    }

    /// Unit and steps of frames of numbers; none of a board, and before the first frame.
    pub(crate) fn frames(&self) -> Option<LiveFrames> {
        let (unit, steps, begin_us) = self.handle.frame_values()?;
        Some(LiveFrames { unit, step: steps.size, zero: steps.zero, begin_us })
    }

    /// The steps of the values; ticks of a board.
    fn value_steps(&self) -> ValueSteps {
        self.handle.frame_values().map_or(ValueSteps { size: 1.0, zero: 0 }, |(_, steps, _)| steps)
    }

    /// Whether those are others than at the last call, so that clients are to be told.
    pub(crate) fn has_new_steps(&self) -> bool {
        let now = self.handle.frame_values().map(|(_, steps, _)| steps);
        std::mem::replace(&mut *lock(&self.steps), now) != now
    }

    /// The encoders of the readout that runs, with its tare where that is known.
    pub(crate) fn encoders(&self) -> ReadoutEncoders {
        match self.handle.measured_tare() {
            Some(tare) => self.encoders.with_tare(&tare),
            None => self.encoders.clone(),
        }
    }

    /// Whether the readout's tare is being measured.
    pub(crate) fn measures_tare(&self) -> bool {
        self.handle.counters().readout.taring
    }

    /// The message of its counters; rates are those of the last `seconds`, since the counters `before`.
    #[allow(clippy::cast_precision_loss)]
    pub(crate) fn counters(
        &self,
        now: &Counters,
        before: Option<&Counters>,
        seconds: f64,
        frame_us: Option<f64>,
        viewers: usize,
    ) -> Message {
        let rate = |count: fn(&Counters) -> u64| {
            before.map(|before| count(now).saturating_sub(count(before)) as f64 / seconds)
        };
        let v2 = now.decoding.wire_v2;
        Message::Counters {
            at_ns: now_ns(),
            seconds: now.seconds,
            board_us: now.board.board_us,
            events: now.decoding.events,
            events_per_s: rate(|counters| counters.decoding.events),
            bytes_per_s: rate(|counters| counters.capture.bytes),
            datagrams_per_s: rate(|counters| counters.capture.datagrams),
            frames_per_s: match now.lines {
                Some(_) => rate(|counters| counters.decoding.frames),
                None => frame_us.map(|frame_us| 1e6 / frame_us),
            },
            arrival: now.arrival(now_ns()),
            pace: now.board.pace.clone(),
            rest_shift: now.rest_shift.clone(),
            falls: now.falls,
            lost: Lost {
                kernel: now.capture.dropped_by_kernel.0,
                queue: now.capture.dropped_by_queue,
                wire: v2.missing,
                damaged: now.decoding.wire.skipped + v2.checksum + v2.short + v2.foreign,
                outside: now.decoding.wire.outside + v2.outside,
                readout: now.readout.events_dropped,
                panel: self.missing(),
            },
            queue: now.capture.waiting,
            latency: Latency { decode: now.decode_latency, report: now.report_latency },
            wire_version: now.decoding.wire_version,
            marked_start: now.board.marked_start,
            taring: now.readout.taring,
            detections: now.readout.detections,
            reach_us: self.index.range(),
            reach_bytes: self.index.bytes(),
            viewers,
            sent_frames_per_s: 0.0,
            ended: self.handle.is_over(),
        }
    }

    /// The latest detections, oldest first.
    pub(crate) fn latest_detections(&self) -> Vec<OutputDetection> {
        lock(&self.latest_detections).iter().cloned().collect()
    }

    /// Events that only the panel lacks.
    pub(crate) fn missing(&self) -> u64 {
        self.missing.load(Ordering::Relaxed)
    }

    /// Applies what the pipeline has copied; it copies more often while a client is connected.
    pub(crate) fn receive(&self, has_clients: bool) -> ReceivedState {
        let mut received = ReceivedState::default();
        let events = lock(&self.events);
        events.set_watched(has_clients);
        while let Some(piece) = events.next() {
            let mut state = lock(&self.state);
            self.missing.fetch_add(piece.missing, Ordering::Relaxed);
            if let (Some(first), Some(latest)) = (piece.changes.first(), state.latest()) {
                // A sensor whose driver stalled is behind the time that the host's clock gave to its silence.
                let t = self.index.range().map_or(first.t, |(_, last)| last.max(first.t));
                if t < latest - STALLED_US {
                    state.set_back(t);
                }
            }
            if let Some(last) = piece.changes.last() {
                lock(&self.silence).latest = Some((now_ns(), last.t));
            }
            if piece.reset {
                state.clear();
                self.rested.store(false, Ordering::Relaxed);
                received.reset = true;
            }
            let stored = self.index.push(piece, &state);
            let gap = stored.piece.missing > 0 || state.latest().is_none();
            if let Some(held) = stored.piece.held.as_ref().filter(|_| gap) {
                state.set_held(held, stored.piece.before);
            }
            state.apply(&stored.piece.changes);
            let mut activity = lock(&self.activity);
            stored.piece.changes.iter().for_each(|change| activity.count(change));
            received.frame |= !stored.piece.changes.is_empty();
        }
        drop(events);
        received.detections.extend(self.detections.try_iter());
        let mut latest = lock(&self.latest_detections);
        latest.extend(received.detections.iter().cloned());
        let excess = latest.len().saturating_sub(MOST_LATEST);
        latest.drain(..excess);
        drop(latest);
        self.apply_rest();
        received.zeroed = self.apply_zeroings();
        received.frame |= received.zeroed;
        received
    }

    /// Sets the rest of all taxels once, where a tare was given or has been measured.
    fn apply_rest(&self) {
        if self.rested.load(Ordering::Relaxed) {
            return;
        }
        let rest = self.handle.rest();
        if rest.len() == self.array().len() {
            let steps = self.value_steps();
            let ticks = rest.into_iter().map(|rest| rest.map_or(UNKNOWN, |rest| steps.of_rest(rest))).collect();
            lock(&self.state).set_rest(ticks);
            self.rested.store(true, Ordering::Relaxed);
        }
    }

    /// Sets the rest of taxels that were zeroed since the last call; returns whether there were any.
    fn apply_zeroings(&self) -> bool {
        let zeroings = self.handle.zeroings();
        if self.zeroings.swap(zeroings, Ordering::Relaxed) == zeroings {
            return false;
        }
        let (columns, steps) = (usize::from(self.array().columns), self.value_steps());
        let mut state = lock(&self.state);
        for zeroing in self.handle.latest_zeroings().0 {
            state.zero(usize::from(zeroing.y) * columns + usize::from(zeroing.x), steps.of_rest(zeroing.rest));
        }
        true
    }

    /// Moves the time shown on while no events arrive; that of a stalled source from where it is.
    pub(crate) fn follow_clock(&self, offset: Offset) {
        let mut silence = lock(&self.silence);
        if let Some((arrived_ns, t)) = silence.latest.take() {
            let late = offset.board_us(arrived_ns) - t;
            silence.behind_us = if late > STALLED_US { late } else { 0 };
        }
        let mut state = lock(&self.state);
        if state.latest().is_some() {
            state.advance(offset.board_us(now_ns() - BEHIND_NS) - silence.behind_us);
        }
    }
}
