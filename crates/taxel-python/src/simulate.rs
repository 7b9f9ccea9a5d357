//! Simulated touch, and the board that feels it, as fast as it goes.

use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use taxel_core::board::{Armed, Play, Played};
use taxel_core::contact::{Act, Contact, Motion, Pictures, Scene, Sensor};
use taxel_core::wire::Registers;
use taxel_core::{Error, Result, reading};
use taxel_live::address::of_text;
use taxel_live::emulate::{Emulator, EmulatorOptions, Report};

use crate::convert::{ArrayParts, EventsOut, array, from_events, slice, to_array};
use crate::enter::{enter, enter_telling};
use crate::errors::core;

/// An act as Python hands it over: silence in ms, a scene as JSON, or pictures with their period in us.
#[derive(FromPyObject)]
pub(crate) enum ActIn<'py> {
    Silence(f64),
    Ball(String),
    Pictures(PyReadonlyArray1<'py, f32>, f64),
}

fn scene(json: &str) -> Result<Scene> {
    reading::from_text(json).map_err(|unfit| Error::Scene(unfit.of("scene")))
}

fn to_acts(acts: Vec<ActIn<'_>>) -> PyResult<Vec<Act>> {
    acts.into_iter()
        .map(|act| {
            Ok(match act {
                ActIn::Silence(ms) => Act::Silence { ms },
                ActIn::Ball(json) => Act::Ball(scene(&json).map_err(core)?),
                ActIn::Pictures(values, period_us) => {
                    Act::Pictures(Pictures { values: slice("values", &values)?.to_vec(), period_us })
                }
            })
        })
        .collect()
}

fn to_sensor(json: &str) -> PyResult<Sensor> {
    reading::from_text(json).map_err(|unfit| core(Error::Scene(unfit.of("sensor"))))
}

/// Touches as Python gets them: kind, start and stop in us, speed in m/s, peak force in N.
type ContactsOut = Vec<(String, f64, f64, f64, f64)>;

/// Depth in mm and force in N at even steps, and touches.
type MotionOut<'py> = (Bound<'py, PyArray1<f32>>, Bound<'py, PyArray1<f32>>, ContactsOut);

fn from_contacts(contacts: &[Contact]) -> ContactsOut {
    contacts.iter().map(|c| (c.kind.name().to_owned(), c.start_us, c.stop_us, c.speed_m_s, c.peak_n)).collect()
}

/// Draws a scene; gives its parameters as JSON.
#[pyfunction]
fn draw_scene(parts: ArrayParts, seed: u64, index: u32, left_to_rest: bool) -> PyResult<String> {
    let scene = Scene::draw(&to_array(parts)?, seed, index, left_to_rest).map_err(core)?;
    serde_json::to_string(&scene).map_err(|error| core(Error::Scene(error.to_string())))
}

/// Works a scene out: depth in mm and force in N at even steps, and its touches.
#[pyfunction]
fn motion<'py>(py: Python<'py>, json: &str, step_us: f64) -> PyResult<MotionOut<'py>> {
    let motion = enter(py, |_| Motion::of(&scene(json)?, step_us))?;
    let contacts = from_contacts(&motion.contacts);
    Ok((array(py, motion.depth_mm), array(py, motion.force_n), contacts))
}

/// Works acts out without playing them: touches in us of the board's clock, force in N by frame.
#[pyfunction]
fn truth<'py>(
    py: Python<'py>,
    parts: ArrayParts,
    preset: &str,
    acts: Vec<ActIn<'py>>,
) -> PyResult<(ContactsOut, Bound<'py, PyArray1<f32>>)> {
    let registers = Registers::preset(preset).map_err(core)?;
    let (array_felt, sensor) = (to_array(parts)?, Sensor::default());
    let play = Play { array: array_felt, registers, sensor, seed: 0, acts: to_acts(acts)?, tare_ms: 0.0 };
    let stage = enter(py, |_| play.stage())?;
    Ok((from_contacts(stage.contacts()), array(py, stage.force_n())))
}

/// Plays acts to a board that arms, is tared and starts; gives what a host decodes of its datagrams, and how many they
/// were, with their words.
///
/// `watch` hears, once a second of the board's, what share is played; what it raises ends the play.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "Python names them")]
fn play<'py>(
    py: Python<'py>,
    parts: ArrayParts,
    preset: &str,
    sensor: &str,
    seed: u64,
    acts: Vec<ActIn<'py>>,
    tare_ms: f64,
    watch: Py<PyAny>,
) -> PyResult<(EventsOut<'py>, u64, u64)> {
    let (array, registers) = (to_array(parts)?, Registers::preset(preset).map_err(core)?);
    let play = Play { array, registers, sensor: to_sensor(sensor)?, seed, acts: to_acts(acts)?, tare_ms };
    let Played { events, datagrams, words } = enter_telling(py, |stop, teller| {
        play.hear(|share| teller.tell(Some(&watch), |py, told| told.call1(py, (share,))), stop)
    })?;
    Ok((from_events(py, events), datagrams, words))
}

/// Plays acts to a board that arms, is tared and starts, in real time, and sends its datagrams to `to`; gives the report.
///
/// `wire` is the version of the wire that it speaks; `control` is where the board takes commands by TCP; `begun` hears that address once the board is ready, `watch` a
/// report, as JSON, ten times a second. What either raises ends the play.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "Python names them")]
fn emulate(
    py: Python<'_>,
    to: &str,
    parts: ArrayParts,
    preset: &str,
    sensor: &str,
    seed: u64,
    acts: Vec<ActIn<'_>>,
    tare_ms: f64,
    wire: u8,
    control: Option<&str>,
    begun: Py<PyAny>,
    watch: Py<PyAny>,
) -> PyResult<String> {
    let (array, acts, sensor) = (to_array(parts)?, to_acts(acts)?, to_sensor(sensor)?);
    let registers = Registers { wire_version: wire, ..Registers::preset(preset).map_err(core)? };
    let (to, control) = enter(py, |_| Ok::<_, taxel_live::Error>((of_text(to)?, control.map(of_text).transpose()?)))?;
    enter_telling(py, |stop, teller| {
        let Armed { board, mut stage, commands } =
            Play { array: array.clone(), registers, sensor, seed, acts, tare_ms }.arm()?;
        let options = EmulatorOptions { control, commands, ..EmulatorOptions::to(to) };
        let mut emulator = Emulator::open(board, &array, options)?;
        let control = emulator.control_address().map(|a| a.to_string());
        teller.tell(Some(&begun), |py, told| told.call1(py, (control,)));
        let mut failed = Ok(());
        let mut touch = |ticks: &mut [u16]| {
            stage.frame(ticks).unwrap_or_else(|error| {
                failed = Err(error);
                false
            })
        };
        let say = |report: &Report| teller.tell(Some(&watch), |py, told| told.call1(py, (json(report),)));
        let report = emulator.run(&mut touch, say, stop)?;
        failed?;
        Ok::<_, taxel_live::Error>(json(&report))
    })
}

fn json(report: &Report) -> String {
    // Whole and finite numbers only: nothing in it can fail to be written.
    serde_json::to_string(report).unwrap_or_default()
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(draw_scene, module)?)?;
    module.add_function(wrap_pyfunction!(motion, module)?)?;
    module.add_function(wrap_pyfunction!(truth, module)?)?;
    module.add_function(wrap_pyfunction!(play, module)?)?;
    module.add_function(wrap_pyfunction!(emulate, module)?)
}
