"""Make the picture of docs/threejs.md from a built scene: `python docs/make_threejs_picture.py out/street docs`.

The scene as glTF binary, drawn by three.js in a headless Chromium: run tools/readers/web.sh install first.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2

from forestgen.exporting import export

READERS = Path(__file__).parents[1] / "tools" / "readers"
CAMERA = {"size": [1500, 540], "fov": 34, "position": [-22, 2.6, 7.6], "target": [40, 7.6, 8.5]}  # between the rows


def main(scene: Path, docs: Path) -> None:
    """Write docs/threejs.jpg."""
    with TemporaryDirectory() as work:
        (glb,) = export(scene, Path(work), "glb")
        picture, jobs = Path(work) / "picture.png", Path(work) / "jobs.json"
        job = {"file": str(glb), "level": 0, "camera": CAMERA, "look": "outdoors", "picture": str(picture)}
        jobs.write_text(json.dumps([job]))
        subprocess.run(["node", str(READERS / "three_shows.mjs"), str(jobs)], check=True, stdout=subprocess.DEVNULL)
        cv2.imwrite(str(docs / "threejs.jpg"), cv2.imread(str(picture)), [cv2.IMWRITE_JPEG_QUALITY, 85])


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
