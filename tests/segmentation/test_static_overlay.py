"""What is laid over the picture is told from the scene by how the camera moves."""

import cv2
import numpy as np
import pytest

from keyrecon.records import CameraPath
from keyrecon.segmentation.background_model import median_background
from keyrecon.segmentation.foreground_model import ForegroundModel
from keyrecon.segmentation.static_overlay import find_overlay

SIZE = 200, 360
PANEL = np.zeros(SIZE, bool)
PANEL[150:178, 40:130] = True


def scene():
    """A lawn with lines, larger than the picture."""
    rng = np.random.default_rng(3)
    ground = cv2.GaussianBlur(rng.integers(60, 190, (300, 700, 3)).astype(np.float32), (0, 0), 6)
    ground = (120 + 4 * (ground - 125)).clip(0, 255).astype(np.uint8)
    cv2.line(ground, (0, 150), (700, 150), (240, 128, 128), 3)
    cv2.line(ground, (350, 0), (250, 300), (240, 128, 128), 3)
    return ground


def pan(shifts, panel=True):
    """Pictures of a camera that looks aside, and their homographies to the first."""
    pictures, paths = [], []
    for shift in shifts:
        place = np.array([[1.0, 0, 60 + shift], [0, 1, 40 + 0.1 * shift], [0, 0, 1]])
        picture = cv2.warpPerspective(
            scene(), place, SIZE[::-1], flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        )
        if panel:
            picture[PANEL] = (20, 128, 128)
            cv2.putText(
                picture, "40 - 15", (46, 172), cv2.FONT_HERSHEY_SIMPLEX, 0.6, (250, 128, 128), 2
            )
        pictures.append(picture)
        paths.append(place)
    return pictures, np.linalg.inv(paths[0]) @ np.array(paths)


def overlay_of(pictures, paths, free=None):
    everywhere = [np.ones(SIZE, bool)] * len(pictures)
    return find_overlay(pictures, everywhere if free is None else free, paths, 1.0)


@pytest.mark.parametrize(
    "shifts", [range(0, 120, 8), [0] * 10 + [5, 12, 20, 28]], ids=["pan", "late"]
)
def test_a_panel_that_stays_while_the_camera_pans_is_found(shifts):
    found = overlay_of(*pan(shifts))
    assert (found & PANEL).sum() > 0.95 * PANEL.sum()
    assert (found & ~PANEL).sum() < 0.15 * PANEL.sum()


def test_lines_along_the_way_of_the_camera_are_no_overlay():
    assert not overlay_of(*pan(range(0, 120, 8), panel=False)).any()


def test_a_static_camera_tells_nothing_of_overlays():
    assert not overlay_of(*pan([0] * 12)).any()


def test_a_player_whom_the_camera_follows_is_no_overlay():
    pictures, paths = pan(range(0, 120, 8), panel=False)
    player = np.zeros(SIZE, bool)
    player[60:160, 150:200] = True
    for picture in pictures:
        picture[player] = (90, 180, 160)
        picture[70:150:6, 150:200] = (200, 100, 100)
    assert overlay_of(pictures, paths).any()
    assert not overlay_of(pictures, paths, [~player] * len(pictures)).any()


def test_what_is_behind_a_panel_is_not_seen_and_what_is_beside_it_is():
    shifts = range(0, 120, 8)
    pictures, paths = pan(shifts)
    everywhere = [np.ones(SIZE, bool)] * len(pictures)
    overlay = overlay_of(pictures, paths)
    background = median_background(pictures, everywhere, paths, 1.0, overlay=overlay)
    model = ForegroundModel(background, CameraPath(paths, np.ones(len(paths))))
    picture = pictures[-1].copy()
    player = np.zeros(SIZE, bool)
    player[100:195, 80:100] = True
    picture[player & ~PANEL] = (130, 200, 180)
    seen = model.foreground(picture, len(pictures) - 1, np.eye(3)) > 0.5
    near = cv2.dilate(PANEL.astype(np.uint8), np.ones((9, 9))) > 0
    assert not (seen & PANEL).any()
    assert (seen & player & ~near).sum() > 0.95 * (player & ~near).sum()
    assert (seen & ~player).sum() < 0.01 * seen.size
