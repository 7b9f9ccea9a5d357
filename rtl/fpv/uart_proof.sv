// The serial line, which is of no clock: whatever bytes come when, each is received once and unchanged.
//
// A bit has 16 clocks here; the sender's may be up to 2.7 % shorter or longer, begins at any sixteenth of a clock, and
// each edge is seen a clock later or not.
module uart_proof #(
    parameter bit LEMMAS = 1'b1
) (
    input logic       clk,
    input logic       wants,
    input logic [7:0] given,
    input logic [3:0] given_phase,
    input logic [8:0] given_length
);

  localparam int CLOCKS = 16;

  logic begun = 1'b0;
  logic [3:0] quiet;  // clocks that the line is quiet after reset, which lasts for most of them
  logic rx, valid, broken;
  logic [7:0] data;

  taxel_uart_rx #(.CLOCKS(CLOCKS)) receiver (.clk, .reset(!begun || quiet > 4'd4), .rx, .valid, .data, .broken);

  // A byte that is sent: since how many clocks, and from which sixteenth of one on; how long its bits are, in sixteenths.
  logic sending, waits, starts;
  logic [7:0] sent, clocks;
  logic [3:0] phase;
  logic [8:0] length;

  // The line so many clocks after a byte's start; high before it and after it.
  function automatic logic level(
      logic [7:0] byte_sent, logic [8:0] bits_length, logic [3:0] from, logic signed [9:0] clock);
    logic [9:0] frame;
    logic [12:0] passed;
    logic l;
    frame = {1'b1, byte_sent, 1'b0};
    passed = {1'b0, clock[7:0], 4'd0} + 13'(from);
    l = frame[0];
    for (int k = 1; k < 10; k++) if (passed >= 13'(k) * 13'(bits_length)) l = frame[k];
    return clock < 0 || l;
  endfunction

  assign rx     = !sending || level(sent, length, phase, 10'(clocks));
  assign starts = begun && wants && !sending && quiet == 4'd0;

  always_ff @(posedge clk) begin
    begun <= 1'b1;
    if (quiet != 4'd0) quiet <= quiet - 4'd1;
    clocks <= clocks + 8'd1;
    if (valid) waits <= 1'b0;
    if (starts) begin
      sending <= 1'b1;
      waits   <= 1'b1;
      clocks  <= '0;
      sent    <= given;
      phase   <= given_phase;
      length  <= given_length;
    end else if (sending && {1'b0, clocks, 4'd0} + 13'(phase) + 13'd16 >= 13'd10 * 13'(length)) begin
      sending <= 1'b0;
    end
    if (!begun) begin
      {sending, waits} <= '0;
      quiet <= '1;
    end
  end

  always_comb begin
    assume (given_length >= 9'd249 && given_length <= 9'd263);
    // A fault must show in one byte, whose bits are others in reverse and change one by one, and that comes at once
    // by a crossing that is never late.
    if (!LEMMAS) begin
      assume (given == 8'h55 && given_phase == 4'd0 && (given_length == 9'd249 || given_length == 9'd263));
      assume (wants && !receiver.settle.late);
    end
    if (begun && quiet == 4'd0) begin
      if (valid) assert (waits && data == sent);
      assert (!broken);
      // The next one may begin in the clock in which it is received.
      if (!sending) assert (!waits || valid);
      cover (valid && data == 8'hA5 && length == 9'd249);
      cover (starts && sent == 8'h00 && clocks == 8'd155);
    end
  end

  // What the receiver holds meanwhile, without which the induction does not close.
  logic [7:0] since;  // clocks since it began
  assign since = receiver.bits == 4'd10 ? 8'd7 - 8'(receiver.left)
               : receiver.bits == 4'd9 ? 8'd23 - 8'(receiver.left)
                                       : 8'd39 + {4'd8 - receiver.bits, 4'd0} - 8'(receiver.left);
  always_comb begin
    if (LEMMAS && begun) begin
      assert (!receiver.low || quiet > 4'd3);
      if (!sending) assert (receiver.settle.was && receiver.settle.unsettled && receiver.settle.to || quiet > 4'd8);
      if (quiet != 4'd0) assert (!sending && !waits && (quiet > 4'd3 || (!receiver.busy && !valid)));
      if (sending) begin
        assert (length >= 9'd249 && length <= 9'd263 && quiet == 4'd0);
        assert ({1'b0, clocks, 4'd0} + 13'(phase) < 13'd10 * 13'(length));
        assert (receiver.settle.was == level(sent, length, phase, 10'(clocks) - 10'sd1));
        assert (receiver.settle.unsettled == level(sent, length, phase, 10'(clocks) - 10'sd1)
                || receiver.settle.unsettled == level(sent, length, phase, 10'(clocks) - 10'sd2));
        assert (receiver.settle.to == level(sent, length, phase, 10'(clocks) - 10'sd2)
                || receiver.settle.to == level(sent, length, phase, 10'(clocks) - 10'sd3));
      end
      if (receiver.busy && quiet == 4'd0) begin
        assert (sending && waits && receiver.bits != 4'd0 && receiver.bits <= 4'd10 && receiver.left != 0);
        assert (receiver.left <= (receiver.bits == 4'd10 ? 5'd7 : 5'd16));
        assert (clocks == since + 8'd3 || clocks == since + 8'd4);
        for (int k = 0; k < 8; k++)
          if (receiver.bits <= 4'd9 && 4'(k) < 4'd9 - receiver.bits) assert (receiver.data[7-(4'd8-receiver.bits-4'(k))] == sent[k]);
      end
      if (sending && !receiver.busy && !valid) assert (waits ? clocks <= 8'd3 : clocks >= 8'd154);
      if (!sending && quiet == 4'd0) assert (!receiver.busy && waits == valid);
    end
  end

endmodule
