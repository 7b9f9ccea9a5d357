// One channel of the converter, on the fast clock: at which sample its comparator tripped.
//
// Throughput: a pair of samples a clock.
// Latency: the result of a pair stands a clock later.
// Loses nothing: one that trips after a read's last pair counts as not tripped.
module taxel_comparator_column (
    input  logic        clk_fast,
    input  logic        begins,   // a clock before pair 0 of a read is sampled
    input  logic        closes,   // the pair that is sampled is the read's last
    input  logic [14:0] pair,
    input  logic [1:0]  sample,   // whether the comparator has tripped, at the first and second half of the clock
    output logic        tripped,
    output logic        first,    // at the first of the pair
    output logic [14:0] at        // the pair
);

  // Each channel has its own register for whether its samples still count: one of all would have too far to go.
  logic awaited;

  always_ff @(posedge clk_fast) begin
    awaited <= begins || (awaited && sample == 2'b00 && !closes);
    if (awaited) begin
      tripped <= sample != 2'b00;
      first   <= sample[0];
      at      <= pair;
    end
  end

endmodule
