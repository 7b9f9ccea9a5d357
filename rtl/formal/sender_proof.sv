// The bytes of a datagram of version 2, whatever is written and whenever the link is ready: the header of wire version
// 2, the units of the body as they were written last, the promise, and the CRC-32C of all bytes before, worded here bit
// by bit.
//
// Of the body one unit is followed, at any place of either bank. What the packer's proof shows is assumed: a body has
// at most 688 units, and while a datagram is sent nothing is written into its bank.
module sender_proof
  import taxel_types::*;
#(
    parameter bit LEMMAS = 1'b1
) (
    input logic        clk,
    input logic        write,
    input logic        bank,
    input logic [9:0]  place,
    input logic [15:0] unit,
    input logic        send,
    input datagram_t   datagram,
    input logic        tready
);

  localparam logic [15:0] BOARD = 16'hB0A2;
  localparam int MOST = 688;

  logic begun = 1'b0;
  logic sending, tvalid, tlast;
  logic [7:0] tdata;
  // What stands still: the session, and which unit is followed.
  logic [15:0] session;
  logic followed_bank;
  logic [9:0] followed_place;

  taxel_datagram_sender #(.ROWS(64), .BOARD(BOARD)) sender (
      .clk, .reset(!begun), .session, .write, .bank, .place, .unit, .send, .datagram, .sending, .tdata, .tvalid,
      .tready, .tlast
  );

  datagram_t of_now;
  logic known, moves, waited, last_before;
  logic [15:0] followed;
  logic [10:0] at, length, in_body;  // which byte is due, and of how many
  logic [31:0] crc;
  logic [7:0] data_before;
  logic [5:0] age;  // clocks

  function automatic logic [31:0] divided(logic [31:0] crc, logic [7:0] data);
    logic [31:0] c;
    c = crc;
    for (int k = 0; k < 8; k++) c = {1'b0, c[31:1]} ^ (c[0] != data[k] ? 32'h82F63B78 : 32'd0);
    return c;
  endfunction

  // The header as the page of version 2 lists it, byte 0 in the lowest bits.
  logic [17:0][7:0] header;
  assign header[0]      = 8'h54;
  assign header[1]      = {4'd2, of_now.kind};
  assign header[3:2]    = BOARD;
  assign header[7:4]    = of_now.sequence_number;
  assign header[13:8]   = of_now.base;
  assign header[15:14]  = session;
  assign header[16]     = {of_now.line[2:0], 5'd6};
  assign header[17]     = {of_now.line[6:3], 1'b0, of_now.dropped, of_now.differences, of_now.frame_sync};

  assign moves   = begun && tvalid && tready;
  assign length  = 11'd24 + {of_now.units, 1'b0};
  assign in_body = at - 11'd18;

  always_ff @(posedge clk) begin
    begun          <= 1'b1;
    age            <= age + 6'd1;
    session        <= session;
    followed_bank  <= followed_bank;
    followed_place <= followed_place;
    if (begun && write && bank == followed_bank && place == followed_place) begin
      known    <= 1'b1;
      followed <= unit;
    end
    if (begun && send) of_now <= datagram;
    if (moves) begin
      at  <= tlast ? 11'd0 : at + 11'd1;
      // Of the bytes before it.
      crc <= tlast ? '1 : at < length - 11'd4 ? divided(crc, tdata) : crc;
    end
    waited      <= begun && tvalid && !tready;
    data_before <= tdata;
    last_before <= tlast;
    if (!begun) begin
      {known, waited, at, age} <= '0;
      crc <= '1;
    end
  end

  always_comb begin
    if (begun) begin
      assume (!send || (!sending && !write && datagram.units <= 10'(MOST)));
      assume (!(write && sending && bank == of_now.bank));
      // A fault must show in one datagram: two units in the second bank, with pauses of the link.
      if (!LEMMAS) begin
        assume (write == (age == 6'd1 || age == 6'd2) && bank && place == 10'(age == 6'd2));
        assume (unit == (age == 6'd1 ? 16'hA55A : 16'h1234) && followed_place == 10'd1 && followed_bank);
        assume (send == (age == 6'd4) && tready == (age[2:0] != 3'd6) && session == 16'hBEEF);
        assume (datagram == datagram_t'{kind: 4'd1, frame_sync: 1'b1, differences: 1'b0, dropped: 1'b1,
                                        sequence_number: 32'd7, base: 48'h123456789ABC, line: 7'h5B,
                                        span: 16'hFEDC, units: 10'd2, bank: 1'b1});
      end
      if (tvalid) begin
        if (at < 11'd18) assert (tdata == header[at[4:0]]);
        else if (at < length - 11'd6) begin
          if (known && of_now.bank == followed_bank && in_body[10:1] == followed_place)
            assert (tdata == (in_body[0] ? followed[15:8] : followed[7:0]));
        end else if (at < length - 11'd4)
          assert (tdata == (at == length - 11'd6 ? of_now.span[7:0] : of_now.span[15:8]));
        else assert (tdata == 8'(~crc >> {2'(at - length), 3'd0}));
        assert (tlast == (at == length - 11'd1) && at < length && length <= 11'd1400);
        assert (sending);
      end
      if (waited) assert (tvalid && tdata == data_before && tlast == last_before);
      // It does not rest before the last byte has gone.
      if (at != 11'd0) assert (sending);
      cover (moves && tlast && known && of_now.units == 10'd1
             && followed_bank == of_now.bank && followed_place == 10'd0);
      cover (moves && tlast && of_now.bank && waited);
    end
  end

  // What the sender holds meanwhile, without which the induction does not close: of the bytes on their way, which are
  // of places one behind the other, the last is chosen and comes out next.
  localparam int STAGES = 3;
  logic [STAGES-1:0] held;  // which stages hold a byte: it is fetched, read, chosen
  logic [STAGES-1:0][10:0] place_of;
  logic [STAGES-1:0][1:0] part_of;
  logic [STAGES-1:0] last_of;
  logic [10:0] due;  // where the next one is fetched

  function automatic logic [1:0] part_at(logic [10:0] place_in, logic [10:0] bytes);
    return place_in < 11'd18 ? 2'd0 : place_in < bytes - 11'd6 ? 2'd1 : place_in < bytes - 11'd4 ? 2'd2 : 2'd3;
  endfunction

  function automatic logic is_followed(logic [10:0] place_in, logic [10:0] bytes);
    return known && of_now.bank == followed_bank && place_in >= 11'd18 && place_in < bytes - 11'd6
        && 10'((place_in - 11'd18) >> 1) == followed_place;
  endfunction

  assign held     = {sender.chosen.valid, sender.read.valid, sender.fetched.valid};
  assign place_of = {sender.chosen.at, sender.read.at, sender.fetched.at};
  assign part_of  = {2'(sender.chosen.part), 2'(sender.read.part), 2'(sender.fetched.part)};
  assign last_of  = {sender.chosen.last, sender.read.last, sender.fetched.last};
  assign due      = at + 11'(tvalid) + 11'(held[2]) + 11'(held[1]) + 11'(held[0]);

  always_comb begin
    if (LEMMAS && begun) begin
      if (known) assert (sender.buffer[{followed_bank, followed_place}] == followed);
      assert (of_now.units <= 10'(MOST) || !sending);
      if (sender.busy || held != 0 || tvalid) assert (sending && sender.now == of_now);
      else assert (at == 11'd0);
      // From the first byte on they come without a gap, to the last one.
      if (sender.busy) begin
        assert (sender.at == due && due < length);
        if (!(&held && tvalid)) assert (at == 11'd0);
        assert (!tvalid || held[2]);
        assert (!held[2] || held[1]);
        assert (!held[1] || held[0]);
      end else begin
        if (held != 0 || tvalid) assert (due == length && tvalid);
        assert (!held[0] || held[1]);
        assert (!held[1] || held[2]);
      end
      // They stand a clock, two and three after the header was taken.
      if (sending && (!sender.busy || due >= 11'd1)) assert (sender.body_end == length - 11'd6 || due == 11'd0);
      if (sending && (!sender.busy || due >= 11'd2)) assert (sender.promise_end == length - 11'd4 || due == 11'd0);
      if (sending && (!sender.busy || due >= 11'd3)) assert (sender.last_at == length - 11'd1 || due == 11'd0);
      for (int k = 0; k < STAGES; k++) begin
        if (held[k]) begin
          assert (place_of[k] < length && part_of[k] == part_at(place_of[k], length));
          assert (last_of[k] == (place_of[k] == length - 11'd1));
        end
      end
      if (held[2]) assert (place_of[2] == at + 11'(tvalid));
      if (held[1]) assert (place_of[1] == at + 11'(tvalid) + 11'(held[2]));
      if (held[0]) assert (place_of[0] == at + 11'(tvalid) + 11'(held[2]) + 11'(held[1]));
      if (held[0] && is_followed(place_of[0], length)) assert (sender.unit_fetched == followed);
      if (held[1] && is_followed(place_of[1], length)) assert (sender.unit_read == followed);
      if (held[2]) begin
        if (part_of[2] == 2'd0) assert (sender.data == header[place_of[2][4:0]]);
        if (is_followed(place_of[2], length)) assert (sender.data == (place_of[2][0] ? followed[15:8] : followed[7:0]));
        if (part_of[2] == 2'd2) assert (sender.data == (place_of[2][0] ? of_now.span[15:8] : of_now.span[7:0]));
      end
      if (at == 11'd0) assert (crc == '1);
      if (tvalid)
        assert (sender.crc == (at < length - 11'd4 ? divided(crc, tdata) : crc >> {3'(at - length + 11'd5), 3'd0}));
      else if (sender.busy || held != 0) assert (sender.crc == '1);
    end
  end

endmodule
