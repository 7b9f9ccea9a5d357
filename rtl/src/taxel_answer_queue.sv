// Answers that wait for the serial line.
//
// Throughput: an answer a clock.
// Latency: an answer stands at the output a clock after it came.
// Loses nothing: it says whether there is room before a command is judged. The register file refuses and counts the others.
module taxel_answer_queue #(
    parameter int DEPTH = 8
) (
    input  logic                 clk,
    input  logic                 reset,
    input  logic                 answer,
    input  taxel_types::answer_t answered,
    output logic                 room,      // for one more command, of which the answer comes four clocks later
    output logic                 ready,
    output taxel_types::answer_t oldest,
    input  logic                 pop
);

  import taxel_types::*;

  localparam int PLACES = $clog2(DEPTH);

  answer_t waiting[DEPTH];
  logic [PLACES-1:0] write, read;
  logic [PLACES:0] count;

  assign ready  = count != 0;
  assign oldest = waiting[read];
  // Commands come many clocks apart, so an answer on its way is here before the next one.
  assign room   = count != (PLACES + 1)'(DEPTH);

  always_ff @(posedge clk) begin
    if (answer) begin
      waiting[write] <= answered;
      write <= write + PLACES'(1);
    end
    if (pop) read <= read + PLACES'(1);
    count <= count + (PLACES + 1)'(answer) - (PLACES + 1)'(pop);
    if (reset) begin
      write <= '0;
      read  <= '0;
      count <= '0;
    end
  end

  // It neither overflows nor underflows.
  always_ff @(posedge clk) if (!reset) assert (!(answer && !room) && !(pop && !ready));

endmodule
