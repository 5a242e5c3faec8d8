import cv2
import numpy as np
import pytest

from keyrecon.numerics.viterbi import TransitionModel, find_cheapest_track
from keyrecon.pipeline import as_printed
from keyrecon.segmentation.part_evidence import Evidence
from keyrecon.tracking.candidates import PartCandidates, search_frame
from keyrecon.tracking.detection import FindOptions, head_costs

TALL = 96.0


def two_heads(trunk: tuple[int, int]) -> Evidence:
    """Heads at (60, 60) and (180, 60) above bodies alike; the player's shirt lies at `trunk`."""
    head, player, shirt = (np.zeros((160, 240), np.float32) for _ in range(3))
    for x in (60, 180):
        cv2.circle(head, (x, 60), 6, 1.0, -1)
        cv2.rectangle(player, (x - 12, 70), (x + 12, 120), 1.0, -1)
    cv2.circle(shirt, trunk, 12, 1.0, -1)
    blurred = cv2.GaussianBlur(head, (0, 0), 1.5)
    return Evidence(blurred, head * 0, player, cv2.integral(player), cv2.integral(shirt))


@pytest.mark.parametrize("trunk", [(60, 86), (42, 78), (78, 78), (86, 60)])
def test_of_two_heads_alike_one_has_the_player_s_shirt_beneath_or_aslant(trunk):
    found = search_frame(two_heads(trunk), TALL)
    ours = np.abs(found.heads[:, 0] - 60) < 3
    assert found.trunk[ours].max() > 0.8
    assert found.trunk[~ours].max() < 0.05


def test_without_a_word_of_the_trunk_nothing_is_said_of_it():
    evidence = two_heads((60, 86))
    silent = Evidence(evidence.head, evidence.foot, evidence.player, evidence.inside)
    assert np.isnan(search_frame(silent, TALL).trunk).all()


def test_who_stands_in_other_clothes_is_not_taken_for_the_player_who_runs_past():
    places = np.append(np.arange(0, 240, 8.0), np.arange(240, -1, -8.0))
    heads = [np.array([[x, 60.0], [16.0, 52.0]]) for x in places]

    def seen(trunk: float) -> list[PartCandidates]:
        feet = np.zeros((0, 2)), np.zeros(0)
        shares = np.array([trunk, 0.0])
        return [PartCandidates(h, np.array([0.05, 0.07]), *feet, shares) for h in heads]

    def taken(candidates: list[PartCandidates], options: FindOptions = FindOptions()) -> np.ndarray:
        states = [h[:, None] for h in heads]
        costs = head_costs(candidates, options.other_trunk)
        return find_cheapest_track(costs, states, TransitionModel(12.0, 30))

    assert (taken(seen(0.0)) == 1).mean() > 0.9
    assert (taken(seen(0.6)) == 0).all()
    assert (taken(seen(np.nan)) == 1).mean() > 0.9
    assert (taken(seen(0.6), as_printed().find) == 1).mean() > 0.9  # the paper has no such test
