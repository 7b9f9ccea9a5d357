// Datagrams of version 2 of the wire: what comes out of the queue becomes bodies in a buffer of two banks, each with a header.
//
// A body is written as units of 16 bits. What a datagram holds, and when it ends, is as of the emulated board's packer: an
// event that does not fit ends it, so does the end of a frame, unless events are held for later ones.
//
// Throughput: an event of one unit or two every 3 clocks, and one more clock for each further unit, up to 6.
// Latency: a datagram is sent when it is known that it is over.
// Loses nothing: while both banks wait for the link, so does the queue. What the queue lost is flagged.
module taxel_packer_v2 #(
    parameter int ROWS = 64,
    parameter bit VALUED = 1'b1,
    parameter bit DIFFERENCE = 1'b0,
    parameter int HOLD_US = 0,          // for how long an event may wait for others
    parameter int HEARTBEAT_US = 10_000, // between promises that nothing has happened
    parameter int MOST = 688             // units of a body: 1376 bytes
) (
    input  logic                   clk,
    input  logic                   reset,
    input  logic                   valid,           // an entry, by ascending rows within a line
    input  taxel_types::event_t    entry,
    output logic                   taken,
    input  logic                   leaving,         // an entry of version 1 is next
    output logic                   idle,            // no event waits, nor a datagram
    // What is repeated.
    input  logic                   states_ready,
    input  logic [6:0]             repeated_line,
    output logic [6:0]             row_repeated,
    input  logic [15:0]            value_repeated,
    output logic                   states_sent,
    input  taxel_types::totals_t   totals,
    output logic                   totals_sent,
    // The buffer and the header of what is in it.
    output logic                   write,
    output logic                   bank,
    output logic [9:0]             place,
    output logic [15:0]            unit,
    output logic                   send,            // one clock
    output taxel_types::datagram_t datagram,
    input  logic                   sending          // the datagram before has not gone
);

  import taxel_types::*;

  localparam int STRIDE = ROWS > 1 ? $clog2(ROWS) : 0;
  localparam micros_t LATEST = 48'd32_511;
  localparam micros_t RESTLESS = 48'd100_000;
  localparam micros_t LONGEST = 48'd65_535;
  localparam logic [14:0] FAR = 15'h7FFF;  // skip of the control words of 15 bits, and of 7
  localparam logic [6:0] NEAR = 7'h7F;

  typedef enum logic [3:0] {
    IDLE,
    WEIGH,    // where an event lies, seen from the one before
    PLACE,    // whether it fits
    WRITE,    // units of a word, or of a marker
    CLOSE,    // what was gathered is sent
    BEYOND,   // a promise of more than 16 bits: an empty datagram with a later base
    OVER,     // the end of a frame
    BEAT,     // a promise alone
    REPEAT,   // a line's values
    TOTALS,   // the board's totals
    SEND,     // a datagram without events
    NEXT,     // what else an entry asks for
    AGE       // how long ago things were, and whether that is long
  } state_t;

  state_t state, after;
  event_t now;
  format_t format;
  logic room, flushes;  // for an entry: what stands at the input is copied, whether it is one or not
  logic gathered, flag, lost, any, again, late, newer, differs;
  logic moved, behind, far, far_ahead;  // an event's time and place against those of the one before
  logic since_long, quiet_long, silent, restless, ripe;
  logic [9:0] units;
  micros_t base, at, promised, last, since, quiet, since_last, long_ago;
  logic [15:0] span, since_16, quiet_16;
  logic [6:0] line;
  logic signed [15:0] position, reached, entry_position, ahead;
  logic [14:0] gap, gap_ahead;
  logic [31:0] sequence_number;
  logic states, totals_due;
  logic [7:0] row;
  logic [4:0] word, word_ahead;
  logic [15:0] total;  // the unit of totals that is next
  logic words_over, rows_over;
  logic [1:0] fetching;    // clocks until it stands
  logic [15:0] repeated;   // in a register, as memory answers late

  // Units that wait to be written, the first in the lowest bits.
  logic [6:0][15:0] waiting;
  logic [2:0] left;
  logic [7:0] fits;  // whether so many more do

  function automatic logic [15:0] at_most(micros_t t);
    return t < LONGEST ? t[15:0] : LONGEST[15:0];
  endfunction

  assign position = 16'(now.x) << STRIDE | 16'(now.y);
  assign entry_position = 16'(entry.x) << STRIDE | 16'(entry.y);
  assign ahead = entry_position - reached - 16'sd1;
  assign taken = valid && room;
  // What is gathered goes when an entry of version 1 is next.
  assign flushes = room && !valid && leaving && gathered;
  assign idle  = state == IDLE && !gathered && !valid && !send && !sending;
  assign row_repeated = row[6:0];

  // An event as units.
  logic valued, narrow, jumps;
  logic [6:0][15:0] units_of;
  logic [2:0] count_of;
  logic [7:0] value_8;
  logic [15:0] gap_16;
  logic [14:0] rest;

  assign valued  = VALUED || format.spikes;
  assign narrow  = valued && !format.wide_values;
  assign jumps   = narrow && far;
  assign rest    = jumps ? 15'(gap[5:0]) : gap;
  assign value_8 = now.value > 16'd255 ? 8'd255 : now.value[7:0];
  assign gap_16  = {now.more, rest};

  always_comb begin
    units_of = '0;
    if (narrow) begin
      units_of[0] = {now.more, rest[6:0], value_8};
      count_of = 3'd1;
      if (jumps) begin
        units_of = {units_of[5:0], {1'b0, NEAR, 8'(gap >> 6) - 8'd1}};
        count_of = count_of + 3'd1;
      end
      if (again) begin
        units_of = {units_of[4:0], 16'(now.at - base), {1'b1, NEAR, 8'd0}};
        count_of = count_of + 3'd2;
      end
    end else if (valued) begin
      units_of[1:0] = {gap_16, now.value};
      count_of = 3'd2;
      if (again) begin
        units_of = {units_of[2:0], 16'd0, 16'(now.at - base), {1'b1, FAR}, 16'd0};
        count_of = 3'd6;
      end
    end else begin
      units_of[0] = gap_16;
      count_of = 3'd1;
      if (again) begin
        units_of = {units_of[4:0], 16'(now.at - base), {1'b1, FAR}};
        count_of = 3'd3;
      end
    end
  end

  // Totals as units, the lowest first.
  logic [319:0] all_totals;
  assign all_totals = {16'd0, totals.faults, 32'd0, sequence_number, 16'd0, totals.dropped, 16'd0, totals.events,
                       16'd0, totals.frames};

  logic [3:0] kind;  // of events
  assign kind = !valued ? 4'd0 : narrow ? 4'd1 : 4'd2;

  // What happens in this clock: an event finds its place in the body, or what was gathered goes first; a datagram goes.
  logic fits_in, beats, free, goes, shows_value, shows_total;
  assign fits_in     = state == PLACE && !(gathered && (differs || late || !fits[count_of]));
  // A promise alone.
  assign beats       = state == BEAT && !gathered && now.kind == ENTRY_FRAME && newer && (restless || silent);
  assign free        = !sending && !send;
  assign shows_value = state == REPEAT && !rows_over && fetching == 0;
  assign shows_total = state == TOTALS && !words_over;

  always_comb begin
    case (state)
      CLOSE, SEND, BEYOND: goes = free;
      REPEAT: goes = free && rows_over;
      TOTALS: goes = free && words_over;
      default: goes = 1'b0;
    endcase
  end

  // How long ago things were, of the clock before: they stand while they are used.
  always_ff @(posedge clk) begin
    since      <= now.at - base;
    quiet      <= now.at - promised;
    since_last <= now.at - last;
    late       <= now.at - base > LATEST;
    newer      <= now.at > promised;
    long_ago   <= now.at - LONGEST;
    // And of two clocks before.
    since_16   <= at_most(since);
    since_long <= since > LONGEST;
    quiet_16   <= at_most(quiet);
    quiet_long <= quiet > LONGEST;
    silent     <= quiet >= micros_t'(HEARTBEAT_US);
    restless   <= any && since_last <= RESTLESS;
    ripe       <= HOLD_US == 0 || since + micros_t'(length_of(now)) > micros_t'(HOLD_US);
  end

  // What is done next.
  always_ff @(posedge clk) begin
    case (state)
      IDLE: ;
      WEIGH: state <= PLACE;
      PLACE: begin
        state <= !fits_in ? CLOSE : count_of == 3'd1 ? IDLE : WRITE;
        after <= fits_in ? IDLE : WEIGH;
      end
      WRITE: if (left == 3'd1) state <= after;
      OVER: begin
        state <= AGE;
        after <= NEXT;
      end
      AGE: state <= BEAT;
      BEAT: begin
        state <= NEXT;
        if (gathered && (now.kind != ENTRY_FRAME || ripe || states || totals_due)) state <= CLOSE;
        if (beats) state <= SEND;
      end
      SEND: if (goes) state <= after;
      // Of what lies further ahead an empty datagram promises the rest.
      CLOSE: if (goes) state <= since_long ? SEND : after;
      NEXT: begin
        if (now.kind == ENTRY_MARKER) begin
          state <= WRITE;
          after <= BEYOND;
        end else if (states) begin
          if (states_ready) state <= REPEAT;
        end else begin
          state <= totals_due ? TOTALS : IDLE;
        end
      end
      BEYOND: if (goes) state <= IDLE;
      REPEAT: begin
        if (goes) state <= NEXT;
        if (shows_value) begin
          state <= WRITE;
          after <= REPEAT;
        end
      end
      default: if (goes) state <= NEXT;  // TOTALS
    endcase
    if (taken) state <= entry.kind == ENTRY_EVENT ? WEIGH : OVER;
    if (flushes) state <= OVER;
    // The next entry is taken while the last unit of the one before is written.
    room <= (state == IDLE && !taken && !flushes) || (fits_in && count_of <= 3'd2)
        || (state == WRITE && left == 3'd2 && after == IDLE);
    if (reset) begin
      state <= IDLE;
      room  <= 1'b0;
    end
  end

  // The entry, and what it still asks for.
  always_ff @(posedge clk) begin
    if (room) begin
      now        <= entry;
      states     <= entry.states && !flushes;
      totals_due <= entry.totals && !flushes;
      if (flushes) now.kind <= ENTRY_FLUSH;
      if (flushes) now.at <= at;
    end else if (state == NEXT && now.kind == ENTRY_MARKER) begin
      now.kind <= ENTRY_FLUSH;
    end else if (goes && state == REPEAT) begin
      states <= 1'b0;
    end else if (goes && state == TOTALS) begin
      totals_due <= 1'b0;
    end
  end

  // Where an event lies, seen from the one before, or from the start of a body or of a time.
  always_ff @(posedge clk) begin
    moved     <= entry.at != at;
    behind    <= entry_position <= reached;
    gap_ahead <= 15'(ahead);
    far_ahead <= 15'(ahead) >= 15'(NEAR);
    if (state == WEIGH) begin
      again <= gathered && (moved || behind);
      if (!gathered) begin
        gap <= 15'(now.y);
        far <= 15'(now.y) >= 15'(NEAR);
      end else if (moved || behind) begin
        gap <= 15'(position);
        far <= 15'(position) >= 15'(NEAR);
      end else begin
        gap <= gap_ahead;
        far <= far_ahead;
      end
      // What waits has its own format: it is sent first.
      differs <= now.format != format;
    end
  end

  // What is gathered: when and where it begins, and where its last event is.
  always_ff @(posedge clk) begin
    if (fits_in) begin
      gathered <= 1'b1;
      if (!gathered) begin
        line     <= now.x;
        flag     <= lost;
      end
      at      <= now.at;
      last    <= now.at;
      any     <= 1'b1;
      reached <= position;
    end
    if (goes && state == CLOSE) gathered <= 1'b0;
    if (!gathered && (room || state == WEIGH)) format <= room ? entry.format : now.format;
    if (reset) {gathered, any} <= '0;
  end

  // From when on, and how far, what is sent next promises; and up to when all datagrams do.
  always_ff @(posedge clk) begin
    if (fits_in && !gathered) base <= now.at;
    if (beats) begin
      base <= quiet_long ? long_ago : promised;
      span <= quiet_16;
    end
    if (goes && state == CLOSE && since_long) begin
      base <= long_ago;
      span <= LONGEST[15:0];
    end
    if (goes && (state == SEND || (state == CLOSE && newer))) promised <= now.at;
    if (reset) promised <= '0;
  end

  // Whether the queue lost something, until a datagram that begins after that says so.
  always_ff @(posedge clk) begin
    if ((fits_in && !gathered) || (goes && state != CLOSE)) lost <= 1'b0;
    if (taken) lost <= lost || entry.lost;
    if (reset) lost <= 1'b0;
  end

  // The units of a body, and their places in the buffer.
  always_ff @(posedge clk) begin
    write <= fits_in || state == WRITE || shows_total;
    if (fits_in || state == WRITE || shows_total) units <= units + 10'd1;
    for (int k = 0; k < 8; k++) fits[k] <= units <= 10'(MOST - k);
    place <= units;
    case (state)
      PLACE: begin
        unit    <= units_of[0];
        waiting <= units_of >> 16;
        left    <= count_of - 3'd1;
      end
      WRITE: begin
        unit    <= waiting[0];
        waiting <= waiting >> 16;
        left    <= left - 3'd1;
      end
      NEXT: if (now.kind == ENTRY_MARKER) begin
        waiting <= {48'd0, 16'd0, now.more ? 16'd1 : 16'd2, 16'd0, 16'd0};
        left    <= 3'd4;
      end
      REPEAT: if (shows_value) begin
        waiting[1] <= '0;
        waiting[0] <= narrow ? {8'd0, repeated > 16'd255 ? 8'd255 : repeated[7:0]} : repeated;
        left       <= narrow ? 3'd1 : 3'd2;
      end
      TOTALS: if (shows_total) unit <= total;
      default: ;
    endcase
    if (goes || reset) units <= '0;
    if (reset) write <= 1'b0;
  end

  // What is repeated: a value comes a clock after its row is asked for, and is used another one later.
  always_ff @(posedge clk) begin
    states_sent <= goes && state == REPEAT;
    totals_sent <= goes && state == TOTALS;
    repeated    <= value_repeated;
    rows_over   <= 32'(row) == ROWS;
    total       <= 16'(all_totals >> (16 * word_ahead));
    if (state == REPEAT) fetching <= fetching >> 1;
    if (shows_value) begin
      row      <= row + 8'd1;
      fetching <= 2'b01;
    end
    if (shows_total) begin
      word_ahead <= word_ahead + 5'd1;
      word       <= word + 5'd1;
      words_over <= word == 5'd19;
    end
    if (state == NEXT) begin
      row        <= '0;
      rows_over  <= 1'b0;
      fetching   <= 2'b11;
      word       <= '0;
      word_ahead <= 5'd1;
      words_over <= 1'b0;
      total      <= all_totals[15:0];
    end
    if (reset) {states_sent, totals_sent} <= '0;
  end

  // A datagram's header stands before it is known whether the one before has gone.
  always_ff @(posedge clk) begin
    send <= goes;
    if (goes) begin
      sequence_number <= sequence_number + 32'd1;
      bank            <= !bank;
    end
    datagram <= '{
        kind: kind,
        frame_sync: format.frame_sync,
        differences: DIFFERENCE && !format.spikes,
        dropped: lost,
        sequence_number: sequence_number,
        base: now.at,
        line: 7'd0,
        span: 16'd0,
        units: units,
        bank: bank
    };
    case (state)
      SEND: begin
        datagram.base <= base;
        datagram.span <= span;
      end
      CLOSE: begin
        datagram.dropped <= flag;
        datagram.base    <= base;
        datagram.line    <= line;
        datagram.span    <= since_16;
      end
      BEYOND: datagram.kind <= 4'd3;
      REPEAT: begin
        datagram.kind        <= narrow ? 4'd6 : 4'd7;
        datagram.differences <= 1'b0;
        datagram.line        <= repeated_line;
      end
      TOTALS: datagram.kind <= 4'd4;
      default: ;
    endcase
    if (reset) begin
      {bank, send} <= '0;
      sequence_number <= '0;
    end
  end

  // There are no other states.
  always_ff @(posedge clk) if (!reset) assert (state <= AGE);

endmodule
