// A register in a stream, and one more for what comes while it waits: neither side's signals pass through in a clock.
//
// Throughput: a word a clock.
// Latency: a clock.
// Loses nothing: while the output waits, the input does a clock later.
module taxel_stream_register #(
    parameter int BITS = 8
) (
    input  logic            clk,
    input  logic            reset,
    input  logic            valid_in,
    output logic            ready_in,
    input  logic [BITS-1:0] data_in,
    output logic            valid_out,
    input  logic            ready_out,
    output logic [BITS-1:0] data_out
);

  logic [BITS-1:0] second;  // holds what came last, where the first is full: then nothing more is let in

  always_ff @(posedge clk) begin
    if (ready_out || !valid_out) begin
      // What waits goes first.
      valid_out <= valid_in || !ready_in;
      data_out  <= ready_in ? data_in : second;
      ready_in  <= 1'b1;
    end else if (valid_in && ready_in) begin
      ready_in <= 1'b0;
    end
    if (ready_in) second <= data_in;
    if (reset) begin
      valid_out <= 1'b0;
      ready_in  <= 1'b1;
    end
  end

  // What is offered, to it and by it, stands until it is taken.
  logic waits_in, waits_out;
  logic [BITS-1:0] waiting_in, waiting_out;
  always_ff @(posedge clk) begin
    waits_in    <= valid_in && !ready_in && !reset;
    waits_out   <= valid_out && !ready_out && !reset;
    waiting_in  <= data_in;
    waiting_out <= data_out;
    if (!reset && waits_in) assert (valid_in && data_in == waiting_in);
    if (!reset && waits_out) assert (valid_out && data_out == waiting_out);
  end

endmodule
