// Which taxels of a read changed: counts become values, each is compared with the value that its taxel holds, or each taxel
// is an afferent that may fire.
//
// The counts of a read are loaded at once and taken one a clock, channel after channel; with the pattern its values take their
// place. What `PREVIOUS_SAMPLE` and `INTENSITY`
// choose is as `previous` and `intensity` of the emulated board. The initial frame sets every taxel's value to 0.
//
// Before the first events of a frame of version 2 come, its predecessor's end is queued; where a line's values are due to be
// repeated then, they are copied, ahead of the events that change them.
//
// Throughput: a taxel a clock; what goes ahead of a frame's first taxel takes at most 6 clocks more.
// Latency: seven clocks from a read's report to its first taxel's event.
// Loses events and markers that find the queue full (`lost`; `taxel_totals` counts them), and then a taxel keeps its value.
module taxel_change_detector #(
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
    input  taxel_types::read_t        read,             // of the step that ends
    input  logic                      read_done,        // its counts are there
    input  logic [CHANNELS-1:0]       tripped,
    input  logic [CHANNELS-1:0]       first,
    input  logic [CHANNELS-1:0][14:0] at,
    output logic                      push,
    output taxel_types::event_t       found,
    input  logic                      full,
    output logic                      frame,            // of the events to come, alternating over frames that have any
    output logic                      sent,             // a taxel's event found room
    output logic                      lost,             // an event or a marker found none
    output logic                      frame_over,       // all events of a frame but the first one were found
    output logic                      not_returned,     // a comparator had tripped when its ramp began
    output logic                      counted_first,    // a count of the initial frame, in the order of the scan
    output logic [15:0]               count_first,      // 65535: not returned
    // What is repeated: the packer reads it by rows, and says when it has.
    input  taxel_types::totals_t      totals,
    output taxel_types::totals_t      repeated_totals,
    output logic                      states_ready,
    output logic [6:0]                repeated_line,
    input  logic [6:0]                row_repeated,
    output logic [15:0]               value_repeated,
    input  logic                      states_sent,
    input  logic                      totals_sent
);

  import taxel_types::*;

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
  logic counting, of_frame, flushes, first_read, after_sent;
  logic busy;  // taxels come: counting, and nothing goes before them
  logic [2:0] markers;
  logic [MARKERS-1:0] starts;

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
      busy     <= !(after_sent && ended.ended.format.version_2) && !(first_read && ended.markers != 0);
    end else if (of_frame) begin
      of_frame <= 1'b0;
      busy     <= counting && markers == 0 && !flushes;
    end else if (markers != 0) begin
      markers <= markers - 3'd1;
      starts  <= starts >> 1;
      busy    <= counting && markers == 3'd1 && !flushes;
    end else if (flushes) begin
      flushes <= 1'b0;
      busy    <= counting;
    end else if (counting) begin
      channel <= channel + CHANNEL_BITS'(1);
      busy    <= channel != CHANNEL_BITS'(CHANNELS - 1);
      if (channel == CHANNEL_BITS'(CHANNELS - 1)) counting <= 1'b0;
    end else begin
      busy <= 1'b0;
    end
    // A thousand registers hang on these two.
    if (read_done) begin
      for (int c = 0; c < CHANNELS; c++) counts[c] <= '{tripped: tripped[c], first: first[c], at: at[c]};
    end else if (busy) begin
      counts <= counts >> $bits(trip_t);
    end
    if (reset) begin
      {counting, busy, of_frame, flushes} <= '0;
      markers  <= '0;
    end
  end

  // Seven stages, one taxel a clock.
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

  sample_t counted, valued, fetched, compared, weighed, judged;
  logic [15:0] tick, of_pattern;
  logic [15:0] held, previous;
  logic [15:0] moved, moved_of, moved_by;
  logic more, more_of, polarity, beyond, changed;
  // Of what is judged, known a clock before: a taxel that may have changed, an entry that is no taxel's, a frame's end.
  logic counts_now, other, frame_ends;
  logic [ROW_BITS-1:0] row;
  read_t of_counted, of_valued, of_fetched, of_compared, of_weighed, of_judged;

  if (STEPS == 1) begin : g_one
    assign row = channel;
  end else begin : g_more
    assign row = {channel, now.step[STEP_BITS-1:0]};
  end

  taxel_pattern #(.COLUMNS(COLUMNS), .ROWS(ROWS), .ROW_BITS(ROW_BITS)) ball (
      .clk, .reset, .step_end, .read, .read_done, .row, .value(of_pattern)
  );

  logic [15:0] values[2**ADDRESS_BITS];
  logic store, storing;
  logic [ADDRESS_BITS-1:0] storing_at;
  logic [15:0] stored, storing_value;

  always_ff @(posedge clk) begin
    // Which tick it was: the sample before the one that had tripped.
    counted.valid        <= busy || of_frame || markers != 0 || flushes;
    counted.kind         <= of_frame ? ENTRY_FRAME : markers != 0 ? ENTRY_MARKER : flushes ? ENTRY_FLUSH : ENTRY_EVENT;
    counted.start        <= starts[0];
    counted.last         <= busy && now.frame_last && channel == CHANNEL_BITS'(CHANNELS - 1);
    counted.exists       <= busy && 32'(row) < ROWS;
    counted.not_returned <= !now.pattern && counts[0].tripped && counts[0].first && counts[0].at == 0;
    counted.address      <= {now.line[LINE_BITS-1:0], row};
    counted.value        <= '0;
    tick                 <= counts[0].tripped ? {counts[0].at, 1'b0} - 16'(counts[0].first) : 16'hFFFF;
    of_counted           <= now;
    // What it reads: at most the ramp's length.
    valued               <= counted;
    valued.value         <= of_counted.pattern ? of_pattern : tick < of_counted.ramp ? tick : of_counted.ramp;
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
    // An afferent takes a clock more.
    weighed              <= compared;
    of_weighed           <= of_compared;
    more_of              <= more;
    moved_of             <= moved;
    // Whether that is an event.
    judged               <= weighed;
    of_judged            <= of_weighed;
    polarity             <= more_of;
    moved_by             <= moved_of;
    beyond               <= moved_of > 16'(of_weighed.noise_floor);
    counts_now           <= weighed.valid && weighed.exists && !weighed.not_returned && !of_weighed.initial_frame;
    other                <= weighed.valid && weighed.kind != ENTRY_EVENT;
    frame_ends           <= weighed.valid && weighed.kind == ENTRY_FRAME;
    // Whether an afferent fires is known late in a clock, and the blocks of the values lie far apart.
    storing              <= store && !reset;
    storing_at           <= judged.address;
    storing_value        <= stored;
    if (storing) values[storing_at] <= storing_value;
    if (reset) {counted.valid, valued.valid, fetched.valid, compared.valid, weighed.valid, judged.valid} <= '0;
    if (reset) {counts_now, other, frame_ends} <= '0;
  end

  logic spikes, fires, fires_more;
  logic [15:0] integral;
  assign spikes = of_judged.format.spikes;

  taxel_afferents #(.COLUMNS(COLUMNS), .STEPS(STEPS), .ADDRESS_BITS(ADDRESS_BITS)) receptors (
      .clk, .begins(read_done), .read(ended), .address(counted.address), .ticks(valued.value),
      .threshold(of_compared.threshold), .sampled(judged.valid && judged.kind == ENTRY_EVENT && spikes),
      .returned(!judged.not_returned), .stored_at(judged.address), .fires, .more(fires_more), .intensity(integral)
  );

  assign changed = counts_now && (spikes ? fires : beyond);
  assign push = (changed || other) && !full;
  assign sent = changed && !full;
  assign frame_over = judged.valid && judged.last && !of_judged.initial_frame;
  assign lost = (changed || (other && judged.kind == ENTRY_MARKER)) && full;
  assign not_returned = judged.valid && judged.exists && judged.not_returned && !of_judged.initial_frame;
  assign store = judged.valid && judged.exists
      && (of_judged.initial_frame || (!spikes && (PREVIOUS_SAMPLE ? !judged.not_returned : changed && !full)));
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
        found.more  = spikes ? fires_more : polarity;
        found.value = spikes ? integral : DIFFERENCE ? moved_by : judged.value;
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
  logic line_pending, totals_pending, states_busy, totals_busy, copies, copying, copied, writes, ends;
  logic [6:0] line_next, line_due, line_now;
  logic [ROW_BITS-1:0] place, row_copied, row_fetched, row_written;
  logic [15:0] again[2**ADDRESS_BITS];  // the same values, for the copy to read
  logic [15:0] line_values[2**ROW_BITS];
  logic [15:0] copied_value, value_written;

  // In the order of the scan: channel by channel.
  if (STEPS == 1) begin : g_row_of_one
    assign row_copied = place;
  end else begin : g_row_of_more
    assign row_copied = {place[CHANNEL_BITS-1:0], place[ROW_BITS-1:CHANNEL_BITS]};
  end

  // The line that comes after one; lines are counted less one.
  function automatic logic [6:0] line_after(logic [6:0] line, logic [7:0] lines);
    return 8'(line) == lines ? 7'd0 : line + 7'd1;
  endfunction

  assign ends       = frame_ends && !full;
  assign states_now = copies;
  assign totals_now = totals_pending && !totals_busy;
  assign states_ready = states_busy && !copying && !copied && !writes;

  always_ff @(posedge clk) begin
    if (read_done && after_sent) begin
      line_pending   <= line_pending || (REPEATS && ended.ended.line_due);
      totals_pending <= totals_pending || ended.ended.totals_due;
    end
    line_due <= 8'(line_next) > of_valued.ended.lines ? 7'd0 : line_next;
    if (fetched.valid && fetched.kind == ENTRY_FRAME && line_pending && of_fetched.ended.format.spikes) begin
      // Afferents have no values: the line's turn passes.
      line_pending <= 1'b0;
      line_next    <= line_after(line_due, of_fetched.ended.lines);
    end else if (fetched.valid && fetched.kind == ENTRY_FRAME && line_pending && !states_busy) begin
      copies   <= 1'b1;
      copying  <= 1'b1;
      place    <= '0;
      line_now <= line_due;
    end else if (copying) begin
      place <= place + ROW_BITS'(1);
      if (&place) copying <= 1'b0;
    end
    if (frame_ends) copies <= 1'b0;
    if (ends && copies) begin
      states_busy  <= 1'b1;
      line_pending <= 1'b0;
      line_next    <= line_after(line_now, of_judged.ended.lines);
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
    if (storing) again[storing_at] <= storing_value;
    copied_value <= again[{line_now[LINE_BITS-1:0], row_copied}];
    copied       <= copying;
    row_fetched  <= row_copied;
    // A RAM block's output comes late, and the block that it goes to may lie far.
    value_written <= copied_value;
    writes        <= copied;
    row_written   <= row_fetched;
    if (writes) line_values[row_written] <= value_written;
    value_repeated <= line_values[row_repeated[ROW_BITS-1:0]];
    if (push) lost_before <= 1'b0;
    else if (changed) lost_before <= 1'b1;
    if (reset) begin
      {line_pending, totals_pending, states_busy, totals_busy, copies, copying, copied, writes, lost_before} <= '0;
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
