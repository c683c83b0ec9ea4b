"""A hundred steps with a timeout each, and PyBullet in the loop: one trace in all processes, byte for byte."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parents[2]
PROGRAM = """
import sys
from functools import partial
import pybullet
from planlang import *
from planlang.kernel import record

class Balls:
    rate = 240

    def __init__(self):
        self.client = pybullet.connect(pybullet.DIRECT)
        pybullet.setGravity(0, 0, -9.81)
        ground = pybullet.createCollisionShape(pybullet.GEOM_PLANE)
        pybullet.createMultiBody(0, ground)
        ball = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=0.05)
        self.balls = [
            pybullet.createMultiBody(1, ball, basePosition=(0.09 * (n % 5), 0.08 * (n // 5 % 2), 0.2 + n // 10 / 9))
            for n in range(20)
        ]

    def step(self):
        pybullet.stepSimulation()

    def height(self, number):
        return pybullet.getBasePositionAndOrientation(self.balls[number])[0][2]

world = Balls()

async def step(number):
    ball = number % len(world.balls)
    low = Fluent(name=f"ball {ball} is low", read=lambda: world.height(ball) < 0.12 + 0.1 * rng_of[number])
    await wait_for(low)
    await sleep(rng().random() * 0.3)
    pybullet.applyExternalForce(world.balls[ball], -1, (0, 0, 400 + number), (0, 0, 0), pybullet.WORLD_FRAME)
    return {"kicked", f"ball {ball}", world.height(ball)}

rng_of = {}

async def bounded(number):
    rng_of[number] = rng().random()
    try:
        return await timeout(0.5, partial(step, number))
    except PlanFailure as failure:
        record("missed", failure=failure)

async def plan():
    steps = {f"step{n}": partial(bounded, n) for n in range(100)}
    await partial_order(steps, [(f"step{n // 2}", f"step{n}") for n in range(1, 100)])

trace = Trace()
run(plan, host=SimulationHost(world), seed=3, trace=trace)
sys.stdout.write(trace.text())
"""


def test_a_plan_with_physics_in_the_loop_has_one_trace_in_six_processes() -> None:
    processes = [
        subprocess.Popen(
            [sys.executable, "-c", PROGRAM],
            env={**os.environ, "PYTHONPATH": str(CHECKOUT), "PYTHONHASHSEED": hash_seed},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        )
        for hash_seed in ("0", "1", "2", "42", "4711", "random")
    ]
    ended = [process.communicate(timeout=120) for process in processes]
    assert [process.returncode for process in processes] == [0] * 6, ended[0][1].decode()
    traces = [output[output.index(b'{"step"') :] for output, _ in ended]  # PyBullet greets on the same channel
    assert len(set(traces)) == 1
    assert traces[0].count(b'"missed"') not in (0, 100), "some steps are in time, some are not"
