//! Status lines of the board: the text that it sends on its serial line (documented in `docs/wire.md`).

use std::fmt::{self, Display, Formatter};

use serde::Serialize;

/// The line in which a board describes itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Greeting {
    /// Version of the wire in its registers.
    pub wire_version: u8,
    /// Sense lines of its array.
    pub rows: u16,
    /// Driven lines of its array.
    pub columns: u16,
    /// Channels of its converter.
    pub channels: u8,
}

/// A line of the board that a host reacts to, without its end.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum StatusLine {
    /// The board describes itself: at its reset, and on request.
    Greeting(Greeting),
    /// A register that was written, or read.
    Register {
        /// Number of the register.
        register: u8,
        /// Value of the whole register.
        value: u32,
    },
    /// A write that the board refuses.
    Refusal {
        /// Number of the register.
        register: u8,
        /// Number of the rule that the write breaks.
        rule: u8,
    },
    /// The number of faults of one kind since reset.
    Fault {
        /// Kind of the fault.
        name: String,
        /// Number since reset.
        count: u64,
    },
}

impl StatusLine {
    /// Parses a line; `None` if it is another one.
    #[must_use]
    pub fn parse(line: &str) -> Option<Self> {
        let (kind, rest) = line.split_once(' ')?;
        match kind {
            "taxel-board" => greeting(rest).map(Self::Greeting),
            "ok" => {
                let (register, value) = rest.split_once("=0x")?;
                let value = u32::from_str_radix(value, 16).ok().filter(|_| value.len() == 8)?;
                Some(Self::Register { register: register_of(register)?, value })
            }
            "bad" => {
                let (register, rule) = rest.split_once(" rule ")?;
                Some(Self::Refusal { register: register_of(register)?, rule: rule.parse().ok()? })
            }
            "fault" => {
                let (name, count) = rest.split_once(' ')?;
                let name = Some(name).filter(|name| name.chars().all(char::is_alphanumeric) && !name.is_empty())?;
                Some(Self::Fault { name: name.to_owned(), count: count.parse().ok()? })
            }
            _ => None,
        }
    }
}

fn greeting(text: &str) -> Option<Greeting> {
    let mut words = text.split(' ');
    let mut word = || words.next();
    let (version, size, channels) = (word()?.strip_prefix('v')?, word()?, word()?.strip_suffix("ch")?);
    let (rows, columns) = size.split_once('x')?;
    let greeting = Greeting {
        wire_version: version.parse().ok()?,
        rows: rows.parse().ok()?,
        columns: columns.parse().ok()?,
        channels: channels.parse().ok()?,
    };
    word().is_none().then_some(greeting)
}

fn register_of(text: &str) -> Option<u8> {
    text.strip_prefix("REG")?.parse().ok().filter(|register| *register < 8)
}

impl Display for Greeting {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Self { wire_version, rows, columns, channels } = self;
        write!(f, "taxel-board v{wire_version} {rows}x{columns} {channels}ch")
    }
}

impl Display for StatusLine {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::Greeting(greeting) => greeting.fmt(f),
            Self::Register { register, value } => write!(f, "ok REG{register}=0x{value:08X}"),
            Self::Refusal { register, rule } => write!(f, "bad REG{register} rule {rule}"),
            Self::Fault { name, count } => write!(f, "fault {name} {count}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_comes_back_from_its_text() {
        let mut lines = vec![];
        for (k, value) in [0, 1, 0xA0, 0x8000_0000, u32::MAX].into_iter().enumerate() {
            let (register, rule) = (k as u8, 4 - k as u8);
            lines.push(StatusLine::Register { register, value });
            lines.push(StatusLine::Refusal { register, rule });
            lines.push(StatusLine::Fault { name: "queue".to_owned(), count: u64::from(value) << 8 });
            let [rows, columns] = [value as u16, (value >> 16) as u16];
            lines.push(StatusLine::Greeting(Greeting { wire_version: 1 + rule, rows, columns, channels: 64 }));
        }
        for line in lines {
            assert_eq!(StatusLine::parse(&line.to_string()), Some(line));
        }
        assert_eq!(
            StatusLine::parse("taxel-board v2 128x64 16ch"),
            Some(StatusLine::Greeting(Greeting { wire_version: 2, rows: 128, columns: 64, channels: 16 }))
        );
    }

    #[test]
    fn a_line_with_a_part_missing_or_damaged_is_another_one() {
        for line in ["taxel-board v1 64x64 16ch", "ok REG4=0x000000A0", "bad REG4 rule 3", "fault queue 3"] {
            assert!(StatusLine::parse(line).is_some(), "{line}");
            for k in 0..line.len() {
                let damaged = format!("{}\u{fffd}{}", &line[..k], &line[k + 1..]);
                assert_eq!(StatusLine::parse(&damaged), None, "{damaged}");
            }
            assert_eq!(StatusLine::parse(&format!("{line} ")), None);
            assert_eq!(StatusLine::parse(&format!(" {line}")), None);
        }
        for line in
            ["", "ok", "ok REG8=0x00000000", "ok REG4=0xA0", "status frames=2 events=500", "fault  3", "bad REG1"]
        {
            assert_eq!(StatusLine::parse(line), None, "{line}");
        }
    }
}
