"""Sound calls of `taxel.simulate`."""

import os
from collections.abc import Callable
from typing import IO, Any

import numpy as np

import taxel
from sound.things import ARRAY, EVENTS, REGISTERS, Sound, fresh, method, plain

SCENE = taxel.simulate.Scene.draw(1)
LAYER = taxel.simulate.Layer(array=ARRAY)
CIRCUIT = taxel.simulate.circuit

MOTION = SCENE.motion()
EMULATED: dict[str, Any] = {
    "to": "127.0.0.1:9",
    "touch": [taxel.simulate.Silence(3.0)],
    "seed": 1,
    "preset": None,
    "registers": None,
    "tare_ms": 1.0,
    "array": None,
    "sensor": {},
    "wire": 2,
    "previous": "last_sent",
    "intensity": "value",
    "version_2": None,
    "circuit": None,
    "asynchronous": False,
    "flaws": None,
    "faults": None,
    "reset_every_s": None,
    "drift_ppm": 0.0,
    "control": None,
    "line": None,
    "baud": 115_200,
    "sync": None,
    "overwrite": True,
    "source_port": 0,
    "begun": lambda _: None,
    "watch": lambda _: None,
    "touched": lambda _: None,
}


def pipe() -> IO[bytes]:
    """A pipe with the line that describes frames, and no frame."""
    read, write = os.pipe()
    with os.fdopen(write, "wb") as end:
        end.write(b'{"rows": 4, "columns": 4, "rate": 100, "bits": 8}\n')
    return os.fdopen(read, "rb")


#: A valid call of every public function and class with arguments, by its full name.
SOUND: dict[str, Sound] = {
    "taxel.simulate.Board": plain(
        taxel.simulate.Board,
        registers=REGISTERS,
        array=None,
        previous="last_sent",
        intensity="value",
        queue=100,
        version_2=None,
        circuit=CIRCUIT.Circuit(),
        asynchronous=False,
    ),
    "taxel.simulate.Version2": plain(
        taxel.simulate.Version2, board=1, seed=2, hold_us=0, heartbeat_us=10_000, states_us=1_000_000
    ),
    "taxel.simulate.Flaws": plain(
        taxel.simulate.Flaws,
        gain=0.1,
        threshold=1.0,
        hysteresis=1.0,
        drift=1.0,
        dead=0.1,
        stuck=0.1,
        loose=1,
        noise=1.0,
        seeds={"gain": 1},
    ),
    "taxel.simulate.Faults": plain(
        taxel.simulate.Faults, lost=0.1, repeated=0.1, reordered=0.1, cut=0.1, corrupted=0.1, seed=1
    ),
    "taxel.simulate.Replay": plain(taxel.simulate.Replay, source=EVENTS, speed=1.0),
    "taxel.simulate.Replay.registers": method(taxel.simulate.Replay(EVENTS), "registers", preset="5.2 kHz"),
    "taxel.simulate.Board.command": fresh(taxel.simulate.Board, "command", data=bytes.fromhex("e000000000")),
    "taxel.simulate.Board.frame": fresh(
        taxel.simulate.Board, "frame", ticks=np.zeros(4096, np.uint16), most=5, accepted=np.ones(4096, bool)
    ),
    "taxel.simulate.Board.record": fresh(taxel.simulate.Board, "record", start=True),
    "taxel.simulate.FrameSequence": plain(taxel.simulate.FrameSequence, values=np.zeros((3, 64, 64)), period_us=192.0),
    "taxel.simulate.Scene": plain(lambda **given: taxel.simulate.Scene(**given).motion(), parameters=SCENE.parameters),
    "taxel.simulate.Scene.draw": plain(taxel.simulate.Scene.draw, seed=1, index=0, left_to_rest=False, array=None),
    "taxel.simulate.Scene.motion": method(SCENE, "motion", step_us=100.0, array=None),
    "taxel.simulate.Scene.replace": lambda: (
        lambda **given: SCENE.replace(**given).motion(),
        {"foam": {"dashpot_ms": 0.0}, "lead_ms": 5.0},
    ),
    "taxel.simulate.Scene.body": lambda: (
        lambda n, **given: SCENE.body(n, **given).motion(),
        {"n": 0, "x_mm": 80.0, "mass_g": 30.0},
    ),
    "taxel.simulate.play": plain(
        taxel.simulate.play,
        acts=[taxel.simulate.Silence(10.0)],
        seed=1,
        preset="5.2 kHz",
        tare_ms=3.0,
        array=None,
        sensor={},
        wire=2,
        circuit=None,
        asynchronous=True,
        watch=lambda _: None,
    ),
    "taxel.simulate.circuit.Fabric": plain(CIRCUIT.Fabric, rest_us=0.1, touch_us=1.0, exponent=0.8),
    "taxel.simulate.circuit.Fabric.conductance": method(CIRCUIT.Fabric(), "conductance", force_n=[0.0, 1.0]),
    "taxel.simulate.circuit.Fabric.force": method(CIRCUIT.Fabric(), "force", conductance_us=[0.0, 1.0]),
    "taxel.simulate.circuit.VirtualGround": plain(
        CIRCUIT.VirtualGround,
        v_trans=0.5,
        feedback_kohm=47.0,
        gain=1e3,
        offset_mv=2.0,
        switch_ohm=2.5,
        wire_ohm=1.0,
        rail_v=3.3,
        seed=1,
    ),
    "taxel.simulate.circuit.Divider": plain(
        CIRCUIT.Divider, supply_v=5.0, resistor_kohm=10.0, switch_ohm=2.5, wire_ohm=1.0, idle="floating"
    ),
    "taxel.simulate.circuit.VirtualGround.volts": method(CIRCUIT.VirtualGround(), "volts", conductance_us=[[1.0, 2.0]]),
    "taxel.simulate.circuit.VirtualGround.volts_alone": method(
        CIRCUIT.VirtualGround(), "volts_alone", conductance_us=[[1.0, 2.0]]
    ),
    "taxel.simulate.circuit.Divider.volts": method(CIRCUIT.Divider(), "volts", conductance_us=[[1.0, 2.0]]),
    "taxel.simulate.circuit.Divider.volts_alone": method(CIRCUIT.Divider(), "volts_alone", conductance_us=[[1.0, 2.0]]),
    "taxel.simulate.circuit.Converter": plain(
        CIRCUIT.Converter,
        shape="linear",
        ramp=150,
        hysteresis_v=0.1,
        settle_us=0.05,
        amplifier_us=0.7,
        discharge_us=0.02,
        wait_us=0.2,
        step_us=0.75,
        line_us=3.0,
        steps=4,
    ),
    "taxel.simulate.circuit.Converter.ticks": method(CIRCUIT.Converter(), "ticks", volts=[[1.4, 2.0]]),
    "taxel.simulate.circuit.Converter.ramp_volts": method(CIRCUIT.Converter(), "ramp_volts", ticks=[1.0, 9.0]),
    "taxel.simulate.circuit.Converter.ramp_ticks": method(CIRCUIT.Converter(), "ramp_ticks", volts=[1.0, 9.0]),
    "taxel.simulate.circuit.Converter.trace": method(
        CIRCUIT.Converter(), "trace", line_v=[1.4, 1.5, 2.0, 2.5], every_us=0.1, stop_us=6.0
    ),
    "taxel.simulate.circuit.AdaptiveRamp": plain(
        CIRCUIT.AdaptiveRamp,
        converter=CIRCUIT.Converter(),
        steepest=38,
        gentlest=510,
        moves_ticks=4.0,
        noise_ticks=2.0,
    ),
    "taxel.simulate.circuit.AdaptiveRamp.convert": method(
        CIRCUIT.AdaptiveRamp(), "convert", volts=np.full((9, 4, 8), 1.5), period_us=20.0
    ),
    "taxel.simulate.circuit.Circuit": plain(
        CIRCUIT.Circuit, readout=CIRCUIT.VirtualGround(), converter=CIRCUIT.Converter()
    ),
    "taxel.simulate.circuit.Circuit.ticks": method(CIRCUIT.Circuit(), "ticks", conductance_us=[[1.0, 2.0]]),
    "taxel.simulate.truth": plain(
        taxel.simulate.truth, acts=[taxel.simulate.Silence(10.0)], preset="5.2 kHz", array=None
    ),
    "taxel.simulate.Layer": plain(taxel.simulate.Layer, foam={}, array=ARRAY, cells_per_pitch=2, tolerance=1e-4),
    "taxel.simulate.Layer.press": method(LAYER, "press", sunk_mm=np.full((4, 4), 0.5)),
    "taxel.simulate.Layer.forget": method(LAYER, "forget"),
    "taxel.simulate.Layer.compliance": method(LAYER, "compliance", waves=[0.1]),
    "taxel.simulate.Layer.base_share": method(LAYER, "base_share", waves=[0.1]),
    "taxel.simulate.Silence": plain(
        lambda **given: taxel.simulate.play([taxel.simulate.Silence(**given)], seed=1, tare_ms=3.0), ms=10.0
    ),
    "taxel.simulate.SceneFile.open": plain(taxel.simulate.SceneFile.open, path="here_scene.toml"),
    "taxel.simulate.Pipe": lambda: (taxel.simulate.Pipe, {"source": pipe(), "noise_floor": 3}),
    "taxel.simulate.Pipe.registers": lambda: (taxel.simulate.Pipe(pipe()).registers, {"preset": None}),
    "taxel.simulate.emulate": lambda: (taxel.simulate.emulate, EMULATED),
    "taxel.simulate.pattern": plain(taxel.simulate.pattern, frame=3, array=taxel.Array(4, 4), ramp=150),
}

#: For each type that only taxel constructs, a call that returns an instance.
RESULTS: dict[str, Callable[[], Any]] = {
    "taxel.simulate.Contact": lambda: MOTION.contacts[0],
    "taxel.simulate.EmulatorReport": lambda: taxel.simulate.emulate("127.0.0.1:9", [taxel.simulate.Silence(1.0)]),
    "taxel.simulate.Motion": lambda: MOTION,
    "taxel.simulate.Played": lambda: taxel.simulate.play([taxel.simulate.Silence(10.0)], seed=1, tare_ms=3.0),
    "taxel.simulate.Pressed": lambda: LAYER.press(np.full((4, 4), 0.5)),
    "taxel.simulate.SceneFile": lambda: taxel.simulate.SceneFile.open("here_scene.toml"),
    "taxel.simulate.Track": lambda: MOTION.tracks[0],
    "taxel.simulate.circuit.Converted": lambda: CIRCUIT.AdaptiveRamp().convert(np.full((9, 4, 8), 1.5), period_us=20.0),
    "taxel.simulate.circuit.Trace": lambda: CIRCUIT.Converter().trace([1.4, 1.5, 2.0, 2.5], every_us=0.1, stop_us=6.0),
}

#: Names that are not tested, and the reason.
LEFT_OUT: dict[str, str] = {}
