"""Reading pictures: what comes back, and bad files refused by name."""

from __future__ import annotations

import struct
import zlib

import cv2
import numpy as np
import pytest
from PIL import Image

from stereolib.rig import check_pair, image_size, read_image, read_pair, to_grey, to_light
from stereolib.rig.images import image_orientation


@pytest.fixture
def picture():
    smooth = cv2.GaussianBlur(np.random.default_rng(0).integers(0, 256, (40, 60, 3), dtype=np.uint8), (0, 0), 2)
    return cv2.normalize(smooth, None, 0, 255, cv2.NORM_MINMAX)


def written(path, image):
    path.write_bytes(cv2.imencode(path.suffix, image)[1].tobytes())
    return path


def test_lossless_file_comes_back_exactly(tmp_path, picture):
    path = written(tmp_path / "a.png", picture)
    np.testing.assert_array_equal(read_image(path), picture)
    np.testing.assert_array_equal(read_image(str(path), grey=True), to_grey(picture))


def test_deep_pictures_are_refused_not_crushed(tmp_path, picture):
    """Cameras of 10 and 12 bits write files of 16: taken as 8, little more than black would be left."""
    cv2.imwrite(str(tmp_path / "deep.png"), picture.astype(np.uint16) << 2)
    with pytest.raises(ValueError, match=r"deep\.png: the picture has uint16 samples, 8 bits are needed"):
        read_image(tmp_path / "deep.png")


def png(width: int, height: int) -> bytes:
    """A few bytes of PNG that claim any size."""
    header = b"IHDR" + struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    chunks = [header, b"IDAT" + zlib.compress(bytes(100)), b"IEND"]
    packed = (struct.pack(">I", len(c) - 4) + c + struct.pack(">I", zlib.crc32(c)) for c in chunks)
    return b"\x89PNG\r\n\x1a\n" + b"".join(packed)


@pytest.mark.parametrize(
    ("size", "megapixels"), [((10_100, 10_000), 101), ((15_000, 10_000), 150), ((10**5,) * 2, 10**4)]
)
def test_a_header_that_claims_a_giant_is_refused_before_it_is_decoded(tmp_path, monkeypatch, size, megapixels):
    """Below Pillow's limits, between its warning and its error, and beyond."""
    monkeypatch.setattr(cv2, "imdecode", None)
    (tmp_path / "giant.png").write_bytes(png(*size))
    with pytest.raises(ValueError, match=rf"giant\.png: the picture has {megapixels} megapixels, at most 100 are read"):
        read_image(tmp_path / "giant.png")


def test_a_format_that_pillow_does_not_know_goes_to_opencv(tmp_path, picture):
    """Radiance's HDR: decoded, and refused for its samples only."""
    path = written(tmp_path / "a.hdr", picture)
    with pytest.raises(ValueError, match="float32 samples"):
        read_image(path)


def test_light_is_a_power_of_the_grey_level(picture):
    np.testing.assert_allclose(to_light(picture), (picture / 255) ** 2.2, atol=1e-6)
    assert to_light(picture).dtype == np.float32


def test_grey_is_the_luminance(picture):
    expected = picture.astype(float) @ [0.114, 0.587, 0.299]
    np.testing.assert_allclose(to_grey(picture), expected, atol=0.51)
    assert to_grey(picture[..., 0]) is not None
    np.testing.assert_array_equal(to_grey(picture[..., 0]), picture[..., 0])


@pytest.mark.parametrize(
    "wrong",
    [
        np.zeros((4, 6)),
        np.zeros((4, 6, 3), np.int64),
        np.zeros((4, 6), np.int8),
        np.zeros((4, 6, 4), np.uint8),
        np.zeros((4, 6, 1), np.uint8),
        np.zeros((0, 6), np.uint8),
        [[0, 255]],
    ],
)
def test_grey_and_light_are_made_of_pictures_alone(wrong):
    for make in (to_grey, to_light):
        with pytest.raises(ValueError, match=r"the picture: (images must be uint8 arrays|expected \(H, W\) grey)"):
            make(wrong)


@pytest.mark.parametrize("kind", ["tif", "jpg", "png"])
def test_the_size_is_that_of_the_picture_as_it_is_read(tmp_path, picture, kind):
    """Cameras that are held upright say so in the file."""
    for orientation in (1, 3, 6, 8):
        exif = Image.Exif()
        exif[0x0112] = orientation
        Image.fromarray(picture).save(path := tmp_path / f"{orientation}.{kind}", exif=exif.tobytes())
        assert image_size(path) == read_image(path).shape[1::-1] == ((60, 40) if orientation < 5 else (40, 60))


@pytest.mark.parametrize("kind", ["jpg", "png"])
def test_damaged_exif_spoils_no_picture(tmp_path, picture, kind):
    """Pillow takes it for wrong Python."""
    Image.fromarray(picture).save(path := tmp_path / f"odd.{kind}", exif=b"Exif\0\0no TIFF at all")
    assert image_size(path) == read_image(path).shape[1::-1] == (60, 40)
    assert image_orientation(path) == 1


def test_pair_in_order(tmp_path, picture):
    left, right = written(tmp_path / "l.png", picture), written(tmp_path / "r.png", 255 - picture)
    pair = read_pair(left, right)
    np.testing.assert_array_equal(pair, [picture, 255 - picture])
    assert read_pair(left, right, grey=True)[0].shape == (40, 60)


@pytest.mark.parametrize("kind", ["jpg", "png", "bmp"])
@pytest.mark.parametrize("share", [0.02, 0.5, 0.9])
@pytest.mark.filterwarnings("default")
def test_a_file_cut_short_is_named(tmp_path, picture, kind, share):
    data = cv2.imencode(f".{kind}", picture)[1].tobytes()
    path = tmp_path / f"cut.{kind}"
    path.write_bytes(data[: int(len(data) * share)])
    with pytest.raises(ValueError, match=rf"cut\.{kind}: .*{int(len(data) * share)} bytes"):
        read_image(path)


def test_a_jpeg_may_end_before_its_file_does(tmp_path, picture):
    """Cameras pad theirs, telephones append a film."""
    data, path = cv2.imencode(".jpg", picture)[1].tobytes(), tmp_path / "padded.jpg"
    path.write_bytes(data + bytes(5000))
    np.testing.assert_array_equal(read_image(path), cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR))
    path.write_bytes(data[: len(data) // 2] + bytes(5000))
    with pytest.raises(ValueError, match="cut short"):
        read_image(path)


def test_a_jpeg_without_its_last_bytes_is_refused_though_opencv_reads_it(tmp_path, picture):
    data = cv2.imencode(".jpg", picture)[1].tobytes()
    path = tmp_path / "almost.jpg"
    path.write_bytes(data[:-100])
    assert cv2.imread(str(path)) is not None  # with grey where the rest should be
    with pytest.raises(ValueError, match="cut short"):
        read_image(path)


@pytest.mark.parametrize(("content", "text"), [(None, "no such file"), (b"", "0 bytes"), (b"hello", "5 bytes")])
def test_no_picture_at_all_is_named(tmp_path, content, text):
    path = tmp_path / "board 01.jpg"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(ValueError, match=rf"board 01\.jpg: .*{text}"):
        read_image(path)
    with pytest.raises(ValueError, match="is a folder"):
        read_image(tmp_path)


def test_pair_of_two_sizes_names_both_files(tmp_path, picture):
    with pytest.raises(ValueError, match=r"l\.png is 60x40, .*r\.png is 60x20: a stereo pair must have one size"):
        read_pair(written(tmp_path / "l.png", picture), written(tmp_path / "r.png", picture[:20]))


@pytest.mark.parametrize(
    ("right", "text"),
    [
        (np.zeros((40, 30, 3), np.uint8), "left is 60x40, right is 30x40"),
        (np.zeros((40, 60), np.uint8), "left is colour, right is grey: read both the same way"),
        (np.zeros((40, 60, 3)), "right: images must be uint8 arrays, got float64"),
        (np.zeros((40, 60, 4), np.uint8), r"right: expected .* got shape \(40, 60, 4\)"),
        (np.zeros((0, 60, 3), np.uint8), "right: expected"),
        (None, "right: images must be uint8 arrays, got NoneType"),  # what cv2.imread gives for a bad file
    ],
)
def test_check_pair_refuses(picture, right, text):
    check_pair(picture, picture)
    with pytest.raises(ValueError, match=text):
        check_pair(picture, right)


def test_one_picture_twice_is_named(tmp_path, picture):
    """Byte by byte or in another format; one colour all over tells nothing of which file it is."""
    left, again = written(tmp_path / "l.png", picture), written(tmp_path / "again.bmp", picture)
    for right in (left, again):
        with pytest.raises(ValueError, match=rf"l\.png and \S+{right.name} are the same picture.*right camera's"):
            read_pair(left, right)
    plain = written(tmp_path / "plain.png", np.full_like(picture, 90))
    assert len(read_pair(plain, plain)) == 2
