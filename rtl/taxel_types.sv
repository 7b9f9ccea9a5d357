// What modules hand on to each other.
package taxel_types;

  // Most markers between two frames; a further one is counted as lost.
  localparam int MARKERS = 4;

  // One read: the taxels of a multiplexer's step, converted at once, and what they are compared by.
  typedef struct packed {
    logic        initial_frame;  // of the frame before time 0, which is not sent
    logic        frame_first;    // the first read of its frame
    logic        frame_last;     // the last read of its frame
    logic [6:0]  line;           // the driven line
    logic [2:0]  step;
    logic [15:0] stamp;          // 100 us
    logic [15:0] ramp;           // ticks
    logic [7:0]  noise_floor;    // ticks
    logic [2:0]  markers;        // how many go before this frame
    logic [MARKERS-1:0] starts;  // what they mark, the oldest in bit 0: a start of a recording, or a stop
  } read_t;

  // One event in the queue: a taxel's change with its value, or a marker.
  typedef struct packed {
    logic        marker;
    logic        frame;  // alternates from one frame that has events to the next
    logic [15:0] stamp;  // 100 us
    logic [5:0]  x;
    logic [5:0]  y;
    logic        more;   // polarity: more pressure; of a marker: start
    logic [15:0] value;
  } event_t;

  // What a command is answered with.
  typedef enum logic [1:0] {
    ANSWER_GREETING,
    ANSWER_OK,
    ANSWER_BAD,
    ANSWER_STATUS
  } answer_kind_t;

  typedef struct packed {
    answer_kind_t kind;
    logic [2:0]   number;
    logic [31:0]  value;  // what the register holds, or the rule that refuses
  } answer_t;

  // Bits of a count, which a status line gives in at most so many digits.
  localparam int COUNT_BITS = 48;
  localparam int COUNT_DIGITS = 15;
  typedef logic [COUNT_BITS-1:0] count_t;

  // What a status line gives, in its order.
  typedef struct packed {
    count_t frames;
    count_t events;
    count_t dropped;
    count_t datagrams;
    count_t faults;
  } totals_t;

endpackage
