"""The leaf atlas: what is cut, how it is packed, and what its prototypes promise."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

from forestgen.tree.atlas import LeafAtlasFromPhoto
from forestgen.tree.atlas_packing import bleed, pack
from forestgen.tree.foliage_unmixing import pure_foliage
from forestgen.tree.leaf_blades import LONG_STALK, PETIOLE, build_blade, row_extents, trim
from forestgen.tree.leaf_cells import climb, find_pieces, group_colours
from forestgen.tree.leaf_colours import lab_of, split_colours
from forestgen.tree.leaf_scale import bears_needles, detail_radius
from forestgen.tree.leaf_shapes import FORMS, half_width
from forestgen.tree.mattes import Mattes
from forestgen.tree.model import Atlas
from forestgen.tree.photo import Photo, load_photo
from forestgen.tree.scale import photo_camera
from forestgen.tree.strokes import load_strokes
from forestgen.tree.view import View
from tests.synthetic import drawn_tree


def atlas_of(view: View, seed: int = 1, **fields: object) -> Atlas:
    return LeafAtlasFromPhoto(**fields)([view], rng=np.random.default_rng(seed))  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def mottled() -> View:
    """The drawn tree, its leaves from dark green on the left to yellow on the right, each with its own light."""
    view = drawn_tree(px_per_metre=160.0).view
    rng = np.random.default_rng(3)
    height, width = view.mattes.foliage.shape
    across = np.linspace(0, 1, width)[None, :, None]
    green, yellow = np.array([30.0, 70.0, 20.0]), np.array([200.0, 180.0, 40.0])
    light = cv2.GaussianBlur(rng.normal(0, 1, (height, width)).astype(np.float32), (0, 0), 4)
    leaf = (green * (1 - across) + yellow * across) * (1 + 0.4 * light / light.std())[..., None]
    alpha = view.mattes.foliage[..., None]
    rgb = np.clip(view.photo.rgb * (1 - alpha) + leaf * alpha, 0, 255).astype(np.uint8)
    return replace(view, photo=Photo(rgb, "mottled.png"))


@pytest.fixture(scope="module")
def atlas(mottled: View) -> Atlas:
    return atlas_of(mottled)


def test_a_bare_tree_gets_an_empty_atlas() -> None:
    atlas = atlas_of(drawn_tree(leaves=False).view)
    assert atlas.prototypes == ()
    assert atlas.rgba.shape == (1, 1, 4)
    assert not atlas.rgba.any()


def test_each_colour_is_worn_short_and_long_stalked(atlas: Atlas) -> None:
    n = len(atlas.prototypes) // 2
    assert n == 32
    for short, long in zip(atlas.prototypes[:n], atlas.prototypes[n:], strict=True):
        assert_allclose(short.uv, long.uv)
        assert long.points[:, 1].mean() > short.points[:, 1].mean() + 0.1


def test_sides_are_powers_of_two(atlas: Atlas) -> None:
    assert all(side & (side - 1) == 0 and side <= 2048 for side in atlas.rgba.shape[:2])


def test_leaf_space(atlas: Atlas) -> None:
    for leaf in atlas.prototypes:
        assert_allclose(leaf.points[0], 0, atol=1e-12)  # the petiole's foot
        assert 0.85 <= leaf.points[:, 1].max() <= 1.05  # one unit long, but for its bow
        assert leaf.points[:, 1].min() >= -1e-9
        assert 8 <= len(leaf.points) <= 16
        assert np.ptp(leaf.points[:, 2]) > 0.02  # no cardboard
        corner = leaf.points[leaf.faces]
        facing = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        assert facing[:, 2].sum() > 0  # its face is to +Z
        assert_allclose(np.linalg.norm(leaf.normals, axis=1), 1)
        assert ((leaf.uv >= 0) & (leaf.uv <= 1)).all()


def filled(atlas: Atlas, which: slice) -> list[np.ndarray]:
    """The texels of each prototype's polygon."""
    height, width = atlas.rgba.shape[:2]
    masks = []
    for leaf in atlas.prototypes[which]:
        mask = np.zeros((height, width), np.uint8)
        xy = leaf.uv * [width, -height] + [0, height] - 0.5
        for face in leaf.faces:
            cv2.fillPoly(mask, [np.round(xy[face] * 16).astype(np.int32)], 1, shift=4)
        masks.append(mask > 0)
    return masks


def test_polygons_hug_the_leaves_and_do_not_overlap(atlas: Atlas) -> None:
    masks = filled(atlas, slice(0, len(atlas.prototypes) // 2))
    leaf = atlas.rgba[..., 3] >= 128
    union = np.any(masks, axis=0)
    assert np.max(np.sum(masks, axis=0)) == 1
    assert (leaf & union).sum() >= 0.96 * leaf.sum()  # little of a leaf is cut off
    assert (leaf & union).sum() >= 0.78 * union.sum()  # a square would reach about 0.5


def test_colour_is_the_mean_of_the_texels(atlas: Atlas) -> None:
    leaf = atlas.rgba[..., 3] >= 128
    for mask, prototype in zip(filled(atlas, slice(0, 8)), atlas.prototypes[:8], strict=True):
        texels = atlas.rgba[mask & leaf][:, :3].mean(axis=0) / 255
        assert_allclose(texels, prototype.colour, atol=0.02)


def test_colour_is_bled_under_the_edge(atlas: Atlas) -> None:
    """No texel near a leaf is black or sky: a mip level of four texels a side keeps the leaf's colour."""
    alpha = atlas.rgba[..., 3].astype(np.float32) / 255
    colour = atlas.rgba[..., :3].astype(np.float32)
    edge = (cv2.dilate(alpha, np.ones((9, 9))) > 0.5) & (alpha < 0.5)
    solid = cv2.boxFilter(colour * (alpha > 0.9)[..., None], -1, (15, 15), normalize=False)
    count = cv2.boxFilter((alpha > 0.9).astype(np.float32), -1, (15, 15), normalize=False)
    near = edge & (count > 4)
    off = np.abs(colour[near] - solid[near] / count[near][:, None]).mean(axis=1)
    assert np.median(off) < 20
    assert np.percentile(off, 95) < 70


def test_colours_span_the_crown(mottled: View, atlas: Atlas) -> None:
    lab = lab_of(mottled.photo.rgb[mottled.mattes.foliage > 0.9]).astype(float)
    mine = lab_of(np.round([leaf.colour * 255 for leaf in atlas.prototypes]).astype(np.uint8)).astype(float)
    far = np.sqrt(((lab[::50, None] - mine) ** 2).sum(axis=2)).min(axis=1)
    assert np.median(far) < 10  # single pixels vary more than leaves do
    for channel, span in ((0, 0.5), (1, 0.6), (2, 0.6)):
        low, high = np.percentile(lab[:, channel], [5, 95])
        assert np.ptp(mine[:, channel]) > span * (high - low)


def test_same_seed_same_bytes(mottled: View, atlas: Atlas) -> None:
    again, other = atlas_of(mottled), atlas_of(mottled, seed=2)
    assert again.rgba.tobytes() == atlas.rgba.tobytes()
    assert all(
        a.points.tobytes() == b.points.tobytes() for a, b in zip(again.prototypes, atlas.prototypes, strict=True)
    )
    assert any(
        a.points.tobytes() != b.points.tobytes() for a, b in zip(other.prototypes, atlas.prototypes, strict=True)
    )


@pytest.mark.parametrize("pixels", [1, 2, 9])
def test_a_few_pixels_of_foliage_are_enough(pixels: int) -> None:
    view = drawn_tree(leaves=False).view
    foliage = np.zeros_like(view.mattes.foliage)
    foliage[100, 100 : 100 + pixels] = 1
    atlas = atlas_of(replace(view, mattes=Mattes(foliage, view.mattes.branch)))
    assert 1 <= len(atlas.prototypes) // 2 <= pixels


def lightness(atlas: Atlas) -> NDArray[np.float32]:
    return lab_of(np.round([leaf.colour * 255 for leaf in atlas.prototypes]).astype(np.uint8))[:, 0]


def test_two_views_share_the_colours(mottled: View) -> None:
    red = replace(mottled, photo=Photo(mottled.photo.rgb[..., [0, 2, 1]] // 2, "dark.png"))
    atlas = LeafAtlasFromPhoto()([mottled, red], rng=np.random.default_rng(0))
    assert len(atlas.prototypes) == 64
    darker = lightness(atlas)[:16].mean() - lightness(atlas)[16:32].mean()
    alone = lightness(atlas_of(mottled)).mean() - lightness(atlas_of(red)).mean()
    assert alone > 10
    assert 0.1 * alone < darker < 0.5 * alone  # half the cells are the dark photo's, in a light nearer to the other's


def test_conifers_get_needles_and_others_do_not(mottled: View) -> None:
    assert not bears_needles(mottled)
    slim = mottled.strokes.crown * [0.3, 1.0]
    slim[:, 0] += mottled.camera.root_px[0] - slim[:, 0].mean()
    dark = Photo(np.full_like(mottled.photo.rgb, 0) + np.array([40, 60, 30], np.uint8), "dark.png")
    conifer = replace(mottled, photo=dark, strokes=replace(mottled.strokes, crown=slim))
    assert bears_needles(conifer)
    full = atlas_of(mottled, needles="never").rgba[..., 3] > 128
    spray = atlas_of(mottled, needles="always").rgba[..., 3] > 128
    assert outline_length(spray) / spray.sum() > 1.8 * outline_length(full) / full.sum()


def outline_length(mask: np.ndarray) -> int:
    return int((mask & ~(cv2.erode(mask.astype(np.uint8), np.ones((3, 3))) > 0)).sum())


def test_fields_are_checked() -> None:
    with pytest.raises(ValueError, match="colours is 0; expected 1 to 128"):
        LeafAtlasFromPhoto(colours=0)
    with pytest.raises(ValueError, match="cell_px is 2000"):
        LeafAtlasFromPhoto(cell_px=2000)


def test_climb_parts_two_hills_at_the_valley() -> None:
    height = np.array([[1, 3, 1, 0, 2, 4, 2], [1, 2, 1, 0, 1, 2, 1]], np.float32)
    inside = np.ones((2, 7), bool)
    inside[1, 0] = False
    label = climb(height, inside)
    assert label[1, 0] == -1
    assert len(np.unique(label[inside])) == 2
    assert_array_equal(label[0, :3], label[0, 1])
    assert_array_equal(label[0, 4:], label[0, 5])


def test_split_colours_finds_the_clusters() -> None:
    lab = np.array([[0, 0, 0], [1, 0, 0], [50, 0, 0], [51, 0, 0], [50, 40, 0]], float)
    group = split_colours(lab, np.ones(5), 3)
    assert [len(np.unique(group[part])) for part in ([0, 1], [2, 3], [4])] == [1, 1, 1]
    assert len(np.unique(group)) == 3
    assert len(np.unique(split_colours(np.zeros((4, 3)), np.ones(4), 3))) == 1  # no more groups than colours


def test_pieces_tile_the_foliage(mottled: View) -> None:
    pieces = find_pieces(mottled, pure_foliage(mottled), 20.0)
    assert pieces.area.sum() == mottled.mattes.is_foliage.sum()
    assert_allclose(np.linalg.norm(pieces.axis, axis=1), 1)
    assert (pieces.length >= pieces.width).all()
    assert np.isfinite(pieces.score).all()
    assert 10 < np.median(pieces.length[pieces.area > 50]) < 40
    assert len(group_colours(pieces, 8)) == 8


def test_trim_of_a_diamond_by_hand() -> None:
    alpha = np.zeros((50, 40))
    for row in range(42):
        half = 1 + int(15 * (1 - abs(row - 21) / 21))
        alpha[row, 20 - half : 20 + half] = 1
    left, right = row_extents(alpha)
    assert (left[21], right[21]) == (-16, 16)
    levels = trim(alpha)
    assert levels[0, 0] == PETIOLE * 50
    assert levels[-1, 0] == 50
    assert levels[:, 2].argmax() == 2  # widest at mid height
    assert_allclose(levels[:, 1], -levels[:, 2])


@pytest.mark.parametrize("stalk", [PETIOLE, LONG_STALK])
def test_a_blade_is_one_connected_sheet(stalk: float) -> None:
    levels = np.array([[8, -3, 3], [16, -10, 8], [30, -12, 12], [40, -6, 9], [50, -1, 2]], float)
    blade = build_blade(levels, 50, stalk, rng=np.random.default_rng(0))
    assert np.abs(blade.points[blade.flat[:, 1] == PETIOLE][:, 1] - stalk).max() < 1e-9
    edge = np.sort(np.concatenate([blade.faces[1:, [0, 1]], blade.faces[1:, [1, 2]], blade.faces[1:, [2, 0]]]), axis=1)
    _, count = np.unique(edge, axis=0, return_counts=True)
    assert set(count) == {1, 2}
    n_vertices = len(np.unique(blade.faces[1:]))
    assert n_vertices - len(count) + len(blade.faces) - 1 == 1  # Euler: a disc


@pytest.mark.parametrize("form", list(FORMS))
def test_generic_leaves_are_one_piece_from_foot_to_tip(form: str) -> None:
    alpha = FORMS[form](94, 60, np.random.default_rng(2))  # type: ignore[index]
    assert alpha.shape == (94, 60)
    _, _, stats, _ = cv2.connectedComponentsWithStats((alpha >= 0.5).astype(np.uint8))
    assert stats[1:, cv2.CC_STAT_AREA].max() >= 0.97 * (alpha >= 0.5).sum()
    rows = np.flatnonzero((alpha >= 0.5).any(axis=1))
    assert rows[0] < 12
    assert rows[-1] > 84


def test_half_width_is_greatest_where_it_should_be() -> None:
    t = np.linspace(0, 1, 1001)
    half = half_width(t, 0.4, 0.6, 0.8)
    assert t[half.argmax()] == pytest.approx(0.4, abs=2e-3)
    assert half.max() == pytest.approx(1, abs=1e-6)
    assert half[[0, -1]] == pytest.approx([0, 0])


def test_detail_radius_follows_the_size_of_what_is_drawn() -> None:
    found = []
    for radius in (2, 4, 7):
        mask = np.zeros((200, 200), np.uint8)
        for y in range(20, 190, 30):
            for x in range(20, 190, 30):
                cv2.circle(mask, (x, y), radius, 1, -1)
        found.append(detail_radius(mask > 0))
        assert radius / 3 < found[-1] <= radius
    assert found == sorted(found)
    assert detail_radius(np.ones((100, 100), bool)) == 8
    assert detail_radius(np.zeros((9, 9), bool)) == 0


def test_bleed_takes_the_nearest_solid_colour() -> None:
    rgba = np.zeros((1, 6, 4), np.uint8)
    rgba[0, 0], rgba[0, 5] = (10, 0, 0, 255), (0, 20, 0, 255)
    rgba[0, 1] = (99, 99, 99, 40)
    out = bleed(rgba)
    assert_array_equal(out[0, :, 0], [10, 10, 10, 0, 0, 0])
    assert_array_equal(out[..., 3], rgba[..., 3])
    assert_array_equal(bleed(np.zeros((2, 2, 4), np.uint8)), 0)


def test_packed_cells_keep_their_distance() -> None:
    sizes = [(int(w), int(h)) for w, h in np.random.default_rng(0).integers(20, 90, (60, 2))]
    (width, height), corner = pack(sizes)
    free = np.ones((height, width), bool)
    for (w, h), (left, top) in zip(sizes, corner, strict=True):
        assert left >= 0
        assert top >= 0
        assert left + w <= width
        assert top + h <= height
        around = free[max(0, top - 4) : top + h + 4, max(0, left - 4) : left + w + 4]
        assert around.all()
        free[top : top + h, left : left + w] = False


def test_too_many_cells_are_refused() -> None:
    with pytest.raises(ValueError, match="do not fit into an atlas of 128 px"):
        pack([(100, 100)] * 3, largest=128)


@pytest.mark.parametrize("name", ["oak_summer", "pine_medium"])
def test_true_trees(shared: Path, name: str) -> None:
    folder = shared / "ground_truth" / name
    mask = cv2.imread(str(folder / "photo_az000_mask.png")).astype(np.float32) / 255
    mattes = Mattes(mask[..., 2], mask[..., 1])
    photo, strokes = load_photo(folder / "photo_az000.jpg"), load_strokes(folder / "strokes_az000.json")
    base = drawn_tree().view
    view = View(photo, strokes, mattes, base.branches, photo_camera(mattes, strokes, 13.0))
    assert bears_needles(view) == (name == "pine_medium")
    atlas = atlas_of(view)
    assert len(atlas.prototypes) >= 32
    lab = lab_of(np.round([leaf.colour * 255 for leaf in atlas.prototypes]).astype(np.uint8))
    assert np.ptp(lab[:, 0]) > 25  # lights and darks
