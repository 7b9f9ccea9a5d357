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

  assign session = ~crc[15:0];

  always_ff @(posedge clk) begin
    counted_before <= counted;
    // The CRC with two more bytes is a sum of what becomes of it and of them.
    of_count       <= crc_32c(32'd0, count);
    if (counted_before) crc <= crc_32c(crc, 16'd0) ^ of_count;
    if (reset) begin
      counted_before <= 1'b0;
      crc            <= '1;
    end
  end

endmodule
