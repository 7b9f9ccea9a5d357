// The queue of events: a ring in block memory, with a register before it, as whether an event comes is known late in a clock and
// the blocks lie far apart, and three behind it: what the blocks read in every clock, the register that each block has behind
// that, and one where an event is used, which may lie as far away as the blocks from each other.
//
// It gives one every other clock at most: a register takes the next event the clock after it gave one on, so that no register
// but the last waits for `pop`, which is known late in a clock. A place of the ring is free when its word has landed.
//
// Throughput: an event a clock in, one every other clock out.
// Latency: five clocks from `push` to `ready`, where nothing waits.
// Loses nothing: it is full before it would. Who pushes counts what found no room.
module taxel_event_fifo #(
    parameter int DEPTH = 4096,
    parameter int BITS = 47,
    // Of the memories in which the ring lies side by side: as wide as a RAM block of its depth is. A wider one becomes blocks of
    // a part of the depth each, and to choose between these takes too long behind outputs that come late.
    parameter int WIDTH = DEPTH > 8192 ? 1 : DEPTH > 4096 ? 2 : DEPTH > 2048 ? 4 : DEPTH > 1024 ? 9 : 18
) (
    input  logic            clk,
    input  logic            reset,
    input  logic            push,   // only where not full
    input  logic [BITS-1:0] entered,
    output logic            full,
    output logic            empty,  // nothing is in it, nor on its way to the output
    output logic            ready,  // the oldest stands at the output
    output logic [BITS-1:0] oldest,
    input  logic            pop     // only where ready
);

  localparam int PLACES = $clog2(DEPTH);
  localparam int SLICES = (BITS + WIDTH - 1) / WIDTH;

  // A word goes from `held`, before the ring, into the ring in the clock that has `stored`. Behind it the blocks read it into
  // `fetched`; `land` takes it on into `landed`, the blocks' own registers, and `move` from there to `oldest`.
  logic [PLACES-1:0] write, read;
  logic [PLACES:0] waiting;  // words in the ring and before it
  logic [BITS-1:0] held;
  logic stored;
  logic [SLICES-1:0][WIDTH-1:0] fetched, landed;
  logic fetched_valid, land, move;
  logic landed_free;  // `landed` takes what was read
  logic ring_empty;

  assign empty = ring_empty && !stored && landed_free && !ready;
  assign land  = fetched_valid && landed_free;
  assign move  = !landed_free && !ready;

  for (genvar k = 0; k < SLICES; k++) begin : g_slice
    logic [WIDTH-1:0] ring[DEPTH];
    always_ff @(posedge clk) begin
      if (stored) ring[write] <= WIDTH'(held >> (k * WIDTH));
      fetched[k] <= ring[read];
    end
  end

  always_ff @(posedge clk) begin
    held   <= entered;
    stored <= push;
    if (stored) write <= write == PLACES'(DEPTH - 1) ? '0 : write + PLACES'(1);
    if (land) read <= read == PLACES'(DEPTH - 1) ? '0 : read + PLACES'(1);
    // What the count will be is not waited for: whether a word is pushed is known late in a clock.
    if (push != land) begin
      waiting <= push ? waiting + (PLACES + 1)'(1) : waiting - (PLACES + 1)'(1);
      full    <= push && waiting == (PLACES + 1)'(DEPTH - 1);
    end
    // A word that is pushed now is in the ring after the next clock. In the clock after a word has landed no
    // other does, and the next place is read.
    ring_empty    <= waiting == (PLACES + 1)'(land);
    fetched_valid <= !ring_empty;
    if (landed_free) landed <= fetched;
    if (land) landed_free <= 1'b0;
    else if (move) landed_free <= 1'b1;
    if (move) oldest <= BITS'(landed);
    if (move) ready <= 1'b1;
    else if (pop) ready <= 1'b0;
    if (reset) begin
      write         <= '0;
      read          <= '0;
      waiting       <= '0;
      stored        <= 1'b0;
      full          <= 1'b0;
      ring_empty    <= 1'b1;
      fetched_valid <= 1'b0;
      landed_free   <= 1'b1;
      ready         <= 1'b0;
    end
  end

  // Whoever pushes and pops does so only where that is allowed, and the ring neither overflows nor underflows.
  always_ff @(posedge clk) begin
    if (!reset) begin
      assert (!(push && full) && !(pop && !ready));
      assert (waiting <= (PLACES + 1)'(DEPTH) && !(land && waiting == '0));
    end
  end

endmodule
