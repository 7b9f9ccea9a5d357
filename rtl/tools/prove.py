"""Prove the queue, the packer and the register file without bound, reach their covers, and show that planted faults are found.

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


#: sby's options for programs, and what these are called.
PROGRAMS = (("yosys", "yosys"), ("smtbmc", "yosys-smtbmc"), ("witness", "yosys-witness"))

FIFO, PACKER, REGISTERS = "taxel_event_fifo.sv", "taxel_packer_v1.sv", "taxel_register_file.sv"
PACKAGE, SELECT = "taxel_registers.sv", "taxel_line_select.sv"
PROOFS = (
    Proof(
        "fifo_proof",
        (FIFO,),
        "abc pdr",
        (
            (FIFO, "!none && (!fetched_valid || move)", "!none"),
            (FIFO, "!none && (!fetched_valid || move)", "waiting > 1 && (!fetched_valid || move)"),
            (FIFO, "fetched_valid && (!ready || pop)", "fetched_valid"),
            (FIFO, "(PLACES + 1)'(DEPTH - 1);", "(PLACES + 1)'(DEPTH - 2);"),
            (FIFO, "fetch && waiting ==", "waiting =="),
            (FIFO, "none && !fetched_valid && !ready", "none && !ready"),
            (FIFO, "write == PLACES'(DEPTH - 1)", "write == PLACES'(DEPTH - 2)"),
            (
                FIFO,
                "if (push) begin\n      ring[write] <= entered;",
                "if (push) begin\n      if (!fetch) ring[write] <= entered;",
            ),
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
            (REGISTERS, "|| changed.mechanoreceptor", ""),
            (REGISTERS, "lacks ? 4'd4 : refused(which)", "refused(which)"),
            (REGISTERS, "command && room;", "command;"),
            (PACKAGE, "if (which[11]) return 4'd3;", ""),
            (PACKAGE, "if (which[12]) return 4'd3;", ""),
            (PACKAGE, "(40'(r.step_read) << 1)", "(40'(r.step_read) << 2)"),
            (PACKAGE, "changed.step_read = value[31:16];", "changed.step_read = value[15:0];"),
        ),
    ),
    Proof(
        "select_proof",
        (SELECT,),
        "abc pdr",
        (
            (SELECT, "out > in ? out : in", "in"),
            (SELECT, "lines + 8'd1 - 8'(at)", "lines - 8'(at)"),
            (SELECT, "unknown || lines > known", "unknown"),
            (SELECT, "8'(line - at)", "8'(line - at) + 8'd1"),
            (SELECT, "!all && later ? 8'd0", "later ? 8'd0"),
            (SELECT, "pulses == insert && !csel_din", "pulses == insert"),
            (
                SELECT,
                "if (pulses == insert && !csel_din) csel_din <= 1'b1;\n        else csel_clk <= 1'b1;",
                "csel_din <= pulses == insert;\n        csel_clk <= 1'b1;",
            ),
        ),
    ),
)


def checked(proof: Proof, name: str, mode: str, edit: tuple[str, str, str] | None = None) -> str:
    """Run one proof or its covers, on the sources or a copy with one edit; return sby's verdict."""
    folder = WORK / name
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    for source in (*(RTL / s for s in proof.sources), RTL / "formal" / f"{proof.name}.sv"):
        text = source.read_text()
        if edit and edit[0] == source.name:
            if text.count(edit[1]) != 1:
                raise ValueError(f"{source.name}: {edit[1]!r} stands there {text.count(edit[1])} times")
            text = text.replace(edit[1], edit[2])
        (folder / source.name).write_text(text)
        files.append(folder / source.name)
    engine = proof.engine if mode == "prove" else "smtbmc yices"
    # Of a proof: of its induction; an engine that needs none goes on without.
    depth = f"depth {40 if mode == 'cover' else 10}\n"
    script = f"read_slang -j 1 --top {proof.name} {' '.join(f.name for f in files)}\nprep -top {proof.name}\n"
    listed = "\n".join(str(f.relative_to(ROOT)) for f in files)
    job = folder / f"{mode}.sby"
    job.write_text(f"[options]\nmode {mode}\n{depth}\n[engines]\n{engine}\n\n[script]\n{script}\n[files]\n{listed}\n")
    abc = next((ROOT / ".venv-rtl").glob("lib/python3*/site-packages/pyosys/yosys-abc"))
    programs = [f"--{p}={TOOLS / f'yowasp-{q}'}" for p, q in PROGRAMS]
    command = [str(TOOLS / "yowasp-sby"), "-f", *programs, f"--abc={abc}", str(job.relative_to(ROOT))]
    paths = {"PATH": f"{TOOLS}:/usr/bin:/bin", "HOME": str(Path.home())}
    result = subprocess.run(command, cwd=ROOT, env=paths, capture_output=True, text=True, timeout=600, check=False)
    status = folder / mode / "status"
    (folder / f"{mode}.log").write_text(result.stdout + result.stderr)
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
            verdict = checked(proof, f"{proof.name}_fault_{k}", "prove", edit)
            bad += verdict != "FAIL"
            print(f"{proof.name}, {edit[1]!r} -> {edit[2]!r}: {verdict}", flush=True)
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
