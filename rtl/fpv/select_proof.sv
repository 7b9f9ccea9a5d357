// The chain of shift registers, whatever it holds at first and whatever line is named when, whether or not the jump before is over:
// in time a single line is driven. Data and levels of the clock stand for as long as they should, and nothing moves until a line
// starts.
module select_proof (
    input logic       clk,
    input logic       wants,
    input logic       begins,
    input logic [6:0] given_line,
    input logic [7:0] given_lines  // less one
);

  localparam int COLUMNS = 4;
  localparam int HALF = 2;
  // Clocks from a line's start until it alone is driven: the longest jump, and data that did not stand.
  localparam int CLOCKS = 2 * HALF * COLUMNS + 2 * HALF + 2;

  logic begun = 1'b0;
  logic next, start, csel_clk, csel_din, clk_was, din_was, ever;
  logic [COLUMNS-1:0] chain, driven;
  logic [5:0] since;       // clocks since a line started
  logic [2:0] since_next;  // and since it was named
  logic named;             // a line that has not started
  logic [1:0] level_stood, data_stood;
  logic [6:0] wanted;
  logic [7:0] of_lines;

  assign next  = begun && wants && !named && 8'(given_line) <= given_lines && given_lines < 8'(COLUMNS);
  assign start = begun && begins && named && since_next >= 3'd4;

  taxel_line_select #(.COLUMNS(COLUMNS), .HALF(HALF)) select (
      .clk, .reset(!begun), .next, .line(given_line), .lines(given_lines), .start, .csel_clk, .csel_din
  );

  always_ff @(posedge clk) begin
    begun   <= 1'b1;
    clk_was <= csel_clk && begun;
    din_was <= csel_din;
    level_stood <= csel_clk != clk_was ? 2'd1 : level_stood + 2'(level_stood < 2'(HALF));
    data_stood  <= csel_din != din_was ? 2'd1 : data_stood + 2'(data_stood < 2'(HALF));
    // A place of the chain is a line; the clock's edge moves all.
    if (begun && csel_clk && !clk_was) chain <= {chain[COLUMNS-2:0], csel_din};
    if (since != 6'(CLOCKS)) since <= since + 6'd1;
    if (since_next != 3'd4) since_next <= since_next + 3'd1;
    if (next) begin
      named      <= 1'b1;
      since_next <= 3'd1;
      wanted     <= given_line;
      of_lines   <= given_lines;
    end
    if (start) begin
      named <= 1'b0;
      ever  <= 1'b1;
      since <= 6'd1;
    end
    if (!begun) begin
      {named, ever, since, clk_was, din_was} <= '0;
      level_stood <= 2'(HALF);
      data_stood  <= 2'd0;
    end
  end

  // Of places beyond the frame's lines nothing is said: what they drive is not read.
  always_comb begin
    for (int k = 0; k < COLUMNS; k++) driven[k] = chain[k] && 8'(k) <= of_lines;
  end

  always_comb begin
    if (begun) begin
      if (ever && !named && since == 6'(CLOCKS)) begin
        assert (driven == COLUMNS'(1) << wanted);
        assert (!csel_clk);
      end
      // From a clock after it is named until it starts nothing rises.
      if (named && since_next >= 3'd2) assert (!(csel_clk && !clk_was));
      if (csel_clk != clk_was) assert (level_stood >= 2'(HALF));
      if (csel_clk && !clk_was) assert (csel_din == din_was && data_stood >= 2'(HALF));
      if (csel_clk && clk_was) assert (csel_din == din_was);
      cover (ever && !named && since == 6'(CLOCKS) && wanted == 7'd3);
      cover (ever && !named && since == 6'(CLOCKS) && chain[3] && of_lines == 8'd2 && wanted == 7'd1);
      cover (start && ever && since < 6'd9 && select.pulses > 8'd1);
    end
  end

endmodule
