// Bytes to the serial line: 8 bits, no parity, one stop bit, CLOCKS clocks a bit.
//
// Throughput: a byte every 10 x CLOCKS + 1 clocks.
// Latency: its start bit begins a clock after it is taken.
// Loses nothing: `ready` is low while a byte goes.
module taxel_uart_tx #(
    parameter int CLOCKS = 868
) (
    input  logic       clk,
    input  logic       reset,
    input  logic       valid,
    input  logic [7:0] data,
    output logic       ready,
    output logic       tx
);

  localparam int BITS = $clog2(CLOCKS + 1);

  logic [9:0] shift;
  logic [3:0] bits;  // how many are still to go
  logic [BITS-1:0] left;

  assign tx = shift[0];

  always_ff @(posedge clk) begin
    if (ready) begin
      left <= BITS'(CLOCKS);
      if (valid) begin
        shift <= {1'b1, data, 1'b0};
        bits  <= 4'd10;
        ready <= 1'b0;
      end
    end else if (left == BITS'(1)) begin
      left  <= BITS'(CLOCKS);
      shift <= {1'b1, shift[9:1]};
      bits  <= bits - 4'd1;
      ready <= bits == 4'd1;
    end else begin
      left <= left - BITS'(1);
    end
    if (reset) begin
      shift <= '1;
      bits  <= '0;
      ready <= 1'b1;
    end
  end

  always_ff @(posedge clk) if (!reset) assert (ready == (bits == 4'd0) && bits <= 4'd10);

endmodule
