//! The board's registers: presets, the rules that the hardware does not check, and the order of writes (Table 5.5).
//!
//! "Line" is the driven line, the outer step of the scan (the manual's "row", on the sensor a column); "step" is the
//! inner one, the multiplexer's (the manual's "col"). The manual's names are aliases when reading JSON and in
//! [`Registers::set`]. Fields, rules and presets are made from `registers.toml`.

mod field;
mod table;

pub use field::Field;
use field::{Scanned, us};
pub use table::{POWER_LAW, POWER_LAW_FRACTION, PRESETS, Preset, Registers};

use crate::wire::Command;
use crate::{Array, Error, Result, problem};

/// Sense lines that a board of the thesis' build has, however many of them the array uses; larger arrays have their rows.
const SENSE_LINES: u16 = 64;

/// Registers whose order of writing matters.
const TIMING: [u8; 4] = [1, 2, 3, 4];

/// All fields, in the order of the registers.
#[must_use]
pub fn fields() -> &'static [Field] {
    &table::FIELDS
}

/// A write that the rules forbid; nothing has changed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Refusal {
    /// The register that was to be written.
    pub register: u8,
    /// Which rule of the reference (5 and 6 only warn).
    pub rule: u8,
    /// Rule and numbers, in one line.
    pub text: String,
}

impl From<Refusal> for Error {
    fn from(refusal: Refusal) -> Self {
        Self::Device(refusal.text)
    }
}

impl Default for Registers {
    /// What the board holds at reset. Reading: the first preset, for with zeros every first write would be refused.
    fn default() -> Self {
        PRESETS[0].registers
    }
}

impl Registers {
    /// The preset of that name.
    ///
    /// # Errors
    ///
    /// `Problem` where there is none, with the names that there are.
    pub fn preset(name: &str) -> Result<Self> {
        match PRESETS.iter().find(|preset| preset.name == name) {
            Some(preset) => Ok(preset.registers),
            None => Err(problem!("preset {name:?}: there are {}", named(&PRESETS))),
        }
    }

    /// The preset of that name on a board of that array: a smaller one has fewer lines to drive.
    ///
    /// # Errors
    ///
    /// `Problem` where there is none, or where it is made for boards of more lines than version 1 names and the array
    /// has no more than these, or the other way round; with the names that there are.
    pub fn preset_on(name: &str, array: &Array) -> Result<Self> {
        let preset = Self::preset(name)?;
        let fitting = || PRESETS.iter().filter(|preset| preset.is_of_size(array));
        if !fitting().any(|preset| preset.name == name) {
            let Array { rows, columns, .. } = array;
            return Err(problem!(
                "preset {name:?} is not made for a board of {rows} x {columns} taxels: there are {}",
                named(fitting())
            ));
        }
        Ok(Self { lines: preset.lines.min(array.columns), ..preset })
    }

    /// These registers with a preset taken over, as a board of that array takes it: which version of the wire it speaks, and
    /// whether a recording runs, no preset says; channels are the board's build, and a smaller array has fewer lines.
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

    /// The presets that are made for boards of that array's size and so many channels.
    pub fn presets(array: &Array, channels: u8) -> impl Iterator<Item = &'static Preset> + use<'_> {
        PRESETS.iter().filter(move |preset| preset.is_of_size(array) && preset.registers.channels == channels)
    }

    /// What a board of that array and so many channels holds at reset.
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

    /// The registers whose eight words a board of so many channels read back, whatever the rules say.
    #[must_use]
    pub fn of_words(words: &[u32; 8], channels: u8) -> Self {
        let mut registers = Self { channels, ..Self::default() };
        for (register, &word) in (0..).zip(words) {
            registers.store(register, word);
        }
        registers
    }

    /// What a board holds that scans another sensor's frames as they come: so many a second, of values of so many bits. And by
    /// how many bits a value is to be shifted down, where the ramp of so fast a scan cannot tell that many.
    ///
    /// # Errors
    ///
    /// `Problem` where there are no such bits or so fast a scan is none; `Device` where the array breaks a rule.
    pub fn of_source(array: &Array, rate_hz: f64, bits: u32) -> Result<(Self, u32)> {
        const CHANNELS: u8 = 64;
        if !(1..=16).contains(&bits) {
            return Err(problem!("bits is {bits}: must be 1 to 16"));
        }
        let line = 1e8 / (rate_hz * f64::from(array.columns));
        let steps = u32::from(sense_lines(array)).div_ceil(CHANNELS.into());
        // Rule 7, and a ramp of 16 ticks.
        let least = f64::from(steps * (u32::from(CHANNELS) + 10));
        if !(line >= least && line <= 4e9) {
            let most = 1e8 / (least * f64::from(array.columns));
            let (rows, columns) = (array.rows, array.columns);
            return Err(problem!(
                "rate is {rate_hz} frames/s: of {rows} x {columns} taxels it must be above 0 and at most {most:.0}"
            ));
        }
        let line_period = line.round() as u32;
        let step_period = (line_period / steps).min(65_535);
        let step_read = step_period - 20;
        let (values, most) = ((1_u32 << bits) - 1, (3 * step_read - 1).min(65_534));
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

    /// Multiplexer steps in a line: on a board of 64 sense lines 4 with 16 channels, 1 with 64.
    #[must_use]
    pub fn steps(&self, array: &Array) -> u32 {
        u32::from(sense_lines(array)).div_ceil(u32::from(self.channels.max(1)))
    }

    /// A frame's length, 10 ns: lines times line period.
    #[must_use]
    pub fn frame_10ns(&self) -> u64 {
        u64::from(self.lines) * u64::from(self.line_period)
    }

    /// A frame's length, us.
    #[must_use]
    pub fn frame_us(&self) -> f64 {
        self.frame_10ns() as f64 / 100.0
    }

    /// Sets register `command.register` as a whole, as the board does.
    ///
    /// # Errors
    ///
    /// The rule that forbids it; then nothing has changed.
    pub fn write(&mut self, command: Command, array: &Array) -> std::result::Result<(), Refusal> {
        let Command { register, value } = command;
        if value & !Self::mask(register) != 0 {
            let text = format!("REG{register}=0x{value:08X} sets reserved bits: they must be 0 (rule 4)");
            return Err(Refusal { register, rule: 4, text });
        }
        let mut next = *self;
        next.store(register, value);
        next.rules(register, array).map_err(|mut refusal| {
            refusal.text = format!("{}; the board keeps {}", refusal.text, self.shown(register));
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
        if !matches!(self.channels, 16 | 64) {
            return Err(Error::Device(format!("{} channels: the converter has 16 or 64", self.channels)));
        }
        self.rules(0, array).map_err(Error::from)
    }

    /// The rules that refuse, in the order in which the board tries them: first that every value lies in its range.
    fn rules(&self, register: u8, array: &Array) -> std::result::Result<(), Refusal> {
        for field in fields() {
            let value = self.get(field);
            if value < field.least || value > field.greatest {
                let text = if field.least == 1 && field.offset == 0 && value == 0 {
                    format!("{} is 0: must be 1 or more (rule 4)", field.name)
                } else {
                    format!(
                        "{} {value} does not fit: must be {} to {} (rule 4)",
                        field.name, field.least, field.greatest
                    )
                };
                return Err(Refusal { register, rule: 4, text });
            }
        }
        let scanned = Scanned { steps: self.steps(array), driven_lines: array.columns, sense_lines: array.rows };
        match table::refused(self, &scanned) {
            Some((rule, text)) => Err(Refusal { register, rule, text }),
            None => Ok(()),
        }
    }

    /// What is allowed but hardly meant, one line each.
    #[must_use]
    pub fn warnings(&self) -> Vec<String> {
        table::warned(self).into_iter().map(|(_, text)| text).collect()
    }

    /// What a field holds, in its own unit.
    fn get(&self, field: &Field) -> u32 {
        let bits = self.word(field.register) >> field.shift & field.mask;
        // Of a count of lines the bits alone cannot say 0.
        if field.name == "lines" { self.lines.into() } else { bits + field.offset }
    }

    /// The writes that lead from these registers to `target`, in an order in which no write is refused on the way:
    /// 1, 2, 3, 4 when slowing down, 4, 3, 2, 1 when speeding up.
    ///
    /// `record` is left as it is: starting is a command of its own.
    ///
    /// # Errors
    ///
    /// `Device` where either set breaks a rule, or they are of boards with different channels.
    pub fn commands_to(&self, target: &Self, array: &Array) -> Result<Vec<Command>> {
        self.check(array)?;
        target.check(array)?;
        if self.channels != target.channels {
            return Err(Error::Device(format!(
                "the board has {} channels, the registers are for {}",
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
                Some(place) => left.remove(place),
                None => return Err(Error::Device("no order of writes leads there without a refusal".to_owned())),
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
    /// `Problem` where there is no such field; `Device` with the rule that would be broken. Then nothing has changed.
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
                return Err(problem!("register {name:?}: there are {}, channels", names.join(", ")));
            };
            // The manual's name counts as the register does, ours what is meant.
            let offset = if name == field.name { field.offset } else { 0 };
            let (least, greatest) = (field.least - field.offset + offset, field.greatest - field.offset + offset);
            if value < least || value > greatest {
                return Err(Error::Device(format!(
                    "{name} {value} does not fit: must be {least} to {greatest} (rule 4)"
                )));
            }
            let stored = value - offset;
            let rest = next.word(field.register) & !(field.mask << field.shift);
            next.store(field.register, rest | stored << field.shift);
        }
        next.check(array)?;
        *self = next;
        Ok(())
    }

    fn shown(&self, register: u8) -> String {
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
    /// Whether it is made for boards of the array's size: beyond the lines that version 1 can name, or within.
    fn is_of_size(&self, array: &Array) -> bool {
        (self.sense_lines > SENSE_LINES) == is_large(array)
    }
}

/// Presets' names, as an error lists them.
fn named<'a>(presets: impl IntoIterator<Item = &'a Preset>) -> String {
    let names: Vec<_> = presets.into_iter().map(|preset| format!("{:?}", preset.name)).collect();
    names.join(", ")
}

/// Whether an array has more lines than version 1 can name.
fn is_large(array: &Array) -> bool {
    array.rows.max(array.columns) > SENSE_LINES
}

/// The sense lines that a board for this array converts.
pub(crate) fn sense_lines(array: &Array) -> u16 {
    array.rows.max(SENSE_LINES)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_sensor_has_registers_that_keep_the_rules_and_its_rate() {
        for (rows, columns, rate, bits) in [(16, 8, 50.0, 12), (4, 5, 1000.0, 16), (128, 128, 400.0, 8), (1, 1, 0.1, 1)]
        {
            let array = Array::new(rows, columns, 1.0, "other").unwrap();
            let (registers, shift) = Registers::of_source(&array, rate, bits).unwrap();
            assert_eq!(u32::from(registers.ramp), ((1 << bits) - 1) >> shift);
            assert!((1e6 / registers.frame_us() / rate - 1.0).abs() < 1e-3, "{registers:?}");
            assert!(shift == 0 || bits == 16, "{shift} of {bits}");
        }
        let array = Array::new(64, 64, 1.0, "other").unwrap();
        for (rate, bits) in [(1e6, 8), (0.0, 8), (f64::NAN, 8), (-1.0, 8), (100.0, 0), (100.0, 17)] {
            assert!(Registers::of_source(&array, rate, bits).is_err());
        }
    }

    fn thesis() -> Array {
        Array::thesis()
    }

    #[test]
    fn a_preset_leaves_what_it_does_not_say() {
        let array = Array::new(16, 8, 1.0, "small").unwrap();
        for (wire_version, record, channels) in [(1, false, 16), (2, true, 64)] {
            let held = Registers { wire_version, record, channels, ..Registers::at_reset(&array, channels) };
            for preset in &PRESETS {
                let then = held.with_preset(&preset.registers, &array);
                assert_eq!(
                    (then.wire_version, then.record, then.channels, then.lines),
                    (wire_version, record, channels, 8)
                );
                let said = Registers { wire_version, record, channels, lines: 8, ..preset.registers };
                assert_eq!(then, said, "{}", preset.name);
            }
        }
        let of = |lines, channels| {
            let array = Array::new(lines, lines, 1.0, "any").unwrap();
            Registers::presets(&array, channels).map(|preset| preset.name).collect::<Vec<_>>()
        };
        assert_eq!(of(8, 16), ["5.2 kHz", "2 kHz", "5.2 kHz, FA-1"]);
        assert_eq!(of(64, 64), ["20.8 kHz"]);
        assert_eq!(of(128, 16), ["128 x 128, 1.3 kHz"]);
    }

    #[test]
    fn presets_keep_the_rules_and_their_rates() {
        let rates = [5208.33, 2000.64, 20_833.3, 5208.33, 1000.32, 2003.21, 5208.33, 1302.08];
        for (Preset { name, sense_lines, registers }, rate) in PRESETS.iter().zip(rates) {
            let array = Array::new(*sense_lines, *sense_lines, 1.0, "of the preset's size").unwrap();
            assert_eq!(registers.check(&array), Ok(()), "{name}");
            assert!(registers.warnings().is_empty(), "{name}");
            assert!((1e6 / registers.frame_us() / rate - 1.0).abs() < 1e-5, "{name}");
        }
        assert_eq!(Registers::default().frame_us(), 192.0);
    }

    #[test]
    fn a_set_comes_back_from_its_eight_words() {
        for Preset { sense_lines, registers: preset, .. } in PRESETS {
            let array = Array::new(sense_lines, sense_lines, 1.0, "of the preset's size").unwrap();
            let mut board = Registers::at_reset(&array, preset.channels);
            for command in board.commands_to(&preset, &array).unwrap() {
                board.write(command, &array).unwrap();
            }
            assert_eq!(board, preset);
            let words = std::array::from_fn(|n| board.word(n as u8));
            assert_eq!(Registers::of_words(&words, preset.channels), preset);
        }
    }

    #[test]
    fn slowing_down_writes_upwards_and_speeding_up_downwards() {
        let (fast, slow) = (PRESETS[0].registers, PRESETS[1].registers);
        let order = |from: Registers, to: Registers| -> Vec<u8> {
            from.commands_to(&to, &thesis()).unwrap().iter().map(|c| c.register).collect()
        };
        assert_eq!(order(fast, slow), [1, 2, 3, 4, 5]);
        assert_eq!(order(slow, fast), [4, 3, 2, 1, 5]);
    }

    #[test]
    fn every_rule_refuses_with_its_numbers_and_keeps_the_old_value() {
        let cases = [
            (
                1,
                299,
                1,
                "line_read 3.00 us is longer than line_period 2.99 us (rule 1); the board keeps line_period 3.00 us",
            ),
            (
                2,
                320,
                1,
                "line_read 3.20 us is longer than line_period 3.00 us (rule 1); the board keeps line_read 3.00 us",
            ),
            (
                2,
                299,
                2,
                "4 x step_period 0.75 us is longer than line_read 2.99 us (rule 2); the board keeps line_read 3.00 us",
            ),
            (
                3,
                76 << 16 | 75,
                1,
                "step_read 0.76 us is longer than step_period 0.75 us (rule 1); the board keeps step_period 0.75 us, step_read 0.55 us",
            ),
            (
                4,
                165,
                3,
                "ramp 165 ticks is not shorter than step_read 0.55 us = 165 ticks (rule 3); the board keeps ramp 150 ticks",
            ),
            (4, 0, 4, "ramp is 0: must be 1 or more (rule 4); the board keeps ramp 150 ticks"),
            (7, 1, 4, "REG7=0x00000001 sets reserved bits: they must be 0 (rule 4)"),
            (6, 9, 4, "REG6=0x00000009 sets reserved bits: they must be 0 (rule 4)"),
        ];
        for (register, value, rule, text) in cases {
            let mut registers = Registers::default();
            let refusal = registers.write(Command { register, value }, &thesis()).unwrap_err();
            assert_eq!((refusal.register, refusal.rule, refusal.text.as_str()), (register, rule, text));
            assert_eq!(registers, Registers::default());
        }
        let small = Array::new(8, 8, 1.0, "small").unwrap();
        let refusal = Registers::default().write(Command { register: 5, value: 8 << 16 }, &small).unwrap_err();
        assert_eq!(refusal.rule, 4);
        assert!(refusal.text.starts_with("9 lines: the array has 8 columns to drive"));
    }

    #[test]
    fn a_board_of_any_size_resets_to_registers_that_keep_the_rules() {
        for (rows, columns) in
            [(1, 1), (8, 8), (64, 64), (65, 3), (3, 65), (100, 100), (128, 128), (256, 256), (512, 128)]
        {
            let array = Array::new(rows, columns, 1.0, "any").unwrap();
            for channels in [16, 64] {
                let registers = Registers::at_reset(&array, channels);
                assert_eq!(registers.check(&array), Ok(()), "{rows} x {columns}, {channels} channels");
                assert!(registers.warnings().is_empty());
                assert_eq!(registers.lines, columns);
                assert_eq!(registers.wire_version, if rows > 64 || columns > 64 { 2 } else { 1 });
            }
        }
        let large = Array::new(128, 128, 1.0, "large").unwrap();
        assert_eq!(Registers::at_reset(&large, 64), Registers::preset("128 x 128, 1 kHz").unwrap());
        assert_eq!(Registers::at_reset(&large, 16), Registers::preset("128 x 128, 1.3 kHz").unwrap());
        let version_1 = Registers { wire_version: 1, ..Registers::at_reset(&large, 64) };
        assert!(version_1.check(&large).unwrap_err().to_string().ends_with("choose version 2 (rule 8)"));
        let hasty = Registers { step_period: 73, step_read: 53, ..Registers::preset("20.8 kHz").unwrap() };
        assert!(hasty.check(&thesis()).unwrap_err().to_string().ends_with("wants 0.74 us (rule 7)"));
    }

    #[test]
    fn a_file_that_knows_nothing_of_version_2_is_read() {
        let old = r#"{"random_lines":false,"mechanoreceptor":false,"invert_comparator":false,"frame_sync":true,
            "line_period":300,"line_read":300,"step_period":75,"step_read":55,"ramp":150,"noise_floor":3,"lines":64,
            "record":false,"channels":16}"#;
        assert_eq!(serde_json::from_str::<Registers>(old).unwrap(), Registers::default());
    }

    #[test]
    fn what_is_hardly_meant_is_warned_of() {
        let mut registers = Registers::default();
        registers.set("step_read", 56, &thesis()).unwrap();
        assert!(registers.warnings()[0].contains("leaves 0.19 us") && registers.warnings()[0].ends_with("(rule 5)"));
        let mut registers = Registers::default();
        registers.set("noise_floor", 150, &thesis()).unwrap();
        assert!(registers.warnings()[0].ends_with("(rule 6)"));
    }

    #[test]
    fn the_manuals_names_are_aliases() {
        let (mut a, mut b) = (Registers::default(), Registers::default());
        a.set("line_period", 400, &thesis()).unwrap();
        b.set("row_change_period", 400, &thesis()).unwrap();
        a.set("lines", 32, &thesis()).unwrap();
        b.set("nrows", 31, &thesis()).unwrap();
        assert_eq!(a, b);
        assert!(a.set("lines", 0, &thesis()).unwrap_err().to_string().contains("must be 1 to 256"));
        assert!(a.set("lines", 65, &thesis()).unwrap_err().to_string().contains("the array has 64 columns"));
        assert!(a.set("nrows", 256, &thesis()).unwrap_err().to_string().contains("must be 0 to 255"));
        assert!(a.set("speed", 1, &thesis()).unwrap_err().to_string().contains("there are random_lines, "));
    }

    #[test]
    fn any_set_leads_to_any_other_without_a_refusal() {
        use rand::{Rng, SeedableRng, rngs::StdRng};
        let mut random = StdRng::seed_from_u64(5);
        let mut draw = || loop {
            let top = 1 << random.random_range(4..20);
            let mut registers = Registers {
                line_period: random.random_range(1..top),
                line_read: random.random_range(1..top),
                step_period: random.random_range(1..top.min(65_536)) as u16,
                step_read: random.random_range(1..top.min(65_536)) as u16,
                ramp: random.random_range(1..top.min(65_536)) as u16,
                noise_floor: random.random(),
                lines: random.random_range(1..=64),
                ..Registers::default()
            };
            registers.line_read = registers.line_read.min(registers.line_period);
            registers.step_period = registers.step_period.min((registers.line_read / 4) as u16);
            registers.step_read = registers.step_read.min(registers.step_period);
            if registers.check(&thesis()).is_ok() {
                return registers;
            }
        };
        for _ in 0..2000 {
            let (mut board, target) = (draw(), draw());
            for command in board.commands_to(&target, &thesis()).unwrap() {
                board.write(command, &thesis()).unwrap();
            }
            assert_eq!(board, target);
        }
    }
}
