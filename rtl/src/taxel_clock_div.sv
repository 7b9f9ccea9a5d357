// Clock division: one pulse every PERIOD clocks, the first PERIOD clocks after `restart`.
//
// Throughput: a pulse every PERIOD clocks.
// Latency: PERIOD clocks from `restart` to the first one.
// Loses nothing: there is no input that waits.
module taxel_clock_div #(
    parameter int PERIOD = 10_000
) (
    input  logic clk,
    input  logic restart,
    output logic pulse
);

  localparam int BITS = $clog2(PERIOD + 1);

  logic [BITS-1:0] left;

  always_ff @(posedge clk) begin
    pulse <= !restart && left == BITS'(2);
    left  <= (restart || left == BITS'(1)) ? BITS'(PERIOD) : left - BITS'(1);
  end

endmodule
