// The sorter of version 2, whatever comes when and whenever what it hands on is taken: two events, of any taxels and
// times, come out once each and unchanged, by ascending rows where they are of one line and time, else in the order in
// which they came; what is not sorted passes unchanged, behind all that came before it.
//
// A line has 16 rows here. A taxel changes once at a time, and events of a line and a time come together, in one
// format.
module sorter_proof
  import taxel_types::*;
#(
    parameter bit LEMMAS = 1'b1
) (
    input logic   clk,
    input logic   ready,
    input event_t oldest,
    input logic   leaving,
    input logic   accepts
);

  localparam int ROWS = 16;

  logic begun = 1'b0;
  logic pop, idle, valid, taken;
  event_t entry;

  assign taken = accepts && valid;

  taxel_line_sorter #(.ROWS(ROWS)) sorter (
      .clk, .reset(!begun), .ready, .oldest, .leaving, .pop, .idle, .valid, .entry, .taken
  );

  // The two events: what they are stands still.
  event_t [1:0] events;
  logic [1:0] seen, gone, comes, out;
  logic between;  // another group came between them
  logic sorts, passed;
  event_t waited, passing, standing;
  logic waits, stands, leaves;
  logic [1:0] lost_first;  // the first of an event's group came out as one behind a loss

  function automatic logic is_sorted(event_t e);
    return e.kind == ENTRY_EVENT && e.format.frame_sync;
  endfunction

  function automatic logic together(event_t a, event_t b);
    return a.x == b.x && a.at == b.at;
  endfunction

  always_comb begin
    sorts = is_sorted(oldest);
    for (int k = 0; k < 2; k++) begin
      comes[k] = sorts && together(oldest, events[k]) && oldest.y == events[k].y;
      out[k]     = valid && is_sorted(entry) && together(entry, events[k]) && entry.y == events[k].y;
    end
  end

  always_ff @(posedge clk) begin
    begun  <= 1'b1;
    events <= events;
    if (begun) begin
      for (int k = 0; k < 2; k++) begin
        if (pop && comes[k]) seen[k] <= 1'b1;
        if (taken && out[k]) gone[k] <= 1'b1;
        if (taken && is_sorted(entry) && together(entry, events[k]) && seen[k] && entry.lost) lost_first[k] <= 1'b1;
      end
      // After the first of the two, up to the second.
      if (seen[0] && !seen[1] && pop && !(sorts && together(oldest, events[0]))) between <= 1'b1;
    end
    passed  <= begun && pop && !sorts;
    passing <= oldest;
    stands  <= begun && ready && !pop;
    standing <= oldest;
    leaves  <= begun && leaving && !idle;
    waits   <= begun && valid && !taken;
    waited  <= entry;
    if (!begun) {seen, gone, between, passed, waits, stands, leaves, lost_first} <= '0;
  end

  // Where faults are looked for: entries so far, and what stands still of how they follow one another.
  logic [3:0] popped, group, row_first, row_stride;
  logic [1:0] together_bits;
  logic differ;  // lines of the same time follow one another
  assign group = popped >> together_bits;

  always_ff @(posedge clk) begin
    popped <= begun ? popped + 4'(pop) : '0;
    {row_first, row_stride, together_bits, differ} <= {row_first, row_stride, together_bits, differ};
  end

  always_comb begin
    // Two different events, the first of them first, each once and as it is.
    assume (is_sorted(events[0]) && is_sorted(events[1]));
    assume (32'(events[0].y) < ROWS && 32'(events[1].y) < ROWS);
    assume (!together(events[0], events[1]) || events[0].y != events[1].y);
    if (begun) begin
      // A fault must show with lines of as many taxels each, whose rows are as far from one another, and which follow one
      // another at once.
      if (!LEMMAS) begin
        assume (ready || leaving);
        assume (oldest.y == 7'(4'(row_first + row_stride * popped)));
        assume (oldest.x == 7'(differ && group[0]) && oldest.at == 48'(group >> differ));
        assume (oldest.value == 16'(popped) && oldest.more == popped[0]);
        assume ({oldest.format.version_2, oldest.format.wide_values, oldest.format.spikes} == 3'b100);
        assume ({oldest.frame, oldest.states, oldest.totals} == '0);
      end
      assume (!ready || 32'(oldest.y) < ROWS);
      assume (!(ready && leaving));
      // What stands at the queue's output stays there until it is taken; an entry of version 1 until nothing is
      // gathered.
      if (stands) assume (ready && oldest == standing);
      if (leaves) assume (leaving);
      for (int k = 0; k < 2; k++) begin
        if (pop && comes[k]) assume (oldest == events[k] && !seen[k]);
        if (pop && sorts && together(oldest, events[k]))
          assume (oldest.format == events[k].format && oldest.frame == events[k].frame
                  && {oldest.states, oldest.totals} == {events[k].states, events[k].totals});
      end
      if (pop && comes[1]) assume (seen[0]);
      // Events of a group come together.
      if (pop && comes[1] && between) assume (!together(events[0], events[1]));

      for (int k = 0; k < 2; k++) begin
        if (out[k]) begin
          assert (seen[k] && !gone[k]);
          assert (entry.more == events[k].more && entry.value == events[k].value && entry.format == events[k].format);
          assert (entry.kind == events[k].kind && entry.frame == events[k].frame);
          if (events[k].lost) assert (entry.lost || lost_first[k]);
        end
        if (idle) assert (!seen[k] || gone[k]);
        // What is not sorted waits for what came before.
        if (passed) assert (!seen[k] || gone[k]);
      end
      if (out[1] && (between || events[0].y < events[1].y || !together(events[0], events[1]))) assert (gone[0]);
      if (out[0] && seen[1] && !between && together(events[0], events[1]) && events[1].y < events[0].y)
        assert (gone[1]);
      if (passed) assert (valid && entry == passing);
      if (waits) assert (valid && entry == waited);
      cover (gone == 2'b11 && together(events[0], events[1]) && events[1].y + 7'd8 < events[0].y);
      cover (gone == 2'b11 && between && events[1].x != events[0].x && passed);
      cover (sorter.handing && sorter.gathered && seen == 2'b11 && gone == 2'b00);
      cover (passed && gone[0]);
    end
  end

  // Where each of them is meanwhile, without which the induction does not close: it is gathered, or waits with its
  // line, or is of the rows that are chosen from, chosen, landed, at the output.
  logic [1:0] gathers, lies, rests, chosen, landed, hands;
  logic [1:0][2:0] rank;  // how far: the lower row of a line is never behind
  always_comb begin
    for (int k = 0; k < 2; k++) begin
      gathers[k] = sorter.gathered && together(sorter.gathering, events[k])
          && sorter.changed[sorter.bank][events[k].y[3]][events[k].y[2:0]];
      lies[k]    = sorter.changed[!sorter.bank][events[k].y[3]][events[k].y[2:0]];
      rests[k]   = sorter.rows[events[k].y[2:0]] && sorter.base == {events[k].y[6:3], 3'd0};
      chosen[k]  = sorter.chosen && sorter.y == events[k].y;
      landed[k]  = sorter.landed && sorter.y_landed == events[k].y;
      if (!sorter.handing || !together(sorter.line, events[k])) {lies[k], rests[k], chosen[k], landed[k]} = '0;
      hands[k] = lies[k] || rests[k] || chosen[k] || landed[k];
      rank[k]  = gone[k] ? 3'd6 : out[k] ? 3'd5 : landed[k] ? 3'd4 : chosen[k] ? 3'd3 : rests[k] ? 3'd2 : 3'd1;
    end
    if (LEMMAS && begun) begin
      assert (sorter.handing || (sorter.changed[!sorter.bank] == '0 && sorter.rows == '0 && !sorter.chosen
                                 && !sorter.landed));
      assert (!sorter.fetched || sorter.chosen);
      assert (sorter.gathered || sorter.changed[sorter.bank] == '0);
      assert (!sorter.gathered || sorter.changed[sorter.bank] != '0);
      assert (!sorter.handing || sorter.group <= 2'd2);
      assert (!(sorter.handing && sorter.group >= 2'd1) || sorter.changed[!sorter.bank][0] == '0);
      assert (!(sorter.handing && sorter.group >= 2'd2) || sorter.changed[!sorter.bank][1] == '0);
      if (sorter.rows != '0) assert (sorter.group >= 2'd1 && sorter.base == {3'd0, sorter.group == 2'd2, 3'd0});
      if (sorter.weighed) assert (stands && sorter.same == together(standing, sorter.gathering));
      assert (!sorter.gathered || is_sorted(sorter.gathering));
      assert (!sorter.handing || is_sorted(sorter.line));
      assert (!between || (seen[0] && !gathers[0]));
      assert (!seen[1] || (seen[0] && (between || together(events[0], events[1]))));
      if (between && hands[1]) assert (!hands[0]);
      if (seen[1] && !between) begin
        assert (gathers[0] == gathers[1] || gone[0]);
        if (hands[0]) assert (hands[1] || out[1] || gone[1]);
        if (hands[1]) assert (hands[0] || out[0] || gone[0]);
        if (hands[0] || hands[1])
          assert (gone[0] || (events[0].y < events[1].y ? rank[0] >= rank[1] : rank[1] >= rank[0]));
      end
      if (seen[0] && !seen[1] && !between && !gathers[0] && !gone[0])
        assert (leaving || (ready && !(sorts && together(oldest, events[0]))));
      for (int k = 0; k < 2; k++) begin
        assert (3'(gathers[k]) + 3'(lies[k]) + 3'(rests[k]) + 3'(chosen[k]) + 3'(landed[k]) + 3'(out[k])
                == 3'(seen[k] && !gone[k]));
        assert (seen[k] || !gone[k]);
        if (gathers[k]) assert (sorter.held[{sorter.bank, events[k].y}] == {events[k].more, events[k].value});
        if (lies[k] || rests[k] || chosen[k])
          assert (sorter.held[{!sorter.bank, events[k].y}] == {events[k].more, events[k].value});
        if (chosen[k] && sorter.fetched) assert (sorter.held_read == {events[k].more, events[k].value});
        if (landed[k]) assert (sorter.held_of == {events[k].more, events[k].value});
        if (sorter.gathered && seen[k] && together(sorter.gathering, events[k]) && gathers[k])
          assert (sorter.gathering.format == events[k].format && sorter.gathering.frame == events[k].frame
                  && (!events[k].lost || sorter.gathering.lost));
        if (hands[k])
          assert (sorter.line.format == events[k].format && sorter.line.frame == events[k].frame
                  && (!events[k].lost || sorter.line.lost || lost_first[k]
                      || (valid && entry.lost && is_sorted(entry) && together(entry, events[k]))));
      end
    end
  end

endmodule
