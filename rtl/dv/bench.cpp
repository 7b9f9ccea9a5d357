// Runs the logic for Python: frames of trip times in, bytes of the link and of the serial line out.
//
// The bench stands where the analogue board and the pins' cells stand: it follows the chain of shift registers and the
// multiplexer's address by their pins, and answers each ramp with comparators that trip at the ticks given for what these
// select at any time: where that moves while a ramp rises, they show what they would have done had it been selected all along.
// It knows nothing of what the logic makes of it.
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <deque>
#include <memory>
#include <utility>
#include <vector>

#include "Vtaxel_top.h"
#include "Vtaxel_top___024root.h"
#include "verilated.h"

// What Verilator's eval() calls when a clock has risen. What else that does, to find out which clock has, for messages of
// other threads and for objects to be deleted, takes an eighth of the time: the bench knows which, and the logic has neither
// messages nor objects, nor paths from an input to an output.
void Vtaxel_top___024root___eval_nba(Vtaxel_top___024root* root);

int broken = 0;  // assertions of modules that did not hold

#ifdef VL_USER_STOP
void vl_stop(const char* file, int line, const char* module) {
    std::fprintf(stderr, "%s:%d: %s: an assertion does not hold\n", file, line, module);
    broken++;
}
#endif

namespace {

constexpr int kWindow = 1 << 17;  // ticks of a ramp that the bench follows
constexpr uint16_t kNotReturned = 65535;
constexpr uint16_t kNoStop = 256;

// What holds for a step, which is set as it begins.
struct Step {
    int lines = 0;                                       // driven of the array's columns: none stands at the others
    std::shared_ptr<const std::vector<uint16_t>> ticks;  // by taxel, row after row
    bool inverted = false;                               // comparators fall when they trip
};

struct Bench {
    VerilatedContext context;
    Vtaxel_top top;
    int columns, rows, channels, steps_a_line, baud;
    std::vector<uint8_t> chain;       // the shift registers, 1 where a line is driven
    bool chain_clock = false;
    int line = 0, rsel = 0;           // what is selected: the last one of the driven lines
    Step set, now;                    // for steps to come; of the ramp that rose last
    bool step_began = false;          // in the clock before
    std::deque<Step> steps;           // that began and whose ramp has not risen
    bool shared = false;              // two lines or none were driven when a ramp began
    // The ramp that runs: at which sample each comparator trips.
    std::vector<uint64_t> trips = std::vector<uint64_t>(kWindow);
    std::vector<int> used;
    uint64_t level = 0;
    int tick = -1;                    // of the ramp; below 0: none
    bool ramp_before = false;
    uint64_t sampled[2] = {0, 0};     // in this clock
    uint64_t before[2] = {0, 0};      // in the clock before: what the pins' cells hold
    uint64_t driven[2] = {0, 0};      // at the pins
    // The serial line and the link.
    std::deque<uint16_t> to_send;  // bytes; with kNoStop the stop bit is low, and a bit follows in which the line rests
    int bit = -1, bit_clocks = 0;
    int rx_bit = -1, rx_clocks = 0, rx_byte = 0;
    uint64_t sent_at = ~uint64_t{0};  // the clock of the middle of the last byte's stop bit
    std::vector<uint8_t> serial, payload, last;
    std::vector<uint64_t> edges;      // the clocks of frames' edges
    std::vector<uint8_t> marks;       // record_sync at each edge
    uint64_t clock = 0;
    int phase = 0;
    uint32_t random = 1;
    uint32_t ready_of = 256;          // of 256 clocks the link accepts a beat in so many

    // What no reset reaches begins with random bits.
    explicit Bench(int seed) : top(prepared(context, seed)) {
        std::memset(&top.comparators, 0, sizeof top.comparators);
        top.eval();  // begins with what is initial
    }

    static VerilatedContext* prepared(VerilatedContext& context, int seed) {
        context.randReset(2);
        context.randSeed(seed);
        return &context;
    }

    // Finds which line is driven; returns how many are.
    int drive() {
        int driven = 0;
        line = 0;
        for (int x = 0; x < now.lines; x++) {
            if (!chain[x]) continue;
            driven++;
            line = x;
        }
        return driven;
    }

    // Comparators follow what is selected.
    void follow() {
        for (int t : used) trips[t] = 0;
        used.clear();
        level = 0;
        for (int c = 0; c < channels; c++) {
            const int y = steps_a_line * c + rsel;
            const uint16_t t = y < rows ? (*now.ticks)[y * columns + line] : 0;
            if (t == kNotReturned || t < tick) {
                level |= uint64_t{1} << c;
            } else {
                trips[t] |= uint64_t{1} << c;
                used.push_back(t);
            }
        }
    }

    // One sample of all comparators at the start of a tick; then the tick passes.
    uint64_t sample() {
        const uint64_t now = level;
        if (tick >= 0) {
            if (tick < kWindow) level |= trips[tick];
            tick++;
        }
        return now;
    }

    void show(uint64_t even, uint64_t odd) {
        const uint64_t flip = now.inverted ? ~uint64_t{0} : 0;
        even ^= flip;
        odd ^= flip;
        // In most clocks no comparator changes.
        if (even == driven[0] && odd == driven[1]) return;
        driven[0] = even;
        driven[1] = odd;
        uint8_t* pins = reinterpret_cast<uint8_t*>(&top.comparators);
        for (int k = 0; k < channels / 4; k++) {
            uint8_t byte = 0;
            for (int c = 0; c < 4; c++) {
                byte |= ((even >> (4 * k + c)) & 1) << (2 * c);
                byte |= ((odd >> (4 * k + c)) & 1) << (2 * c + 1);
            }
            pins[k] = byte;
        }
    }

    // The ramp of the clock that begins now. Comparators see no other ramp than one that fell for a clock before it.
    void after_fast() {
        const bool rises = (top.ramp & 1) && !ramp_before;
        ramp_before = top.ramp != 0;
        if (!rises) return;
        now = steps.empty() ? set : steps.front();
        if (!steps.empty()) steps.pop_front();
        shared |= drive() != 1;
        tick = 0;
        follow();
    }

    // What the pins select.
    void select() {
        const bool shifts = top.csel_reg_clk_out && !chain_clock;
        chain_clock = top.csel_reg_clk_out;
        if (!shifts && top.rsel == rsel) return;
        rsel = top.rsel;
        if (shifts) {
            for (int x = columns - 1; x > 0; x--) chain[x] = chain[x - 1];
            chain[0] = top.csel_reg_din_out;
            drive();
        }
        follow();
    }

    void after_slow() {
        clock++;
        // In the clock after a step's start all is set that holds for its frame.
        if (step_began) steps.push_back(set);
        step_began = top.col_change_sync;
        if (top.frame_sync_out) {
            edges.push_back(clock);
            marks.push_back(top.record_sync);
        }
        // The serial line, both ways.
        if (rx_bit < 0) {
            if (!top.tx) {
                rx_bit = 0;
                rx_clocks = baud + baud / 2;
                rx_byte = 0;
            }
        } else if (--rx_clocks == 0) {
            if (rx_bit < 8) {
                rx_byte |= (top.tx & 1) << rx_bit;
                rx_clocks = baud;
                rx_bit++;
            } else {
                if (top.tx) serial.push_back(rx_byte);
                rx_bit = -1;
            }
        }
        if (bit >= 0 && --bit_clocks == 0) {
            bit++;
            bit_clocks = baud;
            if (bit == 9 && to_send.size() == 1) sent_at = clock + baud / 2;
            if (bit == (to_send.front() & kNoStop ? 11 : 10)) {
                bit = -1;
                to_send.pop_front();
            }
        }
        if (bit < 0 && !to_send.empty()) {
            bit = 0;
            bit_clocks = baud;
        }
        top.rx = bit < 0 || bit == 10 ? 1 : bit == 0 ? 0 : bit == 9 ? !(to_send.front() & kNoStop) : (to_send.front() >> (bit - 1)) & 1;
        random = random * 1664525u + 1013904223u;
        top.tready = (random >> 24) < ready_of;
    }

    // What the link accepts at the edge to come.
    void before_slow() {
        if (top.tvalid && top.tready) {
            const int bytes = top.tkeep == 15 ? 4 : top.tkeep == 7 ? 3 : top.tkeep == 3 ? 2 : 1;
            for (int k = 0; k < bytes; k++) {
                payload.push_back(top.tdata >> (8 * k));
                last.push_back(top.tlast && k == bytes - 1);
            }
        }
    }

    // One of four instants of 20 ns, in which are two clocks of 10 ns and three of 6.67: either rises, or both do. Of the
    // bits that say which, the slow one has the lower.
    void instant(int k) {
        const bool fast_up = k != 2;
        const bool slow_up = k == 0 || k == 2;
        if (fast_up) show(before[0], before[1]);
        if (slow_up) before_slow();
        top.rootp->__VnbaTriggered[0] = slow_up | fast_up << 1;
        Vtaxel_top___024root___eval_nba(top.rootp);
        // The samples of a clock's two halves. Of the second clock of three, the other half begins as the slow one rises.
        if (slow_up) select();
        if (fast_up) {
            before[0] = sampled[0];
            before[1] = sampled[1];
            after_fast();
            sampled[0] = sample();
        }
        if (k != 1) sampled[1] = sample();
        if (slow_up) after_slow();
    }

    void step() {
        instant(phase);
        phase = (phase + 1) % 4;
    }
};

}  // namespace

extern "C" {

Bench* bench_new(int columns, int rows, int channels, int steps, int baud, int seed) {
    auto* b = new Bench(seed);
    b->columns = columns;
    b->rows = rows;
    b->channels = channels;
    b->steps_a_line = steps;
    b->baud = baud;
    b->set.ticks = std::make_shared<std::vector<uint16_t>>(columns * rows, 0);
    b->set.lines = columns;
    b->now = b->set;
    b->chain.assign(columns, 1);
    b->top.rx = 1;
    b->top.tready = 1;
    return b;
}

void bench_delete(Bench* b) { delete b; }

// Holds the logic in reset for some clocks.
void bench_reset(Bench* b) {
    b->top.reset = 1;
    for (int k = 0; k < 4 * 8; k++) b->step();
    b->top.reset = 0;
    b->payload.clear();
    b->last.clear();
    b->serial.clear();
    b->edges.clear();
    b->rx_bit = -1;
    b->shared = false;
    b->steps.clear();
    b->step_began = false;
}

// Whether the pattern is on after the next reset.
void bench_pattern(Bench* b, int on) { b->top.pattern = on; }

// What is set for steps that begin from now on, or began in the clock before.
void bench_ticks(Bench* b, const uint16_t* ticks) {
    b->set.ticks = std::make_shared<std::vector<uint16_t>>(ticks, ticks + b->columns * b->rows);
}
void bench_invert(Bench* b, int inverted) { b->set.inverted = inverted; }
void bench_lines(Bench* b, int lines) { b->set.lines = lines; }


// One instant, of 20 ns after 0, 6.67, 10 or 13.33 ns, in which a clock rises; returns the pins behind it, for pictures.
uint64_t bench_instant(Bench* b) {
    const uint64_t phase = b->phase;
    b->step();
    const auto& top = b->top;
    const uint64_t pins[] = {top.frame_sync_out, top.row_read_sync, top.col_change_sync, top.col_read_sync,
                             top.csel_reg_clk_out, top.csel_reg_din_out, top.ramp & 1u, top.ramp >> 1u & 1u,
                             b->driven[0] & 1u, b->driven[1] & 1u};
    uint64_t bits = phase;
    for (int k = 0; k < 10; k++) bits |= pins[k] << (2 + k);
    return bits | uint64_t{top.rsel} << 12;
}

// Runs to the next frame's edge, or for so many clocks; returns whether the edge came.
int bench_run(Bench* b, uint64_t clocks) {
    const size_t edges = b->edges.size();
    const uint64_t until = b->clock + clocks;
    while (b->clock < until) {
        b->step();
        if (b->edges.size() != edges) return 1;
    }
    return 0;
}

void bench_send(Bench* b, const uint8_t* bytes, int count) {
    b->sent_at = ~uint64_t{0};
    b->to_send.insert(b->to_send.end(), bytes, bytes + count);
}

void bench_send_broken(Bench* b, int byte) { b->to_send.push_back(byte | kNoStop); }

int bench_sending(Bench* b) { return static_cast<int>(b->to_send.size()); }
uint64_t bench_sent_at(Bench* b) { return b->sent_at; }
uint64_t bench_clock(Bench* b) { return b->clock; }
uint64_t bench_edge(Bench* b) { return b->edges.back(); }
// How many assertions did not hold since this was last asked.
int bench_broken(Bench*) { return std::exchange(broken, 0); }
int bench_recording(Bench* b) { return b->top.record_sync; }
// Whether a ramp began with two lines driven, or none, since this was last asked.
int bench_shared(Bench* b) { return std::exchange(b->shared, false); }
void bench_link(Bench* b, uint32_t ready_of) { b->ready_of = ready_of; }

// Moves what was received into `to`; returns how many bytes. `ends` marks a datagram's last byte.
int bench_payload(Bench* b, uint8_t* to, uint8_t* ends, int room) {
    const int count = static_cast<int>(b->payload.size()) < room ? b->payload.size() : room;
    std::memcpy(to, b->payload.data(), count);
    std::memcpy(ends, b->last.data(), count);
    b->payload.erase(b->payload.begin(), b->payload.begin() + count);
    b->last.erase(b->last.begin(), b->last.begin() + count);
    return count;
}

int bench_serial(Bench* b, uint8_t* to, int room) {
    const int count = static_cast<int>(b->serial.size()) < room ? b->serial.size() : room;
    std::memcpy(to, b->serial.data(), count);
    b->serial.erase(b->serial.begin(), b->serial.begin() + count);
    return count;
}

}  // extern "C"
