// The ECP5's output cell for both edges, as in its maker's simulation library: three registers, then a half of a clock
// each.
module ODDRX1F (
    input  logic SCLK,
    input  logic RST,
    input  logic D0,   // while the clock is high
    input  logic D1,
    output logic Q
);

  logic [1:0] first, second, third;
  wire unused = RST;

  assign Q = SCLK ? third[1] : third[0];

  always_ff @(posedge SCLK) begin
    first  <= {D0, D1};
    second <= first;
    third  <= second;
  end

endmodule
