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
  // The next entry is taken while the last unit of the one before is written.
  assign taken = valid && (state == IDLE || (state == WRITE && left == 3'd1 && after == IDLE));
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

  // What a datagram's header says stands before it is known whether the one before has gone.
  task automatic go();
    send            <= 1'b1;
    sequence_number <= sequence_number + 32'd1;
    bank            <= !bank;
    units           <= '0;
  endtask

  always_ff @(posedge clk) begin
    write       <= 1'b0;
    send        <= 1'b0;
    states_sent <= 1'b0;
    totals_sent <= 1'b0;
    // Of the clock before: they stand while they are used.
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
    repeated   <= value_repeated;
    for (int k = 0; k < 8; k++) fits[k] <= units <= 10'(MOST - k);
    rows_over <= 32'(row) == ROWS;
    place <= units;
    total <= 16'(all_totals >> (16 * word_ahead));
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
      IDLE: begin
        if (leaving && gathered && !valid) begin
          now.kind           <= ENTRY_FLUSH;
          now.at             <= at;
          {states, totals_due} <= '0;
          state              <= OVER;
        end
      end
      WEIGH: begin
        again <= gathered && (moved || behind);
        if (!gathered) begin
          gap    <= 15'(now.y);
          far    <= 15'(now.y) >= 15'(NEAR);
          format <= now.format;
        end else if (moved || behind) begin
          gap <= 15'(position);
          far <= 15'(position) >= 15'(NEAR);
        end else begin
          gap <= gap_ahead;
          far <= far_ahead;
        end
        // What waits has its own format: it is sent first.
        differs <= now.format != format;
        state   <= PLACE;
      end
      PLACE: begin
        unit    <= units_of[0];
        waiting <= units_of >> 16;
        left    <= count_of - 3'd1;
        if (gathered && (differs || late || !fits[count_of])) begin
          state <= CLOSE;
          after <= WEIGH;
        end else begin
          if (!gathered) begin
            gathered <= 1'b1;
            base     <= now.at;
            line     <= now.x;
            flag     <= lost;
            lost     <= 1'b0;
          end
          at      <= now.at;
          reached  <= position;
          last    <= now.at;
          any     <= 1'b1;
          write   <= 1'b1;
          units   <= units + 10'd1;
          state   <= count_of == 3'd1 ? IDLE : WRITE;
          after   <= IDLE;
        end
      end
      WRITE: begin
        write   <= 1'b1;
        unit    <= waiting[0];
        units   <= units + 10'd1;
        waiting <= waiting >> 16;
        left    <= left - 3'd1;
        if (left == 3'd1) state <= after;
      end
      OVER: begin
        after <= NEXT;
        state <= AGE;
      end
      AGE: state <= BEAT;
      BEAT: begin
        state <= NEXT;
        if (gathered) begin
          if (now.kind != ENTRY_FRAME || ripe || states || totals_due) state <= CLOSE;
        end else if (now.kind == ENTRY_FRAME && newer && (restless || silent)) begin
          base  <= quiet_long ? long_ago : promised;
          span  <= quiet_16;
          state <= SEND;
        end
      end
      SEND: begin
        datagram.base <= base;
        datagram.span <= span;
        if (!sending && !send) begin
          go();
          lost     <= 1'b0;
          promised <= now.at;
          state    <= after;
        end
      end
      CLOSE: begin
        datagram.dropped <= flag;
        datagram.base    <= base;
        datagram.line    <= line;
        datagram.span    <= since_16;
        if (!sending && !send) begin
          go();
          gathered <= 1'b0;
          // Of what lies further ahead the empty datagram that follows promises the rest.
          if (newer) promised <= now.at;
          state <= after;
          if (since_long) begin
            base  <= long_ago;
            span  <= LONGEST[15:0];
            state <= SEND;
          end
        end
      end
      NEXT: begin
        row  <= '0;
        word <= '0;
        word_ahead <= 5'd1;
        words_over <= 1'b0;
        rows_over  <= 1'b0;
        total      <= all_totals[15:0];
        fetching <= 2'b11;
        if (now.kind == ENTRY_MARKER) begin
          waiting  <= {48'd0, 16'd0, now.more ? 16'd1 : 16'd2, 16'd0, 16'd0};
          left     <= 3'd4;
          now.kind <= ENTRY_FLUSH;
          after    <= BEYOND;
          state    <= WRITE;
        end else if (states) begin
          if (states_ready) state <= REPEAT;
        end else if (totals_due) begin
          state <= TOTALS;
        end else begin
          state <= IDLE;
        end
      end
      BEYOND: begin
        // A marker has been written.
        datagram.kind <= 4'd3;
        if (!sending && !send) begin
          go();
          lost  <= 1'b0;
          state <= IDLE;
        end
      end
      REPEAT: begin
        // A value comes a clock after its row is asked for, and is used another one later.
        fetching <= fetching >> 1;
        datagram.kind        <= narrow ? 4'd6 : 4'd7;
        datagram.differences <= 1'b0;
        datagram.line        <= repeated_line;
        if (rows_over) begin
          if (!sending && !send) begin
            go();
            lost        <= 1'b0;
            states      <= 1'b0;
            states_sent <= 1'b1;
            state       <= NEXT;
          end
        end else if (fetching == 0) begin
          waiting[1] <= '0;
          waiting[0] <= narrow ? {8'd0, repeated > 16'd255 ? 8'd255 : repeated[7:0]} : repeated;
          left       <= narrow ? 3'd1 : 3'd2;
          row        <= row + 8'd1;
          after      <= REPEAT;
          fetching   <= 2'b01;
          state      <= WRITE;
        end
      end
      default: begin  // TOTALS
        datagram.kind <= 4'd4;
        if (words_over) begin
          if (!sending && !send) begin
            go();
            lost        <= 1'b0;
            totals_due  <= 1'b0;
            totals_sent <= 1'b1;
            state       <= NEXT;
          end
        end else begin
          write <= 1'b1;
          unit  <= total;
          word_ahead <= word_ahead + 5'd1;
          units <= units + 10'd1;
          word  <= word + 5'd1;
          words_over <= word == 5'd19;
        end
      end
    endcase
    if (taken) begin
      now        <= entry;
      moved      <= entry.at != at;
      behind     <= entry_position <= reached;
      gap_ahead  <= 15'(ahead);
      far_ahead  <= 15'(ahead) >= 15'(NEAR);
      lost       <= lost || entry.lost;
      states     <= entry.states;
      totals_due <= entry.totals;
      state      <= entry.kind == ENTRY_EVENT ? WEIGH : OVER;
      if (!gathered) format <= entry.format;
    end
    if (reset) begin
      {gathered, lost, any, bank, write, send, states_sent, totals_sent} <= '0;
      sequence_number <= '0;
      promised        <= '0;
      units           <= '0;
      state           <= IDLE;
    end
  end

endmodule
