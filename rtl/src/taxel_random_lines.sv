// Which line is driven next: one after the other, or in a random order that is drawn line by line.
//
// The order of a frame of n lines begins as 0 to n - 1. Line k of the frame, except the last one, swaps places k and
// k + (word x (n - k) >> 16), where `word` is the shift register 16 shifts on; then place k is driven. The shift register has
// 16 bits, begins at 0xACE1 at reset and runs on from frame to frame: its new top bit is the sum modulo 2 of bits 0, 2, 3 and 5.
//
// Throughput: a line every 7 clocks.
// Latency: 7 clocks.
// Loses nothing: lines come at least 26 clocks apart.
module taxel_random_lines (
    input  logic       clk,
    input  logic       reset,
    input  logic       next,    // asks for the next line; it stands in `line` 7 clocks later
    input  logic       first,   // which is the first of a frame
    input  logic       random,
    input  logic [7:0] lines,   // of the frame, less one
    output logic [6:0] line
);

  function automatic logic [15:0] drawn(logic [15:0] word);
    logic [15:0] w;
    w = word;
    for (int k = 0; k < 16; k++) w = {w[0] ^ w[2] ^ w[3] ^ w[5], w[15:1]};
    return w;
  endfunction

  (* ram_style = "distributed" *)  // a block answers late, and gates take the answer
  logic [6:0] places[128];
  logic [127:0] swapped;  // where the order differs from the line's own number
  logic [15:0] word;
  logic [23:0] product;
  logic [6:0] k, place, of_place, of_k, at_place, at_k;
  logic swapped_place, swapped_k;
  logic [5:0] stage;
  logic shuffles;
  logic [7:0] left;  // places from k on

  always_ff @(posedge clk) begin
    stage   <= {stage[4:0], next};
    left    <= lines + 8'd1 - 8'(k);
    product <= 24'(word) * 24'(left);
    place   <= shuffles ? k + 7'(product[23:16]) : k;
    of_place      <= places[place];
    of_k          <= places[k];
    swapped_place <= swapped[place];
    swapped_k     <= swapped[k];
    at_place      <= swapped_place ? of_place : place;
    at_k          <= swapped_k ? of_k : k;
    if (next) begin
      k <= first ? 7'd0 : k + 7'd1;
      if (first) swapped <= '0;
    end
    if (stage[0]) begin
      // In the meantime k stands; the last line of a frame has no choice.
      shuffles <= random && 8'(k) != lines;
    end
    if (stage[4] && shuffles) swapped[place] <= 1'b1;
    if (stage[5] && shuffles) places[place] <= at_k;
    if (stage[5]) line <= at_place;
    if (reset) begin
      word  <= 16'hACE1;
      stage <= '0;
      line  <= '0;
    end else if (stage[0] && random && 8'(k) != lines) begin
      word <= drawn(word);
    end
  end

  // A line is asked for when the one before is known.
  always_ff @(posedge clk) if (!reset) assert (!(next && stage != '0));

endmodule
