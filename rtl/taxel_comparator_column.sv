// One channel of the converter, on the fast clock: at which sample its comparator tripped.
module taxel_comparator_column (
    input  logic        clk_fast,
    input  logic        begun,    // pair 0 of a read is sampled in this clock
    input  logic        open,     // the read's samples count
    input  logic [14:0] pair,
    input  logic [1:0]  sample,   // whether the comparator has tripped, at the first and second half of the clock
    output logic        tripped,
    output logic        first,    // at the first of the pair
    output logic [14:0] at        // the pair
);

  always_ff @(posedge clk_fast) begin
    if (begun || (open && !tripped)) begin
      tripped <= sample != 2'b00;
      first   <= sample[0];
      at      <= pair;
    end
  end

endmodule
