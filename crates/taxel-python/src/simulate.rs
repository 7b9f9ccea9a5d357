//! Simulated touch, and the board that reads it, as fast as it goes.

use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::exceptions::PyStopIteration;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde::Deserialize;
use taxel_core::board::{self, Board, BoardOptions, Crossed, Flaws, NetworkFaults, Play, opening};
use taxel_core::circuit::Chain;
use taxel_core::contact::{Act, Bonded, Contact, Foam, FrameSequence, Motion, Narrow, Scene, Sensor, Taxels, Track};
use taxel_core::wire::Registers;
use taxel_core::{Error, Result, reading};
use taxel_live::address::of_text;
use taxel_live::emulate::{Emulator, EmulatorOptions, Replay, Report, Scenes, Touch};

use taxel_border::convert::{ArrayIn, Column, EventsIn, array, column, from_events, slice};
use taxel_border::enter::{Exclusive, enter, enter_with_progress};
use taxel_border::errors::core;
use taxel_border::parameters::{Plain, parsed};

/// An act as Python passes it: silence in ms, a scene as JSON, or a sequence of frames with its period in us.
#[derive(FromPyObject)]
pub(crate) enum ActIn<'py> {
    Silence(f64),
    Scene(String),
    Frames(PyReadonlyArray1<'py, f32>, f64),
}

fn scene(json: &str) -> Result<Scene> {
    reading::from_text(json).map_err(|unfit| unfit.scene("scene"))
}

fn to_act(act: ActIn<'_>) -> PyResult<Act> {
    Ok(match act {
        ActIn::Silence(ms) => Act::Silence { ms },
        ActIn::Scene(json) => Act::Scene(scene(&json).map_err(core)?),
        ActIn::Frames(values, period_us) => {
            Act::Frames(FrameSequence { values: slice("values", &values)?.to_vec(), period_us })
        }
    })
}

fn to_acts(acts: Vec<ActIn<'_>>) -> PyResult<Vec<Act>> {
    acts.into_iter().map(to_act).collect()
}

fn to_sensor(json: &str) -> PyResult<Sensor> {
    reading::from_text(json).map_err(|unfit| core(unfit.scene("sensor")))
}

/// What one body does at even steps, by name.
#[derive(IntoPyObject)]
pub(crate) struct TrackOut<'py> {
    x_mm: Bound<'py, PyArray1<f32>>,
    y_mm: Bound<'py, PyArray1<f32>>,
    depth_mm: Bound<'py, PyArray1<f32>>,
    force_n: Bound<'py, PyArray1<f32>>,
}

/// By body what it does; touches; the warning of one that is too narrow.
type MotionOut<'py> = (Vec<TrackOut<'py>>, Plain<Vec<Contact>>, Option<String>);

/// By number of an act the warning of a touch that is narrower than its cells resolve.
type NarrowOut = Vec<(usize, String)>;

fn from_narrow(narrow: &[(usize, Narrow)]) -> NarrowOut {
    narrow.iter().map(|(act, narrow)| (*act, narrow.to_string())).collect()
}

/// Draws a scene; gives its parameters.
#[pyfunction]
pub fn draw_scene(felt: ArrayIn, seed: u64, index: u32, left_to_rest: bool) -> PyResult<Plain<Scene>> {
    Scene::draw(&felt.0, seed, index, left_to_rest).map(Plain).map_err(core)
}

/// Refuses a scene or taxels that make no sense on an array, without computing the scene.
#[pyfunction]
pub fn check_scene(felt: ArrayIn, json: &str, sensor: &str) -> PyResult<()> {
    scene(json).and_then(|scene| scene.check(&felt.0)).map_err(core)?;
    to_sensor(sensor)?.check().map_err(core)
}

/// Works a scene out: each body's trajectory at even steps, and the touches.
#[pyfunction]
pub fn motion<'py>(py: Python<'py>, felt: ArrayIn, json: &str, step_us: f64) -> PyResult<MotionOut<'py>> {
    let motion = enter(py, |stop| Motion::compute(&scene(json)?, &felt.0, step_us, stop))?;
    let (contacts, narrow) = (Plain(motion.contacts), motion.narrow.map(|narrow| narrow.to_string()));
    let out = |Track { x_mm, y_mm, depth_mm, force_n }: Track| TrackOut {
        x_mm: array(py, x_mm),
        y_mm: array(py, y_mm),
        depth_mm: array(py, depth_mm),
        force_n: array(py, force_n),
    };
    Ok((motion.tracks.into_iter().map(out).collect(), contacts, narrow))
}

/// Works acts out without playing them: touches in us of the board's clock, force in N by frame. `registers` is JSON.
#[pyfunction]
pub fn truth<'py>(
    py: Python<'py>,
    felt: ArrayIn,
    registers: &str,
    acts: Vec<ActIn<'py>>,
) -> PyResult<(Plain<Vec<Contact>>, Column<f32>, NarrowOut)> {
    let registers = parsed("registers", registers)?;
    let (sensor, circuit, asynchronous, tare_ms) = (Sensor::default(), None, false, 0.0);
    let acts = to_acts(acts)?;
    let play = Play { array: felt.0, registers, sensor, seed: 0, acts, tare_ms, circuit, asynchronous };
    let (stage, force_n) = enter(py, |stop| {
        let stage = play.stage(stop)?;
        let force_n = stage.force_n()?;
        Ok::<_, Error>((stage, force_n))
    })?;
    Ok((Plain(stage.contacts().to_vec()), column(py, force_n), from_narrow(stage.narrow())))
}

/// The circuit of a board that is played to, and whether it is asynchronous.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PlayedBy {
    circuit: Option<Chain>,
    asynchronous: bool,
}

/// What a host decodes of the datagrams of a board that was played to.
#[pyclass(frozen, get_all, module = "taxel._core")]
pub struct Played {
    /// The columns of the events.
    events: Py<PyDict>,
    /// How many datagrams there were, with their words and bytes.
    datagrams: u64,
    words: u64,
    bytes: u64,
    narrow: NarrowOut,
}

/// Plays acts to a board that arms, is tared and starts. `registers` and `options` are JSON.
///
/// `watch` is called once a second of the board's with the share that is played; an exception of it ends the play.
#[pyfunction]
pub fn play(
    py: Python<'_>,
    felt: ArrayIn,
    registers: &str,
    sensor: &str,
    seed: u64,
    acts: Vec<ActIn<'_>>,
    tare_ms: f64,
    options: &str,
    watch: Py<PyAny>,
) -> PyResult<Played> {
    let (registers, sensor) = (parsed("registers", registers)?, to_sensor(sensor)?);
    let PlayedBy { circuit, asynchronous } = parsed("options", options)?;
    let play = Play { array: felt.0, registers, sensor, seed, acts: to_acts(acts)?, tare_ms, circuit, asynchronous };
    let board::Played { events, datagrams, words, bytes, narrow } = enter_with_progress(py, |stop, caller| {
        play.run(|share| caller.call(Some(&watch), |py, function| function.call1(py, (share,))), stop)
    })?;
    let events = from_events(py, events).into_pyobject(py)?.unbind();
    Ok(Played { events, datagrams, words, bytes, narrow: from_narrow(&narrow) })
}

/// The touch of an emulated board, as Python passes it.
#[expect(clippy::large_enum_variant, reason = "there is one by call")]
#[derive(FromPyObject)]
pub(crate) enum TouchIn<'py> {
    /// Events and the speed at which they are played.
    Events(EventsIn<'py>, f64),
    /// us, ticks, speed.
    Frames(PyReadonlyArray1<'py, i64>, PyReadonlyArray1<'py, u16>, f64),
    /// An iterator of acts.
    Acts(Py<PyAny>),
}

/// The options of an emulated board.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct EmulationOptions {
    registers: Registers,
    /// The board arms, is tared for so long, marks a start and at the end a stop; none where it does none of that.
    tare_ms: Option<f64>,
    board: BoardOptions,
    control: Option<String>,
    faults: Option<NetworkFaults>,
    circuit: Option<Chain>,
    flaws: Option<Flaws>,
    reset_every_s: Option<f64>,
    drift_ppm: f64,
    source_port: u16,
}

/// Takes acts from a Python iterator, one at a time.
struct Acts(Py<PyAny>);

impl Iterator for Acts {
    type Item = taxel_live::Result<Act>;

    fn next(&mut self) -> Option<Self::Item> {
        let act = Python::attach(|py| {
            let next = self.0.bind(py).call_method0("__next__");
            match next {
                Err(error) if error.is_instance_of::<PyStopIteration>(py) => None,
                Err(error) => Some(Err(error)),
                Ok(act) => Some(act.extract::<ActIn<'_>>().and_then(to_act)),
            }
        })?;
        // What Python raised is raised again as it was.
        Some(act.map_err(|error| taxel_live::Error::Sink(std::io::Error::other(error))))
    }
}

/// Plays a touch to an emulated board that sends its datagrams to `to`, in real time; gives the report.
///
/// `options` is JSON. `begun` is called with the address for commands once the board is ready, `watch` ten times a second
/// with a report and the touches that became known. An exception of either ends the play.
#[pyfunction]
pub fn emulate(
    py: Python<'_>,
    to: &str,
    felt: ArrayIn,
    sensor: &str,
    seed: u64,
    touch: TouchIn<'_>,
    options: &str,
    begun: Py<PyAny>,
    watch: Py<PyAny>,
) -> PyResult<Plain<Report>> {
    let array = felt.0;
    let chosen: EmulationOptions = parsed("options", options)?;
    let EmulationOptions { registers, tare_ms, board, .. } = chosen;
    let (frame_us, step) = (registers.frame_us(), u16::from(registers.noise_floor) + 1);
    let sensor = to_sensor(sensor)?;
    if let (TouchIn::Acts(_), Some(circuit)) = (&touch, &chosen.circuit) {
        Crossed::fits(circuit, &sensor).map_err(core)?;
    }
    let mut touch: Box<dyn Touch> = match touch {
        TouchIn::Acts(iterator) => {
            let taxels = Taxels::new(&sensor, array.len(), registers.ramp, seed).map_err(core)?;
            Box::new(enter(py, |_| Scenes::new(&array, taxels, frame_us, Acts(iterator)))?)
        }
        TouchIn::Events(events, speed) => {
            let events = events.view()?;
            Box::new(enter(py, |_| Replay::events(events, (frame_us, speed), step, registers.ramp))?)
        }
        TouchIn::Frames(t, values, speed) => {
            let (t, values) = (slice("t", &t)?.to_vec(), slice("values", &values)?.to_vec());
            Box::new(enter(py, |_| Replay::frames(&array, t, values, frame_us, speed))?)
        }
    };
    enter_with_progress(py, |stop, caller| {
        let board = Board::with_options(registers, &array, board)?;
        let options = EmulatorOptions {
            control: chosen.control.as_deref().map(of_text).transpose()?,
            commands: tare_ms.map_or(Ok(vec![]), |tare_ms| opening(&registers, tare_ms))?,
            arms: tare_ms.is_some(),
            marks_stop: tare_ms.is_some(),
            faults: chosen.faults,
            circuit: chosen.circuit,
            flaws: chosen.flaws,
            reset_every_s: chosen.reset_every_s,
            drift_ppm: chosen.drift_ppm,
            source_port: chosen.source_port,
            ..EmulatorOptions::to(of_text(to)?)
        };
        let mut emulator = Emulator::open(board, &array, options)?;
        let control = emulator.control_address().map(|a| a.to_string());
        caller.call(Some(&begun), |py, function| function.call1(py, (control,)));
        let report = emulator.run(
            &mut *touch,
            |report, touch| {
                let contacts = touch.take_contacts();
                caller.call(Some(&watch), |py, function| function.call1(py, (Plain(report), Plain(contacts))));
            },
            stop,
        )?;
        Ok::<_, taxel_live::Error>(Plain(report))
    })
}

/// Two columns.
type TwoOut<'py, A, B> = (Bound<'py, PyArray1<A>>, Bound<'py, PyArray1<B>>);

/// Foam bonded to the board.
#[pyclass(frozen, module = "taxel._core")]
pub struct Layer(Exclusive<Bonded>);

#[pymethods]
impl Layer {
    /// `foam` is JSON.
    #[new]
    fn new(py: Python<'_>, felt: ArrayIn, foam: &str, cells_per_pitch: u16, tolerance: f64) -> PyResult<Self> {
        let foam: Foam = reading::from_text(foam).map_err(|unfit| core(unfit.scene("foam")))?;
        let layer =
            enter(py, |stop| Ok::<_, Error>(Bonded::new(&foam, &felt.0, cells_per_pitch, stop)?.to_within(tolerance)))?;
        Ok(Self(Exclusive::new(layer)))
    }

    /// mm/MPa and the share that arrives at the base, by wave number in 1/mm.
    fn waves<'py>(&self, py: Python<'py>, waves: PyReadonlyArray1<'py, f64>) -> PyResult<TwoOut<'py, f64, f64>> {
        let waves = slice("waves", &waves)?;
        let (compliance, share) = self.0.with(py, |layer| {
            waves.iter().map(|q| (layer.compliance(*q), layer.base_share(*q))).unzip::<_, _, Vec<_>, Vec<_>>()
        });
        Ok((array(py, compliance), array(py, share)))
    }

    /// Rows and columns of cells over the array: where they lie, mm below and right of the first taxel.
    fn cells_mm<'py>(&self, py: Python<'py>) -> TwoOut<'py, f64, f64> {
        let places = self.0.with(py, |layer| layer.cells_mm());
        (array(py, places.0), array(py, places.1))
    }

    /// Pressure on the face and stress at the base, MPa, by taxel, where a body has sunk by so many mm at each cell.
    fn press<'py>(&self, py: Python<'py>, sunk: PyReadonlyArray1<'py, f64>) -> PyResult<TwoOut<'py, f64, f32>> {
        let sunk = slice("sunk", &sunk)?;
        let (pressure, base) = self.0.enter(py, |layer, stop| {
            let cells = layer.cells_under(sunk);
            let pressure = layer.press(&cells, stop)?.to_vec();
            let mut base = vec![];
            layer.arrive(&cells, &pressure, &mut base, stop)?;
            Ok::<_, Error>((layer.taxel_pressures(&cells, &pressure), base))
        })?;
        Ok((array(py, pressure), array(py, base)))
    }

    /// Forgets the latest touches.
    fn forget(&self, py: Python<'_>) {
        self.0.with(py, Bonded::forget);
    }
}

/// The pattern's values (ticks) of taxels in frames since it began: each taxel's place and frame.
#[pyfunction]
pub fn pattern_values<'py>(
    py: Python<'py>,
    felt: ArrayIn,
    x: PyReadonlyArray1<'py, u16>,
    y: PyReadonlyArray1<'py, u16>,
    frame: PyReadonlyArray1<'py, u16>,
    ramp: u16,
) -> PyResult<Bound<'py, PyArray1<u16>>> {
    let (x, y, frame) = (slice("x", &x)?, slice("y", &y)?, slice("frame", &frame)?);
    let values = x.iter().zip(y).zip(frame).map(|((&x, &y), &n)| board::pattern(&felt.0, (x, y), n, ramp));
    Ok(array(py, values.collect()))
}
