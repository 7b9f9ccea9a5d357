// The link with beats of one byte and of four, whatever is given and whenever it is ready: a marked byte comes out once, unchanged,
// after exactly those before it, and ends its datagram where it ended it before; beats are full but for a datagram's last.
//
// What is given stands until it is taken, and a datagram comes byte by byte or two at a time.
module link_of #(
    parameter int BYTES = 1,
    parameter bit LEMMAS = 1'b1
) (
    input logic        clk,
    input logic        begun,
    input logic        valid,
    input logic        paired,
    input logic [15:0] data,
    input logic        last,
    input logic [1:0]  mark,
    input logic        tready
);

  logic ready, tvalid, tlast;
  logic [8*BYTES-1:0] tdata;
  logic [BYTES-1:0] tkeep;

  taxel_link #(.BYTES(BYTES)) link (
      .clk, .reset(!begun), .valid, .ready, .paired, .data, .last, .tdata, .tkeep, .tvalid, .tready, .tlast
  );

  // Bytes that have come and not gone, and datagrams' ends; the marked byte, and how many go before it.
  logic [4:0] level, ahead;
  logic [3:0] ends;
  logic [7:0] marked_data;
  logic marked, marked_last, gone, fresh, waits, open, moves, stood;
  logic [2:0] size;  // of the beat
  logic [9*BYTES:0] beat_before;
  logic paired_before, last_before;
  logic [15:0] data_before;

  assign fresh = begun && valid && !waits;
  assign moves = begun && tvalid && tready;
  assign size  = 3'($countones(tkeep));

  // What is in the link: in the register's first place and in its second, in the beat that is gathered, and given.
  logic later_last;
  logic [BYTES-1:0] later_keep;
  logic [8*BYTES-1:0] later;
  logic [2:0] gathered;  // bytes of a beat that have come
  logic half;            // of two bytes the first has gone
  logic [31:0] gathering;
  logic [4:0] count;
  logic [127:0] content;
  logic [15:0] lasts;

  assign {later_last, later_keep, later} = link.register.second;
  if (BYTES == 1) begin : g_one
    assign gathered  = 3'd0;
    assign gathering = '0;
    assign half      = link.g_byte.second;
  end else begin : g_more
    assign gathered  = 3'(link.g_four.at);
    assign gathering = link.g_four.held;
    assign half      = 1'b0;
  end

  always_comb begin
    content = '0;
    lasts  = '0;
    count  = '0;
    if (tvalid) begin
      content = 128'(tdata) & ~(~128'd0 << {size, 3'd0});
      lasts  = 16'(tlast) << (size - 3'd1);
      count  = 5'(size);
    end
    if (!link.room) begin
      content |= (128'(later) & ~(~128'd0 << (8 * $countones(later_keep)))) << {count, 3'd0};
      count  += 5'($countones(later_keep));
      if (later_last) lasts[4'(count-5'd1)] = 1'b1;
    end
    content |= (128'(gathering) & ~(~128'd0 << {gathered, 3'd0})) << {count, 3'd0};
    count  += 5'(gathered);
    if (waits) begin
      content |= (paired_before ? half ? 128'(data_before[15:8]) : 128'(data_before) : 128'(data_before[7:0])) << {count, 3'd0};
      count  += paired_before && !half ? 5'd2 : 5'd1;
      if (last_before) lasts[4'(count-5'd1)] = 1'b1;
    end
  end

  always_ff @(posedge clk) begin
    waits <= begun && valid && !ready;
    if (fresh) begin
      {paired_before, last_before, data_before} <= {paired, last, data};
      open <= !last;
    end
    level <= level + (fresh ? 5'd1 + 5'(paired) : 5'd0) - (moves ? 5'(size) : 5'd0);
    ends  <= ends + 4'(fresh && last) - 4'(moves && tlast);
    if (fresh && mark[0] && (paired || !mark[1]) && !marked) begin
      marked      <= 1'b1;
      marked_data <= mark[1] ? data[15:8] : data[7:0];
      marked_last <= last && mark[1] == paired;
      ahead       <= level + 5'(mark[1]) - (moves ? 5'(size) : 5'd0);
    end else if (marked && !gone && moves) begin
      if (ahead < 5'(size)) gone <= 1'b1;
      else ahead <= ahead - 5'(size);
    end
    stood       <= begun && tvalid && !tready;
    beat_before <= {tlast, tkeep, tdata};
    if (!begun) {waits, open, level, ends, marked, gone, stood} <= '0;
  end

  always_comb begin
    if (begun) begin
      if (waits) assume (valid && paired == paired_before && last == last_before && data == data_before);
      if (fresh && open) assume (paired == paired_before);
      assert (level <= 5'd13 && (!tvalid || 5'(size) <= level));
      assert (ends == 0 || tvalid);
      if (tvalid) begin
        assert (tkeep == '1 || tlast);
        assert (tkeep[0] && (tkeep & (tkeep + BYTES'(1))) == '0);
        if (marked && !gone && ahead < 5'(size)) begin
          assert (8'(tdata >> {ahead[1:0], 3'd0}) == marked_data);
          assert ((tlast && 5'(size) == ahead + 5'd1) == marked_last);
        end
      end
      if (stood) assert (tvalid && {tlast, tkeep, tdata} == beat_before);
      if (marked && !gone) assert (ahead < level);
      // What is in the link, the oldest byte first, without which the induction does not close: faults must be found without it.
      if (LEMMAS) begin
        assert (level == 5'(count) && ends == 4'($countones(lasts)));
        if (marked && !gone) assert (8'(content >> {ahead, 3'd0}) == marked_data && lasts[ahead[3:0]] == marked_last);
        assert (tvalid || link.room);
        if (!link.room) assert (later_keep == '1 || later_last);
        if (!link.room) assert (later_keep[0] && (later_keep & (later_keep + BYTES'(1))) == '0);
        assert (gathered <= 3'd3 && (!gathered[0] || !paired_before));
        if (!open && !waits) assert (gathered == 3'd0);
        if (open) assert (!last_before);
        if (waits && !open) assert (last_before);
        if (half) assert (waits && paired_before);
      end
      cover (gone && level == 0 && marked_last && paired_before);
      cover (marked && !gone && ahead > 5'd1 && !paired_before && !ready);
    end
  end

endmodule

module link_proof #(
    parameter bit LEMMAS = 1'b1
) (
    input logic             clk,
    input logic [1:0]       valid,
    input logic [1:0]       paired,
    input logic [1:0][15:0] data,
    input logic [1:0]       last,
    input logic [1:0][1:0]  mark,
    input logic [1:0]       tready
);

  logic begun = 1'b0;
  always_ff @(posedge clk) begun <= 1'b1;

  for (genvar k = 0; k < 2; k++) begin : g_size
    link_of #(.BYTES(k == 0 ? 1 : 4), .LEMMAS(LEMMAS)) of_size (
        .clk, .begun, .valid(valid[k]), .paired(paired[k]), .data(data[k]), .last(last[k]), .mark(mark[k]), .tready(tready[k])
    );
  end

endmodule
