"""Prove modules of the board's logic without bound, reach the proofs' covers, and show that planted faults are found.

Usage: python rtl/tools/prove.py [NAME ...]. Only PASS counts: anything else, UNKNOWN too, is a failure; of a planted fault only FAIL.
"""

from __future__ import annotations

import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

RTL = Path(__file__).parents[1]
ROOT = RTL.parent
TOOLS = ROOT / ".venv-rtl" / "bin"
WORK = RTL / "build" / "proofs"


@dataclass(frozen=True)
class Proof:
    """A harness, the sources that it proves, the engine, and edits of one line that it must find."""

    name: str
    sources: tuple[str, ...]
    engine: str
    faults: tuple[tuple[str, str, str], ...]
    #: Clocks of an induction's step.
    induction: int = 10
    #: Clocks in which covers are reached and faults show.
    depth: int = 40
    #: Clocks before which no fault is looked for, where it takes long to show that there is none.
    skip: int = 0
    #: The engine that looks for faults, where it is another one.
    search: str = ""
    #: Whether several clocks are made of one by gates.
    gated: bool = False


#: sby's options for programs, and what these are called.
PROGRAMS = (("yosys", "yosys"), ("smtbmc", "yosys-smtbmc"), ("witness", "yosys-witness"))

FIFO, PACKER, REGISTERS = "taxel_event_fifo.sv", "taxel_packer_v1.sv", "taxel_register_file.sv"
PACKAGE, SELECT, PACKER_V2 = "taxel_registers.sv", "taxel_line_select.sv", "taxel_packer_v2.sv"
FRAME = "taxel_ethernet_frame.sv"
COLUMN, RAMP, ARRAY = "taxel_comparator_column.sv", "taxel_ramp_counter.sv", "taxel_comparator_array.sv"
UART = "taxel_uart_rx.sv"
ANNOUNCED, STANDING, MEMORY = "taxel_announcement.sv", "taxel_standing_word.sv", "taxel_two_clock_memory.sv"
UDP = "taxel_udp_sender.sv"
LINK, STREAM = "taxel_link.sv", "taxel_stream_register.sv"
SENDER, SORTER, DETECTOR = "taxel_datagram_sender.sv", "taxel_line_sorter.sv", "taxel_change_detector.sv"
PROOFS = (
    Proof(
        "fifo_proof",
        (FIFO,),
        "abc pdr",
        (
            (FIFO, "fetched_valid <= !none;", "fetched_valid <= 1'b1;"),
            (FIFO, "fetched_valid <= !none;", "fetched_valid <= waiting > 1;"),
            (FIFO, "assign land  = fetched_valid && landing;", "assign land  = fetched_valid;"),
            (FIFO, "assign move  = !landing && !ready;", "assign move  = !landing;"),
            (FIFO, "if (landing) landed <= fetched;", "landed <= fetched;"),
            (FIFO, "(PLACES + 1)'(DEPTH - 1);", "(PLACES + 1)'(DEPTH - 2);"),
            (FIFO, "waiting == (PLACES + 1)'(land);", "waiting == (PLACES + 1)'(push);"),
            (FIFO, "waiting == (PLACES + 1)'(land);", "waiting == '0;"),
            (FIFO, "!stored && landing", "!stored"),
            (FIFO, "none && !stored && landing", "none && landing"),
            (FIFO, "write == PLACES'(DEPTH - 1)", "write == PLACES'(DEPTH - 2)"),
            (FIFO, "if (stored) ring[write]", "if (stored && !land) ring[write]"),
            (FIFO, "if (stored) ring[write]", "if (push) ring[write]"),
            (FIFO, "held >> (k * WIDTH)", "held >> k"),
            (FIFO, "else if (pop) ready <= 1'b0;", ""),
        ),
    ),
    Proof(
        "packer_proof",
        ("taxel_types.sv", FIFO, PACKER),
        "abc pdr",
        (
            (PACKER, "MOST - 1 : MOST - 2", "MOST : MOST - 1"),
            (PACKER, "oldest.frame == now.frame &&", ""),
            (PACKER, "ready || over || (empty", "ready || (empty"),
            (PACKER, "{1'b1, now.more, second,", "{1'b1, now.more, !second,"),
            (PACKER, "{1'b0, field[13:7]}", "{1'b0, field[12:6]}"),
            (PACKER, "{2'b00, now.x[5:0]}", "{2'b00, now.y[5:0]}"),
            (PACKER, "allowed && (!busy || (advance && event_over))", "allowed && (!busy || event_over)"),
            (PACKER, "busy && (!event_over || known)", "busy"),
        ),
    ),
    Proof(
        "registers_proof",
        ("taxel_types.sv", PACKAGE, REGISTERS),
        "smtbmc yices",
        (
            (REGISTERS, "checked && rule == 4'd0;", "checked;"),
            (REGISTERS, "checked && rule == 4'd0;", "judged && rule == 4'd0;"),
            (REGISTERS, "reserved ? 4'd4 : refused(which)", "refused(which)"),
            (REGISTERS, "command && room;", "command;"),
            (PACKAGE, "if (which[11]) return 4'd3;", ""),
            (PACKAGE, "if (which[12]) return 4'd5;", ""),
            (PACKAGE, "if (which[13]) return 4'd7;", ""),
            (PACKAGE, "(40'(r.step_read) << 1)", "(40'(r.step_read) << 2)"),
            (PACKAGE, "changed.step_read = value[31:16];", "changed.step_read = value[15:0];"),
        ),
    ),
    Proof(
        "packer_v2_proof",
        ("taxel_types.sv", PACKER_V2),
        "smtbmc yices",
        (
            (
                PACKER_V2,
                "sequence_number <= sequence_number + 32'd1;",
                "if (!lost) sequence_number <= sequence_number + 32'd1;",
            ),
            (PACKER_V2, "bank            <= !bank;", ""),
            (PACKER_V2, "!fits[count_of]", "!fits[0]"),
            (PACKER_V2, "if (goes || reset) units <= '0;", "if (goes || reset) units <= 10'(lost && goes);"),
            (PACKER_V2, "words_over <= word == 5'd19;", "words_over <= word == 5'd24;"),
            (
                PACKER_V2,
                "units: units,",
                "units: units - 10'd1,",
            ),
        ),
    ),
    Proof(
        "words_proof",
        ("taxel_types.sv", PACKER_V2),
        "smtbmc yices",
        (
            (PACKER_V2, "8'(gap >> 6) - 8'd1", "8'(gap >> 6)"),
            (PACKER_V2, "15'(ahead) >= 15'(NEAR)", "15'(ahead) > 15'(NEAR)"),
            (PACKER_V2, "15'(now.y) >= 15'(NEAR)", "15'(now.y) > 15'(NEAR)"),
            (PACKER_V2, "15'(position) >= 15'(NEAR)", "15'(position) > 15'(NEAR)"),
            (PACKER_V2, "rest    = jumps ? 15'(gap[5:0])", "rest    = jumps ? 15'(gap[6:0])"),
            (PACKER_V2, "now.at - base > LATEST", "now.at - base > LONGEST"),
            (PACKER_V2, "entry_position - reached - 16'sd1;", "entry_position - reached;"),
            (PACKER_V2, "again <= gathered && (moved || behind);", "again <= gathered && moved;"),
            (PACKER_V2, "again <= gathered && (moved || behind);", "again <= gathered && behind;"),
            (
                PACKER_V2,
                "{units_of[2:0], 16'd0, 16'(now.at - base), {1'b1, FAR}, 16'd0}",
                "{units_of[2:0], 16'(now.at - base), 16'd0, {1'b1, FAR}, 16'd0}",
            ),
            (PACKER_V2, "{gap_16, now.value}", "{now.value, gap_16}"),
            (PACKER_V2, "differs <= now.format != format;", "differs <= 1'b0;"),
            (PACKER_V2, "line     <= now.x;", ""),
            (PACKER_V2, "at      <= now.at;", "at      <= base;"),
            (PACKER_V2, "if (left == 3'd1) state <= after;", "if (left <= 3'd2) state <= after;"),
            (PACKER_V2, "left == 3'd2 && after == IDLE", "after == IDLE"),
            (PACKER_V2, "left == 3'd2 && after == IDLE", "left == 3'd2"),
            (PACKER_V2, "fits_in && count_of <= 3'd2", "fits_in && count_of <= 3'd3"),
            (PACKER_V2, "state == IDLE && !taken && !flushes", "state == IDLE && !flushes"),
            (PACKER_V2, "room && !valid && leaving", "room && leaving"),
            (PACKER_V2, "now.more ? 16'd1 : 16'd2", "now.more ? 16'd2 : 16'd1"),
            (PACKER_V2, "base: now.at,", "base: base,"),
            (PACKER_V2, "since_16   <= at_most(since);", "since_16   <= at_most(since) + 16'd1;"),
        ),
        induction=7,
    ),
    Proof(
        "sender_proof",
        ("taxel_types.sv", SENDER),
        "smtbmc yices",
        (
            (SENDER, "BODY: data <= unit_read;", "BODY: data <= unit_fetched;"),
            (SENDER, "promise_end <= body_end + 10'(SPAN);", "promise_end <= body_end;"),
            (SENDER, "promise_end + 10'(CHECKSUM - 1)", "promise_end + 10'(CHECKSUM)"),
            (SENDER, "crc  <= '1;", "crc  <= '0;"),
            (SENDER, "~crc[15:0]", "crc[15:0]"),
            (SENDER, "chosen.part == SUM ? crc >> 16", "chosen.part[1] ? crc >> 16"),
            (SENDER, "crc_32c(crc, data)", "crc_32c(crc, tdata)"),
            (SENDER, "at - 10'(HEADER)}", "at - 10'(HEADER - 1)}"),
            (SENDER, "buffer[{bank, place}] <= unit", "buffer[{1'b0, place}] <= unit"),
            (SENDER, "now.dropped, now.differences", "now.differences, now.dropped"),
            (SENDER, "{now.line[2:0], STRIDE}", "{now.line[3:1], STRIDE}"),
            (SENDER, "assign moves   = !tvalid || tready;", "assign moves   = 1'b1;"),
        ),
        induction=3,
        depth=50,
    ),
    Proof(
        "crc_proof",
        ("taxel_types.sv",),
        "smtbmc yices",
        (
            ("taxel_types.sv", "32'h82F63B78", "32'h82F63B70"),
            ("taxel_types.sv", "32'hEDB88320", "32'hEDB88300"),
            ("taxel_types.sv", "c = crc >> 16;", "c = crc >> 8;"),
            ("taxel_types.sv", "x = crc[15:0] ^ unit;", "x = crc[15:0];"),
            ("taxel_types.sv", "16'(256 << k)", "16'(1 << k)"),
        ),
        induction=1,
        depth=1,
    ),
    Proof(
        "link_proof",
        (STREAM, LINK),
        "smtbmc yices",
        (
            (LINK, "assign ready   = room && second == paired;", "assign ready   = room;"),
            (LINK, "assign ends    = last && second == paired;", "assign ends    = last;"),
            (LINK, "second ? data[15:8] : data[7:0]", "data[7:0]"),
            (LINK, "if (valid && room) second <=", "if (valid) second <="),
            (LINK, "(to == 2'd3 || last)", "to == 2'd3"),
            (LINK, "assign to      = at + 2'(paired);", "assign to      = at;"),
            (LINK, "else if (2'(k) == to)", "else if (2'(k) != to)"),
            (LINK, "2'(k) <= to;", "2'(k) <= at;"),
            (LINK, "if (valid && room) begin", "if (valid) begin"),
            (LINK, "last ? 2'd0 : to + 2'd1", "to + 2'd1"),
            (LINK, "held <= beat;", ""),
            (STREAM, "valid_in || !ready_in;", "valid_in;"),
            (STREAM, "ready_in ? data_in : second", "data_in"),
            (STREAM, "if (ready_in) second <= data_in;", "second <= data_in;"),
        ),
        induction=2,
        depth=14,
    ),
    Proof(
        "sorter_proof",
        ("taxel_types.sv", SORTER),
        "smtbmc yices",
        (
            (SORTER, "oldest.x == gathering.x && ", ""),
            (SORTER, " && oldest.at == gathering.at", ""),
            (SORTER, "!sorts && !gathered && !handing && free", "!sorts && !handing && free"),
            (SORTER, "!sorts && !gathered && !handing && free", "!sorts && !gathered && free"),
            (SORTER, "!sorts && !gathered && !handing && free", "!sorts && !gathered && !handing"),
            (SORTER, "for (int k = GROUP - 1; k >= 0; k--) if", "for (int k = 0; k < GROUP; k++) if"),
            (SORTER, "held[{bank, oldest.y}]", "held[{1'b0, oldest.y}]"),
            (SORTER, "if (landed && free) begin", "if (landed) begin"),
            (SORTER, "changed[!bank][group] <= '0;", ""),
            (SORTER, "gathering.lost <= oldest.lost || (gathered && gathering.lost);", ""),
            (SORTER, "gathered && !handing && (leaving", "gathered && (leaving"),
            (SORTER, "if (32'(group) != GROUPS) begin", "if (32'(group) != GROUPS - 1) begin"),
            (SORTER, "entry.value <= held_of.value;", ""),
            (SORTER, "entry.y     <= y_landed;", "entry.y     <= y;"),
            (SORTER, "else if (!chosen && !landed) begin", "else if (!landed) begin"),
            (SORTER, "else if (!chosen && !landed) begin", "else if (!chosen) begin"),
            (SORTER, "fetched && !landed;", "fetched;"),
            (SORTER, "fetched && !landed;", "chosen && !landed;"),
            (SORTER, "(!chosen || lands)", "1'b1"),
            (SORTER, "weighed <= ready && !pop;", "weighed <= ready;"),
            (SORTER, "!gathered && !handing && !valid;", "!gathered && !valid;"),
        ),
        skip=25,
        induction=4,
    ),
    Proof(
        "crossing_proof",
        ("formal/late_synchroniser.sv", ANNOUNCED, STANDING, COLUMN, RAMP, ARRAY),
        "smtbmc yices",
        (
            (ARRAY, ".announce(read_start)", ".announce(step_end)"),
            (ARRAY, "take(read_start)", "take(1'b1)"),
            (ANNOUNCED, "came <= crossed != last;", "came <= crossed && !last;"),
            (STANDING, "if (take) held", "if (!take) held"),
            (ARRAY, "(ended_fast == number && !open && !begun) || begins", "begins"),
            (ARRAY, "ended_fast == number && !open && !begun", "ended_fast == number && !begun"),
            (ARRAY, "ended_fast == number && !open && !begun", "!open && !begun"),
            (ARRAY, "inverted_now <= senses[DELAY-1];", "inverted_now <= 1'b0;"),
            (ARRAY, "if (step_end) ended <= began;", "if (step_end) ended <= !began;"),
            (ANNOUNCED, "if (announce) number <= !number;", "if (announce) number <= 1'b1;"),
            (ARRAY, "assign over = !copied &&", "assign over ="),
            # What shows only where a read begins as the samples of the one before end.
            (ARRAY, "&& !begun) || begins);", "&& !begun));"),
            (ARRAY, "closing && (begins || !closes_here)", "closing && !closes_here"),
            (ARRAY, "start ? inverted_held : senses[0]", "inverted_held"),
            (ARRAY, "begins_here <= nears", "begins_here <= begins"),
            (ARRAY, "copies_here <= over", "copies_here <= closing"),
            (ARRAY, "brought <= sampled ^", "brought <= comparators ^"),
            (RAMP, "pairs_next <= full;", "pairs_next <= length[15:1] - 15'd1;"),
            (RAMP, "ramp   <= {1'b0, rising && odd};", "ramp   <= {1'b0, odd};"),
            (COLUMN, "begins || (awaited", "(awaited"),
            (COLUMN, " && !closes", ""),
            (COLUMN, "first   <= sample[0];", "first   <= sample[1];"),
        ),
        search="abc bmc3",
        induction=14,
        depth=100,
        gated=True,
    ),
    Proof(
        "detector_proof",
        ("taxel_types.sv", DETECTOR),
        "smtbmc yices",
        (
            (DETECTOR, "moved_of > 16'(of_weighed.noise_floor)", "moved_of >= 16'(of_weighed.noise_floor)"),
            (
                DETECTOR,
                "more                 <= fetched.value >= previous;",
                "more                 <= fetched.value < previous;",
            ),
            (DETECTOR, "{counts[0].at, 1'b0} - 16'(counts[0].first)", "{counts[0].at, 1'b0}"),
            (DETECTOR, "- 16'(counts[0].first) : 16'hFFFF", "- 16'(counts[0].first) : 16'h0000"),
            (DETECTOR, "tick < of_counted.ramp ? tick : of_counted.ramp", "tick"),
            (DETECTOR, "weighed.exists && !weighed.not_returned && !of_weighed", "weighed.exists && !of_weighed"),
            (DETECTOR, "!weighed.not_returned && !of_weighed.initial_frame", "!weighed.not_returned"),
            (DETECTOR, "(spikes ? fires : beyond)", "(beyond || (spikes && fires))"),
            (DETECTOR, "!judged.not_returned : changed && !full))", "!judged.not_returned : changed))"),
            (DETECTOR, "storing_at           <= judged.address;", "storing_at           <= weighed.address;"),
            (DETECTOR, "storing              <= store && !reset;", "storing              <= judged.valid && !reset;"),
            (DETECTOR, "{channel, now.step[STEP_BITS-1:0]}", "{now.step[STEP_BITS-1:0], channel}"),
            (DETECTOR, "if (step_end) ended <= read;", "if (read_done) ended <= read;"),
            (DETECTOR, "busy && 32'(row) < ROWS", "busy && 32'(row) <= ROWS"),
            (DETECTOR, "starts  <= starts >> 1;", "starts  <= starts;"),
            (DETECTOR, "counting && markers == 0 && !flushes", "counting && !flushes"),
            # A clock early it would be of the same read, as the next one's report comes behind all taxels of this one.
            (DETECTOR, "of_weighed           <= of_compared;", "if (weighed.valid) of_weighed <= of_compared;"),
            (DETECTOR, "initial_frame ? 16'd0 : judged.value", "initial_frame ? 16'd1 : judged.value"),
        ),
        search="abc bmc3",
        induction=16,
        depth=45,
    ),
    Proof(
        "banks_proof",
        ("formal/late_synchroniser.sv", STANDING, MEMORY, UDP),
        "abc pdr",
        (
            (UDP, "given[filled] == taken_here[filled]", "1'b1"),
            (UDP, "at_write({filled, place})", "at_write({1'b0, place})"),
            (UDP, "at_read({sent, at})", "at_read({filled, at})"),
            (UDP, "sent        <= !sent;", ""),
            (UDP, "given_there[sent] != taken[sent]", "given_there[sent] == taken[sent]"),
            (UDP, "room ? place + BITS'(1) : place;", "place + BITS'(1);"),
            (UDP, "tlast && filled == 1'(bank)", "tlast"),
            (UDP, "place         <= '0;", ""),
            (UDP, ".clk(clk_link), .from(given[bank])", ".clk(clk_link), .from(given[0])"),
            (UDP, "tvalid && tready && room", "tvalid && room"),
        ),
        depth=60,
        gated=True,
    ),
    Proof(
        "uart_proof",
        ("formal/late_synchroniser.sv", UART),
        "smtbmc yices",
        (
            (UART, "left <= BITS'(CLOCKS / 2 - 1);", "left <= BITS'(CLOCKS - 1);"),
            (UART, "bits <= 4'd10;", "bits <= 4'd9;"),
            (UART, "busy <= !line;", "busy <= line;"),
            (UART, "busy <= !line && !low;", "busy <= line && !low;"),
            (UART, "broken <= !line;", "broken <= line;"),
            (UART, "left <= BITS'(CLOCKS);", "left <= BITS'(CLOCKS - 1);"),
            (UART, "valid  <= line;", "valid  <= 1'b0;"),
            (UART, "{line, data[7:1]}", "{data[6:0], line}"),
        ),
        search="abc bmc3",
        induction=3,
        depth=190,
    ),
    Proof(
        "select_proof",
        (SELECT,),
        "abc pdr",
        (
            (SELECT, "out > in ? out : in", "in"),
            (SELECT, "aim_lines + 8'd1 - place", "aim_lines - place"),
            (SELECT, " && aim_lines <= known", ""),
            (SELECT, "insert == 8'd0 && aim > at", "aim > at"),
            (SELECT, "8'(aim) - place", "8'(aim) - 8'(at)"),
            (SELECT, "(start || !waits)", "1'b1"),
            (SELECT, "falls || (!csel_clk && csel_din != data)", "falls || csel_din != data"),
            (SELECT, "csel_din <= data;\n      left     <= HALF_BITS'(HALF - 1);", "csel_din <= data;"),
            (SELECT, "if (csel_din) place <= '0;\n      else if", "if"),
            (SELECT, "place    <= '0;", "place    <= 8'(COLUMNS);"),
        ),
    ),
    Proof(
        "ethernet_frame_proof",
        ("taxel_types.sv", FRAME),
        "smtbmc yices",
        (
            (FRAME, "16'(size) + 16'd28", "16'(size) + 16'd29"),
            (FRAME, "16'(size) + 16'd8;", "16'(size);"),
            (FRAME, "~added(SUM, total)", "added(SUM, total)"),
            (FRAME, "return sum[15:0] + 16'(sum[16]);", "return sum[15:0];"),
            (FRAME, "size < BITS'(LEAST) ?", "size <= BITS'(LEAST) + BITS'(1) ?"),
            (FRAME, "at >= size", "at > size"),
            (FRAME, "~crc[7:0]", "crc[7:0]"),
            (FRAME, "place_choosing < 6'(PREAMBLE)", "place_choosing < 6'(PREAMBLE + 1)"),
            (FRAME, "localparam int GAP = 12;", "localparam int GAP = 9;"),
        ),
        depth=110,
    ),
)


def checked(
    proof: Proof,
    name: str,
    mode: str,
    edit: tuple[str, str, str] | None = None,
    source: Path = RTL,
    longest: float = 3600,
) -> str:
    """Run one proof or its covers, on the sources, on a copy with one edit, or on others; return sby's verdict.

    One that takes longer than so many seconds raises TimeoutExpired.
    """
    planted = edit is not None or source != RTL
    folder = WORK / name
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    for file in (*proof.sources, f"formal/{proof.name}.sv"):
        path = (RTL if file.startswith("formal/") else source) / file
        text = path.read_text()
        if edit and edit[0] == path.name:
            if text.count(edit[1]) != 1:
                raise ValueError(f"{path.name}: {edit[1]!r} stands there {text.count(edit[1])} times")
            text = text.replace(edit[1], edit[2])
        (folder / path.name).write_text(text)
        files.append(folder / path.name)
    engine = "smtbmc yices" if mode == "cover" else (planted and proof.search) or proof.engine
    depth = f"depth {proof.induction if mode == 'prove' else proof.depth}\n"
    if planted and proof.skip:
        depth += f"skip {proof.skip}\n"
    # What only helps an induction to close is no property: a fault must be found without.
    options = "-G LEMMAS=0 " if planted and "parameter bit LEMMAS" in files[-1].read_text() else ""
    script = f"read_slang -j 1 --top {proof.name} {options}{' '.join(f.name for f in files)}\n"
    # What has no source may have any value in each clock, before anything is made simpler by a value that is chosen for it.
    script += f"setundef -anyseq\nprep -top {proof.name}\n"
    if proof.gated:
        # What modules assert at an edge cannot be looked at where that is of a gate.
        script += "flatten\nopt -noff -keepdc\ndelete t:$check r:TRG_ENABLE=1 %i\nformalff -declockgate\nsetundef -undriven -anyseq\nopt_clean\n"
    listed = "\n".join(str(f.relative_to(ROOT)) for f in files)
    job = folder / f"{mode}.sby"
    job.write_text(f"[options]\nmode {mode}\n{depth}\n[engines]\n{engine}\n\n[script]\n{script}\n[files]\n{listed}\n")
    abc = next((ROOT / ".venv-rtl").glob("lib/python3*/site-packages/pyosys/yosys-abc"))
    programs = [f"--{p}={TOOLS / f'yowasp-{q}'}" for p, q in PROGRAMS]
    command = [str(TOOLS / "yowasp-sby"), "-f", *programs, f"--abc={abc}", str(job.relative_to(ROOT))]
    paths = {"PATH": f"{TOOLS}:/usr/bin:/bin", "HOME": str(Path.home())}
    with (folder / f"{mode}.log").open("w") as log:
        process = subprocess.Popen(command, cwd=ROOT, env=paths, stdout=log, stderr=subprocess.STDOUT)
        try:
            process.wait(longest)
        except subprocess.TimeoutExpired:
            # It ends its engines.
            process.terminate()
            process.wait()
            raise
    status = folder / mode / "status"
    return status.read_text().split()[0] if status.exists() else "ERROR"


def main(names: list[str]) -> int:
    """Prove what is named, or all; return the exit status."""
    if not (TOOLS / "yowasp-sby").exists():
        print("rtl: not proved, as the RTL's tools are not installed: make rtl-tools")
        return 0
    bad = 0
    for proof in PROOFS:
        if names and proof.name not in names:
            continue
        for mode in ("prove", "cover"):
            verdict = checked(proof, proof.name, mode)
            bad += verdict != "PASS"
            print(f"{proof.name}, {mode}: {verdict}", flush=True)
        for k, edit in enumerate(proof.faults):
            # An induction that does not close shows no fault: that needs a run of the logic to its violation.
            mode = "bmc" if proof.engine.startswith("smtbmc") else "prove"
            verdict = checked(proof, f"{proof.name}_fault_{k}", mode, edit)
            bad += verdict != "FAIL"
            print(f"{proof.name}, {edit[1]!r} -> {edit[2]!r}: {verdict}", flush=True)
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
