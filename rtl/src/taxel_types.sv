// What modules hand on to each other.
package taxel_types;

  // Most markers between two frames; a further one is counted as lost.
  localparam int MARKERS = 4;

  // Time since time 0, us: as many bits as the base time of a datagram of version 2 has.
  typedef logic [47:0] micros_t;

  // How events of a frame are sent: the version of the wire, whether values may exceed 255, whether all carry the frame's time,
  // whether they are spikes.
  typedef struct packed {
    logic version_2;
    logic wide_values;
    logic frame_sync;
    logic spikes;
  } format_t;

  // What an afferent's threshold moves by.
  typedef struct packed {
    logic [15:0] rest;   // 1/1024
    logic [15:0] jump;   // 1/256 of it
    logic [7:0]  decay;  // 1/1024 of it
  } threshold_t;

  // What a frame's start says of the frame that ends there.
  typedef struct packed {
    logic        initial_frame;
    format_t     format;
    logic [30:0] micros;      // its length, rounded down, at most 2^31 - 1
    logic [7:0]  lines;       // less one
    logic        changed;     // the next frame has other registers
    logic        line_due;    // a line's values are due to be repeated, and the totals
    logic        totals_due;
  } ended_t;

  // One read: the taxels of a multiplexer's step, converted at once, and what they are compared by.
  typedef struct packed {
    logic        initial_frame;  // of the frame before time 0, which is not sent
    logic        frame_first;    // the first read of its frame
    logic        frame_last;     // the last read of its frame
    logic [6:0]  line;           // the driven line
    logic [2:0]  step;
    logic [15:0] stamp;          // 100 us
    micros_t     micros;
    format_t     format;
    ended_t      ended;          // the frame before
    logic        pattern;        // values are those of the pattern, not of the comparators
    logic [15:0] ramp;           // ticks
    logic [7:0]  noise_floor;    // ticks
    threshold_t  threshold;      // of afferents
    logic [2:0]  markers;        // how many go before this frame
    logic [MARKERS-1:0] starts;  // what they mark, the oldest in bit 0: a start of a recording, or a stop
  } read_t;

  typedef enum logic [1:0] {
    ENTRY_EVENT,
    ENTRY_MARKER,
    ENTRY_FRAME,  // the end of a frame of version 2
    ENTRY_FLUSH   // what waits is to be sent, as the registers change
  } entry_kind_t;

  // One entry of the queue: a taxel's change with its value, a marker, or the end of a frame.
  typedef struct packed {
    entry_kind_t kind;
    format_t     format;
    logic        frame;    // alternates from one frame that has events to the next
    logic        lost;     // events were dropped before this entry
    micros_t     at;       // since time 0, us; of version 1: 100 us
    logic [6:0]  x;
    logic [6:0]  y;
    logic        more;     // polarity: more pressure; of a marker: start
    logic [15:0] value;
    logic        states;   // with a frame's end: a line's values are repeated, the totals are sent
    logic        totals;
  } event_t;

  // The length of a frame, in the fields of an event.
  function automatic logic [30:0] length_of(event_t e);
    return {e.x, e.y, e.more, e.value};
  endfunction

  // What two bytes, the first in the low bits, become in a CRC of reflected bits.
  function automatic logic [31:0] crc_of_unit(logic [31:0] polynomial, logic [15:0] unit);
    logic [31:0] c;
    c = 32'(unit);
    for (int k = 0; k < 16; k++) c = c[0] ? (c >> 1) ^ polynomial : c >> 1;
    return c;
  endfunction

  // Each of the next two is a sum of what bits become, which are constants.
  // Of datagrams of version 2: CRC-32C with two more bytes.
  function automatic logic [31:0] crc_32c(logic [31:0] crc, logic [15:0] unit);
    logic [31:0] c;
    logic [15:0] x;
    c = crc >> 16;
    x = crc[15:0] ^ unit;
    for (int k = 0; k < 16; k++) c ^= {32{x[k]}} & crc_of_unit(32'h82F63B78, 16'(1 << k));
    return c;
  endfunction

  // Of Ethernet's frames: CRC-32 with one more byte. It is as the second of two of which the first is 0.
  function automatic logic [31:0] crc_32(logic [31:0] crc, logic [7:0] data);
    logic [31:0] c;
    logic [7:0] x;
    c = crc >> 8;
    x = crc[7:0] ^ data;
    for (int k = 0; k < 8; k++) c ^= {32{x[k]}} & crc_of_unit(32'hEDB88320, 16'(256 << k));
    return c;
  endfunction

  // A datagram of version 2 without its body.
  typedef struct packed {
    logic [3:0]  kind;
    logic        frame_sync;
    logic        differences;
    logic        dropped;
    logic [31:0] sequence_number;
    micros_t     base;
    logic [6:0]  line;
    logic [15:0] span;
    logic [9:0]  units;  // of 16 bits, of its body
    logic        bank;   // of the buffer, where its body is
  } datagram_t;

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
