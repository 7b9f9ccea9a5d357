//! The board's registers: presets, the rules that the hardware does not check, and the order of writes (Table 5.5).
//!
//! "Line" is the driven line, the outer step of the scan (the manual's "row", on the sensor a column); "step" is the
//! inner one, the multiplexer's (the manual's "col"). The manual's names are aliases when reading JSON and in
//! [`Registers::set`]. Fields, rules and presets are made from `registers.toml`.

mod field;
mod power_law;
mod presets;
mod rules;
mod table;

pub use field::Field;
use field::{Scanned, us};
pub use power_law::{POWER_LAW, POWER_LAW_FRACTION};
pub use presets::{PRESETS, Preset};
pub use table::Registers;

use crate::error::Reason;
use crate::wire::Command;
use crate::{Array, Error, Result, problem};

/// Sense lines of a board of the thesis' build, however many of them the array uses; for larger arrays it is the number
/// of rows.
const SENSE_LINES: u16 = 64;

/// Registers that must be written in a certain order.
const TIMING: [u8; 4] = [1, 2, 3, 4];

/// All fields, in the order of the registers.
#[must_use]
pub fn fields() -> &'static [Field] {
    table::FIELDS
}

/// A write that the rules forbid; nothing has changed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct WriteRefusal {
    /// The register that the write addressed.
    pub register: u8,
    /// Which rule of the reference.
    pub rule: u8,
    /// The rule and the numbers that break it, in one line.
    pub text: String,
}

impl From<WriteRefusal> for Error {
    fn from(refusal: WriteRefusal) -> Self {
        broken(&refusal.text)
    }
}

/// The error of a broken rule: of the field with which its text begins.
fn broken(text: &str) -> Error {
    let field = fields().iter().find(|f| text.strip_prefix(f.name).is_some_and(|rest| rest.starts_with([' ', ':'])));
    match field {
        Some(Field { name, .. }) => {
            Error::Device(Reason { argument: Some((*name).to_owned()), ..text[name.len()..].into() })
        }
        None => Error::device(text),
    }
}

impl Default for Registers {
    /// The state at reset. Reading: the first preset, because with zeros every first write would be refused.
    fn default() -> Self {
        PRESETS[0].registers
    }
}

impl Registers {
    /// The preset with this name.
    ///
    /// # Errors
    ///
    /// `Problem` if there is no preset with this name; the message lists the names.
    pub fn preset(name: &str) -> Result<Self> {
        match PRESETS.iter().find(|preset| preset.name == name) {
            Some(preset) => Ok(preset.registers),
            None => Err(problem!("preset"; " {name:?} is not known: must be one of {}", preset_names(PRESETS))),
        }
    }

    /// The preset with this name, adapted to the array: a smaller array has fewer lines to drive.
    ///
    /// # Errors
    ///
    /// `Problem` if there is no preset with this name, or if the preset is for boards with more lines than version 1
    /// can name and the array is not, or the other way round; the message lists the names.
    pub fn preset_on(name: &str, array: &Array) -> Result<Self> {
        let preset = Self::preset(name)?;
        let fitting = || PRESETS.iter().filter(|preset| preset.is_of_size(array));
        if !fitting().any(|preset| preset.name == name) {
            let Array { rows, columns, .. } = array;
            return Err(problem!(
                "preset"; " {name:?} is not for a board of {rows} x {columns} taxels: must be one of {}",
                preset_names(fitting())
            ));
        }
        Ok(Self { lines: preset.lines.min(array.columns), ..preset })
    }

    /// These registers with a preset applied, for a board with this array. A preset defines neither the version of the
    /// wire nor whether a recording runs; the number of channels belongs to the board's build, and a smaller array has
    /// fewer lines.
    #[must_use]
    pub fn with_preset(&self, preset: &Self, array: &Array) -> Self {
        Self {
            lines: preset.lines.min(array.columns),
            wire_version: self.wire_version,
            record: self.record,
            channels: self.channels,
            ..*preset
        }
    }

    /// The presets for boards of the array's size with this number of channels.
    pub fn presets(array: &Array, channels: u8) -> impl Iterator<Item = &'static Preset> + use<'_> {
        PRESETS.iter().filter(move |preset| preset.is_of_size(array) && preset.registers.channels == channels)
    }

    /// The state at reset of a board with this array and number of channels.
    ///
    /// Up to 64 lines the first preset; beyond, version 2 and a preset of 128 lines, its lines and steps fitted to the array.
    #[must_use]
    pub fn at_reset(array: &Array, channels: u8) -> Self {
        let large = is_large(array);
        let mut registers = Self::presets(array, channels).next().map_or_else(Self::default, |preset| preset.registers);
        registers.channels = channels;
        registers.lines = array.columns.min(if large { 256 } else { SENSE_LINES });
        if large {
            registers.line_read = registers.line_read.max(registers.steps(array) * u32::from(registers.step_period));
            registers.line_period = registers.line_period.max(registers.line_read);
        }
        registers
    }

    /// The registers that a board with this number of channels reads back as eight words; the rules are not checked.
    #[must_use]
    pub fn of_words(words: &[u32; 8], channels: u8) -> Self {
        let mut registers = Self { channels, ..Self::default() };
        for (register, &word) in (0..).zip(words) {
            registers.store(register, word);
        }
        registers
    }

    /// The registers of a board that scans another sensor's frames as they arrive, at `rate_hz` frames a second and
    /// with values of `bits` bits; and the number of bits by which values must be shifted down if the ramp of a scan at
    /// this rate resolves fewer.
    ///
    /// # Errors
    ///
    /// `Problem` if the number of bits or the rate is invalid; `Device` if the array breaks a rule.
    pub fn of_source(array: &Array, rate_hz: f64, bits: u32) -> Result<(Self, u32)> {
        const CHANNELS: u8 = 64;
        if !(1..=16).contains(&bits) {
            return Err(problem!("bits"; " is {bits}: must be from 1 to 16"));
        }
        let line = 1e8 / (rate_hz * f64::from(array.columns));
        let steps = u32::from(sense_lines(array)).div_ceil(CHANNELS.into());
        // Rule 7, with a ramp of 16 ticks.
        let least = f64::from(steps * (u32::from(CHANNELS) + 10));
        if !(line >= least && line <= 4e9) {
            let [slowest, most] = [4e9, least].map(|line| 1e8 / (line * f64::from(array.columns)));
            let (slowest, most) = ((slowest * 1e6).ceil() / 1e6, most.floor());
            let (rows, columns) = (array.rows, array.columns);
            return Err(problem!(
                "rate_hz"; " is {rate_hz}: must be from {slowest} to {most} for {rows} x {columns} taxels"
            ));
        }
        let line_period = line.round() as u32;
        let step_period = (line_period / steps).min(65_535);
        let step_read = step_period - 20;
        let (values, most) = ((1_u32 << bits) - 1, (3 * step_read - 5).min(65_534));
        let shift = (0..16).find(|shift| values >> shift <= most).unwrap_or(16);
        let registers = Self {
            channels: CHANNELS,
            lines: array.columns,
            line_period,
            line_read: line_period,
            step_period: step_period as u16,
            step_read: step_read as u16,
            ramp: (values >> shift) as u16,
            wire_version: 2,
            ..Self::default()
        };
        registers.check(array)?;
        Ok((registers, shift))
    }

    /// Number of multiplexer steps in a line: on a board with 64 sense lines 4 with 16 channels, 1 with 64.
    #[must_use]
    pub fn steps(&self, array: &Array) -> u32 {
        u32::from(sense_lines(array)).div_ceil(u32::from(self.channels.max(1)))
    }

    /// Length of a frame, in units of 10 ns: lines times line period.
    #[must_use]
    pub fn frame_10ns(&self) -> u64 {
        u64::from(self.lines) * u64::from(self.line_period)
    }

    /// Length of a frame, us.
    #[must_use]
    pub fn frame_us(&self) -> f64 {
        self.frame_10ns() as f64 / 100.0
    }

    /// Sets register `command.register` as a whole, as the board does.
    ///
    /// # Errors
    ///
    /// The rule that forbids the write; then no register has changed.
    pub fn write(&mut self, command: Command, array: &Array) -> std::result::Result<(), WriteRefusal> {
        let Command { register, value } = command;
        if value & !Self::mask(register) != 0 {
            let text = format!("REG{register}=0x{value:08X} sets reserved bits: they must be 0 (rule 4)");
            return Err(WriteRefusal { register, rule: 4, text });
        }
        let mut next = *self;
        next.store(register, value);
        next.rules(register, array).map_err(|mut refusal| {
            refusal.text = format!("{}; the board keeps {}", refusal.text, self.register_text(register));
            refusal
        })?;
        *self = next;
        Ok(())
    }

    /// Checks all rules.
    ///
    /// # Errors
    ///
    /// `Device`, with the first rule that is broken and the numbers.
    pub fn check(&self, array: &Array) -> Result<()> {
        self.check_channels()?;
        self.rules(0, array).map_err(Error::from)
    }

    /// Checks that values fit their fields and the array (rule 4): a file may be of a board with other rules of timing.
    ///
    /// # Errors
    ///
    /// `Device`, with the first value that does not fit.
    pub fn check_fit(&self, array: &Array) -> Result<()> {
        self.check_channels()?;
        self.rules(0, array).or_else(|refusal| if refusal.rule == 4 { Err(refusal.into()) } else { Ok(()) })
    }

    fn check_channels(&self) -> Result<()> {
        if matches!(self.channels, 16 | 64) {
            return Ok(());
        }
        let text = format!(" is {}: must be 16 or 64, those of the converter", self.channels);
        Err(Error::Device(Reason { argument: Some("channels".to_owned()), ..text.into() }))
    }

    /// The rules that refuse, in the order in which the board checks them; the first is that every value is in its
    /// range.
    fn rules(&self, register: u8, array: &Array) -> std::result::Result<(), WriteRefusal> {
        for field in fields() {
            let value = self.get(field);
            if value < field.least || value > field.greatest {
                let text =
                    format!("{} is {value}: must be from {} to {} (rule 4)", field.name, field.least, field.greatest);
                return Err(WriteRefusal { register, rule: 4, text });
            }
        }
        let scanned = Scanned { steps: self.steps(array), driven_lines: array.columns, sense_lines: array.rows };
        match rules::refusals(self, &scanned).into_iter().next() {
            Some((rule, text)) => Err(WriteRefusal { register, rule, text }),
            None => Ok(()),
        }
    }

    /// Warnings about values that are allowed but probably a mistake, one line each.
    #[must_use]
    pub fn warnings(&self) -> Vec<String> {
        rules::warnings(self).into_iter().map(|(_, text)| text).collect()
    }

    /// The value of a field, in the register's own unit.
    fn get(&self, field: &Field) -> u32 {
        let bits = self.word(field.register) >> field.shift & field.mask;
        // The bits alone cannot represent 0 lines.
        if field.name == "lines" { self.lines.into() } else { bits + field.offset }
    }

    /// The writes that lead from these registers to `target`, in an order in which no write is refused on the way:
    /// 1, 2, 3, 4 when slowing down, 4, 3, 2, 1 when speeding up.
    ///
    /// `record` is left as it is: starting is a command of its own.
    ///
    /// # Errors
    ///
    /// `Device` if either set breaks a rule, or they are of boards with different channels.
    pub fn commands_to(&self, target: &Self, array: &Array) -> Result<Vec<Command>> {
        self.check(array)?;
        target.check(array)?;
        if self.channels != target.channels {
            return Err(Error::device(format!(
                "the board has {} channels, but the registers are for {}",
                self.channels, target.channels
            )));
        }
        let mut left: Vec<u8> = TIMING.iter().copied().chain([0, 5]).collect();
        left.retain(|&n| self.word(n) != target.word(n));
        let (mut now, mut commands) = (*self, vec![]);
        // The rules chain the four registers (4 below 3 below 2 below 1), so some write that is left is always allowed.
        while !left.is_empty() {
            let allowed = left.iter().position(|&register| {
                let command = Command { register, value: target.word(register) };
                let fits = now.write(command, array).is_ok();
                if fits {
                    commands.push(command);
                }
                fits
            });
            match allowed {
                Some(index) => left.remove(index),
                None => return Err(Error::device("the board refuses every order of writes to these values")),
            };
        }
        Ok(commands)
    }

    /// Sets one field by its name or the manual's, in the register's own unit.
    ///
    /// # Errors
    ///
    /// As [`Self::set_all`].
    pub fn set(&mut self, name: &str, value: u32, array: &Array) -> Result<()> {
        self.set_all(&[(name, value)], array)
    }

    /// Sets fields by their names or the manual's, in the registers' own units; the rules must hold once all are set.
    ///
    /// # Errors
    ///
    /// `Problem` if there is no such field; `Device` with the rule that would be broken. In both cases no register has
    /// changed.
    pub fn set_all(&mut self, values: &[(impl AsRef<str>, u32)], array: &Array) -> Result<()> {
        let mut next = *self;
        for (name, value) in values {
            let (name, value) = (name.as_ref(), *value);
            if name == "channels" {
                next.channels = value.min(u32::from(u8::MAX)) as u8;
                continue;
            }
            let Some(field) = fields().iter().find(|f| f.name == name || f.manual == name) else {
                let names: Vec<_> = fields().iter().map(|f| f.name).collect();
                return Err(problem!(name; " is no register: must be one of {}, channels", names.join(", ")));
            };
            // The manual's name takes the value as the register holds it; ours takes the number meant, without the
            // register's offset.
            let offset = if name == field.name { field.offset } else { 0 };
            let (least, greatest) = (field.least - field.offset + offset, field.greatest - field.offset + offset);
            if value < least || value > greatest {
                let text = format!(" is {value}: must be from {least} to {greatest} (rule 4)");
                return Err(Error::Device(Reason { argument: Some(name.to_owned()), ..text.into() }));
            }
            let stored = value - offset;
            let rest = next.word(field.register) & !(field.mask << field.shift);
            next.store(field.register, rest | stored << field.shift);
        }
        next.check(array)?;
        *self = next;
        Ok(())
    }

    fn register_text(&self, register: u8) -> String {
        match register {
            1 => format!("line_period {} us", us(self.line_period.into())),
            2 => format!("line_read {} us", us(self.line_read.into())),
            3 => format!("step_period {} us, step_read {} us", us(self.step_period.into()), us(self.step_read.into())),
            4 => format!("ramp {} ticks", self.ramp),
            5 => format!("noise_floor {} ticks, {} lines", self.noise_floor, self.lines),
            _ => format!("REG{register}=0x{:08X}", self.word(register)),
        }
    }
}

impl Preset {
    /// Whether the preset is for boards of the array's size: with more lines than version 1 can name, or with at most
    /// as many.
    fn is_of_size(&self, array: &Array) -> bool {
        (self.sense_lines > SENSE_LINES) == is_large(array)
    }
}

/// The presets' names, as an error message lists them.
fn preset_names<'a>(presets: impl IntoIterator<Item = &'a Preset>) -> String {
    let names: Vec<_> = presets.into_iter().map(|preset| format!("{:?}", preset.name)).collect();
    names.join(", ")
}

/// Whether an array has more lines than version 1 can name.
fn is_large(array: &Array) -> bool {
    array.rows.max(array.columns) > SENSE_LINES
}

/// Number of sense lines that a board for this array converts.
pub(crate) fn sense_lines(array: &Array) -> u16 {
    array.rows.max(SENSE_LINES)
}

#[cfg(test)]
mod tests;
