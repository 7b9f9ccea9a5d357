// Datagrams as beats of the link, of one byte or of four: of version 1 byte by byte, of version 2 two bytes at a time. A beat of
// four holds as many bytes of a datagram as there are, from the lowest bits on; `tkeep` says which.
//
// Throughput: a beat a clock: a byte where the link has one, else what comes.
// Latency: a clock from a beat's last byte.
// Loses nothing: while the link waits, so do the packers.
module taxel_link #(
    parameter int BYTES = 1
) (
    input  logic               clk,
    input  logic               reset,
    input  logic               valid,
    output logic               ready,
    input  logic               paired,  // two bytes, the first in the low bits: for all of a datagram
    input  logic [15:0]        data,
    input  logic               last,
    output logic [8*BYTES-1:0] tdata,
    output logic [BYTES-1:0]   tkeep,   // the bytes that there are
    output logic               tvalid,
    input  logic               tready,
    output logic               tlast
);

  logic offered, room, ends;  // a beat
  logic [BYTES-1:0][7:0] beat;
  logic [BYTES-1:0] keep;

  if (BYTES == 1) begin : g_byte
    logic second;  // of two, the first has gone

    assign offered = valid;
    assign beat    = second ? data[15:8] : data[7:0];
    assign keep    = 1'b1;
    assign ready   = room && second == paired;
    assign ends    = last && second == paired;

    always_ff @(posedge clk) begin
      if (valid && room) second <= second != paired;
      if (reset) second <= 1'b0;
    end
  end else if (BYTES == 4) begin : g_four
    logic [BYTES-1:0][7:0] held;
    logic [1:0] at, to;  // which byte of the beat comes, and which is the last that does

    assign to      = at + 2'(paired);
    assign offered = valid && (to == 2'd3 || last);
    assign ready   = room;
    assign ends    = last;

    always_comb begin
      beat = held;
      for (int k = 0; k < BYTES; k++) begin
        if (2'(k) == at) beat[k] = data[7:0];
        else if (2'(k) == to) beat[k] = data[15:8];
        keep[k] = 2'(k) <= to;
      end
    end

    always_ff @(posedge clk) begin
      if (valid && room) begin
        held <= beat;
        at   <= last ? 2'd0 : to + 2'd1;
      end
      if (reset) at <= '0;
    end
  end else begin : g_none
    $error("LINK_BYTES: the link has 1 or 4");
  end

  taxel_stream_register #(.BITS(9 * BYTES + 1)) register (
      .clk, .reset, .valid_in(offered), .ready_in(room), .data_in({ends, keep, beat}),
      .valid_out(tvalid), .ready_out(tready), .data_out({tlast, tkeep, tdata})
  );

endmodule
