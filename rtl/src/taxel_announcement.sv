// Takes a pulse into another clock's domain: it becomes a bit that alternates, and its change a pulse there.
//
// What a pulse announces stands, in a `taxel_standing_word`, from the pulse's end until it was taken. How long the crossing takes
// differs by a clock of the other side, so nothing may hang on that.
//
// Throughput: a pulse every four clocks of the slower side.
// Latency: three clocks of the other side, or four where a change comes at an edge.
// Loses two pulses that come closer.
module taxel_announcement (
    input  logic clk_from,
    input  logic reset_from,
    input  logic announce,    // one clock
    output logic number,      // of the pulse, modulo 2
    input  logic clk_to,
    input  logic reset_to,
    output logic came         // one clock
);

  logic crossed, last;

  always_ff @(posedge clk_from) begin
    if (announce) number <= !number;
    if (reset_from) number <= 1'b0;
  end

  taxel_synchroniser crossing (.clk(clk_to), .from(number), .to(crossed));

  always_ff @(posedge clk_to) begin
    last <= crossed;
    came <= crossed != last;
    if (reset_to) {last, came} <= '0;
  end

endmodule
