//! Made from registers.toml by tools/registers.py (`make registers`): edit that.

super::field::registers! {
    // The field: its type, the manual's name, unit; register, lowest bit, mask, offset, least and greatest value, that at
    // reset.
    /// Lines are driven in random order.
    #[serde(alias = "use_rand_row")] random_lines: bool, "use_rand_row", "flag", 0, 0, 0x1, 0, 0, 1, false;
    /// If set, each taxel is an FA-1 afferent (5.4.2): events are its spikes, intensities its integral. Otherwise events are changes.
    #[serde(alias = "comparator_mode")] mechanoreceptor: bool, "comparator_mode", "flag", 0, 1, 0x1, 0, 0, 1, false;
    /// A falling edge ends a sample.
    invert_comparator: bool, "invert_comparator", "flag", 0, 2, 0x1, 0, 0, 1, false;
    /// All events of a frame have the time at which the frame starts.
    #[serde(alias = "use_frame_sync")] frame_sync: bool, "use_frame_sync", "flag", 0, 3, 0x1, 0, 0, 1, true;
    /// Version of the wire protocol that the board uses (our reading: the manual has only one version).
    wire_version: u8, "wire_version", "version", 0, 4, 0x3, 1, 1, 2, 1;
    /// The board sends the values of a simulated rolling ball instead of the comparators' values (our reading: the manual has no such bit).
    #[serde(default)] pattern: bool, "pattern", "flag", 0, 6, 0x1, 0, 0, 1, false;
    /// FA-1: how much a spike raises the threshold (T A of Table 5.3).
    threshold_jump: u16, "threshold_jump", "1/256 theta_0", 0, 16, 0xffff, 0, 0, 65535, 0;
    /// Time from one driven line to the next.
    #[serde(alias = "row_change_period")] line_period: u32, "row_change_period", "10 ns", 1, 0, 0xffffffff, 0, 1, 4294967295, 300;
    /// Part of line_period in which the line is read.
    #[serde(alias = "row_read_duration")] line_read: u32, "row_read_duration", "10 ns", 2, 0, 0xffffffff, 0, 1, 4294967295, 300;
    /// Time from one multiplexer step to the next.
    #[serde(alias = "col_change_period")] step_period: u16, "col_change_period", "10 ns", 3, 0, 0xffff, 0, 1, 65535, 75;
    /// Part of step_period in which the channels are read.
    #[serde(alias = "col_read_duration")] step_read: u16, "col_read_duration", "10 ns", 3, 16, 0xffff, 0, 4, 65535, 55;
    /// Duration of the ramp.
    #[serde(alias = "ramp_time")] ramp: u16, "ramp_time", "ticks", 4, 0, 0xffff, 0, 1, 65534, 150;
    /// FA-1: theta_0, in ticks after the power law.
    threshold_rest: u16, "threshold_rest", "1/1024", 4, 16, 0xffff, 0, 0, 65535, 0;
    /// FA-1: how much a frame without a spike lowers the threshold (B of Table 5.3).
    threshold_decay: u8, "threshold_decay", "1/1024 theta_0", 5, 0, 0xff, 0, 0, 255, 0;
    /// Largest difference that does not cause an event.
    noise_floor: u8, "noise_floor", "ticks", 5, 8, 0xff, 0, 0, 255, 3;
    /// Number of driven lines (the register contains one less; the manual's field has 6 bits, our reading: 8).
    lines: u16, "nrows", "lines", 5, 16, 0xff, 1, 1, 256, 64;
    /// A recording is running: setting and clearing this bit sends a marker and switches the sync line.
    record: bool, "record", "flag", 7, 16, 0x1, 0, 0, 1, false;
    ; // Of the board's build:
    /// Channels of the converter, 16 or 64: a property of the board, not a register.
    channels: u8, 16;
}
