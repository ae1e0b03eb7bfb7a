"""How fast is the particle flow, and how does it grow with particles? Against the plain step in the same run."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parents[1]))

from forestgen.arrays import stage_rng
from forestgen.tree.density_views import estimate_density
from forestgen.tree.lift.direction_field import DirectionField, direction_field
from forestgen.tree.lift.flow_kernels import runge_kutta
from forestgen.tree.lift.flow_tracing import Graph, lens_of, trace_particles
from forestgen.tree.lift.particle_flow import ParticleFlow
from tests.tree.lift import plain_flow
from tests.tree.lift.flow_trees import fork_view

VIEWS = [fork_view(0), fork_view(90)]
CAMERAS = [view.camera for view in VIEWS]
COUNTS = (1_000, 3_000, 10_000, 30_000, 100_000)


def fields() -> list[DirectionField]:
    box = np.array([[0.0, 0.0], [300.0, 320.0]])
    return [direction_field(v.branches.xy, v.branches.parent, box, reach=40.0) for v in VIEWS]


def trace(n: int, strategy: ParticleFlow) -> tuple[Graph, float]:
    """The graph that n particles leave with only the root known, and the processor seconds of the flow alone."""
    density = estimate_density(VIEWS, resolution=32)
    start = density.sample(n, rng=stage_rng(0, "lift"))
    rules = strategy.rules(density, start)
    every = fields()
    begin = time.process_time()
    graph = trace_particles(start, np.zeros((1, 3)), np.array([-1]), CAMERAS, every, rules)
    return graph, time.process_time() - begin


def step_ratio(n: int) -> tuple[float, float]:
    """Processor seconds of one compiled and of one plain step of n particles."""
    rng = np.random.default_rng(0)
    x: NDArray[np.float64] = rng.uniform([-2, 0, -2], [2, 4, 2], (n, 3))
    v, mass, steady, every = np.zeros_like(x), np.full(n, 2.0), rng.normal(0, 0.5, (n, 3)), fields()
    lens = np.array([lens_of(camera) for camera in CAMERAS])
    grid = np.array([[*field.low, *field.step] for field in every])
    vector = np.array([field.vector for field in every])
    runge_kutta(x.copy(), v.copy(), mass, steady, lens, grid, vector, 1.0, 0.05)
    begin = time.process_time()
    plain_flow.runge_kutta(x, v, mass, steady, CAMERAS, every, 1.0, 0.05)
    middle = time.process_time()
    runge_kutta(x, v, mass, steady, lens, grid, vector, 1.0, 0.05)
    return time.process_time() - middle, middle - begin


def main() -> None:
    fast, plain = step_ratio(20_000)
    print(
        f"one step of 20,000 particles: {1e3 * fast:.1f} ms; plain {1e3 * plain:.0f} ms: {plain / fast:.0f} x as fast"
    )
    strategy = ParticleFlow.paper()
    trace(200, strategy)  # compiles, or reads the compiled code
    seconds = []
    for n in COUNTS:
        graph, taken = trace(n, strategy)
        seconds.append(taken)
        budget = " (budget 1 s)" if n == 1_000 else ""
        print(f"{n:>7,} particles, {strategy.steps} steps: {taken:6.2f} s{budget}, {len(graph.parent):,} nodes")
    slope = np.polyfit(np.log(COUNTS), np.log(seconds), 1)[0]
    ideal = np.polyfit(np.log(COUNTS), np.log(np.array(COUNTS) * np.log(COUNTS)), 1)[0]
    print(f"seconds grow with particles to the power {slope:.2f}; n log n has {ideal:.2f} over this range")
    begin = time.process_time()
    skeleton = ParticleFlow()(VIEWS, rng=stage_rng(0, "lift"))
    print(f"whole stage, default: {time.process_time() - begin:.2f} s, {len(skeleton)} nodes")


if __name__ == "__main__":
    main()
