"""Photo: one photograph as 8-bit sRGB, its EXIF orientation and its colour profile applied."""

from __future__ import annotations

import logging
import warnings
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageCms, ImageOps, UnidentifiedImageError

from forestgen.arrays import freeze
from forestgen.errors import InputError
from forestgen.reading import one_line, require_file, shortened

log = logging.getLogger(__name__)

MAX_PIXELS = 100_000_000  # a photo of the largest cameras; more is refused from the header, before decoding
MIN_SIDE = 32  # px; below that nobody could have drawn a stroke
FORMATS = ("JPEG", "PNG", "TIFF", "WEBP", "AVIF", "JPEG2000", "BMP", "GIF", "PPM")
HEIF_BRANDS = (b"heic", b"heix", b"hevc", b"hevx", b"heim", b"heis", b"mif1", b"msf1")
RAW_SUFFIXES = {".dng", ".nef", ".cr2", ".cr3", ".arw", ".orf", ".rw2", ".raf", ".pef", ".srw"}
PAPER = (255, 255, 255)  # what shows through transparent pixels: white, as in most viewers
SPACE_OF_MODE = {"L": "GRAY", "RGB": "RGB", "CMYK": "CMYK", "LAB": "Lab"}


@dataclass(frozen=True, eq=False)
class Photo:
    """An image of H rows and W columns."""

    rgb: NDArray[np.uint8]  # (H, W, 3) sRGB
    name: str  # file name, for messages and the report

    def __post_init__(self) -> None:
        freeze(self, rgb=(np.uint8, "H", "W", 3))

    @property
    def size(self) -> tuple[int, int]:
        """(width, height), px."""
        return self.rgb.shape[1], self.rgb.shape[0]


def load_photo(path: Path) -> Photo:
    """Read a photo of any usual kind: upright, in sRGB, 8 bits a channel.

    Greyscale becomes three equal channels, 16 bits are scaled to 8, embedded profiles (CMYK too)
    are converted to sRGB, transparent pixels are laid on white, of several frames the first is taken.

    Raises:
        InputError: there is no such file, it is no image or a broken one, or it is too large or small.
    """
    path = Path(path)
    require_file(path, "a photo")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Pillow's warnings: sizes are checked here, broken tags do no harm
        with _opened(path) as image:
            _check_size(path, image.size)
            try:
                image.load()
                return Photo(np.asarray(_as_srgb(_upright(image, path), path)), path.name)
            except InputError:
                raise
            except Exception as error:  # decoders raise whatever they like at broken data
                raise InputError(f"{path}: the image is broken or cut off: {_said(error)}; copy it again") from error


def _opened(path: Path) -> Image.Image:
    """The image with its header read and nothing decoded."""
    if path.suffix.lower() in RAW_SUFFIXES:
        raise InputError(f"{path}: expected a photo, came a camera's raw file; develop it and export a JPEG or TIFF")
    try:
        return Image.open(path, formats=FORMATS)
    except Image.DecompressionBombError as error:
        raise InputError(f"{path}: expected at most {MAX_PIXELS // 10**6} million pixels, came far more;"
                         " scale the photo down") from error  # fmt: skip
    except UnidentifiedImageError as error:
        if _is_heif(path):
            raise InputError(f"{path}: expected a photo, came HEIC, which cannot be read; export it as JPEG") from error
        raise InputError(f"{path}: expected a photo (JPEG, PNG, TIFF, WebP), but this is no such image"
                         " or its beginning is broken") from error  # fmt: skip
    except Exception as error:
        raise InputError(f"{path}: expected a photo, but it cannot be read: {_said(error)}") from error


def _check_size(path: Path, size: tuple[int, int]) -> None:
    width, height = size
    if width * height > MAX_PIXELS:
        raise InputError(f"{path}: expected at most {MAX_PIXELS // 10**6} million pixels, came {width} x {height};"
                         " scale the photo down")  # fmt: skip
    if min(size) < MIN_SIDE:
        raise InputError(f"{path}: expected at least {MIN_SIDE} pixels a side, came {width} x {height};"
                         " give the photo at full size")  # fmt: skip


def _upright(image: Image.Image, path: Path) -> Image.Image:
    """The image turned as its EXIF orientation asks; as it is where that tag cannot be read."""
    try:
        return ImageOps.exif_transpose(image)
    except Exception as error:
        log.warning("%s: EXIF data cannot be read (%s); the photo is taken as it lies", path, _said(error))
        return image


def _as_srgb(image: Image.Image, path: Path) -> Image.Image:
    """The image in mode RGB: profile applied, transparency laid on white."""
    profile = image.info.get("icc_profile")
    if image.mode.startswith(("I", "F")):
        image = _eight_bits(image, path)
    alpha = image.convert("RGBA").getchannel("A") if image.has_transparency_data else None
    if image.mode in ("1", "LA", "La"):
        image = image.convert("L")
    elif image.mode not in SPACE_OF_MODE:
        image = image.convert("RGB")
    rgb = _through_profile(image, profile, path)
    return rgb if alpha is None else Image.composite(rgb, Image.new("RGB", rgb.size, PAPER), alpha)


def _eight_bits(image: Image.Image, path: Path) -> Image.Image:
    """A 16-bit grey image scaled to 8 bits."""
    grey = np.asarray(image)
    if grey.dtype.kind == "f" or grey.min() < 0 or grey.max() > 65535:
        raise InputError(f"{path}: expected 8 or 16 bits a channel, came 32; save the photo with 8 or 16 bits")
    return Image.fromarray(np.round(grey.astype(np.float32) / 257).astype(np.uint8))


def _through_profile(image: Image.Image, profile: bytes | None, path: Path) -> Image.Image:
    """The image (L, RGB, CMYK or LAB) in sRGB. A profile that is broken or of another kind is passed over."""
    srgb = ImageCms.createProfile("sRGB")
    if profile:
        try:
            source = ImageCms.ImageCmsProfile(BytesIO(profile))
            space = source.profile.xcolor_space.strip()
            if space == "RGB" and image.mode == "L":
                image = image.convert("RGB")  # grey photos often carry the camera's RGB profile
            if space == SPACE_OF_MODE[image.mode]:
                return _converted(image, source, srgb)
            log.warning("%s: its %s colour profile does not fit a %s image; taken as sRGB", path, space, image.mode)
        except (ImageCms.PyCMSError, OSError, ValueError) as error:
            log.warning("%s: colour profile cannot be used (%s); taken as sRGB", path, _said(error))
    if image.mode == "LAB":
        return _converted(image, ImageCms.createProfile("LAB"), srgb)
    return image.convert("RGB")


def _converted(image: Image.Image, source: object, target: object) -> Image.Image:
    out = ImageCms.profileToProfile(
        image,
        source,  # type: ignore[arg-type]
        target,  # type: ignore[arg-type]
        renderingIntent=ImageCms.Intent.RELATIVE_COLORIMETRIC,
        outputMode="RGB",
        flags=ImageCms.Flags.BLACKPOINTCOMPENSATION,
    )
    assert out is not None  # it is only when working in place
    return out


def _is_heif(path: Path) -> bool:
    with path.open("rb") as file:
        head = file.read(12)
    return head[4:8] == b"ftyp" and head[8:12] in HEIF_BRANDS


def _said(error: Exception) -> str:
    return shortened(one_line(str(error)) or type(error).__name__, 100)
