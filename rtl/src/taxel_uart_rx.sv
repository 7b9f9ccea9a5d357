// Bytes from the serial line: 8 bits, no parity, one stop bit, CLOCKS clocks a bit. The line is of no clock. A start bit is
// sampled in its middle too: a shorter pulse is none.
//
// Throughput: a byte in ten bits.
// Latency: a byte stands 1 to 2 clocks after the middle of its stop bit (half a clock less where CLOCKS is odd).
// Loses a byte without a stop bit, which is told once, however long the line is held low (`broken`).
module taxel_uart_rx #(
    parameter int CLOCKS = 868
) (
    input  logic       clk,
    input  logic       reset,
    input  logic       rx,
    output logic       valid,
    output logic [7:0] data,
    output logic       broken  // as valid, for a byte without a stop bit
);

  if (CLOCKS < 4) begin : g_clocks
    $error("CLOCKS: at least 4");
  end

  localparam int BITS = $clog2(CLOCKS + 1);

  logic line, busy;
  logic low;  // since a byte without a stop bit
  logic [BITS-1:0] left;
  logic [3:0] bits;  // how many are still to come, with the start and the stop bit

  taxel_synchroniser settle (.clk, .from(rx), .to(line));

  always_ff @(posedge clk) begin
    valid  <= 1'b0;
    broken <= 1'b0;
    left   <= left - BITS'(1);
    if (line) low <= 1'b0;
    if (!busy) begin
      // From the start bit's edge to its middle.
      left <= BITS'(CLOCKS / 2 - 1);
      bits <= 4'd10;
      busy <= !line && !low;
    end else if (left == BITS'(1)) begin
      left <= BITS'(CLOCKS);
      bits <= bits - 4'd1;
      if (bits == 4'd10) begin
        busy <= !line;
      end else if (bits == 4'd1) begin
        busy   <= 1'b0;
        valid  <= line;
        broken <= !line;
        low    <= !line;
      end else begin
        data <= {line, data[7:1]};
      end
    end
    if (reset) {busy, low, valid, broken} <= '0;
  end

  always_ff @(posedge clk) if (!reset) assert (!busy || (bits != 4'd0 && bits <= 4'd10));

endmodule
