// Times since time 0, the start of the first frame that is sent: stamps of 100 us, and us.
//
// With `frame_sync` all reads of a frame carry the time of its start, else each carries that of its step.
//
// Throughput: a stamp a clock.
// Latency: none: it stands in the clock in which a step starts.
// Loses nothing: a stamp begins again after 2^16 x 100 us, the length of a frame stays at 2^31 - 1 us.
module taxel_time_stamper (
    input  logic                 clk,
    input  logic                 zero,         // this clock is time 0
    input  logic                 frame_start,  // a frame starts in this clock
    input  logic                 frame_sync,
    output logic [15:0]          stamp,        // of a step that starts in this clock
    output taxel_types::micros_t micros,
    output logic [30:0]          ended         // at a frame's start: how long the one before was, us
);

  import taxel_types::*;

  localparam int CLOCKS = 10_000;  // of 10 ns in 100 us
  localparam int SHORT = 100;      // in 1 us

  logic [15:0] counted, of_frame, now;
  logic [13:0] clocks;
  micros_t counted_us, of_frame_us, now_us;
  logic [6:0] clocks_us, clocks_ended;

  assign now    = zero ? 16'd0 : counted;
  assign stamp  = (frame_sync && !frame_start) ? of_frame : now;
  assign now_us = zero ? '0 : counted_us;
  assign micros = (frame_sync && !frame_start) ? of_frame_us : now_us;

  always_ff @(posedge clk) begin
    if (frame_start) of_frame <= now;
    if (frame_start) of_frame_us <= now_us;
    if (zero) begin
      counted <= '0;
      clocks  <= 14'd1;
    end else if (clocks == 14'(CLOCKS - 1)) begin
      counted <= counted + 16'd1;
      clocks  <= '0;
    end else begin
      clocks <= clocks + 14'd1;
    end
    if (zero) begin
      counted_us <= '0;
      clocks_us  <= 7'd1;
    end else if (clocks_us == 7'(SHORT - 1)) begin
      counted_us <= counted_us + micros_t'(1);
      clocks_us  <= '0;
    end else begin
      clocks_us <= clocks_us + 7'd1;
    end
    if (frame_start) begin
      ended        <= '0;
      clocks_ended <= 7'd1;
    end else if (clocks_ended == 7'(SHORT - 1)) begin
      if (!(&ended)) ended <= ended + 31'd1;
      clocks_ended <= '0;
    end else begin
      clocks_ended <= clocks_ended + 7'd1;
    end
  end

endmodule
