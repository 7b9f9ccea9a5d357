//! A live source: copies of a board's events from the pipeline, and the state and the keyframe index made of them.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, Weak};
use std::time::{Duration, Instant};

use crossbeam_channel as channel;
use serde_json::{Value, json};
use taxel_core::Array;
use taxel_core::detect::Detector;
use taxel_core::held::UNKNOWN;
use taxel_core::rest::ValueSteps;
use taxel_core::wire::Registers;
use taxel_live::capture::{FIREWALL, Origin};
use taxel_live::clock::Offset;
use taxel_live::locked::lock;
use taxel_live::pipeline::{Counters, Handle, LiveOptions, OutputDetection, Piece, ViewerEvents};
use taxel_live::recording::{Cause, CauseKind, now_ns};
use taxel_live::{Error, Result};

use crate::block::Block;
use crate::columns::{COLUMN_US, COLUMNS_US};
use crate::index::{Index, Kept};
use crate::shown::sensor;
use crate::state::{ArrayState, Keyframe, Sensor};

/// How far back a live source can be viewed, us ...
const REACH_US: i64 = 60_000_000;
/// ... and the memory that it may take, bytes.
const REACH_BYTES: usize = 512 << 20;

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

/// A live source with the state and the index that its events make, in a thread of its own until it is dropped.
pub struct LiveSource {
    /// What else can be done with the pipeline.
    pub handle: Handle,
    pub(crate) state: Mutex<ArrayState>,
    /// What can be viewed of its past.
    pub index: Arc<Index>,
    /// The labels of the readout that runs.
    labels: Option<Vec<String>>,
    /// The latest detections, oldest first, for clients that connect later.
    latest_detections: Mutex<VecDeque<OutputDetection>>,
    /// Events that found no room in the queue from the pipeline.
    missing: AtomicU64,
    /// Counts up when a new frame can be shown.
    received: AtomicU64,
    /// Whether a client is connected.
    watched: AtomicBool,
    news: Mutex<News>,
    /// The counters that were told last, and when.
    counted: Mutex<Option<(Instant, Counters)>>,
}

/// What the thread that receives for a live source holds alone.
struct Receiving {
    events: ViewerEvents,
    detections: channel::Receiver<OutputDetection>,
    /// Whether the state has the rest that was given with the readout.
    rested: bool,
    /// Number of zeroings that the state has applied.
    zeroings: u64,
    silence: SilentTime,
    /// The steps of the values of frames of numbers, as clients know them.
    steps: Option<ValueSteps>,
}

/// Where the board's time is while no events arrive.
#[derive(Debug, Default)]
struct SilentTime {
    /// Arrival (ns since 1970) and board time (us) of the latest event.
    latest: Option<(i64, i64)>,
    /// How far a stalled source is behind the host's clock, us.
    behind_us: i64,
}

/// The labels of a live source's readout.
fn labels(options: &LiveOptions) -> taxel_core::Result<Option<Vec<String>>> {
    let detector = options.readout.as_deref().map(Detector::from_json).transpose()?;
    Ok(detector.map(|detector| match detector {
        Detector::PlainRule(rule) => rule.labels.into_iter().flatten().collect(),
        Detector::Readout(readout) => readout.neurons.into_keys().collect(),
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
        let mut receiving = Receiving {
            detections: handle.detections(MOST_WAITING),
            events: handle.events()?,
            rested: false,
            zeroings: 0,
            silence: SilentTime::default(),
            steps: None,
        };
        let source = Arc::new(Self::new(handle)?);
        let received = Arc::downgrade(&source);
        std::thread::Builder::new()
            .name("taxel-view".to_owned())
            .spawn(move || receiving.receive_until_dropped(&received))
            .map_err(Error::socket("the panel's thread"))?;
        Ok(source)
    }

    fn new(handle: Handle) -> Result<Self> {
        let noise_floor = handle.registers().noise_floor;
        let options = handle.options();
        let labels = labels(options)?;
        let sensor = Arc::new(Sensor::new(options.array.clone(), noise_floor.into(), None));
        let blank = Keyframe::blank(sensor.array.len());
        // Enough for all that a view of the past can show, at the widest columns too.
        let columns = REACH_US / COLUMN_US;
        Ok(Self {
            state: Mutex::new(ArrayState::new(&sensor, &blank, COLUMN_US, columns)),
            index: Arc::new(Index::new(sensor, Kept::Latest { us: REACH_US, bytes: REACH_BYTES })),
            labels,
            handle,
            latest_detections: Mutex::default(),
            missing: AtomicU64::new(0),
            received: AtomicU64::new(0),
            watched: AtomicBool::new(false),
            news: Mutex::default(),
            counted: Mutex::default(),
        })
    }

    /// The sensor.
    pub fn array(&self) -> &Array {
        &self.index.sensor.array
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
            "sensor": options.name,
            "sources": self.handle.source_names(),
            "frames": frames,
            "readout": self.labels,
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

    /// The `overview` message of the past that can be viewed.
    pub fn overview(&self) -> Value {
        let columns = lock(&self.state).columns().clone();
        self.index.overview(None, Some(&columns))
    }

    /// The steps of the values; ticks of a board.
    fn value_steps(&self) -> ValueSteps {
        self.handle.frame_values().map_or(ValueSteps { size: 1.0, zero: 0, floor: 0 }, |(_, steps, _)| steps)
    }

    /// The `counters` message, with rates since the last call; a frame takes `frame_us` where that is known.
    pub fn counters(&self, frame_us: Option<f64>) -> Value {
        let now = self.handle.counters();
        let before = lock(&self.counted).replace((Instant::now(), now.clone()));
        let rate = |count: fn(&Counters) -> u64| {
            let (at, before) = before.as_ref()?;
            Some(count(&now).saturating_sub(count(before)) as f64 / at.elapsed().as_secs_f64())
        };
        let frames_per_s = match now.lines {
            Some(_) => rate(|counters| counters.decoding.frames),
            None => frame_us.map(|frame_us| 1e6 / frame_us),
        };
        json!({
            "type": "counters",
            "seconds": now.seconds,
            "board_us": now.board.board_us,
            "events": now.decoding.events,
            "events_per_s": rate(|counters| counters.decoding.events),
            "bytes_per_s": rate(|counters| counters.capture.bytes),
            "frames_per_s": frames_per_s,
            "arrival": now.arrival(now_ns()),
            "pace": now.board.pace,
            "lost": self.losses(&now),
            "queue": now.capture.waiting,
            "latency": { "decode": now.decode_latency, "report": now.report_latency },
            "wire_version": now.decoding.wire_version,
            "taring": now.readout.taring,
            "detections": now.readout.detections,
            "reach_us": self.index.range(),
            "ended": self.handle.is_over(),
        })
    }

    /// What was lost, by cause; those that are only noted are no losses.
    fn losses(&self, now: &Counters) -> Value {
        let verdict = self.handle.verdict(now);
        let mut counts = verdict.counts;
        counts[Cause::ReadoutDropped] = now.readout.events_dropped;
        counts[Cause::ViewDropped] = self.missing.load(Ordering::Relaxed);
        let lost = |cause: Cause| cause.kind() == CauseKind::Lost || cause == Cause::ReadoutDropped;
        let shown = counts.iter().filter(|(cause, _)| cause.kind() != CauseKind::Noted);
        json!({
            "number": counts.iter().filter(|(cause, _)| lost(*cause)).map(|(_, n)| n).sum::<u64>(),
            "by_kernel_known": now.capture.dropped_by_kernel.are_known(),
            "causes": shown.map(|(cause, n)| format!("{n} {}", cause.words(n))).collect::<Vec<_>>(),
        })
    }

    /// Applies a piece of what the pipeline has copied, and stores it.
    fn take(&self, piece: Piece) {
        let mut state = lock(&self.state);
        if let (Some(first), Some(latest)) = (piece.changes.first(), state.latest) {
            // A sensor whose driver stalled is behind the time that the host's clock gave to its silence.
            let t = self.index.range().map_or(first.t, |(_, last)| last.max(first.t));
            if t < latest - STALLED_US {
                state.set_back(t);
            }
        }
        if piece.reset {
            state.clear();
        }
        let Piece { changes, held, since, before, missing, reset, .. } = piece;
        let key = held.is_some();
        let gap = missing > 0 || reset || state.latest.is_none();
        let block =
            Block { held: held.filter(|_| gap).map(|held| (held, before)), changes: Arc::new(changes), rest: None };
        state.begin_block(&block);
        // How the rest is tracked takes more memory than all else of a keyframe.
        let key = key.then(|| Keyframe { latest: since, tracked: None, ..state.keyframe() });
        state.apply(&block.changes);
        self.index.push(key, block).expect("nothing is written to a file");
    }

    /// The `detection` messages of the latest, oldest first.
    pub fn latest_detections(&self) -> Vec<String> {
        lock(&self.latest_detections).iter().map(message_of).collect()
    }
}

impl Receiving {
    /// Receives until nobody holds the source any more.
    fn receive_until_dropped(&mut self, source: &Weak<LiveSource>) {
        let mut followed = Instant::now();
        loop {
            std::thread::sleep(RECEIVE_EVERY);
            let Some(source) = source.upgrade() else { return };
            self.receive(&source);
            if followed.elapsed() >= COUNT_EVERY {
                followed = Instant::now();
                self.follow(&source);
            }
        }
    }

    /// Applies what the pipeline has copied.
    fn receive(&mut self, source: &LiveSource) {
        let (mut frame, mut reset) = (false, false);
        self.events.set_watched(source.watched.load(Ordering::Relaxed));
        while let Some(piece) = self.events.next() {
            source.missing.fetch_add(piece.missing, Ordering::Relaxed);
            frame |= !piece.changes.is_empty();
            reset |= piece.reset;
            if piece.reset {
                self.rested = false;
            }
            if let Some(last) = piece.changes.last() {
                self.silence.latest = Some((now_ns(), last.t));
            }
            source.take(piece);
        }
        let detections: Vec<OutputDetection> = self.detections.try_iter().collect();
        let told = detections.iter().map(message_of).collect::<Vec<_>>();
        let mut latest = lock(&source.latest_detections);
        latest.extend(detections);
        let excess = latest.len().saturating_sub(MOST_LATEST);
        latest.drain(..excess);
        drop(latest);
        self.apply_rest(source);
        let zeroed = self.apply_zeroings(source);
        if frame || zeroed {
            source.received.fetch_add(1, Ordering::Relaxed);
        }
        let mut news = lock(&source.news);
        news.detections.extend(told);
        news.reset |= reset;
        news.zeroed |= zeroed;
    }

    /// Reads the clock of the pipeline, and what it says of its values.
    fn follow(&mut self, source: &LiveSource) {
        if let Some(offset) = source.handle.counters().board.offset {
            let behind_us = self.silence.behind_us(offset);
            let mut state = lock(&source.state);
            if state.latest.is_some() {
                // Time moves on while no events arrive; that of a stalled source from where it is.
                state.advance(offset.board_us(now_ns() - BEHIND_NS) - behind_us);
            }
        }
        let steps = source.handle.frame_values().map(|(_, steps, _)| steps);
        if std::mem::replace(&mut self.steps, steps) != steps {
            lock(&source.news).about = true;
            if let Some(steps) = steps {
                lock(&source.state).set_noise_floor(steps.floor);
            }
        }
        source.received.fetch_add(1, Ordering::Relaxed);
    }

    /// Sets the rest of all taxels once, where a tare was given or has been measured.
    fn apply_rest(&mut self, source: &LiveSource) {
        if self.rested {
            return;
        }
        let rest = source.handle.rest();
        if rest.len() == source.array().len() {
            let steps = source.value_steps();
            let ticks = rest.into_iter().map(|rest| rest.map_or(UNKNOWN, |rest| steps.of_rest(rest))).collect();
            lock(&source.state).set_rest(ticks);
            self.rested = true;
        }
    }

    /// Sets the rest of taxels that were zeroed since the last call; returns whether there were any.
    fn apply_zeroings(&mut self, source: &LiveSource) -> bool {
        let (latest, zeroings) = source.handle.latest_zeroings();
        if std::mem::replace(&mut self.zeroings, zeroings) == zeroings {
            return false;
        }
        let (array, steps) = (source.array(), source.value_steps());
        let mut state = lock(&source.state);
        for zeroing in latest {
            state.zero(array.index(zeroing.x, zeroing.y), steps.of_rest(zeroing.rest));
        }
        true
    }
}

impl SilentTime {
    /// How far the source is behind the host's clock, us: as far as a stalled one was with its latest event.
    fn behind_us(&mut self, offset: Offset) -> i64 {
        if let Some((arrived_ns, t)) = self.latest.take() {
            let late = offset.board_us(arrived_ns) - t;
            self.behind_us = if late > STALLED_US { late } else { 0 };
        }
        self.behind_us
    }
}

/// The `detection` message.
fn message_of(output: &OutputDetection) -> String {
    let OutputDetection { detection, reported_us, .. } = output;
    json!({
        "type": "detection",
        "label": detection.label,
        "t_us": detection.t,
        "latency_us": reported_us - detection.known,
    })
    .to_string()
}

/// What every panel says at first beside its sources.
#[must_use]
pub fn limits() -> Value {
    json!({
        "firewall": FIREWALL,
        "column_us": COLUMN_US,
        "columns_us": COLUMNS_US,
    })
}
