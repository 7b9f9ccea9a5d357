//! Recordings: the live format's reader and writer.

use std::path::PathBuf;
use std::sync::Arc;

use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::{Value, json};
use taxel_core::detect::Detection;
use taxel_core::encode::Zeroing;
use taxel_core::{Marker, wire};
use taxel_live::clock::{self, BoardClock, Offset};
use taxel_live::recording::{
    self, Basis, BoardChange, Cause, CauseKind, Condition, Counts, FrameEncoding, Header, Reader, RecordingCounts,
    SourceWriter, Verdict, Writer, WriterOptions,
};

use crate::threaded::Threaded;
use taxel_border::convert::{Column, array, column, from_events, slice};
use taxel_border::enter::enter;
use taxel_border::errors::{core, live};
use taxel_border::parameters::{Plain, parsed};

/// The decoded datagrams of a board.
#[pyclass(frozen, get_all)]
pub struct DecodedDatagrams {
    /// The columns of the events.
    events: Py<PyDict>,
    /// The decoder's counts.
    counts: Plain<Value>,
    /// The counts of the decoder of version 2.
    version_2: Plain<Value>,
    /// What a verdict takes from decoding.
    found: Plain<Value>,
    /// The arrival of each datagram (ns), and the earliest time (us) at which it could leave the board.
    arrived_ns: Column<i64>,
    left: Column<i64>,
}

/// Frames, by name.
#[derive(IntoPyObject)]
struct Frames<'py> {
    /// Time of each, us, and in the file, ns.
    t: Bound<'py, PyArray1<i64>>,
    at_ns: Bound<'py, PyArray1<i64>>,
    /// All values, row by row.
    values: Bound<'py, PyArray1<f32>>,
    /// Number of messages that are no frame of the array.
    bad: u64,
}

/// What a recording holds beside its data.
#[pyclass(frozen, get_all)]
pub struct Remarks {
    /// The registers each time they were set, with the host's time (ns); notes; changes of the board with the host's time.
    registers: Plain<Value>,
    notes: Plain<Value>,
    /// Starts (true) and stops that the board marked, us.
    markers: Vec<(i64, bool)>,
    board: Plain<Value>,
    /// Detections: host's time (ns), label, t and known (us), slope, repaired.
    detections: Plain<Value>,
    /// Zeroed taxels, with the host's time.
    zeroings: Plain<Value>,
    /// The last counts before the end.
    counts: Plain<Value>,
    /// What a verdict takes from the file.
    condition: Plain<Value>,
    datagrams: u64,
    datagram_bytes: u64,
    /// The values that taxels held at the beginning, ticks; none if that is not known.
    held: Option<Vec<u16>>,
}

impl Remarks {
    pub(crate) fn new(all: &recording::Remarks, condition: &Condition) -> Self {
        let detections: Vec<_> =
            all.detections.iter().map(|(at, d)| (at, &d.label, d.t, d.known, d.slope, d.repaired)).collect();
        Self {
            registers: Plain(json!(all.registers)),
            notes: Plain(json!(all.notes)),
            markers: all.markers.iter().map(|marker| (marker.t, marker.start)).collect(),
            board: Plain(json!(all.board.iter().map(|c| (c.at_ns, c)).collect::<Vec<_>>())),
            detections: Plain(json!(detections)),
            zeroings: Plain(json!(all.zeroings)),
            counts: Plain(json!(all.counts)),
            condition: Plain(json!(condition)),
            datagrams: all.datagrams,
            datagram_bytes: all.datagram_bytes,
            held: all.held.clone(),
        }
    }
}

/// Bytes of datagrams, by name.
#[derive(IntoPyObject)]
struct Datagrams<'py> {
    arrived_ns: Bound<'py, PyArray1<i64>>,
    number: Bound<'py, PyArray1<u64>>,
    /// Where each begins, and the last ends.
    offsets: Bound<'py, PyArray1<i64>>,
    payload: Bound<'py, PyArray1<u8>>,
}

/// A recording of the live format, opened.
#[pyclass(frozen)]
pub struct RecordingReader {
    pub(crate) reader: Reader,
}

#[pymethods]
impl RecordingReader {
    #[new]
    fn open(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        Ok(Self { reader: enter(py, |_| Reader::open(&path))? })
    }

    /// The same reader, which returns at most so many bytes.
    fn within(&self, memory: u64) -> Self {
        Self { reader: self.reader.within(memory) }
    }

    /// The names of the sources.
    fn sources(&self) -> Vec<String> {
        self.reader.sources().map(str::to_owned).collect()
    }

    /// The same recording as one of its sources has it.
    fn of_source(&self, name: &str) -> PyResult<Self> {
        Ok(Self { reader: self.reader.of_source(name).map_err(live)? })
    }

    /// All frames of a source.
    fn frames<'py>(&self, py: Python<'py>) -> PyResult<Frames<'py>> {
        let recording::Frames { t, at_ns, values, bad } = enter(py, |stop| self.reader.frames(stop))?;
        Ok(Frames { t: array(py, t), at_ns: array(py, at_ns), values: array(py, values), bad })
    }

    /// The header, how the recording ended, and what was rebuilt on opening.
    fn about(&self) -> (Plain<Value>, Plain<Value>, Plain<Value>) {
        let reader = &self.reader;
        (Plain(json!(reader.header())), Plain(json!(reader.ending())), Plain(json!(reader.rebuilt())))
    }

    /// What the recording holds beside its data.
    fn remarks(&self, py: Python<'_>) -> PyResult<Remarks> {
        let (all, bad_chunks) = enter(py, |stop| self.reader.remarks(stop))?;
        Ok(Remarks::new(&all, &self.reader.condition(&all, bad_chunks)))
    }

    /// Decodes all datagrams.
    fn decode(&self, py: Python<'_>) -> PyResult<DecodedDatagrams> {
        let decoded = enter(py, |stop| self.reader.decode(stop))?;
        Ok(DecodedDatagrams {
            events: from_events(py, decoded.events).into_pyobject(py)?.unbind(),
            counts: Plain(json!(decoded.counts)),
            version_2: Plain(json!(decoded.version_2)),
            found: Plain(json!(decoded.found)),
            arrived_ns: column(py, decoded.arrived_ns),
            left: column(py, decoded.left),
        })
    }

    /// All datagrams as they came.
    fn datagrams<'py>(&self, py: Python<'py>) -> PyResult<Datagrams<'py>> {
        let all = enter(py, |stop| self.reader.datagrams(stop))?;
        let (arrived_ns, number) = (array(py, all.arrived_ns), array(py, all.number));
        Ok(Datagrams { arrived_ns, number, offsets: array(py, all.offsets), payload: array(py, all.bytes) })
    }
}

/// A recording of the live format, being written: one of its sources.
#[pyclass(frozen)]
pub struct RecordingWriter {
    writer: Arc<Threaded<Writer>>,
    /// The source, if it is not the first.
    source: Option<String>,
}

impl RecordingWriter {
    fn with<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&SourceWriter) -> taxel_live::Result<T> + Send,
    ) -> PyResult<T> {
        self.writer.with(py, |writer| match &self.source {
            None => work(writer),
            Some(name) => work(&writer.track(name)?),
        })
    }
}

#[pymethods]
impl RecordingWriter {
    /// Begins a recording; `header` is JSON.
    #[new]
    fn create(py: Python<'_>, path: PathBuf, header: &str, compression: &str, overwrite: bool) -> PyResult<Self> {
        let header: Header = parsed("header", header)?;
        let options = WriterOptions { compression: compression.parse().map_err(core)?, overwrite };
        let writer = enter(py, |_| Writer::create(&path, &header, options))?;
        let writer = Threaded::new("the recording is finished: begin a new recording", writer);
        Ok(Self { writer: Arc::new(writer), source: None })
    }

    /// The writer of another source of the same recording.
    fn track(&self, name: &str) -> Self {
        Self { writer: Arc::clone(&self.writer), source: Some(name.to_owned()) }
    }

    /// Writes frames: number of the first, time in the file (ns) and board time (us) of each, all values.
    fn frames(
        &self,
        py: Python<'_>,
        first: u64,
        at_ns: PyReadonlyArray1<'_, i64>,
        t_us: PyReadonlyArray1<'_, i64>,
        values: PyReadonlyArray1<'_, f32>,
        integers: bool,
    ) -> PyResult<()> {
        let (at_ns, t_us, values) = (slice("at_ns", &at_ns)?, slice("t_us", &t_us)?, slice("values", &values)?);
        let encoding = if integers { FrameEncoding::Whole } else { FrameEncoding::Float };
        self.with(py, |track| track.frames(first, at_ns, t_us, values, encoding))
    }

    /// Ends a source that is not the first, with the counts of what was received and lost, given as JSON.
    fn end(&self, py: Python<'_>, counts: &str) -> PyResult<()> {
        let counts: RecordingCounts = parsed("counts", counts)?;
        self.with(py, |track| {
            track.end(counts);
            Ok(())
        })
    }

    /// Writes datagrams: arrival ns, number, where each begins in `payload` (and where the last ends), bytes.
    fn datagrams(
        &self,
        py: Python<'_>,
        arrived_ns: PyReadonlyArray1<'_, i64>,
        number: PyReadonlyArray1<'_, u64>,
        offsets: PyReadonlyArray1<'_, i64>,
        payload: PyReadonlyArray1<'_, u8>,
    ) -> PyResult<()> {
        let (arrived_ns, number) = (slice("arrived_ns", &arrived_ns)?, slice("number", &number)?);
        let (offsets, bytes) = (slice("offsets", &offsets)?, slice("payload", &payload)?);
        self.with(py, |writer| writer.datagrams(arrived_ns, number, offsets, bytes))
    }

    /// Writes one datagram.
    fn datagram(&self, py: Python<'_>, arrived_ns: i64, number: u64, payload: &[u8]) -> PyResult<()> {
        self.with(py, |writer| writer.datagram(arrived_ns, number, payload))
    }

    /// Writes a note.
    fn note(&self, py: Python<'_>, at_ns: i64, t_us: Option<i64>, text: &str) -> PyResult<()> {
        self.with(py, |writer| writer.note(at_ns, t_us, text))
    }

    /// Writes that a taxel was zeroed: t (us), x, y, rest, the rest before.
    fn zeroing(&self, py: Python<'_>, at_ns: i64, zeroing: (i64, u16, u16, f64, Option<f64>)) -> PyResult<()> {
        let (t, x, y, rest, before) = zeroing;
        self.with(py, |writer| writer.zeroing(at_ns, &Zeroing { t, x, y, rest, before }))
    }

    /// Writes a start or stop of the board.
    fn marker(&self, py: Python<'_>, at_ns: i64, t_us: i64, start: bool) -> PyResult<()> {
        self.with(py, |writer| writer.marker(at_ns, Marker { t: t_us, start }))
    }

    /// Writes a detection: label, t and known (us), slope, repaired.
    fn detection(&self, py: Python<'_>, at_ns: i64, detection: (String, i64, i64, f64, bool)) -> PyResult<()> {
        let (label, t, known, slope, repaired) = detection;
        self.with(py, |writer| writer.detection(at_ns, &Detection { label, t, known, slope, repaired }))
    }

    /// Writes a reset of the board or a change of its version of the wire, given as JSON.
    fn board_change(&self, py: Python<'_>, at_ns: i64, change: &str) -> PyResult<()> {
        let change: BoardChange = parsed("change", change)?;
        self.with(py, |writer| writer.board_change(&BoardChange { at_ns, ..change }))
    }

    /// Writes registers, given as JSON.
    fn registers(&self, py: Python<'_>, at_ns: i64, registers: &str) -> PyResult<()> {
        let registers: wire::Registers = parsed("registers", registers)?;
        self.with(py, |writer| writer.registers(at_ns, &registers))
    }

    /// Writes what was received and lost so far, given as JSON.
    fn counts(&self, py: Python<'_>, at_ns: i64, counts: &str) -> PyResult<()> {
        let counts: RecordingCounts = parsed("counts", counts)?;
        self.with(py, |writer| writer.counts(at_ns, &counts))
    }

    /// Writes a preview of held ticks, row by row.
    fn preview(&self, py: Python<'_>, at_ns: i64, t_us: i64, ticks: PyReadonlyArray1<'_, u16>) -> PyResult<()> {
        let ticks = slice("ticks", &ticks)?;
        self.with(py, |writer| writer.preview(at_ns, t_us, ticks))
    }

    /// Writes the values that the taxels held when it began, ticks by index, 65 535 of a taxel without any event so far.
    fn held(&self, py: Python<'_>, at_ns: i64, t_us: Option<i64>, ticks: PyReadonlyArray1<'_, u16>) -> PyResult<()> {
        let ticks = slice("ticks", &ticks)?;
        self.with(py, |writer| writer.held(at_ns, t_us, ticks))
    }

    /// Ends the recording; `counts` is JSON.
    fn finish(&self, py: Python<'_>, counts: &str) -> PyResult<()> {
        let counts: RecordingCounts = parsed("counts", counts)?;
        enter(py, |_| match self.writer.take() {
            Some(writer) => writer.finish(counts).map(drop),
            None => Err(self.writer.ended()),
        })
    }
}

/// The verdict on what is known of a recording, which is JSON.
#[pyfunction]
pub fn recording_verdict(basis: &str) -> PyResult<Plain<Value>> {
    Ok(Plain(json!(Verdict::new(parsed::<Basis>("verdict", basis)?))))
}

/// The line of a verdict, which is JSON.
#[pyfunction]
pub fn verdict_text(verdict: &str) -> PyResult<String> {
    Ok(parsed::<Verdict>("verdict", verdict)?.text())
}

/// All causes by which something is lost, damaged or noted: key, kind, words (of one, of several), meaning.
#[pyfunction]
pub fn causes() -> Vec<(&'static str, &'static str, (String, String), &'static str)> {
    let kind = |cause: Cause| match cause.kind() {
        CauseKind::Lost => "lost",
        CauseKind::Damaged | CauseKind::File => "damaged",
        CauseKind::Noted => "noted",
        CauseKind::Live => "live",
    };
    let words = |cause: Cause| (cause.words(1), cause.words(2));
    Cause::ALL.iter().map(|&cause| (cause.key(), kind(cause), words(cause), cause.meaning())).collect()
}

/// The damage among a decoder's counts, which are JSON.
#[pyfunction]
pub fn recording_damage(counts: &str) -> PyResult<Plain<Counts>> {
    Ok(Plain(Counts::of_version_1(&parsed("counts", counts)?)))
}

/// Lines between a source's clock and the host's, one for each stretch: its middle (us), and the line.
#[pyfunction]
pub fn clock_lines(
    py: Python<'_>,
    own_us: PyReadonlyArray1<'_, i64>,
    arrived_ns: PyReadonlyArray1<'_, i64>,
) -> PyResult<Plain<Vec<(i64, Offset)>>> {
    let (own_us, arrived_ns) = (slice("own_us", &own_us)?, slice("arrived_ns", &arrived_ns)?);
    enter(py, |_| Ok::<_, taxel_core::Error>(Plain(BoardClock::offsets_of(own_us, arrived_ns))))
}

/// Why a drift (ppm) and delays (us: of 99 in 100 datagrams at most, of one in two) cannot be; `None` if they can.
#[pyfunction]
pub fn clock_doubt(drift_ppm: f64, delay_us: f64, median_us: f64) -> Option<String> {
    clock::doubt(drift_ppm, delay_us, median_us)
}

/// Whether all values are whole and from 0 to 65 535, so that 16 bits hold them.
#[pyfunction]
pub fn whole_frames(py: Python<'_>, values: PyReadonlyArray1<'_, f32>) -> PyResult<bool> {
    let values = slice("values", &values)?;
    enter(py, |_| Ok::<_, taxel_core::Error>(FrameEncoding::choose(values) == FrameEncoding::Whole))
}
