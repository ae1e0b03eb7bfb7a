"""The command in a process of its own, and what tests of it expect."""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys

REPORT = {
    "scene": "small",
    "passed": True,
    "trees": [
        {
            "name": "a",
            "passed": True,
            "seconds": {"grow": 1.25, "check": 2.5},
            "gates": {"envelope_iou": 0.9},
            "views": [
                {
                    "photo": "p.jpg",
                    "azimuth": 0.0,
                    "envelope_iou": 0.95,
                    "skill": 0.5,
                    "boundary_f": 0.9,
                    "branch_chamfer": 0.0123,
                    "colour_delta_e": 4.0,
                    "failed": [],
                }
            ],
        }
    ],
}


def failing(report: dict) -> dict:
    """The report with the gate of its tree missed."""
    report = json.loads(json.dumps(report))
    tree = report["trees"][0]
    report["passed"] = tree["passed"] = False
    tree["views"][0] |= {"envelope_iou": 0.81234, "failed": ["envelope_iou"]}
    return report


def one_line(text: str) -> str:
    """The text, which must be one line of ours."""
    assert text.startswith("forestgen: ")
    assert text.count("\n") == 1
    return text


def shell(*words: object, limit: int | None = None, **environment: str) -> subprocess.CompletedProcess[bytes]:
    """Run the command; `limit`: bytes that a file may have."""

    def confine() -> None:
        if limit is not None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    return subprocess.run(
        [sys.executable, "-m", "forestgen", *map(str, words)],
        capture_output=True,
        env={**os.environ, **environment},
        preexec_fn=confine,
        timeout=300,
    )
