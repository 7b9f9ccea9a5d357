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
use taxel_live::recording::{Note, Remarks};
use taxel_panel::{
    Activity, BoardLines, BoardRequests, Cut, Detected, EditOutcome, FileRequests, FrameFile, FrameIndex, FramePlace,
    FrameRest, FrameSource, FramesRead, LabelConflict, LabelEdit, LabelRequests, LabelRow, LabelTable, Opening,
    PresetRequests, PresetValue, ReadFile, Reply, RequestHandlers, RestSource, TrainingRequests, TrainingResult,
    UnhealthyTaxels, UserPreset, UserPresets,
};

use crate::held::from_touches;
use taxel_border::convert::{ArrayParts, array, from_array, slice, to_array};
use taxel_border::enter::enter;
use taxel_border::errors::ProblemError;
use taxel_border::parameters::parsed;

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

    fn connect(&self, place: Option<&str>) -> Reply<()> {
        self.call(|handler| handler.call_method1("connect", (place,)).map(drop))
    }

    fn listen(&self, host: &str, port: u16) -> Reply<()> {
        self.call(|handler| handler.call_method1("listen", (host, port)).map(drop))
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
        let whole = opening == Opening::Whole;
        self.call(|handler| {
            let (events, frames): (Option<PathBuf>, Option<ReadFramesIn<'_>>) =
                handler.call_method1("read", (path, trial, whole))?.extract()?;
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
}

impl LabelRequests for PythonHandler {
    fn stamp(&self, table: &Path) -> Reply<String> {
        self.call(|handler| handler.call_method1("stamp", (table,))?.extract())
    }

    fn read(&self, table: &Path, recording: &str) -> Reply<LabelTable> {
        self.call(|handler| handler.call_method1("read", (table, recording))?.extract()).map(to_table)
    }

    fn change(
        &self,
        table: &Path,
        recording: &str,
        requests: &[Vec<LabelEdit>],
    ) -> Reply<(Vec<EditOutcome>, LabelTable)> {
        let edit = |edit: &LabelEdit| (edit.old.clone().map(from_row), edit.new.clone().map(from_row));
        let requests: Vec<Vec<_>> = requests.iter().map(|request| request.iter().map(edit).collect()).collect();
        let (outcomes, read): (Vec<OutcomeIn>, TableParts) =
            self.call(|handler| handler.call_method1("change", (table, recording, requests))?.extract())?;
        let outcome = |outcome| match outcome {
            OutcomeIn::Refused(reason) => Err(reason),
            OutcomeIn::Written(rows) => Ok(rows.into_iter().map(|row| row.map(to_row)).collect()),
        };
        Ok((outcomes.into_iter().map(outcome).collect(), to_table(read)))
    }

    fn settle(&self, table: &Path, recording: &str, conflict: &LabelConflict, restore: bool) -> Reply<LabelTable> {
        let rows = |rows: &[LabelRow]| rows.iter().cloned().map(from_row).collect::<Vec<_>>();
        let LabelConflict { missing, returned, new } = conflict;
        let conflict: ConflictParts = (rows(missing), rows(returned), rows(new));
        let given = (table, recording, conflict, restore);
        self.call(|handler| handler.call_method1("settle", given)?.extract()).map(to_table)
    }
}

impl TrainingRequests for PythonHandler {
    fn train(&self, recording: &Path, out: &Path) -> Reply<TrainingResult> {
        let (text, next, options) = self.call(|handler| handler.call_method1("train", (recording, out))?.extract())?;
        Ok(TrainingResult { text, next, options })
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
        let (labels, detections) =
            self.call(|handler| handler.call_method1("detect", (recording, trial, readout))?.extract())?;
        Ok(Detected { labels, detections })
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

/// A label as Python has it: text, time (us), source, trial, time of the note that it replaces (us), and by the host (ns).
type LabelParts = (String, i64, String, String, Option<i64>, Option<i64>);

/// A conflict as Python has it: labels that are missing, that returned, and that are new.
type ConflictParts = (Vec<LabelParts>, Vec<LabelParts>, Vec<LabelParts>);

/// A table of labels as Python has it: its rows and its conflict.
type TableParts = (Vec<LabelParts>, ConflictParts);

/// What became of a request, as Python has it.
#[derive(FromPyObject)]
enum OutcomeIn {
    Refused(String),
    Written(Vec<Option<LabelParts>>),
}

fn to_row((label, t_us, source, trial, replaces_us, host_ns): LabelParts) -> LabelRow {
    LabelRow { label, t_us, source, trial, replaces_us, host_ns }
}

fn from_row(LabelRow { label, t_us, source, trial, replaces_us, host_ns }: LabelRow) -> LabelParts {
    (label, t_us, source, trial, replaces_us, host_ns)
}

fn to_table((rows, (missing, returned, new)): TableParts) -> LabelTable {
    let all = |rows: Vec<LabelParts>| rows.into_iter().map(to_row).collect();
    LabelTable {
        rows: all(rows),
        conflict: LabelConflict { missing: all(missing), returned: all(returned), new: all(new) },
    }
}

/// A source of frames: name, first column, rows, columns, times (us), values, rest.
type SourceIn<'py> = (String, u16, u16, u16, PyReadonlyArray1<'py, i64>, PyReadonlyArray1<'py, f32>, RestIn<'py>);

/// The rest of a source: where it is known from, that of each cell (NaN where unknown), ticks by the unit, whether values
/// fall from it, the cells that flicker, and where something lay then (for people).
type RestIn<'py> = (String, PyReadonlyArray1<'py, f64>, f64, f64, bool, Vec<usize>, String);

/// Frames as Python has read them: the array of all sources, the sources; unit, time from one frame to the next if they
/// are numbered (us), notes (time, text, source) and detections (label, time, known) as JSON, the verdict, the trial and all
/// trials of the file, how long the rest of the file takes (s).
type ReadFramesIn<'py> =
    (ArrayParts, Vec<SourceIn<'py>>, String, Option<i64>, String, String, Option<String>, Vec<String>, Option<f64>);

/// Notes (time, text, source) and detections (label, time, known) of frames.
type RemarksIn = (Vec<(Option<i64>, String, String)>, Vec<(String, i64, i64)>);

fn to_index(py: Python<'_>, frames: ReadFramesIn<'_>) -> PyResult<FrameIndex> {
    let (array, sources, unit, number_us, remarks, verdict, trial, trials, left_s) = frames;
    let array = to_array(array)?;
    let (notes, detections): RemarksIn = parsed("remarks", &remarks)?;
    let (notes, note_sources) =
        notes.into_iter().map(|(t_us, text, source)| (Note { at_ns: 0, t_us, text }, source)).unzip();
    let remarks = Remarks {
        notes,
        detections: detections
            .into_iter()
            .map(|(label, t, known)| (0, Detection { label, t, known, slope: f64::NAN, repaired: false }))
            .collect(),
        ..Remarks::default()
    };
    let file = FrameFile { unit, number_us, remarks, note_sources, verdict, trial, trials, left_s };
    let mut placed = vec![];
    for (
        name,
        left,
        rows,
        columns,
        t,
        values,
        (rest, rests, ticks_by_unit, loaded_from, falls, flickering, preload_at),
    ) in &sources
    {
        let (t, values, rests) = (slice("t", t)?, slice("values", values)?, slice("rest", rests)?);
        let inside = *left <= array.columns && *columns <= array.columns - left && *rows <= array.rows;
        let cells = usize::from(*rows) * usize::from(*columns);
        let each = rests.len() == cells && flickering.iter().all(|&cell| cell < cells);
        if !inside || values.len() != t.len() * cells || !each {
            return Err(ProblemError::new_err(format!("source {name}: does not fit the array")));
        }
        let known = |&rest: &f64| if rest.is_nan() { f64::NO_REST } else { rest };
        let rest = FrameRest {
            source: RestSource::named(rest)
                .ok_or_else(|| ProblemError::new_err(format!("source {name}: rest {rest:?} is none")))?,
            values: rests.iter().map(known).collect(),
            ticks_by_unit: *ticks_by_unit,
            loaded_from: *loaded_from,
            falls: *falls,
            flickering: flickering.clone(),
            preload_at: preload_at.clone(),
        };
        let place = FramePlace { name: name.clone(), left: *left, rows: *rows, columns: *columns };
        placed.push(FrameSource { place, t: t.to_vec(), values, rest });
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
