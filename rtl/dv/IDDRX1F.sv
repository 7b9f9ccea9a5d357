// The ECP5's input cell for both edges, as in its maker's simulation library: what both edges of a clock took, from its
// end on.
module IDDRX1F (
    input  logic SCLK,
    input  logic RST,
    input  logic D,
    output logic Q0,   // as the clock rose
    output logic Q1    // as it fell
);

  logic risen, fallen;
  wire unused = RST;

  always_ff @(negedge SCLK) fallen <= D;

  always_ff @(posedge SCLK) begin
    risen <= D;
    Q0    <= risen;
    Q1    <= fallen;
  end

endmodule
