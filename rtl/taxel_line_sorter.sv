// Version 2 with the stamps of frames: the events of a line in the order of its rows, as the positions in a datagram ascend.
//
// Events of a line are gathered until an entry comes that is not of it, and then handed on row by row. Everything else passes.
module taxel_line_sorter
  import taxel_types::*;
#(
    parameter int ROWS = 64
) (
    input  logic   clk,
    input  logic   reset,
    input  logic   ready,  // an entry of version 2 stands at the queue's output
    input  event_t oldest,
    input  logic   leaving,  // an entry of version 1 does
    output logic   pop,
    output logic   idle,   // nothing is gathered
    output logic   valid,  // an entry stands at the output
    output event_t entry,
    input  logic   taken
);

  localparam int GROUP = 8;
  localparam int GROUPS = (ROWS + GROUP - 1) / GROUP;

  typedef struct packed {
    logic more;
    logic [15:0] value;
  } held_t;

  held_t held[128];
  logic [GROUPS-1:0][GROUP-1:0] changed;
  event_t line;  // what its events have in common
  logic gathered, handing, belongs, sorts, free;
  logic [$clog2(GROUPS+1)-1:0] group;
  logic [2:0] row;
  logic [6:0] y;

  assign idle    = !gathered && !valid;
  assign sorts   = oldest.kind == ENTRY_EVENT && oldest.format.frame_sync;
  assign belongs = sorts && (!gathered || (oldest.x == line.x && oldest.at == line.at));
  assign free    = !valid || taken;
  assign pop     = ready && !handing && (belongs || (!gathered && free));

  // The first row that changed of a group.
  always_comb begin
    row = '0;
    for (int k = GROUP - 1; k >= 0; k--) if (changed[group][k]) row = 3'(k);
  end
  assign y = 7'({group, row});

  always_ff @(posedge clk) begin
    if (taken) valid <= 1'b0;
    if (pop && sorts) begin
      held[oldest.y] <= '{more: oldest.more, value: oldest.value};
      changed[oldest.y[6:3]][oldest.y[2:0]] <= 1'b1;
      line      <= oldest;
      line.lost <= oldest.lost || (gathered && line.lost);
      gathered  <= 1'b1;
      group     <= '0;
    end else if (pop) begin
      valid <= 1'b1;
      entry <= oldest;
    end
    if (gathered && (leaving || (ready && !belongs))) handing <= 1'b1;
    if (handing && free) begin
      if (changed[group] == '0) begin
        group <= group + 1'b1;
        if (32'(group) == GROUPS - 1) {handing, gathered} <= '0;
      end else begin
        valid       <= 1'b1;
        entry       <= line;
        entry.y     <= y;
        entry.more  <= held[y].more;
        entry.value <= held[y].value;
        line.lost   <= 1'b0;
        changed[group][row] <= 1'b0;
      end
    end
    if (reset) begin
      {valid, gathered, handing} <= '0;
      changed <= '0;
    end
  end

endmodule
