//! What all who look have in common: the live source, the board's registers, the folder, the labels.

use std::collections::{BTreeMap, HashMap};
use std::path::PathBuf;
use std::sync::atomic::{AtomicI64, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, Weak};
use std::time::{Duration, Instant, UNIX_EPOCH};

use crossbeam_channel as channel;
use serde_json::{Map, Value, json};
use taxel_core::encode::Zeroing;
use taxel_core::wire::Registers;
use taxel_core::wire::registers::{PRESETS, Preset};
use taxel_core::{Array, encode, problem};
use tokio::sync::{Notify, broadcast, watch};

use super::film::file::FileFilm;
use super::film::ring::{REACH_US, RingFilm};
use super::film::{Activity, Film};
use super::lens::{COLUMN_US, COLUMNS_US, Keyframe, Lens, SPAN, Strip};
use super::limits::{MOST_BYTES, MOST_CREDITS};
use super::options::PanelOptions;
use super::recorder::Recorder;
use crate::capture::Origin;
use crate::locked::lock;
use crate::pipeline::{Counters, Handle, Outlet, Said, UNKNOWN};
use crate::recording::now_ns;
use crate::{Error, Result};

/// How often the newest is looked for.
const PUMP_EVERY: Duration = Duration::from_millis(16);

/// How often counters are told.
const COUNT_EVERY: Duration = Duration::from_millis(250);

/// How far behind the host's clock the shown time follows where nothing comes, ms: what comes has come by then.
const BEHIND_NS: i64 = 40_000_000;

/// So far behind the time shown a source has stalled; less is the network's delay and the clocks' error.
const STALLED_US: i64 = 200_000;

/// Messages that wait for one client at most.
const TOLD_WAITING: usize = 256;

/// What the panel asks of the program that started it: what belongs to other rooms (the board's serial line, cutting, tables
/// of labels), and may take its time.
pub trait Office: Send + Sync {
    /// Answers a question with JSON, or with the reason why not, for a person to read.
    ///
    /// # Errors
    ///
    /// The reason.
    fn ask(&self, what: &str, with: &Value) -> std::result::Result<Value, String>;
}

/// What is told to everybody.
#[derive(Debug, Clone)]
pub(super) enum Told {
    Text(Arc<str>),
    /// To which each client adds its own.
    Counters(Arc<Map<String, Value>>),
    /// The labels of a recording, for who looks at it.
    Labels(String),
    /// What a client is greeted with has changed.
    Hello,
}

/// A board, as it is seen.
pub(super) struct LiveSide {
    pub(super) handle: Handle,
    outlet: Mutex<Outlet>,
    said: channel::Receiver<Said>,
    pub(super) lens: Mutex<Lens>,
    pub(super) film: RingFilm,
    pub(super) activity: Mutex<Activity>,
    missing: AtomicU64,
    /// How much of what was zeroed has been shown.
    zeroed: AtomicU64,
}

/// A label of a recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Label {
    pub(super) id: u64,
    pub(super) label: String,
    pub(super) t_us: i64,
}

/// What changes.
#[derive(Debug, Default)]
pub(super) struct HubState {
    pub(super) control: Option<String>,
    pub(super) registers: Registers,
    pub(super) known: bool,
    pub(super) presets: BTreeMap<String, Map<String, Value>>,
    pub(super) presets_path: String,
    pub(super) labels: HashMap<String, Vec<Label>>,
    pub(super) label_ids: u64,
}

/// See the module.
pub(super) struct Hub {
    options: PanelOptions,
    office: Arc<dyn Office>,
    live: Mutex<Option<Arc<LiveSide>>>,
    telling: broadcast::Sender<Told>,
    moved: watch::Sender<u64>,
    state: Mutex<HubState>,
    films: Mutex<HashMap<PathBuf, Weak<FileFilm>>>,
    pub(super) recorder: Recorder,
    /// The board was reset: its registers are to be read again.
    pub(super) unknown: Notify,
    /// How often it greeted on its serial line, as it was told last.
    resets: AtomicI64,
    viewers: AtomicUsize,
}

/// A place among those who look; given back when it is dropped.
pub(super) struct Seat(Arc<Hub>);

impl Drop for Seat {
    fn drop(&mut self) {
        self.0.viewers.fetch_sub(1, Ordering::Relaxed);
    }
}

impl Hub {
    pub(super) fn new(options: PanelOptions, live: Option<Handle>, office: Box<dyn Office>) -> Result<Arc<Self>> {
        let state = HubState { control: options.control.clone(), ..HubState::default() };
        let hub = Arc::new(Self {
            options,
            office: office.into(),
            live: Mutex::default(),
            telling: broadcast::channel(TOLD_WAITING).0,
            moved: watch::channel(0).0,
            state: Mutex::new(state),
            films: Mutex::default(),
            recorder: Recorder::default(),
            unknown: Notify::new(),
            resets: AtomicI64::new(0),
            viewers: AtomicUsize::new(0),
        });
        if let Some(live) = live {
            hub.attach(live)?;
        }
        Ok(hub)
    }

    pub(super) fn options(&self) -> &PanelOptions {
        &self.options
    }

    /// Looks at a live source from here on.
    pub(super) fn attach(&self, handle: Handle) -> Result<()> {
        let said = handle.hear(TOLD_WAITING);
        let outlet = handle.look()?;
        let array = handle.options().array.clone();
        let registers = {
            let mut state = self.state();
            if state.known {
                // The board is the one whose registers were read: another source begins with what it was told.
                handle.wrote(state.registers);
            } else {
                state.registers = handle.registers();
            }
            state.registers
        };
        let floor = u16::from(registers.noise_floor);
        let blank =
            Keyframe { latest: None, events: 0, held: vec![UNKNOWN; array.len()], rest: vec![UNKNOWN; array.len()] };
        // As far as a view may look back, at the widest columns too.
        let strip = Strip::room(array.rows.into(), REACH_US / COLUMN_US);
        let side = LiveSide {
            lens: Mutex::new(Lens::new(array.columns, floor, &blank, COLUMN_US, strip)),
            activity: Mutex::new(Activity::new(array.len())),
            film: RingFilm::new(array, floor),
            outlet: Mutex::new(outlet),
            handle,
            said,
            missing: AtomicU64::new(0),
            zeroed: AtomicU64::new(0),
        };
        *lock(&self.live) = Some(Arc::new(side));
        self.tell(Told::Hello);
        self.tell_all(&self.zeroed());
        Ok(())
    }

    pub(super) fn live(&self) -> Option<Arc<LiveSide>> {
        lock(&self.live).clone()
    }

    pub(super) fn state(&self) -> MutexGuard<'_, HubState> {
        lock(&self.state)
    }

    pub(super) fn sit(self: &Arc<Self>, most: usize) -> Option<Seat> {
        let taken = self.viewers.fetch_add(1, Ordering::Relaxed);
        let seat = Seat(Arc::clone(self));
        (taken < most).then_some(seat)
    }

    pub(super) fn viewers(&self) -> usize {
        self.viewers.load(Ordering::Relaxed)
    }

    pub(super) fn tell(&self, told: Told) {
        // Where nobody listens nobody misses it.
        let _ = self.telling.send(told);
    }

    pub(super) fn tell_all(&self, said: &Value) {
        self.tell(Told::Text(said.to_string().into()));
    }

    pub(super) fn hear(&self) -> (broadcast::Receiver<Told>, watch::Receiver<u64>) {
        (self.telling.subscribe(), self.moved.subscribe())
    }

    /// Asks the office, which may take its time.
    pub(super) async fn ask(&self, what: &'static str, with: Value) -> std::result::Result<Value, String> {
        let office = Arc::clone(&self.office);
        let answer = tokio::task::spawn_blocking(move || office.ask(what, &with)).await;
        answer.unwrap_or_else(|_| Err(format!("{what}: failed within taxel; please report it")))
    }

    // ------------------------------------------------------------------------------------------ what comes

    /// Takes what the decoding thread handed over, and tells what is new, until it is dropped.
    pub(super) async fn pump(self: Arc<Self>) {
        let (mut counted, mut listened) = (Instant::now(), None::<tokio::task::JoinHandle<()>>);
        let mut before = None;
        // The newest that was heard, and when; how far that is behind what the host's clock made of it, where that is far.
        let (mut newest, mut behind) = (None, 0);
        let mut ticks = tokio::time::interval(PUMP_EVERY);
        ticks.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
        loop {
            ticks.tick().await;
            let Some(live) = self.live() else {
                tokio::time::sleep(COUNT_EVERY).await;
                continue;
            };
            let looks = self.viewers() > 0;
            let outlet = lock(&live.outlet);
            outlet.look(looks);
            let mut new = false;
            while let Some(piece) = outlet.next() {
                let mut lens = lock(&live.lens);
                live.missing.fetch_add(piece.missing, Ordering::Relaxed);
                if let (Some(first), Some(latest)) = (piece.changes.first(), lens.latest()) {
                    // A sensor whose driver stalled is behind what the host's clock made of its silence.
                    let heard = live.film.range().map_or(first.t, |(_, last)| last.max(first.t));
                    if heard < latest - STALLED_US {
                        lens.set_back(heard);
                    }
                }
                if let Some(last) = piece.changes.last() {
                    newest = Some((now_ns(), last.t));
                }
                if piece.reset {
                    lens.forget();
                    self.is_unknown();
                }
                let kept = live.film.keep(piece, &lens);
                if let Some(held) =
                    kept.piece.held.as_ref().filter(|_| kept.piece.missing > 0 || lens.latest().is_none())
                {
                    lens.hold(held, kept.piece.before);
                }
                let mut activity = lock(&live.activity);
                lens.take_all(&kept.piece.changes);
                kept.piece.changes.iter().for_each(|change| activity.take(change));
                new |= !kept.piece.changes.is_empty();
            }
            drop(outlet);
            while let Ok(said) = live.said.try_recv() {
                self.tell_all(&detection(&said));
            }
            let zeroings = live.handle.zeroings();
            if live.zeroed.swap(zeroings, Ordering::Relaxed) != zeroings {
                let columns = usize::from(live.film.array().columns);
                let mut lens = lock(&live.lens);
                for one in live.handle.zeroed().0 {
                    // A held value, so it has 16 bits.
                    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
                    lens.zero(usize::from(one.y) * columns + usize::from(one.x), one.rest as u16);
                }
                drop(lens);
                self.tell_all(&self.zeroed());
                new = true;
            }
            if new {
                self.moved.send_modify(|n| *n += 1);
            }
            if counted.elapsed() >= COUNT_EVERY {
                let counters = live.handle.counters();
                if let Some(offset) = counters.offset {
                    if let Some((at_ns, t)) = newest.take() {
                        let late = offset.board_us(at_ns) - t;
                        behind = if late > STALLED_US { late } else { 0 };
                    }
                    // Time goes on where nothing comes; of a source that stalled, from where it is.
                    let mut lens = lock(&live.lens);
                    if lens.latest().is_some() {
                        lens.advance(offset.board_us(now_ns() - BEHIND_NS) - behind);
                    }
                }
                let seconds = counted.elapsed().as_secs_f64();
                counted = Instant::now();
                let told = self.counters(&live, &counters, before.as_ref(), seconds);
                self.tell(Told::Counters(Arc::new(told)));
                before = Some(counters);
                self.moved.send_modify(|n| *n += 1);
                let listens = self.state().control.is_some();
                if looks && listens && listened.as_ref().is_none_or(tokio::task::JoinHandle::is_finished) {
                    let hub = Arc::clone(&self);
                    listened = Some(tokio::spawn(async move { hub.listen_to_board().await }));
                }
            }
        }
    }

    /// A board that was reset holds other registers than were read.
    fn is_unknown(&self) {
        if std::mem::take(&mut self.state().known) {
            self.tell_all(&self.registers());
        }
        self.unknown.notify_one();
    }

    /// What the board said on its serial line since it was asked last.
    async fn listen_to_board(&self) {
        if let Ok(lines) = self.ask("lines", json!({})).await {
            for line in lines["said"].as_array().into_iter().flatten() {
                self.tell_all(&json!({ "type": "board_line", "at_ns": now_ns(), "text": line }));
            }
            // Of version 1 the line alone tells of a reset.
            let resets = lines["resets"].as_i64().unwrap_or(0);
            if self.resets.swap(resets, Ordering::Relaxed) != resets && resets > 0 {
                self.is_unknown();
            }
        }
    }

    #[allow(clippy::cast_precision_loss)]
    fn counters(&self, live: &LiveSide, now: &Counters, before: Option<&Counters>, seconds: f64) -> Map<String, Value> {
        let rate = |now: u64, before: Option<u64>| before.map(|before| now.saturating_sub(before) as f64 / seconds);
        let damaged = now.wire.skipped + now.wire_v2.checksum + now.wire_v2.short + now.wire_v2.foreign;
        let said = json!({
            "type": "counters",
            "at_ns": now_ns(),
            "seconds": now.seconds,
            "board_us": now.board_us,
            "events": now.events,
            "events_per_s": rate(now.events, before.map(|b| b.events)),
            "bytes_per_s": rate(now.capture.bytes, before.map(|b| b.capture.bytes)),
            "datagrams_per_s": rate(now.capture.datagrams, before.map(|b| b.capture.datagrams)),
            "frames_per_s": 1e6 / self.state().registers.frame_us(),
            "lost": {
                "kernel": now.capture.dropped_by_kernel,
                "queue": now.capture.dropped_by_queue,
                "wire": now.wire_v2.missing,
                "damaged": damaged,
                "outside": now.wire.outside + now.wire_v2.outside,
                "readout": now.events_dropped,
                "panel": live.missing.load(Ordering::Relaxed),
            },
            "queue": now.capture.waiting,
            "latency": { "decode": now.decode_latency, "said": now.said_latency },
            "wire_version": now.wire_version,
            "marked_start": now.marked_start,
            "taring": now.taring,
            "detections": now.detections,
            "reach_us": live.film.range(),
            "reach_bytes": live.film.bytes(),
            "viewers": self.viewers(),
            "ended": live.handle.is_over(),
        });
        match said {
            Value::Object(said) => said,
            _ => Map::new(),
        }
    }

    // ------------------------------------------------------------------------------------------ what is said of it

    pub(super) fn hello(&self) -> Value {
        let live = self.live();
        let array = live.as_ref().map(|live| said_of(&live.handle.options().array));
        json!({
            "type": "hello",
            "protocol": 1,
            "taxel": env!("CARGO_PKG_VERSION"),
            "live": live.is_some(),
            "array": array,
            "udp": live.as_ref().and_then(|live| match live.handle.place() {
                Origin::Udp(address) => Some(address.to_string()),
                Origin::Bridge(_) => None,
            }),
            "delta_intensity": live.as_ref().map(|live| live.handle.options().differences),
            "control": self.state().control,
            "folder": self.options.folder,
            "open": self.options.open,
            "readout": self.options.readout,
            "encoders": encode::NAMES,
            "column_us": COLUMN_US,
            "columns_us": COLUMNS_US,
            "time_columns": SPAN,
            "most_message_bytes": MOST_BYTES,
            "most_credits": MOST_CREDITS,
        })
    }

    /// The taxels that were zeroed, of the live source.
    pub(super) fn zeroed(&self) -> Value {
        let zeroed = self.live().map(|live| live.handle.zeroed().0).unwrap_or_default();
        json!({ "type": "zeroed", "taxels": zeroed.iter().map(said_of_zeroing).collect::<Vec<_>>() })
    }

    pub(super) fn registers(&self) -> Value {
        let array = self.live().map(|live| live.handle.options().array.clone());
        let state = self.state();
        let held = Registers { record: false, ..state.registers };
        let same = |preset: &&Preset| match &array {
            Some(array) => held.with_preset(&preset.registers, array) == held,
            None => preset.registers == held,
        };
        let built_in = offered(&held, array.as_ref()).into_iter().find(same).map(|preset| preset.name.to_owned());
        let values = json!(held);
        let own = || state.presets.iter().find(|(_, preset)| values == json!(preset)).map(|(name, _)| name.clone());
        json!({
            "type": "registers",
            "known": state.known,
            "values": state.registers,
            "preset": built_in.or_else(own),
            "frame_us": state.registers.frame_us(),
            "warnings": state.registers.warnings(),
        })
    }

    pub(super) fn presets(&self) -> Value {
        let array = self.live().map(|live| live.handle.options().array.clone());
        let state = self.state();
        let built_in: Vec<_> =
            offered(&state.registers, array.as_ref()).into_iter().map(|preset| preset.name).collect();
        json!({ "type": "presets", "built_in": built_in, "own": state.presets, "path": state.presets_path })
    }

    /// The recordings of the folder.
    pub(super) fn recordings(&self) -> Value {
        let mut files = vec![];
        for entry in std::fs::read_dir(&self.options.folder).into_iter().flatten().flatten() {
            let name = entry.file_name().to_string_lossy().into_owned();
            let (Ok(about), true) = (entry.metadata(), name.ends_with(".mcap") || name.ends_with(".lsa")) else {
                continue;
            };
            if !about.is_file() || checked_name(&name).is_err() {
                continue;
            }
            let modified = about.modified().ok().and_then(|at| at.duration_since(UNIX_EPOCH).ok());
            let modified = modified.map_or(0, |since| u64::try_from(since.as_nanos()).unwrap_or(0));
            let labels = self.state().labels.get(&name).map(Vec::len);
            files.push((
                modified,
                json!({ "name": name, "bytes": about.len(), "modified_ns": modified, "labels": labels }),
            ));
        }
        files.sort_by_key(|(modified, _)| std::cmp::Reverse(*modified));
        let files: Vec<_> = files.into_iter().take(1000).map(|(_, said)| said).collect();
        json!({ "type": "recordings", "folder": self.options.folder, "files": files })
    }

    /// Where a file of the folder is, or will be.
    pub(super) fn place(&self, name: &str) -> Result<PathBuf> {
        checked_name(name)?;
        let path = self.options.folder.join(name);
        // A link may lead out of the folder.
        match path.canonicalize() {
            Ok(real) if !real.starts_with(&self.options.folder) => {
                Err(problem!("{name}: lies outside the folder {}", self.options.folder.display()).into())
            }
            _ => Ok(path),
        }
    }

    /// A recording of the folder, indexed once however many look at it.
    pub(super) async fn film(&self, name: &str) -> Result<Arc<FileFilm>> {
        let path = self.place(name)?;
        if self.recorder.file().as_deref() == Some(name) {
            return Err(problem!("{name}: is being recorded; open it when that has ended").into());
        }
        let length = std::fs::metadata(&path).map_err(Error::file(&path))?.len();
        if let Some(film) = lock(&self.films).get(&path).and_then(Weak::upgrade).filter(|film| film.bytes == length) {
            return Ok(film);
        }
        let there = path.clone();
        let film = tokio::task::spawn_blocking(move || FileFilm::open(&there)).await;
        let film = film.map_err(|_| problem!("{name}: failed within taxel; please report it"))??;
        lock(&self.films).insert(path, Arc::downgrade(&film));
        Ok(film)
    }

    // ------------------------------------------------------------------------------------------ labels

    /// Where the labels of a recording are.
    pub(super) fn label_file(name: &str) -> String {
        let stem = name.rsplit_once('.').map_or(name, |(stem, _)| stem);
        format!("{stem}.notes.csv")
    }

    pub(super) fn labels(&self, name: &str) -> Value {
        let state = self.state();
        let labels: Vec<_> = state
            .labels
            .get(name)
            .into_iter()
            .flatten()
            .map(|l| json!({ "label_id": l.id, "label": l.label, "t_us": l.t_us }))
            .collect();
        json!({ "type": "labels", "name": name, "path": Self::label_file(name), "labels": labels })
    }

    /// Reads the labels of a recording anew; those that are as they were keep their numbers.
    pub(super) async fn read_labels(&self, name: &str) -> std::result::Result<(), String> {
        let path = self.place(&Self::label_file(name)).map_err(|error| error.to_string())?;
        if !path.exists() {
            self.state().labels.remove(name);
            return Ok(());
        }
        let rows = self.ask("labels_read", json!({ "path": path, "recording": name })).await?;
        let mut state = self.state();
        let mut before = state.labels.remove(name).unwrap_or_default();
        let mut labels = vec![];
        for row in rows.as_array().into_iter().flatten() {
            let (Some(label), Some(t_us)) = (row["label"].as_str(), row["t_us"].as_i64()) else { continue };
            let same = before.iter().position(|l| l.label == label && l.t_us == t_us);
            let id = match same {
                Some(place) => before.swap_remove(place).id,
                None => {
                    state.label_ids += 1;
                    state.label_ids
                }
            };
            labels.push(Label { id, label: label.to_owned(), t_us });
        }
        state.labels.insert(name.to_owned(), labels);
        Ok(())
    }

    /// Changes the labels of a recording and writes them; where that fails they stay as they were.
    pub(super) async fn change_labels(
        &self,
        name: &str,
        change: impl FnOnce(&mut Vec<Label>, &mut u64) -> std::result::Result<(), String>,
    ) -> std::result::Result<(), String> {
        let path = self.place(&Self::label_file(name)).map_err(|error| error.to_string())?;
        let (before, rows) = {
            let mut state = self.state();
            let before = state.labels.get(name).cloned().unwrap_or_default();
            let mut labels = before.clone();
            let mut ids = state.label_ids;
            change(&mut labels, &mut ids)?;
            labels.sort_by_key(|label| label.t_us);
            let rows: Vec<_> = labels.iter().map(|l| json!({ "label": l.label, "t_us": l.t_us })).collect();
            state.label_ids = ids;
            state.labels.insert(name.to_owned(), labels);
            (before, rows)
        };
        if let Err(reason) = self.ask("labels_write", json!({ "path": path, "rows": rows })).await {
            self.state().labels.insert(name.to_owned(), before);
            return Err(reason);
        }
        self.tell(Told::Labels(name.to_owned()));
        Ok(())
    }
}

/// A sensor, as clients are told.
pub(super) fn said_of(array: &Array) -> Value {
    let exists = array.exists.as_ref();
    let exists = exists.map(|all| all.iter().map(|&there| if there { '1' } else { '0' }).collect::<String>());
    json!({ "rows": array.rows, "columns": array.columns, "pitch_mm": array.pitch_mm, "name": array.name, "exists": exists })
}

/// A taxel that was zeroed.
pub(super) fn said_of_zeroing(zeroing: &Zeroing) -> Value {
    let Zeroing { t, x, y, rest, before } = zeroing;
    json!({ "taxel": [x, y], "t_us": t, "rest": rest, "before": before })
}

/// The built-in presets that the board in hand could hold; all where there is none.
fn offered(held: &Registers, array: Option<&Array>) -> Vec<&'static Preset> {
    let Some(array) = array else { return PRESETS.iter().collect() };
    let fits = |preset: &&Preset| held.with_preset(&preset.registers, array).check(array).is_ok();
    Registers::presets(array, held.channels).filter(fits).collect()
}

fn detection(said: &Said) -> Value {
    let Said { detection, said, .. } = said;
    json!({
        "type": "detection", "label": detection.label, "t_us": detection.t, "known_us": detection.known, "said_us": said,
        "latency_us": said - detection.known, "slope_mv_per_ms": detection.slope,
    })
}

/// A file's name that leads nowhere else.
fn checked_name(name: &str) -> Result<()> {
    let fits = |c: char| c.is_alphanumeric() || " ._-".contains(c);
    let count = name.chars().count();
    if !(1..=110).contains(&count) || name.starts_with('.') || !name.chars().all(fits) {
        let said: String = name.chars().take(40).collect();
        return Err(problem!(
            "name {said:?}: must be 1 to 100 letters, digits, spaces, '.', '_' or '-', not beginning with '.'"
        )
        .into());
    }
    Ok(())
}
