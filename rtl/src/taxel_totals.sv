// What the board counts since reset. The totals are those of whole frames, as they were when the last one's events were found.
//
// Throughput: all inputs in each clock.
// Latency: three clocks from the end of a frame to its totals.
// Loses nothing within 2^48: there counts begin again.
module taxel_totals (
    input  logic                 clk,
    input  logic                 reset,
    input  logic                 event_sent,    // a taxel's change went into the queue
    input  logic                 queue_lost,    // an event or a marker found no room in it
    input  logic                 marker_lost,   // a marker found none before it
    input  logic                 not_returned,
    input  logic [2:0]           skipped,       // so many bytes were no command
    input  logic                 refused,       // a command found no room for its answer
    input  logic                 datagram,      // the link accepted the last byte of one
    input  logic                 frame_over,    // all events of a frame were found
    output taxel_types::count_t  lost,
    output taxel_types::count_t  faults,
    output taxel_types::count_t  commands,
    output taxel_types::totals_t totals
);

  import taxel_types::*;

  count_t frames, events, datagrams;
  logic over, done, one_event, one_fault, one_datagram;
  logic [1:0] more_lost;
  logic [2:0] more_commands;

  // What is to be counted is registered first: it is known late in a clock.
  always_ff @(posedge clk) begin
    over          <= frame_over;
    one_event     <= event_sent;
    one_fault     <= not_returned;
    one_datagram  <= datagram;
    more_lost     <= 2'(queue_lost) + 2'(marker_lost);
    more_commands <= skipped + 3'(refused);
    frames        <= frames + count_t'(over);
    events        <= events + count_t'(one_event);
    faults        <= faults + count_t'(one_fault);
    datagrams     <= datagrams + count_t'(one_datagram);
    lost          <= lost + count_t'(more_lost);
    commands      <= commands + count_t'(more_commands);
    // Now the counts have all of that frame's.
    if (done) totals <= '{frames: frames, events: events, dropped: lost, datagrams: datagrams, faults: faults};
    done <= over;
    if (reset) begin
      {over, done, one_event, one_fault, one_datagram, more_lost, more_commands} <= '0;
      {frames, events, faults, datagrams, lost, commands} <= '0;
      totals <= '0;
    end
  end

endmodule
