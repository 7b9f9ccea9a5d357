// Which taxels of a read changed: counts become values, each is compared with the value that its taxel holds.
//
// The counts of a read are loaded at once and taken one a clock, channel after channel. What `PREVIOUS_SAMPLE` and `INTENSITY`
// choose is as `previous` and `intensity` of the emulated board. The initial frame sets every taxel's value to 0.
//
// Before the first events of a frame of version 2 come, its predecessor's end is queued; where a line's values are due to be
// repeated then, they are copied, ahead of the events that change them.
module taxel_change_detector
  import taxel_types::*;
#(
    parameter int COLUMNS = 64,
    parameter int ROWS = 64,
    parameter int CHANNELS = 16,
    parameter int STEPS = 4,
    parameter bit PREVIOUS_SAMPLE = 1'b0,  // compare with the last value sampled, else with the last one sent
    parameter bit DIFFERENCE = 1'b0,       // an event's value is how far it moved, else where it is
    parameter bit REPEATS = 1'b1,          // lines' values are repeated
    parameter bit HOLDS = 1'b0             // events may wait for those of the next frame
) (
    input  logic                      clk,
    input  logic                      reset,
    input  logic                      step_end,
    input  read_t                     read,       // of the step that ends
    input  logic                      read_done,  // its counts are there
    input  logic [CHANNELS-1:0]       tripped,
    input  logic [CHANNELS-1:0]       first,
    input  logic [CHANNELS-1:0][14:0] at,
    output logic                      push,
    output event_t                    found,
    input  logic                      full,
    output logic                      frame,         // of the events to come, alternating over frames that have any
    output logic                      sent,          // a taxel's event found room
    output logic                      lost,          // an event or a marker found none
    output logic                      frame_over,    // all events of a frame but the first one were found
    output logic                      not_returned,  // a comparator had tripped when its ramp began
    output logic                      counted_first, // a count of the initial frame, in the order of the scan
    output logic [15:0]               count_first,   // 65535: not returned
    // What is repeated: the packer reads it by rows, and says when it has.
    input  totals_t                   totals,
    output totals_t                   repeated_totals,
    output logic                      states_ready,
    output logic [6:0]                repeated_line,
    input  logic [6:0]                row_repeated,
    output logic [15:0]               value_repeated,
    input  logic                      states_sent,
    input  logic                      totals_sent
);

  localparam int STEP_BITS = $clog2(STEPS);
  localparam int CHANNEL_BITS = $clog2(CHANNELS);
  localparam int ROW_BITS = STEP_BITS + CHANNEL_BITS;
  localparam int LINE_BITS = $clog2(COLUMNS) == 0 ? 1 : $clog2(COLUMNS);
  localparam int ADDRESS_BITS = LINE_BITS + ROW_BITS;

  typedef struct packed {
    logic tripped;
    logic first;
    logic [14:0] at;
  } trip_t;

  // What the read was; then its counts.
  read_t ended, now;
  trip_t [CHANNELS-1:0] counts;
  logic [CHANNEL_BITS-1:0] channel;
  logic counting, busy, of_frame, flushes, first_read, after_sent;
  logic [2:0] markers;
  logic [MARKERS-1:0] starts;

  assign busy = counting && !of_frame && markers == 0 && !flushes;
  assign first_read = ended.frame_first && !ended.initial_frame;
  assign after_sent = first_read && !ended.ended.initial_frame;  // of a frame that was sent

  always_ff @(posedge clk) begin
    if (step_end) ended <= read;
    if (read_done) begin
      now      <= ended;
      counting <= 1'b1;
      channel  <= '0;
      of_frame <= after_sent && ended.ended.format.version_2;
      markers  <= first_read ? ended.markers : 3'd0;
      starts   <= ended.starts;
      flushes  <= HOLDS && after_sent && ended.ended.format.version_2 && ended.ended.changed;
      for (int c = 0; c < CHANNELS; c++) counts[c] <= '{tripped: tripped[c], first: first[c], at: at[c]};
    end else if (of_frame) begin
      of_frame <= 1'b0;
    end else if (markers != 0) begin
      markers <= markers - 3'd1;
      starts  <= starts >> 1;
    end else if (flushes) begin
      flushes <= 1'b0;
    end else if (counting) begin
      counts  <= counts >> $bits(trip_t);
      channel <= channel + CHANNEL_BITS'(1);
      if (channel == CHANNEL_BITS'(CHANNELS - 1)) counting <= 1'b0;
    end
    if (reset) begin
      {counting, of_frame, flushes} <= '0;
      markers  <= '0;
    end
  end

  // Six stages, one taxel a clock.
  typedef struct packed {
    logic valid;
    logic last;    // of its frame
    entry_kind_t kind;
    logic start;
    logic exists;
    logic not_returned;
    logic [ADDRESS_BITS-1:0] address;
    logic [15:0] value;
  } sample_t;

  sample_t counted, valued, fetched, compared, judged;
  logic [15:0] tick;
  logic [15:0] held, previous;
  logic [15:0] moved, moved_by;
  logic more, polarity, beyond, changed;
  logic [ROW_BITS-1:0] row;
  read_t of_counted, of_valued, of_fetched, of_compared, of_judged;

  if (STEPS == 1) begin : g_one
    assign row = channel;
  end else begin : g_more
    assign row = {channel, now.step[STEP_BITS-1:0]};
  end

  logic [15:0] values[2**ADDRESS_BITS];
  logic store;
  logic [15:0] stored;

  always_ff @(posedge clk) begin
    // Which tick it was: the sample before the one that had tripped.
    counted.valid        <= busy || of_frame || markers != 0 || flushes;
    counted.kind         <= of_frame ? ENTRY_FRAME : markers != 0 ? ENTRY_MARKER : flushes ? ENTRY_FLUSH : ENTRY_EVENT;
    counted.start        <= starts[0];
    counted.last         <= busy && now.frame_last && channel == CHANNEL_BITS'(CHANNELS - 1);
    counted.exists       <= busy && 32'(row) < ROWS;
    counted.not_returned <= counts[0].tripped && counts[0].first && counts[0].at == 0;
    counted.address      <= {now.line[LINE_BITS-1:0], row};
    counted.value        <= '0;
    tick                 <= counts[0].tripped ? {counts[0].at, 1'b0} - 16'(counts[0].first) : 16'hFFFF;
    of_counted           <= now;
    // What it reads: at most the ramp's length.
    valued               <= counted;
    valued.value         <= tick < of_counted.ramp ? tick : of_counted.ramp;
    of_valued            <= of_counted;
    held                 <= values[counted.address];
    // The value that its taxel holds.
    fetched              <= valued;
    of_fetched           <= of_valued;
    previous             <= held;
    // How far it moved.
    compared             <= fetched;
    of_compared          <= of_fetched;
    more                 <= fetched.value >= previous;
    moved                <= fetched.value >= previous ? fetched.value - previous : previous - fetched.value;
    // Whether that is an event.
    judged               <= compared;
    of_judged            <= of_compared;
    polarity             <= more;
    moved_by             <= moved;
    beyond               <= moved > 16'(of_compared.noise_floor);
    if (store) values[judged.address] <= stored;
    if (reset) {counted.valid, valued.valid, fetched.valid, compared.valid, judged.valid} <= '0;
  end

  logic other;  // than a taxel's
  assign other = judged.valid && judged.kind != ENTRY_EVENT;
  assign changed = judged.valid && judged.exists && !judged.not_returned && !of_judged.initial_frame && beyond;
  assign push = (changed || other) && !full;
  assign sent = changed && !full;
  assign frame_over = judged.valid && judged.last && !of_judged.initial_frame;
  assign lost = (changed || (other && judged.kind == ENTRY_MARKER)) && full;
  assign not_returned = judged.valid && judged.exists && judged.not_returned && !of_judged.initial_frame;
  assign store = judged.valid && judged.exists
      && (of_judged.initial_frame || (PREVIOUS_SAMPLE ? !judged.not_returned : changed && !full));
  assign stored = of_judged.initial_frame ? 16'd0 : judged.value;

  assign counted_first = fetched.valid && fetched.exists && of_fetched.initial_frame;
  assign count_first   = fetched.not_returned ? 16'hFFFF : fetched.value;

  logic lost_before;  // since the last entry
  logic states_now, totals_now;

  always_comb begin
    found = '0;
    found.kind   = judged.kind;
    found.format = judged.kind == ENTRY_EVENT ? of_judged.format : of_judged.ended.format;
    found.frame  = frame;
    found.lost   = lost_before;
    found.at     = found.format.version_2 ? of_judged.micros : micros_t'(of_judged.stamp);
    case (judged.kind)
      ENTRY_EVENT: begin
        found.x     = of_judged.line;
        found.y     = 7'(judged.address[ROW_BITS-1:0]);
        found.more  = polarity;
        found.value = DIFFERENCE ? moved_by : judged.value;
      end
      ENTRY_FRAME: begin
        {found.x, found.y, found.more, found.value} = of_judged.ended.micros;
        found.states = states_now;
        found.totals = totals_now;
      end
      default: found.more = judged.start;
    endcase
  end

  // What is due to be repeated goes with the next frame's end that finds room, where what was repeated last has been sent. The
  // copy of a line begins before that is known, two clocks ahead of the frame's first event, and stays ahead of all.
  logic line_pending, totals_pending, states_busy, totals_busy, copies, copying, copied, ends;
  logic [6:0] line_next, line_now;
  logic [ROW_BITS-1:0] place, row_copied, row_written;
  logic [15:0] again[2**ADDRESS_BITS];  // the same values, for the copy to read
  logic [15:0] line_values[2**ROW_BITS];
  logic [15:0] copied_value;

  // In the order of the scan: channel by channel.
  if (STEPS == 1) begin : g_row_of_one
    assign row_copied = place;
  end else begin : g_row_of_more
    assign row_copied = {place[CHANNEL_BITS-1:0], place[ROW_BITS-1:CHANNEL_BITS]};
  end

  assign ends       = push && judged.kind == ENTRY_FRAME;
  assign states_now = copies;
  assign totals_now = totals_pending && !totals_busy;
  assign states_ready = states_busy && !copying && !copied;

  always_ff @(posedge clk) begin
    if (read_done && after_sent) begin
      line_pending   <= line_pending || (REPEATS && ended.ended.line_due);
      totals_pending <= totals_pending || ended.ended.totals_due;
    end
    if (fetched.valid && fetched.kind == ENTRY_FRAME && line_pending && !states_busy) begin
      copies   <= 1'b1;
      copying  <= 1'b1;
      place    <= '0;
      line_now <= 8'(line_next) > of_fetched.ended.lines ? 7'd0 : line_next;
    end else if (copying) begin
      place <= place + ROW_BITS'(1);
      if (&place) copying <= 1'b0;
    end
    if (judged.valid && judged.kind == ENTRY_FRAME) copies <= 1'b0;
    if (ends && copies) begin
      states_busy  <= 1'b1;
      line_pending <= 1'b0;
      line_next    <= 8'(line_now) == of_judged.ended.lines ? 7'd0 : line_now + 7'd1;
    end else if (states_sent) begin
      states_busy <= 1'b0;
    end
    if (ends && totals_now) begin
      totals_busy     <= 1'b1;
      totals_pending  <= 1'b0;
      repeated_totals <= totals;
    end else if (totals_sent) begin
      totals_busy <= 1'b0;
    end
    repeated_line <= line_now;
    if (store) again[judged.address] <= stored;
    copied_value <= again[{line_now[LINE_BITS-1:0], row_copied}];
    copied       <= copying;
    row_written  <= row_copied;
    if (copied) line_values[row_written] <= copied_value;
    value_repeated <= line_values[row_repeated[ROW_BITS-1:0]];
    if (push) lost_before <= 1'b0;
    else if (changed) lost_before <= 1'b1;
    if (reset) begin
      {line_pending, totals_pending, states_busy, totals_busy, copies, copying, copied, lost_before} <= '0;
      line_next <= '0;
    end
  end

  logic pushed;  // in this frame
  always_ff @(posedge clk) begin
    if (push) pushed <= 1'b1;
    if (judged.valid && judged.last) begin
      if (pushed || push) frame <= !frame;
      pushed <= 1'b0;
    end
    if (reset) {pushed, frame} <= '0;
  end

endmodule
