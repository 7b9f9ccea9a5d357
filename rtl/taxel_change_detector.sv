// Which taxels of a read changed: counts become values, each is compared with the value that its taxel holds.
//
// The counts of a read are loaded at once and taken one a clock, channel after channel. What `PREVIOUS_SAMPLE` and `INTENSITY`
// choose is as `previous` and `intensity` of the emulated board. The initial frame sets every taxel's value to 0.
module taxel_change_detector
  import taxel_types::*;
#(
    parameter int COLUMNS = 64,
    parameter int ROWS = 64,
    parameter int CHANNELS = 16,
    parameter int STEPS = 4,
    parameter bit PREVIOUS_SAMPLE = 1'b0,  // compare with the last value sampled, else with the last one sent
    parameter bit DIFFERENCE = 1'b0        // an event's value is how far it moved, else where it is
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
    output logic                      not_returned   // a comparator had tripped when its ramp began
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
  logic counting, busy;
  logic [2:0] markers;
  logic [MARKERS-1:0] starts;

  assign busy = counting && markers == 0;

  always_ff @(posedge clk) begin
    if (step_end) ended <= read;
    if (read_done) begin
      now      <= ended;
      counting <= 1'b1;
      channel  <= '0;
      markers  <= ended.frame_first && !ended.initial_frame ? ended.markers : 3'd0;
      starts   <= ended.starts;
      for (int c = 0; c < CHANNELS; c++) counts[c] <= '{tripped: tripped[c], first: first[c], at: at[c]};
    end else if (markers != 0) begin
      markers <= markers - 3'd1;
      starts  <= starts >> 1;
    end else if (counting) begin
      counts  <= counts >> $bits(trip_t);
      channel <= channel + CHANNEL_BITS'(1);
      if (channel == CHANNEL_BITS'(CHANNELS - 1)) counting <= 1'b0;
    end
    if (reset) begin
      counting <= 1'b0;
      markers  <= '0;
    end
  end

  // Six stages, one taxel a clock.
  typedef struct packed {
    logic valid;
    logic last;    // of its frame
    logic marker;
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
    counted.valid        <= busy || markers != 0;
    counted.marker       <= markers != 0;
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

  assign changed = judged.valid && judged.exists && !judged.not_returned && !of_judged.initial_frame && beyond;
  assign push = (changed || (judged.valid && judged.marker)) && !full;
  assign sent = changed && !full;
  assign frame_over = judged.valid && judged.last && !of_judged.initial_frame;
  assign lost = (changed || (judged.valid && judged.marker)) && full;
  assign not_returned = judged.valid && judged.exists && judged.not_returned && !of_judged.initial_frame;
  assign store = judged.valid && judged.exists
      && (of_judged.initial_frame || (PREVIOUS_SAMPLE ? !judged.not_returned : changed && !full));
  assign stored = of_judged.initial_frame ? 16'd0 : judged.value;

  always_comb begin
    found = '0;
    found.marker = judged.marker;
    found.frame  = frame;
    found.stamp  = of_judged.stamp;
    if (judged.marker) begin
      found.more = judged.start;
    end else begin
      found.x     = 6'(of_judged.line);
      found.y     = 6'(judged.address);
      found.more  = polarity;
      found.value = DIFFERENCE ? moved_by : judged.value;
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
