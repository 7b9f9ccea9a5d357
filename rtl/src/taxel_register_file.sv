// The registers as written, behind the rules of registers.toml: a write that breaks one changes nothing.
//
// Every command is answered, four clocks later; it takes longer than that to come. One that finds no room for its answer is
// refused, and counted.
//
// Throughput: a command every four clocks.
// Latency: four clocks from a command to its answer.
// Loses a command that finds no room for its answer (`refused_full`), and a marker that finds four waiting (`marker_lost`):
// `taxel_totals` counts both.
module taxel_register_file #(
    parameter int COLUMNS = 64,
    parameter int ROWS = 64,
    parameter int CHANNELS = 16,
    parameter int STEPS = 4,
    parameter taxel_registers::registers_t AT_RESET = '0
) (
    input  logic                            clk,
    input  logic                            reset,
    input  logic                            pattern,        // whether it is on after a reset
    input  logic                            command,
    input  logic [2:0]                      number,
    input  logic [31:0]                     value,
    output logic                            answer,         // to a command: one clock
    output taxel_types::answer_t            answered,
    input  logic                            room,           // for an answer
    output logic                            refused_full,   // a command found none
    output taxel_registers::registers_t     written,
    output logic [2:0]                      markers,        // starts and stops of recordings that wait for a frame
    output logic [taxel_types::MARKERS-1:0] starts,
    input  logic                            markers_taken,
    output logic                            marker_lost
);

  import taxel_registers::*;
  import taxel_types::*;

  registers_t changed;
  logic begun, judged, checked;
  logic [2:0] n;
  logic [31:0] word_written;
  logic reserved;
  logic [RULES-1:0] which;
  logic [3:0] rule;
  logic reads, greets, totals;

  logic writes, marks;
  // REG6 has no field, so a read changes nothing.
  assign writes = checked && rule == 4'd0;

  always_ff @(posedge clk) begin
    // The command as it came; the registers as they would be.
    begun        <= command && room;
    refused_full <= command && !room;
    if (command) begin
      n            <= number;
      word_written <= value;
      changed      <= store(written, number, value);
      reserved     <= (value & ~mask(number)) != 0;
      reads        <= number == 3'd6 && value < 32'd8;
      greets       <= number == 3'd6 && value == 32'd8;
      totals       <= number == 3'd6 && value == 32'd9;
    end
    // What is wrong with them; which of that comes first.
    judged  <= begun;
    which   <= broken(changed, STEPS, COLUMNS, ROWS, CHANNELS);
    checked <= judged;
    rule    <= reserved ? 4'd4 : refused(which);
    // The answer.
    answer            <= checked;
    answered.number <= n;
    answered.value    <= word_written;
    answered.kind     <= rule == 4'd0 ? ANSWER_OK : ANSWER_BAD;
    if (reads) begin
      answered.number <= word_written[2:0];
      answered.value    <= word(written, word_written[2:0]);
      answered.kind     <= ANSWER_OK;
    end else if (greets) begin
      answered.kind <= ANSWER_GREETING;
    end else if (totals) begin
      answered.kind <= ANSWER_STATUS;
    end else if (rule != 4'd0) begin
      answered.value <= 32'(rule);
    end
    if (writes) written <= changed;
    if (reset) begin
      {begun, judged, checked, answer, refused_full} <= '0;
      written <= AT_RESET;
      written.pattern <= pattern;
    end
  end

  // Starts and stops, the oldest in bit 0, until the scan takes them for a frame.
  logic [2:0] still;
  assign marks = writes && changed.record != written.record;
  assign still = markers_taken ? 3'd0 : markers;

  always_ff @(posedge clk) begin
    marker_lost <= 1'b0;
    markers     <= still;
    if (marks) begin
      if (still == 3'(MARKERS)) begin
        marker_lost <= 1'b1;
      end else begin
        markers <= still + 3'd1;
        starts[still[1:0]] <= changed.record;
      end
    end
    if (reset) begin
      markers     <= '0;
      marker_lost <= 1'b0;
    end
  end

  // What it holds obeys the rules.
  always_ff @(posedge clk) if (!reset) assert (broken(written, STEPS, COLUMNS, ROWS, CHANNELS) == '0);

endmodule
