// When a board of version 2 repeats a line's values and its totals: all lines once in EVERY clocks.
//
// Both flags say at a frame's start whether they came due in the frame that ended.
//
// Throughput: a line and the totals a frame at most.
// Latency: flags stand at the start of the next frame.
// Loses turns that come due twice in a frame: once is repeated.
module taxel_refresh #(
    parameter int EVERY = 100_000_000  // clocks; 0: never
) (
    input  logic       clk,
    input  logic       zero,         // this clock is time 0
    input  logic       frame_start,
    input  logic [7:0] lines,        // of this frame, less one
    output logic       line_due,
    output logic       totals_due
);

  if (EVERY == 0) begin : g_never
    assign {line_due, totals_due} = '0;
    wire unused = &{clk, zero, frame_start, lines};
  end else begin : g_every
    localparam int BITS = $clog2(EVERY + 257);

    logic [BITS-1:0] since_line, since_totals, line_next, totals_next;
    logic line_over, totals_over;

    assign line_next   = since_line + BITS'(lines) + BITS'(1);
    assign totals_next = since_totals + BITS'(1);
    assign line_over   = line_next >= BITS'(EVERY);
    assign totals_over = totals_next >= BITS'(EVERY);

    // As if since 0 at time 0, when nothing is due: EVERY is more than the lines.
    always_ff @(posedge clk) begin
      since_line   <= zero ? BITS'(lines) + BITS'(1) : line_over ? line_next - BITS'(EVERY) : line_next;
      since_totals <= zero ? BITS'(1) : totals_over ? totals_next - BITS'(EVERY) : totals_next;
      line_due     <= (line_due && !frame_start) || (line_over && !zero);
      totals_due   <= (totals_due && !frame_start) || (totals_over && !zero);
    end
  end

endmodule
