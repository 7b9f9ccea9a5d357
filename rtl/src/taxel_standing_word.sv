// Holds a word for another clock's domain: it is read there only while it stands, which a bit that crosses tells.
//
// Synthesis keeps the registers, so that a crossing can be found.
//
// Throughput: a word a clock of its own side; the other side reads it later.
// Latency: a clock.
// Loses a word that the next one replaces before it was read: who tells the other side sees to that.
module taxel_standing_word #(
    parameter int BITS = 8
) (
    input  logic            clk,
    input  logic            take,
    input  logic [BITS-1:0] word,
    output logic [BITS-1:0] stands
);

  (* keep *) logic [BITS-1:0] held;
  assign stands = held;

  always_ff @(posedge clk) if (take) held <= word;

endmodule
