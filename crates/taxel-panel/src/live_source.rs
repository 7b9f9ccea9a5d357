//! A live source: copies of a board's events from the pipeline, and the state and the keyframe index made of them.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, Weak};
use std::time::{Duration, Instant};

use crossbeam_channel as channel;
use serde_json::{Value, json};
use taxel_core::Array;
use taxel_core::detect::Detector;
use taxel_core::encode::{self, Tare};
use taxel_core::held::UNKNOWN;
use taxel_core::problem;
use taxel_core::rest::ValueSteps;
use taxel_core::wire::Registers;
use taxel_live::capture::{FIREWALL, Origin};
use taxel_live::clock::Offset;
use taxel_live::locked::lock;
use taxel_live::pipeline::{Counters, Handle, LiveOptions, OutputDetection, StatedTare, ViewerEvents};
use taxel_live::recording::now_ns;
use taxel_live::{Error, Result};

use crate::array_state::{ArrayState, Keyframe};
use crate::keyframe_index::live::{LiveIndex, REACH_US};
use crate::keyframe_index::{Activity, KeyframeIndex};
use crate::readout_encoders::ReadoutEncoders;
use crate::shown::sensor;
use crate::time_columns::{COLUMN_US, COLUMNS_US, SPAN, TimeColumns};

/// How often new events are fetched from the pipeline, and how often its clock and its counters are read.
const RECEIVE_EVERY: Duration = Duration::from_millis(16);
const COUNT_EVERY: Duration = Duration::from_millis(250);

/// Detections that may wait to be told.
const MOST_WAITING: usize = 256;

/// The time shown follows the host's clock this far behind it while no events arrive, ns: events arrive within that.
const BEHIND_NS: i64 = 40_000_000;

/// A source this far behind the time shown has stalled, us; less is network delay and error of the clocks.
const STALLED_US: i64 = 200_000;

/// Maximum number of detections that a client that connects later receives.
const MOST_LATEST: usize = 300;

/// What has happened since it was last told.
#[derive(Debug, Default)]
pub struct News {
    /// The `detection` messages.
    pub detections: Vec<String>,
    /// The board was reset.
    pub reset: bool,
    /// Taxels were zeroed.
    pub zeroed: bool,
    /// [`LiveSource::about`] says something else.
    pub about: bool,
}

/// A live source with the state and the keyframe index that its events make, in a thread of its own until it is dropped.
pub struct LiveSource {
    /// What else can be done with the pipeline.
    pub handle: Handle,
    events: Mutex<ViewerEvents>,
    detections: channel::Receiver<OutputDetection>,
    /// The latest of them, oldest first, for clients that connect later.
    latest_detections: Mutex<VecDeque<OutputDetection>>,
    pub(crate) state: Mutex<ArrayState>,
    pub(crate) index: LiveIndex,
    activity: Mutex<Activity>,
    /// The labels of the readout that runs.
    labels: Option<Vec<String>>,
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
    /// Counts up when a new frame can be shown.
    received: AtomicU64,
    /// Whether a client is connected.
    watched: AtomicBool,
    news: Mutex<News>,
    /// The counters that were told last, and when.
    counted: Mutex<Option<(Instant, Counters)>>,
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

impl LiveSource {
    /// Begins to receive what a pipeline copies for viewers, of a board that holds these registers, or those that it knows.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` where the pipeline has ended; `Socket` where the system gives no thread.
    pub fn begin(handle: Handle, registers: Option<Registers>) -> Result<Arc<Self>> {
        if let Some(registers) = registers {
            handle.announce_registers(registers);
        }
        let source = Arc::new(Self::new(handle)?);
        let received = Arc::downgrade(&source);
        std::thread::Builder::new()
            .name("taxel-view".to_owned())
            .spawn(move || receive_until_dropped(&received))
            .map_err(Error::socket("the panel's thread"))?;
        Ok(source)
    }

    fn new(handle: Handle) -> Result<Self> {
        let noise_floor = handle.registers().noise_floor;
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
            received: AtomicU64::new(0),
            watched: AtomicBool::new(false),
            news: Mutex::default(),
            counted: Mutex::default(),
        })
    }

    /// The sensor.
    pub fn array(&self) -> &Array {
        self.index.array()
    }

    /// What the panel says of it at first, and when that changes.
    pub fn about(&self) -> Value {
        let options = self.handle.options();
        let frames = self.handle.frame_values().map(
            |(unit, steps, begin_us)| json!({ "unit": unit, "step": steps.size, "zero": steps.zero, "begin_us": begin_us }),
        );
        let (udp, lines, source) = match self.handle.origin() {
            Origin::Udp(address) => (Some(address.to_string()), None, None),
            Origin::Frames(place) => {
                (None, Some(place.clone()), options.input.as_ref().map(|input| input.text.clone()))
            }
        };
        json!({
            "array": sensor(self.array()),
            "udp": udp,
            "lines": lines,
            "source": source,
            "sources": self.handle.source_names(),
            "frames": frames,
            "readout": self.labels,
            "readout_encoders": self.encoders().names(),
        })
    }

    /// What has happened since the last call; `None`: nothing.
    pub fn news(&self) -> Option<News> {
        let mut news = lock(&self.news);
        let any = !news.detections.is_empty() || news.reset || news.zeroed || news.about;
        any.then(|| std::mem::take(&mut *news))
    }

    /// Counts up when a new frame can be shown.
    pub(crate) fn received(&self) -> u64 {
        self.received.load(Ordering::Relaxed)
    }

    /// Whether a client is connected: then the pipeline copies more often.
    pub fn set_watched(&self, watched: bool) {
        self.watched.store(watched, Ordering::Relaxed);
    }

    /// The board holds these registers.
    pub fn announce(&self, registers: Registers) {
        self.handle.announce_registers(registers);
        lock(&self.state).set_noise_floor(registers.noise_floor.into());
    }

    /// Counts by which dead, stuck and noisy taxels are found.
    pub fn activity(&self) -> Activity {
        lock(&self.activity).clone()
    }

    /// Makes the held values the rest of all taxels, or tracks it from them on.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` before the first value.
    pub fn rest(&self, now: bool) -> Result<()> {
        let mut state = lock(&self.state);
        let held = state.held().to_vec();
        match now {
            true if held.iter().all(|&held| held == UNKNOWN) => {
                return Err(problem!("no events have arrived yet").into());
            }
            true => state.set_rest(held),
            false => state.track_rest(),
        }
        Ok(())
    }

    /// The `overview` message of the past that can be viewed.
    pub fn overview(&self) -> Value {
        let (start_us, step_us, events) = self.index.event_rate();
        let state = lock(&self.state);
        let force = state.time_columns().greatest_sums(start_us, step_us, events.len(), COLUMN_US);
        json!({
            "type": "overview", "source": null, "start_us": start_us, "step_us": step_us, "events": events, "force": force,
        })
    }

    /// The steps of the values; ticks of a board.
    fn value_steps(&self) -> ValueSteps {
        self.handle.frame_values().map_or(ValueSteps { size: 1.0, zero: 0 }, |(_, steps, _)| steps)
    }

    /// Whether those are others than at the last call, so that clients are to be told.
    fn has_new_steps(&self) -> bool {
        let now = self.handle.frame_values().map(|(_, steps, _)| steps);
        std::mem::replace(&mut *lock(&self.steps), now) != now
    }

    /// The encoders of the readout that runs, with its tare where that is known.
    pub(crate) fn encoders(&self) -> ReadoutEncoders {
        match self.handle.tare() {
            Some(tare) => self.encoders.with_tare(&tare),
            None => self.encoders.clone(),
        }
    }

    /// Whether the readout's tare is being measured.
    pub(crate) fn measures_tare(&self) -> bool {
        self.handle.counters().readout.taring
    }

    /// The `counters` message, with rates since the last call; a frame takes `frame_us` where that is known.
    #[allow(clippy::cast_precision_loss)]
    pub fn counters(&self, frame_us: Option<f64>) -> Value {
        let now = self.handle.counters();
        let before = lock(&self.counted).replace((Instant::now(), now.clone()));
        let rate = |count: fn(&Counters) -> u64| {
            let (at, before) = before.as_ref()?;
            Some(count(&now).saturating_sub(count(before)) as f64 / at.elapsed().as_secs_f64())
        };
        let v2 = now.decoding.wire_v2;
        let frames_per_s = match now.lines {
            Some(_) => rate(|counters| counters.decoding.frames),
            None => frame_us.map(|frame_us| 1e6 / frame_us),
        };
        json!({
            "type": "counters",
            "at_ns": now_ns(),
            "seconds": now.seconds,
            "board_us": now.board.board_us,
            "events": now.decoding.events,
            "events_per_s": rate(|counters| counters.decoding.events),
            "bytes_per_s": rate(|counters| counters.capture.bytes),
            "datagrams_per_s": rate(|counters| counters.capture.datagrams),
            "frames_per_s": frames_per_s,
            "arrival": now.arrival(now_ns()),
            "pace": now.board.pace,
            "lost": {
                "kernel": now.capture.dropped_by_kernel.0,
                "queue": now.capture.dropped_by_queue,
                "wire": v2.missing,
                "damaged": now.decoding.wire.skipped + v2.checksum + v2.short + v2.foreign,
                "outside": now.decoding.wire.outside + v2.outside,
                "readout": now.readout.events_dropped,
                "panel": self.missing.load(Ordering::Relaxed),
            },
            "queue": now.capture.waiting,
            "latency": { "decode": now.decode_latency, "report": now.report_latency },
            "wire_version": now.decoding.wire_version,
            "marked_start": now.board.marked_start,
            "taring": now.readout.taring,
            "detections": now.readout.detections,
            "reach_us": self.index.range(),
            "reach_bytes": self.index.bytes(),
            "ended": self.handle.is_over(),
        })
    }

    /// The `detection` messages of the latest, oldest first.
    pub fn latest_detections(&self) -> Vec<String> {
        lock(&self.latest_detections).iter().map(message_of).collect()
    }

    /// Applies what the pipeline has copied.
    fn receive(&self) {
        let (mut frame, mut reset) = (false, false);
        let events = lock(&self.events);
        events.set_watched(self.watched.load(Ordering::Relaxed));
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
                reset = true;
            }
            let stored = self.index.push(piece, &state);
            let gap = stored.piece.missing > 0 || state.latest().is_none();
            if let Some(held) = stored.piece.held.as_ref().filter(|_| gap) {
                state.set_held(held, stored.piece.before);
            }
            state.apply(&stored.piece.changes);
            let mut activity = lock(&self.activity);
            stored.piece.changes.iter().for_each(|change| activity.count(change));
            frame |= !stored.piece.changes.is_empty();
        }
        drop(events);
        let detections: Vec<OutputDetection> = self.detections.try_iter().collect();
        let told = detections.iter().map(message_of).collect::<Vec<_>>();
        let mut latest = lock(&self.latest_detections);
        latest.extend(detections);
        let excess = latest.len().saturating_sub(MOST_LATEST);
        latest.drain(..excess);
        drop(latest);
        self.apply_rest();
        let zeroed = self.apply_zeroings();
        if frame || zeroed {
            self.received.fetch_add(1, Ordering::Relaxed);
        }
        let mut news = lock(&self.news);
        news.detections.extend(told);
        news.reset |= reset;
        news.zeroed |= zeroed;
    }

    /// Reads the clock of the pipeline, and what it says of its values.
    fn follow(&self) {
        if let Some(offset) = self.handle.counters().board.offset {
            self.follow_clock(offset);
        }
        if self.has_new_steps() {
            lock(&self.news).about = true;
        }
        self.received.fetch_add(1, Ordering::Relaxed);
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
    fn follow_clock(&self, offset: Offset) {
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

/// The `detection` message.
fn message_of(output: &OutputDetection) -> String {
    let OutputDetection { detection, reported_us, .. } = output;
    json!({
        "type": "detection",
        "label": detection.label,
        "t_us": detection.t,
        "known_us": detection.known,
        "reported_us": reported_us,
        "latency_us": reported_us - detection.known,
        "slope_mv_per_ms": (!detection.slope.is_nan()).then_some(detection.slope),
    })
    .to_string()
}

/// Receives until nobody holds the source any more.
fn receive_until_dropped(source: &Weak<LiveSource>) {
    let mut followed = Instant::now();
    loop {
        std::thread::sleep(RECEIVE_EVERY);
        let Some(source) = source.upgrade() else { return };
        source.receive();
        if followed.elapsed() >= COUNT_EVERY {
            followed = Instant::now();
            source.follow();
        }
    }
}

/// What every panel says at first beside its sources.
#[must_use]
pub fn limits() -> Value {
    json!({
        "firewall": FIREWALL,
        "encoders": encode::NAMES,
        "column_us": COLUMN_US,
        "columns_us": COLUMNS_US,
        "time_columns": SPAN,
    })
}
