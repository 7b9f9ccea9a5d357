// The converter between its two clocks, 150 and 100 MHz of one PLL, which is 3 to 2: whatever is read when and whatever
// the comparators show, each read has one ramp of its length and is reported once, in order, with what its samples
// were; what is reported stands still for a whole clock before it is taken, and comes between the end of its own read
// and that of the next one.
//
// Of 20 ns five steps are looked at: three edges of the fast clock and two of the slow one, by turns as fast, slow,
// fast, slow, fast, or with the first two at once (`aligned`): there are no other orders. A synchroniser's first
// flip-flop may take a change at the edge at which it comes or at the next one, each time anew. One channel of a bank
// of eight, of which the others see nothing; ramps of 10 ticks at most, 5 ticks shorter than their reads as rule
// 3 demands; reads of 4 clocks or more, which end 13 clocks apart or more, where a board's rules demand 26. The next
// read may begin as soon as a read has ended: ramps in reads of 4 and 5 clocks last until then, and their samples into
// the next read.
module crossing_proof #(
    parameter bit LEMMAS = 1'b1
) (
    input logic       tick,
    input logic       given_aligned,
    input logic       wants_start,
    input logic       wants_end,
    input logic [3:0] new_length,
    input logic       new_inverted,
    input logic [1:0] comparators
);

  localparam int APART = 13;
  localparam int LONGEST = 10;
  localparam int FALLS = 5;

  logic [2:0] phase = '0;
  logic [3:0] warm = '0;
  logic aligned;  // stands still after the first slow edge
  logic up_fast, up_slow, open_fast, open_slow, clk, clk_fast;
  assign up_fast = !phase[0];
  assign up_slow = phase == 3'd3 || phase == (aligned ? 3'd0 : 3'd1);
  always_latch if (!tick) open_fast = up_fast;
  always_latch if (!tick) open_slow = up_slow;
  assign clk_fast = tick & open_fast;
  assign clk      = tick & open_slow;

  logic reset, begun, read_start, step_end, inverted, read_done, tripped, first;
  logic [3:0] length;
  logic [14:0] at;
  logic [7:0] all_tripped, all_first;
  logic [7:0][14:0] all_at;
  assign {tripped, first, at} = {all_tripped[0], all_first[0], all_at[0]};
  logic [1:0] ramp;
  // They are a read's in the clock in which it starts, and in others of any value.
  logic [3:0] length_shown;
  logic inverted_shown, ever;
  // The read before; and of the read that the converter knows of, which is still that one while a read starts.
  logic [3:0] length_before, length_of;
  logic inverted_before, inverted_of;
  assign length_of      = read_start ? length_before : length;
  assign inverted_of    = read_start ? inverted_before : inverted;
  assign length_shown   = read_start ? length : new_length;
  assign inverted_shown = read_start ? inverted : new_inverted;
  assign reset = warm < 4'd8;
  assign begun = warm == 4'd13;

  taxel_comparator_array #(.CHANNELS(8)) converter (
      .clk, .reset, .read_start, .step_end, .length(16'(length_shown)), .inverted(inverted_shown), .read_done,
      .tripped(all_tripped), .first(all_first), .at(all_at), .clk_fast, .comparators({14'd0, comparators}), .ramp
  );

  // The scan, in slow clocks. A read is a clock longer than from start to end.
  logic reading, starts, ends;
  logic [3:0] since_start, since_end;
  logic asked;       // a read began whose ramp has not risen
  logic unreported;  // a read ended that was not reported
  assign starts = begun && !reading && wants_start;
  assign ends   = reading && since_start >= 4'd2 && since_end >= 4'(APART - 1) && wants_end
      && 6'(length) + 6'(FALLS) <= 6'd3 * (6'(since_start) + 6'd2);

  // The board, in fast clocks: the ramp as it is seen, and the samples that the pins' cells give two clocks later.
  logic high, low, rises, rose, sampled, sampled_before, done_now;
  logic [1:0] pair;
  logic [2:0] pairs, pairs_left, pairs_due;
  logic [3:0] left, due;  // ticks of the ramp still to come
  logic inverts, trips, trips_first, trips_before, first_before;
  logic [2:0] trips_at, at_before;
  assign rises    = up_fast && ramp[0] && !high;
  assign due      = rises ? length_of : left;
  assign pair     = comparators ^ {2{inverts}};
  assign done_now = up_slow && read_done;

  // What was reported, step by step.
  logic [2:0][16:0] results;

  always_ff @(posedge tick) begin
    if (warm == '0) aligned <= given_aligned;
    phase   <= phase == 3'd4 ? 3'd0 : phase + 3'd1;
    results <= {results[1:0], {tripped, first, at}};
    if (up_slow) begin
      if (!begun) warm <= warm + 4'd1;
      read_start <= starts;
      step_end   <= ends;
      if (since_start != 4'd15) since_start <= since_start + 4'd1;
      if (since_end != 4'd15) since_end <= since_end + 4'd1;
      if (starts) begin
        reading     <= 1'b1;
        since_start <= '0;
        length      <= new_length;
        inverted    <= new_inverted;
        {length_before, inverted_before} <= {length, inverted};
      end
      if (ends) begin
        reading   <= 1'b0;
        since_end <= '0;
      end
    end
    if (rises) asked <= 1'b0;
    if (up_slow && read_start) {asked, ever} <= '1;
    if (done_now) unreported <= 1'b0;
    if (up_slow && step_end) unreported <= 1'b1;
    if (up_fast) begin
      high <= ramp[1];
      low  <= ramp == 2'b00;
      rose <= rises;
      left <= due < 4'd2 ? 4'd0 : due - 4'd2;
      if (rises) {inverts, pairs_due} <= {inverted_of, 3'(length_of >> 1)};
      if (rose) begin
        // Pair 0. What was not reported yet goes one place down.
        {trips_before, first_before, at_before} <= {trips, trips_first, trips_at};
        {trips, trips_first, trips_at} <= {pair != 2'b00, pair[0], 3'd0};
        pairs      <= 3'd1;
        pairs_left <= pairs_due;
      end else if (pairs_left != 3'd0) begin
        if (!trips) {trips, trips_first, trips_at} <= {pair != 2'b00, pair[0], pairs};
        pairs      <= pairs + 3'd1;
        pairs_left <= pairs_left - 3'd1;
      end
    end
    // Which results wait for their report.
    if (done_now && sampled_before) sampled_before <= 1'b0;
    else if (done_now) sampled <= 1'b0;
    if (up_fast && rose) begin
      sampled        <= 1'b1;
      sampled_before <= sampled && !done_now;
    end
    if (!begun) begin
      {reading, read_start, step_end, asked, ever, unreported, high, rose, left, pairs_left, sampled, sampled_before} <= '0;
      {since_start, since_end} <= '1;
      {length, length_before} <= {4'd1, 4'd1};
    end
  end

  always_comb begin
    assume (new_length != 4'd0 && 32'(new_length) <= LONGEST);
    // The count of pairs goes on after a ramp and comes round in 218 us. Were that in the clock in which the first
    // sample of a ramp of one tick draws near, samples after it would count: past the ramp, so that they read as the
    // ramp's length.
    assume (!converter.nears || converter.open || !converter.counter.one_left);
    if (begun) begin
      // One ramp a read, of its length, begun before the next read begins, and behind a clock in which it is low.
      if (up_fast) assert (ramp == {due >= 4'd2, due >= 4'd1});
      if (rises) assert (asked && low);
      if (up_slow && read_start) assert (!asked || rises);
      if (up_slow && step_end) assert (!unreported || read_done);
      if (up_fast && rose) assert (!sampled_before || done_now);
      if (done_now) begin
        assert (unreported && sampled && results == {3{{tripped, first, at}}});
        if (sampled_before)
          assert (tripped == trips_before && (!tripped || (first == first_before && at == 15'(at_before))));
        else
          assert (pairs_left == 3'd0 && tripped == trips
                  && (!tripped || (first == trips_first && at == 15'(trips_at))));
      end
      // That is twelve clocks after its end at the latest.
      if (since_end >= 4'(APART - 1)) assert (!unreported || read_done);
      cover (done_now && tripped && at == 15'd2 && length == 4'd5 && aligned);
      cover (done_now && tripped && at == 15'd2 && length == 4'd5 && !aligned);
      cover (done_now && sampled_before);
      cover (up_fast && converter.begins && converter.open);
      cover (done_now && !sampled_before && reading && since_end != 4'd15 && tripped);
    end
  end

  // Where a read is on its way, without which the induction does not close: how many edges ago of the clock that it
  // crosses to a bit was caught by the first flip-flop, counted up to some; and how many ago it changed. Where a read
  // begins while the one before is sampled still, that one's count goes on in `ahead`.
  localparam logic [3:0] OLD = 4'd14;
  localparam logic [2:0] OLD_END = 3'd4;
  localparam logic [2:0] OLD_DONE = 3'd4;
  logic [3:0] caught, ahead;
  logic [2:0] caught_end, caught_done, since_done;
  logic known;  // a read was sampled

  function automatic logic [3:0] later(logic [3:0] count);
    return count == OLD ? OLD : count + 4'd1;
  endfunction

  always_ff @(posedge tick) begin
    if (up_fast) begin
      caught     <= converter.to_start.crossing.unsettled != converter.began ? '0 : later(caught);
      ahead      <= later(converter.to_start.crossing.unsettled != converter.began && caught != '0 ? caught : ahead);
      caught_end <= converter.to_ended.unsettled != converter.ended ? '0
          : caught_end == OLD_END ? OLD_END : caught_end + 3'd1;
      if (converter.begins) known <= 1'b1;
    end
    if (up_slow) begin
      caught_done <= converter.to_done.crossing.unsettled != converter.to_done.number ? '0
          : caught_done == OLD_DONE ? OLD_DONE : caught_done + 3'd1;
      if (since_done != 3'd7) since_done <= since_done + 3'd1;
    end
    if (up_fast && converter.copy) since_done <= '0;
    if (!begun) begin
      {caught, ahead, caught_end, caught_done, since_done} <= {OLD, OLD, OLD_END, OLD_DONE, 3'd7};
      known <= 1'b0;
    end
  end

  // Fast edges since the slow edge of so many clocks ago: every other slow edge is followed by two.
  function automatic logic [5:0] fast_edges(logic [4:0] clocks, logic [2:0] phase_now, logic aligned_now);
    logic after_third;
    logic [5:0] since_slow;
    after_third = phase_now == 3'd4 || phase_now == 3'd0 || (phase_now == 3'd1 && !aligned_now);
    since_slow  = phase_now == 3'd1 ? (aligned_now ? 6'd0 : 6'd2) : 6'(phase_now == 3'd0 || phase_now == 3'd3);
    return since_slow + ((6'd3 * 6'(clocks) + 6'(after_third ^ clocks[0])) >> 1);
  endfunction

  // Of a bit that changed so many edges ago: what the flip-flops hold.
  function automatic logic crosses(
      logic [5:0] edges, logic caught_now, logic [3:0] count, logic [3:0] old, logic was_caught);
    if (edges == 6'd0) return !caught_now && !was_caught;
    if (!was_caught) return 1'b0;
    if (!caught_now) return edges == 6'd1;
    return 6'(count) == (edges > 6'(old) ? 6'(old) : edges - 6'd1)
        || (edges >= 6'd2 && 6'(count) == (edges > 6'(old) + 6'd1 ? 6'(old) : edges - 6'd2));
  endfunction

  logic signed [4:0] step;         // of the read that began last: -1 until it is caught
  logic signed [4:0] step_before;  // of the read before
  logic [4:0] half, half_before;   // pairs of their ramps
  logic [5:0] edges, edges_end;
  logic caught_now, caught_end_now, caught_done_now, current;
  logic [4:0] done_step;    // clocks since its counts might be copied: in the next one they are
  logic waits;              // for that
  logic awaited;
  logic [14:0] pair_here;
  logic [1:0] sample, next_sample;
  assign caught_now      = converter.to_start.crossing.unsettled == converter.began;
  assign caught_end_now  = converter.to_ended.unsettled == converter.ended;
  assign caught_done_now = converter.to_done.crossing.unsettled == converter.to_done.number;
  assign step        = caught_now ? 5'(caught) : -5'sd1;
  assign step_before = 5'(!caught_now && caught != '0 ? caught : ahead);
  assign edges       = fast_edges(5'(since_start) - 5'd1, phase, aligned);
  assign edges_end   = fast_edges(5'(since_end) - 5'd1, phase, aligned);
  assign half        = 5'(length_of >> 1);
  assign half_before = 5'(length_before >> 1);
  assign current   = converter.ended == converter.began;
  assign awaited   = converter.g_bank[0].g_column[0].column.awaited;
  assign pair_here = converter.g_bank[0].pair;
  assign sample    = converter.brought[0];
  assign next_sample = converter.sampled[0] ^ {2{converter.inverted_now}};

  // Until the read that began last comes to a step, what has that step is the read's before: by steps, which read's step
  // stands there, whether that read is not over, and what it asked for.
  logic [6:3][4:0] at_step, half_at;
  logic [6:3][3:0] length_at;
  logic [6:3] lives, inverted_at;
  always_comb begin
    for (int k = 3; k <= 6; k++) begin
      {at_step[k], half_at[k], length_at[k], inverted_at[k]} = step >= 5'(k)
          ? {step, half, length_of, inverted_of} : {step_before, half_before, length_before, inverted_before};
      lives[k] = at_step[k] >= 5'(k) && at_step[k] != 5'(OLD);
    end
  end

  // The clocks in which the read that ended last is copied.
  logic end_seen, pairs_over;
  logic [2:0] of_end;
  logic [4:0] of_pairs;
  always_comb begin
    end_seen   = caught_end_now && caught_end >= 3'd1;
    of_end     = caught_end - 3'd1;
    of_pairs   = (current ? 5'(step) - half : 5'(step_before) - half_before) - 5'd7;
    pairs_over = current ? step >= 5'sd7 + $signed(half) : step_before >= 5'sd7 + $signed(half_before);
    waits      = !end_seen || !pairs_over;
    done_step  = 5'(of_end) < of_pairs ? 5'(of_end) : of_pairs;
  end

  // What the board has of the read that the column samples, or sampled last.
  logic trips_here, first_here;
  logic [2:0] at_here;
  assign {trips_here, first_here, at_here} = step == 5'sd5 ? {trips_before, first_before, at_before}
      : {trips, trips_first, trips_at};

  always_comb begin
    if (LEMMAS && warm >= 4'd8 && !begun) begin
      assert (!converter.began && !converter.ended && !converter.read_done && !converter.to_done.last);
      assert (!converter.to_start.crossing.was && !converter.to_start.crossing.unsettled && !converter.to_start.crossed);
      assert (!converter.to_ended.was && !converter.to_ended.unsettled && !converter.ended_fast);
      assert (!converter.to_done.crossing.was && !converter.to_done.crossing.unsettled && !converter.to_done.crossed);
      assert (!converter.to_start.last && !converter.start && !converter.number && converter.copied && !converter.copy);
      assert (!converter.to_done.number && converter.counter.delayed == '0 && !converter.begun && !converter.open);
      assert (ramp == '0 && !converter.counter.rising);
      assert (!converter.g_bank[0].begins_here && !converter.g_bank[0].copies_here);
    end
    if (LEMMAS && begun) begin
      // The scan.
      assert (warm == 4'd13 && phase <= 3'd4);
      assert (!read_start || (reading && since_start == '0));
      assert (!step_end || (since_end == '0 && !unreported));
      if (since_start == 4'd0) assert (read_start);
      if (since_end == 4'd0) assert (step_end);
      assert (length != 4'd0 && 32'(length) <= LONGEST);
      assert (length_before != 4'd0 && 32'(length_before) <= LONGEST);
      if (ever && !read_start) assert (converter.length_held == 16'(length) && converter.inverted_held == inverted);
      assert (ever || read_start || since_start == 4'd15);
      if (reading) assert (since_end == 4'd15 || since_end > since_start);
      else assert (since_start == 4'd15 || since_start >= since_end + 4'd3);
      if (since_start < 4'd12) assert (since_end >= 4'd12 || since_end >= since_start + 4'd1 || !reading);
      assert (current == !((reading || step_end) && since_start != 4'd0));
      if (!reading) assert (since_start == 4'd15 || 6'(length) + 6'(FALLS) <= 6'd3 * (6'(since_start) + 6'd1));
      // How far the read before is ahead; of three reads one is over.
      if (step_before != 5'(OLD) && since_start != 4'd0)
        assert (step >= 5'sd6 || (step_before >= step + 5'sd5
                && step_before >= step + 5'sd1 + $signed(half_before) + $signed(5'(length_before[0]))));
      if (reading && since_start == 4'd0)
        assert (caught == OLD || (since_end != 4'd15 && 6'(caught) + 6'd2 >= fast_edges(since_end + 5'd2, phase, aligned)));
      else if (reading)
        assert (step_before == 5'(OLD)
                || (since_end != 4'd15 && 6'(step_before) + 6'd2 >= fast_edges(since_end + 5'd2, phase, aligned)));
      if (!reading && since_start < since_end + 4'd5) assert (step >= 5'sd6 || step_before == 5'(OLD));
      if (since_start == 4'd0) assert (step >= 5'sd2 && (step >= 5'sd6 || step_before == 5'(OLD)));
      // Bits on their way.
      if (since_start == 4'd0) assert (caught_now && converter.to_start.crossing.was == converter.began);
      else if (since_start == 4'd15) assert (caught == OLD && caught_now
          && converter.to_start.crossing.was == converter.began);
      else assert (crosses(edges, caught_now, caught, OLD, converter.to_start.crossing.was == converter.began));
      if (since_end == 4'd0 || since_end == 4'd15) assert (caught_end == OLD_END && caught_end_now
          && converter.to_ended.was == converter.ended);
      else assert (crosses(edges_end, caught_end_now, 4'(caught_end), 4'(OLD_END),
                           converter.to_ended.was == converter.ended));
      if (since_done == 3'd7) assert (caught_done == OLD_DONE && caught_done_now
          && converter.to_done.crossing.was == converter.to_done.number);
      else assert (crosses(6'(since_done), caught_done_now, 4'(caught_done), 4'(OLD_DONE),
                           converter.to_done.crossing.was == converter.to_done.number));
      assert (converter.ended_fast == (converter.ended ^ !end_seen));
      assert (converter.to_done.crossed == (converter.to_done.number ^ !(caught_done_now && caught_done >= 3'd1)));
      assert (converter.to_done.last == (converter.to_done.number ^ !(caught_done_now && caught_done >= 3'd2)));
      assert (read_done == (caught_done_now && caught_done == 3'd2));
      // The read, clock by clock.
      assert (converter.to_start.crossed == (converter.began ^ (step < 5'sd1)));
      assert (converter.to_start.last == (converter.began ^ (step < 5'sd2)));
      assert (converter.number == (converter.began ^ (step < 5'sd6 && step_before >= 5'sd6)));
      assert (converter.start == (step == 5'sd2) && converter.begun == (at_step[6] == 5'd6));
      assert (converter.counter.delayed == {at_step[5] == 5'd5, at_step[4] == 5'd4, step == 5'sd3});
      assert (converter.g_bank[0].begins_here == (at_step[5] == 5'd5) && converter.g_bank[0].copies_here == converter.copy);
      assert (converter.open == (lives[6] && at_step[6] <= 5'd6 + half_at[6]));
      if (lives[3]) assert (converter.counter.pairs_next == 15'(half_at[3]) && converter.senses[0] == inverted_at[3]);
      assert (converter.counter.rising == (lives[3] && half_at[3] > at_step[3] - 5'd3));
      assert (ramp == (lives[3] ? {5'(length_at[3]) >= {at_step[3] - 5'd3, 1'b0} + 5'd2,
                                   5'(length_at[3]) >= {at_step[3] - 5'd3, 1'b0} + 5'd1} : 2'b00));
      if (converter.counter.rising) begin
        assert (converter.counter.ramp_left == 15'(half_at[3] - (at_step[3] - 5'd3)));
        assert (converter.counter.odd == length_at[3][0]);
        assert (converter.counter.ramp_last == (half_at[3] - (at_step[3] - 5'd3) == 5'd1));
      end
      if (lives[4]) assert (converter.counter.pairs == 15'(half_at[4]) && converter.senses[1] == inverted_at[4]);
      if (lives[5])
        assert (converter.counter.none == (half_at[5] == 5'd0) && converter.counter.single == (half_at[5] == 5'd1)
                && converter.inverted_now == inverted_at[5]);
      if (converter.open) begin
        assert (pair_here == 15'(at_step[6] - 5'd6));
        assert (converter.counter.pairs_left == 15'(half_at[6] - (at_step[6] - 5'd6)));
        assert (converter.counter.one_left == (at_step[6] - 5'd5 == half_at[6]));
        assert (converter.counter.pairs_last == (at_step[6] - 5'd6 == half_at[6]));
        assert (converter.g_bank[0].closes_here == (at_step[6] - 5'd6 == half_at[6]));
      end
      // The board.
      assert (high == (lives[4] && 5'(length_at[4]) >= {at_step[4] - 5'd4, 1'b0} + 5'd2));
      assert (rose == (at_step[4] == 5'd4));
      assert (asked == (step < 5'sd4));
      if (lives[4]) begin
        assert (inverts == inverted_at[4]);
        assert (5'(left) == (5'(length_at[4]) >= {at_step[4] - 5'd3, 1'b0}
            ? 5'(length_at[4]) - {at_step[4] - 5'd3, 1'b0} : 5'd0));
      end else assert (left == '0);
      if (rose) assert (5'(pairs_due) == half_at[4]);
      assert (5'(pairs_left) == (lives[5] && at_step[5] <= 5'd5 + half_at[5] ? half_at[5] - (at_step[5] - 5'd5) : 5'd0));
      if (pairs_left != 3'd0) assert (5'(pairs) == at_step[5] - 5'd4);
      assert (!known || !awaited || converter.open);
      if (at_step[6] == 5'd6) assert (awaited);
      if (lives[6]) assert (known);
      if (sampled_before || (sampled && at_step[5] != 5'd5)) assert (known);
      // The board is a pair ahead of the column.
      if (at_step[5] == 5'd5)
        assert (trips == (next_sample != 2'b00)
                && (!trips || (trips_first == next_sample[0] && trips_at == 3'd0)));
      if (known && (step == 5'sd5 || at_step[5] != 5'd5)) begin
        if (!awaited)
          assert (converter.tripped_now[0] == trips_here
                  && (!trips_here || (converter.first_now[0] == first_here && converter.at_now[0] == 15'(at_here))));
        else if (sample != 2'b00)
          assert (trips_here && first_here == sample[0] && 15'(at_here) == pair_here);
        else if (pair_here == 15'(half_at[6]))
          assert (!trips_here);
        else
          assert (trips_here == (next_sample != 2'b00)
                  && (!trips_here || (first_here == next_sample[0] && 15'(at_here) == pair_here + 15'd1)));
      end
      if (sampled_before && step == 5'sd6)
        assert (converter.tripped_now[0] == trips_before
                && (!trips_before || (converter.first_now[0] == first_before
                                      && converter.at_now[0] == 15'(at_before))));
      // The copy, and its report.
      if (current && step < 5'sd6) begin
        // The read that began last ended before its first sample.
        assert (converter.copied && !converter.copy && converter.to_done.number == converter.number);
      end else if (!current && step >= 5'sd6) begin
        // It has not ended, and the one before was copied as its samples began, or before.
        assert (!converter.copied && converter.copy == (step == 5'sd6 && (waits || done_step < 5'd2)));
        assert (converter.to_done.number == (converter.number ^ !converter.copy));
      end else begin
        assert (converter.copied == (at_step[6] < 5'd6 || (!waits && done_step >= 5'd1)));
        assert (converter.copy == (!waits && done_step == 5'd1));
        assert (converter.to_done.number == (converter.ended ^ (waits || done_step < 5'd2)));
      end
      assert (unreported == !(converter.to_done.number == converter.ended && caught_done_now && caught_done >= 3'd3)
              || step_end || since_end == 4'd0);
      if (step_end) assert (converter.to_done.number == converter.ended && since_done >= 3'd5);
      if (!known) assert (current && step == 5'(OLD) ? !unreported
          : step < 5'sd6 && (current || !unreported || step_before < 5'sd6));
      if (current) assert (sampled == (unreported && step >= 5'sd5) && !sampled_before);
      else if (step < 5'sd5) assert (sampled == (unreported && step_before >= 5'sd5) && !sampled_before);
      else assert (sampled && sampled_before == unreported);
      if (unreported && converter.to_done.number == converter.ended) begin
        if (sampled_before)
          assert (tripped == trips_before && (!tripped || (first == first_before && at == 15'(at_before))));
        else assert (tripped == trips && (!tripped || (first == trips_first && at == 15'(trips_at))));
        assert (since_done < 3'd7 && 5'(since_end) <= 5'd8 + 5'(since_done));
      end
    end
  end

endmodule
