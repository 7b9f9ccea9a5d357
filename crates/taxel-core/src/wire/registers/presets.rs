//! Made from registers.toml by tools/registers.py (`make registers`): edit that.

use super::table::Registers;

/// A named set of register values.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Preset {
    /// Name of the preset.
    pub name: &'static str,
    /// Number of sense lines of the boards for which it is made.
    pub sense_lines: u16,
    /// The values of the registers.
    pub registers: Registers,
}

const DEFAULTS: Registers = Registers {
    random_lines: false,
    mechanoreceptor: false,
    invert_comparator: false,
    frame_sync: true,
    wire_version: 1,
    pattern: false,
    threshold_jump: 0,
    line_period: 300,
    line_read: 300,
    step_period: 75,
    step_read: 55,
    ramp: 150,
    threshold_rest: 0,
    threshold_decay: 0,
    noise_floor: 3,
    lines: 64,
    record: false,
    channels: 16,
};

/// The presets, in the order of the reference; a board's registers at reset are the first preset for its array's size.
pub const PRESETS: [Preset; 9] = [
    Preset { name: "5.2 kHz", sense_lines: 64, registers: DEFAULTS },
    Preset {
        name: "2 kHz",
        sense_lines: 64,
        registers: Registers {
            line_period: 781,
            line_read: 780,
            step_period: 195,
            step_read: 175,
            ramp: 510,
            noise_floor: 10,
            ..DEFAULTS
        },
    },
    Preset {
        name: "20.8 kHz",
        sense_lines: 64,
        registers: Registers { line_period: 75, line_read: 75, channels: 64, ..DEFAULTS },
    },
    Preset {
        name: "5.2 kHz, 64 channels",
        sense_lines: 64,
        registers: Registers { step_period: 300, step_read: 280, ramp: 825, noise_floor: 16, channels: 64, ..DEFAULTS },
    },
    Preset {
        name: "5.2 kHz, FA-1",
        sense_lines: 64,
        registers: Registers {
            mechanoreceptor: true,
            threshold_rest: 33,
            threshold_jump: 983,
            threshold_decay: 51,
            ..DEFAULTS
        },
    },
    Preset {
        name: "128 x 128, 1 kHz",
        sense_lines: 128,
        registers: Registers {
            line_period: 781,
            line_read: 780,
            step_period: 390,
            step_read: 370,
            ramp: 1095,
            noise_floor: 22,
            lines: 128,
            channels: 64,
            wire_version: 2,
            ..DEFAULTS
        },
    },
    Preset {
        name: "128 x 128, 2 kHz",
        sense_lines: 128,
        registers: Registers {
            line_period: 390,
            line_read: 390,
            step_period: 195,
            step_read: 175,
            ramp: 510,
            noise_floor: 10,
            lines: 128,
            channels: 64,
            wire_version: 2,
            ..DEFAULTS
        },
    },
    Preset {
        name: "128 x 128, 5.2 kHz",
        sense_lines: 128,
        registers: Registers {
            line_period: 150,
            line_read: 150,
            lines: 128,
            channels: 64,
            wire_version: 2,
            ..DEFAULTS
        },
    },
    Preset {
        name: "128 x 128, 1.3 kHz",
        sense_lines: 128,
        registers: Registers { line_period: 600, line_read: 600, lines: 128, wire_version: 2, ..DEFAULTS },
    },
];
