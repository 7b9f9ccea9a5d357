// The board's logic: the scan, the converter, events to the link, commands and status lines on the serial line.
//
// `clk` has 100 MHz, `clk_fast` 150 MHz. The ramp and the comparators have two bits a fast clock, one for each half, the first
// in bit 0: on a board these come from the pins' both-edge cells, which are no part of this module.
//
// Throughput: a taxel in 10 clocks in version 1 of the wire, in 3 to 4 in version 2, to 5 where the link has one byte (docs/hardware.md).
// Latency: an event leaves when its datagram is over: at the end of its frame, or as it is full.
// Loses events and markers that find the queue full, and commands for whose answer there is no room: counted, and reported by
// status lines.
module taxel_top #(
    parameter int COLUMNS = 64,               // driven lines of the array
    parameter int ROWS = 64,                  // sense lines
    parameter int CHANNELS = 16,              // of the converter, 16 or 64
    parameter bit PREVIOUS_SAMPLE = 1'b0,     // compare with the last value sampled, else with the last one sent
    parameter bit DIFFERENCE = 1'b0,          // an intensity is how far a value moved, else the value
    parameter bit VALUED = 1'b1,              // a change is followed by its intensity
    parameter int QUEUE = COLUMNS * ROWS,     // events that the queue holds
    parameter int BAUD_CLOCKS = 868,          // of a bit on the serial line: 115 200 baud
    parameter int ANSWERS = 8,                // that wait for the serial line
    parameter int FAULT_CLOCKS = 1_000_000,   // between two lines of faults at least
    parameter int BOARD = 0,                  // number of the board; this and the next three are of version 2 of the wire
    parameter int HOLD_US = 0,                // for how long an event may wait for others
    parameter int HEARTBEAT_US = 10_000,      // between promises that nothing has happened
    parameter int STATES_US = 1_000_000,      // in which all lines' values, and the totals, are repeated; 0: never
    parameter int LINK_BYTES = 1,             // of a beat of the link, 1 or 4
    parameter int DELAY = 2,                  // fast clocks from the ramp's pair to the samples taken during it
    parameter int CSEL_CLOCKS = 8             // for which each level of the shift registers' clock stands: 80 ns
) (
    input  logic                     clk,
    input  logic                     clk_fast,
    input  logic                     reset,
    input  logic                     pattern,   // in reset: whether values are those of the pattern from time 0 on
    // The analogue side.
    output logic [1:0]               ramp,
    input  logic [CHANNELS-1:0][1:0] comparators,
    output logic [2:0]               rsel,
    output logic                     csel_reg_clk_out,
    output logic                     csel_reg_din_out,
    // The serial line.
    input  logic                     rx,
    output logic                     tx,
    // Datagrams' payloads, the first byte of a beat in its low bits; `tkeep` says which bytes there are.
    output logic [8*LINK_BYTES-1:0]  tdata,
    output logic [LINK_BYTES-1:0]    tkeep,
    output logic                     tvalid,
    input  logic                     tready,
    output logic                     tlast,
    // A recording runs; and signals for an oscilloscope.
    output logic                     record_sync,
    output logic                     frame_sync_out,
    output logic                     col_change_sync,
    output logic                     col_read_sync,
    output logic                     row_read_sync
);

  import taxel_registers::*;
  import taxel_types::*;

  localparam int SENSE_LINES = ROWS > 64 ? ROWS : 64;
  localparam int STEPS = (SENSE_LINES + CHANNELS - 1) / CHANNELS;
  localparam registers_t AT_RESET = at_reset(STEPS, COLUMNS, ROWS, CHANNELS);
  // A read's last sample is taken 37 ns after its step at the latest (rule 3), and later by what the pins' cells take: two
  // thirds of a clock for each fast one.
  localparam int HOLD = 4 + (2 * (DELAY - 2) + 2) / 3;

  if (CHANNELS != 16 && CHANNELS != 64) begin : g_channels
    $error("CHANNELS: the converter has 16 or 64");
  end
  if (COLUMNS > 128 || ROWS > 128 || (1 << $clog2(STEPS)) != STEPS) begin : g_lines
    $error("COLUMNS, ROWS: at most 128, and steps that are a power of two");
  end
  if (ANSWERS < 2 || (1 << $clog2(ANSWERS)) != ANSWERS) begin : g_answers
    $error("ANSWERS: a power of two, at least 2");
  end
  if (DELAY < 2 || HOLD > 8) begin : g_delay
    $error("DELAY: 2 to 8");
  end
  if (CSEL_CLOCKS < 1 || CSEL_CLOCKS > 256) begin : g_pulses
    $error("CSEL_CLOCKS: 1 to 256");
  end
  if (STATES_US == 1 || STATES_US > 20_000_000) begin : g_states
    $error("STATES_US: 0, or 2 to 20000000");
  end

  // Commands.
  logic byte_valid, byte_broken, command, answer, room, refused_full, markers_taken, marker_lost;
  logic [7:0] byte_data;
  logic [2:0] number, skipped, markers;
  logic [31:0] value;
  logic [MARKERS-1:0] starts;
  answer_t answered, oldest_answer;
  registers_t written, active;
  logic answer_ready, answer_pop, status_valid, status_taken;
  logic [7:0] status_data;

  taxel_uart_rx #(.CLOCKS(BAUD_CLOCKS)) uart_rx (.clk, .reset, .rx, .valid(byte_valid), .data(byte_data), .broken(byte_broken));

  taxel_command_receiver receiver (
      .clk, .reset, .valid(byte_valid), .data(byte_data), .broken(byte_broken), .command, .number, .value, .skipped
  );

  taxel_register_file #(
      .COLUMNS(COLUMNS),
      .ROWS(ROWS),
      .CHANNELS(CHANNELS),
      .STEPS(STEPS),
      .AT_RESET(AT_RESET)
  ) registers (
      .clk, .reset, .pattern, .command, .number, .value, .answer, .answered, .room, .refused_full,
      .written, .markers, .starts, .markers_taken, .marker_lost
  );

  taxel_answer_queue #(.DEPTH(ANSWERS)) answers (
      .clk, .reset, .answer, .answered, .room, .ready(answer_ready), .oldest(oldest_answer), .pop(answer_pop)
  );

  // The scan.
  logic zero, frame_start, step_start, read_start, step_end, row_reading, col_reading, read_done;
  logic [15:0] stamp;
  micros_t micros;
  logic [30:0] ended_micros;
  logic line_due, totals_due;
  read_t read;

  taxel_mux_ctrl #(
      .COLUMNS(COLUMNS),
      .STEPS(STEPS),
      .HOLD(HOLD),
      .CSEL_CLOCKS(CSEL_CLOCKS),
      .AT_RESET(AT_RESET)
  ) mux_ctrl (
      .clk, .reset, .written, .markers, .starts, .markers_taken, .active, .stamp, .micros, .ended_micros,
      .line_due, .totals_due, .zero, .frame_start, .step_start, .read_start, .step_end, .reading(row_reading), .converting(col_reading), .read,
      .rsel, .csel_clk(csel_reg_clk_out), .csel_din(csel_reg_din_out)
  );

  taxel_time_stamper time_stamper (.clk, .zero, .frame_start, .frame_sync(active.frame_sync), .stamp, .micros,
                                   .ended(ended_micros));

  taxel_refresh #(.EVERY(STATES_US * 100)) refresh (
      .clk, .zero, .frame_start, .lines(active.lines), .line_due, .totals_due
  );

  assign record_sync     = active.record;
  assign frame_sync_out  = frame_start;
  assign col_change_sync = step_start;
  assign col_read_sync   = col_reading;
  assign row_read_sync   = row_reading;

  // The converter.
  logic [CHANNELS-1:0] tripped, first;
  logic [CHANNELS-1:0][14:0] at;

  taxel_comparator_array #(.CHANNELS(CHANNELS), .DELAY(DELAY)) converter (
      .clk, .reset, .read_start, .step_end, .length(read.ramp), .inverted(active.invert_comparator), .read_done,
      .tripped, .first, .at, .clk_fast, .comparators, .ramp
  );

  // Events.
  logic push, full, empty, ready, pop, frame, event_sent, event_lost, frame_over, not_returned;
  event_t found, oldest;
  logic counted_first, states_ready, states_sent, totals_sent;
  logic [15:0] count_first, value_repeated, session;
  logic [6:0] repeated_line, row_repeated;
  count_t lost, faults, commands;
  totals_t totals, repeated_totals;

  taxel_change_detector #(
      .COLUMNS(COLUMNS),
      .ROWS(ROWS),
      .CHANNELS(CHANNELS),
      .STEPS(STEPS),
      .PREVIOUS_SAMPLE(PREVIOUS_SAMPLE),
      .DIFFERENCE(DIFFERENCE),
      .REPEATS(VALUED),
      .HOLDS(HOLD_US != 0)
  ) detector (
      .clk, .reset, .step_end, .read, .read_done, .tripped, .first, .at,
      .push, .found, .full, .frame, .sent(event_sent), .lost(event_lost), .frame_over, .not_returned,
      .counted_first, .count_first, .totals, .repeated_totals, .states_ready, .repeated_line, .row_repeated,
      .value_repeated, .states_sent, .totals_sent
  );

  taxel_session of_session (.clk, .reset, .counted(counted_first), .count(count_first), .session);

  taxel_event_fifo #(.DEPTH(QUEUE), .BITS($bits(event_t))) queue (
      .clk, .reset, .push, .entered(found), .full, .empty, .ready, .oldest, .pop
  );

  // Datagrams: each version waits until the other one's have gone.
  logic pop_v1, pop_v2, busy_v1, sorted, entry_taken, idle_sorter, idle_v2, tvalid_v1, tvalid_v2, tlast_v1, tlast_v2;
  logic write, bank, send, sending, leaving, room_link;
  logic [7:0] tdata_v1;
  logic [15:0] tdata_v2;
  logic [9:0] place;
  logic [15:0] unit;
  event_t entry;
  datagram_t datagram;

  assign pop     = pop_v1 || pop_v2;
  assign leaving = ready && !oldest.format.version_2;

  logic of_v1;  // nothing of version 2 is gathered, waits or leaves: known a clock later, in which no event can follow
  always_ff @(posedge clk) of_v1 <= idle_sorter && idle_v2;

  taxel_link #(.BYTES(LINK_BYTES)) link (
      .clk, .reset, .valid(tvalid_v1 || tvalid_v2), .ready(room_link), .paired(!busy_v1),
      .data(busy_v1 ? 16'(tdata_v1) : tdata_v2), .last(busy_v1 ? tlast_v1 : tlast_v2),
      .tdata, .tkeep, .tvalid, .tready, .tlast
  );

  taxel_packer_v1 #(.VALUED(VALUED)) packer_v1 (
      .clk, .reset, .ready, .oldest, .allowed(leaving && of_v1), .busy(busy_v1), .pop(pop_v1), .empty,
      .frame, .tdata(tdata_v1), .tvalid(tvalid_v1), .tready(room_link), .tlast(tlast_v1)
  );

  taxel_line_sorter #(.ROWS(ROWS)) sorter (
      .clk, .reset, .ready(ready && oldest.format.version_2 && !busy_v1), .oldest, .leaving, .pop(pop_v2),
      .idle(idle_sorter), .valid(sorted), .entry, .taken(entry_taken)
  );

  taxel_packer_v2 #(
      .ROWS(ROWS),
      .VALUED(VALUED),
      .DIFFERENCE(DIFFERENCE),
      .HOLD_US(HOLD_US),
      .HEARTBEAT_US(HEARTBEAT_US)
  ) packer_v2 (
      .clk, .reset, .valid(sorted), .entry, .taken(entry_taken), .leaving(leaving && idle_sorter), .idle(idle_v2),
      .states_ready, .repeated_line, .row_repeated, .value_repeated, .states_sent, .totals(repeated_totals),
      .totals_sent, .write, .bank, .place, .unit, .send, .datagram, .sending
  );

  taxel_datagram_sender #(.ROWS(ROWS), .BOARD(16'(BOARD))) sender (
      .clk, .reset, .session, .write, .bank, .place, .unit, .send, .datagram, .sending,
      .tdata(tdata_v2), .tvalid(tvalid_v2), .tready(room_link), .tlast(tlast_v2)
  );

  // Status lines.
  taxel_totals counts (
      .clk, .reset, .event_sent, .queue_lost(event_lost), .marker_lost, .not_returned, .skipped, .refused(refused_full),
      .datagram(tvalid && tready && tlast), .frame_over, .lost, .faults, .commands, .totals
  );

  taxel_status_sender #(.COLUMNS(COLUMNS), .ROWS(ROWS), .CHANNELS(CHANNELS), .FAULT_CLOCKS(FAULT_CLOCKS)) status (
      .clk, .reset, .version(written.wire_version), .ready(answer_ready), .oldest(oldest_answer), .pop(answer_pop),
      .lost, .faults, .commands, .totals, .valid(status_valid), .data(status_data), .taken(status_taken)
  );

  taxel_uart_tx #(.CLOCKS(BAUD_CLOCKS)) uart_tx (
      .clk, .reset, .valid(status_valid), .data(status_data), .ready(status_taken), .tx
  );

  // One version sends at a time.
  always_ff @(posedge clk) if (!reset) assert (!(tvalid_v1 && tvalid_v2));

endmodule
