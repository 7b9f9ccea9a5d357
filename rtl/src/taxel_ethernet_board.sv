// A board with a link of Ethernet and 64 channels: the core, its reset, the cells of its pins, and frames that go to a
// PHY by RGMII.
//
// Its clocks are made outside, where cells of the part have parameters. The cells of the pins are of an ECP5.
//
// Throughput: as of `taxel_top`, and of `taxel_udp_sender` for the link.
// Latency: as of those, and what the pins' cells take.
// Loses nothing of its own: the core counts what finds no room.
module taxel_ethernet_board #(
    parameter int COLUMNS = 64,
    parameter int ROWS = 64,
    parameter int BAUD_CLOCKS = 868,
    parameter int CSEL_CLOCKS = 8,
    parameter int RESET_CLOCKS = 1_000_000,    // 10 ms, for the PHY
    parameter int PATTERN_CLOCKS = 200_000_000  // 2 s, for which the button is held for the pattern
) (
    input  logic        clk,       // 100 MHz
    input  logic        clk_fast,  // 150 MHz
    input  logic        clk_link,  // 125 MHz
    input  logic        steady,    // all three clocks are; of no clock
    input  logic        button_n,  // low while the button is pressed, which resets; of no clock
    input  logic [63:0] comparators,
    output logic        ramp,
    output logic        csel_reg_clk_out,
    output logic        csel_reg_din_out,
    input  logic        rx,
    output logic        tx,
    output logic        record_sync,
    output logic        frame_sync_out,
    output logic        col_change_sync,
    output logic        col_read_sync,
    output logic        row_read_sync,
    output logic        eth_reset_n,
    output logic        eth_tx_clk,
    output logic        eth_tx_ctl,
    output logic [3:0]  eth_tx_data
);

  // Reset lasts until the clocks have been steady, and the button up, for as long as the PHY needs. A button bounces for
  // less than that.
  localparam int RESET_BITS = $clog2(RESET_CLOCKS + 1);

  localparam int PATTERN_BITS = $clog2(PATTERN_CLOCKS + 1);

  logic runs, up;
  logic reset, pattern;
  initial {reset, pattern} = 2'b10;
  logic [RESET_BITS-1:0] waited;
  logic [PATTERN_BITS-1:0] held;

  taxel_synchroniser to_runs (.clk, .from(steady), .to(runs));
  taxel_synchroniser to_up (.clk, .from(button_n), .to(up));

  always_ff @(posedge clk) begin
    reset <= waited != RESET_BITS'(RESET_CLOCKS);
    if (!runs || !up) waited <= '0;
    else if (waited != RESET_BITS'(RESET_CLOCKS)) waited <= waited + RESET_BITS'(1);
    // The button, held for long enough, starts the pattern; as it bounces, what it started stays. The next reset ends it.
    if (!runs || up) held <= '0;
    else if (held != PATTERN_BITS'(PATTERN_CLOCKS)) held <= held + PATTERN_BITS'(1);
    if (held == PATTERN_BITS'(PATTERN_CLOCKS)) pattern <= 1'b1;
    else if (!runs || (!reset && !up)) pattern <= 1'b0;
  end

  assign eth_reset_n = !reset;

  // The pins' cells of the converter: of each clock the first half is that in which the clock is high. From the ramp's
  // pair to its samples they take three clocks more than ideal ones.
  logic [1:0] ramp_pair;
  logic [63:0][1:0] samples;
  logic [2:0] rsel;  // no multiplexers: a channel for each line
  logic tkeep;       // a beat is a byte
  wire unused = &{rsel, tkeep};

  ODDRX1F of_ramp (.SCLK(clk_fast), .RST(1'b0), .D0(ramp_pair[0]), .D1(ramp_pair[1]), .Q(ramp));

  for (genvar c = 0; c < 64; c++) begin : g_comparator
    IDDRX1F of_comparator (.SCLK(clk_fast), .RST(1'b0), .D(comparators[c]), .Q0(samples[c][0]), .Q1(samples[c][1]));
  end

  logic [7:0] tdata;
  logic tvalid, tready, tlast;

  taxel_top #(
      .COLUMNS(COLUMNS),
      .ROWS(ROWS),
      .CHANNELS(64),
      .BAUD_CLOCKS(BAUD_CLOCKS),
      .CSEL_CLOCKS(CSEL_CLOCKS),
      .DELAY(2 + 3)
  ) core (
      .clk, .clk_fast, .reset, .pattern, .ramp(ramp_pair), .comparators(samples), .rsel, .csel_reg_clk_out, .csel_reg_din_out,
      .rx, .tx, .tdata, .tkeep, .tvalid, .tready, .tlast, .record_sync, .frame_sync_out, .col_change_sync, .col_read_sync,
      .row_read_sync
  );

  // The link: RGMII, the low half of a byte while the clock is high. The clock's edges are those of the data: the PHY
  // delays it.
  logic [7:0] txd;
  logic tx_enable;

  taxel_udp_sender sender (
      .clk, .reset, .tdata, .tvalid, .tready, .tlast, .clk_link, .txd, .tx_enable
  );

  ODDRX1F of_tx_clk (.SCLK(clk_link), .RST(1'b0), .D0(1'b1), .D1(1'b0), .Q(eth_tx_clk));
  ODDRX1F of_tx_ctl (.SCLK(clk_link), .RST(1'b0), .D0(tx_enable), .D1(tx_enable), .Q(eth_tx_ctl));

  for (genvar k = 0; k < 4; k++) begin : g_tx_data
    ODDRX1F of_tx_data (.SCLK(clk_link), .RST(1'b0), .D0(txd[k]), .D1(txd[k+4]), .Q(eth_tx_data[k]));
  end

endmodule
