// The chain of shift registers, whatever it holds at first and whatever line follows which: in time a single line is driven.
module select_proof (
    input logic       clk,
    input logic       wants,
    input logic [6:0] line,
    input logic [7:0] lines  // less one
);

  localparam int COLUMNS = 5;
  // Clocks from a line's start until it alone is driven: two a place, and three.
  localparam int CLOCKS = 2 * COLUMNS + 3;

  logic begun = 1'b0;
  logic start, csel_clk, csel_din, clk_was, din_was, started;
  logic [COLUMNS-1:0] chain, driven;
  logic [4:0] since;
  logic [6:0] wanted;
  logic [7:0] of_lines;

  assign start = begun && wants && (since == 5'(CLOCKS) || !started) && 8'(line) <= lines && lines < 8'(COLUMNS);

  taxel_line_select #(.COLUMNS(COLUMNS)) select (.clk, .reset(!begun), .start, .line, .lines, .csel_clk, .csel_din);

  always_ff @(posedge clk) begin
    begun   <= 1'b1;
    clk_was <= csel_clk && begun;
    din_was <= csel_din;
    // A place of the chain is a line; the clock's edge moves all.
    if (begun && csel_clk && !clk_was) chain <= {chain[COLUMNS-2:0], csel_din};
    if (start) begin
      started  <= 1'b1;
      since    <= '0;
      wanted   <= line;
      of_lines <= lines;
    end else if (since != 5'(CLOCKS)) begin
      since <= since + 5'd1;
    end
    if (!begun) {started, since} <= '0;
  end

  // Of places beyond the frame's lines nothing is said: what they drive is not read.
  always_comb begin
    for (int k = 0; k < COLUMNS; k++) driven[k] = chain[k] && 8'(k) <= of_lines;
  end

  always_comb begin
    if (begun && started && since == 5'(CLOCKS)) begin
      assert (driven == COLUMNS'(1) << wanted);
      assert (!csel_clk);
    end
    // Data stand before the clock rises and while it is high.
    if (begun && started && since != 5'd0 && csel_clk) assert (csel_din == din_was);
    if (begun) begin
      cover (started && since == 5'(CLOCKS) && wanted == 7'd4);
      cover (started && since == 5'(CLOCKS) && chain[4] && of_lines == 8'd2 && wanted == 7'd1);
    end
  end

endmodule
