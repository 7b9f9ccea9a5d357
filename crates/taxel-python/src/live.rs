//! The pipeline from datagrams to detections, and the sender of the benchmarks.

use std::path::PathBuf;
use std::sync::{PoisonError, RwLock};
use std::time::{Duration, Instant};

use numpy::PyArray1;
use pyo3::prelude::*;
use serde::Deserialize;
use serde_json::{Value, json};
use taxel_core::detect::Readout;
use taxel_core::encode::Tare;
use taxel_core::wire::Registers;
use taxel_core::{Array, problem};
use taxel_live::address::of_host;
use taxel_live::capture::{self, SendCounts, Sender};
use taxel_live::pipeline::{Ear, Lines, Live as Pipeline, LiveOptions, Record, Said, Sink};

use crate::convert::{ArrayParts, array, to_array};
use crate::enter::enter;
use crate::errors::{ProblemError, core};
use crate::parameters::parsed;

/// How long a wait lasts before Ctrl-C is looked for.
const LOOK_EVERY: Duration = Duration::from_millis(50);

/// What Python may choose; everything else is as Rust has it.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Chosen {
    /// A preset's name, or what the registers hold.
    registers: Value,
    differences: bool,
    guard_frames: f64,
    readout_events: Option<usize>,
    kernel_buffer_bytes: Option<usize>,
    queue_bytes: Option<usize>,
    gro: Option<bool>,
}

impl Chosen {
    fn registers(&self, array: &Array) -> PyResult<Registers> {
        match &self.registers {
            Value::String(name) => {
                let preset = Registers::preset(name).map_err(core)?;
                // A smaller array has fewer lines to drive.
                let lines = preset.lines.min(array.columns);
                Ok(Registers { lines, ..preset })
            }
            held => Registers::deserialize(held).map_err(|e| ProblemError::new_err(format!("registers: {e}"))),
        }
    }
}

/// Label, t, known, slope, said (us of the board's clock), said (ns of the host's clock).
type SaidParts = (String, i64, i64, f64, i64, i64);

fn said_parts(said: Said) -> SaidParts {
    let d = said.detection;
    (d.label, d.t, d.known, d.slope, said.said, said.said_ns)
}

/// Datagrams to detections, as they come.
#[pyclass(frozen)]
struct Live {
    /// Never waited for while the GIL is held: whoever holds it may be asking for the GIL to look for Ctrl-C.
    pipeline: RwLock<Option<Pipeline>>,
}

impl Live {
    fn with<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&Pipeline) -> taxel_live::Result<T> + Send,
    ) -> PyResult<T> {
        enter(py, |_| match self.pipeline.read().unwrap_or_else(PoisonError::into_inner).as_ref() {
            Some(pipeline) => work(pipeline),
            None => Err(problem!("live: has been stopped; begin a new one").into()),
        })
    }
}

#[pymethods]
impl Live {
    /// Opens the socket, and the file where one is named (path, compression, overwrite).
    ///
    /// `options`, `readout` and `tare` are JSON; `tare_us` takes a fresh tare. `say` is called with each detection in the
    /// thread that made it, `lines` writes it to the standard output as JSON.
    #[new]
    #[allow(clippy::too_many_arguments)]
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
    ) -> PyResult<Self> {
        let chosen: Chosen = parsed("options", options)?;
        let record = match record {
            None => None,
            Some((path, compression, overwrite)) => {
                Some(Record { path, compression: compression.parse().map_err(core)?, overwrite })
            }
        };
        let usual = LiveOptions::new(to_array(parts)?);
        let options = LiveOptions {
            registers: chosen.registers(&usual.array)?,
            differences: chosen.differences,
            guard_frames: chosen.guard_frames,
            readout_events: chosen.readout_events.unwrap_or(usual.readout_events),
            capture: capture::ReceiverOptions {
                kernel_buffer_bytes: chosen.kernel_buffer_bytes.unwrap_or(usual.capture.kernel_buffer_bytes),
                queue_bytes: chosen.queue_bytes.unwrap_or(usual.capture.queue_bytes),
                gro: chosen.gro.unwrap_or(usual.capture.gro),
            },
            record,
            ..usual
        };
        let mut sinks: Vec<Box<dyn Sink>> = vec![];
        if lines {
            sinks.push(Box::new(Lines(std::io::stdout())));
        }
        if let Some(say) = say {
            sinks.push(Box::new(move |said: &Said| {
                Python::attach(|py| say.call1(py, said_parts(said.clone())).map(drop)).map_err(std::io::Error::other)
            }));
        }
        let readout = readout.map(Readout::from_json).transpose().map_err(core)?;
        let tare = tare.map(Tare::from_json).transpose().map_err(core)?;
        let ear = match (readout, tare_us) {
            (None, _) => Ear::Deaf,
            (Some(readout), Some(us)) => Ear::Taring(us, Box::new(readout)),
            (Some(readout), None) => {
                let frame_us = options.registers.frame_us();
                Ear::Reading(Box::new(readout.stream(&options.array, frame_us, tare.as_ref()).map_err(core)?))
            }
        };
        let pipeline = enter(py, |_| Pipeline::start(of_host(host, port)?, options, ear, sinks))?;
        Ok(Self { pipeline: RwLock::new(Some(pipeline)) })
    }

    /// Host and port that it listens on.
    fn address(&self, py: Python<'_>) -> PyResult<(String, u16)> {
        let address = self.with(py, |pipeline| Ok(pipeline.address()))?;
        Ok((address.ip().to_string(), address.port()))
    }

    /// The next detection; None after `timeout` seconds without one, or when all is over.
    fn next(&self, py: Python<'_>, timeout: f64) -> PyResult<Option<SaidParts>> {
        let timeout = Duration::try_from_secs_f64(timeout)
            .map_err(|_| ProblemError::new_err(format!("timeout is {timeout} s: must be 0 or more")))?;
        let until = Instant::now().checked_add(timeout);
        loop {
            let left = until.map_or(LOOK_EVERY, |t| t.saturating_duration_since(Instant::now()));
            let (said, over) =
                enter(py, |_| match self.pipeline.read().unwrap_or_else(PoisonError::into_inner).as_ref() {
                    Some(pipeline) => {
                        // Asked before: what ended it was then noted before, and `next` gives it.
                        let over = pipeline.is_over();
                        Ok::<_, taxel_live::Error>((pipeline.next(left.min(LOOK_EVERY))?, over))
                    }
                    None => Ok((None, true)),
                })?;
            py.check_signals()?;
            if said.is_some() || over || left.is_zero() {
                return Ok(said.map(said_parts));
            }
        }
    }

    /// Whether the way has ended.
    fn is_over(&self, py: Python<'_>) -> bool {
        self.with(py, |pipeline| Ok(pipeline.is_over())).unwrap_or(true)
    }

    /// What came and what became of it: JSON.
    fn counters(&self, py: Python<'_>) -> PyResult<String> {
        self.with(py, |pipeline| Ok(json!(pipeline.counters()).to_string()))
    }

    /// The values that the taxels hold, ticks, by taxel index.
    fn picture<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<u16>>> {
        Ok(array(py, self.with(py, |pipeline| Ok(pipeline.picture()))?))
    }

    /// The tare that was taken, as JSON, once it is complete.
    fn tare(&self, py: Python<'_>) -> PyResult<Option<String>> {
        self.with(py, |pipeline| Ok(pipeline.tare().map(|tare| tare.to_json())))
    }

    /// Starts and stops that came since this was asked last: (t us, start).
    fn take_markers(&self, py: Python<'_>) -> PyResult<Vec<(i64, bool)>> {
        self.with(py, |pipeline| Ok(pipeline.take_markers().iter().map(|m| (m.t, m.start)).collect()))
    }

    /// Writes something down in the recording.
    fn note(&self, py: Python<'_>, text: &str) -> PyResult<()> {
        self.with(py, |pipeline| pipeline.note(text))
    }

    /// Ends; gives counters, verdict and path as JSON, or None where it had ended before.
    fn stop(&self, py: Python<'_>) -> PyResult<Option<String>> {
        enter(py, |_| {
            let pipeline = self.pipeline.write().unwrap_or_else(PoisonError::into_inner).take();
            pipeline.map(|pipeline| Ok::<_, taxel_live::Error>(json!(pipeline.stop()?).to_string())).transpose()
        })
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        let pipeline = self.pipeline.get_mut().unwrap_or_else(PoisonError::into_inner).take();
        // Its threads may be about to call a Python function: they must be able to, or they never end.
        Python::attach(|py| py.detach(|| drop(pipeline)));
    }
}

/// Sends datagrams over and over, `each` of them every `period_us`, for `seconds`; gives what was sent as JSON.
#[pyfunction]
#[allow(clippy::too_many_arguments)]
fn send(
    py: Python<'_>,
    host: &str,
    port: u16,
    datagrams: Vec<Vec<u8>>,
    each: usize,
    period_us: f64,
    seconds: f64,
    segment: bool,
) -> PyResult<String> {
    if datagrams.is_empty() || each == 0 {
        return Err(ProblemError::new_err("send: needs one datagram or more, and one or more at a time"));
    }
    for (name, value) in [("period_us", period_us), ("seconds", seconds)] {
        if !(0.0..=1e9).contains(&value) {
            return Err(ProblemError::new_err(format!("{name} is {value}: must lie between 0 and 1e9")));
        }
    }
    let counts: SendCounts = enter(py, |stop| {
        let mut sender = Sender::open(of_host(host, port)?, segment)?;
        let begun = Instant::now();
        let mut next = datagrams.iter().cycle();
        for period in 0_u32.. {
            let due = Duration::from_secs_f64(f64::from(period) * period_us * 1e-6);
            if due.as_secs_f64() >= seconds || begun.elapsed().as_secs_f64() >= seconds || stop.asked() {
                break;
            }
            std::thread::sleep(due.saturating_sub(begun.elapsed()));
            for datagram in next.by_ref().take(each) {
                sender.push(datagram)?;
            }
            sender.flush()?;
        }
        Ok::<_, taxel_live::Error>(sender.counts())
    })?;
    Ok(json!(counts).to_string())
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Live>()?;
    module.add_function(wrap_pyfunction!(send, module)?)
}
