// In place of the two flip-flops of a crossing, in its proofs: a change reaches the first at the edge at which it comes
// or at the next one, each time anew.
module taxel_synchroniser (
    input  logic clk,
    input  logic from,
    output logic to
);

  logic late, was, unsettled;  // `late` is of no source: any value at any time

  always_ff @(posedge clk) begin
    was       <= from;
    unsettled <= late ? was : from;
    to        <= unsettled;
  end

endmodule
