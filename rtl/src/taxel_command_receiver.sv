// Commands of the host: five bytes that set one register; it finds its place again after damage.
//
// Throughput: a byte a clock.
// Latency: a command stands a clock after its fifth byte.
// Loses bytes that belong to no command (`skipped`; `taxel_totals` counts them).
module taxel_command_receiver (
    input  logic        clk,
    input  logic        reset,
    input  logic        valid,
    input  logic [7:0]  data,
    input  logic        broken,    // a byte that was none: its command is none either
    output logic        command,   // a whole one
    output logic [2:0]  number,
    output logic [31:0] value,
    output logic [2:0]  skipped    // bytes that turn out to belong to no command, in this clock
);

  logic [2:0] have;
  logic [3:0] tops;  // the top bits of the value's bytes

  always_ff @(posedge clk) begin
    command <= 1'b0;
    skipped <= '0;
    if (valid) begin
      if (data[7]) begin
        skipped  <= have;
        have     <= 3'd1;
        number <= data[6:4];
        tops     <= data[3:0];
      end else if (have == 0) begin
        skipped <= 3'd1;
      end else begin
        value   <= {value[23:0], tops[3], data[6:0]};
        tops    <= tops << 1;
        have    <= have == 3'd4 ? 3'd0 : have + 3'd1;
        command <= have == 3'd4;
      end
    end
    if (broken) begin
      skipped <= have + 3'd1;
      have    <= '0;
    end
    if (reset) begin
      have    <= '0;
      command <= 1'b0;
      skipped <= '0;
    end
  end

endmodule
