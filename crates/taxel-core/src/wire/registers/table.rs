//! Made from registers.toml by tools/registers.py (`make registers`): edit that.

use serde::{Deserialize, Serialize};

use super::field::{Field, Scanned, us};

/// What the registers hold, in the registers' own units (Table 5.5).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Registers {
    /// Lines are driven in random order.
    #[serde(alias = "use_rand_row")]
    pub random_lines: bool,
    /// Each taxel is an FA-1 afferent (5.4.2): an event is its spike, the intensity word its integral; else a change.
    #[serde(alias = "comparator_mode")]
    pub mechanoreceptor: bool,
    /// A falling edge ends a sample.
    pub invert_comparator: bool,
    /// All events of a frame carry the time of its start.
    #[serde(alias = "use_frame_sync")]
    pub frame_sync: bool,
    /// Which version of the wire the board speaks (read: the manual has one).
    #[serde(default = "at_reset::wire_version")]
    pub wire_version: u8,
    /// FA-1: by how much a spike raises the threshold, T A of Table 5.3. In units of 1/256 theta_0.
    #[serde(default = "at_reset::threshold_jump")]
    pub threshold_jump: u16,
    /// Time from one driven line to the next. In units of 10 ns.
    #[serde(alias = "row_change_period")]
    pub line_period: u32,
    /// Part of it in which the line is read. In units of 10 ns.
    #[serde(alias = "row_read_duration")]
    pub line_read: u32,
    /// Time from one multiplexer step to the next. In units of 10 ns.
    #[serde(alias = "col_change_period")]
    pub step_period: u16,
    /// Part of it in which the channels are read. In units of 10 ns.
    #[serde(alias = "col_read_duration")]
    pub step_read: u16,
    /// How long the ramp rises. In units of ticks.
    #[serde(alias = "ramp_time")]
    pub ramp: u16,
    /// FA-1: theta_0, in ticks after the power law. In units of 1/1024.
    #[serde(default = "at_reset::threshold_rest")]
    pub threshold_rest: u16,
    /// FA-1: by how much a quiet frame lowers the threshold, B of Table 5.3. In units of 1/1024 theta_0.
    #[serde(default = "at_reset::threshold_decay")]
    pub threshold_decay: u8,
    /// Smallest difference that makes no event. In units of ticks.
    pub noise_floor: u8,
    /// Driven lines (the register holds one less; the manual's field has 6 bits, read: 8).
    pub lines: u16,
    /// A recording runs: setting and clearing it sends a marker and moves the sync line.
    pub record: bool,
    /// Channels of the converter, 16 or 64: the board's build, not a register.
    pub channels: u8,
}

/// A set of registers by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Preset {
    /// What it is called.
    pub name: &'static str,
    /// For how many sense lines it is made.
    pub sense_lines: u16,
    /// What the registers hold.
    pub registers: Registers,
}

/// What fields that older files lack hold at reset.
mod at_reset {
    pub(super) const fn wire_version() -> u8 {
        1
    }
    pub(super) const fn threshold_jump() -> u16 {
        0
    }
    pub(super) const fn threshold_rest() -> u16 {
        0
    }
    pub(super) const fn threshold_decay() -> u8 {
        0
    }
}

pub(super) const FIELDS: [Field; 16] = [
    Field {
        name: "random_lines",
        manual: "use_rand_row",
        unit: "flag",
        text: "Lines are driven in random order.",
        register: 0,
        shift: 0,
        mask: 0x1,
        offset: 0,
        least: 0,
        greatest: 1,
    },
    Field {
        name: "mechanoreceptor",
        manual: "comparator_mode",
        unit: "flag",
        text: "Each taxel is an FA-1 afferent (5.4.2): an event is its spike, the intensity word its integral; else a change.",
        register: 0,
        shift: 1,
        mask: 0x1,
        offset: 0,
        least: 0,
        greatest: 1,
    },
    Field {
        name: "invert_comparator",
        manual: "invert_comparator",
        unit: "flag",
        text: "A falling edge ends a sample.",
        register: 0,
        shift: 2,
        mask: 0x1,
        offset: 0,
        least: 0,
        greatest: 1,
    },
    Field {
        name: "frame_sync",
        manual: "use_frame_sync",
        unit: "flag",
        text: "All events of a frame carry the time of its start.",
        register: 0,
        shift: 3,
        mask: 0x1,
        offset: 0,
        least: 0,
        greatest: 1,
    },
    Field {
        name: "wire_version",
        manual: "wire_version",
        unit: "version",
        text: "Which version of the wire the board speaks (read: the manual has one).",
        register: 0,
        shift: 4,
        mask: 0x3,
        offset: 1,
        least: 1,
        greatest: 2,
    },
    Field {
        name: "threshold_jump",
        manual: "threshold_jump",
        unit: "1/256 theta_0",
        text: "FA-1: by how much a spike raises the threshold, T A of Table 5.3.",
        register: 0,
        shift: 16,
        mask: 0xffff,
        offset: 0,
        least: 0,
        greatest: 65535,
    },
    Field {
        name: "line_period",
        manual: "row_change_period",
        unit: "10 ns",
        text: "Time from one driven line to the next.",
        register: 1,
        shift: 0,
        mask: 0xffffffff,
        offset: 0,
        least: 1,
        greatest: 4294967295,
    },
    Field {
        name: "line_read",
        manual: "row_read_duration",
        unit: "10 ns",
        text: "Part of it in which the line is read.",
        register: 2,
        shift: 0,
        mask: 0xffffffff,
        offset: 0,
        least: 1,
        greatest: 4294967295,
    },
    Field {
        name: "step_period",
        manual: "col_change_period",
        unit: "10 ns",
        text: "Time from one multiplexer step to the next.",
        register: 3,
        shift: 0,
        mask: 0xffff,
        offset: 0,
        least: 1,
        greatest: 65535,
    },
    Field {
        name: "step_read",
        manual: "col_read_duration",
        unit: "10 ns",
        text: "Part of it in which the channels are read.",
        register: 3,
        shift: 16,
        mask: 0xffff,
        offset: 0,
        least: 1,
        greatest: 65535,
    },
    Field {
        name: "ramp",
        manual: "ramp_time",
        unit: "ticks",
        text: "How long the ramp rises.",
        register: 4,
        shift: 0,
        mask: 0xffff,
        offset: 0,
        least: 1,
        greatest: 65535,
    },
    Field {
        name: "threshold_rest",
        manual: "threshold_rest",
        unit: "1/1024",
        text: "FA-1: theta_0, in ticks after the power law.",
        register: 4,
        shift: 16,
        mask: 0xffff,
        offset: 0,
        least: 0,
        greatest: 65535,
    },
    Field {
        name: "threshold_decay",
        manual: "threshold_decay",
        unit: "1/1024 theta_0",
        text: "FA-1: by how much a quiet frame lowers the threshold, B of Table 5.3.",
        register: 5,
        shift: 0,
        mask: 0xff,
        offset: 0,
        least: 0,
        greatest: 255,
    },
    Field {
        name: "noise_floor",
        manual: "noise_floor",
        unit: "ticks",
        text: "Smallest difference that makes no event.",
        register: 5,
        shift: 8,
        mask: 0xff,
        offset: 0,
        least: 0,
        greatest: 255,
    },
    Field {
        name: "lines",
        manual: "nrows",
        unit: "lines",
        text: "Driven lines (the register holds one less; the manual's field has 6 bits, read: 8).",
        register: 5,
        shift: 16,
        mask: 0xff,
        offset: 1,
        least: 1,
        greatest: 256,
    },
    Field {
        name: "record",
        manual: "record",
        unit: "flag",
        text: "A recording runs: setting and clearing it sends a marker and moves the sync line.",
        register: 7,
        shift: 16,
        mask: 0x1,
        offset: 0,
        least: 0,
        greatest: 1,
    },
];

/// The presets, in the order of the reference; the first for an array's size is what its board holds at reset.
pub const PRESETS: [Preset; 8] = [
    Preset {
        name: "5.2 kHz",
        sense_lines: 64,
        registers: Registers {
            random_lines: false,
            mechanoreceptor: false,
            invert_comparator: false,
            frame_sync: true,
            wire_version: 1,
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
        },
    },
    Preset {
        name: "2 kHz",
        sense_lines: 64,
        registers: Registers {
            random_lines: false,
            mechanoreceptor: false,
            invert_comparator: false,
            frame_sync: true,
            wire_version: 1,
            threshold_jump: 0,
            line_period: 781,
            line_read: 780,
            step_period: 195,
            step_read: 175,
            ramp: 510,
            threshold_rest: 0,
            threshold_decay: 0,
            noise_floor: 10,
            lines: 64,
            record: false,
            channels: 16,
        },
    },
    Preset {
        name: "20.8 kHz",
        sense_lines: 64,
        registers: Registers {
            random_lines: false,
            mechanoreceptor: false,
            invert_comparator: false,
            frame_sync: true,
            wire_version: 1,
            threshold_jump: 0,
            line_period: 75,
            line_read: 75,
            step_period: 75,
            step_read: 55,
            ramp: 150,
            threshold_rest: 0,
            threshold_decay: 0,
            noise_floor: 3,
            lines: 64,
            record: false,
            channels: 64,
        },
    },
    Preset {
        name: "5.2 kHz, FA-1",
        sense_lines: 64,
        registers: Registers {
            random_lines: false,
            mechanoreceptor: true,
            invert_comparator: false,
            frame_sync: true,
            wire_version: 1,
            threshold_jump: 983,
            line_period: 300,
            line_read: 300,
            step_period: 75,
            step_read: 55,
            ramp: 150,
            threshold_rest: 33,
            threshold_decay: 51,
            noise_floor: 3,
            lines: 64,
            record: false,
            channels: 16,
        },
    },
    Preset {
        name: "128 x 128, 1 kHz",
        sense_lines: 128,
        registers: Registers {
            random_lines: false,
            mechanoreceptor: false,
            invert_comparator: false,
            frame_sync: true,
            wire_version: 2,
            threshold_jump: 0,
            line_period: 781,
            line_read: 780,
            step_period: 390,
            step_read: 370,
            ramp: 1095,
            threshold_rest: 0,
            threshold_decay: 0,
            noise_floor: 22,
            lines: 128,
            record: false,
            channels: 64,
        },
    },
    Preset {
        name: "128 x 128, 2 kHz",
        sense_lines: 128,
        registers: Registers {
            random_lines: false,
            mechanoreceptor: false,
            invert_comparator: false,
            frame_sync: true,
            wire_version: 2,
            threshold_jump: 0,
            line_period: 390,
            line_read: 390,
            step_period: 195,
            step_read: 175,
            ramp: 510,
            threshold_rest: 0,
            threshold_decay: 0,
            noise_floor: 10,
            lines: 128,
            record: false,
            channels: 64,
        },
    },
    Preset {
        name: "128 x 128, 5.2 kHz",
        sense_lines: 128,
        registers: Registers {
            random_lines: false,
            mechanoreceptor: false,
            invert_comparator: false,
            frame_sync: true,
            wire_version: 2,
            threshold_jump: 0,
            line_period: 150,
            line_read: 150,
            step_period: 75,
            step_read: 55,
            ramp: 150,
            threshold_rest: 0,
            threshold_decay: 0,
            noise_floor: 3,
            lines: 128,
            record: false,
            channels: 64,
        },
    },
    Preset {
        name: "128 x 128, 1.3 kHz",
        sense_lines: 128,
        registers: Registers {
            random_lines: false,
            mechanoreceptor: false,
            invert_comparator: false,
            frame_sync: true,
            wire_version: 2,
            threshold_jump: 0,
            line_period: 600,
            line_read: 600,
            step_period: 75,
            step_read: 55,
            ramp: 150,
            threshold_rest: 0,
            threshold_decay: 0,
            noise_floor: 3,
            lines: 128,
            record: false,
            channels: 16,
        },
    },
];

impl Registers {
    /// Register `n` as the board holds it; 0 where it has no such register.
    #[must_use]
    pub fn word(&self, n: u8) -> u32 {
        match n {
            0 => {
                u32::from(self.random_lines)
                    | u32::from(self.mechanoreceptor) << 1
                    | u32::from(self.invert_comparator) << 2
                    | u32::from(self.frame_sync) << 3
                    | (u32::from(self.wire_version).wrapping_sub(1) & 0x3) << 4
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

    /// Which bits register `n` has; the others are reserved and must be 0.
    #[must_use]
    pub fn mask(n: u8) -> u32 {
        match n {
            0 => 0xffff003f,
            1 => 0xffffffff,
            2 => 0xffffffff,
            3 => 0xffffffff,
            4 => 0xffffffff,
            5 => 0xffffff,
            7 => 0x10000,
            _ => 0,
        }
    }

    /// Sets a register's fields, whatever the rules say.
    pub(super) fn store(&mut self, register: u8, value: u32) {
        match register {
            0 => {
                self.random_lines = value & 0x1 == 1;
                self.mechanoreceptor = (value >> 1) & 0x1 == 1;
                self.invert_comparator = (value >> 2) & 0x1 == 1;
                self.frame_sync = (value >> 3) & 0x1 == 1;
                self.wire_version = ((value >> 4) & 0x3) as u8 + 1;
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

/// The first rule that refuses these registers, with its numbers.
pub(super) fn refused(registers: &Registers, scanned: &Scanned) -> Option<(u8, String)> {
    let wire_version = i64::from(registers.wire_version);
    let line_period = i64::from(registers.line_period);
    let line_read = i64::from(registers.line_read);
    let step_period = i64::from(registers.step_period);
    let step_read = i64::from(registers.step_read);
    let ramp = i64::from(registers.ramp);
    let lines = i64::from(registers.lines);
    let channels = i64::from(registers.channels);
    let steps = i64::from(scanned.steps);
    let driven_lines = i64::from(scanned.driven_lines);
    let sense_lines = i64::from(scanned.sense_lines);
    if lines > driven_lines {
        return Some((4, format!("{} lines: the array has {} columns to drive (rule 4)", lines, driven_lines)));
    }
    if line_read > line_period {
        return Some((
            1,
            format!("line_read {} us is longer than line_period {} us (rule 1)", us(line_read), us(line_period)),
        ));
    }
    if step_read > step_period {
        return Some((
            1,
            format!("step_read {} us is longer than step_period {} us (rule 1)", us(step_read), us(step_period)),
        ));
    }
    if steps * step_period > line_read {
        return Some((
            2,
            format!(
                "{} x step_period {} us is longer than line_read {} us (rule 2)",
                steps,
                us(step_period),
                us(line_read)
            ),
        ));
    }
    if ramp >= 3 * step_read {
        return Some((
            3,
            format!(
                "ramp {} ticks is not shorter than step_read {} us = {} ticks (rule 3)",
                ramp,
                us(step_read),
                3 * step_read
            ),
        ));
    }
    if channels + 10 > step_period {
        return Some((
            7,
            format!(
                "step_period {} us is too short for {} channels: the logic compares one a clock and wants {} us (rule 7)",
                us(step_period),
                channels,
                us(channels + 10)
            ),
        ));
    }
    if wire_version != 2 && (driven_lines > 64 || sense_lines > 64) {
        return Some((
            8,
            format!(
                "version 1 of the wire names 64 x 64 taxels, the array has {} x {}: choose version 2 (rule 8)",
                sense_lines, driven_lines
            ),
        ));
    }
    None
}

/// What is allowed but hardly meant.
pub(super) fn warned(registers: &Registers) -> Vec<(u8, String)> {
    let mut said = vec![];
    let step_period = i64::from(registers.step_period);
    let step_read = i64::from(registers.step_read);
    let ramp = i64::from(registers.ramp);
    let noise_floor = i64::from(registers.noise_floor);
    if step_period - step_read < 20 {
        said.push((
            5,
            format!(
                "step_period {} us leaves {} us before step_read {} us: taxels settle in {} us (rule 5)",
                us(step_period),
                us(step_period - step_read),
                us(step_read),
                us(20)
            ),
        ));
    }
    if noise_floor >= ramp {
        said.push((
            6,
            format!(
                "noise_floor {} ticks is not below ramp {} ticks: no event can ever come (rule 6)",
                noise_floor, ramp
            ),
        ));
    }
    said
}

/// Bits behind the point of [`POWER_LAW`].
pub const POWER_LAW_FRACTION: u32 = 16;

/// Ticks to the power of 0.7 (5.1), in fixed point, as the logic looks it up.
pub const POWER_LAW: [u32; 2048] = [
    0, 65536, 106464, 141405, 172951, 202190, 229713, 255887, 280959, 305105, 328458, 351119, 373170, 394676, 415690,
    436258, 456419, 476205, 495645, 514763, 533582, 552120, 570395, 588423, 606217, 623789, 641152, 658316, 675290,
    692084, 708704, 725159, 741455, 757600, 773598, 789455, 805178, 820769, 836235, 851579, 866806, 881919, 896921,
    911817, 926610, 941301, 955895, 970395, 984802, 999119, 1013349, 1027493, 1041555, 1055536, 1069438, 1083263,
    1097012, 1110689, 1124293, 1137827, 1151293, 1164691, 1178024, 1191292, 1204498, 1217641, 1230724, 1243748,
    1256713, 1269622, 1282474, 1295271, 1308015, 1320705, 1333344, 1345931, 1358468, 1370956, 1383395, 1395786,
    1408131, 1420429, 1432681, 1444889, 1457053, 1469174, 1481252, 1493287, 1505282, 1517235, 1529149, 1541022,
    1552857, 1564653, 1576411, 1588131, 1599815, 1611462, 1623073, 1634649, 1646190, 1657696, 1669168, 1680606,
    1692011, 1703384, 1714723, 1726031, 1737307, 1748552, 1759766, 1770949, 1782102, 1793225, 1804319, 1815384,
    1826419, 1837427, 1848406, 1859357, 1870281, 1881177, 1892047, 1902889, 1913706, 1924496, 1935260, 1945999,
    1956712, 1967400, 1978064, 1988703, 1999317, 2009908, 2020474, 2031017, 2041537, 2052033, 2062506, 2072957,
    2083385, 2093791, 2104175, 2114536, 2124876, 2135195, 2145492, 2155768, 2166023, 2176258, 2186471, 2196665,
    2206838, 2216991, 2227124, 2237238, 2247332, 2257406, 2267461, 2277498, 2287515, 2297513, 2307493, 2317455,
    2327398, 2337323, 2347230, 2357119, 2366990, 2376844, 2386680, 2396499, 2406300, 2416085, 2425853, 2435603,
    2445337, 2455055, 2464756, 2474441, 2484109, 2493762, 2503398, 2513019, 2522623, 2532212, 2541786, 2551344,
    2560887, 2570415, 2579927, 2589425, 2598907, 2608375, 2617828, 2627267, 2636691, 2646100, 2655495, 2664876,
    2674243, 2683596, 2692935, 2702260, 2711571, 2720869, 2730153, 2739423, 2748681, 2757924, 2767155, 2776372,
    2785576, 2794767, 2803946, 2813111, 2822263, 2831403, 2840531, 2849645, 2858748, 2867837, 2876915, 2885980,
    2895033, 2904074, 2913103, 2922120, 2931125, 2940118, 2949099, 2958069, 2967027, 2975974, 2984909, 2993832,
    3002744, 3011645, 3020535, 3029413, 3038280, 3047136, 3055981, 3064815, 3073639, 3082451, 3091253, 3100044,
    3108824, 3117593, 3126352, 3135101, 3143839, 3152567, 3161284, 3169991, 3178688, 3187375, 3196051, 3204718,
    3213374, 3222020, 3230657, 3239283, 3247900, 3256507, 3265104, 3273692, 3282270, 3290838, 3299397, 3307946,
    3316486, 3325016, 3333537, 3342049, 3350551, 3359045, 3367529, 3376003, 3384469, 3392926, 3401373, 3409812,
    3418242, 3426663, 3435074, 3443478, 3451872, 3460258, 3468634, 3477003, 3485362, 3493713, 3502056, 3510390,
    3518715, 3527032, 3535341, 3543641, 3551933, 3560217, 3568493, 3576760, 3585019, 3593270, 3601513, 3609747,
    3617974, 3626193, 3634403, 3642606, 3650801, 3658988, 3667167, 3675338, 3683502, 3691658, 3699806, 3707946,
    3716079, 3724204, 3732321, 3740431, 3748534, 3756629, 3764716, 3772796, 3780869, 3788934, 3796992, 3805043,
    3813086, 3821122, 3829151, 3837172, 3845187, 3853194, 3861194, 3869187, 3877173, 3885152, 3893124, 3901089,
    3909047, 3916998, 3924942, 3932879, 3940809, 3948733, 3956649, 3964559, 3972462, 3980359, 3988249, 3996132,
    4004008, 4011878, 4019741, 4027597, 4035447, 4043291, 4051128, 4058958, 4066782, 4074600, 4082411, 4090215,
    4098014, 4105806, 4113591, 4121371, 4129144, 4136910, 4144671, 4152425, 4160173, 4167915, 4175651, 4183381,
    4191104, 4198822, 4206533, 4214238, 4221937, 4229631, 4237318, 4244999, 4252674, 4260344, 4268007, 4275665,
    4283317, 4290962, 4298602, 4306237, 4313865, 4321488, 4329105, 4336716, 4344321, 4351921, 4359515, 4367103,
    4374686, 4382263, 4389835, 4397400, 4404961, 4412516, 4420065, 4427608, 4435147, 4442679, 4450207, 4457728,
    4465245, 4472756, 4480261, 4487761, 4495256, 4502745, 4510230, 4517708, 4525182, 4532650, 4540113, 4547571,
    4555023, 4562470, 4569912, 4577349, 4584781, 4592207, 4599628, 4607045, 4614456, 4621862, 4629263, 4636658,
    4644049, 4651435, 4658816, 4666191, 4673562, 4680928, 4688289, 4695644, 4702995, 4710341, 4717682, 4725018,
    4732350, 4739676, 4746998, 4754315, 4761626, 4768934, 4776236, 4783533, 4790826, 4798114, 4805397, 4812676,
    4819950, 4827219, 4834483, 4841743, 4848998, 4856249, 4863495, 4870736, 4877972, 4885204, 4892432, 4899655,
    4906873, 4914086, 4921296, 4928500, 4935700, 4942896, 4950087, 4957274, 4964456, 4971634, 4978807, 4985976,
    4993141, 5000301, 5007457, 5014608, 5021755, 5028897, 5036036, 5043170, 5050299, 5057424, 5064545, 5071662,
    5078775, 5085883, 5092987, 5100086, 5107182, 5114273, 5121360, 5128443, 5135521, 5142596, 5149666, 5156732,
    5163794, 5170852, 5177905, 5184955, 5192000, 5199042, 5206079, 5213112, 5220141, 5227167, 5234188, 5241205,
    5248218, 5255227, 5262232, 5269232, 5276229, 5283222, 5290212, 5297197, 5304178, 5311155, 5318128, 5325098,
    5332063, 5339025, 5345982, 5352936, 5359886, 5366832, 5373774, 5380713, 5387647, 5394578, 5401505, 5408428,
    5415347, 5422263, 5429175, 5436083, 5442987, 5449887, 5456784, 5463677, 5470566, 5477452, 5484334, 5491212,
    5498086, 5504957, 5511824, 5518688, 5525547, 5532403, 5539256, 5546105, 5552950, 5559792, 5566630, 5573464,
    5580295, 5587122, 5593946, 5600766, 5607582, 5614395, 5621205, 5628011, 5634813, 5641612, 5648407, 5655199,
    5661988, 5668773, 5675554, 5682332, 5689106, 5695877, 5702645, 5709409, 5716170, 5722927, 5729681, 5736431,
    5743178, 5749922, 5756662, 5763399, 5770133, 5776863, 5783590, 5790313, 5797033, 5803750, 5810463, 5817173,
    5823880, 5830584, 5837284, 5843981, 5850674, 5857365, 5864052, 5870735, 5877416, 5884093, 5890767, 5897438,
    5904106, 5910770, 5917431, 5924089, 5930744, 5937395, 5944043, 5950688, 5957330, 5963969, 5970605, 5977237,
    5983866, 5990492, 5997115, 6003735, 6010352, 6016966, 6023576, 6030184, 6036788, 6043389, 6049987, 6056582,
    6063174, 6069763, 6076349, 6082932, 6089511, 6096088, 6102661, 6109232, 6115800, 6122364, 6128926, 6135484,
    6142040, 6148592, 6155142, 6161688, 6168232, 6174772, 6181310, 6187845, 6194376, 6200905, 6207431, 6213954,
    6220474, 6226991, 6233505, 6240016, 6246524, 6253029, 6259532, 6266031, 6272528, 6279022, 6285513, 6292001,
    6298486, 6304968, 6311448, 6317924, 6324398, 6330869, 6337337, 6343802, 6350265, 6356724, 6363181, 6369635,
    6376086, 6382535, 6388980, 6395423, 6401863, 6408301, 6414735, 6421167, 6427596, 6434022, 6440445, 6446866,
    6453284, 6459699, 6466112, 6472522, 6478929, 6485333, 6491735, 6498134, 6504530, 6510924, 6517315, 6523703,
    6530088, 6536471, 6542851, 6549229, 6555603, 6561976, 6568345, 6574712, 6581076, 6587438, 6593797, 6600153,
    6606507, 6612858, 6619207, 6625552, 6631896, 6638236, 6644574, 6650910, 6657243, 6663573, 6669901, 6676226,
    6682549, 6688869, 6695186, 6701501, 6707814, 6714123, 6720431, 6726736, 6733038, 6739337, 6745635, 6751929,
    6758221, 6764511, 6770798, 6777083, 6783365, 6789645, 6795922, 6802197, 6808469, 6814738, 6821006, 6827270,
    6833533, 6839793, 6846050, 6852305, 6858558, 6864808, 6871055, 6877300, 6883543, 6889784, 6896021, 6902257,
    6908490, 6914721, 6920949, 6927175, 6933398, 6939619, 6945838, 6952054, 6958268, 6964480, 6970689, 6976896,
    6983100, 6989302, 6995502, 7001700, 7007895, 7014087, 7020278, 7026466, 7032651, 7038835, 7045016, 7051194,
    7057371, 7063545, 7069716, 7075886, 7082053, 7088218, 7094380, 7100540, 7106698, 7112854, 7119007, 7125158,
    7131307, 7137454, 7143598, 7149740, 7155880, 7162017, 7168153, 7174286, 7180416, 7186545, 7192671, 7198795,
    7204917, 7211037, 7217154, 7223269, 7229382, 7235493, 7241601, 7247707, 7253811, 7259913, 7266013, 7272110,
    7278206, 7284299, 7290390, 7296478, 7302565, 7308649, 7314732, 7320812, 7326890, 7332965, 7339039, 7345110,
    7351179, 7357247, 7363312, 7369374, 7375435, 7381494, 7387550, 7393604, 7399657, 7405707, 7411755, 7417800,
    7423844, 7429886, 7435925, 7441963, 7447998, 7454031, 7460062, 7466091, 7472118, 7478143, 7484166, 7490187,
    7496205, 7502222, 7508236, 7514249, 7520259, 7526267, 7532274, 7538278, 7544280, 7550280, 7556278, 7562274,
    7568268, 7574260, 7580250, 7586238, 7592224, 7598208, 7604190, 7610169, 7616147, 7622123, 7628097, 7634069,
    7640038, 7646006, 7651972, 7657936, 7663897, 7669857, 7675815, 7681771, 7687725, 7693677, 7699627, 7705575,
    7711521, 7717465, 7723407, 7729347, 7735285, 7741221, 7747155, 7753088, 7759018, 7764946, 7770873, 7776797,
    7782720, 7788641, 7794559, 7800476, 7806391, 7812304, 7818215, 7824124, 7830032, 7835937, 7841840, 7847742,
    7853641, 7859539, 7865435, 7871329, 7877221, 7883111, 7888999, 7894886, 7900770, 7906653, 7912534, 7918412,
    7924289, 7930165, 7936038, 7941909, 7947779, 7953646, 7959512, 7965376, 7971238, 7977099, 7982957, 7988814,
    7994668, 8000521, 8006372, 8012222, 8018069, 8023915, 8029758, 8035600, 8041441, 8047279, 8053115, 8058950,
    8064783, 8070614, 8076443, 8082271, 8088096, 8093920, 8099742, 8105563, 8111381, 8117198, 8123013, 8128826,
    8134637, 8140447, 8146254, 8152060, 8157865, 8163667, 8169468, 8175267, 8181064, 8186859, 8192653, 8198445,
    8204235, 8210024, 8215810, 8221595, 8227378, 8233160, 8238939, 8244717, 8250494, 8256268, 8262041, 8267812,
    8273581, 8279349, 8285115, 8290879, 8296641, 8302402, 8308161, 8313918, 8319674, 8325427, 8331180, 8336930,
    8342679, 8348426, 8354171, 8359915, 8365657, 8371397, 8377136, 8382873, 8388608, 8394342, 8400073, 8405804,
    8411532, 8417259, 8422984, 8428708, 8434430, 8440150, 8445868, 8451585, 8457300, 8463014, 8468726, 8474436,
    8480145, 8485852, 8491557, 8497261, 8502963, 8508663, 8514362, 8520059, 8525755, 8531448, 8537141, 8542831,
    8548520, 8554208, 8559893, 8565578, 8571260, 8576941, 8582620, 8588298, 8593974, 8599648, 8605321, 8610993,
    8616662, 8622330, 8627997, 8633662, 8639325, 8644987, 8650647, 8656305, 8661962, 8667617, 8673271, 8678923,
    8684574, 8690223, 8695870, 8701516, 8707161, 8712803, 8718445, 8724084, 8729722, 8735359, 8740994, 8746627,
    8752259, 8757889, 8763518, 8769145, 8774771, 8780395, 8786017, 8791638, 8797258, 8802876, 8808492, 8814107,
    8819720, 8825332, 8830942, 8836551, 8842158, 8847764, 8853368, 8858971, 8864572, 8870171, 8875770, 8881366,
    8886961, 8892555, 8898147, 8903737, 8909326, 8914914, 8920500, 8926084, 8931667, 8937249, 8942829, 8948408,
    8953985, 8959560, 8965134, 8970707, 8976278, 8981848, 8987416, 8992983, 8998548, 9004112, 9009674, 9015235,
    9020794, 9026352, 9031908, 9037463, 9043017, 9048569, 9054119, 9059668, 9065216, 9070762, 9076307, 9081850,
    9087392, 9092932, 9098471, 9104009, 9109545, 9115079, 9120612, 9126144, 9131674, 9137203, 9142731, 9148257,
    9153781, 9159304, 9164826, 9170346, 9175865, 9181382, 9186898, 9192413, 9197926, 9203438, 9208948, 9214457,
    9219965, 9225471, 9230976, 9236479, 9241981, 9247481, 9252980, 9258478, 9263974, 9269469, 9274963, 9280455,
    9285945, 9291435, 9296923, 9302409, 9307894, 9313378, 9318860, 9324341, 9329821, 9335299, 9340776, 9346252,
    9351726, 9357198, 9362670, 9368140, 9373608, 9379076, 9384541, 9390006, 9395469, 9400931, 9406391, 9411850,
    9417308, 9422765, 9428220, 9433673, 9439126, 9444577, 9450026, 9455474, 9460921, 9466367, 9471811, 9477254,
    9482696, 9488136, 9493575, 9499012, 9504449, 9509883, 9515317, 9520749, 9526180, 9531610, 9537038, 9542465,
    9547890, 9553315, 9558738, 9564159, 9569580, 9574999, 9580416, 9585833, 9591248, 9596662, 9602074, 9607485,
    9612895, 9618303, 9623711, 9629117, 9634521, 9639925, 9645327, 9650727, 9656127, 9661525, 9666922, 9672317,
    9677712, 9683105, 9688496, 9693887, 9699276, 9704664, 9710050, 9715436, 9720820, 9726202, 9731584, 9736964,
    9742343, 9747720, 9753097, 9758472, 9763846, 9769218, 9774590, 9779960, 9785328, 9790696, 9796062, 9801427,
    9806791, 9812153, 9817514, 9822874, 9828233, 9833591, 9838947, 9844302, 9849655, 9855008, 9860359, 9865709,
    9871058, 9876405, 9881751, 9887096, 9892440, 9897783, 9903124, 9908464, 9913803, 9919140, 9924477, 9929812,
    9935146, 9940478, 9945810, 9951140, 9956469, 9961797, 9967123, 9972449, 9977773, 9983096, 9988417, 9993738,
    9999057, 10004375, 10009692, 10015008, 10020322, 10025635, 10030947, 10036258, 10041568, 10046876, 10052183,
    10057489, 10062794, 10068098, 10073400, 10078701, 10084001, 10089300, 10094598, 10099894, 10105189, 10110483,
    10115776, 10121068, 10126358, 10131648, 10136936, 10142223, 10147508, 10152793, 10158076, 10163359, 10168640,
    10173919, 10179198, 10184476, 10189752, 10195027, 10200301, 10205574, 10210846, 10216116, 10221386, 10226654,
    10231921, 10237187, 10242451, 10247715, 10252977, 10258238, 10263498, 10268757, 10274015, 10279272, 10284527,
    10289781, 10295035, 10300287, 10305537, 10310787, 10316036, 10321283, 10326529, 10331774, 10337018, 10342261,
    10347503, 10352744, 10357983, 10363221, 10368458, 10373694, 10378929, 10384163, 10389396, 10394627, 10399858,
    10405087, 10410315, 10415542, 10420768, 10425993, 10431216, 10436439, 10441660, 10446880, 10452100, 10457318,
    10462535, 10467750, 10472965, 10478179, 10483391, 10488602, 10493813, 10499022, 10504230, 10509437, 10514643,
    10519847, 10525051, 10530253, 10535455, 10540655, 10545854, 10551053, 10556250, 10561445, 10566640, 10571834,
    10577027, 10582218, 10587409, 10592598, 10597786, 10602973, 10608160, 10613345, 10618528, 10623711, 10628893,
    10634074, 10639253, 10644432, 10649609, 10654786, 10659961, 10665135, 10670308, 10675480, 10680651, 10685821,
    10690990, 10696158, 10701324, 10706490, 10711655, 10716818, 10721981, 10727142, 10732302, 10737461, 10742620,
    10747777, 10752933, 10758088, 10763242, 10768395, 10773546, 10778697, 10783847, 10788995, 10794143, 10799290,
    10804435, 10809580, 10814723, 10819865, 10825007, 10830147, 10835286, 10840424, 10845561, 10850697, 10855832,
    10860966, 10866099, 10871231, 10876362, 10881492, 10886621, 10891749, 10896875, 10902001, 10907126, 10912249,
    10917372, 10922494, 10927614, 10932734, 10937852, 10942970, 10948086, 10953201, 10958316, 10963429, 10968542,
    10973653, 10978763, 10983872, 10988981, 10994088, 10999194, 11004299, 11009404, 11014507, 11019609, 11024710,
    11029810, 11034909, 11040008, 11045105, 11050201, 11055296, 11060390, 11065483, 11070575, 11075666, 11080756,
    11085845, 11090934, 11096021, 11101107, 11106192, 11111276, 11116359, 11121441, 11126522, 11131602, 11136681,
    11141760, 11146837, 11151913, 11156988, 11162062, 11167135, 11172207, 11177279, 11182349, 11187418, 11192486,
    11197554, 11202620, 11207685, 11212749, 11217813, 11222875, 11227937, 11232997, 11238056, 11243115, 11248172,
    11253229, 11258284, 11263339, 11268392, 11273445, 11278497, 11283547, 11288597, 11293646, 11298694, 11303740,
    11308786, 11313831, 11318875, 11323918, 11328960, 11334001, 11339041, 11344080, 11349118, 11354155, 11359192,
    11364227, 11369261, 11374294, 11379327, 11384358, 11389389, 11394418, 11399447, 11404475, 11409501, 11414527,
    11419552, 11424576, 11429598, 11434620, 11439641, 11444661, 11449681, 11454699, 11459716, 11464732, 11469748,
    11474762, 11479776, 11484788, 11489800, 11494810, 11499820, 11504829, 11509837, 11514844, 11519850, 11524855,
    11529859, 11534862, 11539864, 11544866, 11549866, 11554865, 11559864, 11564862, 11569858, 11574854, 11579849,
    11584843, 11589836, 11594828, 11599819, 11604809, 11609799, 11614787, 11619775, 11624761, 11629747, 11634732,
    11639715, 11644698, 11649680, 11654661, 11659642, 11664621, 11669599, 11674577, 11679553, 11684529, 11689503,
    11694477, 11699450, 11704422, 11709393, 11714363, 11719333, 11724301, 11729269, 11734235, 11739201, 11744166,
    11749129, 11754092, 11759054, 11764016, 11768976, 11773935, 11778894, 11783851, 11788808, 11793764, 11798719,
    11803673, 11808626, 11813578, 11818530, 11823480, 11828430, 11833378, 11838326, 11843273, 11848219, 11853164,
    11858108, 11863052, 11867994, 11872936, 11877877, 11882817, 11887756, 11892694, 11897631, 11902567, 11907503,
    11912437, 11917371, 11922304, 11927236, 11932167, 11937097, 11942026, 11946955, 11951882, 11956809, 11961735,
    11966660, 11971584, 11976507, 11981430, 11986351, 11991272, 11996192, 12001111, 12006029, 12010946, 12015862,
    12020778, 12025692, 12030606, 12035519, 12040431, 12045342, 12050252, 12055162, 12060070, 12064978, 12069885,
    12074791, 12079696, 12084601, 12089504, 12094407, 12099308, 12104209, 12109109, 12114009, 12118907, 12123804,
    12128701, 12133597, 12138492, 12143386, 12148279, 12153172, 12158063, 12162954, 12167844, 12172733, 12177621,
    12182509, 12187395, 12192281, 12197166, 12202050, 12206933, 12211815, 12216697, 12221578, 12226458, 12231337,
    12236215, 12241092, 12245969, 12250844, 12255719, 12260593, 12265466, 12270339, 12275210, 12280081, 12284951,
    12289820, 12294688, 12299555, 12304422, 12309288, 12314153, 12319017, 12323880, 12328742, 12333604, 12338465,
    12343325, 12348184, 12353042, 12357900, 12362757, 12367613, 12372468, 12377322, 12382175, 12387028, 12391880,
    12396731, 12401581, 12406430, 12411279, 12416127, 12420974, 12425820, 12430665, 12435510, 12440353, 12445196,
    12450038, 12454879, 12459720, 12464560, 12469398, 12474237, 12479074, 12483910, 12488746, 12493581, 12498415,
    12503248, 12508080, 12512912, 12517743, 12522573, 12527402, 12532231, 12537058, 12541885, 12546711, 12551536,
    12556361, 12561185, 12566007, 12570830, 12575651, 12580471, 12585291, 12590110, 12594928, 12599745, 12604562,
    12609378, 12614193, 12619007, 12623820, 12628633, 12633445, 12638256, 12643066, 12647876, 12652684, 12657492,
    12662299, 12667106, 12671911, 12676716, 12681520, 12686323, 12691126, 12695927, 12700728, 12705528, 12710328,
    12715126, 12719924, 12724721, 12729517, 12734313, 12739107, 12743901, 12748694, 12753487, 12758278, 12763069,
    12767859, 12772648, 12777437, 12782225, 12787011, 12791798, 12796583, 12801368, 12806152, 12810935, 12815717,
    12820499, 12825280, 12830060, 12834839, 12839618, 12844395, 12849172, 12853949, 12858724, 12863499, 12868273,
    12873046, 12877819, 12882590, 12887361, 12892131, 12896901, 12901670, 12906437, 12911205, 12915971, 12920737,
    12925502, 12930266, 12935029, 12939792, 12944554, 12949315, 12954075, 12958835, 12963594, 12968352, 12973109,
    12977866, 12982622, 12987377, 12992132, 12996885, 13001638, 13006390, 13011142, 13015892, 13020642, 13025392,
    13030140, 13034888, 13039635, 13044381, 13049127, 13053871, 13058615, 13063359, 13068101, 13072843, 13077584,
    13082324, 13087064, 13091803, 13096541, 13101278, 13106015, 13110751, 13115486, 13120221, 13124954, 13129687,
    13134420, 13139151, 13143882, 13148612, 13153342, 13158070, 13162798, 13167525, 13172252, 13176977, 13181702,
    13186427, 13191150, 13195873, 13200595, 13205316, 13210037, 13214757, 13219476, 13224195, 13228912, 13233629,
    13238346, 13243061, 13247776, 13252490, 13257204, 13261916, 13266628, 13271340, 13276050, 13280760, 13285469,
    13290178, 13294885, 13299592, 13304299, 13309004, 13313709, 13318413, 13323117, 13327819, 13332521, 13337223,
    13341923, 13346623, 13351322, 13356021, 13360718, 13365415, 13370112, 13374807, 13379502, 13384197, 13388890,
    13393583, 13398275, 13402966, 13407657, 13412347, 13417036, 13421725, 13426413, 13431100, 13435786, 13440472,
    13445157, 13449842, 13454525, 13459208, 13463891, 13468572, 13473253, 13477933, 13482613, 13487291, 13491970,
    13496647, 13501324, 13506000, 13510675, 13515350, 13520024, 13524697, 13529369, 13534041, 13538712, 13543383,
    13548053, 13552722, 13557390, 13562058, 13566725, 13571391, 13576057, 13580722, 13585386, 13590050, 13594713,
    13599375, 13604036, 13608697, 13613357, 13618017, 13622676,
];
