// Drives one line at a time through a chain of shift registers (74HC164): a single one stands at the place of the line.
//
// A later line is reached by shifting on. For an earlier one the old one is shifted out beyond the last line, and a new one in;
// so too where there are more lines than before, as what was shifted out stands there. The line is named before it is due: the
// data then stand in time, and the clock rises at once as the line starts. Data and both levels of the clock stand for HALF
// clocks or more, whatever is asked for when, so a jump over n lines settles 2 x HALF x n clocks later.
//
// Throughput: a line every 2 x HALF clocks for each pulse of the jump.
// Latency: the first pulse rises a clock after `start`, or HALF after what stood in its way; the data stand four clocks after
// `next`.
// Loses no line: a jump that the next line comes before goes on to that one. Until it is over no line or several are driven.
module taxel_line_select #(
    parameter int COLUMNS = 64,
    parameter int HALF = 8  // clocks for which the data, and each level of the clock, stand
) (
    input  logic       clk,
    input  logic       reset,
    input  logic       next,   // names the line that is due, four clocks or more before it starts
    input  logic [6:0] line,   // with `next`
    input  logic [7:0] lines,  // less one; with `next`
    input  logic       start,  // of that line
    output logic       csel_clk,
    output logic       csel_din
);

  localparam int HALF_BITS = HALF > 1 ? $clog2(HALF) : 1;

  logic [6:0] aim;                // the line named last
  logic [7:0] aim_lines;          // less one
  logic [6:0] at;                 // which line the pulses below lead to
  logic [7:0] known;              // lines less one of which only that is driven then
  logic [7:0] place;              // where the newest one stands, older ones beyond it; COLUMNS: in none
  logic [7:0] pulses, insert;     // how many are left; before so many of them the one goes in, 0: it is in
  logic waits;                    // for the start of the line
  logic [HALF_BITS-1:0] left;     // clocks until data and clock have stood
  logic data, rises, falls;
  // From a clock after `next` on no pulse rises: on from where the one stands; or so many take it out, and a new one in.
  logic named, weighed, later;
  logic [7:0] on, out, in;

  assign data  = insert != 8'd0 && pulses == insert;
  assign rises = !csel_clk && (start || !waits) && left == '0 && pulses != 8'd0;
  assign falls = csel_clk && left == '0;

  always_ff @(posedge clk) begin
    named   <= next && !reset;
    weighed <= named && !reset;
    if (next) begin
      aim       <= line;
      aim_lines <= lines;
    end
    later <= insert == 8'd0 && aim > at && aim_lines <= known;
    on    <= 8'(aim) - place;
    out   <= place > aim_lines ? 8'd0 : aim_lines + 8'd1 - place;
    in    <= 8'(aim) + 8'd1;
  end

  always_ff @(posedge clk) begin
    if (start) waits <= 1'b0;
    if (next) waits <= 1'b1;
    if (left != '0) left <= left - HALF_BITS'(1);
    if (rises) begin
      csel_clk <= 1'b1;
      left     <= HALF_BITS'(HALF - 1);
      pulses   <= pulses - 8'd1;
      if (csel_din) insert <= '0;
      if (csel_din) place <= '0;
      else if (place != 8'(COLUMNS)) place <= place + 8'd1;
    end else if (falls || (!csel_clk && csel_din != data)) begin
      csel_clk <= 1'b0;
      csel_din <= data;
      left     <= HALF_BITS'(HALF - 1);
    end
    if (weighed) begin
      pulses <= later ? on : out > in ? out : in;
      insert <= later ? 8'd0 : in;
      at     <= aim;
      known  <= aim_lines;
    end
    if (reset) begin
      // The whole chain is shifted through, as what it holds is not known. No line lies beyond the last one.
      pulses   <= 8'(COLUMNS);
      insert   <= '0;
      place    <= '0;
      at       <= '1;
      known    <= '0;
      waits    <= 1'b0;
      csel_clk <= 1'b0;
      csel_din <= 1'b0;
      left     <= HALF_BITS'(HALF - 1);
    end
  end

  // A line is named before it starts, so that its data stand by then, and what leads to it lies within the chain.
  always_ff @(posedge clk) begin
    if (!reset) begin
      assert (!(start && (!waits || named || weighed)));
      assert (!rises || csel_din == data);
      assert (place <= 8'(COLUMNS) && pulses <= 8'(COLUMNS) && insert <= pulses);
    end
  end

endmodule
