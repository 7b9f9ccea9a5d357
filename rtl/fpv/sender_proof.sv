// The units of a datagram of version 2, two bytes each, whatever is written and whenever the link is ready: the header of wire version
// 2, the units of the body as they were written last, the promise, and the CRC-32C of all units before, by
// the sum that `crc_proof` is of.
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
  logic [15:0] tdata;
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
  logic [9:0] at, length;  // which unit is due, and of how many
  // The CRC of the units before the one that is due; and with it, summed as it comes, of what is asserted to be both: of a sum
  // made here the solver does not find in time that it is the sender's.
  logic [31:0] crc, crc_from, crc_with;
  logic [15:0] unit_of;
  logic [15:0] data_before;
  logic [5:0] age;  // clocks

  // The header as the page of version 2 lists it, unit 0 in the lowest bits.
  logic [8:0][15:0] header;
  assign header[0]   = {4'd2, of_now.kind, 8'h54};
  assign header[1]   = BOARD;
  assign header[3:2] = of_now.sequence_number;
  assign header[6:4] = of_now.base;
  assign header[7]   = session;
  assign header[8]   = {
      of_now.line[6:3], 1'b0, of_now.dropped, of_now.differences, of_now.frame_sync, of_now.line[2:0], 5'd6
  };

  assign moves   = begun && tvalid && tready;
  assign length  = 10'd12 + of_now.units;

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
      at  <= tlast ? 10'd0 : at + 10'd1;
      crc <= tlast ? '1 : at < length - 10'd2 ? crc_with : crc;
    end
    if (begun && sender.moves && sender.chosen.valid) begin
      crc_from <= sender.crc;
      unit_of  <= sender.data;
      crc_with <= crc_32c(sender.crc, sender.data);
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
        if (at < 10'd9) assert (tdata == header[at[3:0]]);
        else if (at < length - 10'd3) begin
          if (known && of_now.bank == followed_bank && at - 10'd9 == followed_place) assert (tdata == followed);
        end else if (at == length - 10'd3) assert (tdata == of_now.span);
        else assert (tdata == 16'(~crc >> {1'(at - length), 4'd0}));
        if (at < length - 10'd2) assert (crc_from == crc && unit_of == tdata && sender.crc == crc_with);
        // At most 1400 bytes.
        assert (tlast == (at == length - 10'd1) && at < length && length <= 10'd700);
        assert (sending);
      end
      if (waited) assert (tvalid && tdata == data_before && tlast == last_before);
      // It does not rest before the last unit has gone.
      if (at != 10'd0) assert (sending);
      cover (moves && tlast && known && of_now.units == 10'd1
             && followed_bank == of_now.bank && followed_place == 10'd0);
      cover (moves && tlast && of_now.bank && waited);
    end
  end

  // What the sender holds meanwhile, without which the induction does not close: of the units on their way, which are
  // of places one behind the other, the last is chosen and comes out next.
  localparam int STAGES = 3;
  logic [STAGES-1:0] held;  // which stages hold a unit: it is fetched, read, chosen
  logic [STAGES-1:0][9:0] place_of;
  logic [STAGES-1:0][1:0] part_of;
  logic [STAGES-1:0] last_of;
  logic [9:0] due;  // where the next one is fetched

  function automatic logic [1:0] part_at(logic [9:0] place_in, logic [9:0] units);
    return place_in < 10'd9 ? 2'd0 : place_in < units - 10'd3 ? 2'd1 : place_in < units - 10'd2 ? 2'd2 : 2'd3;
  endfunction

  function automatic logic is_followed(logic [9:0] place_in, logic [9:0] units);
    return known && of_now.bank == followed_bank && place_in >= 10'd9 && place_in < units - 10'd3
        && place_in - 10'd9 == followed_place;
  endfunction

  assign held     = {sender.chosen.valid, sender.read.valid, sender.fetched.valid};
  assign place_of = {sender.chosen.at, sender.read.at, sender.fetched.at};
  assign part_of  = {2'(sender.chosen.part), 2'(sender.read.part), 2'(sender.fetched.part)};
  assign last_of  = {sender.chosen.last, sender.read.last, sender.fetched.last};
  assign due      = at + 10'(tvalid) + 10'(held[2]) + 10'(held[1]) + 10'(held[0]);

  always_comb begin
    if (LEMMAS && begun) begin
      if (known) assert (sender.buffer[{followed_bank, followed_place}] == followed);
      assert (of_now.units <= 10'(MOST) || !sending);
      if (sender.busy || held != 0 || tvalid) assert (sending && sender.now == of_now);
      else assert (at == 10'd0);
      // From the first unit on they come without a gap, to the last one.
      if (sender.busy) begin
        assert (sender.at == due && due < length);
        if (!(&held && tvalid)) assert (at == 10'd0);
        assert (!tvalid || held[2]);
        assert (!held[2] || held[1]);
        assert (!held[1] || held[0]);
      end else begin
        if (held != 0 || tvalid) assert (due == length && tvalid);
        assert (!held[0] || held[1]);
        assert (!held[1] || held[2]);
      end
      // They stand a clock, two and three after the header was taken.
      if (sending && (!sender.busy || due >= 10'd1)) assert (sender.body_end == length - 10'd3 || due == 10'd0);
      if (sending && (!sender.busy || due >= 10'd2)) assert (sender.promise_end == length - 10'd2 || due == 10'd0);
      if (sending && (!sender.busy || due >= 10'd3)) assert (sender.last_at == length - 10'd1 || due == 10'd0);
      for (int k = 0; k < STAGES; k++) begin
        if (held[k]) begin
          assert (place_of[k] < length && part_of[k] == part_at(place_of[k], length));
          assert (last_of[k] == (place_of[k] == length - 10'd1));
        end
      end
      if (held[2]) assert (place_of[2] == at + 10'(tvalid));
      if (held[1]) assert (place_of[1] == at + 10'(tvalid) + 10'(held[2]));
      if (held[0]) assert (place_of[0] == at + 10'(tvalid) + 10'(held[2]) + 10'(held[1]));
      if (held[0] && is_followed(place_of[0], length)) assert (sender.unit_fetched == followed);
      if (held[1] && is_followed(place_of[1], length)) assert (sender.unit_read == followed);
      if (held[2]) begin
        if (part_of[2] == 2'd0) assert (sender.data == header[place_of[2][3:0]]);
        if (is_followed(place_of[2], length)) assert (sender.data == followed);
        if (part_of[2] == 2'd2) assert (sender.data == of_now.span);
      end
      if (at == 10'd0) assert (crc == '1);
      if (tvalid && at >= length - 10'd2) assert (sender.crc == crc >> {2'(at - length + 10'd3), 4'd0});
      if (!tvalid && (sender.busy || held != 0)) assert (sender.crc == '1);
    end
  end

endmodule
