// Each taxel as an FA-1 afferent (5.4.2), in whole numbers of 2^-16: which of a read's taxels fire.
//
// It follows the stages of the change detector: clock 0 is that in which a taxel's address is given, and clock 5 tells of it.
// A taxel's first reading counts as what had always been. For that a line that was not read before in this mode forgets what
// its taxels hold.
//
// Throughput: a taxel a clock.
// Latency: five clocks after a taxel's address it is known whether it fires.
// Loses nothing: no taxel waits. An integral above 16 bits is given as 65535.
module taxel_afferents #(
    parameter int COLUMNS = 64,
    parameter int STEPS = 4,
    parameter int ADDRESS_BITS = 12
) (
    input  logic                    clk,
    input  logic                    begins,     // a read whose taxels come from the next clock on
    input  taxel_types::read_t      read,
    input  logic [ADDRESS_BITS-1:0] address,    // clock 0
    input  logic [15:0]             ticks,      // clock 1: at most the ramp
    input  taxel_types::threshold_t threshold,  // clock 3
    input  logic                    sampled,    // clock 5: this was a taxel of a frame of spikes
    input  logic                    returned,   // its comparator had returned
    input  logic [ADDRESS_BITS-1:0] stored_at,
    output logic                    fires,
    output logic                    more,       // the spike is of more pressure
    output logic [15:0]             intensity   // the integral, 1/1024
);

  import taxel_types::*;

  localparam int LINE_BITS = $clog2(COLUMNS) == 0 ? 1 : $clog2(COLUMNS);
  localparam int PRESSURE = 24;  // bits
  // A threshold rises where a pressure exceeds it, by 2^30 at most: it stays below 2^31.
  localparam int THRESHOLD = 31;

  typedef struct packed {
    logic begun;
    logic [PRESSURE-1:0] base;  // the pressure when the integral was last reset
    logic [THRESHOLD-1:0] threshold;
  } afferent_t;

  afferent_t afferents[2**ADDRESS_BITS];
  afferent_t held_1, held_2, held_3, held_4, held_5;  // by clock
  afferent_t stored, written;
  logic writes;
  logic [ADDRESS_BITS-1:0] written_at;
  logic [PRESSURE-1:0] looked_up, pressure_3, pressure_4, pressure_5, size;
  logic [THRESHOLD-1:0] rest_4, rest_5, raised, lowered;
  logic [29:0] jump;
  logic [19:0] decay;
  logic less;

  // Lines that were read in this mode.
  logic [2**LINE_BITS-1:0] begun;
  logic fresh, fresh_0, fresh_1, fresh_2;

  always_ff @(posedge clk) begin
    if (begins) begin
      fresh <= !begun[read.line[LINE_BITS-1:0]];
      if (!read.format.spikes) begun <= '0;
      else if (read.step == 3'(STEPS - 1)) begun[read.line[LINE_BITS-1:0]] <= 1'b1;
    end
    fresh_0 <= fresh;
    fresh_1 <= fresh_0;
    fresh_2 <= fresh_1;
  end

  taxel_power_law compression (.clk, .ticks, .pressure(looked_up));

  always_ff @(posedge clk) begin
    held_1    <= afferents[address];
    held_2    <= held_1;
    held_3    <= held_2;
    if (fresh_2) held_3.begun <= 1'b0;
    pressure_3 <= looked_up;
    // The integral, and what the threshold may move by.
    held_4    <= held_3;
    pressure_4 <= pressure_3;
    less       <= pressure_3 < held_3.base;
    size       <= pressure_3 < held_3.base ? held_3.base - pressure_3 : pressure_3 - held_3.base;
    rest_4     <= THRESHOLD'({threshold.rest, 6'd0});
    jump       <= 30'((32'(threshold.jump) * 32'(threshold.rest)) >> 2);
    decay      <= 20'((24'(threshold.decay) * 24'(threshold.rest)) >> 4);
    // Whether that is a spike.
    held_5    <= held_4;
    pressure_5 <= pressure_4;
    rest_5     <= rest_4;
    raised     <= held_4.threshold + THRESHOLD'(jump);
    lowered    <= held_4.threshold > rest_4 ? held_4.threshold - THRESHOLD'(decay) : rest_4;
    fires      <= held_4.begun && THRESHOLD'(size) > held_4.threshold;
    more       <= !less;
    intensity  <= size >= PRESSURE'(1 << 22) ? 16'hFFFF : size[21:6];
    // What is written is known late in a clock, and the blocks lie far apart.
    writes     <= sampled && (returned || !held_5.begun);
    written    <= stored;
    written_at <= stored_at;
    if (writes) afferents[written_at] <= written;
  end

  always_comb begin
    stored = held_5;
    stored.begun = returned;
    if (!held_5.begun || fires) stored.base = pressure_5;
    if (!held_5.begun) stored.threshold = rest_5;
    else stored.threshold = fires ? raised : lowered;
  end

endmodule
