// The sums by which two bytes at once go into a CRC-32C, and one into a CRC-32: of any CRC and any bytes they are what their
// division bit by bit leaves.
//
// A step of the division is linear, so that what steps leave of a word is the sum of what they leave of its bits.
module crc_proof
  import taxel_types::*;
(
    input logic        clk,
    input logic [31:0] crc,
    input logic [15:0] unit,
    input logic [31:0] other
);

  localparam logic [31:0] CRC_32C = 32'h82F63B78;
  localparam logic [31:0] CRC_32 = 32'hEDB88320;

  function automatic logic [31:0] step(logic [31:0] polynomial, logic [31:0] word);
    return {1'b0, word[31:1]} ^ (word[0] ? polynomial : 32'd0);
  endfunction

  // Of one bit: a constant.
  function automatic logic [31:0] left_by_8(logic [31:0] polynomial, logic [31:0] word);
    logic [31:0] c;
    c = word;
    for (int k = 0; k < 8; k++) c = step(polynomial, c);
    return c;
  endfunction

  logic [31:0] of_unit, of_byte, left_of_unit, left_of_byte;
  assign of_unit = crc ^ 32'(unit);
  assign of_byte = crc ^ 32'(unit[7:0]);

  always_comb begin
    left_of_unit = '0;
    left_of_byte = '0;
    // In the order in which they are added there: the solver finds the sums equal by their form.
    for (int k = 0; k < 32; k++) begin
      left_of_unit ^= {32{of_unit[(k+16)%32]}} & left_by_8(CRC_32C, left_by_8(CRC_32C, 32'd1 << ((k + 16) % 32)));
      left_of_byte ^= {32{of_byte[(k+8)%32]}} & left_by_8(CRC_32, 32'd1 << ((k + 8) % 32));
    end
    assert (crc_32c(crc, unit) == left_of_unit);
    assert (crc_32(crc, unit[7:0]) == left_of_byte);
    assert (step(CRC_32C, crc ^ other) == (step(CRC_32C, crc) ^ step(CRC_32C, other)));
    assert (step(CRC_32, crc ^ other) == (step(CRC_32, crc) ^ step(CRC_32, other)));
  end

endmodule
