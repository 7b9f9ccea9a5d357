// The two banks of the sender of UDP, between two clocks of any periods and phases: whatever bytes come when, and whenever the
// frame asks for which byte and is over, the length and each byte of any payload are those that came, payloads go in their order,
// each once, and none is made up.
//
// Either clock has an edge in a step, or both have, or none. A synchroniser's first flip-flop may take a change at the edge at
// which it comes or at the next one, each time anew. One payload of all is looked at, and one of its bytes; payloads have three
// bytes at most, and of longer ones the first three.
module banks_proof (
    input logic       tick,
    input logic       up_core,
    input logic       up_link,
    input logic       tvalid,
    input logic       tlast,
    input logic [7:0] tdata,
    input logic       chosen,  // the payload that begins is looked at
    input logic [1:0] given_at,
    input logic       given_taken
);

  localparam int MOST = 3;

  logic open_core, open_link, clk, clk_link;
  always_latch if (!tick) open_core = up_core;
  always_latch if (!tick) open_link = up_link;
  assign clk      = tick & open_core;
  assign clk_link = tick & open_link;

  // Reset lasts for eight clocks of the link or more, of the scan's for one in the first half and three in the second: either
  // side takes it, and then sees that no bank is handed over, or back.
  logic [3:0] warm = '0;
  logic [2:0] warm_core = '0;
  logic reset, tready;
  assign reset = warm < 4'd8 || warm_core != 3'd4;

  taxel_udp_sender #(.MOST(MOST)) sender (
      .clk, .reset, .tdata, .tvalid, .tready, .tlast, .clk_link, .txd(), .tx_enable()
  );

  logic [1:0] place;  // of the byte that is looked at
  logic moves, begins, of_chosen, open_now, ever, of_current, whole, gone, takes, now, asked;
  logic [1:0] bytes, length, waiting, ahead;  // payloads that were given and not taken; of them before the chosen one
  logic [7:0] byte_held;
  assign moves     = up_core && tvalid && tready && !reset;
  assign begins    = moves && !open_now;
  assign of_chosen = begins ? chosen && !ever : of_current;
  assign takes     = up_link && sender.taken_now && !reset;
  assign now       = whole && !gone && ahead == 2'd0 && sender.waits;

  always_ff @(posedge tick) begin
    place <= place;
    if (up_link && warm != 4'd8 && (warm != 4'd4 || warm_core != 3'd0)) warm <= warm + 4'd1;
    if (up_core && warm_core != 3'd4 && (warm_core == 3'd0 || warm >= 4'd4)) warm_core <= warm_core + 3'd1;
    if (moves) begin
      open_now <= !tlast;
      bytes  <= tlast ? 2'd0 : bytes == 2'(MOST) ? bytes : bytes + 2'd1;
      of_current <= of_chosen && !tlast;
      if (of_chosen) begin
        ever   <= 1'b1;
        length <= bytes == 2'(MOST) ? bytes : bytes + 2'd1;
        if (bytes == place) byte_held <= tdata;
        if (tlast) begin
          whole <= 1'b1;
          ahead <= waiting - 2'(takes);
        end
      end
    end
    waiting <= waiting + 2'(moves && tlast) - 2'(takes);
    if (takes && whole && !gone) begin
      if (ahead == 2'd0) gone <= 1'b1;
      else ahead <= ahead - 2'd1;
    end
    if (up_link) asked <= now && sender.at == place && place < length;
    if (reset) {open_now, ever, of_current, whole, gone, asked, bytes, waiting, ahead} <= '0;
  end

  always_comb begin
    if (!reset) begin
      assert (waiting <= 2'd2);
      assert (!sender.waits || waiting != 2'd0);
      assert (!now || sender.lengths[sender.sent] == length);
      assert (!asked || sender.fetched == byte_held);
      // There is room unless both banks wait, or their return is on its way.
      assert (tready || waiting != 2'd0 || sender.taken != sender.taken_here);
      cover (now && length == 2'd3 && ahead == 2'd0 && waiting == 2'd2);
      cover (gone && waiting == 2'd2);
    end
  end

endmodule

// In place of the frame: it asks for any byte and takes a payload at any time but in its reset.
module taxel_ethernet_frame #(
    parameter logic [47:0] FROM_MAC  = '0,
    parameter logic [47:0] TO_MAC    = '0,
    parameter logic [31:0] FROM_IP   = '0,
    parameter logic [31:0] TO_IP     = '0,
    parameter logic [15:0] FROM_PORT = '0,
    parameter logic [15:0] TO_PORT   = '0,
    parameter int          BITS      = 11
) (
    input  logic            clk,
    input  logic            reset,
    input  logic            waits,
    input  logic [BITS-1:0] length,
    output logic [BITS-1:0] at,
    input  logic [7:0]      fetched,
    output logic            taken,
    output logic [7:0]      txd,
    output logic            enable
);
  assign at    = banks_proof.given_at;
  assign taken = waits && banks_proof.given_taken && !reset;
  assign {txd, enable} = '0;
endmodule
