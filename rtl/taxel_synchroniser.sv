// Takes one bit that changes seldom into another clock's domain: two flip-flops in a row.
module taxel_synchroniser (
    input  logic clk,
    input  logic from,
    output logic to
);

  logic unsettled;

  always_ff @(posedge clk) {to, unsettled} <= {unsettled, from};

endmodule
