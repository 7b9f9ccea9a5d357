// A memory that is written on one clock and read on another one: a place is read only while it stands, which a bit that crosses
// tells.
//
// Throughput: a word a clock on either side.
// Latency: a clock from a place to its word.
// Loses a word that the next one replaces before it was read: who tells the other side sees to that.
module taxel_two_clock_memory #(
    parameter int BITS = 8,
    parameter int PLACES = 10  // bits of a place
) (
    input  logic              clk_write,
    input  logic              write,
    input  logic [PLACES-1:0] at_write,
    input  logic [BITS-1:0]   word_written,
    input  logic              clk_read,
    input  logic [PLACES-1:0] at_read,
    output logic [BITS-1:0]   word_read
);

  logic [BITS-1:0] words[2**PLACES];

  always_ff @(posedge clk_write) if (write) words[at_write] <= word_written;
  always_ff @(posedge clk_read) word_read <= words[at_read];

endmodule
