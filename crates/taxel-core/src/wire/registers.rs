//! The board's registers: presets, the rules that the hardware does not check, and the order of writes (Table 5.5).
//!
//! "Line" is the driven line, the outer step of the scan (the manual's "row", on the sensor a column); "step" is the
//! inner one, the multiplexer's (the manual's "col"). The manual's names are aliases when reading JSON and in
//! [`Registers::set`].

use serde::{Deserialize, Serialize};

use crate::wire::Command;
use crate::{Array, Error, Result, problem};

/// Sense lines of the thesis' array, shared out over the converter's channels in steps.
pub const SENSE_LINES: u16 = 64;

/// Below this, a step may be read before it has settled, in 10 ns (0.2 us, thesis 4.4.1).
pub const SETTLING: u16 = 20;

/// Registers whose order of writing matters.
const TIMING: [u8; 4] = [1, 2, 3, 4];

/// The presets by name; frames/s are 5208.33, 2000.64 and 20 833.3.
///
/// Reading: only 300 with 4 steps, and 5208 Hz, are certain (manual, thesis 4.4.1); the split within a step is ours.
pub const PRESETS: [(&str, Registers); 3] = [
    ("5.2 kHz", preset(300, 300, 75, 55, 150, 3, 16)),
    ("2 kHz", preset(781, 780, 195, 175, 510, 10, 16)),
    ("20.8 kHz", preset(75, 75, 75, 55, 150, 3, 64)),
];

const fn preset(
    line_period: u32,
    line_read: u32,
    step_period: u16,
    step_read: u16,
    ramp: u16,
    noise_floor: u8,
    channels: u8,
) -> Registers {
    Registers {
        random_lines: false,
        mechanoreceptor: false,
        invert_comparator: false,
        frame_sync: true,
        line_period,
        line_read,
        step_period,
        step_read,
        ramp,
        noise_floor,
        lines: 64,
        record: false,
        channels,
    }
}

/// What the registers hold, in the registers' own units.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Registers {
    /// Lines are driven in random order.
    #[serde(alias = "use_rand_row")]
    pub random_lines: bool,
    /// The comparator's mode; the manual: "unused for now".
    #[serde(alias = "comparator_mode")]
    pub mechanoreceptor: bool,
    /// A falling edge ends a sample.
    pub invert_comparator: bool,
    /// All events of a frame carry the time of its start.
    #[serde(alias = "use_frame_sync")]
    pub frame_sync: bool,
    /// Time from one driven line to the next, 10 ns.
    #[serde(alias = "row_change_period")]
    pub line_period: u32,
    /// Part of it in which the line is read, 10 ns.
    #[serde(alias = "row_read_duration")]
    pub line_read: u32,
    /// Time from one multiplexer step to the next, 10 ns.
    #[serde(alias = "col_change_period")]
    pub step_period: u16,
    /// Part of it in which the channels are read, 10 ns.
    #[serde(alias = "col_read_duration")]
    pub step_read: u16,
    /// How long the ramp rises, ticks of 1/300 us.
    #[serde(alias = "ramp_time")]
    pub ramp: u16,
    /// Smallest difference that does not make an event, ticks of 1/300 us.
    pub noise_floor: u8,
    /// Driven lines, 1 to 64 (the register `nrows` holds one less).
    pub lines: u8,
    /// A recording runs.
    pub record: bool,
    /// Channels of the converter, 16 or 64: the board's build, not a register.
    pub channels: u8,
}

/// A write that the rules forbid; nothing has changed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Refusal {
    /// The register that was to be written.
    pub register: u8,
    /// Which rule of the reference (1 to 4; 5 and 6 only warn).
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
        PRESETS[0].1
    }
}

impl Registers {
    /// The preset of that name.
    ///
    /// # Errors
    ///
    /// `Problem` where there is none, with the names that there are.
    pub fn preset(name: &str) -> Result<Self> {
        match PRESETS.iter().find(|(known, _)| *known == name) {
            Some((_, registers)) => Ok(*registers),
            None => {
                let names: Vec<_> = PRESETS.iter().map(|(known, _)| format!("{known:?}")).collect();
                Err(problem!("preset {name:?}: there are {}", names.join(", ")))
            }
        }
    }

    /// Multiplexer steps in a line: 4 with 16 channels, 1 with 64.
    #[must_use]
    pub fn steps(&self) -> u32 {
        u32::from(SENSE_LINES) / u32::from(self.channels.max(1))
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

    /// Register `n` as the board holds it; 0 where it has no such register.
    #[must_use]
    pub fn word(&self, n: u8) -> u32 {
        match n {
            0 => {
                u32::from(self.random_lines)
                    | u32::from(self.mechanoreceptor) << 1
                    | u32::from(self.invert_comparator) << 2
                    | u32::from(self.frame_sync) << 3
            }
            1 => self.line_period,
            2 => self.line_read,
            3 => u32::from(self.step_period) | u32::from(self.step_read) << 16,
            4 => u32::from(self.ramp),
            5 => u32::from(self.noise_floor) << 8 | u32::from(self.lines.wrapping_sub(1) & 0x3f) << 16,
            7 => u32::from(self.record) << 16,
            _ => 0,
        }
    }

    /// Which bits register `n` has; the others are reserved and must be 0.
    #[must_use]
    pub fn mask(n: u8) -> u32 {
        match n {
            0 => 0xf,
            1..=3 => u32::MAX,
            4 => 0xffff,
            5 => 0x003f_ff00,
            7 => 1 << 16,
            _ => 0,
        }
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

    /// Sets a register's fields, whatever the rules say.
    fn store(&mut self, register: u8, value: u32) {
        let bit = |n: u32| value >> n & 1 == 1;
        match register {
            0 => {
                self.random_lines = bit(0);
                self.mechanoreceptor = bit(1);
                self.invert_comparator = bit(2);
                self.frame_sync = bit(3);
            }
            1 => self.line_period = value,
            2 => self.line_read = value,
            3 => (self.step_period, self.step_read) = (value as u16, (value >> 16) as u16),
            4 => self.ramp = value as u16,
            5 => (self.noise_floor, self.lines) = ((value >> 8) as u8, (value >> 16 & 0x3f) as u8 + 1),
            7 => self.record = bit(16),
            _ => {}
        }
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
        if !(1..=64).contains(&self.lines) {
            return Err(Error::Device(format!("{} lines do not fit nrows: must be 1 to 64 (rule 4)", self.lines)));
        }
        self.rules(0, array).map_err(Error::from)
    }

    /// The rules that refuse (1 to 4), in the reference's order but with "at least 1" first.
    fn rules(&self, register: u8, array: &Array) -> std::result::Result<(), Refusal> {
        let refuse = |rule: u8, text: String| Err(Refusal { register, rule, text: format!("{text} (rule {rule})") });
        let periods = [
            ("line_period", self.line_period),
            ("line_read", self.line_read),
            ("step_period", self.step_period.into()),
            ("step_read", self.step_read.into()),
            ("ramp", self.ramp.into()),
        ];
        if let Some((name, _)) = periods.iter().find(|(_, value)| *value == 0) {
            return refuse(4, format!("{name} is 0: must be 1 or more"));
        }
        if u16::from(self.lines) > array.columns {
            return refuse(4, format!("{} lines: the array has {} columns to drive", self.lines, array.columns));
        }
        if self.line_read > self.line_period {
            return refuse(
                1,
                format!("line_read {} us is longer than line_period {} us", us(self.line_read), us(self.line_period)),
            );
        }
        if self.step_read > self.step_period {
            return refuse(
                1,
                format!("step_read {} us is longer than step_period {} us", us(self.step_read), us(self.step_period)),
            );
        }
        let steps = self.steps();
        if steps * u32::from(self.step_period) > self.line_read {
            return refuse(
                2,
                format!(
                    "{steps} x step_period {} us is longer than line_read {} us",
                    us(self.step_period),
                    us(self.line_read)
                ),
            );
        }
        if u32::from(self.ramp) >= 3 * u32::from(self.step_read) {
            return refuse(
                3,
                format!(
                    "ramp {} ticks is not shorter than step_read {} us = {} ticks",
                    self.ramp,
                    us(self.step_read),
                    3 * u32::from(self.step_read)
                ),
            );
        }
        Ok(())
    }

    /// What is allowed but hardly meant (rules 5 and 6), one line each.
    #[must_use]
    pub fn warnings(&self) -> Vec<String> {
        let mut warnings = vec![];
        let settling = self.step_period.saturating_sub(self.step_read);
        if settling < SETTLING {
            warnings.push(format!(
                "step_period {} us leaves {} us before step_read {} us: taxels settle in {} us (rule 5)",
                us(self.step_period),
                us(settling),
                us(self.step_read),
                us(SETTLING)
            ));
        }
        if u16::from(self.noise_floor) >= self.ramp {
            warnings.push(format!(
                "noise_floor {} ticks is not below ramp {} ticks: no event can ever come (rule 6)",
                self.noise_floor, self.ramp
            ));
        }
        warnings
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
    pub fn set_all(&mut self, fields: &[(impl AsRef<str>, u32)], array: &Array) -> Result<()> {
        let mut next = *self;
        for (name, value) in fields {
            let (name, value) = (name.as_ref(), *value);
            if name == "channels" {
                next.channels = value.min(u32::from(u8::MAX)) as u8;
                continue;
            }
            let Some(field) = FIELDS.iter().find(|f| f.name == name || f.manual == name) else {
                let names: Vec<_> = FIELDS.iter().map(|f| f.name).collect();
                return Err(problem!("register {name:?}: there are {}, channels", names.join(", ")));
            };
            // Of the two names, only the manual's `nrows` counts lines less one.
            let stored = if name == "lines" { value.wrapping_sub(1) } else { value };
            if stored > field.mask {
                let (low, high) = if name == "lines" { (1, 64) } else { (0, field.mask) };
                return Err(Error::Device(format!("{name} {value} does not fit: must be {low} to {high} (rule 4)")));
            }
            let rest = next.word(field.register) & !(field.mask << field.shift);
            next.store(field.register, rest | stored << field.shift);
        }
        next.check(array)?;
        *self = next;
        Ok(())
    }

    fn shown(&self, register: u8) -> String {
        match register {
            1 => format!("line_period {} us", us(self.line_period)),
            2 => format!("line_read {} us", us(self.line_read)),
            3 => format!("step_period {} us, step_read {} us", us(self.step_period), us(self.step_read)),
            4 => format!("ramp {} ticks", self.ramp),
            5 => format!("noise_floor {} ticks, {} lines", self.noise_floor, self.lines),
            _ => format!("REG{register}=0x{:08X}", self.word(register)),
        }
    }
}

/// Where a field lies (Table 5.5).
struct Field {
    name: &'static str,
    manual: &'static str,
    register: u8,
    shift: u32,
    mask: u32,
}

const fn field(name: &'static str, manual: &'static str, register: u8, shift: u32, mask: u32) -> Field {
    Field { name, manual, register, shift, mask }
}

const FIELDS: [Field; 12] = [
    field("random_lines", "use_rand_row", 0, 0, 1),
    field("mechanoreceptor", "comparator_mode", 0, 1, 1),
    field("invert_comparator", "invert_comparator", 0, 2, 1),
    field("frame_sync", "use_frame_sync", 0, 3, 1),
    field("line_period", "row_change_period", 1, 0, u32::MAX),
    field("line_read", "row_read_duration", 2, 0, u32::MAX),
    field("step_period", "col_change_period", 3, 0, 0xffff),
    field("step_read", "col_read_duration", 3, 16, 0xffff),
    field("ramp", "ramp_time", 4, 0, 0xffff),
    field("noise_floor", "noise_floor", 5, 8, 0xff),
    field("lines", "nrows", 5, 16, 0x3f),
    field("record", "record", 7, 16, 1),
];

/// 10 ns units as us, with two places.
fn us(units: impl Into<u32>) -> String {
    let units: u32 = units.into();
    format!("{}.{:02}", units / 100, units % 100)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn thesis() -> Array {
        Array::thesis()
    }

    #[test]
    fn presets_keep_the_rules_and_their_rates() {
        let rates = [5208.33, 2000.64, 20_833.3];
        for ((name, registers), rate) in PRESETS.iter().zip(rates) {
            assert_eq!(registers.check(&thesis()), Ok(()), "{name}");
            assert!(registers.warnings().is_empty(), "{name}");
            assert!((1e6 / registers.frame_us() / rate - 1.0).abs() < 1e-5, "{name}");
        }
        assert_eq!(Registers::default().frame_us(), 192.0);
    }

    #[test]
    fn a_set_comes_back_from_its_eight_words() {
        for (_, preset) in PRESETS {
            let mut board = Registers { channels: preset.channels, ..PRESETS[0].1 };
            if preset.channels == 64 {
                board = PRESETS[2].1;
            }
            for command in board.commands_to(&preset, &thesis()).unwrap() {
                board.write(command, &thesis()).unwrap();
            }
            assert_eq!(board, preset);
        }
    }

    #[test]
    fn slowing_down_writes_upwards_and_speeding_up_downwards() {
        let (fast, slow) = (PRESETS[0].1, PRESETS[1].1);
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
            (4, 1 << 16, 4, "REG4=0x00010000 sets reserved bits: they must be 0 (rule 4)"),
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
        assert!(a.set("lines", 0, &thesis()).unwrap_err().to_string().contains("must be 1 to 64"));
        assert!(a.set("lines", 65, &thesis()).unwrap_err().to_string().contains("must be 1 to 64"));
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
