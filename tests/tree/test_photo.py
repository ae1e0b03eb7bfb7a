"""Photos as people have them: every usual kind is read alike, and what cannot be read is said in one line."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray
from PIL import Image, ImageCms

from forestgen.errors import InputError
from forestgen.tree.photo import MAX_PIXELS, Photo, load_photo

WIDTH, HEIGHT = 64, 48
TURN = Image.Transpose
LYING = {  # how a camera stores an upright picture under each EXIF orientation
    1: None,
    2: TURN.FLIP_LEFT_RIGHT,
    3: TURN.ROTATE_180,
    4: TURN.FLIP_TOP_BOTTOM,
    5: TURN.TRANSPOSE,
    6: TURN.ROTATE_90,
    7: TURN.TRANSVERSE,
    8: TURN.ROTATE_270,
}


def lopsided() -> NDArray[np.uint8]:
    """An image (H, W, 3) that looks different however it is turned."""
    column, row = np.meshgrid(np.linspace(0, 255, WIDTH), np.linspace(0, 255, HEIGHT))
    return np.stack([column, row, (column + row) / 2], axis=-1).astype(np.uint8)


def grey() -> NDArray[np.uint8]:
    return lopsided()[..., 2]


def saved(path: Path, image: NDArray[Any] | Image.Image, **options: Any) -> Path:
    (image if isinstance(image, Image.Image) else Image.fromarray(image)).save(path, **options)
    return path


def srgb_profile(*renamed: tuple[bytes, bytes]) -> bytes:
    """The sRGB profile; tags may be renamed, so that red means green and the like."""
    profile = bytearray(ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes())
    count = struct.unpack_from(">I", profile, 128)[0]
    for k in range(count):
        at = 132 + 12 * k
        for old, new in renamed:
            if profile[at : at + 4] == old:
                profile[at : at + 4] = new
                break
    return bytes(profile)


def cmyk_profile(lab_of_ink: dict[int, tuple[int, int, int]]) -> bytes:
    """A printer's profile: 8-bit Lab of full inks by bit mask (C = 8, M = 4, Y = 2, K = 1), white elsewhere."""
    cells = [lab_of_ink.get(ink, (255, 128, 128)) for ink in range(16)]
    ramp = bytes(range(256))
    lut = b"mft1" + bytes(4) + bytes([4, 3, 2, 0]) + struct.pack(">9i", *(65536 if k % 4 == 0 else 0 for k in range(9)))
    lut += ramp * 4 + b"".join(bytes(cell) for cell in cells) + ramp * 3
    white = b"XYZ " + bytes(4) + struct.pack(">3i", 63190, 65536, 54061)
    tags = [(b"A2B0", lut), (b"wtpt", white)]
    offset, table, body = 132 + 12 * len(tags), struct.pack(">I", len(tags)), b""
    for name, data in tags:
        data += bytes(-len(data) % 4)
        table += name + struct.pack(">II", offset + len(body), len(data))
        body += data
    header = bytearray(128)
    struct.pack_into(">I", header, 0, offset + len(body))
    header[8:12] = b"\x02\x40\0\0"
    header[12:24] = b"prtrCMYKLab "
    header[36:40] = b"acsp"
    struct.pack_into(">3i", header, 68, 63190, 65536, 54061)
    return bytes(header) + table + body


def png_header(width: int, height: int) -> bytes:
    """The beginning of a PNG that says how large it is, and no pixel."""
    body = b"IHDR" + struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    header = struct.pack(">I", 13) + body + struct.pack(">I", zlib.crc32(body))
    return b"\x89PNG\r\n\x1a\n" + header + struct.pack(">I", 100) + b"IDAT"


@pytest.mark.parametrize("ending", ["png", "tif", "bmp", "webp", "ppm", "jp2"])
def test_lossless_kinds_come_back_pixel_for_pixel(tmp_path: Path, ending: str) -> None:
    options = {"lossless": True} if ending == "webp" else {"irreversible": False} if ending == "jp2" else {}
    photo = load_photo(saved(tmp_path / f"a.{ending}", lopsided(), **options))
    assert_array_equal(photo.rgb, lopsided())
    assert photo.name == f"a.{ending}"
    assert photo.size == (WIDTH, HEIGHT)
    assert not photo.rgb.flags.writeable


@pytest.mark.parametrize("ending", ["jpg", "avif"])
def test_lossy_kinds_come_back_nearly(tmp_path: Path, ending: str) -> None:
    photo = load_photo(saved(tmp_path / f"a.{ending}", lopsided(), quality=95))
    assert np.abs(photo.rgb.astype(int) - lopsided()).mean() < 4


@pytest.mark.parametrize("ending", ["png", "jpg", "tif", "webp"])
@pytest.mark.parametrize("orientation", LYING)
def test_exif_orientation_is_applied(tmp_path: Path, orientation: int, ending: str) -> None:
    upright = Image.fromarray(lopsided())
    turn = LYING[orientation]
    lying = upright if turn is None else upright.transpose(turn)
    exif = Image.Exif()
    exif[274] = orientation
    options = {"lossless": True} if ending == "webp" else {"quality": 95} if ending == "jpg" else {}
    photo = load_photo(saved(tmp_path / f"a.{ending}", lying, exif=exif, **options))
    assert photo.size == (WIDTH, HEIGHT)
    assert np.abs(photo.rgb.astype(int) - lopsided()).mean() < (4 if ending == "jpg" else 1e-9)


def test_grey_becomes_three_equal_channels(tmp_path: Path) -> None:
    photo = load_photo(saved(tmp_path / "a.png", grey()))
    assert_array_equal(photo.rgb, np.repeat(grey()[..., None], 3, axis=2))


@pytest.mark.parametrize("ending", ["png", "tif"])
def test_sixteen_bits_are_scaled_not_cut(tmp_path: Path, ending: str) -> None:
    deep = grey().astype(np.uint16) * 257
    deep[0, 0], deep[-1, -1] = 0, 65535
    photo = load_photo(saved(tmp_path / f"a.{ending}", deep))
    assert_array_equal(photo.rgb[..., 0], np.round(deep / 257))


@pytest.mark.parametrize("ending", ["png", "tif"])
@pytest.mark.parametrize("channels", [3, 4])
def test_sixteen_bit_colour(tmp_path: Path, ending: str, channels: int) -> None:
    deep = np.dstack([lopsided()[..., ::-1], np.full((HEIGHT, WIDTH), 255, np.uint8)])[..., :channels].astype(np.uint16)
    path = tmp_path / f"a.{ending}"
    assert cv2.imwrite(str(path), deep * 257)
    assert_allclose(load_photo(path).rgb, lopsided(), atol=1)


def test_float_pixels_are_refused(tmp_path: Path) -> None:
    path = saved(tmp_path / "a.tif", grey().astype(np.float32))
    with pytest.raises(InputError, match=r"a\.tif: expected 8 or 16 bits a channel, came 32; save"):
        load_photo(path)


def test_palette(tmp_path: Path) -> None:
    few = lopsided() // 128 * 255
    image = Image.fromarray(few).convert("P", palette=Image.Palette.ADAPTIVE, colors=8)
    for ending in ("png", "gif"):
        assert_array_equal(load_photo(saved(tmp_path / f"a.{ending}", image)).rgb, few)


def test_transparent_pixels_are_laid_on_white(tmp_path: Path) -> None:
    alpha = np.zeros((HEIGHT, WIDTH), np.uint8)
    alpha[:, 20:40], alpha[:, 40:] = 128, 255
    expected = lopsided().astype(float) * alpha[..., None] / 255 + 255.0 * (1 - alpha[..., None] / 255)
    photo = load_photo(saved(tmp_path / "a.png", np.dstack([lopsided(), alpha])))
    assert_allclose(photo.rgb, expected, atol=1)
    grey_photo = load_photo(saved(tmp_path / "b.png", np.dstack([grey(), alpha])))
    assert_allclose(grey_photo.rgb[..., 0], grey() * (alpha / 255) + 255 * (1 - alpha / 255), atol=1)


def test_transparent_palette_entry_is_laid_on_white(tmp_path: Path) -> None:
    image = Image.new("P", (WIDTH, HEIGHT), 0)
    image.putpalette([10, 20, 30, 200, 100, 50])
    image.paste(1, (0, 0, 32, HEIGHT))
    photo = load_photo(saved(tmp_path / "a.png", image, transparency=0))
    assert photo.rgb[5, 5].tolist() == [200, 100, 50]
    assert photo.rgb[5, 50].tolist() == [255, 255, 255]


@pytest.mark.parametrize("ending", ["jpg", "tif"])
def test_cmyk_without_profile(tmp_path: Path, ending: str) -> None:
    image = Image.new("CMYK", (WIDTH, HEIGHT), (255, 0, 255, 0))  # cyan and yellow ink: green
    photo = load_photo(saved(tmp_path / f"a.{ending}", image))
    assert_allclose(photo.rgb[20, 20], [0, 255, 0], atol=4)


def test_cmyk_goes_through_its_profile(tmp_path: Path) -> None:
    brick = (136, 128 + 60, 128 + 45)  # L = 53, a = 60, b = 45: a red that cyan ink alone never is
    profile = cmyk_profile({8: brick})
    photo = load_photo(
        saved(tmp_path / "a.tif", Image.new("CMYK", (WIDTH, HEIGHT), (255, 0, 0, 0)), icc_profile=profile)
    )
    red, green, blue = photo.rgb[20, 20].tolist()
    assert red > 180
    assert green < 110
    assert blue < 90


@pytest.mark.parametrize("has_alpha", [False, True])
def test_embedded_profile_is_converted_to_srgb(tmp_path: Path, has_alpha: bool) -> None:
    swapped = srgb_profile((b"rXYZ", b"gXYZ"), (b"gXYZ", b"rXYZ"))  # in this space red means green
    flat = np.zeros((HEIGHT, WIDTH, 4), np.uint8)
    flat[...] = 250, 40, 90, 255
    photo = load_photo(saved(tmp_path / "a.png", flat if has_alpha else flat[..., :3], icc_profile=swapped))
    assert_allclose(photo.rgb[0, 0], [40, 250, 90], atol=2)


def test_srgb_profile_changes_nothing(tmp_path: Path) -> None:
    photo = load_photo(saved(tmp_path / "a.png", lopsided(), icc_profile=srgb_profile()))
    assert_allclose(photo.rgb, lopsided(), atol=1)


def test_grey_photo_with_a_cameras_rgb_profile_stays_grey(tmp_path: Path) -> None:
    photo = load_photo(saved(tmp_path / "a.jpg", grey(), icc_profile=srgb_profile(), quality=95))
    assert_allclose(photo.rgb, np.repeat(grey()[..., None], 3, axis=2), atol=4)


@pytest.mark.parametrize("profile", [b"no profile at all", srgb_profile()[:300], cmyk_profile({})])
def test_a_useless_profile_is_passed_over_with_a_warning_in_the_log(
    tmp_path: Path, profile: bytes, caplog: pytest.LogCaptureFixture
) -> None:
    photo = load_photo(saved(tmp_path / "a.png", lopsided(), icc_profile=profile))
    assert_array_equal(photo.rgb, lopsided())
    assert "taken as sRGB" in caplog.text


def test_lab_tiff(tmp_path: Path) -> None:
    to_lab = ImageCms.buildTransform(ImageCms.createProfile("sRGB"), ImageCms.createProfile("LAB"), "RGB", "LAB")
    lab = ImageCms.applyTransform(Image.fromarray(lopsided()), to_lab)
    assert lab is not None
    assert np.abs(load_photo(saved(tmp_path / "a.tif", lab)).rgb.astype(int) - lopsided()).mean() < 3


def test_of_an_animation_the_first_frame_is_taken(tmp_path: Path) -> None:
    frames = [Image.new("RGB", (WIDTH, HEIGHT), colour) for colour in ("red", "blue")]
    frames[0].save(tmp_path / "a.gif", save_all=True, append_images=frames[1:])
    assert load_photo(tmp_path / "a.gif").rgb[5, 5].tolist() == [255, 0, 0]


def bytes_of(image: NDArray[Any], kind: str) -> bytes:
    buffer = BytesIO()
    Image.fromarray(image).save(buffer, kind)
    return buffer.getvalue()


BROKEN: dict[str, tuple[Callable[[], bytes], str]] = {
    "empty.jpg": (lambda: b"", r"empty\.jpg: expected a photo, but the file is empty \(0 bytes\)"),
    "text.jpg": (lambda: b"a letter to a friend", r"text\.jpg: expected a photo \(JPEG, PNG, TIFF, WebP\)"),
    "cut.jpg": (lambda: bytes_of(lopsided(), "JPEG")[:-100], r"cut\.jpg: the image is broken or cut off"),
    "cut.png": (lambda: bytes_of(lopsided(), "PNG")[:-200], r"cut\.png: the image is broken or cut off"),
    "cut.tif": (lambda: bytes_of(lopsided(), "TIFF")[:-200], r"cut\.tif: "),
    "head.png": (lambda: bytes_of(lopsided(), "PNG")[:20], r"head\.png: expected a photo"),
    "giga.png": (lambda: png_header(40000, 40000), r"giga\.png: expected at most 100 million pixels, came far more"),
    "large.png": (lambda: png_header(12000, 10000), r"large\.png: expected at most 100 .* came 12000 x 10000; scale"),
    "tiny.png": (
        lambda: bytes_of(lopsided()[:8, :8], "PNG"),
        r"tiny\.png: expected at least 32 pixels a side, came 8 x",
    ),
    "phone.heic": (lambda: b"\0\0\0\x18ftypheic" + bytes(40), r"phone\.heic: .* came HEIC.* export it as JPEG"),
    "camera.NEF": (lambda: bytes_of(lopsided(), "TIFF"), r"camera\.NEF: .* raw file; develop it"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_what_cannot_be_read_is_said_in_one_line(tmp_path: Path, name: str) -> None:
    content, message = BROKEN[name]
    (tmp_path / name).write_bytes(content())
    with pytest.raises(InputError, match=message) as caught:
        load_photo(tmp_path / name)
    assert "\n" not in str(caught.value)


def test_a_file_that_is_not_there_and_a_folder(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.jpg: expected a photo, but there is no such file; check the path"):
        load_photo(tmp_path / "none.jpg")
    with pytest.raises(InputError, match="this is a folder; give the path of the file itself"):
        load_photo(tmp_path)
    with pytest.raises(InputError, match=r"a b\.jpg: expected a photo, but"):
        load_photo(tmp_path / "a\0b.jpg")


def test_the_limit_admits_the_largest_cameras() -> None:
    assert MAX_PIXELS >= 61_000_000


@pytest.mark.parametrize("kind", ["JPEG", "PNG", "TIFF", "WEBP", "GIF", "BMP", "JPEG2000"])
def test_flipped_bytes_give_a_photo_or_an_input_error(tmp_path: Path, kind: str) -> None:
    whole = bytes_of(lopsided(), kind)
    rng = np.random.default_rng(1)
    path = tmp_path / "a.img"
    for _ in range(40):
        broken = bytearray(whole)
        for at in rng.integers(0, len(whole), rng.integers(1, 8)):
            broken[at] = rng.integers(0, 256)
        path.write_bytes(broken[: rng.integers(1, len(whole) + 1)] if rng.random() < 0.3 else broken)
        with suppress(InputError):
            assert isinstance(load_photo(path), Photo)


def test_the_real_photos_are_read(shared: Path) -> None:
    paths = sorted((shared / "photos").glob("*.jpg"))
    assert paths
    for path in paths[:4]:
        assert min(load_photo(path).size) > 300
