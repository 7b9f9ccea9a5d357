// Units of a datagram of version 2, two bytes each, the first in the low bits: its header, its body out of the buffer, its
// promise, and the CRC-32C of all of them.
//
// Throughput: a unit a clock in which the link accepts one.
// Latency: five clocks from `send` to the first unit.
// Loses nothing: while the link waits, so does it.
module taxel_datagram_sender #(
    parameter int ROWS = 64,
    parameter logic [15:0] BOARD = 16'd0
) (
    input  logic                   clk,
    input  logic                   reset,
    input  logic [15:0]            session,
    input  logic                   write,     // of a unit into the buffer
    input  logic                   bank,
    input  logic [9:0]             place,
    input  logic [15:0]            unit,
    input  logic                   send,      // one clock, where not sending
    input  taxel_types::datagram_t datagram,
    output logic                   sending,   // from the clock after `send` on
    output logic [15:0]            tdata,
    output logic                   tvalid,
    input  logic                   tready,
    output logic                   tlast
);

  import taxel_types::*;

  localparam logic [4:0] STRIDE = 5'(ROWS > 1 ? $clog2(ROWS) : 0);
  localparam int HEADER = 9;  // units
  localparam int SPAN = 1;
  localparam int CHECKSUM = 2;

  logic [15:0] buffer[2048];
  datagram_t now;
  logic [143:0] head;
  logic moves;

  // Four stages, which move together: what is fetched stands in a register as memory answers late, the unit is chosen,
  // and its CRC follows.
  typedef enum logic [1:0] {HEAD, BODY, PROMISE, SUM} part_t;

  typedef struct packed {
    logic        valid;
    logic        last;
    part_t       part;
    logic [9:0]  at;    // unit of the datagram
  } place_t;

  logic busy;
  logic [9:0] at, body_end, promise_end, last_at;
  place_t fetched, read, chosen;
  logic [15:0] unit_fetched, unit_read, data;
  logic [31:0] crc;

  assign moves   = !tvalid || tready;
  assign head    = {
      {now.line[6:3], 1'b0, now.dropped, now.differences, now.frame_sync}, {now.line[2:0], STRIDE}, session, now.base,
      now.sequence_number, BOARD, {4'd2, now.kind}, 8'h54
  };

  always_ff @(posedge clk) begin
    if (write) buffer[{bank, place}] <= unit;
    // They stand before the header has gone.
    body_end    <= 10'(HEADER) + now.units;
    promise_end <= body_end + 10'(SPAN);
    last_at     <= promise_end + 10'(CHECKSUM - 1);
    sending     <= send || busy || fetched.valid || read.valid || chosen.valid || tvalid;
    if (moves) begin
      fetched <= '{
          valid: busy,
          last: at == last_at && at >= 10'(HEADER),
          part: at < 10'(HEADER) ? HEAD : at < body_end ? BODY : at < promise_end ? PROMISE : SUM,
          at: at
      };
      unit_fetched <= buffer[{now.bank, at - 10'(HEADER)}];
      read         <= fetched;
      unit_read    <= unit_fetched;
      chosen       <= read;
      case (read.part)
        HEAD: data <= 16'(head >> {read.at[3:0], 4'd0});
        BODY: data <= unit_read;
        default: data <= now.span;
      endcase
      tvalid <= chosen.valid;
      tlast  <= chosen.last;
      tdata  <= chosen.part == SUM ? ~crc[15:0] : data;
      if (chosen.valid) crc <= chosen.part == SUM ? crc >> 16 : crc_32c(crc, data);
      at <= at + 10'd1;
      if (at == last_at && at >= 10'(HEADER)) busy <= 1'b0;
    end
    if (send) begin
      now  <= datagram;
      busy <= 1'b1;
      at   <= '0;
      crc  <= '1;
    end
    if (reset) begin
      {busy, tvalid, sending} <= '0;
      {fetched.valid, read.valid, chosen.valid} <= '0;
    end
  end

  // One datagram at a time, whose bank stands still.
  always_ff @(posedge clk) begin
    if (!reset) assert (!(send && sending) && !(write && busy && bank == now.bank));
  end

endmodule
