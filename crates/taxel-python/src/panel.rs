//! The panel's view of a live source or a recording.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};

use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use serde_json::{Value, json};
use taxel_core::rest::Value as _;
use taxel_core::wire::Registers;
use taxel_core::{Array, problem};
use taxel_live::clock::BoardClock;
use taxel_live::pipeline::Record;
use taxel_live::recording::{Compression, Condition};
use taxel_panel::{FrameRest, FrameSource, FramesOfSource, Index, Kept, LiveSource, View};

use crate::held::{TouchesOut, from_touches};
use crate::live::Live;
use crate::recording::{RecordingReader, Remarks};
use taxel_border::convert::{ArrayIn, EventsIn, array, slice};
use taxel_border::enter::enter;
use taxel_border::errors::ProblemError;
use taxel_border::parameters::{Plain, parsed};

/// Counts by which unhealthy taxels are found: the sensor, the events of each taxel, those in the direction of the one before,
/// touches, and the greatest value that it held.
type ActivityOut<'py> =
    (Plain<Array>, Bound<'py, PyArray1<u32>>, Bound<'py, PyArray1<u32>>, TouchesOut<'py>, Bound<'py, PyArray1<u16>>);

fn activity_of<'py>(py: Python<'py>, index: &Index) -> PyResult<ActivityOut<'py>> {
    let activity = enter(py, |_| index.activity())?;
    let touches = from_touches(py, &activity.touches);
    let (events, moved) = (array(py, activity.events), array(py, activity.moved));
    Ok((Plain(index.sensor.array.clone()), events, moved, touches, array(py, activity.greatest)))
}

/// What every panel says at first.
#[pyfunction]
pub fn panel_limits() -> Plain<Value> {
    Plain(taxel_panel::limits())
}

/// A live source as the panel shows it, received in a thread of its own. Messages are JSON.
#[pyclass(frozen)]
pub struct PanelLive(Arc<LiveSource>);

#[pymethods]
impl PanelLive {
    /// Begins to receive from a board that holds these registers (JSON), or those that the pipeline knows.
    #[new]
    fn begin(py: Python<'_>, live: &Live, registers: Option<&str>) -> PyResult<Self> {
        let registers: Option<Registers> = registers.map(|text| parsed("registers", text)).transpose()?;
        let handle = live.handle(py)?;
        enter(py, |_| LiveSource::begin(handle, registers)).map(Self)
    }

    /// Begins to receive from another source of the same pipeline.
    fn of_source(&self, py: Python<'_>, name: &str) -> PyResult<Self> {
        let found = self.0.handle.of_source(name).ok_or_else(|| problem!("name"; " is {name:?}: no such source"));
        enter(py, |_| LiveSource::begin(found?, None)).map(Self)
    }

    /// What is said of it at first, and when `news` says so again.
    fn about(&self, py: Python<'_>) -> Plain<Value> {
        Plain(py.detach(|| self.0.about()))
    }

    /// What has happened since the last call: detections as messages, and whether the board was reset, taxels were zeroed, and
    /// `about` says something else; None: nothing.
    fn news(&self) -> Option<(Vec<String>, bool, bool, bool)> {
        self.0.news().map(|news| (news.detections, news.reset, news.zeroed, news.about))
    }

    /// The messages of the latest detections, oldest first.
    fn latest_detections(&self, py: Python<'_>) -> Vec<String> {
        py.detach(|| self.0.latest_detections())
    }

    /// The message of its counters; `frame_us` is the length of the board's frames, where it is known.
    fn counters(&self, py: Python<'_>, frame_us: Option<f64>) -> String {
        py.detach(|| self.0.counters(frame_us).to_string())
    }

    /// The message of the past that can be viewed.
    fn overview(&self, py: Python<'_>) -> String {
        py.detach(|| self.0.overview().to_string())
    }

    /// Whether a client is connected: then the pipeline copies more often.
    fn watch(&self, watched: bool) {
        self.0.set_watched(watched);
    }

    /// The registers as far as the pipeline knows them.
    fn registers(&self) -> Plain<Registers> {
        Plain(self.0.handle.registers())
    }

    /// The board holds these registers (JSON).
    fn announce(&self, py: Python<'_>, registers: &str) -> PyResult<()> {
        let registers: Registers = parsed("registers", registers)?;
        py.detach(|| self.0.announce(registers));
        Ok(())
    }

    /// Begins to record into a new .mcap.
    fn record(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let record = Record { path, compression: Compression::None, overwrite: false };
        enter(py, |_| self.0.handle.record(&record).map(drop))
    }

    /// Names the whole recording that runs.
    fn entitle(&self, py: Python<'_>, text: &str) -> PyResult<()> {
        enter(py, |_| self.0.handle.entitle(text))
    }

    /// Whether any recording runs.
    fn is_recording(&self, py: Python<'_>) -> bool {
        py.detach(|| self.0.handle.is_recording())
    }

    /// Counts by which unhealthy taxels are found.
    fn activity<'py>(&self, py: Python<'py>) -> PyResult<ActivityOut<'py>> {
        activity_of(py, &self.0.index)
    }
}

/// An indexed recording.
#[pyclass(frozen)]
pub struct PanelRecording(Arc<Index>);

#[pymethods]
impl PanelRecording {
    /// Decodes the datagrams of a board; changes beyond so many bytes of memory are in a temporary file in a folder. Returns
    /// also what else the recording holds, and the drift and the delays that the datagrams' arrivals show.
    #[staticmethod]
    fn of_board(
        py: Python<'_>,
        reader: &RecordingReader,
        folder: PathBuf,
        memory: u64,
    ) -> PyResult<(Self, Remarks, Plain<Value>)> {
        let reader = &reader.reader;
        enter(py, |_| {
            let (index, remarks, decoded) = Index::of_board(reader, Kept::All { memory, folder })?;
            let condition = reader.condition(&remarks, decoded.bad_chunks);
            let condition = Condition { decoded: Some(decoded.found), ..condition };
            let mut clock = BoardClock::default();
            for (&left, &arrived_ns) in
                decoded.left.iter().zip(&decoded.arrived_ns).filter(|(left, _)| **left > i64::MIN)
            {
                clock.note(left, arrived_ns);
            }
            let shown = Self(Arc::new(index));
            Ok::<_, taxel_live::Error>((shown, Remarks::new(&remarks, &condition), Plain(json!(clock.pace()))))
        })
    }

    /// Takes events, and the ticks that the taxels held before them, 65 535 where unknown.
    #[staticmethod]
    fn of_events(
        py: Python<'_>,
        events: EventsIn<'_>,
        held: Option<PyReadonlyArray1<'_, u16>>,
        noise_floor: u16,
        folder: PathBuf,
        memory: u64,
    ) -> PyResult<Self> {
        let (events, held) = (events.view()?, held.as_ref().map(|held| slice("held", held)).transpose()?);
        let index = enter(py, |_| Index::of_events(events, held, noise_floor, Kept::All { memory, folder }))?;
        Ok(Self(Arc::new(index)))
    }

    /// Takes frames, `ReadFrames` of Python.
    #[staticmethod]
    fn of_frames(py: Python<'_>, frames: ReadFrames<'_>, folder: PathBuf, memory: u64) -> PyResult<Self> {
        to_index(py, frames, Kept::All { memory, folder }).map(|index| Self(Arc::new(index)))
    }

    /// What the `opened` message says of its values.
    fn opened(&self, py: Python<'_>) -> PyResult<Plain<Value>> {
        enter(py, |_| self.0.opened()).map(Plain)
    }

    /// Its `overview` message.
    fn overview(&self, py: Python<'_>, name: &str) -> String {
        py.detach(|| self.0.overview(Some(name), self.0.whole.as_deref()).to_string())
    }

    /// First and last time, us; how long before and after them a label may lie, us; how long one us of the file is in the view.
    fn times(&self) -> (Option<(i64, i64)>, i64, i64) {
        (self.0.range(), self.0.late_us(), self.0.us())
    }

    /// The sensor.
    fn array(&self) -> Plain<Array> {
        Plain(self.0.sensor.array.clone())
    }

    /// Counts by which unhealthy taxels are found; None of frames.
    fn activity<'py>(&self, py: Python<'py>) -> PyResult<Option<ActivityOut<'py>>> {
        if self.0.sensor.frames.is_some() {
            return Ok(None);
        }
        activity_of(py, &self.0).map(Some)
    }
}

/// What a client sees of a live source or a recording. Its methods may be called in any thread; those that decode take long.
#[pyclass(frozen)]
pub struct PanelView {
    view: Mutex<View>,
    moves: AtomicBool,
}

impl PanelView {
    fn lock(&self) -> MutexGuard<'_, View> {
        self.view.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Works with the view, without the GIL.
    fn with<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut View) -> taxel_live::Result<T> + Send,
    ) -> PyResult<T> {
        enter(py, |_| {
            let mut view = self.lock();
            let done = work(&mut view);
            self.moves.store(view.moves(), Ordering::Relaxed);
            done
        })
    }
}

#[pymethods]
impl PanelView {
    /// A view that follows a live source, where there is one.
    #[new]
    fn new(live: Option<&PanelLive>) -> Self {
        let view = View::new(live.map(|live| Arc::clone(&live.0)));
        Self { moves: AtomicBool::new(view.moves()), view: Mutex::new(view) }
    }

    /// Another live source is there, or none; it is followed unless a recording is shown.
    fn set_live(&self, py: Python<'_>, live: Option<&PanelLive>) -> PyResult<()> {
        let live = live.map(|live| Arc::clone(&live.0));
        self.with(py, |view| {
            view.set_live(live);
            Ok(())
        })
    }

    /// Whether `advance` is to be called before the next frame.
    fn moves(&self) -> bool {
        self.moves.load(Ordering::Relaxed)
    }

    /// Plays on, decodes narrow columns; returns whether the end of a recording was reached.
    fn advance(&self, py: Python<'_>) -> PyResult<bool> {
        self.with(py, |view| Ok(view.advance()))
    }

    /// The next frame, and messages that go with it; None where nothing is new, or another thread works on the view.
    fn frame(&self, py: Python<'_>) -> PyResult<Option<(Vec<u8>, Vec<String>)>> {
        enter(py, |_| {
            let mut view = match self.view.try_lock() {
                Ok(view) => view,
                Err(TryLockError::Poisoned(poisoned)) => poisoned.into_inner(),
                Err(TryLockError::WouldBlock) => return Ok::<_, taxel_core::Error>(None),
            };
            let frame = view.frame();
            self.moves.store(view.moves(), Ordering::Relaxed);
            Ok(frame)
        })
    }

    /// State (following, playing, paused), speed, and time, us.
    fn transport(&self, py: Python<'_>) -> PyResult<(&'static str, f64, Option<i64>)> {
        self.with(py, |view| Ok(view.transport()))
    }

    /// Sends the history of a taxel (column, row) from now on, or none.
    fn watch(&self, py: Python<'_>, taxel: Option<(u16, u16)>) -> PyResult<()> {
        self.with(py, |view| view.watch(taxel))
    }

    /// Columns of this width, us, that end at a time or at that of the view.
    fn zoom(&self, py: Python<'_>, column_us: i64, end_us: Option<i64>) -> PyResult<()> {
        self.with(py, |view| view.zoom(column_us, end_us))
    }

    /// Shows a time, us.
    fn seek(&self, py: Python<'_>, t_us: i64) -> PyResult<()> {
        self.with(py, |view| view.seek(t_us))
    }

    /// The message of the values at a time, us.
    fn values(&self, py: Python<'_>, t_us: i64) -> PyResult<String> {
        enter(py, |_| {
            let read = self.lock().values()?;
            read(t_us).map(|values| values.to_string())
        })
    }

    /// Plays at a speed, or at the last one.
    fn play(&self, py: Python<'_>, speed: Option<f64>) -> PyResult<()> {
        self.with(py, |view| view.play(speed))
    }

    /// Stays where it is.
    fn pause(&self, py: Python<'_>) -> PyResult<()> {
        self.with(py, View::pause)
    }

    /// Moves by so many time stamps with events.
    fn step(&self, py: Python<'_>, frames: i64) -> PyResult<()> {
        self.with(py, |view| view.step(frames))
    }

    /// Follows the live source.
    fn follow(&self, py: Python<'_>) -> PyResult<()> {
        self.with(py, View::follow)
    }

    /// Shows a recording at its beginning.
    fn show(&self, py: Python<'_>, recording: &PanelRecording) -> PyResult<()> {
        let recording = Arc::clone(&recording.0);
        self.with(py, |view| view.show(recording))
    }
}

/// `ReadSource` of Python: its rest is NaN where it is unknown.
#[derive(FromPyObject)]
struct ReadSource<'py> {
    name: String,
    left: u16,
    array: ArrayIn,
    t: PyReadonlyArray1<'py, i64>,
    values: PyReadonlyArray1<'py, f32>,
    rest_source: String,
    rest: PyReadonlyArray1<'py, f64>,
    ticks_by_unit: f64,
    loaded_from: f64,
    falls: bool,
    preload_at: String,
}

/// `ReadFrames` of Python.
#[derive(FromPyObject)]
struct ReadFrames<'py> {
    array: ArrayIn,
    sources: Vec<ReadSource<'py>>,
    unit: String,
    number_us: Option<i64>,
}

fn to_index(py: Python<'_>, frames: ReadFrames<'_>, kept: Kept) -> PyResult<Index> {
    let ReadFrames { array: ArrayIn(array), sources, unit, number_us } = frames;
    let mut placed = vec![];
    let values: Vec<PyReadonlyArray1<'_, f32>> = sources.iter().map(|source| source.values.clone()).collect();
    for (read, values) in sources.into_iter().zip(&values) {
        let (name, left, sensor) = (read.name, read.left, read.array.0);
        let (t, values, rests) = (slice("t", &read.t)?, slice("values", values)?, slice("rest", &read.rest)?);
        let cells = sensor.len();
        let inside = left <= array.columns && sensor.columns <= array.columns - left && sensor.rows <= array.rows;
        if !inside || values.len() != t.len() * cells || rests.len() != cells {
            return Err(ProblemError::new_err(format!("source {name}: does not fit the array")));
        }
        let known = |&rest: &f64| if rest.is_nan() { f64::NO_REST } else { rest };
        let rest = FrameRest {
            source: serde_json::from_value(json!(read.rest_source)).map_err(|error| {
                ProblemError::new_err(format!("source {name}: rest {:?}: {error}", read.rest_source))
            })?,
            values: rests.iter().map(known).collect(),
            ticks_by_unit: read.ticks_by_unit,
            loaded_from: read.loaded_from,
            falls: read.falls,
            preload_at: read.preload_at,
        };
        placed.push(FrameSource { about: FramesOfSource { name, left, sensor, rest }, t: t.to_vec(), values });
    }
    enter(py, |_| Index::of_frames(array, unit, number_us, placed, kept))
}
