// Version 2 with the stamps of frames: the events of a line in the order of its rows, as the positions in a datagram ascend.
//
// Events of a line are gathered in one of two banks until an entry comes that is not of it; then they are handed on row by row,
// while the next line's are gathered in the other bank. Everything else passes when both banks are empty.
module taxel_line_sorter
  import taxel_types::*;
#(
    parameter int ROWS = 64
) (
    input  logic   clk,
    input  logic   reset,
    input  logic   ready,    // an entry of version 2 stands at the queue's output
    input  event_t oldest,
    input  logic   leaving,  // an entry of version 1 does
    output logic   pop,
    output logic   idle,     // nothing is gathered
    output logic   valid,    // an entry stands at the output
    output event_t entry,
    input  logic   taken
);

  localparam int GROUP = 8;
  localparam int GROUPS = (ROWS + GROUP - 1) / GROUP;

  typedef struct packed {
    logic more;
    logic [15:0] value;
  } held_t;

  held_t held[256];
  logic [1:0][GROUPS-1:0][GROUP-1:0] changed;
  event_t gathering, line;  // what the events of a line have in common: of the one that is gathered, or handed on
  logic gathered, handing, bank, sorts, belongs, free, passes;
  logic [$clog2(GROUPS+1)-1:0] group;
  logic [2:0] row;
  logic [6:0] y;

  assign idle    = !gathered && !handing && !valid;
  assign sorts   = oldest.kind == ENTRY_EVENT && oldest.format.frame_sync;
  assign belongs = sorts && (!gathered || (oldest.x == gathering.x && oldest.at == gathering.at));
  assign free    = !valid || taken;
  assign passes  = !sorts && !gathered && !handing && free;
  assign pop     = ready && (belongs || passes);

  // The first row that changed of a group, of the bank that is not gathered in.
  always_comb begin
    row = '0;
    for (int k = GROUP - 1; k >= 0; k--) if (changed[!bank][group][k]) row = 3'(k);
  end
  assign y = 7'({group, row});

  always_ff @(posedge clk) begin
    if (taken) valid <= 1'b0;
    if (pop && sorts) begin
      held[{bank, oldest.y}] <= '{more: oldest.more, value: oldest.value};
      changed[bank][oldest.y[6:3]][oldest.y[2:0]] <= 1'b1;
      gathering      <= oldest;
      gathering.lost <= oldest.lost || (gathered && gathering.lost);
      gathered       <= 1'b1;
    end else if (pop) begin
      valid <= 1'b1;
      entry <= oldest;
    end
    if (gathered && !handing && (leaving || (ready && !belongs))) begin
      handing  <= 1'b1;
      gathered <= 1'b0;
      bank     <= !bank;
      line     <= gathering;
      group    <= '0;
    end
    if (handing && free) begin
      if (changed[!bank][group] == '0) begin
        group <= group + 1'b1;
        if (32'(group) == GROUPS - 1) handing <= 1'b0;
      end else begin
        valid       <= 1'b1;
        entry       <= line;
        entry.y     <= y;
        entry.more  <= held[{!bank, y}].more;
        entry.value <= held[{!bank, y}].value;
        line.lost   <= 1'b0;
        changed[!bank][group][row] <= 1'b0;
      end
    end
    if (reset) begin
      {valid, gathered, handing, bank} <= '0;
      changed <= '0;
    end
  end

endmodule
