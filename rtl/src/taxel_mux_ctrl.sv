// The scan: which line is driven, which step of it is read, and when the ramp rises.
//
// Frame after frame without a pause: each line has STEPS steps, and of each step the last `step_read` is read, after the taxels
// have settled. `EARLY` clocks before a frame's edge the registers as written are taken for the next frame. All pulses are of
// one clock; those of a frame's, a line's and a step's start come together.
//
// The ramp of a read rises and falls later than the read begins and ends, by what the crossing to the fast clock and the pins'
// cells take. The multiplexer and the lines follow `HOLD` clocks after a step's start, when the samples of the read before are
// over: so they settle for `step_period - step_read` before the ramp rises.
//
// After reset the scan waits until the chain of shift registers is empty.
//
// Throughput: a step every `step_period` clocks.
// Latency: what is written `EARLY` clocks before a frame's edge acts in that frame.
// Loses nothing: the scan waits for nobody.
module taxel_mux_ctrl #(
    parameter int COLUMNS = 64,
    parameter int STEPS = 4,
    parameter int HOLD = 4,         // clocks from a step's start until the multiplexer and the lines follow, 2 to 8
    parameter int CSEL_CLOCKS = 8,  // for which each level of the shift registers' clock stands
    parameter taxel_registers::registers_t AT_RESET = '0
) (
    input  logic                            clk,
    input  logic                            reset,
    input  taxel_registers::registers_t     written,
    input  logic [2:0]                      markers,        // how many wait, and what they mark
    input  logic [taxel_types::MARKERS-1:0] starts,
    output logic                            markers_taken,
    output taxel_registers::registers_t     active,         // of this frame
    input  logic [15:0]                     stamp,          // of a step that starts now
    input  taxel_types::micros_t            micros,
    input  logic [30:0]                     ended_micros,   // at a frame's start: the length of the one before
    input  logic                            line_due,       // and what came due in it
    input  logic                            totals_due,
    output logic                            zero,           // time 0
    output logic                            frame_start,
    output logic                            step_start,
    output logic                            read_start,     // of the ramp and the conversion
    output logic                            step_end,       // which is the end of the read
    output logic                            reading,        // the line's part that is read, a step's part that is read
    output logic                            converting,
    output taxel_types::read_t              read,           // of this step
    output logic [2:0]                      rsel,
    output logic                            csel_clk,
    output logic                            csel_din
);

  import taxel_registers::*;
  import taxel_types::*;

  localparam int EARLY = 16;
  localparam int ORDERING = 7;  // clocks until the next line is known

  if (HOLD < 2 || HOLD > 8) begin : g_hold
    $error("HOLD: 2 to 8");
  end

  registers_t committed;
  logic [2:0] committed_markers;
  logic [MARKERS-1:0] committed_starts;
  logic [31:0] line_left, reading_left;
  logic [15:0] step_left, converting_left;
  logic [7:0] place;
  logic [6:0] line, next_line;
  logic [2:0] step;
  logic line_start, last_line, stepping, early, early_line;
  logic initial_frame, initial_begun;
  logic line_over, frame_over, step_over;
  logic [7:0] next_lines;
  registers_t ended_registers;  // of the frame before
  logic next_random;

  assign markers_taken = early && last_line;

  always_ff @(posedge clk) begin
    // Whether this is the last line is known from its second clock on.
    last_line     <= place == active.lines;
    // The last clock of a line, of a frame's last line, of a step: known a clock before, as much hangs on them.
    line_over     <= line_left == 32'd2;
    frame_over    <= line_left == 32'd2 && last_line;
    step_over     <= stepping && step_left == 16'd2;
    early         <= line_left == 32'(EARLY + 1);
    frame_start   <= 1'b0;
    line_start    <= 1'b0;
    step_start    <= 1'b0;
    zero          <= 1'b0;
    step_end      <= step_over;
    read_start    <= stepping && step_left == active.step_read;
    line_left     <= line_left - 32'd1;
    if (stepping) step_left <= step_left - 16'd1;
    if (markers_taken) begin
      committed         <= written;
      committed_markers <= markers;
      committed_starts  <= starts;
    end
    if (step_over) begin
      if (step == 3'(STEPS - 1)) begin
        stepping <= 1'b0;
      end else begin
        step       <= step + 3'd1;
        step_left  <= active.step_period;
        step_start <= 1'b1;
      end
    end
    if (line_over) begin
      line_start <= 1'b1;
      step_start <= 1'b1;
      stepping   <= 1'b1;
      step       <= '0;
      line       <= next_line;
      if (frame_over) begin
        frame_start   <= 1'b1;
        zero          <= initial_frame && initial_begun;
        initial_frame <= initial_frame && !initial_begun;
        initial_begun <= 1'b1;
        place         <= '0;
        active        <= committed;
        ended_registers <= active;
        line_left     <= committed.line_period;
        step_left     <= committed.step_period;
      end else begin
        place     <= place + 8'd1;
        line_left <= active.line_period;
        step_left <= active.step_period;
      end
    end
    if (reset) begin
      // As at the end of a frame of one line.
      active         <= AT_RESET;
      active.lines   <= '0;
      place          <= '0;
      line_left      <= 32'(EARLY + 4 + 2 * CSEL_CLOCKS * COLUMNS);
      stepping       <= 1'b0;
      step           <= '0;
      line           <= '0;
      step_left      <= 16'd0;
      {line_over, frame_over, step_over} <= '0;
      initial_frame  <= 1'b1;
      initial_begun <= 1'b0;
    end
  end

  // The debug signal of the line's read: it ends with `line_read`.
  assign reading = reading_left != 0;
  assign converting = converting_left != 0;
  always_ff @(posedge clk) begin
    if (line_start) reading_left <= active.line_read;
    else if (reading_left != 0) reading_left <= reading_left - 32'd1;
    if (read_start) converting_left <= active.step_read;
    else if (converting_left != 0) converting_left <= converting_left - 16'd1;
    if (reset) begin
      reading_left    <= '0;
      converting_left <= '0;
    end
  end

  function automatic format_t format_of(registers_t r);
    return '{
        version_2: r.wire_version == 2'd1,
        wide_values: r.mechanoreceptor || r.ramp > 16'd255,
        frame_sync: r.frame_sync,
        spikes: r.mechanoreceptor
    };
  endfunction

  // What holds for a step is latched when it starts: its conversion ends when the scan has moved on.
  always_ff @(posedge clk) begin
    if (step_start) begin
      read.initial_frame <= initial_frame;
      read.frame_first   <= frame_start;
      read.frame_last    <= place == active.lines && step == 3'(STEPS - 1);
      read.line          <= line;
      read.step          <= step;
      read.stamp         <= stamp;
      read.micros        <= micros;
      read.format        <= format_of(active);
      read.ended         <= '{
          initial_frame: zero,
          format: format_of(ended_registers),
          micros: ended_micros,
          lines: ended_registers.lines,
          changed: ended_registers != active,
          line_due: line_due,
          totals_due: totals_due
      };
      read.pattern       <= active.pattern && !initial_frame;
      read.ramp          <= active.ramp;
      read.noise_floor   <= active.noise_floor;
      read.threshold     <= '{rest: active.threshold_rest, jump: active.threshold_jump, decay: active.threshold_decay};
      read.markers       <= committed_markers;
      read.starts        <= committed_starts;
    end
  end

  // What is selected follows a step's start, and a line's.
  logic [HOLD-1:1] step_moves, line_moves;

  always_ff @(posedge clk) begin
    step_moves <= (HOLD - 1)'({step_moves, step_start});
    line_moves <= (HOLD - 1)'({line_moves, line_start});
    if (step_moves[HOLD-1]) rsel <= step;
    if (reset) {step_moves, line_moves, rsel} <= '0;
  end

  assign next_lines  = last_line ? committed.lines : active.lines;
  assign next_random = last_line ? committed.random_lines : active.random_lines;

  taxel_random_lines order (
      .clk,
      .reset,
      .next(early_line),
      .first(last_line),
      .random(next_random),
      .lines(next_lines),
      .line(next_line)
  );

  // One clock after the registers of the next frame are taken; and when the line is drawn.
  logic [ORDERING-1:0] drawing;
  always_ff @(posedge clk) begin
    early_line <= early && !reset;
    drawing    <= reset ? '0 : {drawing[ORDERING-2:0], early_line};
  end

  taxel_line_select #(.COLUMNS(COLUMNS), .HALF(CSEL_CLOCKS)) select (
      .clk,
      .reset,
      .next(drawing[ORDERING-1]),
      .line(next_line),
      .lines(next_lines),
      .start(line_moves[HOLD-1]),
      .csel_clk,
      .csel_din
  );

  // Lines and steps are those of the registers.
  always_ff @(posedge clk) if (!reset) assert (32'(step) < STEPS && place <= active.lines);

endmodule
