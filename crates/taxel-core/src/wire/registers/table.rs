//! Made from registers.toml by tools/registers.py (`make registers`): edit that.

use serde::{Deserialize, Serialize};

/// The values of the registers, in the registers' own units (Table 5.5).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Registers {
    /// Lines are driven in random order.
    #[serde(alias = "use_rand_row")]
    pub random_lines: bool,
    /// If set, each taxel is an FA-1 afferent (5.4.2): events are its spikes, intensities its integral. Otherwise events are changes.
    #[serde(alias = "comparator_mode")]
    pub mechanoreceptor: bool,
    /// A falling edge ends a sample.
    pub invert_comparator: bool,
    /// All events of a frame have the time at which the frame starts.
    #[serde(alias = "use_frame_sync")]
    pub frame_sync: bool,
    /// Version of the wire protocol that the board uses (our reading: the manual has only one version).
    pub wire_version: u8,
    /// The board sends the values of a simulated rolling ball instead of the comparators' values (our reading: the manual has no such bit).
    #[serde(default)]
    pub pattern: bool,
    /// FA-1: how much a spike raises the threshold (T A of Table 5.3). In units of 1/256 theta_0.
    pub threshold_jump: u16,
    /// Time from one driven line to the next. In units of 10 ns.
    #[serde(alias = "row_change_period")]
    pub line_period: u32,
    /// Part of line_period in which the line is read. In units of 10 ns.
    #[serde(alias = "row_read_duration")]
    pub line_read: u32,
    /// Time from one multiplexer step to the next. In units of 10 ns.
    #[serde(alias = "col_change_period")]
    pub step_period: u16,
    /// Part of step_period in which the channels are read. In units of 10 ns.
    #[serde(alias = "col_read_duration")]
    pub step_read: u16,
    /// Duration of the ramp. In units of ticks.
    #[serde(alias = "ramp_time")]
    pub ramp: u16,
    /// FA-1: theta_0, in ticks after the power law. In units of 1/1024.
    pub threshold_rest: u16,
    /// FA-1: how much a frame without a spike lowers the threshold (B of Table 5.3). In units of 1/1024 theta_0.
    pub threshold_decay: u8,
    /// Largest difference that does not cause an event. In units of ticks.
    pub noise_floor: u8,
    /// Number of driven lines (the register contains one less; the manual's field has 6 bits, our reading: 8).
    pub lines: u16,
    /// A recording is running: setting and clearing this bit sends a marker and switches the sync line.
    pub record: bool,
    /// Channels of the converter, 16 or 64: a property of the board, not a register.
    pub channels: u8,
}

impl Registers {
    /// The word of register `n`; 0 if there is no such register.
    #[must_use]
    pub fn word(&self, n: u8) -> u32 {
        match n {
            0 => {
                u32::from(self.random_lines)
                    | u32::from(self.mechanoreceptor) << 1
                    | u32::from(self.invert_comparator) << 2
                    | u32::from(self.frame_sync) << 3
                    | (u32::from(self.wire_version).wrapping_sub(1) & 0x3) << 4
                    | u32::from(self.pattern) << 6
                    | u32::from(self.threshold_jump) << 16
            }
            1 => self.line_period,
            2 => self.line_read,
            3 => u32::from(self.step_period) | u32::from(self.step_read) << 16,
            4 => u32::from(self.ramp) | u32::from(self.threshold_rest) << 16,
            5 => {
                u32::from(self.threshold_decay)
                    | u32::from(self.noise_floor) << 8
                    | (u32::from(self.lines).wrapping_sub(1) & 0xff) << 16
            }
            7 => u32::from(self.record) << 16,
            _ => 0,
        }
    }

    /// Mask of the bits of register `n`; the others are reserved and must be 0.
    #[must_use]
    pub fn mask(n: u8) -> u32 {
        match n {
            0 => 0xffff007f,
            1 => 0xffffffff,
            2 => 0xffffffff,
            3 => 0xffffffff,
            4 => 0xffffffff,
            5 => 0xffffff,
            7 => 0x10000,
            _ => 0,
        }
    }

    /// Sets a register's fields without checking the rules.
    pub(super) fn store(&mut self, register: u8, value: u32) {
        match register {
            0 => {
                self.random_lines = value & 0x1 == 1;
                self.mechanoreceptor = (value >> 1) & 0x1 == 1;
                self.invert_comparator = (value >> 2) & 0x1 == 1;
                self.frame_sync = (value >> 3) & 0x1 == 1;
                self.wire_version = ((value >> 4) & 0x3) as u8 + 1;
                self.pattern = (value >> 6) & 0x1 == 1;
                self.threshold_jump = ((value >> 16) & 0xffff) as u16;
            }
            1 => {
                self.line_period = value;
            }
            2 => {
                self.line_read = value;
            }
            3 => {
                self.step_period = (value & 0xffff) as u16;
                self.step_read = ((value >> 16) & 0xffff) as u16;
            }
            4 => {
                self.ramp = (value & 0xffff) as u16;
                self.threshold_rest = ((value >> 16) & 0xffff) as u16;
            }
            5 => {
                self.threshold_decay = (value & 0xff) as u8;
                self.noise_floor = ((value >> 8) & 0xff) as u8;
                self.lines = ((value >> 16) & 0xff) as u16 + 1;
            }
            7 => {
                self.record = (value >> 16) & 0x1 == 1;
            }
            _ => {}
        }
    }
}
