// The board's logic: the scan, the converter, events to the link, commands and status lines on the serial line.
//
// `clk` has 100 MHz, `clk_fast` 150 MHz. The ramp and the comparators have two bits a fast clock, one for each half, the first
// in bit 0: on a board these come from the pins' both-edge cells, which are no part of this module.
module taxel_top
  import taxel_registers::*;
  import taxel_types::*;
#(
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
    parameter int DELAY = 2                   // fast clocks from the ramp's pair to the samples taken during it
) (
    input  logic                     clk,
    input  logic                     clk_fast,
    input  logic                     reset,
    // The analogue side.
    output logic [1:0]               ramp,
    input  logic [CHANNELS-1:0][1:0] comparators,
    output logic [2:0]               rsel,
    output logic                     csel_reg_clk_out,
    output logic                     csel_reg_din_out,
    // The serial line.
    input  logic                     rx,
    output logic                     tx,
    // Datagrams' payloads.
    output logic [7:0]               tdata,
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

  localparam int SENSE_LINES = ROWS > 64 ? ROWS : 64;
  localparam int STEPS = (SENSE_LINES + CHANNELS - 1) / CHANNELS;
  localparam registers_t AT_RESET = at_reset(STEPS, COLUMNS, ROWS, CHANNELS);

  if (CHANNELS != 16 && CHANNELS != 64) begin : g_channels
    $error("CHANNELS: the converter has 16 or 64");
  end
  if (COLUMNS > 64 || ROWS > 64) begin : g_lines
    $error("COLUMNS, ROWS: version 1 of the wire names 64 x 64 taxels");
  end

  // Commands.
  logic byte_valid, command, answer, room, refused_full, markers_taken, marker_lost;
  logic [7:0] byte_data;
  logic [2:0] number, skipped, markers;
  logic [31:0] value;
  logic [MARKERS-1:0] starts;
  answer_t answered, oldest_answer;
  registers_t written, active;
  logic answer_ready, answer_pop, status_valid, status_taken;
  logic [7:0] status_data;

  taxel_uart_rx #(.CLOCKS(BAUD_CLOCKS)) uart_rx (.clk, .reset, .rx, .valid(byte_valid), .data(byte_data));

  taxel_command_receiver receiver (
      .clk, .reset, .valid(byte_valid), .data(byte_data), .command, .number, .value, .skipped
  );

  taxel_register_file #(
      .COLUMNS(COLUMNS),
      .ROWS(ROWS),
      .CHANNELS(CHANNELS),
      .STEPS(STEPS),
      .AT_RESET(AT_RESET)
  ) registers (
      .clk, .reset, .command, .number, .value, .answer, .answered, .room, .refused_full,
      .written, .markers, .starts, .markers_taken, .marker_lost
  );

  taxel_answer_queue #(.DEPTH(ANSWERS)) answers (
      .clk, .reset, .answer, .answered, .room, .ready(answer_ready), .oldest(oldest_answer), .pop(answer_pop)
  );

  // The scan.
  logic zero, frame_start, step_start, read_start, step_end, row_reading, col_reading, read_done;
  logic [15:0] stamp;
  read_t read;

  taxel_mux_ctrl #(.COLUMNS(COLUMNS), .STEPS(STEPS), .AT_RESET(AT_RESET)) mux_ctrl (
      .clk, .reset, .written, .markers, .starts, .markers_taken, .active, .stamp,
      .zero, .frame_start, .step_start, .read_start, .step_end, .reading(row_reading), .converting(col_reading), .read,
      .rsel, .csel_clk(csel_reg_clk_out), .csel_din(csel_reg_din_out)
  );

  taxel_time_stamper time_stamper (.clk, .zero, .frame_start, .frame_sync(active.frame_sync), .stamp);

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

  taxel_change_detector #(
      .COLUMNS(COLUMNS),
      .ROWS(ROWS),
      .CHANNELS(CHANNELS),
      .STEPS(STEPS),
      .PREVIOUS_SAMPLE(PREVIOUS_SAMPLE),
      .DIFFERENCE(DIFFERENCE)
  ) detector (
      .clk, .reset, .step_end, .read, .read_done, .tripped, .first, .at,
      .push, .found, .full, .frame, .sent(event_sent), .lost(event_lost), .frame_over, .not_returned
  );

  taxel_event_fifo #(.DEPTH(QUEUE), .BITS($bits(event_t))) queue (
      .clk, .reset, .push, .entered(found), .full, .empty, .ready, .oldest, .pop
  );

  taxel_packer_v1 #(.VALUED(VALUED)) packer (
      .clk, .reset, .ready, .oldest, .pop, .empty, .frame, .tdata, .tvalid, .tready, .tlast
  );

  // Status lines.
  count_t lost, faults, commands;
  totals_t totals;

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

endmodule
