// Time stamps of 100 us: how many have passed since time 0, the start of the first frame that is sent.
//
// With `frame_sync` all reads of a frame carry the stamp of its start, else each carries that of its step.
module taxel_time_stamper (
    input  logic        clk,
    input  logic        zero,         // this clock is time 0
    input  logic        frame_start,  // a frame starts in this clock
    input  logic        frame_sync,
    output logic [15:0] stamp         // of a step that starts in this clock
);

  localparam int CLOCKS = 10_000;  // of 10 ns in 100 us

  logic [15:0] counted, of_frame, now;
  logic [13:0] clocks;

  assign now   = zero ? 16'd0 : counted;
  assign stamp = (frame_sync && !frame_start) ? of_frame : now;

  always_ff @(posedge clk) begin
    if (frame_start) of_frame <= now;
    if (zero) begin
      counted <= '0;
      clocks  <= 14'd1;
    end else if (clocks == 14'(CLOCKS - 1)) begin
      counted <= counted + 16'd1;
      clocks  <= '0;
    end else begin
      clocks <= clocks + 14'd1;
    end
  end

endmodule
