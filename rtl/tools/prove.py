"""Prove modules of the board's logic without bound, and reach the proofs' covers.

Usage: python rtl/tools/prove.py [NAME ...]. Only PASS counts: anything else, UNKNOWN too, is a failure. That each proof can fail is shown by
`faults.py --proofs`.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1] / "dv"))

from verilated import RTL, SOURCES

ROOT = RTL.parent
TOOLS = ROOT / ".venv-rtl" / "bin"
WORK = RTL / "build" / "proofs"


@dataclass(frozen=True)
class Proof:
    """A harness, the sources that it proves, and the engine."""

    name: str
    sources: tuple[str, ...]
    engine: str
    #: Clocks of an induction's step.
    induction: int = 10
    #: Clocks in which covers are reached and faults show.
    depth: int = 40
    #: Clocks before which no planted fault is looked for, where it takes long to show that there is none.
    skip: int = 0
    #: The engine that looks for planted faults, where it is another one.
    search: str = ""
    #: Whether several clocks are made of one by gates.
    gated: bool = False

    @property
    def looking(self) -> str:
        """The mode in which a fault is looked for: an induction that does not close shows none."""
        return "bmc" if self.engine.startswith("smtbmc") else "prove"


#: sby's options for programs, and what these are called.
PROGRAMS = (("yosys", "yosys"), ("smtbmc", "yosys-smtbmc"), ("witness", "yosys-witness"))

PROOFS = (
    Proof("fifo_proof", ("taxel_event_fifo",), "abc pdr"),
    Proof("packer_proof", ("taxel_types", "taxel_event_fifo", "taxel_packer_v1"), "abc pdr"),
    Proof("registers_proof", ("taxel_types", "taxel_registers", "taxel_register_file"), "smtbmc yices"),
    Proof("packer_v2_proof", ("taxel_types", "taxel_packer_v2"), "smtbmc yices"),
    Proof("words_proof", ("taxel_types", "taxel_packer_v2"), "smtbmc yices", induction=7),
    Proof("sender_proof", ("taxel_types", "taxel_datagram_sender"), "smtbmc yices", induction=3, depth=50),
    Proof("crc_proof", ("taxel_types",), "smtbmc yices", induction=1, depth=1),
    Proof("link_proof", ("taxel_stream_register", "taxel_link"), "smtbmc yices", induction=2, depth=14),
    Proof("sorter_proof", ("taxel_types", "taxel_line_sorter"), "smtbmc yices", skip=25, induction=4),
    Proof(
        "crossing_proof",
        (
            "fpv/late_synchroniser",
            "taxel_announcement",
            "taxel_standing_word",
            "taxel_comparator_column",
            "taxel_ramp_counter",
            "taxel_comparator_array",
        ),
        "smtbmc yices",
        search="abc bmc3",
        induction=14,
        depth=100,
        gated=True,
    ),
    Proof(
        "detector_proof",
        ("taxel_types", "taxel_change_detector"),
        "smtbmc yices",
        search="abc bmc3",
        induction=16,
        depth=45,
    ),
    Proof(
        "banks_proof",
        ("fpv/late_synchroniser", "taxel_standing_word", "taxel_two_clock_memory", "taxel_udp_sender"),
        "abc pdr",
        depth=60,
        gated=True,
    ),
    Proof(
        "uart_proof",
        ("fpv/late_synchroniser", "taxel_uart_rx"),
        "smtbmc yices",
        search="abc bmc3",
        induction=3,
        depth=190,
    ),
    Proof("select_proof", ("taxel_line_select",), "abc pdr"),
    Proof("ethernet_frame_proof", ("taxel_types", "taxel_ethernet_frame"), "smtbmc yices", depth=110),
)


def checked(proof: Proof, mode: str, source: Path = SOURCES, longest: float = 3600) -> str:
    """Run one proof or its covers, on the sources or on others, with a fault; return sby's verdict.

    One that takes longer than so many seconds raises TimeoutExpired.
    """
    planted = source != SOURCES
    folder = WORK / (f"{proof.name}_planted" if planted else proof.name)
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    for name in (*proof.sources, f"fpv/{proof.name}"):
        path = (RTL if name.startswith("fpv/") else source) / f"{name}.sv"
        files.append(folder / path.name)
        shutil.copy(path, folder)
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
    paths = {"PATH": f"{TOOLS}:/usr/bin:/bin", "YOWASP_CACHE_DIR": str(TOOLS.parent / "cache")}
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
            verdict = checked(proof, mode)
            bad += verdict != "PASS"
            print(f"{proof.name}, {mode}: {verdict}", flush=True)
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
