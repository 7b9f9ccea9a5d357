//! Commands from host to board: five bytes that set one register (Table 5.1).

use crate::{Error, Place, Result, problem};

/// Sets one 32-bit register.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Command {
    /// Number of the register, 0 to 7.
    pub register: u8,
    /// New value of the whole register.
    pub value: u32,
}

impl Command {
    /// A command that writes `value` to `register`.
    ///
    /// # Errors
    ///
    /// `Problem` if the register is above 7.
    pub fn new(register: u8, value: u32) -> Result<Self> {
        if register > 7 {
            return Err(problem!("register {register}: must be from 0 to 7"));
        }
        Ok(Self { register, value })
    }

    /// The command's five bytes: the first holds the register and the top bits of the value's four bytes, the others
    /// seven bits each.
    #[must_use]
    pub fn to_bytes(self) -> [u8; 5] {
        let v = self.value.to_be_bytes();
        let tops = v.iter().fold(0, |tops, byte| tops << 1 | byte >> 7);
        [0x80 | (self.register & 7) << 4 | tops, v[0] & 0x7f, v[1] & 0x7f, v[2] & 0x7f, v[3] & 0x7f]
    }

    /// Parses a command's five bytes.
    ///
    /// # Errors
    ///
    /// `Format` if the first byte's top bit is clear or another byte's is set.
    pub fn from_bytes(b: [u8; 5]) -> Result<Self> {
        if let Some(k) = (0..5).find(|&k| (b[k] >= 0x80) != (k == 0)) {
            let right = if k == 0 { "80 or above" } else { "below 80" };
            let text = format!("a command's byte is {:02X}: must be {right}", b[k]);
            return Err(Error::format(text).at(Place::byte(k as u64)));
        }
        let byte = |k: usize| b[k] | (b[0] >> (4 - k) & 1) << 7;
        Ok(Self { register: b[0] >> 4 & 7, value: u32::from_be_bytes([byte(1), byte(2), byte(3), byte(4)]) })
    }
}

/// Parses commands from bytes as they arrive, and resynchronises after damage.
#[derive(Debug, Clone, Default)]
pub struct CommandReader {
    bytes: [u8; 5],
    have: usize,
    skipped: u64,
}

impl CommandReader {
    /// Consumes the next byte; returns the command that it completes.
    pub fn push(&mut self, byte: u8) -> Option<Command> {
        if byte >= 0x80 {
            self.skipped += self.have as u64;
            self.have = 0;
        } else if self.have == 0 {
            self.skipped += 1;
            return None;
        }
        self.bytes[self.have] = byte;
        self.have += 1;
        if self.have < 5 {
            return None;
        }
        self.have = 0;
        Command::from_bytes(self.bytes).ok()
    }

    /// Number of bytes that belonged to no whole command.
    #[must_use]
    pub fn skipped(&self) -> u64 {
        self.skipped
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_comes_back_from_its_bytes() {
        for register in 0..8 {
            for value in [0, 1, 0x80, 0x8000_0000, 0x8080_8080, 0x7f7f_7f7f, 0xdead_beef, u32::MAX] {
                let command = Command::new(register, value).unwrap();
                assert_eq!(Command::from_bytes(command.to_bytes()), Ok(command));
            }
        }
    }

    #[test]
    fn top_bits_are_gathered_in_the_first_byte() {
        let command = Command { register: 5, value: 0x8000_8001 };
        assert_eq!(command.to_bytes(), [0b1101_1010, 0, 0, 0, 1]);
    }

    #[test]
    fn a_reader_finds_its_place_after_damage() {
        let (a, b) = (Command { register: 1, value: 300 }, Command { register: 4, value: 150 });
        let stream = [&[1, 2][..], &a.to_bytes(), &a.to_bytes()[..3], &b.to_bytes()].concat();
        let mut reader = CommandReader::default();
        let found: Vec<_> = stream.iter().filter_map(|&byte| reader.push(byte)).collect();
        assert_eq!(found, [a, b]);
        assert_eq!(reader.skipped(), 5);
    }

    #[test]
    fn nonsense_is_refused_with_its_place() {
        assert!(matches!(Command::new(8, 0), Err(Error::Problem(_))));
        for (bytes, byte) in [([0x80, 0, 0x81, 0, 0], 2), ([0; 5], 0)] {
            let Err(Error::Format(reason)) = Command::from_bytes(bytes) else { panic!("{bytes:?} is no command") };
            assert_eq!(reason.place, Some(Place::byte(byte)));
        }
    }
}
