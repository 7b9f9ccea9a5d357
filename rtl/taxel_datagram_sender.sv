// Bytes of a datagram of version 2: its header, its body out of the buffer, its promise, and the CRC-32C of all of them.
module taxel_datagram_sender
  import taxel_types::*;
#(
    parameter int ROWS = 64,
    parameter logic [15:0] BOARD = 16'd0
) (
    input  logic        clk,
    input  logic        reset,
    input  logic [15:0] session,
    input  logic        write,     // of a unit into the buffer
    input  logic        bank,
    input  logic [9:0]  place,
    input  logic [15:0] unit,
    input  logic        send,      // one clock, where not sending
    input  datagram_t   datagram,
    output logic        sending,
    output logic [7:0]  tdata,
    output logic        tvalid,
    input  logic        tready,
    output logic        tlast
);

  localparam logic [4:0] STRIDE = 5'(ROWS > 1 ? $clog2(ROWS) : 0);
  localparam int HEADER = 18;
  localparam int SPAN = 2;
  localparam int CHECKSUM = 4;

  logic [15:0] buffer[2048];
  logic [15:0] fetched;
  datagram_t now;
  logic [10:0] at, at_next;  // byte of the datagram
  logic [10:0] body_end, length;
  logic [9:0] unit_next;
  logic busy, load, high;
  logic [31:0] crc;
  logic [143:0] head;
  logic [7:0] next;

  assign sending  = busy || tvalid;
  assign body_end = 11'(HEADER) + {now.units, 1'b0};
  assign length   = body_end + 11'(SPAN + CHECKSUM);
  assign head     = {
      {now.line[6:3], 1'b0, now.dropped, now.differences, now.frame_sync}, {now.line[2:0], STRIDE}, session, now.base,
      now.sequence_number, BOARD, {4'd2, now.kind}, 8'h54
  };
  assign load      = busy && (!tvalid || tready);
  assign at_next   = load ? at + 11'd1 : at;
  // The unit of the next byte is fetched in the clock before.
  assign unit_next = 10'((at_next - 11'(HEADER)) >> 1);
  assign high      = at[0] ^ HEADER[0];

  always_comb begin
    if (at < 11'(HEADER)) next = 8'(head >> {at[4:0], 3'd0});
    else if (at < body_end) next = high ? fetched[15:8] : fetched[7:0];
    else if (at < body_end + 11'(SPAN)) next = high ? now.span[15:8] : now.span[7:0];
    else next = 8'(~crc >> {2'(at - body_end - 11'(SPAN)), 3'd0});
  end

  always_ff @(posedge clk) begin
    if (write) buffer[{bank, place}] <= unit;
    fetched <= buffer[{now.bank, unit_next}];
    if (tvalid && tready) tvalid <= 1'b0;
    if (load) begin
      at     <= at_next;
      tdata  <= next;
      tvalid <= 1'b1;
      tlast  <= at == length - 11'd1;
      if (at < body_end + 11'(SPAN)) crc <= crc_32c(crc, next);
      if (at == length - 11'd1) busy <= 1'b0;
    end
    if (send) begin
      now  <= datagram;
      busy <= 1'b1;
      at   <= '0;
      crc  <= '1;
    end
    if (reset) begin
      busy   <= 1'b0;
      tvalid <= 1'b0;
    end
  end

endmodule
