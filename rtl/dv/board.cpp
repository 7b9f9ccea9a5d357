// Runs a board's logic between its pins for Python: trip times in, frames out of the PHY's pins.
//
// Three clocks: the scan's, the converter's of its phase, the link's of any. The comparators' pins change in the middle
// of ticks that begin as the ramp's pin rises, and follow the driven line at all times. What the cells of the pins take from there is not known here.
#include <cstdint>
#include <cstring>
#include <vector>

#include "Vtaxel_ethernet_board.h"
#include "verilated.h"

namespace {

// In sixths of a ns.
constexpr uint64_t kHalf = 30, kFastHalf = 20, kLinkHalf = 24, kTick = 20;
constexpr int kChannels = 64;

struct Bench {
    VerilatedContext context;
    Vtaxel_ethernet_board top;
    int columns, rows;
    std::vector<uint16_t> ticks, of_ramp;  // by taxel, row after row: as set, and as the ramp rose
    std::vector<uint8_t> chain;
    int line = 0;
    bool chain_clock = false, ramp = false, frame_sync = false, tx_clock = false;
    uint64_t now = 0, core_at = 0, fast_at = 0, link_at = 7;
    uint64_t rose = 0, returns = 0;        // the ramp's pin; and the time from which comparators have returned
    uint64_t edges = 0;
    std::vector<uint8_t> frame, frames;
    std::vector<uint32_t> lengths;
    uint8_t low = 0;

    Bench(int columns, int rows, int seed) : top(prepared(context, seed)), columns(columns), rows(rows) {
        ticks.assign(columns * rows, 0);
        of_ramp = ticks;
        chain.assign(columns, 1);
        top.rx = 1;
        top.button_n = 1;
    }

    static VerilatedContext* prepared(VerilatedContext& context, int seed) {
        context.randReset(2);
        context.randSeed(seed);
        return &context;
    }

    void after_core() {
        if (top.csel_reg_clk_out && !chain_clock) {
            for (int x = columns - 1; x > 0; x--) chain[x] = chain[x - 1];
            chain[0] = top.csel_reg_din_out;
            line = 0;
            while (line < columns - 1 && !chain[line]) line++;
        }
        chain_clock = top.csel_reg_clk_out;
        if (top.frame_sync_out && !frame_sync) edges++;
        frame_sync = top.frame_sync_out;
    }

    void after_fast() {
        if (top.ramp && !ramp) {
            of_ramp = ticks;
            rose = now;
            returns = ~uint64_t{0};
        }
        if (!top.ramp && ramp) returns = now + kTick / 2;
        ramp = top.ramp;
    }

    void after_link() {
        if (top.eth_tx_clk == tx_clock) return;
        tx_clock = top.eth_tx_clk;
        if (tx_clock) {
            low = top.eth_tx_data;
        } else if (top.eth_tx_ctl) {
            frame.push_back(top.eth_tx_data << 4 | low);
        } else if (!frame.empty()) {
            frames.insert(frames.end(), frame.begin(), frame.end());
            lengths.push_back(frame.size());
            frame.clear();
        }
    }

    void step() {
        now = core_at < fast_at ? core_at : fast_at;
        if (link_at < now) now = link_at;
        uint64_t pins = 0;
        for (int c = 0; c < kChannels && now < returns; c++) {
            const uint64_t k = c < rows ? of_ramp[c * columns + line] : 0;
            pins |= uint64_t{rose + k * kTick + kTick / 2 <= now} << c;
        }
        top.comparators = pins;
        const bool core = core_at == now, fast = fast_at == now, link = link_at == now;
        if (core) {
            top.clk = !top.clk;
            core_at += kHalf;
        }
        if (fast) {
            top.clk_fast = !top.clk_fast;
            fast_at += kFastHalf;
        }
        if (link) {
            top.clk_link = !top.clk_link;
            link_at += kLinkHalf;
        }
        top.eval();
        if (core && top.clk) after_core();
        if (fast) after_fast();
        if (link) after_link();
    }
};

}  // namespace

extern "C" {

Bench* board_new(int columns, int rows, int seed) { return new Bench(columns, rows, seed); }
void board_delete(Bench* b) { delete b; }
void board_button(Bench* b, int pressed) { b->top.button_n = !pressed; }
void board_steady(Bench* b, int steady) { b->top.steady = steady; }
void board_ticks(Bench* b, const uint16_t* ticks) { std::memcpy(b->ticks.data(), ticks, 2 * b->ticks.size()); }
int board_in_reset(Bench* b) { return !b->top.eth_reset_n; }

// Runs to the next frame's edge of the scan, or for so many ns; returns whether the edge came.
int board_run(Bench* b, uint64_t ns) {
    const uint64_t until = b->now + 6 * ns, edges = b->edges;
    while (b->now < until) {
        b->step();
        if (b->edges != edges) return 1;
    }
    return 0;
}

// Moves the frames that ended into `to`, and their lengths; returns how many, or -1 where there is no room.
int board_frames(Bench* b, uint8_t* to, uint32_t* lengths, int room, int most) {
    const int count = static_cast<int>(b->lengths.size());
    if (static_cast<int>(b->frames.size()) > room || count > most) return -1;
    std::memcpy(to, b->frames.data(), b->frames.size());
    std::memcpy(lengths, b->lengths.data(), 4 * count);
    b->frames.clear();
    b->lengths.clear();
    return count;
}

}  // extern "C"
