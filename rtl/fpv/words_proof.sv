// The bodies of version 2, whatever entries come and whenever the link is ready: read as the page of version 2 says,
// with the header that follows, they give the events that were taken, each once, in their order, with their times and
// values; and a marker as it was taken. No datagram holds an event that is earlier than what one before it promised.
//
// All kinds of bodies come by turns: without spikes events have no values here. Widths and lengths are those of a board
// of 128 rows. Entries come in the order of their times.
module words_proof
  import taxel_types::*;
#(
    parameter bit LEMMAS = 1'b1
) (
    input logic        clk,
    input logic        valid,
    input event_t      entry,
    input logic        leaving,
    input logic        states_ready,
    input logic [6:0]  repeated_line,
    input logic [15:0] value_repeated,
    input totals_t     totals,
    input logic        sending
);

  localparam int ROWS = 128;
  localparam int STRIDE = 7;
  localparam micros_t LATEST = 48'd32_511;

  // The packer's states, by their numbers.
  typedef enum logic [3:0] {
    IDLE, WEIGH, PLACE, WRITE, CLOSE, BEYOND, OVER, BEAT, REPEAT, TOTALS, SEND, NEXT, AGE
  } state_t;
  state_t state, after;

  logic begun = 1'b0;
  logic write, send, taken;
  logic [15:0] unit;
  datagram_t datagram;

  taxel_packer_v2 #(.ROWS(ROWS), .VALUED(1'b0), .HOLD_US(1000)) packer (
      .clk, .reset(!begun), .valid, .entry, .taken, .leaving, .idle(), .states_ready, .repeated_line, .row_repeated(),
      .value_repeated, .states_sent(), .totals, .totals_sent(), .write, .bank(), .place(), .unit, .send, .datagram,
      .sending
  );

  assign state = state_t'(4'(packer.state));
  assign after = state_t'(4'(packer.after));

  // What was taken and has not been read yet: an event, or a marker. It is taken a clock before the last unit of the one
  // before is written, and so is expected a clock later.
  event_t coming, expected;
  logic comes, event_waits, marker_waits;

  // A body is of events, of a marker, or of what is repeated. Of events it is read from its first unit on with the
  // kind, the base and the line of its first event, and the header must then say the same.
  typedef enum logic [1:0] {EMPTY, EVENTS, MARKER, REPEATED} body_t;
  typedef struct packed {
    body_t body;
    logic [1:0] kind;
    micros_t base;
    logic [6:0] line;
    logic half;          // a word's first unit was read
    logic [15:0] low;
    logic offset;        // the next word is an offset
    micros_t at;
    logic [31:0] place;  // the position after the last one
    logic [2:0] words;   // units of a marker
  } reader_t;
  reader_t held, begins, read;
  logic [15:0] skip, value, word;
  logic up, whole, finds, ones, sends_marker;
  logic [31:0] position;
  micros_t promised, newest;
  logic any_again, any_jump;

  function automatic logic [1:0] kind_of(format_t f);
    return !f.spikes ? 2'd0 : f.wide_values ? 2'd2 : 2'd1;
  endfunction

  always_comb begin
    begins = held;
    if (held.body == EMPTY) begin
      begins       = '0;
      begins.body  = event_waits ? EVENTS : marker_waits ? MARKER : REPEATED;
      begins.kind  = kind_of(expected.format);
      begins.base  = expected.at;
      begins.line  = expected.x;
      begins.at    = expected.at;
      begins.place = 32'(expected.x) << STRIDE;
    end
    // A word, and its parts.
    whole = begins.kind != 2'd2 || begins.half;
    word  = unit;
    up    = word[15];
    skip  = begins.kind == 2'd1 ? 16'(word[14:8]) : 16'(word[14:0]);
    value = begins.kind == 2'd0 ? 16'd0 : begins.kind == 2'd1 ? 16'(word[7:0]) : begins.low;
    ones  = skip == (begins.kind == 2'd1 ? 16'h7F : 16'h7FFF);
    finds = write && begins.body == EVENTS && whole && !begins.offset && !ones;
    position = begins.place + 32'(skip);
    // The reader after this unit.
    read = held;
    if (write) begin
      read = begins;
      read.words = begins.words == 3'd7 ? 3'd7 : begins.words + 3'd1;
      if (begins.body == EVENTS) begin
        read.half = begins.kind == 2'd2 && !begins.half;
        read.low  = unit;
        if (whole) begin
          read.offset = 1'b0;
          if (begins.offset)
            read.at = begins.base + micros_t'(begins.kind == 2'd2 ? {word, begins.low} : {16'd0, word});
          else if (!ones) read.place = position + 32'd1;
          else if (up) begin
            read.offset = 1'b1;
            read.place  = '0;
          end else begin
            read.place = begins.place + ((32'(value) + 32'd1) << (begins.kind == 2'd1 ? 6 : 14));
          end
        end
      end
    end
  end

  // Of a marker: its units must be these.
  logic [15:0] of_marker;
  always_comb begin
    case (begins.words)
      3'd2: of_marker = expected.more ? 16'd1 : 16'd2;
      default: of_marker = 16'd0;
    endcase
  end

  assign sends_marker = send && datagram.kind == 4'd3;

  always_ff @(posedge clk) begin
    begun <= 1'b1;
    held  <= read;
    if (finds) event_waits <= 1'b0;
    if (send) begin
      held.body <= EMPTY;
      if (sends_marker) marker_waits <= 1'b0;
      if (datagram.kind < 4'd3 && datagram.base + micros_t'(datagram.span) > promised)
        promised <= datagram.base + micros_t'(datagram.span);
    end
    comes <= taken;
    if (taken) begin
      coming <= entry;
      newest <= entry.at;
    end
    if (comes) begin
      expected     <= coming;
      event_waits  <= coming.kind == ENTRY_EVENT;
      marker_waits <= coming.kind == ENTRY_MARKER;
    end
    any_again <= any_again || (write && begins.offset && whole && begins.body == EVENTS);
    any_jump  <= any_jump || (write && begins.body == EVENTS && whole && ones && !up && !begins.offset);
    if (!begun) begin
      held.body <= EMPTY;
      {comes, event_waits, marker_waits, any_again, any_jump} <= '0;
      {promised, newest} <= '0;
    end
  end

  always_comb begin
    if (begun) begin
      if (valid) assume (32'(entry.y) < ROWS && entry.at >= newest && !entry.at[47]);
      // A fault shows early, too.
      if (!LEMMAS) assume (!valid || entry.at < 48'd200_000);
      // Nothing comes before what was taken last can be read.
      if (comes) assert ((!event_waits || finds) && !marker_waits);
      if (finds) begin
        assert (event_waits);
        assert (position >> STRIDE == 32'(expected.x) && position[STRIDE-1:0] == expected.y);
        assert (up == expected.more && begins.at == expected.at);
        if (begins.kind == 2'd1) assert (value == (expected.value > 16'd255 ? 16'd255 : expected.value));
        if (begins.kind == 2'd2) assert (value == expected.value);
        assert (begins.kind == kind_of(expected.format) && expected.at >= promised);
      end
      if (write && begins.body == EVENTS && begins.offset && whole)
        assert ((begins.kind == 2'd2 ? {word, begins.low} : {16'd0, word}) <= 32'(LATEST));
      if (write && begins.body == MARKER) assert (begins.words < 3'd4 && unit == of_marker);
      if (send) begin
        // A body ends with a word that is no offset's beginning; its header is as it was read with.
        assert (!write);
        case (held.body)
          EVENTS: begin
            assert (!held.half && !held.offset);
            assert (datagram.kind == 4'(held.kind) && datagram.base == held.base && datagram.line == held.line);
          end
          MARKER: assert (datagram.kind == 4'd3 && held.words == 3'd4 && datagram.base == expected.at && marker_waits);
          REPEATED: assert (datagram.kind == 4'd4 || datagram.kind == 4'd6 || datagram.kind == 4'd7);
          default: assert (datagram.kind < 4'd3 && datagram.units == 0);
        endcase
      end
    end
  end

  // What the packer holds meanwhile, without which the induction does not close. Faults must be found without it.
  always_comb begin
    if (LEMMAS && begun) begin
      assert (state != WRITE || (packer.left != 0 && packer.left <= 3'd6));
      assert (!packer.room || state == IDLE || (state == WRITE && after == IDLE && packer.left == 3'd1));
      assert (promised <= newest && 4'(state) <= 4'(AGE));
      if (comes) assert (coming.at == newest && packer.now == coming && (state == WEIGH || state == OVER));
      else assert (!event_waits || expected.at == newest);
      assert (!send || !packer.gathered || state == WEIGH);
      case (state)
        IDLE: assert ((!event_waits || finds) && (!marker_waits || sends_marker));
        WEIGH: assert (!marker_waits && (comes || (event_waits && packer.now == expected && !write)));
        PLACE: assert (event_waits && packer.now == expected && !write && !marker_waits);
        WRITE: assert (after == IDLE ? packer.gathered && !marker_waits : !packer.gathered && !event_waits
                       && (after == BEYOND ? marker_waits && expected.at == packer.now.at
                           : after == REPEAT && !marker_waits));
        CLOSE: assert (packer.gathered && !write);
        SEND: assert (!packer.gathered && packer.base + packer.span == packer.now.at
                      && packer.span <= 48'd65_535 && !write);
        AGE, BEAT: assert (after == NEXT && !event_waits);
        OVER: assert ((!event_waits || finds) && !marker_waits
                      && (comes ? packer.now.kind != ENTRY_EVENT : packer.now.kind == ENTRY_FLUSH));
        BEYOND: assert (!packer.gathered && !event_waits && marker_waits && read.body == MARKER && read.words == 3'd4
                        && expected.at == packer.now.at);
        // Where events are held nothing else of a frame's end follows.
        NEXT: assert (!event_waits
                      && (!packer.gathered || (packer.now.kind == ENTRY_FRAME
                                               && !packer.states && !packer.totals_due)));
        default: assert (!packer.gathered && !event_waits && !marker_waits && packer.now.kind != ENTRY_MARKER);
      endcase
      if (state == CLOSE || state == SEND) begin
        assert (after == WEIGH || after == NEXT);
        assert (after == WEIGH ? event_waits && packer.now == expected && !marker_waits : !event_waits);
      end
      if (state == AGE || state == BEAT || ((state == CLOSE || state == SEND) && after == NEXT)
          || state == NEXT)
        assert (marker_waits == (packer.now.kind == ENTRY_MARKER) && (!marker_waits || packer.now == expected));
      assert (state != REPEAT || packer.row <= 8'(ROWS));
      if (state == TOTALS) assert (packer.word <= 5'd20 && packer.words_over == (packer.word == 5'd20));
      if (state == REPEAT) assert (packer.row == 8'd0 ? read.body == EMPTY || send : read.body == REPEATED && !send);
      if (state == TOTALS) assert (packer.word == 5'd0 ? read.body == EMPTY || send : read.body == REPEATED && !send);
      if (state == WRITE && after == REPEAT)
        assert (packer.row != 8'd0 && packer.row <= 8'(ROWS) && read.body != MARKER && !send);
      assert (state == IDLE || packer.now.at <= newest);
      // An event's place, seen from the one before, and how long ago things were: of the clocks before.
      if (state == WEIGH && packer.gathered) begin
        assert (packer.moved == (packer.now.at != packer.at) && packer.behind == (packer.position <= packer.reached));
        assert (packer.gap_ahead == 15'(packer.position - packer.reached - 16'sd1));
        assert (packer.far_ahead == (packer.gap_ahead >= 15'h7F));
      end
      if (state == PLACE) begin
        assert (packer.far == (packer.gap >= 15'h7F));
        if (packer.gathered) begin
          assert (packer.again == (packer.now.at != packer.at || packer.position <= packer.reached));
          assert (packer.gap == 15'(packer.again ? packer.position : packer.position - packer.reached - 16'sd1));
          assert (packer.differs == (packer.now.format != packer.format));
          assert (packer.late == (packer.now.at - packer.base > LATEST));
        end else begin
          assert (!packer.again && packer.gap == 15'(packer.now.y) && packer.format == packer.now.format);
        end
      end
      if (packer.gathered && (state == PLACE || state == CLOSE || state == AGE || state == BEAT))
        assert (packer.since == packer.now.at - packer.base);
      if (packer.gathered && (state == CLOSE || state == BEAT))
        assert (packer.since_16 == (packer.since < 48'd65_535 ? packer.since[15:0] : 16'd65_535)
                && packer.since_long == (packer.since > 48'd65_535));
      if (state == AGE || state == BEAT)
        assert (packer.quiet == packer.now.at - packer.promised
                && packer.newer == (packer.now.at > packer.promised));
      if (state == BEAT)
        assert (packer.quiet_16 == (packer.quiet < 48'd65_535 ? packer.quiet[15:0] : 16'd65_535)
                && packer.quiet_long == (packer.quiet > 48'd65_535));
      if (packer.gathered && state != WRITE) begin
        assert (read.body == EVENTS && !read.half && !read.offset && !send);
        assert (read.base == packer.base && read.line == packer.line && read.kind == kind_of(packer.format));
        assert (read.at == packer.at && read.place == 32'(packer.reached) + 32'd1 && !packer.reached[15]);
        assert (packer.base <= packer.at && packer.at <= newest && (state == IDLE || packer.at <= packer.now.at));
      end
      if (!packer.gathered) assert (read.body != EVENTS || send);
      if (!packer.gathered && (state == IDLE || state == WEIGH || state == PLACE || state == OVER || state == AGE
                               || state == BEAT || state == SEND || state == NEXT))
        assert ((read.body == EMPTY || send) && packer.units == '0);
    end
  end

  always_comb begin
    if (begun) begin
      cover (send && datagram.kind == 4'd0 && datagram.units == 10'd6 && any_again);
      cover (send && datagram.kind == 4'd1 && datagram.units == 10'd6 && any_jump && any_again);
      cover (send && datagram.kind == 4'd2 && datagram.units == 10'd10 && any_again);
      cover (send && datagram.kind == 4'd3);
      cover (send && datagram.kind == 4'd1 && promised > 48'd1000 && datagram.units == 10'd4);
    end
  end

endmodule
