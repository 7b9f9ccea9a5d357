// A frame of Ethernet, whatever payload waits when: its bytes are the preamble, headers whose lengths and checksum
// follow the payload's length, the payload, zeros up to 60 bytes, and the check sequence of all but the preamble;
// between two frames lie 12 clocks or more.
//
// Lengths are those of 5 bits: longer and shorter than what is padded. The byte that memory answers with is any.
//
// Planted faults are looked for in frames of 3 and 19 bytes in any order, each as soon after the one before as can be, with
// known bytes: clock by clock it takes too long to show that no other bytes violate a check sequence yet.
module ethernet_frame_proof
  import taxel_types::*;
#(
    parameter bit LEMMAS = 1'b1
) (
    input logic       clk,
    input logic       waits,
    input logic [4:0] length,
    input logic [7:0] memory
);

  localparam int BITS = 5;
  localparam int LEAST = 18;
  localparam logic [47:0] FROM_MAC = 48'h02_54_41_58_00_01;
  localparam logic [47:0] TO_MAC = 48'hFF_FE_FD_FC_FB_FA;
  localparam logic [31:0] FROM_IP = 32'hC0A8_3408;
  localparam logic [31:0] TO_IP = 32'hC0A8_3401;

  logic begun = 1'b0;
  logic waiting;
  logic [BITS-1:0] asked;
  logic [7:0] answer;
  logic taken, enable;
  logic [BITS-1:0] at;
  logic [7:0] txd;
  logic [7:0] read_1, read_2, read_3;
  logic [BITS-1:0] at_1, at_2, at_3, at_4;

  typedef enum logic [2:0] {QUIET, HEAD, BODY, TAIL, PAUSE} part_t;  // the frame's parts, by their numbers
  part_t part;

  assign waiting = (waits || !LEMMAS) && asked != 0;
  assign asked   = LEMMAS ? length : length[0] ? BITS'(19) : BITS'(3);
  assign answer  = LEMMAS ? memory : {3'b101, at_1};

  taxel_ethernet_frame #(
      .FROM_MAC(FROM_MAC), .TO_MAC(TO_MAC), .FROM_IP(FROM_IP), .TO_IP(TO_IP), .FROM_PORT(16'd5208), .TO_PORT(16'd5209),
      .BITS(BITS)
  ) frame (
      .clk, .reset(!begun), .waits(waiting), .length(asked), .at, .fetched(answer), .taken, .txd, .enable
  );

  assign part = part_t'(3'(frame.part));

  // Which byte of the frame goes out, and how long the payload is that it was begun for.
  logic [6:0] sent;       // bytes of the frame so far
  logic [BITS-1:0] size;
  logic [6:0] body;       // with its padding
  logic [31:0] crc;       // bit by bit, the highest power first
  logic [3:0] quiet;
  logic ever;

  assign body = 7'(size) < 7'(LEAST) ? 7'(LEAST) : 7'(size);

  function automatic logic [31:0] with_byte(logic [31:0] from, logic [7:0] data);
    logic [31:0] c;
    c = from;
    for (int k = 0; k < 8; k++) c = (c << 1) ^ ((c[31] ^ data[k]) ? 32'h04C11DB7 : 32'd0);
    return c;
  endfunction

  function automatic logic [7:0] turned(logic [7:0] byte_of);
    for (int k = 0; k < 8; k++) turned[k] = byte_of[7-k];
  endfunction

  // The IP header's words, added as RFC 1071 has it.
  logic [15:0] total;
  logic [31:0] sum;
  logic [16:0] once;
  logic [15:0] folded;
  assign total = 16'd28 + 16'(size);
  assign sum = 32'h4500 + 32'(total) + 32'h4000 + 32'h4011
      + 32'(FROM_IP[31:16]) + 32'(FROM_IP[15:0]) + 32'(TO_IP[31:16]) + 32'(TO_IP[15:0]);
  assign once = 17'(sum[15:0]) + 17'(sum[31:16]);
  assign folded = once[15:0] + 16'(once[16]);

  logic [7:0] wanted;
  always_comb begin
    wanted = 8'd0;
    case (sent)
      7'd0, 7'd1, 7'd2, 7'd3, 7'd4, 7'd5, 7'd6: wanted = 8'h55;
      7'd7: wanted = 8'hD5;
      7'd8, 7'd9, 7'd10, 7'd11, 7'd12, 7'd13: wanted = 8'(TO_MAC >> 8 * (13 - 32'(sent)));
      7'd14, 7'd15, 7'd16, 7'd17, 7'd18, 7'd19: wanted = 8'(FROM_MAC >> 8 * (19 - 32'(sent)));
      7'd20: wanted = 8'h08;
      7'd22: wanted = 8'h45;
      7'd24: wanted = total[15:8];
      7'd25: wanted = total[7:0];
      7'd28: wanted = 8'h40;
      7'd30: wanted = 8'd64;
      7'd31: wanted = 8'd17;
      7'd32: wanted = ~folded[15:8];
      7'd33: wanted = ~folded[7:0];
      7'd34, 7'd35, 7'd36, 7'd37: wanted = 8'(FROM_IP >> 8 * (37 - 32'(sent)));
      7'd38, 7'd39, 7'd40, 7'd41: wanted = 8'(TO_IP >> 8 * (41 - 32'(sent)));
      7'd42: wanted = 8'h14;
      7'd43: wanted = 8'h58;
      7'd44: wanted = 8'h14;
      7'd45: wanted = 8'h59;
      7'd47: wanted = 8'd8 + 8'(size);
      default: begin
        if (sent >= 7'd50 && sent < 7'd50 + 7'(size)) wanted = read_3;
        else if (sent >= 7'd50 + body) wanted = ~turned(8'(crc >> 8 * (53 + 32'(body) - 32'(sent))));
      end
    endcase
  end

  always_ff @(posedge clk) begin
    begun  <= 1'b1;
    read_1 <= answer;
    read_2 <= read_1;
    read_3 <= read_2;
    {at_1, at_2, at_3, at_4} <= {at, at_1, at_2, at_3};
    if (begun && waiting && part == QUIET) size <= asked;
    if (enable) begin
      sent  <= sent + 7'd1;
      quiet <= '0;
      ever  <= 1'b1;
      if (sent == 7'd7) crc <= '1;
      else if (sent < 7'd50 + body) crc <= with_byte(crc, txd);
    end else begin
      sent <= '0;
      if (quiet != 4'd15) quiet <= quiet + 4'd1;
    end
    if (!begun) {sent, quiet, ever} <= '0;
  end

  logic [31:0] sum_of_crc, final_crc;
  logic [6:0] tail;  // of the check sequence's bytes
  assign tail = sent - 7'd50 - body;

  always_comb begin
    for (int k = 0; k < 32; k++) final_crc[k] = crc[31-k];
    sum_of_crc = with_byte(crc, txd);
    if (begun) begin
      if (enable) begin
        assert (sent < 7'd54 + body && txd == wanted);
        // The byte of the payload is the one that was asked for.
        if (sent >= 7'd50 && sent < 7'd50 + 7'(size)) assert (at_4 == BITS'(sent - 7'd50));
        if (sent == 0 && ever) assert (quiet >= 4'd12);
      end
      assert (taken == (part == TAIL && frame.place == 0));
      cover (enable && sent == 7'd53 + body && size == 5'd3);
      cover (enable && sent == 7'd53 + body && size == 5'd19);
      cover (enable && sent == 0 && ever);
    end
  end

  // What the frame holds meanwhile, without which the induction does not close: what goes out was asked for four
  // clocks ago.
  always_comb begin
    if (LEMMAS && begun) begin
      case (part)
        QUIET: assert (!enable && (!ever || quiet >= 4'd8));
        HEAD: begin
          assert (frame.place < 6'd50 && enable == (frame.place >= 6'd4));
          assert (sent == (enable ? 7'(frame.place) - 7'd4 : 7'd0));
          if (ever && !enable) assert (quiet >= 4'd9 + 4'(frame.place));
        end
        BODY: assert (enable && sent == 7'd46 + 7'(at) && at <= frame.last && at < BITS'(body));
        TAIL: assert (frame.place < 6'd4 && enable && sent == 7'd46 + body + 7'(frame.place));
        PAUSE: begin
          assert (frame.place >= 6'd4 && frame.place < 6'd16 && enable == (frame.place < 6'd8));
          if (enable) assert (sent == 7'd46 + body + 7'(frame.place));
          else if (frame.place > 6'd8) assert (sent == 0 && quiet == 4'(frame.place - 6'd8));
          else assert (sent == 7'd54 + body && quiet == 0);
        end
        default: assert (0);
      endcase
      if (part == QUIET || (part == HEAD && !enable)) assert (sent == 0);
      if (part != QUIET) assert (size != 0 && frame.size == size);
      if (part != QUIET && (part != HEAD || frame.place > 6'd3))
        assert (7'(frame.last) == body - 7'd1 && frame.total == total && frame.udp_length == 16'd8 + 16'(size)
            && frame.checksum == ~folded);
      if (enable && sent == 7'd7) assert (&frame.crc);
      if (enable && sent >= 7'd8 && sent < 7'd50 + body)
        for (int k = 0; k < 32; k++) assert (frame.crc[k] == sum_of_crc[31-k]);
      if (enable && sent >= 7'd50 + body) assert (frame.crc == final_crc >> 8 * (tail + 7'd1));
    end
  end

endmodule
