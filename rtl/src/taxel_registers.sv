// Made from registers.toml by rtl/tools/registers.py (`make rtl-registers`): edit that.
// What the board's registers hold, how they lie in words, and the rules that they obey.
package taxel_registers;

  typedef struct packed {
    // Lines are driven in random order.
    logic random_lines;
    // If set, each taxel is an FA-1 afferent (5.4.2): events are its spikes, intensities its integral. Otherwise events are changes.
    logic mechanoreceptor;
    // A falling edge ends a sample.
    logic invert_comparator;
    // All events of a frame have the time at which the frame starts.
    logic frame_sync;
    // Version of the wire protocol that the board uses (our reading: the manual has only one version). The bits hold 1 less.
    logic [1:0] wire_version;
    // The board sends the values of a simulated rolling ball instead of the comparators' values (our reading: the manual has no such bit).
    logic pattern;
    // FA-1: how much a spike raises the threshold (T A of Table 5.3).
    logic [15:0] threshold_jump;
    // Time from one driven line to the next.
    logic [31:0] line_period;
    // Part of line_period in which the line is read.
    logic [31:0] line_read;
    // Time from one multiplexer step to the next.
    logic [15:0] step_period;
    // Part of step_period in which the channels are read.
    logic [15:0] step_read;
    // Duration of the ramp.
    logic [15:0] ramp;
    // FA-1: theta_0, in ticks after the power law.
    logic [15:0] threshold_rest;
    // FA-1: how much a frame without a spike lowers the threshold (B of Table 5.3).
    logic [7:0] threshold_decay;
    // Largest difference that does not cause an event.
    logic [7:0] noise_floor;
    // Number of driven lines (the register contains one less; the manual's field has 6 bits, our reading: 8). The bits hold 1 less.
    logic [7:0] lines;
    // A recording is running: setting and clearing this bit sends a marker and switches the sync line.
    logic record;
  } registers_t;

  // What register n holds; 0 where there is no such field.
  function automatic logic [31:0] word(registers_t r, logic [2:0] n);
    case (n)
      3'd0: return 32'(r.random_lines) | (32'(r.mechanoreceptor) << 1) | (32'(r.invert_comparator) << 2) | (32'(r.frame_sync) << 3) | (32'(r.wire_version) << 4) | (32'(r.pattern) << 6) | (32'(r.threshold_jump) << 16);
      3'd1: return 32'(r.line_period);
      3'd2: return 32'(r.line_read);
      3'd3: return 32'(r.step_period) | (32'(r.step_read) << 16);
      3'd4: return 32'(r.ramp) | (32'(r.threshold_rest) << 16);
      3'd5: return 32'(r.threshold_decay) | (32'(r.noise_floor) << 8) | (32'(r.lines) << 16);
      3'd7: return (32'(r.record) << 16);
      default: return 32'd0;
    endcase
  endfunction

  // Which bits register n has; the others are reserved and must be 0.
  function automatic logic [31:0] mask(logic [2:0] n);
    case (n)
      3'd0: return 32'hFFFF007F;
      3'd1: return 32'hFFFFFFFF;
      3'd2: return 32'hFFFFFFFF;
      3'd3: return 32'hFFFFFFFF;
      3'd4: return 32'hFFFFFFFF;
      3'd5: return 32'h00FFFFFF;
      3'd7: return 32'h00010000;
      default: return 32'd0;
    endcase
  endfunction

  // The registers with one of them set, whatever the rules say.
  function automatic registers_t store(registers_t r, logic [2:0] n, logic [31:0] value);
    registers_t changed;
    changed = r;
    case (n)
      3'd0: begin
        changed.random_lines = value[0];
        changed.mechanoreceptor = value[1];
        changed.invert_comparator = value[2];
        changed.frame_sync = value[3];
        changed.wire_version = value[5:4];
        changed.pattern = value[6];
        changed.threshold_jump = value[31:16];
      end
      3'd1: begin
        changed.line_period = value[31:0];
      end
      3'd2: begin
        changed.line_read = value[31:0];
      end
      3'd3: begin
        changed.step_period = value[15:0];
        changed.step_read = value[31:16];
      end
      3'd4: begin
        changed.ramp = value[15:0];
        changed.threshold_rest = value[31:16];
      end
      3'd5: begin
        changed.threshold_decay = value[7:0];
        changed.noise_floor = value[15:8];
        changed.lines = value[23:16];
      end
      3'd7: begin
        changed.record = value[16];
      end
      default: ;
    endcase
    return changed;
  endfunction

  localparam int RULES = 15;

  // Which rules refuse these registers, in their order.
  function automatic logic [RULES-1:0] broken(
      registers_t r, int steps, int driven_lines, int sense_lines, int channels
  );
    logic [RULES-1:0] which;
    which[0] = (40'(r.wire_version) + 40'd1) > 40'd2;
    which[1] = 40'(r.line_period) < 40'd1;
    which[2] = 40'(r.line_read) < 40'd1;
    which[3] = 40'(r.step_period) < 40'd1;
    which[4] = 40'(r.step_read) < 40'd4;
    which[5] = 40'(r.ramp) < 40'd1;
    which[6] = 40'(r.ramp) > 40'd65534;
    which[7] = !((40'(r.lines) + 40'd1) <= 40'(driven_lines));
    which[8] = !(40'(r.line_read) <= 40'(r.line_period));
    which[9] = !(40'(r.step_read) <= 40'(r.step_period));
    which[10] = !((40'(steps) * 40'(r.step_period)) <= 40'(r.line_read));
    which[11] = !((40'(r.ramp) + 40'd5) <= (40'(r.step_read) + (40'(r.step_read) << 1)));
    which[12] = !((40'(r.random_lines) == 40'd0) || ((((40'(r.lines) + 40'd1) << 4)) <= 40'(r.line_period)));
    which[13] = !((40'(channels) + 40'd10) <= 40'(r.step_period));
    which[14] = !(((40'(r.wire_version) + 40'd1) == 40'd2) || ((40'(driven_lines) <= 40'd64) && (40'(sense_lines) <= 40'd64)));
    return which;
  endfunction

  // The number of the first of them; 0: none.
  function automatic logic [3:0] refused(logic [RULES-1:0] which);
    if (which[0]) return 4'd4;
    if (which[1]) return 4'd4;
    if (which[2]) return 4'd4;
    if (which[3]) return 4'd4;
    if (which[4]) return 4'd4;
    if (which[5]) return 4'd4;
    if (which[6]) return 4'd4;
    if (which[7]) return 4'd4;
    if (which[8]) return 4'd1;
    if (which[9]) return 4'd1;
    if (which[10]) return 4'd2;
    if (which[11]) return 4'd3;
    if (which[12]) return 4'd5;
    if (which[13]) return 4'd7;
    if (which[14]) return 4'd8;
    return 4'd0;
  endfunction

  // What a build holds at reset; beyond 64 lines the lines' times are fitted to its steps.
  function automatic registers_t at_reset(int steps, int driven_lines, int sense_lines, int channels);
    registers_t r;
    logic is_large;
    is_large = driven_lines > 64 || sense_lines > 64;
    r = '0;
    if (is_large && channels == 16)
      r = '{
          random_lines: 1'd0,
          mechanoreceptor: 1'd0,
          invert_comparator: 1'd0,
          frame_sync: 1'd1,
          wire_version: 2'd1,
          pattern: 1'd0,
          threshold_jump: 16'd0,
          line_period: 32'd600,
          line_read: 32'd600,
          step_period: 16'd75,
          step_read: 16'd55,
          ramp: 16'd150,
          threshold_rest: 16'd0,
          threshold_decay: 8'd0,
          noise_floor: 8'd3,
          lines: 8'd127,
          record: 1'd0};
    if (is_large && channels == 64)
      r = '{
          random_lines: 1'd0,
          mechanoreceptor: 1'd0,
          invert_comparator: 1'd0,
          frame_sync: 1'd1,
          wire_version: 2'd1,
          pattern: 1'd0,
          threshold_jump: 16'd0,
          line_period: 32'd781,
          line_read: 32'd780,
          step_period: 16'd390,
          step_read: 16'd370,
          ramp: 16'd1095,
          threshold_rest: 16'd0,
          threshold_decay: 8'd0,
          noise_floor: 8'd22,
          lines: 8'd127,
          record: 1'd0};
    if (!is_large && channels == 16)
      r = '{
          random_lines: 1'd0,
          mechanoreceptor: 1'd0,
          invert_comparator: 1'd0,
          frame_sync: 1'd1,
          wire_version: 2'd0,
          pattern: 1'd0,
          threshold_jump: 16'd0,
          line_period: 32'd300,
          line_read: 32'd300,
          step_period: 16'd75,
          step_read: 16'd55,
          ramp: 16'd150,
          threshold_rest: 16'd0,
          threshold_decay: 8'd0,
          noise_floor: 8'd3,
          lines: 8'd63,
          record: 1'd0};
    if (!is_large && channels == 64)
      r = '{
          random_lines: 1'd0,
          mechanoreceptor: 1'd0,
          invert_comparator: 1'd0,
          frame_sync: 1'd1,
          wire_version: 2'd0,
          pattern: 1'd0,
          threshold_jump: 16'd0,
          line_period: 32'd75,
          line_read: 32'd75,
          step_period: 16'd75,
          step_read: 16'd55,
          ramp: 16'd150,
          threshold_rest: 16'd0,
          threshold_decay: 8'd0,
          noise_floor: 8'd3,
          lines: 8'd63,
          record: 1'd0};
    r.lines = 8'(driven_lines - 1);
    if (is_large) begin
      if (r.line_read < 32'(steps) * 32'(r.step_period)) r.line_read = 32'(steps) * 32'(r.step_period);
      if (r.line_period < r.line_read) r.line_period = r.line_read;
    end
    return r;
  endfunction

endpackage
