// All channels of the converter and the timer that they share: raises the ramp for a read, and hands over what was counted.
//
// The scan's clock and the fast one are of one PLL, but nothing here rests on their phase: single bits that alternate from read
// to read cross through two flip-flops, and what they announce stands still meanwhile. Counting begins with the ramp in the
// fast clock's own domain, so how long a crossing takes plays no part in a count.
//
// Throughput: a read at a time; the next one may follow at once.
// Latency: a read is reported before the next one ends.
// Loses a read whose ramp does not fall for a clock after the one before: rule 3 of the registers keeps 5 ticks for that.
module taxel_comparator_array #(
    parameter int CHANNELS = 16,
    parameter int DELAY = 2
) (
    input  logic                     clk,
    input  logic                     reset,
    input  logic                     read_start,
    input  logic                     step_end,
    input  logic [15:0]              length,      // of the ramp, in ticks; at a read's start
    input  logic                     inverted,    // comparators fall when they trip; at a read's start
    output logic                     read_done,   // the counts of the read that ended last stand from here to the next one
    output logic [CHANNELS-1:0]      tripped,
    output logic [CHANNELS-1:0]      first,       // at the first sample of the pair
    output logic [CHANNELS-1:0][14:0] at,         // the pair of samples
    input  logic                     clk_fast,
    input  logic [CHANNELS-1:0][1:0] comparators, // samples of the first and second half of a clock
    output logic [1:0]               ramp
);

  localparam int BANK = 8;  // channels

  // On the scan's clock: the number of the read that began last, and of the one that ended last, modulo 2.
  logic began, ended;

  always_ff @(posedge clk) begin
    if (step_end) ended <= began;
    if (reset) ended <= 1'b0;
  end

  // On the fast clock.
  logic reset_fast, ended_fast, number, copied, over, copy, reported;
  wire unused = reported;
  logic start, nears, begins, begun, open, closing, inverted_held, inverted_now;
  logic [15:0] length_held;
  logic [DELAY-1:0] senses;
  logic [CHANNELS-1:0][1:0] sampled, brought;
  logic [CHANNELS-1:0] tripped_now, first_now;
  logic [CHANNELS-1:0][14:0] at_now;

  taxel_synchroniser to_reset (.clk(clk_fast), .from(reset), .to(reset_fast));
  taxel_synchroniser to_ended (.clk(clk_fast), .from(ended), .to(ended_fast));

  // What a read asks for stands until the next one, four clocks later or more: the fast clock takes it when a short one has ended.
  taxel_announcement to_start (
      .clk_from(clk), .reset_from(reset), .announce(read_start), .number(began),
      .clk_to(clk_fast), .reset_to(reset_fast), .came(start)
  );
  taxel_standing_word #(.BITS(17)) asked (
      .clk, .take(read_start), .word({inverted, length}), .stands({inverted_held, length_held})
  );
  taxel_announcement to_done (
      .clk_from(clk_fast), .reset_from(reset_fast), .announce(copy), .number(reported),
      .clk_to(clk), .reset_to(reset), .came(read_done)
  );

  // The counts of a read are copied when it has ended and the samples of its ramp are over, or at the latest when the next
  // read's begin: then in the clock of its pair 0, which changes them at that clock's end.
  assign over = !copied && ((ended_fast == number && !open && !begun) || begins);

  always_ff @(posedge clk_fast) begin
    // It holds from a clock before a read's first samples on, and the next read may have started by then.
    senses       <= {senses[DELAY-2:0], start ? inverted_held : senses[0]};
    inverted_now <= senses[DELAY-1];
    // Pins lie all around a part: samples have a clock to come from there, and one more to spread.
    sampled <= comparators;
    brought <= sampled ^ {2 * CHANNELS{inverted_now}};
    copy    <= over;
    if (over) copied <= 1'b1;
    if (begins) begin
      number <= !number;
      copied <= 1'b0;
    end
    if (reset_fast) begin
      {number, copy} <= '0;
      copied <= 1'b1;
    end
  end

  taxel_ramp_counter #(.DELAY(DELAY + 1)) counter (
      .clk_fast,
      .reset(reset_fast),
      .start,
      .length(length_held),
      .ramp,
      .nears,
      .begins,
      .begun,
      .open,
      .closing
  );

  // Channels lie far apart, so each bank of them has its own count of pairs, and its own registers for what all do at
  // once. That these wait for their own fall changes nothing, as they stand for one clock; it keeps synthesis from
  // merging them. Only `closing` may stand for two: where a ramp's samples end as those of a ramp of one tick begin.
  for (genvar b = 0; b < CHANNELS / BANK; b++) begin : g_bank
    logic begins_here, closes_here, copies_here;
    logic [14:0] pair;

    always_ff @(posedge clk_fast) begin
      begins_here <= nears && !begins_here;
      closes_here <= closing && (begins || !closes_here);
      copies_here <= over && !copies_here;
      pair        <= begins_here ? '0 : pair + 15'd1;
      if (reset_fast) {begins_here, closes_here, copies_here} <= '0;
    end

    taxel_standing_word #(.BITS(17 * BANK)) counts (
        .clk(clk_fast),
        .take(copies_here),
        .word({tripped_now[b*BANK+:BANK], first_now[b*BANK+:BANK], at_now[b*BANK+:BANK]}),
        .stands({tripped[b*BANK+:BANK], first[b*BANK+:BANK], at[b*BANK+:BANK]})
    );

    for (genvar c = b * BANK; c < (b + 1) * BANK; c++) begin : g_column
      taxel_comparator_column column (
          .clk_fast,
          .begins(begins_here),
          .closes(closes_here),
          .pair,
          .sample(brought[c]),
          .tripped(tripped_now[c]),
          .first(first_now[c]),
          .at(at_now[c])
      );
    end
  end

  // Each read is reported before the next one ends.
  logic unreported;
  always_ff @(posedge clk) begin
    unreported <= !reset && (step_end || (unreported && !read_done));
    if (!reset) assert (!(step_end && unreported && !read_done));
  end

endmodule
