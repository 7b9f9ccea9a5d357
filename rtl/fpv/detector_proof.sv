// The change detector, whatever is read and whenever the queue is full: a taxel, whichever it is, gives an event
// exactly where its count, made a value, differs by more than the noise floor from the value that it sent last, with
// what the event is to hold; no other time gives one. The end of a frame and its markers go before it, one each.
//
// Two lines, two steps and two channels here, of which one row does not exist. Reads are twelve clocks apart or more:
// channels and ten, as rule 9 demands; and of the two steps by turns. Whether an afferent fires, and what the pattern
// has, is any value at any time.
module detector_proof
  import taxel_types::*;
#(
    parameter bit LEMMAS = 1'b1
) (
    input logic             clk,
    input logic             wants_end,
    input logic             wants_done,
    input read_t            read,
    input logic [1:0]       tripped,
    input logic [1:0]       first,
    input logic [1:0][14:0] at,
    input logic             full,
    input totals_t          totals,
    input logic [6:0]       row_repeated,
    input logic             states_sent,
    input logic             totals_sent,
    input logic             fires,      // what an afferent tells
    input logic             fires_more,
    input logic [15:0]      integral,
    input logic [15:0]      rolled      // what the pattern tells
);

  localparam int COLUMNS = 2, ROWS = 3, CHANNELS = 2, STEPS = 2;
  localparam int APART = CHANNELS + 10;
  localparam int STAGES = 7;  // clocks from the report of a read to its first entry

  logic early = 1'b0, begun = 1'b0;  // a reset of two clocks: in the first the memory may still change
  logic step_end, read_done, push, sent, lost, not_returned;
  event_t found;

  taxel_change_detector #(.COLUMNS(COLUMNS), .ROWS(ROWS), .CHANNELS(CHANNELS), .STEPS(STEPS)) detector (
      .clk, .reset(!begun), .step_end, .read, .read_done, .tripped, .first, .at, .push, .found, .full, .frame(), .sent,
      .lost, .frame_over(), .not_returned, .counted_first(), .count_first(), .totals, .repeated_totals(),
      .states_ready(), .repeated_line(),
      .row_repeated, .value_repeated(), .states_sent, .totals_sent
  );

  // The taxel: which it is stands still.
  logic of_line, of_step, of_channel, exists;
  logic [2:0] address;
  assign exists  = 32'({of_channel, of_step}) < ROWS;
  assign address = {of_line, of_channel, of_step};

  // Reads end, and are reported later, each before the next one ends.
  logic unreported;
  logic [3:0] apart;  // clocks since the last report
  read_t ended, now, of_taxel;  // of the taxel: its last report may be judged when the next one has come
  // A fault must show soon: there a step may follow itself.
  assign step_end  = begun && wants_end && (!unreported || read_done) && (!LEMMAS || read.step[0] != ended.step[0]);
  assign read_done = begun && wants_done && unreported && apart >= 4'(APART - 1);

  // The taxel's count on its way, and clocks until it is judged; the first entries of a frame likewise.
  logic comes, trip, trip_first;
  logic [14:0] trip_at;
  logic [4:0] left;
  logic [4:0] since;
  logic with_frame;
  logic [2:0] markers, extra, ahead;  // entries ahead of the taxels'
  logic begins, follows;
  assign begins  = ended.frame_first && !ended.initial_frame;
  assign follows = begins && !ended.ended.initial_frame && ended.ended.format.version_2;
  assign extra   = 3'(follows) + (begins ? ended.markers : 3'd0);

  // What it holds, and what is to come of its count.
  logic [15:0] held, tick, value, moved, of_pattern;
  logic judged, returned, changes, spikes, other;
  logic [4:0] slot;
  assign judged   = comes && left == 5'd0;
  assign returned = of_taxel.pattern || !(trip && trip_first && trip_at == 15'd0);
  assign tick     = {trip_at, 1'b0} - 16'(trip_first);
  assign value    = of_taxel.pattern ? of_pattern : trip && tick < of_taxel.ramp ? tick : of_taxel.ramp;
  assign moved    = value > held ? value - held : held - value;
  assign spikes   = of_taxel.format.spikes;
  assign changes  = judged && exists && returned && !of_taxel.initial_frame
      && (spikes ? fires : moved > 16'(of_taxel.noise_floor));
  assign slot     = since - 5'(STAGES);
  assign other    = since >= 5'(STAGES) && slot < 5'(with_frame) + 5'(markers);

  always_ff @(posedge clk) begin
    early <= 1'b1;
    begun <= early;
    {of_line, of_step, of_channel} <= {of_line, of_step, of_channel};
    if (apart != 4'd15) apart <= apart + 4'd1;
    if (since != 5'd31) since <= since + 5'd1;
    if (comes) left <= left - 5'd1;
    if (left == 5'd5) of_pattern <= rolled;
    if (judged) comes <= 1'b0;
    if (step_end) ended <= read;
    unreported <= step_end || (unreported && !read_done);
    if (read_done) begin
      now        <= ended;
      apart      <= '0;
      since      <= 5'd1;
      with_frame <= follows;
      markers    <= begins ? ended.markers : 3'd0;
      if (ended.line[0] == of_line && ended.step[0] == of_step) begin
        comes    <= 1'b1;
        of_taxel <= ended;
        ahead    <= extra;
        left  <= 5'(STAGES - 1) + 5'(extra) + 5'(of_channel);
        {trip, trip_first, trip_at} <= {tripped[of_channel], first[of_channel], at[of_channel]};
      end
    end
    if (judged && exists && of_taxel.initial_frame) held <= '0;
    else if (changes && !spikes && !full) held <= value;
    if (!begun) begin
      {comes, unreported, with_frame, markers} <= '0;
      apart <= '1;
      since <= '1;
      held  <= detector.values[address];
    end
  end

  always_comb begin
    if (begun) begin
      // A fault must show with small counts, soon after reset.
      if (!LEMMAS) begin
        assume (read.ramp < 16'd8 && read.noise_floor < 8'd4 && held < 16'd8 && wants_end && wants_done);
        for (int c = 0; c < CHANNELS; c++) assume (at[c] < 15'd4);
        assume (rolled < 16'd8);
        assume (read.micros < 48'd8 && read.stamp < 16'd8 && read.threshold == '0 && integral < 16'd8);
        assume (read.ended.micros < 31'd8 && read.ended.lines == '0);
        assume (!read_done || !comes || ended.step[0] != of_step);
      end
      assume (read.line < 7'(COLUMNS) && read.step < 3'(STEPS) && read.markers <= 3'(MARKERS));
      if (judged) begin
        assert (push == (changes && !full) && sent == push && lost == (changes && full));
        assert (not_returned == (exists && !returned && !of_taxel.initial_frame));
        if (push) begin
          assert (found.kind == ENTRY_EVENT && found.x == of_taxel.line && found.y == 7'({of_channel, of_step}));
          assert (found.format == of_taxel.format);
          assert (found.at == (of_taxel.format.version_2 ? of_taxel.micros : micros_t'(of_taxel.stamp)));
          assert (found.value == (spikes ? integral : value) && found.more == (spikes ? fires_more : value >= held));
        end
      end else if (push && found.kind == ENTRY_EVENT) begin
        assert (!(found.x == 7'(of_line) && found.y == 7'({of_channel, of_step})));
      end
      // The end of a frame, then its markers, the oldest first.
      if (other) begin
        assert (push == !full && !sent);
        if (push && with_frame && slot == 5'd0)
          assert (found.kind == ENTRY_FRAME && length_of(found) == now.ended.micros);
        else if (push)
          assert (found.kind == ENTRY_MARKER && found.more == now.starts[2'(slot - 5'(with_frame))]);
        assert (lost == (full && !(with_frame && slot == 5'd0)));
      end else if (push) begin
        assert (found.kind == ENTRY_EVENT);
      end
      cover (judged && push && !spikes && held != 16'd0 && value < held && with_frame && markers == 3'd4);
      cover (judged && lost && of_channel);
      cover (judged && push && spikes);
      cover (judged && !returned && of_channel && exists);
      cover (judged && push && of_taxel.pattern && value > of_taxel.ramp);
    end
  end

  // What the detector holds meanwhile, without which the induction does not close.
  always_comb begin
    if (LEMMAS && begun) begin
      assert (!unreported || detector.ended == ended);
      assert (ended.line < 7'(COLUMNS) && ended.step < 3'(STEPS) && ended.markers <= 3'(MARKERS) || !unreported);
      // What was judged in the clock before is on its way to the memory.
      assert (held == (detector.storing && detector.storing_at == address ? detector.storing_value : detector.values[address]));
      assert (!comes || (left <= 5'd12 && since <= 5'd13));
      assert (!comes || since + left == 5'(STAGES) + 5'(ahead) + 5'(of_channel)
              || (since == 5'd1 && left == 5'd0 && ahead == 3'd5 && of_channel));
      assert (markers <= 3'(MARKERS) && (apart == 4'd15 ? since > 5'd15 : since == 5'(apart) + 5'd1));
      assert (!detector.counting || since <= 5'd8);
    end
  end

endmodule

// In place of the afferents: what they tell is any value at any time.
module taxel_afferents
  import taxel_types::*;
#(
    parameter int COLUMNS = 64,
    parameter int STEPS = 4,
    parameter int ADDRESS_BITS = 12
) (
    input  logic                    clk,
    input  logic                    begins,
    input  read_t                   read,
    input  logic [ADDRESS_BITS-1:0] address,
    input  logic [15:0]             ticks,
    input  threshold_t              threshold,
    input  logic                    sampled,
    input  logic                    returned,
    input  logic [ADDRESS_BITS-1:0] stored_at,
    output logic                    fires,
    output logic                    more,
    output logic [15:0]             intensity
);
  assign fires     = detector_proof.fires;
  assign more      = detector_proof.fires_more;
  assign intensity = detector_proof.integral;
endmodule

// In place of the pattern: a value that is any.
module taxel_pattern
  import taxel_types::*;
#(
    parameter int COLUMNS = 64,
    parameter int ROWS = 64,
    parameter int ROW_BITS = 6
) (
    input  logic                clk,
    input  logic                reset,
    input  logic                step_end,
    input  read_t               read,
    input  logic                read_done,
    input  logic [ROW_BITS-1:0] row,
    output logic [15:0]         value
);
  assign value = detector_proof.rolled;
endmodule
