//! The pipeline from datagrams to detections, and the sender of the benchmarks.

use std::cell::Cell;
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use numpy::PyArray1;
use pyo3::prelude::*;
use serde::Deserialize;
use serde_json::{Value, json};
use taxel_core::detect::{Detection, Detector};
use taxel_core::encode::{Tare, Zeroing};
use taxel_core::wire::Registers;
use taxel_core::{Array, problem};
use taxel_live::address::of_host;
use taxel_live::capture::{self, Sender};
use taxel_live::pipeline::{
    Handle, Lines, Live as Pipeline, LiveOptions, OutputDetection, ReadoutSetup, Record, Sink, Source, Summary,
};
use taxel_live::ports;

use crate::bridge::{Copies, Feed};
use crate::convert::{ArrayParts, array, to_array};
use crate::enter::enter;
use crate::errors::{ProblemError, core, live};
use crate::parameters::{Plain, parsed};
use crate::thread_state;
use crate::threaded::Threaded;

/// The defaults of the options that Python's `LiveOptions` has too, as JSON.
#[pyfunction]
pub fn live_defaults() -> String {
    let LiveOptions { differences, guard_frames, gap_frames, record_later, name, .. } =
        LiveOptions::new(Array::thesis());
    json!({
        "differences": differences, "guard_frames": guard_frames, "gap_frames": gap_frames,
        "record_later": record_later, "name": name,
    })
    .to_string()
}

/// The options that Python sets; all others have Rust's defaults.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Chosen {
    /// A preset's name, or the registers.
    registers: Value,
    differences: bool,
    guard_frames: f64,
    gap_frames: f64,
    readout_events: Option<usize>,
    kernel_buffer_bytes: Option<usize>,
    queue_bytes: Option<usize>,
    gro: Option<bool>,
    /// Where detections go as lines.
    send: Vec<String>,
    /// The board's name in a recording.
    name: String,
    /// The other sources of the recording: name, and description.
    sources: Vec<(String, String)>,
    /// Whether recordings begin and end while it runs.
    record_later: bool,
}

impl Chosen {
    fn registers(&self, array: &Array) -> PyResult<Registers> {
        match &self.registers {
            Value::String(name) => Registers::preset_on(name, array).map_err(core),
            held => Registers::deserialize(held).map_err(|e| ProblemError::new_err(format!("registers: {e}"))),
        }
    }
}

/// A detection, by name: `said` is its output in us of the board's clock, `said_ns` in ns of the host's.
#[derive(IntoPyObject)]
pub(crate) struct DetectionOut {
    label: String,
    t: i64,
    known: i64,
    slope: f64,
    said: i64,
    said_ns: i64,
    repaired: bool,
}

/// How a pipeline, or one of its recordings, ended.
#[pyclass(frozen, get_all)]
pub struct Ended {
    counters: Plain<Value>,
    verdict: Plain<Value>,
    /// The recording, where there is one.
    path: Option<PathBuf>,
    /// The fresh tare, as its file's text, where one was completed.
    tare: Option<String>,
}

impl From<Summary> for Ended {
    fn from(summary: Summary) -> Self {
        Self {
            counters: Plain(json!(summary.counters)),
            verdict: Plain(json!(summary.verdict)),
            path: summary.path,
            tare: summary.tare.as_ref().map(Tare::to_json),
        }
    }
}

fn to_record(path: PathBuf, compression: &str, overwrite: bool) -> PyResult<Record> {
    Ok(Record { path, compression: compression.parse().map_err(core)?, overwrite })
}

fn detection_out(output: OutputDetection) -> DetectionOut {
    let Detection { label, t, known, slope, repaired } = output.detection;
    DetectionOut { label, t, known, slope, said: output.output_us, said_ns: output.output_ns, repaired }
}

thread_local! {
    /// Whether this thread is calling a function that takes detections.
    static IN_CALLBACK: Cell<bool> = const { Cell::new(false) };
}

/// Datagrams to detections, as they come.
#[pyclass(frozen)]
pub struct Live {
    pipeline: Threaded<Pipeline>,
    /// How it ended, once it has; locked while it is being ended.
    summary: Mutex<Option<Summary>>,
}

impl Live {
    /// What others may do with it while it runs.
    pub(crate) fn handle(&self, py: Python<'_>) -> PyResult<Handle> {
        self.with(py, |pipeline| Ok(pipeline.handle()))
    }

    fn with<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&Pipeline) -> taxel_live::Result<T> + Send,
    ) -> PyResult<T> {
        self.pipeline.with(py, work)
    }
}

#[pymethods]
impl Live {
    /// Opens the socket, and the file where one is named (path, compression, overwrite).
    ///
    /// `options`, `readout` and `tare` are JSON; `tare_us` takes a fresh tare. `say` is called with each detection in the
    /// thread that made it, `lines` writes it to the standard output as JSON. With a `feed` no socket is opened.
    #[new]
    fn start(
        py: Python<'_>,
        host: &str,
        port: u16,
        parts: ArrayParts,
        options: &str,
        record: Option<(PathBuf, String, bool)>,
        readout: Option<&str>,
        tare: Option<&str>,
        tare_us: Option<i64>,
        say: Option<Py<PyAny>>,
        lines: bool,
        feed: Option<PyRef<'_, Feed>>,
    ) -> PyResult<Self> {
        let chosen: Chosen = parsed("options", options)?;
        let record = match record {
            None => None,
            Some((path, compression, overwrite)) => Some(to_record(path, &compression, overwrite)?),
        };
        let usual = LiveOptions::new(to_array(parts)?);
        let sources = enter(py, |_| {
            let sources = chosen.sources.iter();
            sources
                .map(|(name, what)| Ok(Source { name: name.clone(), kind: what.parse()? }))
                .collect::<taxel_live::Result<_>>()
        })?;
        let options = LiveOptions {
            name: chosen.name.clone(),
            sources,
            registers: chosen.registers(&usual.array)?,
            differences: chosen.differences,
            guard_frames: chosen.guard_frames,
            gap_frames: chosen.gap_frames,
            readout_events: chosen.readout_events.unwrap_or(usual.readout_events),
            capture: capture::ReceiverOptions {
                kernel_buffer_bytes: chosen.kernel_buffer_bytes.unwrap_or(usual.capture.kernel_buffer_bytes),
                queue_bytes: chosen.queue_bytes.unwrap_or(usual.capture.queue_bytes),
                gro: chosen.gro.unwrap_or(usual.capture.gro),
            },
            record,
            record_later: chosen.record_later,
            send: chosen.send.iter().map(|to| to.parse()).collect::<Result<_, _>>().map_err(live)?,
            ..usual
        };
        let mut sinks: Vec<Box<dyn Sink>> = vec![];
        if lines {
            sinks.push(Box::new(Lines(std::io::stdout())));
        }
        if let Some(say) = say {
            sinks.push(Box::new(move |output: &OutputDetection| {
                thread_state::attach(|py| {
                    IN_CALLBACK.set(true);
                    let outcome = say.call1(py, (detection_out(output.clone()),));
                    IN_CALLBACK.set(false);
                    outcome.map(drop)
                })
                .map_err(std::io::Error::other)
            }));
        }
        let readout = readout.map(Detector::from_json).transpose().map_err(core)?;
        let tare = tare.map(Tare::from_json).transpose().map_err(core)?;
        let readout = ReadoutSetup::of(readout, tare.as_ref(), tare_us, &options).map_err(core)?;
        let fed = feed.map(|feed| feed.receiver()).transpose().map_err(live)?;
        let pipeline = enter(py, |_| match fed {
            Some(receiver) => Pipeline::start_fed(receiver, options, readout, sinks),
            None => Pipeline::start(of_host(host, port)?, options, readout, sinks),
        })?;
        Ok(Self {
            pipeline: Threaded::new("live", "live: has been stopped; begin a new one", pipeline),
            summary: Mutex::default(),
        })
    }

    /// Host and port that it receives on.
    fn address(&self, py: Python<'_>) -> PyResult<(String, u16)> {
        let address = self.with(py, |pipeline| Ok(pipeline.address()))?;
        Ok((address.ip().to_string(), address.port()))
    }

    /// Where datagrams come from, in words.
    fn place(&self, py: Python<'_>) -> PyResult<String> {
        self.with(py, |pipeline| Ok(pipeline.place().to_string()))
    }

    /// The board's registers, as far as they are known.
    fn registers(&self, py: Python<'_>) -> PyResult<Plain<Value>> {
        self.with(py, |pipeline| Ok(Plain(json!(pipeline.handle().registers()))))
    }

    /// Copies for other computers, from the next batch on.
    fn copy(&self, py: Python<'_>) -> PyResult<Copies> {
        self.with(py, |pipeline| pipeline.handle().copy()).map(Copies::new)
    }

    /// The next detection; None after `timeout` seconds without one, or when all is over.
    fn next(&self, py: Python<'_>, timeout: f64) -> PyResult<Option<DetectionOut>> {
        let timeout = Duration::try_from_secs_f64(timeout)
            .map_err(|_| ProblemError::new_err(format!("timeout is {timeout} s: must be 0 or more")))?;
        self.pipeline.check()?;
        let output = enter(py, |stop| match self.pipeline.read().as_ref() {
            Some(pipeline) => pipeline.wait(timeout, stop),
            None => Ok(None),
        })?;
        Ok(output.map(detection_out))
    }

    /// Whether the pipeline has ended.
    fn is_over(&self, py: Python<'_>) -> bool {
        self.with(py, |pipeline| Ok(pipeline.is_over())).unwrap_or(true)
    }

    /// Counts of what came and what became of it.
    fn counters(&self, py: Python<'_>) -> PyResult<Plain<Value>> {
        self.with(py, |pipeline| {
            let counters = pipeline.counters();
            let mut all = json!(counters);
            all["arrival"] = json!(counters.arrival(taxel_live::recording::now_ns()));
            Ok(Plain(all))
        })
    }

    /// The values that the taxels hold, ticks, by taxel index.
    fn picture<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<u16>>> {
        Ok(array(py, self.with(py, |pipeline| Ok(pipeline.picture()))?))
    }

    /// The fresh tare, as JSON, once it is complete.
    fn tare(&self, py: Python<'_>) -> PyResult<Option<String>> {
        self.with(py, |pipeline| Ok(pipeline.tare().map(|tare| tare.to_json())))
    }

    /// Starts and stops that came since the last call: (t us, start).
    fn take_markers(&self, py: Python<'_>) -> PyResult<Vec<(i64, bool)>> {
        self.with(py, |pipeline| Ok(pipeline.take_markers().iter().map(|m| (m.t, m.start)).collect()))
    }

    /// Host and port that another board of the recording sends to; None where there is none of that name.
    fn source_address(&self, py: Python<'_>, name: &str) -> PyResult<Option<(String, u16)>> {
        let address = self.with(py, |pipeline| Ok(pipeline.source_address(name)))?;
        Ok(address.map(|address| (address.ip().to_string(), address.port())))
    }

    /// Records numbers of a source whose values a program gives; `arrived_ns` is now where it is left out.
    fn sample(&self, py: Python<'_>, name: &str, values: Vec<f64>, arrived_ns: Option<i64>) -> PyResult<()> {
        let arrived_ns = arrived_ns.unwrap_or_else(taxel_live::recording::now_ns);
        self.with(py, |pipeline| pipeline.sample(name, arrived_ns, &values))
    }

    /// Takes the values that taxels (column, row) hold for their rest from now on.
    fn zero(&self, py: Python<'_>, taxels: Vec<(u16, u16)>) -> PyResult<Plain<Vec<Zeroing>>> {
        self.with(py, |pipeline| pipeline.handle().zero(&taxels).map(Plain))
    }

    /// The latest zeroing of each taxel that was zeroed.
    fn zeroed(&self, py: Python<'_>) -> PyResult<Plain<Vec<Zeroing>>> {
        self.with(py, |pipeline| Ok(Plain(pipeline.handle().zeroed().0)))
    }

    /// Writes a note into the recording.
    fn note(&self, py: Python<'_>, text: &str) -> PyResult<()> {
        self.with(py, |pipeline| pipeline.note(text))
    }

    /// Records what comes from here on; returns how a recording that ran ended.
    fn record(&self, py: Python<'_>, path: PathBuf, compression: &str, overwrite: bool) -> PyResult<Option<Ended>> {
        let record = to_record(path, compression, overwrite)?;
        let ended = self.with(py, |pipeline| pipeline.record(&record))?;
        Ok(ended.map(Ended::from))
    }

    /// Lets the recording that runs begin anew where it holds nothing; returns whether it does.
    fn record_again(&self, py: Python<'_>) -> PyResult<bool> {
        self.with(py, |pipeline| Ok(pipeline.record_again()))
    }

    /// Ends the recording that runs; returns how.
    fn end_recording(&self, py: Python<'_>) -> PyResult<Ended> {
        self.with(py, Pipeline::end_recording).map(Ended::from)
    }

    /// Whether a recording that `record` began runs.
    fn records(&self, py: Python<'_>) -> bool {
        self.with(py, |pipeline| Ok(pipeline.records())).unwrap_or(false)
    }

    /// Announces that the host has set the board to this version of the wire.
    fn expect_version(&self, py: Python<'_>, version: u8) -> PyResult<()> {
        self.with(py, |pipeline| pipeline.expect_version(version))
    }

    /// Ends; returns how, the same at every call.
    fn stop(&self, py: Python<'_>) -> PyResult<Ended> {
        self.pipeline.check()?;
        if IN_CALLBACK.get() {
            let text =
                "live: `stop` was called by its own `say`, and would wait for itself; call it from another thread";
            return Err(ProblemError::new_err(text));
        }
        enter(py, |_| {
            // A thread that waits for a detection returns then, and releases the pipeline.
            self.pipeline.read().iter().for_each(Pipeline::end);
            let mut summary = self.summary.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some(pipeline) = self.pipeline.take() {
                *summary = Some(pipeline.stop()?);
            }
            let ended = summary.clone();
            ended.ok_or_else(|| taxel_live::Error::from(problem!("live: ended by an error, which was raised then")))
        })
        .map(Ended::from)
    }
}

/// The serial ports that the system knows.
#[pyfunction]
pub fn serial_ports(py: Python<'_>) -> PyResult<Plain<Vec<ports::Port>>> {
    enter(py, |_| ports::ports()).map(Plain)
}

/// Sends datagrams over and over, `each` of them every `period_us`, for `seconds`; returns the counts.
#[pyfunction]
pub fn send(
    py: Python<'_>,
    host: &str,
    port: u16,
    datagrams: Vec<Vec<u8>>,
    each: usize,
    period_us: f64,
    seconds: f64,
    segment: bool,
) -> PyResult<Plain<Value>> {
    enter(py, |stop| {
        let mut sender = Sender::open(of_host(host, port)?, segment)?;
        sender.repeat(&datagrams, each, period_us, seconds, stop)?;
        Ok::<_, taxel_live::Error>(Plain(json!(sender.counts())))
    })
}
