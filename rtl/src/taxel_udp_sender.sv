// Datagrams' payloads, byte by byte on the scan's clock, become frames of Ethernet on the link's clock of 125 MHz,
// which is free.
//
// It sends only: addresses are fixed, as it asks nobody for the receiver's (no ARP) and hears no answer. A payload is
// gathered whole, as its length comes first in a frame, in one of two banks; while both wait for the link, so does the
// core. Each bank changes hands by a bit that crosses through two flip-flops: what the bank holds, and how much, stands
// still meanwhile.
//
// Throughput: a byte a clock, and a frame of n bytes of payload every n + 67 clocks of the link.
// Latency: a payload is gathered whole, then its bank crosses to the link's clock.
// Loses bytes of a payload beyond MOST, which are not counted: the core has none. While both banks wait for the link, so does
// the core.
module taxel_udp_sender #(
    parameter logic [47:0] FROM_MAC  = 48'h02_54_41_58_00_00,  // locally administered
    parameter logic [47:0] TO_MAC    = 48'hFF_FF_FF_FF_FF_FF,  // of the host, or all
    parameter logic [31:0] FROM_IP   = {8'd192, 8'd168, 8'd52, 8'd8},
    parameter logic [31:0] TO_IP     = {8'd192, 8'd168, 8'd52, 8'd1},
    parameter logic [15:0] FROM_PORT = 16'd5208,
    parameter logic [15:0] TO_PORT   = 16'd5208,
    parameter int          MOST      = 1472                    // bytes of a payload; of a longer one, the first
) (
    input  logic       clk,
    input  logic       reset,      // for eight clocks of the link or more
    input  logic [7:0] tdata,
    input  logic       tvalid,
    output logic       tready,
    input  logic       tlast,
    input  logic       clk_link,
    output logic [7:0] txd,
    output logic       tx_enable
);

  localparam int BITS = $clog2(MOST + 1);

  // On the scan's clock: the bank that is filled, and which banks were handed over, each an alternating bit.
  logic filled;
  logic [BITS-1:0] place;
  logic [1:0] given, taken_here;
  logic [1:0][BITS-1:0] lengths;
  logic room;  // for a further byte
  logic [BITS-1:0] size;  // of the payload with this byte

  assign tready = given[filled] == taken_here[filled];
  assign room   = place != BITS'(MOST);
  assign size   = room ? place + BITS'(1) : place;

  always_ff @(posedge clk) begin
    if (tvalid && tready) begin
      place <= size;
      if (tlast) begin
        given[filled] <= !given[filled];
        filled        <= !filled;
        place         <= '0;
      end
    end
    if (reset) begin
      filled <= 1'b0;
      place  <= '0;
      given  <= '0;
    end
  end

  // On the link's: the bank that is sent.
  logic reset_link, sent, waits, taken_now;
  logic [1:0] taken, given_there;
  logic [BITS-1:0] at;
  logic [7:0] fetched;

  taxel_synchroniser to_reset (.clk(clk_link), .from(reset), .to(reset_link));

  for (genvar bank = 0; bank < 2; bank++) begin : g_bank
    taxel_synchroniser to_given (.clk(clk_link), .from(given[bank]), .to(given_there[bank]));
    taxel_synchroniser to_taken (.clk, .from(taken[bank]), .to(taken_here[bank]));
    taxel_standing_word #(.BITS(BITS)) length (
        .clk, .take(tvalid && tready && tlast && filled == 1'(bank)), .word(size), .stands(lengths[bank])
    );
  end

  taxel_two_clock_memory #(.BITS(8), .PLACES(BITS + 1)) payload (
      .clk_write(clk), .write(tvalid && tready && room), .at_write({filled, place}), .word_written(tdata),
      .clk_read(clk_link), .at_read({sent, at}), .word_read(fetched)
  );

  assign waits = given_there[sent] != taken[sent];

  always_ff @(posedge clk_link) begin
    if (taken_now) begin
      taken[sent] <= !taken[sent];
      sent        <= !sent;
    end
    if (reset_link) begin
      taken <= '0;
      sent  <= 1'b0;
    end
  end

  taxel_ethernet_frame #(
      .FROM_MAC(FROM_MAC),
      .TO_MAC(TO_MAC),
      .FROM_IP(FROM_IP),
      .TO_IP(TO_IP),
      .FROM_PORT(FROM_PORT),
      .TO_PORT(TO_PORT),
      .BITS(BITS)
  ) frame (
      .clk(clk_link),
      .reset(reset_link),
      .waits,
      .length(lengths[sent]),
      .at,
      .fetched,
      .taken(taken_now),
      .txd,
      .enable(tx_enable)
  );

  always_ff @(posedge clk) if (!reset) assert (place <= BITS'(MOST));

endmodule
