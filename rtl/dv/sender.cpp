// Runs the sender of UDP for Python: payloads in, frames of Ethernet out. Its two clocks have no common phase.
#include <cstdint>
#include <cstring>
#include <deque>
#include <vector>

#include "Vtaxel_udp_sender.h"
#include "verilated.h"

namespace {

struct Bench {
    VerilatedContext context;
    Vtaxel_udp_sender top;
    uint64_t now = 0, core_at = 0, link_at = 0;  // ps: the clocks' next edges
    uint64_t link_half;
    std::deque<std::vector<uint8_t>> payloads;
    size_t place = 0;
    uint32_t random = 1, valid_of = 256;          // of 256 clocks a byte is offered in so many
    std::vector<uint8_t> frame, frames;
    std::vector<uint32_t> lengths, gaps;          // of each frame: its bytes, and the clocks without one before it
    uint32_t gap = 0;

    Bench(int seed, uint64_t half, uint64_t phase) : top(prepared(context, seed)), link_at(phase), link_half(half) {}

    static VerilatedContext* prepared(VerilatedContext& context, int seed) {
        context.randReset(2);
        context.randSeed(seed);
        return &context;
    }

    void step() {
        const bool core = core_at <= link_at, link = link_at <= core_at;
        now = core ? core_at : link_at;
        const bool core_up = core && !top.clk, link_up = link && !top.clk_link;
        const bool moves = core_up && top.tvalid && top.tready && !top.reset;
        if (core) {
            top.clk = !top.clk;
            core_at += 5000;
        }
        if (link) {
            top.clk_link = !top.clk_link;
            link_at += link_half;
        }
        top.eval();
        if (link_up) {
            if (top.tx_enable) {
                if (frame.empty()) gaps.push_back(gap);
                frame.push_back(top.txd);
                gap = 0;
            } else {
                gap++;
                if (!frame.empty()) {
                    frames.insert(frames.end(), frame.begin(), frame.end());
                    lengths.push_back(frame.size());
                    frame.clear();
                }
            }
        }
        if (moves) {
            if (++place == payloads.front().size()) {
                payloads.pop_front();
                place = 0;
            }
        }
        if (core_up) {
            // A byte that was offered and not taken stays.
            random = random * 1664525u + 1013904223u;
            const bool waits = top.tvalid && !moves;
            top.tvalid = !payloads.empty() && (waits || (random >> 24) < valid_of);
            if (top.tvalid) {
                top.tdata = payloads.front()[place];
                top.tlast = place + 1 == payloads.front().size();
            } else {
                top.tdata = random >> 16;
                top.tlast = random >> 15 & 1;
            }
        }
    }
};

}  // namespace

extern "C" {

Bench* sender_new(int seed, uint64_t half, uint64_t phase) { return new Bench(seed, half, phase); }

void sender_delete(Bench* b) { delete b; }

// Runs for so many ps; in reset, or not.
void sender_run(Bench* b, uint64_t duration, int reset) {
    b->top.reset = reset;
    const uint64_t until = b->now + duration;
    while (b->now < until) b->step();
}

void sender_send(Bench* b, const uint8_t* bytes, int count) { b->payloads.emplace_back(bytes, bytes + count); }
void sender_offers(Bench* b, uint32_t valid_of) { b->valid_of = valid_of; }
int sender_waits(Bench* b) { return static_cast<int>(b->payloads.size()); }

// Moves the frames that ended into `to`, their lengths and the gaps before them into the other two; returns how many.
int sender_frames(Bench* b, uint8_t* to, uint32_t* lengths, uint32_t* gaps, int room, int most) {
    const int count = static_cast<int>(b->lengths.size());
    if (static_cast<int>(b->frames.size()) > room || count > most) return -1;
    std::memcpy(to, b->frames.data(), b->frames.size());
    std::memcpy(lengths, b->lengths.data(), 4 * count);
    std::memcpy(gaps, b->gaps.data(), 4 * count);
    b->frames.clear();
    b->lengths.clear();
    b->gaps.erase(b->gaps.begin(), b->gaps.begin() + count);
    return count;
}

}  // extern "C"
