// The Colorlight i9 (LFE5U-45F-6BG381C) with 64 channels for 64 x 64 taxels: 25 MHz of the board become 150 and 100
// MHz, which are of one generator, and 125 MHz of another one, as no frequency within the first one's range is a
// multiple of all three.
//
// In Verilog of 2001, as the reader of SystemVerilog does not see the parameters of the part's cells.
module colorlight_i9 (
    input         clk25,
    input         button_n,
    input  [63:0] comparators,
    output        ramp,
    output        csel_reg_clk_out,
    output        csel_reg_din_out,
    input         rx,
    output        tx,
    output        record_sync,
    output        frame_sync_out,
    output        col_change_sync,
    output        col_read_sync,
    output        row_read_sync,
    output        eth_reset_n,
    output        eth_tx_clk,
    output        eth_tx_ctl,
    output [3:0]  eth_tx_data
);

  wire clk, clk_fast, clk_link, locked_scan, locked_link;

  // 25 MHz x 6 = 150 MHz; inside 600 MHz, over 6 100 MHz.
  (* FREQUENCY_PIN_CLKI = "25", FREQUENCY_PIN_CLKOP = "150", FREQUENCY_PIN_CLKOS = "100" *)
  (* ICP_CURRENT = "12", LPF_RESISTOR = "8", MFG_ENABLE_FILTEROPAMP = "1", MFG_GMCREF_SEL = "2" *)
  EHXPLLL #(
      .CLKI_DIV(1), .CLKFB_DIV(6), .FEEDBK_PATH("CLKOP"),
      .CLKOP_DIV(4), .CLKOP_CPHASE(2),
      .CLKOS_ENABLE("ENABLED"), .CLKOS_DIV(6), .CLKOS_CPHASE(2)
  ) of_scan (
      .CLKI(clk25), .CLKFB(clk_fast), .CLKOP(clk_fast), .CLKOS(clk), .LOCK(locked_scan), .RST(1'b0), .STDBY(1'b0),
      .PHASESEL0(1'b0), .PHASESEL1(1'b0), .PHASEDIR(1'b1), .PHASESTEP(1'b1), .PHASELOADREG(1'b1), .PLLWAKESYNC(1'b0),
      .ENCLKOP(1'b0)
  );

  // 25 MHz x 5 = 125 MHz; inside 625 MHz.
  (* FREQUENCY_PIN_CLKI = "25", FREQUENCY_PIN_CLKOP = "125" *)
  (* ICP_CURRENT = "12", LPF_RESISTOR = "8", MFG_ENABLE_FILTEROPAMP = "1", MFG_GMCREF_SEL = "2" *)
  EHXPLLL #(
      .CLKI_DIV(1), .CLKFB_DIV(5), .FEEDBK_PATH("CLKOP"), .CLKOP_DIV(5), .CLKOP_CPHASE(2)
  ) of_link (
      .CLKI(clk25), .CLKFB(clk_link), .CLKOP(clk_link), .LOCK(locked_link), .RST(1'b0), .STDBY(1'b0),
      .PHASESEL0(1'b0), .PHASESEL1(1'b0), .PHASEDIR(1'b1), .PHASESTEP(1'b1), .PHASELOADREG(1'b1), .PLLWAKESYNC(1'b0),
      .ENCLKOP(1'b0)
  );

  taxel_ethernet_board board (
      .clk(clk), .clk_fast(clk_fast), .clk_link(clk_link), .steady(locked_scan && locked_link), .button_n(button_n),
      .comparators(comparators), .ramp(ramp), .csel_reg_clk_out(csel_reg_clk_out),
      .csel_reg_din_out(csel_reg_din_out), .rx(rx), .tx(tx), .record_sync(record_sync),
      .frame_sync_out(frame_sync_out), .col_change_sync(col_change_sync), .col_read_sync(col_read_sync),
      .row_read_sync(row_read_sync), .eth_reset_n(eth_reset_n), .eth_tx_clk(eth_tx_clk), .eth_tx_ctl(eth_tx_ctl),
      .eth_tx_data(eth_tx_data)
  );

endmodule
