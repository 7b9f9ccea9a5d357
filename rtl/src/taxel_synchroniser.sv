// Takes one bit that changes seldom into another clock's domain: two flip-flops in a row.
//
// Throughput: a change every two clocks.
// Latency: two clocks, or three where a change comes at an edge.
// Loses a change and its return between two edges.
module taxel_synchroniser (
    input  logic clk,
    input  logic from,
    output logic to
);

  // Synthesis keeps both.
  (* keep *) logic unsettled, settled;
  assign to = settled;

  always_ff @(posedge clk) {settled, unsettled} <= {unsettled, from};

endmodule
