// The number of a session: the low 16 bits of the CRC-32C of the counts of the frame before time 0, each as two bytes, the low one
// first. Comparators' noise makes it differ from reset to reset.
module taxel_session
  import taxel_types::*;
(
    input  logic        clk,
    input  logic        reset,
    input  logic        counted,
    input  logic [15:0] count,
    output logic [15:0] session
);

  logic [31:0] crc;
  logic counted_before;
  logic [15:0] count_before;

  assign session = ~crc[15:0];

  always_ff @(posedge clk) begin
    counted_before <= counted;
    count_before   <= count;
    if (counted_before) crc <= crc_32c(crc_32c(crc, count_before[7:0]), count_before[15:8]);
    if (reset) begin
      counted_before <= 1'b0;
      crc            <= '1;
    end
  end

endmodule
