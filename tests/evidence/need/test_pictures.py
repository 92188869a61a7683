"""The picture of the cell for the reports."""

from gates.pages.figures import LARGEST_PHOTO_BYTES
from genpolicy.evidence.need.pictures import HEIGHT_PX, WIDTH_PX, scene_png


def test_the_picture_of_the_cell_is_the_same_twice_and_says_nothing_else():
    data = scene_png("tabletop_insertion")
    assert data == scene_png("tabletop_insertion")
    assert data.startswith(b"\x89PNG") and len(data) < LARGEST_PHOTO_BYTES
    assert int.from_bytes(data[16:20]) == WIDTH_PX and int.from_bytes(data[20:24]) == HEIGHT_PX
    assert b"tEXt" not in data and b"tIME" not in data
