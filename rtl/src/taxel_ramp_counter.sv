// The converter's timer, on the fast clock: it raises the ramp, and tells when the first and last of its samples are
// taken.
//
// A tick is half a clock, 1/300 us: the ramp is given, and the comparators are sampled, at both edges. Of each pair the first
// sample, and the first half of the ramp, is in bit 0. `DELAY` clocks pass from the ramp's pair to the pair of samples that
// were taken during it.
//
// Throughput: a ramp every five clocks, where it is no longer than that.
// Latency: the ramp rises a clock after `start`.
// Loses a ramp that starts before the one before has fallen for a clock: comparators see one.
module taxel_ramp_counter #(
    parameter int DELAY = 3
) (
    input  logic        clk_fast,
    input  logic        reset,
    input  logic        start,   // of the ramp
    input  logic [15:0] length,  // of the ramp, in ticks
    output logic [1:0]  ramp,
    output logic        nears,   // a clock before `begins`
    output logic        begins,  // a clock before `begun`
    output logic        begun,   // in this clock pair 0 is sampled
    output logic        open,    // the ramp rose in the pair that is sampled, or ended as it began
    output logic        closing  // the pair that is sampled next is the last of them
);

  localparam int MIDDLE = DELAY < 7 ? DELAY - 3 : 4;  // when what a ramp asks for moves on

  // Counters count down, and what ends with them is known clocks before, as the clock is fast.
  logic [14:0] full, ramp_left, pairs_next, pairs, pairs_left;  // pairs of the ramp that are high in both halves
  logic odd;                                        // whether half a pair follows
  logic rising, ramp_last, pairs_last, none, single, one_left;
  logic [DELAY-1:0] delayed;

  assign nears  = delayed[DELAY-2];
  assign begins = delayed[DELAY-1];
  assign closing = begins ? none : one_left;
  assign full   = length[15:1];

  always_ff @(posedge clk_fast) begin
    // The ramp.
    if (start) begin
      odd       <= length[0];
      rising    <= full != 15'd0;
      ramp      <= {full != 15'd0, 1'b1};
      ramp_left <= full;
      ramp_last <= full == 15'd1;
    end else begin
      if (ramp_last || !rising) begin
        ramp   <= {1'b0, rising && odd};
        rising <= 1'b0;
      end
      ramp_left <= ramp_left - 15'd1;
      ramp_last <= ramp_left == 15'd2;
    end
    // The samples of it: up to the one at its end.
    delayed <= {delayed[DELAY-2:0], start};
    // The next ramp may start before these begin.
    if (start) pairs_next <= full;
    if (delayed[MIDDLE]) pairs <= pairs_next;
    none   <= pairs == 15'd0;
    single <= pairs == 15'd1;
    begun  <= begins;
    pairs_last <= closing;
    if (begins) begin
      open       <= 1'b1;
      pairs_left <= pairs;
      one_left   <= single;
    end else begin
      if (pairs_last) open <= 1'b0;
      pairs_left <= pairs_left - 15'd1;
      one_left   <= pairs_left == 15'd2;
    end
    if (reset) begin
      ramp    <= '0;
      rising  <= 1'b0;
      delayed <= '0;
      begun   <= 1'b0;
      open    <= 1'b0;
    end
  end

endmodule
