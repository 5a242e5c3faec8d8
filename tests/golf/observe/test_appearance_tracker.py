import cv2
import numpy as np

from keyrecon.golf.observe.appearance_tracker import track_patch

HEIGHT = 200.0


def cloth(seed=0):
    """A Lab picture with folds of all sizes."""
    rng = np.random.default_rng(seed)
    layers = [cv2.resize(rng.uniform(0, 255, (n, n, 3)), (240, 240)) for n in (8, 20, 50)]
    return (0.5 * layers[0] + 0.3 * layers[1] + 0.2 * layers[2]).astype(np.uint8)


def moved(picture, shift, turn=0.0, about=(120, 120)):
    matrix = cv2.getRotationMatrix2D(about, -np.degrees(turn), 1.0)
    matrix[:, 2] += shift
    return cv2.warpAffine(picture, matrix, picture.shape[1::-1], borderMode=cv2.BORDER_REFLECT)


def track(pictures, weights=None):
    everywhere = [np.full(p.shape[:2], 255, np.uint8) for p in pictures]
    return track_patch(pictures, weights or everywhere, np.array([120.0, 120.0]), HEIGHT, 30.0)


def test_a_patch_is_tracked_to_a_fraction_of_a_pixel():
    way = np.stack([2.5 * np.arange(20), 8 * np.sin(np.arange(20) / 4)], axis=1)
    path = track([moved(cloth(), s) for s in way])
    assert np.abs(path.places - [120, 120] - way).max() < 0.5


def test_the_turn_of_a_patch_is_told():
    turns = np.linspace(0, 0.6, 20)
    path = track([moved(cloth(), (0, 0), turn) for turn in turns])
    assert np.abs(path.turns - turns).max() < 0.03


def test_what_passes_over_a_patch_is_lost_and_does_not_drag_it_along():
    pictures = [moved(cloth(), (t, 0)) for t in range(30)]
    for t in range(8, 26):
        x = 60 + 6 * (t - 8)
        pictures[t][:, x : x + 9] = (20, 128, 128)
    path = track(pictures)
    assert abs(path.places[-1, 0] - 149) < 1.5
    assert path.confidence[:6].min() > 0.95


def test_the_scene_around_the_player_does_not_count():
    pictures, weights = [], []
    for t in range(20):
        scene = cloth(5)
        x = 100 + t
        scene[100:140, x : x + 40] = cloth()[100:140, 100:140]
        weight = np.zeros(scene.shape[:2], np.uint8)
        weight[100:140, x : x + 40] = 255
        pictures.append(scene)
        weights.append(weight)
    path = track(pictures, weights)
    assert np.abs(path.places[:, 0] - 120 - np.arange(20)).max() < 1


def test_a_patch_that_slides_off_the_player_is_unsure():
    pictures = [moved(cloth(), (3 * t, 0)) for t in range(15)]
    weights = [np.full(p.shape[:2], 255, np.uint8) for p in pictures]
    for weight in weights:
        weight[:, 140:] = 0
    assert track(pictures).confidence[-1] > 0.8
    assert track(pictures, weights).confidence[-1] < 0.4
