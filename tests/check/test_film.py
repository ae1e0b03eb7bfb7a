"""The film of a growing tree: drawn from the written stage, kept by later checks."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image
from pxr import Usd

from forestgen.check.film import AGES, PREVIEW, SIZE, STRIP, draw_film, film_pictures, write_preview, write_strip
from forestgen.check.report import TreeReport, report_html, report_json
from forestgen.tree.growth import Growth
from tests.test_growing import model


def shades(n: int) -> list[np.ndarray]:
    """Pictures from dark to light."""
    return [np.full((6, 4, 3), 10 * k, np.uint8) for k in range(n)]


def test_a_strip_shows_ages_evenly_up_to_the_last(tmp_path: Path) -> None:
    write_strip(shades(17), tmp_path / STRIP)
    strip = cv2.imread(str(tmp_path / STRIP))
    assert strip.shape == (6, 4 * AGES, 3)
    assert strip[0, ::4, 0].tolist() == [20, 40, 60, 80, 100, 120, 140, 160]


def test_a_preview_moves_for_ever(tmp_path: Path) -> None:
    write_preview(shades(5), tmp_path / PREVIEW)
    with Image.open(tmp_path / PREVIEW) as preview:
        assert (preview.n_frames, preview.info["loop"]) == (5, 0)
        seen = []
        for k in range(5):
            preview.seek(k)
            seen.append(preview.convert("RGB").getpixel((1, 1))[0])
    assert seen == sorted(set(seen))


def test_a_later_check_keeps_the_film_and_the_page_shows_it(tmp_path: Path) -> None:
    earlier, folder = tmp_path / "earlier", tmp_path / "new"
    assert film_pictures(earlier, folder, "report/oak", "oak") == ()
    earlier.mkdir()
    write_strip(shades(3), earlier / STRIP)
    write_preview(shades(3), earlier / PREVIEW)
    film = film_pictures(earlier, folder, "report/oak", "a <b>oak</b>")
    assert [picture.path for picture in film] == [f"report/oak/{PREVIEW}", f"report/oak/{STRIP}"]
    assert film[0].size == (4, 6)
    assert (folder / STRIP).read_bytes() == (earlier / STRIP).read_bytes()
    tree = TreeReport("oak", "oak", "tan2008", 1, film=film)
    page = report_html(report_json("wood", [tree]), [tree])
    assert f'src="report/oak/{PREVIEW}"' in page
    assert "a &lt;b&gt;oak&lt;/b&gt;" in page
    bare = TreeReport("oak", "oak", "tan2008", 1)
    assert "<h3>Growth</h3>" not in report_html(report_json("wood", [bare]), [bare])


@pytest.mark.gl
def test_the_tree_fills_more_of_each_picture(tmp_path: Path) -> None:
    from forestgen.growing import grow_tree, show_film
    from forestgen.pipeline import write_tree

    made = grow_tree(write_tree(model(60), "oak", tmp_path / "trees"), Growth(), frames=4)
    folder = show_film(made)
    assert folder == tmp_path.resolve() / "report" / "oak"
    strip = cv2.imread(str(folder / STRIP)).astype(float)
    shown = strip.reshape(SIZE[1], -1, SIZE[0], 3).transpose(1, 0, 2, 3)
    assert len(shown) == 4
    backdrop = shown[0, : SIZE[1] // 3].mean(axis=(1, 2), keepdims=True)
    covered = [np.count_nonzero(np.abs(one[: SIZE[1] // 3] - backdrop).max(axis=2) > 25) for one in shown]
    assert covered == sorted(covered)
    assert covered[0] == 0 < covered[-1]
    assert Usd.Stage.Open(str(made.film)).GetEndTimeCode() == 4
    with Image.open(folder / PREVIEW) as preview:
        assert preview.n_frames == 4
    assert sorted(p.name for p in tmp_path.iterdir()) == ["report", "trees"]
    draw_film(made.film, 2, tmp_path / "again")
    assert cv2.imread(str(tmp_path / "again" / STRIP)).shape[1] == 2 * SIZE[0]
