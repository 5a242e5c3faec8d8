from dataclasses import replace

import numpy as np
import pytest
from drawn_player import HEIGHT, SHOE, film, picks

from keyrecon.errors import KeyreconError
from keyrecon.records import Colors, Pick
from keyrecon.segmentation.color_model import (
    color_bins,
    distinct_parts,
    grow_patch,
    learn_colors,
    look_up,
    posterior_tables,
    to_lab,
)


@pytest.fixture(scope="module")
def video(tmp_path_factory):
    return film(tmp_path_factory.mktemp("film") / "player.mp4", 4)


def test_a_click_stands_for_its_material_and_does_not_leak():
    picture = np.full((60, 80, 3), 90, np.uint8)
    picture[20:40, 30:50] = (200, 40, 40)
    patch = grow_patch(to_lab(picture), Pick(0, "shirt", 40.0, 30.0), 200.0)
    assert patch[22:38, 32:48].all()
    assert not patch[:19].any()
    assert not patch[:, 51:].any()


def test_a_click_on_a_large_even_surface_stays_near_the_click():
    lab = to_lab(np.full((200, 200, 3), 90, np.uint8))
    patch = grow_patch(lab, Pick(0, "foot", 100.0, 100.0), 100.0)
    rows, columns = np.nonzero(patch)
    assert np.hypot(rows - 100, columns - 100).max() <= 6


def test_a_part_is_told_from_the_surroundings(video):
    colors = learn_colors(video, picks(4))
    tables = posterior_tables(colors)
    red, green = (
        color_bins(to_lab(np.array([[c]], np.uint8)))[0, 0] for c in ((200, 40, 40), (60, 120, 80))
    )
    shirt = tables[colors.names.index("shirt")]
    assert shirt[red] > 0.9
    assert shirt[green] < 0.05


def test_looking_up_colours_takes_the_entry_of_each_pixel():
    rng = np.random.default_rng(0)
    bins, tables = rng.integers(0, 20, (3, 4)).astype(np.uint16), rng.random((2, 20))
    assert np.array_equal(look_up(tables, bins), tables[:, bins])
    assert np.array_equal(look_up(tables[0], bins), tables[0][bins])


def test_a_click_beneath_the_sole_still_teaches_the_shoe(video):
    below = [replace(p, y=p.y + 0.07 * HEIGHT) if p.part == "foot" else p for p in picks(4)]
    tables = posterior_tables(learn_colors(video, below))
    shoe, floor = (
        color_bins(to_lab(np.array([[c]], np.uint8)))[0, 0] for c in (SHOE, (60, 120, 80))
    )
    foot = tables[1]
    assert foot[shoe] > 0.9
    assert foot[floor] < 0.1


def test_histograms_are_shares(video):
    colors = learn_colors(video, picks(4))
    assert colors.histograms.sum(axis=1) == pytest.approx(1, abs=1e-3)


def test_the_players_size_is_the_length_from_head_to_mid_feet(video):
    assert learn_colors(video, picks(4)).height == pytest.approx(88)


def test_a_head_of_skin_is_no_colour_of_its_own_beside_skin(video):
    colors = learn_colors(video, picks(4))
    groups = distinct_parts(colors)
    assert colors.names.index("head") not in groups
    assert colors.names.index("skin") in groups


def test_parts_of_one_colour_count_as_one():
    white, red = np.zeros(8), np.zeros(8)
    white[0], red[1] = 1, 1
    colors = Colors(("head", "foot", "shirt", "socks"), np.stack([red, white, red * 0.9, white]),
                    np.full(8, 0.1), 100.0)  # fmt: skip
    assert sorted(map(sorted, distinct_parts(colors).values())) == [[1, 3], [2]]


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ([Pick(9, "head", 10.0, 10.0)], "frames 0 to 3"),
        ([Pick(0, "head", 400.0, 10.0)], "outside the picture of 320 x 180"),
        ([Pick(0, "foot", 10.0, 10.0)], "head is not picked in any frame; pick its centre"),
        ([Pick(0, "head", 10.0, 10.0)], "pick both shoes"),
        ([Pick(0, "head", 10.0, 10.0), Pick(1, "foot", 10.0, 90.0)], "No frame has both"),
    ],
)
def test_a_pick_that_cannot_be_used_is_named(video, wrong, message):
    with pytest.raises(KeyreconError, match=message):
        learn_colors(video, wrong)
