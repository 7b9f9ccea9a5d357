// The core between registers at its pins, so that every path of it begins and ends in a register and is timed.
module timed_core #(
    parameter int COLUMNS = 64,
    parameter int ROWS = 64,
    parameter int CHANNELS = 16,
    parameter int LINK_BYTES = 1
) (
    input  logic                     clk,
    input  logic                     clk_fast,
    input  logic                     reset,
    input  logic                     pattern,
    output logic [1:0]               ramp,
    input  logic [CHANNELS-1:0][1:0] comparators,
    input  logic                     rx,
    input  logic                     tready,
    output logic [9*LINK_BYTES+1:0]  link,   // tdata, tkeep, tvalid, tlast
    output logic [10:0]              lines   // all other outputs
);

  logic reset_in, reset_held, pattern_in, rx_in, tready_in;
  logic [1:0] ramp_out;
  logic [CHANNELS-1:0][1:0] comparators_in;
  logic [9*LINK_BYTES+1:0] link_out;
  logic [10:0] lines_out;

  always_ff @(posedge clk) begin
    reset_in   <= reset;
    reset_held <= reset_in;
    pattern_in <= pattern;
    rx_in      <= rx;
    tready_in  <= tready;
    link       <= link_out;
    lines      <= lines_out;
  end

  always_ff @(posedge clk_fast) begin
    comparators_in <= comparators;
    ramp           <= ramp_out;
  end

  taxel_top #(.COLUMNS(COLUMNS), .ROWS(ROWS), .CHANNELS(CHANNELS), .LINK_BYTES(LINK_BYTES)) core (
      .clk, .clk_fast, .reset(reset_held), .pattern(pattern_in), .ramp(ramp_out), .comparators(comparators_in),
      .rsel(lines_out[2:0]), .csel_reg_clk_out(lines_out[3]), .csel_reg_din_out(lines_out[4]),
      .rx(rx_in), .tx(lines_out[5]),
      .tdata(link_out[8*LINK_BYTES-1:0]), .tkeep(link_out[9*LINK_BYTES-1:8*LINK_BYTES]),
      .tvalid(link_out[9*LINK_BYTES]), .tready(tready_in), .tlast(link_out[9*LINK_BYTES+1]),
      .record_sync(lines_out[6]), .frame_sync_out(lines_out[7]), .col_change_sync(lines_out[8]),
      .col_read_sync(lines_out[9]), .row_read_sync(lines_out[10])
  );

endmodule
