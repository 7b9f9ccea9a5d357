// Version 2 with the stamps of frames: the events of a line in the order of its rows, as the positions in a datagram ascend.
//
// Events of a line are gathered in one of two banks until an entry comes that is not of it; then they are handed on row by row,
// while the next line's are gathered in the other bank. Everything else passes when both banks are empty.
//
// Throughput: an entry every other clock; a line is handed on while the next one is gathered.
// Latency: an event waits until an entry comes that is not of its line.
// Loses nothing: while the packer waits, so does the queue.
module taxel_line_sorter #(
    parameter int ROWS = 64
) (
    input  logic                clk,
    input  logic                reset,
    input  logic                ready,    // an entry of version 2 stands at the queue's output
    input  taxel_types::event_t oldest,
    input  logic                leaving,  // an entry of version 1 does
    output logic                pop,
    output logic                idle,     // nothing is gathered
    output logic                valid,    // an entry stands at the output
    output taxel_types::event_t entry,
    input  logic                taken
);

  import taxel_types::*;

  localparam int GROUP = 8;
  localparam int GROUPS = (ROWS + GROUP - 1) / GROUP;

  typedef struct packed {
    logic more;
    logic [15:0] value;
  } held_t;

  held_t held[256];
  logic [1:0][GROUPS-1:0][GROUP-1:0] changed;
  event_t gathering, line;  // what the events of a line have in common: of the one that is gathered, or handed on
  logic gathered, handing, bank, sorts, same, weighed, belongs, free, passes;
  // The row of the entry at the queue's output, a clock after it came there.
  logic [GROUPS-1:0] group_of;
  logic [GROUP-1:0] row_of;
  // The line that is handed on: a group's rows, of them the first one, what is held of it.
  logic [$clog2(GROUPS+1)-1:0] group;
  logic [GROUP-1:0] rows;
  logic [6:0] base, y, y_landed;
  logic [2:0] row;
  logic chosen, fetched, landed, chooses, lands;
  held_t held_read, held_of;  // from the memory, and in the register that its block has behind it

  assign idle    = !gathered && !handing && !valid;
  // What an entry is, and whether it is of the line, is found a clock before that is used.
  assign belongs = sorts && (!gathered || same);
  // What is taken makes room a clock later: the packer's next entry is at least three clocks away.
  assign free    = !valid;
  assign passes  = !sorts && !gathered && !handing && free;
  assign pop     = ready && weighed && (belongs || passes);
  // The memory reads in every clock: a row is chosen until what is held of it has landed.
  assign lands   = fetched && !landed;
  assign chooses = rows != '0 && (!chosen || lands);

  // The first row of a group's.
  always_comb begin
    row = '0;
    for (int k = GROUP - 1; k >= 0; k--) if (rows[k]) row = 3'(k);
  end

  always_ff @(posedge clk) begin
    weighed <= ready && !pop;
    same    <= oldest.x == gathering.x && oldest.at == gathering.at;
    sorts   <= oldest.kind == ENTRY_EVENT && oldest.format.frame_sync;
    row_of  <= GROUP'(1) << oldest.y[2:0];
    for (int g = 0; g < GROUPS; g++) group_of[g] <= oldest.y[6:3] == 4'(g);
    if (taken) valid <= 1'b0;
    if (pop && sorts) begin
      held[{bank, oldest.y}] <= '{more: oldest.more, value: oldest.value};
      for (int g = 0; g < GROUPS; g++) begin
        if (group_of[g]) changed[bank][g] <= changed[bank][g] | row_of;
      end
      gathering      <= oldest;
      gathering.lost <= oldest.lost || (gathered && gathering.lost);
      gathered       <= 1'b1;
    end else if (pop) begin
      valid <= 1'b1;
      entry <= oldest;
    end
    if (gathered && !handing && (leaving || (ready && weighed && !belongs))) begin
      handing  <= 1'b1;
      gathered <= 1'b0;
      bank     <= !bank;
      line     <= gathering;
      group    <= '0;
    end
    // Row by row: it is chosen, what is held of it is fetched and lands, and it is handed on.
    if (handing && rows == '0) begin
      if (32'(group) != GROUPS) begin
        rows                  <= changed[!bank][group];
        changed[!bank][group] <= '0;
        base                  <= {4'(group), 3'd0};
        group                 <= group + 1'b1;
      end else if (!chosen && !landed) begin
        handing <= 1'b0;
      end
    end
    if (chooses) begin
      y    <= base | 7'(row);
      rows <= rows & (rows - GROUP'(1));
    end
    if (chooses) chosen <= 1'b1;
    else if (lands) chosen <= 1'b0;
    held_read <= held[{!bank, y}];
    fetched   <= chosen && !lands;
    if (lands) begin
      held_of  <= held_read;
      y_landed <= y;
    end
    if (lands) landed <= 1'b1;
    else if (free) landed <= 1'b0;
    if (landed && free) begin
      valid       <= 1'b1;
      entry       <= line;
      entry.y     <= y_landed;
      entry.more  <= held_of.more;
      entry.value <= held_of.value;
      line.lost   <= 1'b0;
    end
    if (reset) begin
      {valid, gathered, handing, bank, weighed, chosen, fetched, landed} <= '0;
      rows    <= '0;
      changed <= '0;
    end
  end

  // What is offered stands until it is taken.
  logic waits;
  event_t waiting;
  always_ff @(posedge clk) begin
    waits   <= valid && !taken && !reset;
    waiting <= entry;
    if (!reset) assert (!(taken && !valid));
    if (!reset && waits) assert (valid && entry == waiting);
  end

endmodule
