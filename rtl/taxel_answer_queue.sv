// Answers that wait for the serial line.
module taxel_answer_queue
  import taxel_types::*;
#(
    parameter int DEPTH = 8
) (
    input  logic    clk,
    input  logic    reset,
    input  logic    answer,
    input  answer_t answered,
    output logic    room,    // for one more command, of which the answer comes four clocks later
    output logic    ready,
    output answer_t oldest,
    input  logic    pop
);

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

endmodule
