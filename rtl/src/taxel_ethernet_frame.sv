// A UDP datagram as a frame of Ethernet, a byte a clock: preamble, headers, payload, padding to 60 bytes, check
// sequence, gap.
//
// Lengths and the header's checksum follow the payload's length. The checksum of UDP is 0, which is none (RFC 768): the
// frame has its check sequence. What the sender's two addresses and ports are is fixed.
//
// Throughput: a frame of n bytes of payload every n + 67 clocks, of less than 18 bytes every 85.
// Latency: five clocks from `waits` to the first byte.
// Loses nothing: a payload is there before its frame begins.
module taxel_ethernet_frame #(
    parameter logic [47:0] FROM_MAC  = '0,
    parameter logic [47:0] TO_MAC    = '1,
    parameter logic [31:0] FROM_IP   = '0,
    parameter logic [31:0] TO_IP     = '0,
    parameter logic [15:0] FROM_PORT = '0,
    parameter logic [15:0] TO_PORT   = '0,
    parameter int          BITS      = 11
) (
    input  logic            clk,
    input  logic            reset,
    input  logic            waits,    // a payload of `length` bytes, one or more
    input  logic [BITS-1:0] length,
    output logic [BITS-1:0] at,       // the byte of it that is asked for
    input  logic [7:0]      fetched,  // a clock later
    output logic            taken,    // all of it was asked for: one clock
    output logic [7:0]      txd,
    output logic            enable
);

  import taxel_types::*;

  localparam int PREAMBLE = 8;
  localparam int HEADERS = 14 + 20 + 8;
  localparam int LEAST = 60 - HEADERS;  // bytes of a payload with its padding
  localparam int GAP = 12;

  // What no length is in: of IP version 4, header of five words, not to be fragmented, 64 hops at most, UDP.
  localparam logic [8*(PREAMBLE+HEADERS)-1:0] FIXED = {
      64'h55_55_55_55_55_55_55_D5, TO_MAC, FROM_MAC, 16'h0800,
      16'h4500, 16'd0, 16'd0, 16'h4000, 8'd64, 8'd17, 16'd0, FROM_IP, TO_IP, FROM_PORT, TO_PORT, 16'd0, 16'd0
  };
  localparam int TOTAL = PREAMBLE + 14 + 2;     // where they go: both bytes of the IP packet's length,
  localparam int CHECKSUM = PREAMBLE + 14 + 10; // of its header's checksum,
  localparam int LENGTH = PREAMBLE + 14 + 20 + 4;  // and of the UDP datagram's length

  // The sum of two words in ones' complement.
  function automatic logic [15:0] added(logic [15:0] a, logic [15:0] b);
    logic [16:0] sum;
    sum = 17'(a) + 17'(b);
    return sum[15:0] + 16'(sum[16]);
  endfunction

  // Of the header's words without the length.
  function automatic logic [15:0] sum_of_fixed();
    logic [15:0] sum;
    sum = 16'd0;
    for (int k = 0; k < 10; k++) sum = added(sum, FIXED[8*(HEADERS-14-2*k)-1-:16]);
    return sum;
  endfunction

  localparam logic [15:0] SUM = sum_of_fixed();

  typedef enum logic [2:0] {QUIET, HEAD, BODY, TAIL, PAUSE} part_t;

  // Which byte is next.
  part_t part;
  logic [5:0] place;  // in the head, the tail or the pause
  logic [15:0] total, checksum, udp_length;
  logic [BITS-1:0] size, last;  // of the payload; the last byte of it or of its padding
  logic over;

  assign over = part == BODY && at == last;

  always_ff @(posedge clk) begin
    taken <= 1'b0;
    place <= place + 6'd1;
    case (part)
      QUIET: begin
        place <= '0;
        if (waits) begin
          part <= HEAD;
          size <= length;
        end
      end
      HEAD: begin
        // The clocks of the preamble are enough for these.
        total      <= 16'(size) + 16'd28;
        udp_length <= 16'(size) + 16'd8;
        checksum   <= ~added(SUM, total);
        last       <= size < BITS'(LEAST) ? BITS'(LEAST - 1) : size - BITS'(1);
        at         <= '0;
        if (place == 6'(PREAMBLE + HEADERS - 1)) part <= BODY;
      end
      BODY: begin
        place <= '0;
        at    <= at + BITS'(1);
        if (over) begin
          part  <= TAIL;
          taken <= 1'b1;
        end
      end
      TAIL: if (place == 6'd3) part <= PAUSE;
      default: if (place == 6'(4 + GAP - 1)) part <= QUIET;
    endcase
    if (reset) begin
      part  <= QUIET;
      taken <= 1'b0;
    end
  end

  // Three stages: the payload's byte is fetched, and stands in a register as memory answers late, as the head's does, of
  // which lengths and checksum come a clock after what is fixed; one of the two is chosen; its check sequence follows it.
  part_t fetching, choosing, sending;
  logic [5:0] place_fetching, place_choosing;
  logic padding_fetching, padding, preamble;
  logic [7:0] read, fixed, head, head_read, chosen;
  logic [31:0] crc;

  always_comb begin
    head = fixed;
    case (place_fetching)
      6'(TOTAL): head = total[15:8];
      6'(TOTAL + 1): head = total[7:0];
      6'(CHECKSUM): head = checksum[15:8];
      6'(CHECKSUM + 1): head = checksum[7:0];
      6'(LENGTH): head = udp_length[15:8];
      6'(LENGTH + 1): head = udp_length[7:0];
      default: ;
    endcase
  end

  always_ff @(posedge clk) begin
    fetching         <= part;
    place_fetching   <= place;
    fixed            <= FIXED[8*(PREAMBLE+HEADERS-1-32'(place))+:8];
    padding_fetching <= at >= size;
    choosing         <= fetching;
    place_choosing   <= place_fetching;
    padding          <= padding_fetching;
    read             <= fetched;
    head_read        <= head;
    sending          <= choosing;
    preamble         <= choosing == HEAD && place_choosing < 6'(PREAMBLE);
    chosen           <= choosing == HEAD ? head_read : padding ? 8'd0 : read;
    enable           <= sending == HEAD || sending == BODY || sending == TAIL;
    txd              <= sending == TAIL ? ~crc[7:0] : chosen;
    if (preamble) crc <= '1;
    else if (sending == TAIL) crc <= crc >> 8;
    else crc <= crc_32(crc, chosen);
    if (reset) begin
      {fetching, choosing, sending} <= {QUIET, QUIET, QUIET};
      enable <= 1'b0;
    end
  end

endmodule
