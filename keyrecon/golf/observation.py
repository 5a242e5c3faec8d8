"""Everything that is observed of a swing before the motion model is fitted to it.

The player's masks and what may be his club (`scene`) together tell where the swing is
(`fit.swing_search`), and the club of each swing that it may be when it passes its key postures. One
pass over reduced pictures, all at once in memory, tracks joints and matches points of the player's
surface. What a person marked holds throughout (`marks`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from keyrecon.errors import KeyreconError
from keyrecon.golf.clicks import ClickedPose
from keyrecon.golf.fit.handedness import (
    mirror_evidence,
    mirror_initial,
    mirror_marks,
    mirror_pixels,
)
from keyrecon.golf.fit.residuals import SILHOUETTE_STEP
from keyrecon.golf.fit.swing_path import SearchLimits
from keyrecon.golf.fit.swing_search import SwingEvidence, SwingHypothesis, search_swing
from keyrecon.golf.marks import (
    correct_tracks,
    hold_keys,
    hold_observations,
    hold_shafts,
    place_marks,
)
from keyrecon.golf.observe.appearance_tracker import AppearanceOptions
from keyrecon.golf.observe.club import Club, ClubOptions, track_club
from keyrecon.golf.observe.film import Film, frame_step
from keyrecon.golf.observe.foreground import Foreground, FrameForeground
from keyrecon.golf.observe.joint_tracks import track_joints
from keyrecon.golf.observe.point_matches import MatchOptions, match_points
from keyrecon.golf.observe.shaft_hypotheses import ShaftHypotheses
from keyrecon.golf.observe.swing_events import (
    TimingOptions,
    interpolate_times,
    refine_key_frames,
)
from keyrecon.golf.prior.skeleton import size_body
from keyrecon.golf.records import Camera, Matches, MotionModel, Observations, SwingMarks
from keyrecon.golf.scene import SwingScene, SwingSceneOptions
from keyrecon.io.frame_reader import read_small, side_by_side
from keyrecon.io.video import Video
from keyrecon.numerics.geometry import unit_vectors
from keyrecon.progress import Progress, silent
from keyrecon.segmentation.color_model import to_lab

CLUB_SPREAD = 0.006
"""Standard deviation of the club across its shaft, player heights: a shaft's width. Chosen on
rendered swings, like all values here; see benchmarks/golf.py."""
TIP_SPREAD, HIDDEN_TIP_SPREAD, HEAD_SPREAD = 0.02, 0.12, 0.1
"""The same along it, of a hand end where the hands are, of one where the shaft may go on behind
the player, and of the head end, which contrast often cuts short."""
INTO_HANDS = 0.025
"""From where the shaft leaves the hands to between them, player heights: half a fist's breadth."""
PICTURE_RIM = 0.02
"""A head end nearer to the picture's border may lie outside, player heights."""
LEAST_AREA = 2 / 3
"""Share of the usual area of a whole mask; a player who turns shows no less."""
MASK_STEP = 0.03
"""Distance between samples of the mask, player heights: a forearm's width."""


@dataclass(frozen=True)
class ObservationOptions:
    """How a video of a swing is observed."""

    scene: SwingSceneOptions = field(default_factory=SwingSceneOptions)
    """The player, and what may be his club."""
    club: ClubOptions = field(default_factory=ClubOptions)
    """How the club moves."""
    timing: TimingOptions = field(default_factory=TimingOptions)
    """Key postures."""
    appearance: AppearanceOptions = field(default_factory=AppearanceOptions)
    """Head, knees and ankles."""
    matches: MatchOptions = field(default_factory=MatchOptions)
    """Points of the surface."""


@dataclass(frozen=True, eq=False)
class SwingCandidate:
    """A swing that may be in a film: its club and its key postures."""

    club: Float[np.ndarray, "T 2 2"]
    club_along: Float[np.ndarray, "T 2"]
    keys: Float[np.ndarray, "4"]
    phase: Float[np.ndarray, "T"]
    cost: float
    """How badly the search found it to explain the film."""

    def of(self, observations: Observations) -> Observations:
        """The observations if this is the swing."""
        return hold_observations(replace(
            observations, club=self.club, club_along=self.club_along, keys=self.keys,
            phase=self.phase,
        ))  # fmt: skip


@dataclass(frozen=True, eq=False)
class ObservedFilm:
    """What is observed in a film, and the swings that it may show."""

    film: Film
    """The frames that were observed."""
    slow_motion: float
    """By how much the film is slowed down beyond what was told."""
    observations: Observations
    """Those of the likeliest swing."""
    candidates: tuple[SwingCandidate, ...]
    """The likeliest first."""


def observe_swing(
    video: Video,
    film: Film,
    scene: SwingScene,
    pose: ClickedPose,
    marks: SwingMarks,
    model: MotionModel,
    options: ObservationOptions = ObservationOptions(),
    progress: Progress = silent,
) -> ObservedFilm:
    """Observations of the frames of a film of a video, and the swings in it.

    `scene` is what the film shows, `pose` and `marks` are those of the file's frames. Raises
    KeyreconError where no swing is observed.
    """
    whole, placed = film.open(video), place_in_film(pose, film)
    players, height = scene.players, scene.foreground.height
    evidence = SwingEvidence(players, scene.foreground.shrink, height, scene.shafts, film.fps)
    found = _search(evidence, placed, place_marks(marks, film), model, whole.width)
    slow_motion = find_slow_motion(found[0].keys, film.fps)
    chosen = np.arange(0, len(whole), frame_step(film.fps * slow_motion))
    film = film.take(chosen, slow_motion)
    own = place_marks(marks, film)
    kept = _Kept(
        replace(scene.foreground, likely=scene.foreground.likely[chosen]), players[chosen],
        hold_shafts([scene.shafts[t] for t in chosen], own), place_in_film(pose, film), own, film,
    )  # fmt: skip
    candidates = tuple(_candidate(h, kept, chosen, model, options) for h in found)
    observations = _observe(film.open(video), kept, candidates[0], options, progress)
    return ObservedFilm(film, slow_motion, observations, candidates)


@dataclass(frozen=True, eq=False)
class _Kept:
    """What was observed in the frames that are fitted."""

    foreground: Foreground
    players: Bool[np.ndarray, "T h w"]
    shafts: list[ShaftHypotheses]
    pose: ClickedPose
    marks: SwingMarks
    film: Film


def place_in_film(pose: ClickedPose, film: Film) -> ClickedPose:
    """A clicked pose in the picture and by the frame numbers of a film."""
    joints, camera = pose.joints, pose.camera
    frame = round(float(film.place[joints.frame]))
    return replace(
        pose,
        joints=replace(joints, frame=frame, places=joints.places + film.corner),
        camera=replace(camera, principal=camera.principal + film.corner),
        size=film.size,
    )


SLOW_DOWNSWING = 0.27
"""Seconds that a downswing is thought to take where its length shows slow motion: between those of
tour players and of others."""


def find_slow_motion(keys: Float[np.ndarray, "4"], fps: float) -> float:
    """By how much a film is slowed down in which a swing has these key postures; 1 if it is not."""
    down = float(keys[2] - keys[1]) / fps
    return down / SLOW_DOWNSWING if down > SearchLimits().downswing[1] else 1.0


def _search(
    evidence: SwingEvidence,
    pose: ClickedPose,
    marks: SwingMarks,
    model: MotionModel,
    width: int,
) -> list[SwingHypothesis]:
    """Swings that a film may show, in the film's own picture; left-handers are mirrored."""
    joints, camera = pose.joints, pose.camera
    if pose.left_handed:
        evidence = mirror_evidence(evidence, width)
        joints, marks = mirror_initial(joints, width), mirror_marks(marks, width)
        camera = Camera(camera.focal, mirror_pixels(camera.principal, width))
    body = size_body(pose.stature)
    found = search_swing(evidence, joints, camera, model, body, marks=marks)
    if not found and np.isfinite(marks.keys).any():
        raise KeyreconError(
            "No swing of a pace that golfers have passes start, top, hit and finish where they "
            f"were marked (frames {', '.join(f'{k:.0f}' for k in marks.keys if np.isfinite(k))} of "
            "the fitted ones); correct these marks, or take some back."
        )
    if not found:
        raise KeyreconError(
            f"There is no swing in this video: its {len(evidence.players)} frames are too few for "
            "one. Give a video with a whole swing, from the address to the finish."
        )
    if pose.left_handed:
        found = [replace(h, club=mirror_pixels(h.club, width)) for h in found]
    return found


def _candidate(
    hypothesis: SwingHypothesis,
    kept: _Kept,
    chosen: Int[np.ndarray, "T"],
    model: MotionModel,
    options: ObservationOptions,
) -> SwingCandidate:
    """A hypothesis with the club that was detected where it has it, and key postures by that."""
    foreground, fps = kept.foreground, kept.film.fps
    step = int(chosen[1] - chosen[0]) if len(chosen) > 1 else 1
    club = track_club(kept.shafts, foreground.height, fps, options.club, hypothesis.club[chosen])
    shaft = _describe_club(club, foreground.height, kept.film.size)
    keys = refine_key_frames(club, hypothesis.keys / step, foreground.height, fps, options.timing)
    keys = hold_keys(keys, kept.marks)
    phase = interpolate_times(keys, model.keys, len(chosen))
    return SwingCandidate(shaft.ends, shaft.along, keys, phase, hypothesis.cost)


def _observe(
    video: Video,
    kept: _Kept,
    candidate: SwingCandidate,
    options: ObservationOptions,
    progress: Progress,
) -> Observations:
    """Everything that does not depend on which swing it is, and the likeliest swing."""
    foreground, pose, players = kept.foreground, kept.pose, list(kept.players)
    width = foreground.likely.shape[2]
    pictures = [to_lab(p) for p in progress(read_small(video, width), "Reading", len(video))]
    tracks = track_joints(pictures, foreground, pose, video.fps, options.appearance, progress)
    whole = find_whole(players)
    return candidate.of(Observations(
        camera=pose.camera,
        initial=pose.joints,
        height=pose.height,
        stature=pose.stature,
        joints=correct_tracks(tracks.joints, kept.marks, pose.frame),
        spread=tracks.spread,
        club=candidate.club,
        club_spread=np.full(len(video), CLUB_SPREAD * foreground.height),
        club_along=candidate.club_along,
        foreground=tuple(
            _sample_mask(player & there, foreground)
            for player, there in zip(players, whole, strict=True)
        ),
        silhouette_distance=np.stack(
            [
                _silhouette_distance(foreground.frame(t), player) * np.float32(there)
                for t, (player, there) in enumerate(zip(players, whole, strict=True))
            ]
        ),
        matches=_match_all([p[..., 0] for p in pictures], players, foreground, options.matches),
        keys=candidate.keys,
        phase=candidate.phase,
        left_handed=pose.left_handed,
        marks=kept.marks,
    ))  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Shaft:
    """The club where it was detected, px."""

    ends: Float[np.ndarray, "T 2 2"]
    along: Float[np.ndarray, "T 2"]
    """Standard deviation of both ends along the shaft."""


def _describe_club(club: Club, height: float, size: tuple[int, int]) -> _Shaft:
    """Ends between the hands and at the head; `size` is that of the pictures."""
    ends = np.where(club.detected[:, None, None], club.ends, np.nan)
    unit = unit_vectors(ends[:, 1] - ends[:, 0], 1e-9)
    ends[:, 0] -= INTO_HANDS * height * unit
    rim = PICTURE_RIM * height
    inside = ((ends[:, 1] > rim) & (ends[:, 1] < np.array(size) - rim)).all(axis=1)
    hands = np.where(club.tip, TIP_SPREAD, HIDDEN_TIP_SPREAD) * height
    return _Shaft(ends, np.stack([hands, np.where(inside, HEAD_SPREAD * height, np.inf)], axis=1))


def find_whole(players: Sequence[Bool[np.ndarray, "h w"]]) -> Bool[np.ndarray, "T"]:
    """Frames whose mask has all of the player: one with clothes of the scene's colour loses parts.

    What such a mask leaves out is no reason to move the player elsewhere.
    """
    areas = np.array([player.sum() for player in players])
    return areas > LEAST_AREA * np.median(areas)


def _sample_mask(
    player: Bool[np.ndarray, "h w"], foreground: Foreground
) -> Float[np.ndarray, "n 2"]:
    """Points of a grid on the player, px of the video."""
    step = max(1, round(MASK_STEP * foreground.height * foreground.shrink))
    y, x = np.nonzero(player[step // 2 :: step, step // 2 :: step])
    places = np.stack([x, y], axis=1) * step + step // 2
    return (places - (foreground.shrink - 1) / 2) / foreground.shrink


def _silhouette_distance(
    foreground: FrameForeground, player: Bool[np.ndarray, "h w"]
) -> Float[np.ndarray, "y x"]:
    """Distance to the player in px of the video, on a coarser grid."""
    outside = (~(player | (foreground.mask() > 0))).astype(np.uint8)
    distance: Float[np.ndarray, "h w"] = cv2.distanceTransform(outside, cv2.DIST_L2, 3)
    rows, columns = (max(2, round(s / foreground.shrink / SILHOUETTE_STEP)) for s in outside.shape)
    return cv2.resize(distance / foreground.shrink, (columns, rows), interpolation=cv2.INTER_AREA)


def _match_all(
    pictures: Sequence[UInt8[np.ndarray, "h w"]],
    players: Sequence[Bool[np.ndarray, "h w"]],
    foreground: Foreground,
    options: MatchOptions,
) -> Matches:
    """Points of the surface matched in the next frame, px of the video."""
    height = foreground.height * foreground.shrink

    def match(t: int) -> tuple[np.ndarray, np.ndarray]:
        return match_points(pictures[t], pictures[t + 1], players[t], height, options)

    pairs = list(side_by_side(match, range(len(pictures) - 1)))
    shift = (foreground.shrink - 1) / 2
    start, end = (
        (np.concatenate([p[k] for p in pairs]) - shift) / foreground.shrink for k in (0, 1)
    )
    return Matches(np.repeat(np.arange(len(pairs)), [len(p[0]) for p in pairs]), start, end)
