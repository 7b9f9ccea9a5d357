// The queue, whatever is pushed and popped when: a marked word comes out once, unchanged and after exactly those before it.
module fifo_proof (
    input logic       clk,
    input logic       wants,  // to push
    input logic [3:0] word,
    input logic       accepts,
    input logic       mark
);

  localparam int DEPTH = 4;

  logic begun = 1'b0;
  logic push, pop, full, empty, ready;
  logic [3:0] oldest;

  assign push = begun && wants && !full;
  assign pop  = begun && accepts && ready;

  taxel_event_fifo #(.DEPTH(DEPTH), .BITS(4), .WIDTH(2)) queue (
      .clk, .reset(!begun), .push, .entered(word), .full, .empty, .ready, .oldest, .pop
  );

  logic [3:0] level, ahead, marked_word;
  logic marked, gone;
  logic [2:0] idle;

  always_ff @(posedge clk) begin
    begun <= 1'b1;
    level <= level + 4'(push) - 4'(pop);
    if (push && mark && !marked) begin
      marked      <= 1'b1;
      marked_word <= word;
      ahead       <= level - 4'(pop);
    end else if (marked && !gone && pop) begin
      if (ahead == 0) gone <= 1'b1;
      else ahead <= ahead - 4'd1;
    end
    idle <= level != 0 && !ready ? idle + 3'd1 : 3'd0;
    if (!begun) {level, marked, gone, idle} <= '0;
  end

  always_comb begin
    if (begun) begin
      // Nothing is invented and nothing lost.
      assert (empty == (level == 0));
      assert (!ready || level != 0);
      assert (level <= 4'(DEPTH + 2));
      // It refuses only where its ring is full, and what it holds comes out.
      assert (!full || level >= 4'(DEPTH));
      assert (idle <= 3'd4);
      // Order and value.
      if (marked && !gone) assert (ahead < level);
      if (marked && !gone && ahead == 0 && ready) assert (oldest == marked_word);
      cover (full && pop);
      cover (gone && level == 0);
      cover (marked && ahead == 4'(DEPTH + 1));
    end
  end

endmodule
