// Datagrams of version 1 of the wire: an event becomes one or two words of five bytes, at most `MOST` words a datagram.
//
// A datagram ends with its frame, or before an event whose words would not fit. So the last byte of an event waits until it is
// known what comes next: the next event, or that its frame has no more.
module taxel_packer_v1
  import taxel_types::*;
#(
    parameter bit VALUED = 1'b1,  // a change is followed by its intensity
    parameter int MOST = 280      // words of a datagram
) (
    input  logic       clk,
    input  logic       reset,
    input  logic       ready,    // the oldest event stands at the queue's output
    input  event_t     oldest,
    input  logic       allowed,  // it is of this version, and the other one's datagrams have gone
    output logic       busy,     // an event has not gone yet
    output logic       pop,
    input  logic       empty,    // the queue holds none
    input  logic       frame,    // of the events to come
    output logic [7:0] tdata,
    output logic       tvalid,
    input  logic       tready,
    output logic       tlast
);

  event_t now;
  logic marker, second, advance, word_over, event_over, known, single, fits, ends, over;
  logic [2:0] at;             // which byte of the word
  logic [8:0] words;          // of the datagram, with this event's
  logic [15:0] field;

  // Whether the oldest event goes into the datagram too.
  assign single = oldest.kind == ENTRY_MARKER || !VALUED;
  assign fits = allowed && oldest.frame == now.frame && words <= 9'(single ? MOST - 1 : MOST - 2);

  assign word_over  = at == 3'd4;
  assign marker     = now.kind == ENTRY_MARKER;
  assign event_over = word_over && (marker || !VALUED || second);
  // Once it is known that its frame has no more, that stays so: what waits is not withdrawn.
  assign known      = ready || over || (empty && frame != now.frame);
  assign ends       = !(ready && fits);

  assign field  = second ? now.value : now.at[15:0];
  assign tvalid = busy && (!event_over || known);
  assign tlast  = event_over && ends;
  assign advance = tvalid && tready;
  // An event is taken when the one before has gone.
  assign pop = ready && allowed && (!busy || (advance && event_over));

  always_comb begin
    case (at)
      3'd0: tdata = {1'b1, now.more, second, 1'b0, marker, 1'b0, field[15:14]};
      3'd1: tdata = {1'b0, field[13:7]};
      3'd2: tdata = {1'b0, field[6:0]};
      3'd3: tdata = {2'b00, now.x[5:0]};
      default: tdata = {2'b00, now.y[5:0]};
    endcase
  end

  always_ff @(posedge clk) begin
    if (empty && frame != now.frame) over <= 1'b1;
    if (advance) begin
      at <= word_over ? 3'd0 : at + 3'd1;
      if (word_over) second <= !event_over;
      if (event_over) busy <= 1'b0;
    end
    if (pop) begin
      now   <= oldest;
      busy  <= 1'b1;
      over  <= 1'b0;
      words <= (busy && fits ? words : 9'd0) + (single ? 9'd1 : 9'd2);
    end
    if (reset) begin
      busy   <= 1'b0;
      at     <= '0;
      second <= 1'b0;
    end
  end

endmodule
