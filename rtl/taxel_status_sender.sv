// Status lines in ASCII: the greeting, the answers to commands, the totals, and which faults there were.
//
// A fault line gives the count since reset. Lines of faults come unasked, at most once in FAULT_CLOCKS, where no answer waits.
module taxel_status_sender
  import taxel_types::*;
#(
    parameter int COLUMNS = 64,
    parameter int ROWS = 64,
    parameter int CHANNELS = 16,
    parameter int FAULT_CLOCKS = 1_000_000
) (
    input  logic       clk,
    input  logic       reset,
    input  logic [1:0] version,    // of the wire that is spoken
    input  logic       ready,      // an answer waits
    input  answer_t    oldest,
    output logic       pop,
    input  count_t     lost,       // counts of which a changed one is given unasked
    input  count_t     faults,
    input  count_t     commands,
    input  totals_t    totals,
    output logic       valid,      // a byte for the serial line
    output logic [7:0] data,
    input  logic       taken
);

  // The counts of faults, and as they were given last.
  count_t counts[3], given[3];
  logic [2:0] differs;  // from what was given, a clock ago
  assign counts = '{lost, faults, commands};

  typedef enum logic [1:0] {
    IDLE,
    DIGITS,   // a count becomes digits, a bit a clock
    LETTER,   // a character is looked up
    SENDING   // and waits for the serial line
  } state_t;

  state_t state;
  logic counting;        // the line is of counts
  logic greeted;
  logic [2:0] part;      // a name and a count
  logic [2:0] look;      // which faults are still to be looked at
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
  function automatic logic [7:0] numeral(int number, logic [5:0] k);
    int digits_of;
    digits_of = number >= 100 ? 3 : number >= 10 ? 2 : 1;
    if (32'(k) >= digits_of) return 8'd0;
    case (digits_of - 1 - 32'(k))
      0: return 8'h30 + 8'(number % 10);
      1: return 8'h30 + 8'(number / 10 % 10);
      default: return 8'h30 + 8'(number / 100);
    endcase
  endfunction

  // The characters of each line; 0 is none, and is left out.
  localparam logic [0:12][7:0] BOARD = "taxel-board v";
  localparam logic [0:2][7:0] OK = "ok ";
  localparam logic [0:3][7:0] BAD = "bad ";
  localparam logic [0:2][7:0] REG = "REG";
  localparam logic [0:5][7:0] RULE = " rule ";
  localparam int NAME = 17;
  localparam logic [0:7][0:NAME-1][7:0] NAMES = {
    {"fault queue ", 40'd0}, "fault comparator ", {"fault command ", 24'd0},
    {"status frames=", 24'd0}, {" events=", 72'd0}, {" dropped=", 64'd0}, {" datagrams=", 48'd0}, {" faults=", 72'd0}
  };
  logic [7:0] character, letter;
  logic last, letter_last;
  logic zeros;  // only zeros so far

  always_comb begin
    character = 8'd0;
    last = 1'b0;
    if (counting) begin
      if (at < 6'(NAME)) character = NAMES[part][5'(at)];
      else if (at < 6'(NAME + COUNT_DIGITS)) begin
        if (digits[COUNT_DIGITS-1] != 0 || !zeros || at == 6'(NAME + COUNT_DIGITS - 1))
          character = hex(digits[COUNT_DIGITS-1]);
      end else last = 1'b1;
    end else begin
      case (line.kind)
        ANSWER_GREETING: begin
          if (at < 6'd13) character = BOARD[at[3:0]];
          else if (at == 6'd13) character = 8'h31 + 8'(version);
          else if (at == 6'd14) character = " ";
          else if (at < 6'd18) character = numeral(ROWS, at - 6'd15);
          else if (at == 6'd18) character = "x";
          else if (at < 6'd22) character = numeral(COLUMNS, at - 6'd19);
          else if (at == 6'd22) character = " ";
          else if (at < 6'd26) character = numeral(CHANNELS, at - 6'd23);
          else if (at == 6'd26) character = "c";
          else if (at == 6'd27) character = "h";
          else last = 1'b1;
        end
        ANSWER_OK: begin
          if (at < 6'd3) character = OK[at[1:0]];
          else if (at < 6'd6) character = REG[2'(at - 6'd3)];
          else if (at == 6'd6) character = hex({1'b0, line.number});
          else if (at == 6'd7) character = "=";
          else if (at == 6'd8) character = "0";
          else if (at == 6'd9) character = "x";
          else if (at < 6'd18) character = hex(line.value[31:28]);
          else last = 1'b1;
        end
        default: begin
          if (at < 6'd4) character = BAD[at[1:0]];
          else if (at < 6'd7) character = REG[2'(at - 6'd4)];
          else if (at == 6'd7) character = hex({1'b0, line.number});
          else if (at < 6'd14) character = RULE[3'(at - 6'd8)];
          else if (at == 6'd14) character = hex(line.value[3:0]);
          else last = 1'b1;
        end
      endcase
    end
    if (last) character = 8'h0A;
  end

  assign valid = state == SENDING && letter != 8'd0;
  assign data  = letter;
  assign pop   = state == IDLE && greeted && ready;

  always_ff @(posedge clk) begin
    if (look_again) look <= 3'b111;
    for (int k = 0; k < 3; k++) differs[k] <= counts[k] != given[k];
    case (state)
      IDLE: begin
        at        <= '0;
        counting  <= 1'b0;
        bits_left <= 6'(COUNT_BITS);
        if (!greeted) begin
          greeted   <= 1'b1;
          line.kind <= ANSWER_GREETING;
          state     <= LETTER;
        end else if (ready) begin
          line  <= oldest;
          state <= LETTER;
          if (oldest.kind == ANSWER_STATUS) begin
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
        digits    <= doubled(bits_left == 6'(COUNT_BITS) ? '0 : digits, bits[COUNT_BITS-1]);
        bits      <= bits << 1;
        bits_left <= bits_left - 6'd1;
        if (bits_left == 6'd1) state <= LETTER;
      end
      LETTER: begin
        letter      <= character;
        letter_last <= last;
        state       <= SENDING;
        if (counting && last && part >= 3'd3 && part != 3'd7) begin
          // The line's next count.
          at           <= '0;
          bits_left    <= 6'(COUNT_BITS);
          part         <= part + 3'd1;
          {bits, rest} <= {rest, count_t'(0)};
          state        <= DIGITS;
        end
      end
      default: begin
        if (taken || letter == 8'd0) begin
          at    <= at + 6'd1;
          state <= letter_last ? IDLE : LETTER;
          if (!counting && line.kind == ANSWER_OK && at >= 6'd10) line.value <= line.value << 4;
          if (counting && at >= 6'(NAME)) begin
            if (letter != 8'd0) zeros <= 1'b0;
            digits <= digits << 4;
          end
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
