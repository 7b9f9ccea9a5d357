//! The pipeline from datagrams to detections, and the sender of the benchmarks.

use std::cell::Cell;
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use serde_json::{Value, json};
use taxel_core::encode::{Tare, Zeroing};
use taxel_core::problem;
use taxel_live::address::of_host;
use taxel_live::capture::Sender;
use taxel_live::pipeline::{
    Handle, LineSink, Live as Pipeline, LiveOptions, LiveSummary, OutputDetection, ReadLines, Record, Sink,
};
use taxel_live::recording::{Cause, Counts};

use crate::thread_state;
use crate::threaded::Threaded;
use taxel_border::convert::{array, slice};
use taxel_border::enter::enter;
use taxel_border::errors::{ProblemError, core};
use taxel_border::parameters::{Plain, parsed};

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

impl From<LiveSummary> for Ended {
    fn from(summary: LiveSummary) -> Self {
        Self {
            counters: Plain(json!(summary.counters)),
            verdict: Plain(json!(summary.verdict)),
            path: summary.path,
            tare: summary.tare.as_ref().map(Tare::to_json),
        }
    }
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
    summary: Mutex<Option<LiveSummary>>,
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
    /// Opens the socket, and the file where one is named.
    ///
    /// `options` are those of Rust's `LiveOptions`, as JSON, but for `record`, as the name of a file may be no text. `say` is
    /// called with each detection in the thread that made it.
    #[new]
    fn start(py: Python<'_>, options: &str, record: Option<PathBuf>, say: Option<Py<PyAny>>) -> PyResult<Self> {
        let options = LiveOptions { record, ..parsed("options", options)? };
        options.array.check().map_err(core)?;
        let mut sinks: Vec<Box<dyn Sink>> = vec![];
        if options.lines {
            sinks.push(Box::new(LineSink(std::io::stdout())));
        }
        if let Some(say) = say {
            sinks.push(Box::new(move |output: &OutputDetection| {
                thread_state::attach(|py| {
                    IN_CALLBACK.set(true);
                    let outcome = say.call1(py, (Plain(output),));
                    IN_CALLBACK.set(false);
                    outcome.map(drop)
                })
                .map_err(std::io::Error::other)
            }));
        }
        let pipeline = enter(py, |_| Pipeline::open(options, sinks))?;
        Ok(Self {
            pipeline: Threaded::new("live: has been stopped; begin a new Live", pipeline),
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
        self.with(py, |pipeline| Ok(pipeline.origin().to_string()))
    }

    /// The next detection; None after `timeout` seconds without one, or when all is over.
    fn next(&self, py: Python<'_>, timeout: f64) -> PyResult<Option<Plain<OutputDetection>>> {
        let timeout = Duration::try_from_secs_f64(timeout)
            .map_err(|_| ProblemError::new_err(format!("timeout is {timeout} s: must be 0 or more")))?;
        let output = enter(py, |stop| match self.pipeline.read().as_ref() {
            Some(pipeline) => pipeline.wait(timeout, stop),
            None => Ok(None),
        })?;
        Ok(output.map(Plain))
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
            all["verdict"] = json!(pipeline.verdict(&counters));
            Ok(Plain(all))
        })
    }

    /// The sensor, as JSON values, and the name of the source.
    fn sensor(&self, py: Python<'_>) -> PyResult<(Plain<Value>, String)> {
        self.with(py, |pipeline| {
            let options = pipeline.options();
            Ok((Plain(json!(options.array)), options.name.clone()))
        })
    }

    /// Unit of the frames of numbers that it receives, and their length, us; None of a board.
    fn frame_layout(&self, py: Python<'_>) -> PyResult<Option<(String, f64)>> {
        self.with(py, |pipeline| {
            Ok(pipeline.layout().map(|layout| (layout.unit.clone(), layout.frame_us.unwrap_or_default())))
        })
    }

    /// The values of frames of numbers, by taxel index; none before the first frame.
    fn values<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f32>>> {
        Ok(array(py, self.with(py, |pipeline| Ok(pipeline.values()))?))
    }

    /// The values that the taxels hold, ticks, by taxel index.
    fn frame<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<u16>>> {
        Ok(array(py, self.with(py, |pipeline| Ok(pipeline.frame()))?))
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

    /// Passes lines of a source of numbers on: the arrival of each frame (ns since 1970), the stamps of frames if they
    /// have any, all values one after the other, the number of lines; of those that could not be read, of bytes in no line and
    /// of unfinished lines; the lines that were not read with their arrival, why reading fails now, and the time before which
    /// all that arrived was read.
    fn lines(
        &self,
        py: Python<'_>,
        name: &str,
        arrived_ns: PyReadonlyArray1<'_, i64>,
        stamps: PyReadonlyArray1<'_, f64>,
        values: PyReadonlyArray1<'_, f64>,
        lines: u64,
        unread_counts: (u64, u64, u64),
        unread: Vec<(i64, String)>,
        trouble: Option<String>,
        until_ns: i64,
    ) -> PyResult<()> {
        let read = ReadLines {
            arrived_ns: slice("arrived_ns", &arrived_ns)?.to_vec(),
            stamps: slice("stamps", &stamps)?.to_vec(),
            values: slice("values", &values)?.to_vec(),
            lines,
            counts: Counts::from([
                (Cause::Strange, unread_counts.0),
                (Cause::InNoLine, unread_counts.1),
                (Cause::UnfinishedLines, unread_counts.2),
            ]),
            unread,
            trouble,
            until_ns,
        };
        self.with(py, |pipeline| pipeline.lines(name, &read))
    }

    /// Ends a source of frames, of which no more lines can come.
    fn end_lines(&self, py: Python<'_>, name: &str) -> PyResult<()> {
        self.with(py, |pipeline| {
            pipeline.end_lines(name);
            Ok(())
        })
    }

    /// Takes the values that taxels (column, row) hold for their rest from now on.
    fn zero(&self, py: Python<'_>, taxels: Vec<(u16, u16)>) -> PyResult<Plain<Vec<Zeroing>>> {
        self.with(py, |pipeline| pipeline.zero(&taxels).map(Plain))
    }

    /// The latest zeroing of each taxel that was zeroed.
    fn zeroed(&self, py: Python<'_>) -> PyResult<Plain<Vec<Zeroing>>> {
        self.with(py, |pipeline| Ok(Plain(pipeline.latest_zeroings().0)))
    }

    /// Writes a note into the recording.
    fn note(&self, py: Python<'_>, text: &str) -> PyResult<()> {
        self.with(py, |pipeline| pipeline.note(text))
    }

    /// Records what comes from here on; returns how a recording that ran ended.
    fn record(&self, py: Python<'_>, path: PathBuf, compression: &str, overwrite: bool) -> PyResult<Option<Ended>> {
        let record = Record { path, compression: compression.parse().map_err(core)?, overwrite };
        let ended = self.with(py, |pipeline| match pipeline.options().record_later {
            true => pipeline.record(&record),
            false => Err(problem!("record: give record_later at the start to begin recordings later").into()),
        })?;
        Ok(ended.map(Ended::from))
    }

    /// Lets the recording that runs begin anew where it holds nothing; returns whether it does.
    fn record_again(&self, py: Python<'_>) -> PyResult<bool> {
        self.with(py, |pipeline| Ok(pipeline.record_again()))
    }

    /// Ends the recording that runs; returns how.
    fn end_recording(&self, py: Python<'_>) -> PyResult<Ended> {
        self.with(py, |pipeline| pipeline.end_recording()).map(Ended::from)
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
        if IN_CALLBACK.get() {
            let text = "live: `say` must not call `stop`, because `stop` waits for `say`: call `stop` from another \
                        thread";
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
            ended.ok_or_else(|| {
                taxel_live::Error::from(problem!("live: an earlier error ended it, so there is no summary"))
            })
        })
        .map(Ended::from)
    }
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
