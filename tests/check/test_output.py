"""The check from end to end: a tree whose photo is its own render scores fully, a worse one does not."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from html.parser import HTMLParser

import cv2
import numpy as np
import pytest

from forestgen.check.output import read_build
from forestgen.check.plot import cost_panels
from forestgen.check.report import ViewReport
from forestgen.check.score import MEASURES, Gates, make_gates
from forestgen.errors import InputError
from forestgen.pipeline import check_output
from forestgen.reference import write_provenance, write_reference
from forestgen.usd.tree_asset import write_tree_asset
from tests.check.trees import tree_model

pytestmark = pytest.mark.gl
NAME = "<script>alert('x')</script> & Söhne"


def put(out, model, prim_name, asset_of=None):
    """Write a tree's folder as the pipeline does; the asset may be another tree's."""
    folder = out / "trees" / prim_name
    write_tree_asset(asset_of or model, folder)
    write_provenance(model, folder / "reference")
    write_reference(model.views[0], folder / "reference" / "view_00")


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    """An output folder: the tree itself, the same with half of its leaves gone, a bare one, one not built."""
    out = tmp_path_factory.mktemp("out")
    whole = tree_model(tmp_path_factory.mktemp("whole"), name=NAME)
    bare = tree_model(tmp_path_factory.mktemp("bare"), bare=True)
    keep = whole.leaves.position[:, 0] < 0
    fields = ("position", "orientation", "size", "prototype")
    half = replace(whole, leaves=type(whole.leaves)(*(getattr(whole.leaves, name)[keep] for name in fields)))
    put(out, whole, "whole")
    put(out, replace(whole, name="half"), "half", asset_of=half)
    put(out, bare, "bare")
    entries = [{"name": n, "prim_name": p} for n, p in ((NAME, "whole"), ("half", "half"), ("bare", "bare"))]
    entries += [{"name": "lost", "prim_name": "lost", "method": "tan2008", "seed": 1, "error": "no trunk <found>"}]
    (out / "build.json").write_text(json.dumps({"scene": "street", "trees": entries}))
    return out


@pytest.fixture(scope="module")
def report(out):
    return check_output(out)


def test_a_tree_that_is_its_own_photo_scores_fully(report):
    row = report["trees"][0]
    assert row["passed"]
    view = row["views"][0]
    for name in ("envelope_iou", "silhouette_iou", "skill", "boundary_f", "gap_recall", "density_correlation"):
        assert view[name] > 0.995, name  # a pixel of half leaf, half wood is in neither matte
    assert view["branch_chamfer"] < 0.01  # leaves cover parts of the trunk, and thinning rounds its foot
    assert view["colour_delta_e"] < 0.5
    assert row["counts"] == {"branches": 1, "leaves": 300, "triangles": 602, "prototypes": 2}


def test_half_a_crown_misses_its_gates(report):
    row = report["trees"][1]
    assert not row["passed"]
    assert {"envelope_iou", "skill", "boundary_f"} <= set(row["failed"])
    assert row["views"][0]["silhouette_iou"] < 0.8


def test_a_bare_tree_is_not_asked_for_skill(report):
    row = report["trees"][2]
    assert row["passed"]
    assert row["views"][0]["bare"]
    assert row["counts"]["leaves"] == row["counts"]["prototypes"] == 0


def test_a_tree_that_was_not_built_fails_the_scene(report):
    assert not report["passed"]
    row = report["trees"][3]
    assert not row["passed"]
    assert row["error"] == "no trunk <found>"
    assert row["views"] == []


def test_report_json_has_the_shape_that_others_rely_on(out, report):
    kept = json.loads((out / "report.json").read_text())
    assert kept == json.loads(json.dumps(report))
    assert set(kept) >= {"scene", "passed", "trees"}
    for row in kept["trees"]:
        assert set(row) >= {"name", "method", "seed", "passed", "views", "seconds", "counts"}
        for view in row["views"]:
            assert set(view) >= {"photo", "azimuth", *MEASURES}
    assert kept["trees"][0]["name"] == NAME


class Page(HTMLParser):
    """Collects the page's images, links, anchors and open tags."""

    def __init__(self, text):
        super().__init__()
        self.images, self.links, self.ids, self.tags = [], [], set(), []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        found = dict(attributes)
        self.tags.append(tag)
        if "id" in found:
            self.ids.add(found["id"])
        if tag == "img":
            self.images.append(found)
        if tag == "a":
            self.links.append(found["href"])


def test_the_page_shows_every_picture_and_names_nothing_outside(out, report):
    text = (out / "report.html").read_text()
    page = Page(text)
    assert len(page.images) == 3 * (8 + 4)
    for image in page.images:
        assert image["alt"]
        picture = cv2.imread(str(out / image["src"]))
        assert [int(image["width"]), int(image["height"])] == list(picture.shape[1::-1])
        assert max(picture.shape) <= 900
    for link in page.links:
        assert link[1:] in page.ids if link.startswith("#") else (out / link).is_file()
    assert not re.search(r"https?://|file:|" + re.escape(str(out)), text)
    assert page.tags.count("polyline") == 3  # one cost a tree


def test_names_and_notes_are_text_not_markup(out, report):
    text = (out / "report.html").read_text()
    assert "script" not in Page(text).tags
    assert "&lt;script&gt;" in text
    assert "<b>markup" not in text
    assert "no trunk &lt;found&gt;" in text


def without_seconds(report):
    return {**report, "trees": [{**tree, "seconds": None} for tree in report["trees"]]}


def test_checking_again_gives_the_same_report_and_leaves_no_remains(out, report):
    before = {path: path.read_bytes() for path in out.glob("report/**/*") if path.is_file()}
    assert without_seconds(check_output(out)) == without_seconds(report)
    assert {path: path.read_bytes() for path in out.glob("report/**/*") if path.is_file()} == before
    assert {path.name for path in out.iterdir()} == {"trees", "build.json", "report", "report.json", "report.html"}


def test_a_failed_check_leaves_the_old_report(out, report, tmp_path):
    before = (out / "report" / "whole" / "front.jpg").read_bytes()
    build = (out / "build.json").read_text()
    (out / "build.json").write_text('{"scene": "x", "trees": [{"name": "x", "prim_name": "nowhere"}]}')
    try:
        with pytest.raises(InputError, match="nowhere"):
            check_output(out)
    finally:
        (out / "build.json").write_text(build)
    assert (out / "report" / "whole" / "front.jpg").read_bytes() == before
    assert not list(out.glob(".*"))


@pytest.mark.parametrize(
    ("content", "says"),
    [(None, "forestgen build"), ("{", "cannot be read"), ('{"scene": "x", "trees": [{}]}', "lacks"), ("[]", "lacks")],
)
def test_a_folder_that_is_no_build_is_refused(tmp_path, content, says):
    if content is not None:
        (tmp_path / "build.json").write_text(content)
    with pytest.raises(InputError, match=says):
        read_build(tmp_path)


def test_gates_by_hand():
    good = {**dict.fromkeys(MEASURES, 1.0), "branch_chamfer": 0.0, "colour_delta_e": 0.0}
    assert Gates().failed(good, is_bare=False) == ()
    assert Gates().failed({**good, "branch_chamfer": 0.016, "skill": 0.1}, is_bare=False) == ("skill", "branch_chamfer")
    assert Gates().failed({**good, "skill": 0.1}, is_bare=True) == ()
    assert Gates().failed({**good, "envelope_iou": 0.9, "colour_delta_e": 8.0}, is_bare=False) == ()
    assert Gates().failed({**good, "skill": float("nan")}, is_bare=False) == ("skill",)
    strict = make_gates({"gap_recall": 0.9})
    assert strict.failed({**good, "gap_recall": 0.5}, is_bare=False) == ("gap_recall",)
    with pytest.raises(InputError, match="no measure"):
        make_gates({"beauty": 1.0})


def test_cost_panels_span_their_box():
    (panel,) = cost_panels({"image_cost": [4.0, 2.0, float("nan"), 0.0], "too_short": [1.0], "none": []})
    points = np.array([[float(v) for v in pair.split(",")] for pair in panel.points.split()])
    assert panel.name == "image cost"
    assert points[:, 0].tolist() == [0, 100, 300]
    assert points[:, 1].tolist() == [0, 55, 110]
    (flat,) = cost_panels({"flat": [1.0] * 1000})
    assert len(flat.points.split()) == 300
    (large,) = cost_panels({"twigs": [5990.0, 17401.4]})
    assert (large.bottom, large.top, panel.bottom) == ("5,990", "17,401", "0")


def test_a_view_without_pictures_is_a_view():
    assert ViewReport("a.jpg", 0.0, False, {}, ()).pictures == ()
