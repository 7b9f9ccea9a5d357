//! The requests of the panel's server, as calls of Python objects.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use numpy::PyReadonlyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use taxel_core::Array;
use taxel_core::detect::Detection;
use taxel_core::held::UNKNOWN;
use taxel_core::rest::Value;
use taxel_core::wire::Command;
use taxel_live::recording::{self, Remarks};
use taxel_panel::{
    Activity, BagTopic, BoardLines, BoardRequests, Cut, Description, Detected, EditOutcome, FileRequests, FrameArea,
    FrameFile, FrameIndex, FrameRest, FrameSource, FramesRead, LabelEdit, LabelRequests, LabelRow, LabelScore,
    LabelTable, LabelTimes, Mistake, Opening, PresetRequests, PresetValue, ReadFile, Reply, RequestHandlers,
    RestSource, TrainingRequests, TrainingResult, UnhealthyTaxels, UserPreset, UserPresets,
};

use crate::held::from_touches;
use taxel_border::convert::{ArrayParts, array, from_array, slice, to_array};
use taxel_border::enter::enter;
use taxel_border::errors::ProblemError;

/// Calls the methods of a Python object; the text of an exception is the reason of a refusal.
struct PythonHandler(Py<PyAny>);

impl PythonHandler {
    fn call<T>(&self, call: impl FnOnce(&Bound<'_, PyAny>) -> PyResult<T>) -> Reply<T> {
        Python::attach(|py| call(self.0.bind(py)).map_err(|error| error.value(py).to_string()))
    }
}

/// The handlers that a Python object holds, `PanelRequests` in `_core.pyi`.
pub(super) fn handlers(requests: &Bound<'_, PyAny>) -> PyResult<RequestHandlers> {
    let handler = |name: &str| Ok::<_, PyErr>(Box::new(PythonHandler(requests.getattr(name)?.unbind())));
    Ok(RequestHandlers {
        board: handler("board")?,
        files: handler("files")?,
        labels: handler("labels")?,
        training: handler("training")?,
        presets: handler("presets")?,
    })
}

impl BoardRequests for PythonHandler {
    fn command(&self, command: Command) -> Reply<u32> {
        self.call(|handler| handler.call_method1("command", (command.register, command.value))?.extract())
    }

    fn channels(&self) -> Reply<u8> {
        self.call(|handler| handler.call_method0("channels")?.extract())
    }

    fn board_lines(&self) -> Reply<BoardLines> {
        let (lines, resets) = self.call(|handler| handler.call_method0("board_lines")?.extract())?;
        Ok(BoardLines { lines, resets })
    }

    fn connect(&self, address: Option<&str>) -> Reply<()> {
        self.call(|handler| handler.call_method1("connect", (address,)).map(drop))
    }

    fn listen(&self, host: &str, port: u16) -> Reply<()> {
        self.call(|handler| handler.call_method1("listen", (host, port)).map(drop))
    }

    fn read_source(&self, source: &str) -> Reply<()> {
        self.call(|handler| handler.call_method1("read_source", (source,)).map(drop))
    }

    fn set_differences(&self, on: bool) -> Reply<()> {
        self.call(|handler| handler.call_method1("set_differences", (on,)).map(drop))
    }

    fn addresses(&self) -> Reply<Vec<(String, String)>> {
        self.call(|handler| handler.call_method0("addresses")?.extract())
    }

    fn read_out(&self, readout: &Path) -> Reply<()> {
        self.call(|handler| handler.call_method1("read_out", (readout,)).map(drop))
    }
}

impl FileRequests for PythonHandler {
    fn health(&self, sensor: &Array, activity: &Activity) -> Reply<UnhealthyTaxels> {
        let known = activity.range.iter().any(|&(least, _)| least != UNKNOWN);
        // Python has -1 for what is unknown.
        let range = |&(least, greatest): &(u16, u16)| match least {
            UNKNOWN => (-1_i32, -1_i32),
            _ => (least.into(), greatest.into()),
        };
        let (least, greatest): (Vec<_>, Vec<_>) = activity.range.iter().map(range).unzip();
        let (dead, stuck, noisy, untested) = self.call(|handler| {
            let py = handler.py();
            let values = known.then(|| (array(py, activity.values.clone()), array(py, least), array(py, greatest)));
            let counts = (array(py, activity.events.clone()), array(py, activity.moved.clone()));
            let touches = from_touches(py, &activity.touches);
            handler.call_method1("health", (from_array(sensor), counts.0, counts.1, touches, values))?.extract()
        })?;
        Ok(UnhealthyTaxels { dead, stuck, noisy, untested })
    }

    fn recordings(&self, folder: &Path) -> Reply<Vec<String>> {
        self.call(|handler| handler.call_method1("recordings", (folder,))?.extract())
    }

    fn read(&self, path: &Path, trial: Option<&str>, opening: Opening) -> Reply<ReadFile> {
        let is_whole = opening == Opening::Whole;
        self.call(|handler| {
            let (events, frames): (Option<PathBuf>, Option<ReadFrames<'_>>) =
                handler.call_method1("read", (path, trial, is_whole))?.extract()?;
            match (events, frames) {
                (_, Some(frames)) => Ok(ReadFile::Frames(FramesRead(Box::new(to_index(handler.py(), frames)?)))),
                (Some(path), None) => Ok(ReadFile::Events(path)),
                (None, None) => Err(ProblemError::new_err("read: neither events nor frames")),
            }
        })
    }

    fn health_of_frames(&self, path: &Path, trial: Option<&str>) -> Reply<UnhealthyTaxels> {
        let (dead, stuck, noisy, untested) =
            self.call(|handler| handler.call_method1("health_of_frames", (path, trial))?.extract())?;
        Ok(UnhealthyTaxels { dead, stuck, noisy, untested })
    }

    fn cut(&self, cut: &Cut<'_>) -> Reply<Vec<String>> {
        let Cut { path, trial, out, start_us, stop_us } = *cut;
        self.call(|handler| handler.call_method1("cut", (path, trial, out, start_us, stop_us))?.extract())
    }

    fn topics(&self, path: &Path) -> Reply<Vec<BagTopic>> {
        let topics: Vec<(String, String, Vec<u64>, u64, String)> =
            self.call(|handler| handler.call_method1("topics", (path,))?.extract())?;
        let topic = |(topic, field, shape, messages, trouble)| BagTopic { topic, field, shape, messages, trouble };
        Ok(topics.into_iter().map(topic).collect())
    }

    fn describe(&self, path: &Path, description: &Description) -> Reply<()> {
        let Description { falls, rate_hz, size, topic } = description.clone();
        self.call(|handler| handler.call_method1("describe", (path, falls, rate_hz, size, topic)).map(drop))
    }

    fn save_layout(&self, source: &str, out: &Path) -> Reply<String> {
        self.call(|handler| handler.call_method1("save_layout", (source, out))?.extract())
    }
}

impl LabelRequests for PythonHandler {
    fn read(&self, table: &Path, recording: &str, times: LabelTimes) -> Reply<LabelTable> {
        let arguments = (table, recording, times.us, times.begin_us);
        let read: TableRead = self.call(|handler| handler.call_method1("read", arguments)?.extract())?;
        Ok(read.into())
    }

    fn change(
        &self,
        table: &Path,
        recording: &str,
        times: LabelTimes,
        requests: &[Vec<LabelEdit>],
    ) -> Reply<(Vec<EditOutcome>, LabelTable)> {
        let edit = |edit: &LabelEdit| (edit.old.clone().map(Note::from), edit.new.clone().map(Note::from));
        let requests: Vec<Vec<_>> = requests.iter().map(|request| request.iter().map(edit).collect()).collect();
        let arguments = (table, recording, times.us, times.begin_us, requests);
        let (outcomes, read): (Vec<Outcome>, TableRead) =
            self.call(|handler| handler.call_method1("change", arguments)?.extract())?;
        let outcome = |outcome| match outcome {
            Outcome::Refused(reason) => Err(reason),
            Outcome::Written(notes) => Ok(notes.into_iter().map(|note| note.map(LabelRow::from)).collect()),
        };
        Ok((outcomes.into_iter().map(outcome).collect(), read.into()))
    }

    fn undo(&self, table: &Path, recording: &str, times: LabelTimes, change: u64) -> Reply<LabelTable> {
        let arguments = (table, recording, times.us, times.begin_us, change);
        let read: TableRead = self.call(|handler| handler.call_method1("undo", arguments)?.extract())?;
        Ok(read.into())
    }
}

impl TrainingRequests for PythonHandler {
    fn train(&self, recording: &Path, out: &Path) -> Reply<TrainingResult> {
        let arguments = (recording, out);
        let Trained { text, judged_on, scores, mistakes, next } =
            self.call(|handler| handler.call_method1("train", arguments)?.extract())?;
        let scores = scores.into_iter().map(|(label, is_plain_rule, found, missed, wrong, delay_ms)| LabelScore {
            label,
            is_plain_rule,
            found,
            missed,
            wrong,
            delay_ms,
        });
        let mistakes = mistakes.into_iter().map(|(label, t_us, is_missed, source, trial)| Mistake {
            label,
            t_us,
            is_missed,
            source,
            trial,
        });
        let (scores, mistakes) = (scores.collect(), mistakes.collect());
        Ok(TrainingResult { text, judged_on, scores, mistakes, next })
    }

    fn command(&self, recording: &Path, out: &Path) -> Reply<String> {
        self.call(|handler| handler.call_method1("command", (recording, out))?.extract())
    }

    fn progress(&self) -> Reply<String> {
        self.call(|handler| handler.call_method0("progress")?.extract())
    }

    fn end(&self) -> Reply<()> {
        self.call(|handler| handler.call_method0("end").map(drop))
    }

    fn detect(&self, recording: &Path, trial: Option<&str>, readout: &Path) -> Reply<Detected> {
        let (labels, encoder, detections) =
            self.call(|handler| handler.call_method1("detect", (recording, trial, readout))?.extract())?;
        Ok(Detected { labels, encoder, detections })
    }
}

impl PresetRequests for PythonHandler {
    fn read(&self) -> Reply<UserPresets> {
        self.call(|handler| {
            let (path, presets): (PathBuf, BTreeMap<String, BTreeMap<String, Bound<'_, PyAny>>>) =
                handler.call_method0("read")?.extract()?;
            let preset = |held: BTreeMap<String, Bound<'_, PyAny>>| {
                held.into_iter()
                    .map(|(name, value)| Ok((name, preset_value(&value)?)))
                    .collect::<PyResult<UserPreset>>()
            };
            let presets = presets.into_iter().map(|(name, held)| Ok((name, preset(held)?))).collect::<PyResult<_>>()?;
            Ok(UserPresets { path, presets })
        })
    }

    fn write(&self, presets: &BTreeMap<String, UserPreset>) -> Reply<()> {
        self.call(|handler| {
            let all = PyDict::new(handler.py());
            for (name, preset) in presets {
                let values = PyDict::new(handler.py());
                for (register, value) in preset {
                    match value {
                        PresetValue::Flag(flag) => values.set_item(register, flag)?,
                        PresetValue::Number(number) => values.set_item(register, number)?,
                        PresetValue::Other(text) => values.set_item(register, text)?,
                    }
                }
                all.set_item(name, values)?;
            }
            handler.call_method1("write", (all,)).map(drop)
        })
    }
}

/// A `Note` of Python, whose times are in us of the view; from Rust it comes as a dictionary.
#[derive(FromPyObject, IntoPyObject)]
struct Note {
    text: String,
    t: i64,
    at_ns: i64,
    recording: String,
    source: String,
    replaces: Option<i64>,
}

impl From<Note> for LabelRow {
    fn from(Note { text: label, t: t_us, at_ns, recording: trial, source, replaces: replaces_us }: Note) -> Self {
        Self { label, t_us, source, trial, replaces_us, host_ns: (at_ns != 0).then_some(at_ns) }
    }
}

impl From<LabelRow> for Note {
    fn from(
        LabelRow { label: text, t_us: t, source, trial: recording, replaces_us: replaces, host_ns }: LabelRow,
    ) -> Self {
        Self { text, t, at_ns: host_ns.unwrap_or(0), recording, source, replaces }
    }
}

/// `TableRead` of Python.
#[derive(FromPyObject)]
struct TableRead {
    rows: Vec<Note>,
    changes: Vec<Option<u64>>,
}

impl From<TableRead> for LabelTable {
    fn from(TableRead { rows, changes }: TableRead) -> Self {
        Self { rows: rows.into_iter().map(LabelRow::from).collect(), changes }
    }
}

/// `TrainedReadout` of Python: scores as label, whether of the plain rule, found, missed, false and median delay (ms), mistakes
/// as label, time (us), whether missed, source and trial.
#[derive(FromPyObject)]
struct Trained {
    text: String,
    judged_on: String,
    scores: Vec<(String, bool, u64, u64, u64, Option<f64>)>,
    mistakes: Vec<(String, i64, bool, String, String)>,
    next: String,
}

/// What became of a request: the rows that were written, or why it was refused.
#[derive(FromPyObject)]
enum Outcome {
    Refused(String),
    Written(Vec<Option<Note>>),
}

/// `ReadRest` of Python: its values are NaN where the rest is unknown.
#[derive(FromPyObject)]
struct ReadRest<'py> {
    source: String,
    values: PyReadonlyArray1<'py, f64>,
    ticks_by_unit: f64,
    loaded_from: f64,
    falls: bool,
    flickering: Vec<usize>,
    preload_at: String,
}

/// `ReadSource` of Python.
#[derive(FromPyObject)]
struct ReadSource<'py> {
    name: String,
    left: u16,
    rows: u16,
    columns: u16,
    t: PyReadonlyArray1<'py, i64>,
    values: PyReadonlyArray1<'py, f32>,
    rest: ReadRest<'py>,
}

/// `ReadFrames` of Python.
#[derive(FromPyObject)]
struct ReadFrames<'py> {
    array: ArrayParts,
    sources: Vec<ReadSource<'py>>,
    unit: String,
    number_us: Option<i64>,
    notes: Vec<(Option<i64>, String, String)>,
    detections: Vec<(String, i64, i64, String)>,
    verdict: String,
    trial: Option<String>,
    trials: Vec<String>,
    left_s: Option<f64>,
}

fn to_index(py: Python<'_>, frames: ReadFrames<'_>) -> PyResult<FrameIndex> {
    let ReadFrames { array, sources, unit, number_us, notes, detections, verdict, trial, trials, left_s } = frames;
    let array = to_array(array)?;
    let (notes, note_sources) =
        notes.into_iter().map(|(t_us, text, source)| (recording::Note { at_ns: 0, t_us, text }, source)).unzip();
    let (detections, detection_sources) = detections
        .into_iter()
        .map(|(label, t, known, source)| ((0, Detection { label, t, known, slope: f64::NAN, repaired: false }), source))
        .unzip();
    let remarks = Remarks { notes, detections, ..Remarks::default() };
    let file = FrameFile { unit, number_us, remarks, note_sources, detection_sources, verdict, trial, trials, left_s };
    let mut placed = vec![];
    for ReadSource { name, left, rows, columns, t, values, rest } in &sources {
        let (t, values, rests) = (slice("t", t)?, slice("values", values)?, slice("rest", &rest.values)?);
        let inside = *left <= array.columns && *columns <= array.columns - left && *rows <= array.rows;
        let cells = usize::from(*rows) * usize::from(*columns);
        let each = rests.len() == cells && rest.flickering.iter().all(|&cell| cell < cells);
        if !inside || values.len() != t.len() * cells || !each {
            return Err(ProblemError::new_err(format!("source {name}: does not fit the array")));
        }
        let known = |&rest: &f64| if rest.is_nan() { f64::NO_REST } else { rest };
        let rest = FrameRest {
            source: RestSource::named(&rest.source)
                .ok_or_else(|| ProblemError::new_err(format!("source {name}: rest {:?} is not known", rest.source)))?,
            values: rests.iter().map(known).collect(),
            ticks_by_unit: rest.ticks_by_unit,
            loaded_from: rest.loaded_from,
            falls: rest.falls,
            flickering: rest.flickering.clone(),
            preload_at: rest.preload_at.clone(),
        };
        let area = FrameArea { name: name.clone(), left: *left, rows: *rows, columns: *columns };
        placed.push(FrameSource { area, t: t.to_vec(), values, rest });
    }
    enter(py, |_| Ok::<_, taxel_core::Error>(FrameIndex::new(array, file, placed)))
}

/// A value of a preset, as a table in TOML has it.
fn preset_value(value: &Bound<'_, PyAny>) -> PyResult<PresetValue> {
    if let Ok(flag) = value.extract() {
        return Ok(PresetValue::Flag(flag));
    }
    match value.extract() {
        Ok(number) => Ok(PresetValue::Number(number)),
        Err(_) => Ok(PresetValue::Other(value.str()?.to_string())),
    }
}
