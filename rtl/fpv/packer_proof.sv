// The packer of version 1 behind a queue of two: whatever comes when, the bytes of a marked event are its fields, in order.
//
// All entries are of this version. The lowest bit of a stamp is its frame's here, so that the bytes show which frame an event is of.
module packer_proof
  import taxel_types::*;
(
    input logic   clk,
    input logic   wants,
    input event_t given,
    input logic   frame_ends,
    input logic   mark,
    input logic   tready
);

  localparam int MOST = 5;  // words of a datagram, here

  logic begun = 1'b0;
  logic push, pop, full, empty, ready, frame, tvalid, tlast;
  logic [7:0] tdata;
  event_t entered, oldest;
  logic pushed;

  always_comb begin
    // What this version does not send is 0.
    entered = '0;
    entered.kind = entry_kind_t'({1'b0, given.kind[0]});
    entered.frame = frame;
    entered.at[15:0] = {given.at[15:1], frame};
    {entered.x, entered.y, entered.more, entered.value} = length_of(given);
  end

  assign push = begun && wants && !full;

  taxel_event_fifo #(.DEPTH(2), .BITS($bits(event_t))) queue (
      .clk, .reset(!begun), .push, .entered, .full, .empty, .ready, .oldest, .pop
  );

  taxel_packer_v1 #(.MOST(MOST)) packer (
      .clk, .reset(!begun), .ready, .oldest, .allowed(1'b1), .busy(), .pop, .empty, .frame, .tdata, .tvalid, .tready, .tlast
  );

  // What goes out: which byte of a word, which word of an event, which word of a datagram.
  logic [2:0] at;
  logic second, marker, opened, first_frame;
  logic [8:0] words;
  // The marked event, and how many go before it.
  event_t marked_event;
  logic marked, gone;
  logic [2:0] level, ahead;
  logic moves, word_over, event_over;
  logic [7:0] wanted;
  logic [15:0] field;
  // What waited in the clock before.
  logic waited, last_before;
  logic [7:0] data_before;

  assign moves = begun && tvalid && tready;
  assign word_over = at == 3'd4;
  assign event_over = word_over && (marker || second);
  assign field = second ? marked_event.value : marked_event.at[15:0];

  always_comb begin
    case (at)
      3'd0: wanted = {1'b1, marked_event.more, second, 1'b0, marked_event.kind == ENTRY_MARKER, 1'b0, field[15:14]};
      3'd1: wanted = {1'b0, field[13:7]};
      3'd2: wanted = {1'b0, field[6:0]};
      3'd3: wanted = {2'b00, marked_event.x[5:0]};
      default: wanted = {2'b00, marked_event.y[5:0]};
    endcase
  end

  always_ff @(posedge clk) begin
    begun <= 1'b1;
    if (frame_ends && (pushed || push)) frame <= !frame;
    pushed <= frame_ends ? 1'b0 : pushed || push;
    if (moves) begin
      at <= word_over ? 3'd0 : at + 3'd1;
      if (at == 3'd0) marker <= tdata[3];
      if (at == 3'd2 && !second) begin
        opened <= 1'b1;
        if (!opened) first_frame <= tdata[0];
      end
      if (word_over) begin
        second <= !event_over;
        words  <= words + 9'd1;
      end
      if (tlast) begin
        words  <= '0;
        opened <= 1'b0;
      end
    end
    level <= level + 3'(push) - 3'(moves && event_over);
    if (push && mark && !marked) begin
      marked       <= 1'b1;
      marked_event <= entered;
      ahead        <= level - 3'(moves && event_over);
    end else if (marked && !gone && moves && event_over) begin
      if (ahead == 0) gone <= 1'b1;
      else ahead <= ahead - 3'd1;
    end
    waited      <= begun && tvalid && !tready;
    data_before <= tdata;
    last_before <= tlast;
    if (!begun) begin
      {frame, pushed, at, second, marker, opened, words, level, marked, gone, waited} <= '0;
    end
  end

  always_comb begin
    if (begun && tvalid) begin
      assert (tdata[7] == (at == 3'd0));
      assert (level != 0);
      // A datagram ends with an event, holds at most MOST words, and events of one frame.
      assert (!tlast || event_over);
      assert (words < 9'(MOST));
      if (at == 3'd2 && !second && opened) assert (tdata[0] == first_frame);
      if (marked && !gone && ahead == 0) assert (tdata == wanted);
    end
    // What waits is not withdrawn.
    if (begun && waited) assert (tvalid && tdata == data_before && tlast == last_before);
    if (begun && marked && !gone) assert (ahead < level);
    if (begun) begin
      cover (gone && tlast && moves);
      cover (moves && tlast && words == 9'(MOST - 1));
      cover (moves && marker && event_over && !tlast);
    end
  end

endmodule
