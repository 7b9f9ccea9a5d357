// The register file, whatever is written when: what it holds obeys the rules, worded here once more, and a write that is
// refused changes nothing. Commands come at least four clocks apart: five bytes of a serial line take longer.
module registers_proof
  import taxel_registers::*;
  import taxel_types::*;
(
    input logic        clk,
    input logic        wants,
    input logic [2:0]  number,
    input logic [31:0] value,
    input logic        room,
    input logic        markers_taken,
    input logic        pattern
);

  localparam int COLUMNS = 8, CHANNELS = 16, STEPS = 4;

  logic begun = 1'b0, running = 1'b0;
  logic command, answer, refused_full, marker_lost;
  answer_t answered;
  registers_t written, held;
  logic [2:0] markers;
  logic [MARKERS-1:0] starts;
  logic [2:0] since;  // clocks since a command

  assign command = begun && wants && since == 3'd4;

  taxel_register_file #(
      .COLUMNS(COLUMNS),
      .ROWS(64),
      .CHANNELS(CHANNELS),
      .STEPS(STEPS),
      .AT_RESET(at_reset(STEPS, COLUMNS, 64, CHANNELS))
  ) registers (
      .clk, .reset(!begun), .pattern, .command, .number, .value, .answer, .answered, .room, .refused_full,
      .written, .markers, .starts, .markers_taken, .marker_lost
  );

  // The command that is answered next.
  logic waits;
  logic [2:0] of_number;
  logic [31:0] of_value;

  always_ff @(posedge clk) begin
    begun   <= 1'b1;
    running <= begun;
    held    <= written;
    since   <= command ? 3'd1 : since == 3'd4 ? 3'd4 : since + 3'd1;
    if (command && room) begin
      of_number <= number;
      of_value  <= value;
    end
    waits <= (command && room) || (waits && !answer);
    if (!begun) begin
      since <= 3'd4;
      waits <= 1'b0;
    end
  end

  always_comb begin
    if (begun) begin
      assert (written.lines < COLUMNS);
      assert (written.line_read <= written.line_period);
      assert (written.step_read <= written.step_period);
      assert (34'(written.step_period) * 34'(STEPS) <= 34'(written.line_read));
      assert (18'(written.ramp) + 18'd5 <= 18'(written.step_read) + 18'(written.step_read) + 18'(written.step_read));
      assert (!written.random_lines || 32'd16 * (32'(written.lines) + 32'd1) <= written.line_period);
      assert (written.step_period >= CHANNELS + 10);
      assert (written.ramp != 0 && written.step_read >= 4);
      assert (written.ramp != 16'hFFFF);
      assert (written.wire_version <= 1);
      assert (markers <= MARKERS);
      // An answer is to the command that came; of a write it is `ok` exactly where the register holds it.
      if (answer) begin
        assert (waits);
        if (answered.kind == ANSWER_OK && of_number != 3'd6)
          assert (answered.number == of_number && answered.value == of_value && word(written, of_number) == of_value);
        if (answered.kind == ANSWER_OK && of_number == 3'd6) assert (answered.value == word(written, of_value[2:0]));
      end
      // Nothing but such a write changes them.
      if (running && written != held) assert (answer && answered.kind == ANSWER_OK && of_number != 3'd6);
      cover (answer && answered.kind == ANSWER_BAD);
      cover (answer && answered.kind == ANSWER_STATUS);
      cover (answer && answered.kind == ANSWER_OK && of_number == 3'd4 && written.ramp == 16'd7);
      cover (marker_lost);
    end
  end

endmodule
