// Drives one line at a time through a chain of shift registers (74HC164): a single one stands at the place of the line.
//
// A later line is reached by shifting on. For an earlier one the old one is shifted out beyond the last line, and a new one in.
// After reset, and where there are more lines than before, the whole chain is shifted through, as what it holds is not known.
// A pulse takes 2 x HALF clocks, so a jump over n lines settles n pulses later.
//
// Throughput: a line every 2 x HALF clocks for each pulse of the jump, and HALF + 2 more.
// Latency: as long.
// Loses a jump that the next line's start cuts short: then no line or two are driven, until ascending lines have passed all
// places.
module taxel_line_select #(
    parameter int COLUMNS = 64,
    parameter int HALF = 1  // clocks of half a pulse
) (
    input  logic       clk,
    input  logic       reset,
    input  logic       start,  // of a line
    input  logic [6:0] line,
    input  logic [7:0] lines,  // less one
    output logic       csel_clk,
    output logic       csel_din
);

  localparam int HALF_BITS = $clog2(HALF + 1);

  logic [6:0] at;  // which line is selected
  logic [7:0] known;  // lines less one for which the chain is known to hold a single one
  logic       unknown;
  logic [7:0] pulses, insert;  // how many are left, and at which of them the one goes in
  // A clock after `start`: the whole chain, or on from the old line; else so many pulses take the old one out, the new one in.
  logic fresh, all, later;
  logic [7:0] on, out, in;
  logic [HALF_BITS-1:0] left;

  always_ff @(posedge clk) begin
    fresh <= start && !reset;
    if (start) begin
      all   <= unknown || lines > known;
      later <= line > at;
      on    <= 8'(line - at);
      out   <= 8'(at) > lines ? 8'd0 : lines + 8'd1 - 8'(at);
      in    <= 8'(line) + 8'd1;
    end
  end

  always_ff @(posedge clk) begin
    if (reset) begin
      unknown  <= 1'b1;
      pulses   <= '0;
      csel_clk <= 1'b0;
      csel_din <= 1'b0;
      at       <= '0;
      known    <= '0;
      insert   <= '0;
      left     <= HALF_BITS'(1);
    end else if (start) begin
      at       <= line;
      known    <= lines;
      unknown  <= 1'b0;
      csel_clk <= 1'b0;
      csel_din <= 1'b0;
    end else if (fresh) begin
      pulses <= all ? 8'(COLUMNS) : later ? on : out > in ? out : in;
      insert <= !all && later ? 8'd0 : in;
      left   <= HALF_BITS'(HALF);
    end else if (left != HALF_BITS'(1)) begin
      left <= left - HALF_BITS'(1);
    end else begin
      left <= HALF_BITS'(HALF);
      if (csel_clk) begin
        csel_clk <= 1'b0;
        csel_din <= 1'b0;
        pulses   <= pulses - 8'd1;
      end else if (pulses != 0) begin
        // The data stand half a pulse before the clock rises, and until it has fallen.
        if (pulses == insert && !csel_din) csel_din <= 1'b1;
        else csel_clk <= 1'b1;
      end
    end
  end

endmodule
