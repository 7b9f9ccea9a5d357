// Datagrams of version 1 of the wire: an event becomes one or two words of five bytes, at most `MOST` words a datagram.
//
// A datagram ends with its frame, or before an event whose words would not fit. So the last byte of an event waits until it is
// known what comes next: the next event, or that its frame has no more.
//
// Throughput: a byte a clock: 5 for a word, 10 for an event with its value.
// Latency: a clock from an event that is taken to its first byte.
// Loses nothing: while the link waits, so does the queue.
module taxel_packer_v1 #(
    parameter bit VALUED = 1'b1,  // a change is followed by its intensity, as a spike always is
    parameter int MOST = 280      // words of a datagram
) (
    input  logic                clk,
    input  logic                reset,
    input  logic                ready,    // the oldest event stands at the queue's output
    input  taxel_types::event_t oldest,
    input  logic                allowed,  // it is of this version, and the other one's datagrams have gone
    output logic                busy,     // an event has not gone yet
    output logic                pop,
    input  logic                empty,    // the queue holds none
    input  logic                frame,    // of the events to come
    output logic [7:0]          tdata,
    output logic                tvalid,
    input  logic                tready,
    output logic                tlast
);

  import taxel_types::*;

  event_t now;
  logic marker, second, advance, valued, word_over, known, single, fits, ends, over;
  logic event_over;           // this is an event's last byte
  logic [1:0] room;           // for an event of two words, of one
  logic [1:0][8:0] more;      // words with it
  logic [2:0] at;             // which byte of the word
  logic [8:0] words;          // of the datagram, with this event's
  logic [15:0] field;

  // Whether the oldest event goes into the datagram too.
  assign single = oldest.kind == ENTRY_MARKER || !(VALUED || oldest.format.spikes);
  assign fits = allowed && oldest.frame == now.frame && room[single];

  assign word_over  = at == 3'd4;
  assign marker     = now.kind == ENTRY_MARKER;
  assign valued     = VALUED || now.format.spikes;
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
    // They stand long before an event's last byte.
    for (int k = 0; k < 2; k++) begin
      room[k] <= words <= 9'(k == 1 ? MOST - 1 : MOST - 2);
      more[k] <= words + 9'(2 - k);
    end
    if (advance) begin
      at         <= word_over ? 3'd0 : at + 3'd1;
      event_over <= at == 3'd3 && (marker || !valued || second);
      if (word_over) second <= !event_over;
      if (event_over) busy <= 1'b0;
    end
    if (pop) begin
      now   <= oldest;
      busy  <= 1'b1;
      over  <= 1'b0;
      words <= busy && fits ? more[single] : single ? 9'd1 : 9'd2;
    end
    if (reset) begin
      busy       <= 1'b0;
      at         <= '0;
      second     <= 1'b0;
      event_over <= 1'b0;
    end
  end

  // What is offered stands until it is taken.
  logic waits;
  logic [8:0] waiting;
  always_ff @(posedge clk) begin
    waits   <= tvalid && !tready && !reset;
    waiting <= {tlast, tdata};
    if (!reset && waits) assert (tvalid && {tlast, tdata} == waiting);
    if (!reset && busy) assert (at <= 3'd4);
  end

endmodule
