//! The wire and the board: bytes, commands, registers.

use std::borrow::Cow;

use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use serde::Deserialize;
use serde_json::{Value, json};
use taxel_core::board::{Board, BoardCounts, BoardOptions, Crossed};
use taxel_core::circuit::Chain;
use taxel_core::wire::v2::{self, DatagramOutcome};
use taxel_core::wire::{self, Command, CutDatagrams, Decoder, Registers};
use taxel_core::{Error, Events, problem};

use taxel_border::convert::{
    ArrayIn, ColumnsIn, EventsIn, EventsOut, FilledOut, array, from_columns, from_events, slice, to_columns,
};
use taxel_border::enter::{Exclusive, enter};
use taxel_border::errors::core;
use taxel_border::parameters::{Plain, parsed};

/// A decoder of either version, and what the last datagram of version 2 was.
enum VersionedDecoder {
    One(Box<Decoder>),
    Two(Box<v2::Decoder>, Option<DatagramOutcome>),
}

/// Turns bytes of version 1, or datagrams of version 2, into events as they come.
#[pyclass(module = "taxel._core", frozen)]
pub struct WireDecoder(Exclusive<VersionedDecoder>);

impl WireDecoder {
    /// What waits in a decoder of version 1; nothing does in one of version 2.
    fn rest<'py>(&self, py: Python<'py>, release: fn(&mut Decoder, &mut Events)) -> EventsOut<'py> {
        let events = self.0.with(py, |decoder| match decoder {
            VersionedDecoder::One(decoder) => {
                let mut events = Events::empty(decoder.array().clone());
                release(decoder, &mut events);
                events
            }
            VersionedDecoder::Two(decoder, _) => Events::empty(decoder.array().clone()),
        });
        from_events(py, events)
    }
}

#[pymethods]
impl WireDecoder {
    /// `differences` is of version 1 alone: datagrams of version 2 state it themselves.
    #[new]
    fn new(version: u8, array: ArrayIn, differences: bool) -> PyResult<Self> {
        Ok(Self(Exclusive::new(match version {
            1 => VersionedDecoder::One(Box::new(Decoder::new(array.0).differences(differences))),
            _ => VersionedDecoder::Two(Box::new(v2::Decoder::new(array.0)), None),
        })))
    }

    /// Fills columns from their first row on with the events of bytes or of a datagram; ends a stream of version 1 with the
    /// `last` bytes.
    fn fill<'py>(
        &self,
        py: Python<'py>,
        data: PyReadonlyArray1<'_, u8>,
        arrived: Option<i64>,
        mut columns: ColumnsIn<'_>,
        last: bool,
    ) -> PyResult<FilledOut<'py>> {
        let data = slice("data", &data)?;
        let mut columns = to_columns(&mut columns)?;
        self.0.enter(py, |decoder, stop| match decoder {
            VersionedDecoder::One(decoder) => decoder.fill(data, arrived, &mut columns, last, stop),
            VersionedDecoder::Two(decoder, outcome) => {
                *outcome = Some(decoder.fill(data, arrived, &mut columns)?);
                Ok(())
            }
        })?;
        Ok(from_columns(py, &columns))
    }

    /// As `fill`, of datagrams of version 1 that lie one behind the other, each decoded by itself, as a host receives them;
    /// ends the stream.
    fn fill_datagrams<'py>(
        &self,
        py: Python<'py>,
        data: PyReadonlyArray1<'_, u8>,
        lengths: PyReadonlyArray1<'_, i64>,
        mut columns: ColumnsIn<'_>,
    ) -> PyResult<FilledOut<'py>> {
        let (data, lengths) = (slice("data", &data)?, slice("lengths", &lengths)?);
        let mut columns = to_columns(&mut columns)?;
        self.0.enter(py, |decoder, stop| match decoder {
            VersionedDecoder::One(decoder) => decoder.fill_datagrams(data, lengths, &mut columns, stop),
            VersionedDecoder::Two(..) => Err(problem!(
                "lengths"; ": must be left out for version 2, whose datagrams come with their lengths"
            )),
        })?;
        Ok(from_columns(py, &columns))
    }

    /// Releases the change that waits for its intensity.
    fn end_of_datagram<'py>(&self, py: Python<'py>) -> EventsOut<'py> {
        self.rest(py, Decoder::end_of_datagram)
    }

    /// Ends the stream; returns the rest.
    fn finish<'py>(&self, py: Python<'py>) -> EventsOut<'py> {
        self.rest(py, Decoder::finish)
    }

    /// The version's counts.
    fn counts(&self, py: Python<'_>) -> Plain<Value> {
        Plain(self.0.with(py, |decoder| match decoder {
            VersionedDecoder::One(decoder) => json!(decoder.counts()),
            VersionedDecoder::Two(decoder, _) => json!(decoder.counts()),
        }))
    }

    /// Until when nothing comes after the last datagram of version 2, us, and whether that datagram was decoded.
    fn last(&self, py: Python<'_>) -> Option<(Option<i64>, bool)> {
        self.0.with(py, |decoder| match decoder {
            VersionedDecoder::One(_) => None,
            VersionedDecoder::Two(_, last) => last.map(|outcome| match outcome {
                DatagramOutcome::Intact { until, .. } => (until, true),
                DatagramOutcome::Repeated | DatagramOutcome::Refused(_) => (None, false),
            }),
        })
    }

    /// The totals that the board last sent.
    fn status(&self, py: Python<'_>) -> Option<Plain<v2::BoardTotals>> {
        self.0.with(py, |decoder| match decoder {
            VersionedDecoder::One(_) => None,
            VersionedDecoder::Two(decoder, _) => decoder.status().copied().map(Plain),
        })
    }

    /// What each taxel holds by index, -1 where that is not known.
    fn held<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i32>> {
        let held = self.0.with(py, |decoder| match decoder {
            VersionedDecoder::One(decoder) => decoder.held(),
            VersionedDecoder::Two(decoder, _) => decoder.held(),
        });
        array(py, held.iter().map(|held| held.map_or(-1, i32::from)).collect())
    }
}

/// How many rows bytes of a version may need: of a stream of version 1, of a datagram or a stream of version 2.
#[pyfunction]
pub fn wire_rows(version: u8, length: usize) -> usize {
    match version {
        1 => wire::most_rows(length),
        _ => v2::most_rows(length),
    }
}

/// Offsets of datagrams, and their times, us.
type CutOut<'py> = (Bound<'py, PyArray1<i64>>, Bound<'py, PyArray1<i64>>);

/// Where datagrams begin into which bytes of version 1 are cut, and where the last one ends; the board's time of each, us.
#[pyfunction]
pub fn wire_cut<'py>(py: Python<'py>, data: PyReadonlyArray1<'_, u8>) -> PyResult<CutOut<'py>> {
    let data = slice("data", &data)?;
    let CutDatagrams { offsets, times } = enter(py, |_| Ok::<_, Error>(wire::cut(data)))?;
    Ok((array(py, offsets.into_iter().map(|at| at as i64).collect()), array(py, times)))
}

/// Events as bytes.
#[pyfunction]
pub fn wire_encode(py: Python<'_>, events: EventsIn<'_>) -> PyResult<Vec<u8>> {
    let events = events.view()?;
    enter(py, |_| wire::encode(events))
}

/// A command's five bytes.
#[pyfunction]
pub fn command_bytes(register: u8, value: u32) -> PyResult<[u8; 5]> {
    Ok(Command::new(register, value).map_err(core)?.to_bytes())
}

/// Register and value of a command's five bytes.
#[pyfunction]
pub fn command_read(data: PyReadonlyArray1<'_, u8>) -> PyResult<(u8, u32)> {
    let data = slice("data", &data)?;
    let bytes = data.try_into().map_err(|_| {
        taxel_border::errors::FormatError::new_err(format!("command of {} bytes: must be 5", data.len()))
    })?;
    let command = Command::from_bytes(bytes).map_err(core)?;
    Ok((command.register, command.value))
}

/// The presets' names.
#[pyfunction]
pub fn registers_presets() -> Vec<&'static str> {
    wire::registers::PRESETS.iter().map(|preset| preset.name).collect()
}

/// All fields, in the order of the registers: names, units, ranges, texts.
#[pyfunction]
pub fn registers_fields() -> Plain<&'static [wire::registers::Field]> {
    Plain(wire::registers::fields())
}

/// A preset: as it is written, or on a board of an array.
#[pyfunction]
#[pyo3(signature = (name, array = None))]
pub fn registers_preset(name: &str, array: Option<ArrayIn>) -> PyResult<Plain<Registers>> {
    let preset = match array {
        None => Registers::preset(name),
        Some(array) => Registers::preset_on(name, &array.0),
    };
    Ok(Plain(preset.map_err(core)?))
}

/// What a board of an array that holds these registers holds after a preset.
#[pyfunction]
pub fn registers_with_preset(registers: &str, name: &str, array: ArrayIn) -> PyResult<Plain<Registers>> {
    let held: Registers = parsed("registers", registers)?;
    let preset = Registers::preset_on(name, &array.0).map_err(core)?;
    Ok(Plain(held.with_preset(&preset, &array.0)))
}

/// What a board of an array and so many channels holds at reset.
#[pyfunction]
pub fn registers_at_reset(array: ArrayIn, channels: u8) -> PyResult<Plain<Registers>> {
    Ok(Plain(Registers::at_reset(&array.0, channels)))
}

/// What a board holds that scans another sensor's frames, and by how many bits values are shifted down.
#[pyfunction]
pub fn registers_of_source(array: ArrayIn, rate_hz: f64, bits: u32) -> PyResult<(Plain<Registers>, u32)> {
    let (registers, shift) = Registers::of_source(&array.0, rate_hz, bits).map_err(core)?;
    Ok((Plain(registers), shift))
}

/// Sets fields by name, in the registers' own units; returns the new set.
///
/// All are set before the rules are checked, so that their order does not matter.
#[pyfunction]
pub fn registers_with(registers: &str, fields: Vec<(String, u32)>, array: ArrayIn) -> PyResult<Plain<Registers>> {
    let mut registers: Registers = parsed("registers", registers)?;
    registers.set_all(&fields, &array.0).map_err(core)?;
    Ok(Plain(registers))
}

/// The registers that a file holds: values fit their fields and the array, whatever the other rules say.
#[pyfunction]
pub fn registers_of_file(registers: &str, array: ArrayIn) -> PyResult<Plain<Registers>> {
    let registers: Registers = parsed("registers", registers)?;
    registers.check_fit(&array.0).map_err(core)?;
    Ok(Plain(registers))
}

/// The warnings about values that are allowed.
#[pyfunction]
pub fn registers_warnings(registers: &str) -> PyResult<Vec<String>> {
    Ok(parsed::<Registers>("registers", registers)?.warnings())
}

/// The eight 32-bit registers, and a frame's length in us.
#[pyfunction]
pub fn registers_words(registers: &str) -> PyResult<(Vec<u32>, f64)> {
    let registers: Registers = parsed("registers", registers)?;
    Ok(((0..8).map(|n| registers.word(n)).collect(), registers.frame_us()))
}

/// What the eight 32-bit registers of a board of so many channels hold, whatever the rules say.
#[pyfunction]
pub fn registers_of_words(words: [u32; 8], channels: u8) -> Plain<Registers> {
    Plain(Registers::of_words(&words, channels))
}

/// The writes that lead from one set to another.
#[pyfunction]
pub fn registers_commands(source: &str, target: &str, array: ArrayIn) -> PyResult<Vec<(u8, u32)>> {
    let (from, to): (Registers, Registers) = (parsed("registers", source)?, parsed("registers", target)?);
    let commands = from.commands_to(&to, &array.0).map_err(core)?;
    Ok(commands.into_iter().map(|c| (c.register, c.value)).collect())
}

/// How an emulated board works.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WireBoardOptions {
    board: BoardOptions,
    circuit: Option<Chain>,
}

/// The emulated board, and the circuit through which it reads.
#[pyclass(module = "taxel._core", frozen)]
pub struct WireBoard(Exclusive<(Board, Option<Crossed>)>);

#[pymethods]
impl WireBoard {
    /// `registers` and `options` are JSON.
    #[new]
    fn new(registers: &str, array: ArrayIn, options: &str) -> PyResult<Self> {
        let (registers, array): (Registers, _) = (parsed("registers", registers)?, array.0);
        let WireBoardOptions { board, circuit } = parsed("options", options)?;
        let board = Board::with_options(registers, &array, board).map_err(core)?;
        let crossed = circuit.map(|chain| Crossed::new(chain, &registers, &array)).transpose().map_err(core)?;
        Ok(Self(Exclusive::new((board, crossed))))
    }

    /// Resets the board.
    fn reset(&self, py: Python<'_>) -> PyResult<()> {
        self.0.enter(py, |(board, _), _| board.reset())
    }

    fn greeting(&self, py: Python<'_>) -> String {
        self.0.with(py, |(board, _)| board.greeting())
    }

    fn registers(&self, py: Python<'_>) -> Plain<Registers> {
        Plain(self.0.with(py, |(board, _)| *board.registers()))
    }

    fn time_us(&self, py: Python<'_>) -> f64 {
        self.0.with(py, |(board, _)| board.time_us())
    }

    /// Takes command bytes; returns status lines.
    fn command(&self, py: Python<'_>, data: PyReadonlyArray1<'_, u8>) -> PyResult<String> {
        let data = slice("data", &data)?;
        self.0.enter(py, |(board, _), _| Ok::<_, Error>(board.command(data)))
    }

    fn record(&self, py: Python<'_>, start: bool) {
        self.0.with(py, |(board, _)| board.record(start));
    }

    fn faults(&self, py: Python<'_>) -> String {
        self.0.with(py, |(board, _)| board.faults())
    }

    /// Scans one frame; returns the datagrams, of which the sink takes at most so many.
    fn frame(
        &self,
        py: Python<'_>,
        ticks: PyReadonlyArray1<'_, u16>,
        most: usize,
        accepted: Option<PyReadonlyArray1<'_, bool>>,
    ) -> PyResult<Vec<Vec<u8>>> {
        let (ticks, mut sent) = (slice("ticks", &ticks)?, vec![]);
        let accepted = accepted.as_ref().map(|accepted| slice("accepted", accepted)).transpose()?;
        self.0.enter(py, |(board, crossed), _| {
            let mut ticks = Cow::from(ticks);
            // The board refuses a frame of another length.
            if let Some(crossed) = crossed
                && ticks.len() == crossed.taxels()
            {
                crossed.read(board.registers(), ticks.to_mut())?;
            }
            board.frame_accepting(&ticks, accepted, |datagram| {
                let room = sent.len() < most;
                if room {
                    sent.push(datagram.to_vec());
                }
                room
            })?;
            Ok::<_, Error>(sent)
        })
    }

    fn counts(&self, py: Python<'_>) -> Plain<BoardCounts> {
        Plain(self.0.with(py, |(board, _)| *board.counts()))
    }
}
