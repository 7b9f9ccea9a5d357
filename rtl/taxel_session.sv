// The number of a session: the low 16 bits of the CRC-32C of the counts of the frame before time 0, each as two bytes, the low one
// first. Comparators' noise makes it differ from reset to reset.
//
// Throughput: a count a clock.
// Latency: two clocks from the last count.
// Loses nothing.
module taxel_session (
    input  logic        clk,
    input  logic        reset,
    input  logic        counted,
    input  logic [15:0] count,
    output logic [15:0] session
);

  import taxel_types::*;

  logic [31:0] crc, of_count;
  logic counted_before;

  // A CRC with two more bytes is a sum: of what becomes of its low 16 bits, of the others, and of what becomes of the
  // bytes.
  function automatic logic [31:0] of_word(logic [15:0] word);
    logic [31:0] sum;
    sum = '0;
    for (int k = 0; k < 16; k++) begin
      sum ^= {32{word[k]}} & crc_32c(crc_32c(32'd0, 8'(16'(1 << k))), 8'(16'(1 << k) >> 8));
    end
    return sum;
  endfunction

  assign session = ~crc[15:0];

  always_ff @(posedge clk) begin
    counted_before <= counted;
    of_count       <= of_word(count);
    if (counted_before) crc <= of_word(crc[15:0]) ^ 32'(crc[31:16]) ^ of_count;
    if (reset) begin
      counted_before <= 1'b0;
      crc            <= '1;
    end
  end

endmodule
