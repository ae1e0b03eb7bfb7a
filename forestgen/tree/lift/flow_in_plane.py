"""Particle flow in one picture plane: what figure 4 of Neubert et al. 2007 shows of direction field and attraction."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from forestgen.camera import Camera
from forestgen.tree.lift.direction_field import Blend, DirectionField, direction_field
from forestgen.tree.lift.flow_tracing import FlowRules, Graph, trace_particles

RULES = FlowRules(
    steps=400, speed=0.01, inertia=3.0, inertia_growth=0.3, to_field=1.0, to_neighbour=0.35, to_base=0.0, to_limb=0.0,
    limb_share=0.0, sight=0.12, join=0.02, floor=0.02, join_traces=True, least_turn=0.3,
)  # fmt: skip
ALONE = 1e-6  # of the height: particles that do not attract each other do not join either


def flow_in_plane(
    xy: NDArray[np.float64],
    parent: NDArray[np.int64],
    start: NDArray[np.float64],
    *,
    blend: Blend,
    attraction: bool,
    reach: float = 0.2,
    share: float = 0.5,
) -> tuple[DirectionField, Graph]:
    """The field of an attractor graph (N, 2) px, and the ways of particles from start (P, 2) px to its root.

    The graph that is left lies in the plane z = 0, in px, y up from the root. `reach` is a share of the
    picture's height, which is the height of all points together; `share` is a constant h (eq. 3).
    """
    every = np.concatenate([xy, start])
    box = np.array([every.min(axis=0), every.max(axis=0)])
    tall = float(box[1, 1] - box[0, 1])
    field = direction_field(xy, parent, box, blend=blend, reach=reach * tall, share=share)
    camera = Camera((1, 1), (float(xy[0, 0]), float(xy[0, 1])), 1.0)
    values = {name: getattr(RULES, name) * tall for name in ("speed", "sight", "join", "floor")}
    if not attraction:
        values |= {"to_neighbour": 0.0, "join": ALONE * tall, "join_traces": False}
    rules = FlowRules(**{**vars(RULES), **values})
    graph = trace_particles(camera.unproject(start), np.zeros((1, 3)), np.array([-1]), [camera], [field], rules)
    return field, graph
