// The converter's timer, on the fast clock: it raises the ramp, and counts the pairs of samples that are taken meanwhile.
//
// A tick is half a clock, 1/300 us: the ramp is given, and the comparators are sampled, at both edges. Of each pair the first
// sample, and the first half of the ramp, is in bit 0. `DELAY` clocks pass from the ramp's pair to the pair of samples that
// were taken during it.
module taxel_ramp_counter #(
    parameter int DELAY = 2
) (
    input  logic        clk_fast,
    input  logic        reset,
    input  logic        start,   // of the ramp
    input  logic [15:0] length,  // of the ramp, in ticks
    output logic [1:0]  ramp,
    output logic        begins,  // a clock before `begun`
    output logic        begun,   // in this clock pair 0 is sampled
    output logic        open,    // the ramp rose in the pair that is sampled, or ended as it began
    output logic [14:0] pair
);

  logic [15:0] left;
  logic [14:0] pairs, last;
  logic [DELAY-1:0] delayed;

  assign begins = delayed[DELAY-1];

  always_ff @(posedge clk_fast) begin
    // The ramp.
    if (start) begin
      ramp <= {length != 16'd1, 1'b1};
      left <= length[15:1] == 15'd0 ? 16'd0 : length - 16'd2;
    end else begin
      ramp <= {left[15:1] != 15'd0, left != 16'd0};
      left <= left[15:1] == 15'd0 ? 16'd0 : left - 16'd2;
    end
    // The samples of it: up to the one at its end.
    delayed <= {delayed[DELAY-2:0], start};
    if (start) last <= length[15:1];
    begun <= begins;
    if (begins) begin
      open  <= 1'b1;
      pair  <= '0;
      pairs <= last;
    end else begin
      if (pair == pairs) open <= 1'b0;
      pair <= pair + 15'd1;
    end
    if (reset) begin
      ramp    <= '0;
      left    <= '0;
      delayed <= '0;
      begun   <= 1'b0;
      open    <= 1'b0;
    end
  end

endmodule
