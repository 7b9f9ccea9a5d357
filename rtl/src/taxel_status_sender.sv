// Status lines in ASCII: the greeting, the answers to commands, the totals, and which faults there were.
//
// A fault line gives the count since reset. Lines of faults come unasked, at most once in FAULT_CLOCKS, where no answer waits.
//
// Throughput: a character in fewer clocks than the serial line takes for one.
// Latency: an answer waits for the line before it.
// Loses nothing: a count that changed several times is given as it stands then.
module taxel_status_sender #(
    parameter int COLUMNS = 64,
    parameter int ROWS = 64,
    parameter int CHANNELS = 16,
    parameter int FAULT_CLOCKS = 1_000_000
) (
    input  logic                 clk,
    input  logic                 reset,
    input  logic [1:0]           version,   // of the wire that is spoken
    input  logic                 ready,     // an answer waits
    input  taxel_types::answer_t oldest,
    output logic                 pop,
    input  taxel_types::count_t  lost,      // counts of which a changed one is given unasked
    input  taxel_types::count_t  faults,
    input  taxel_types::count_t  commands,
    input  taxel_types::totals_t totals,
    output logic                 valid,     // a byte for the serial line
    output logic [7:0]           data,
    input  logic                 taken
);

  import taxel_types::*;

  // The counts of faults, and as they were given last.
  count_t counts[3], given[3];
  logic [2:0] differs;  // from what was given, a clock ago
  assign counts = '{lost, faults, commands};

  typedef enum logic [2:0] {
    IDLE,
    DIGITS,   // a count becomes digits, a bit a clock
    LOOK,     // a character is looked up for each kind of line
    LETTER,   // that of this kind is taken
    SENDING,  // and waits for the serial line
    NEXT      // the next one is turned to, a clock later: when the line is ready is known late in a clock
  } state_t;

  state_t state;
  logic counting;        // the line is of counts
  logic greeted;
  logic waits;           // an answer does, since a clock
  logic [2:0] part;      // a name and a count
  logic [2:0] look;      // which faults are still to be looked at
  answer_t waiting;      // it, or what stood there
  answer_t line;
  logic [5:0] at;        // character of the line
  count_t bits;
  count_t [3:0] rest;    // of the line, from the top
  logic [5:0] bits_left;
  logic [COUNT_DIGITS-1:0][3:0] digits;
  logic look_again;

  taxel_clock_div #(.PERIOD(FAULT_CLOCKS)) pace (.clk, .restart(reset), .pulse(look_again));

  function automatic logic [7:0] hex(logic [3:0] digit);
    return digit < 4'd10 ? 8'h30 + 8'(digit) : 8'h37 + 8'(digit);
  endfunction

  function automatic logic [COUNT_DIGITS-1:0][3:0] doubled(logic [COUNT_DIGITS-1:0][3:0] of, logic carry);
    logic [COUNT_DIGITS-1:0][3:0] sum;
    for (int k = 0; k < COUNT_DIGITS; k++) sum[k] = of[k] >= 4'd5 ? of[k] + 4'd3 : of[k];
    return {sum[COUNT_DIGITS-1:0]} << 1 | (4 * COUNT_DIGITS)'(carry);
  endfunction

  // A number of at most three digits, of the array or its channels: its digits from the left.
  function automatic logic [23:0] numerals(int number);
    logic [23:0] three;
    three = {8'h30 + 8'(number / 100), 8'h30 + 8'(number / 10 % 10), 8'h30 + 8'(number % 10)};
    return number >= 100 ? three : number >= 10 ? three << 8 : three << 16;
  endfunction

  // The characters of each line; 0 is none, and is left out.
  localparam int NAME = 17;
  localparam logic [0:7][0:NAME-1][7:0] NAMES = {
    {"fault queue ", 40'd0}, "fault comparator ", {"fault command ", 24'd0},
    {"status frames=", 24'd0}, {" events=", 72'd0}, {" dropped=", 64'd0}, {" datagrams=", 48'd0}, {" faults=", 72'd0}
  };
  typedef struct packed {
    logic last;
    logic [7:0] character;
  } symbol_t;

  localparam symbol_t END = '{last: 1'b1, character: 8'h0A};

  function automatic symbol_t plain(logic [7:0] character);
    return '{last: 1'b0, character: character};
  endfunction

  typedef symbol_t [0:63] text_t;

  // A text of so many characters, which its end follows.
  function automatic text_t ended(logic [0:31][7:0] characters, int length);
    text_t text;
    for (int k = 0; k < 64; k++) text[k] = k < length ? plain(characters[k[4:0]]) : END;
    return text;
  endfunction

  // The texts of a greeting and of answers: what differs from line to line is put in where 0 stands.
  localparam text_t GREETING = ended({"taxel-board v", 8'd0, " ", numerals(ROWS), "x", numerals(COLUMNS), " ",
                                      numerals(CHANNELS), "ch", 32'd0}, 28);
  localparam text_t OK = ended({"ok REG", 8'd0, "=0x", 176'd0}, 18);
  localparam text_t BAD = ended({"bad REG", 8'd0, " rule ", 144'd0}, 15);

  symbol_t of_counts, of_greeting, of_ok, of_bad, symbol;
  logic [7:0] letter;
  logic letter_last;
  logic zeros;    // only zeros so far
  logic further;  // a count of the line follows
  logic in_number, in_value;  // `at` lies in a count, in an answer's value

  always_ff @(posedge clk) begin
    if (at < 6'(NAME)) of_counts <= plain(NAMES[part][5'(at)]);
    else if (at == 6'(NAME + COUNT_DIGITS)) of_counts <= END;
    else if (digits[COUNT_DIGITS-1] != 0 || !zeros || at == 6'(NAME + COUNT_DIGITS - 1))
      of_counts <= plain(hex(digits[COUNT_DIGITS-1]));
    else of_counts <= plain(8'd0);

    of_greeting <= GREETING[at];
    if (at == 6'd13) of_greeting.character <= 8'h31 + 8'(version);

    of_ok <= OK[at];
    if (at == 6'd6) of_ok.character <= hex({1'b0, line.number});
    else if (at >= 6'd10 && at < 6'd18) of_ok.character <= hex(line.value[31:28]);

    of_bad <= BAD[at];
    if (at == 6'd7) of_bad.character <= hex({1'b0, line.number});
    else if (at == 6'd14) of_bad.character <= hex(line.value[3:0]);
  end

  always_comb begin
    case (line.kind)
      ANSWER_GREETING: symbol = of_greeting;
      ANSWER_OK: symbol = of_ok;
      default: symbol = of_bad;
    endcase
    if (counting) symbol = of_counts;
  end

  assign valid = state == SENDING && letter != 8'd0;
  assign data  = letter;
  assign pop   = state == IDLE && greeted && waits;

  always_ff @(posedge clk) begin
    // It is not popped before many clocks later.
    waits   <= ready;
    waiting <= oldest;
    if (look_again) look <= 3'b111;
    for (int k = 0; k < 3; k++) differs[k] <= counts[k] != given[k];
    further <= part >= 3'd3 && part != 3'd7;
    // `at` stays from before LOOK until NEXT.
    in_number <= counting && at >= 6'(NAME);
    in_value  <= !counting && line.kind == ANSWER_OK && at >= 6'd10;
    case (state)
      IDLE: begin
        at        <= '0;
        counting  <= 1'b0;
        digits    <= '0;
        bits_left <= 6'(COUNT_BITS);
        if (!greeted) begin
          greeted   <= 1'b1;
          line.kind <= ANSWER_GREETING;
          state     <= LOOK;
        end else if (waits) begin
          line  <= waiting;
          state <= LOOK;
          if (waiting.kind == ANSWER_STATUS) begin
            counting     <= 1'b1;
            part         <= 3'd3;
            {bits, rest} <= totals;
            state        <= DIGITS;
          end
        end else if (look != 0) begin
          // One fault a clock.
          part <= look[0] ? 3'd0 : look[1] ? 3'd1 : 3'd2;
          look <= look & (look - 3'd1);
          for (int k = 2; k >= 0; k--) begin
            if (look[k] && (look & 3'((1 << k) - 1)) == 0 && differs[k]) begin
              counting <= 1'b1;
              bits     <= counts[k];
              given[k] <= counts[k];
              state    <= DIGITS;
            end
          end
        end
      end
      DIGITS: begin
        zeros     <= 1'b1;
        digits    <= doubled(digits, bits[COUNT_BITS-1]);
        bits      <= bits << 1;
        bits_left <= bits_left - 6'd1;
        if (bits_left == 6'd1) state <= LOOK;
      end
      LOOK: state <= LETTER;
      LETTER: begin
        letter      <= symbol.character;
        letter_last <= symbol.last;
        state       <= SENDING;
        if (counting && of_counts.last && further) begin
          // The line's next count.
          at           <= '0;
          bits_left    <= 6'(COUNT_BITS);
          part         <= part + 3'd1;
          {bits, rest} <= {rest, rest[0]};
          state        <= DIGITS;
        end
      end
      SENDING: if (taken || letter == 8'd0) state <= NEXT;
      default: begin  // NEXT
        at    <= at + 6'd1;
        state <= letter_last ? IDLE : LOOK;
        if (in_value) line.value <= line.value << 4;
        if (in_number) begin
          if (letter != 8'd0) zeros <= 1'b0;
          digits <= digits << 4;
        end
      end
    endcase
    if (reset) begin
      state   <= IDLE;
      greeted <= 1'b0;
      look    <= '0;
      for (int k = 0; k < 3; k++) given[k] <= '0;
    end
  end

endmodule
