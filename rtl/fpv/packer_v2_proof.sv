// The packer of version 2, whatever entries come and whenever the link is ready: its datagrams are numbered without a gap, and the
// body of each is the units that were written since the one before, in their order and at most MOST of them.
//
// With 688 units a datagram has 18 + 1376 + 2 + 4 = 1400 bytes. Here a body holds less and a line has four rows; positions, times and
// values are of their full width.
module packer_v2_proof
  import taxel_types::*;
(
    input logic        clk,
    input logic        valid,
    input event_t      entry,
    input logic        leaving,
    input logic        states_ready,
    input logic [6:0]  repeated_line,
    input logic [15:0] value_repeated,
    input totals_t     totals,
    input logic        sending
);

  localparam int ROWS = 4;
  localparam int MOST = 20;
  localparam int TOTAL_UNITS = 20;  // of a datagram with totals

  // The packer's states, by their numbers.
  typedef enum logic [3:0] {IDLE, WEIGH, PLACE, WRITE, CLOSE, BEYOND, OVER, BEAT, REPEAT, TOTALS, SEND, NEXT, AGE} state_t;
  state_t state, after;

  logic begun = 1'b0;
  logic write, bank, send, any;
  logic [9:0] place, written;  // units since the last datagram
  logic [31:0] latest;         // number of the last datagram
  logic was_bank;              // which bank it has
  datagram_t datagram;

  taxel_packer_v2 #(.ROWS(ROWS), .MOST(MOST)) packer (
      .clk, .reset(!begun), .valid, .entry, .taken(), .leaving, .idle(), .states_ready, .repeated_line, .row_repeated(),
      .value_repeated, .states_sent(), .totals, .totals_sent(), .write, .bank, .place, .unit(), .send, .datagram, .sending
  );

  assign state = state_t'(4'(packer.state));
  assign after = state_t'(4'(packer.after));

  always_ff @(posedge clk) begin
    begun <= 1'b1;
    if (send) begin
      any      <= 1'b1;
      latest   <= datagram.sequence_number;
      was_bank <= datagram.bank;
      written  <= '0;
    end else if (write) begin
      written <= written + 10'd1;
    end
    if (!begun) {any, written} <= '0;
  end

  always_comb begin
    if (begun) begin
      if (send) begin
        assert (datagram.sequence_number == (any ? latest + 32'd1 : 32'd0));
        assert (!write && datagram.units == written && written <= 10'(MOST));
        if (any) assert (datagram.bank != was_bank);
      end
      if (write) assert (place == written && written < 10'(MOST));
      // What the packer holds meanwhile, without which the induction does not close.
      assert (packer.sequence_number == (send ? datagram.sequence_number + 32'd1 : any ? latest + 32'd1 : 32'd0));
      assert (packer.units == (send ? 10'd0 : written + 10'(write)));
      assert (bank == (send ? !datagram.bank : any ? !was_bank : 1'b0));
      assert (packer.units <= 10'(MOST));
      assert (!packer.room || state == IDLE || (state == WRITE && after == IDLE && packer.left == 3'd1));
      case (state)
        IDLE, WEIGH, PLACE, OVER, AGE: assert (packer.gathered || packer.units == 0);
        BEAT: assert (after == NEXT && (packer.gathered || packer.units == 0));
        CLOSE: assert (packer.gathered && (after == WEIGH || after == NEXT));
        SEND: assert (!packer.gathered && packer.units == 0 && (after == WEIGH || after == NEXT));
        NEXT: assert (!packer.gathered && packer.units == 0);
        BEYOND: assert (!packer.gathered && packer.units <= 10'd5);
        REPEAT: assert (!packer.gathered && packer.row <= 8'(ROWS) && packer.units <= 10'(2 * packer.row));
        TOTALS: assert (!packer.gathered && packer.units == 10'(packer.word) && packer.word <= 5'(TOTAL_UNITS)
                && packer.words_over == (packer.word == 5'(TOTAL_UNITS)));
        WRITE: begin
          assert (packer.left != 0 && packer.units + 10'(packer.left) <= 10'(MOST));
          case (after)
            IDLE: assert (packer.gathered);
            BEYOND: assert (!packer.gathered && packer.units + 10'(packer.left) <= 10'd5);
            REPEAT:
            assert (!packer.gathered && packer.row <= 8'(ROWS) && packer.units + 10'(packer.left) <= 10'(2 * packer.row));
            default: assert (0);
          endcase
        end
        default: assert (0);
      endcase
      cover (send && datagram.kind == 4'd2 && datagram.units > 10'd12);
      cover (send && any && datagram.kind == 4'd4 && datagram.units == 10'(TOTAL_UNITS));
      cover (send && any && datagram.units == 10'd0);
    end
  end

endmodule
