// The pattern: what a ball that rolls over the array reads, by taxel and frame (docs/registers.md, The pattern).
//
// Positions are in sixteenths of a taxel. The array closes to a ring both ways: a ball that leaves it on one side comes back
// on the other. From its middle the value falls by a tick for each sixteenth, and a distance is the longer one of both ways
// and half the shorter one.
//
// Throughput: a taxel a clock.
// Latency: a clock from a taxel's row to its value.
// Loses nothing: between a read's end and its report three clocks pass or more.
module taxel_pattern #(
    parameter int COLUMNS = 64,
    parameter int ROWS = 64,
    parameter int ROW_BITS = 6
) (
    input  logic                clk,
    input  logic                reset,
    input  logic                step_end,
    input  taxel_types::read_t  read,       // of the step that ends
    input  logic                read_done,  // taxels of that read follow
    input  logic [ROW_BITS-1:0] row,
    output logic [15:0]         value       // of the row of the clock before
);

  localparam int HEIGHT = 128;  // ticks, where the ramp is as long
  localparam int X_BITS = $clog2(COLUMNS) + 4;
  localparam int Y_BITS = $clog2(ROWS) + 4;
  localparam int BITS = 12;     // of a height less a distance, with its sign

  // The distance to the ball, the shorter way around a ring of so many bits.
  function automatic logic [BITS-1:0] shorter(logic [BITS-1:0] ahead, int bits);
    return ahead[bits-1] ? BITS'(1 << bits) - ahead : ahead;
  endfunction

  // What holds for a line: the frames since the pattern began, how far the ball is, and the height less that, and less half of it.
  logic rolls;
  logic [15:0] n;
  logic [6:0] line;
  logic [BITS-1:0] height, way, ahead;
  typedef struct packed {
    logic [BITS-1:0] way;
    logic [BITS-1:0] less;
    logic [BITS-1:0] less_half;
  } across_t;
  across_t next, now, across;
  logic [14:0] place;

  assign way = shorter(ahead, X_BITS);

  always_ff @(posedge clk) begin
    if (step_end) begin
      if (read.frame_first) begin
        n     <= read.pattern && rolls ? n + 16'd1 : 16'd0;
        rolls <= read.pattern;
      end
      line   <= read.line;
      height <= read.ramp < 16'(HEIGHT) ? BITS'(read.ramp) : BITS'(HEIGHT);
    end
    ahead <= BITS'(X_BITS'(n[15:4] - 12'({line, 4'd0})));
    next  <= '{way: way, less: height - way, less_half: height - (way >> 1)};
    if (read_done) begin
      now   <= next;
      place <= n[15:1];
    end
    if (reset) rolls <= 1'b0;
  end

  // The taxels of it.
  logic [BITS-1:0] along, left;

  always_ff @(posedge clk) begin
    along  <= shorter(BITS'(Y_BITS'(place - 15'({row, 4'd0}))), Y_BITS);
    across <= now;
  end

  assign left  = along > across.way ? across.less_half - along : across.less - (along >> 1);
  assign value = left[BITS-1] ? 16'd0 : 16'(left);

endmodule
