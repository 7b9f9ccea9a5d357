//! Made from registers.toml by tools/registers.py (`make registers`): edit that.

use super::table::{AT_RESET, Registers};

super::field::presets! {
    // The preset's name, the sense lines of the boards for which it is made, and what differs from the values at reset.
    "5.2 kHz", 64: ;
    "2 kHz", 64: line_period 781, line_read 780, step_period 195, step_read 175, ramp 510, noise_floor 10;
    "20.8 kHz", 64: line_period 75, line_read 75, channels 64;
    "5.2 kHz, 64 channels", 64: step_period 300, step_read 280, ramp 825, noise_floor 16, channels 64;
    "5.2 kHz, FA-1", 64: mechanoreceptor true, threshold_rest 33, threshold_jump 983, threshold_decay 51;
    "128 x 128, 1 kHz", 128: line_period 781, line_read 780, step_period 390, step_read 370, ramp 1095, noise_floor 22, lines 128, channels 64, wire_version 2;
    "128 x 128, 2 kHz", 128: line_period 390, line_read 390, step_period 195, step_read 175, ramp 510, noise_floor 10, lines 128, channels 64, wire_version 2;
    "128 x 128, 5.2 kHz", 128: line_period 150, line_read 150, lines 128, channels 64, wire_version 2;
    "128 x 128, 1.3 kHz", 128: line_period 600, line_read 600, lines 128, wire_version 2;
}
