"""The player followed through the shots of a video, each shot by itself.

Camera, scene and tracks of one shot say nothing of the next. What the player looks like does:
colours are learnt once, and tell which shots show the player at all.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Bool

from keyrecon.io.held_video import hold_if_small
from keyrecon.io.video import Video
from keyrecon.keeping import Keep, work_on_each
from keyrecon.progress import Progress, silent
from keyrecon.records import (
    Annotations,
    CameraPath,
    Colors,
    Edges,
    FlowTracks,
    Pick,
    Shots,
    Track,
    TrackAnchors,
    TrackVerification,
)
from keyrecon.segmentation.background_model import BackgroundOptions, build_background
from keyrecon.segmentation.color_model import picked_height
from keyrecon.segmentation.contours import EdgeOptions, find_edges
from keyrecon.timeline import (
    join_frames,
    part_of_anchors,
    part_of_marks,
    part_of_path,
    part_of_picks,
    scatter_edges,
    scatter_frames,
)
from keyrecon.tracking.detection import FindOptions, find_player
from keyrecon.tracking.mark_flow import FlowOptions, track_marked_joints
from keyrecon.tracking.scale import SizeEvidence, with_standing_height
from keyrecon.tracking.shot_sorting import (
    PlayerDetection,
    ShotOptions,
    detect_in_shot,
    numbered_shots,
    sort_shots,
)
from keyrecon.tracking.tracker import TrackOptions, track_player
from keyrecon.tracking.tracklets import linked_to_player
from keyrecon.tracking.verification import verify_track

HELD = 1e9
"""Bytes of a shot's decoded frames that are kept in memory while its stages read them: 28 s of
1280 x 720 at 25 frames per second, a quarter of what a match may take."""


@dataclass(frozen=True)
class FollowOptions:
    """Options of the stages that follow the player."""

    shots: ShotOptions = field(default_factory=ShotOptions)
    find: FindOptions = field(default_factory=FindOptions)
    background: BackgroundOptions = field(default_factory=BackgroundOptions)
    track: TrackOptions = field(default_factory=TrackOptions)
    edges: EdgeOptions = field(default_factory=EdgeOptions)


@dataclass(frozen=True, eq=False)
class FollowedPlayer:
    """The player in the usable shots, these put end to end."""

    shots: Shots
    """All shots of the file."""
    track: Track
    edges: tuple[Edges, ...]
    verification: TrackVerification
    """What the video says of the track, in frames of the file."""


@dataclass(frozen=True, eq=False)
class _Shot:
    """Inputs of the stages for one shot."""

    name: str
    """Appended to those of its stages; nothing for the only one."""
    first: int
    """Frame of the file that it begins with."""
    video: Video
    camera: CameraPath
    colors: Colors
    anchors: TrackAnchors
    picks: tuple[Pick, ...]
    """What a person clicked or marked in it."""

    def linked(self, track: Track) -> Bool[np.ndarray, "T"]:
        """Frames in which a track is joined to the player who was told."""
        heads = [pick for pick in self.picks if pick.part == "head"]
        frames = np.array([pick.frame for pick in heads], dtype=np.int64)
        places = np.array([(pick.x, pick.y) for pick in heads]).reshape(-1, 2)
        return linked_to_player(track, self.camera, frames, places, self.video.fps)

    def joined_part(self, track: Track, linked: Bool[np.ndarray, "T"], envelope: float) -> Track:
        """A track that is sure of nothing where it is not `linked`, nor has the size of who is
        there; `envelope` as in the options of the tracker."""
        if linked.all():
            return track
        joined = replace(track, confidence=track.confidence * linked)
        window = round(envelope * self.video.fps)
        evidence = SizeEvidence.of(self.camera, self.video, self.anchors)
        return with_standing_height(joined, evidence, window, joined.confidence > 0)


def follow_player(
    video: Video,
    camera: CameraPath,
    colors: Colors,
    clicks: Sequence[Pick],
    anchors: TrackAnchors,
    options: FollowOptions,
    keep: Keep,
    progress: Progress = silent,
) -> FollowedPlayer:
    """Sort the shots, and follow the player through the usable ones.

    Raises KeyreconError where the player is not found, or a shot is named that there is not.
    """
    shots = Shots.between(camera.cuts, len(video))
    asked = numbered_shots(options.shots.use, len(shots.parts))
    numbered_shots(options.shots.skip, len(shots.parts))
    if not camera.cuts:
        only = _Shot("", 0, video, camera, colors, anchors, tuple(clicks))
        detected = keep(
            "find", find_player, video, colors, camera, anchors,
            options=options.find, progress=progress,
        )  # fmt: skip
        return FollowedPlayer(shots, *_follow(only, detected, options, keep, progress))
    each = [_shot(part, video, camera, colors, clicks, anchors) for part in shots.parts]
    detections = _detect_each(each, asked, options.find, keep, progress)
    picked = np.array([bool(shot.picks) for shot in each])
    shots = sort_shots(shots, detections, picked, video.fps, options.shots, camera.dissolves)
    usable = np.flatnonzero(shots.usable).tolist()
    found = [_found(detections[number]) for number in usable]
    followed = _follow_each([each[number] for number in usable], found, options, keep, progress)
    return FollowedPlayer(shots, *followed)


def _detect_each(
    shots: Sequence[_Shot],
    asked: set[int],
    options: FindOptions,
    keep: Keep,
    progress: Progress,
) -> list[PlayerDetection]:
    """What was found of the player in each shot; in those that are `asked` for by number a person
    vouches for the player, however few frames show the head."""

    def sight(number: int) -> PlayerDetection:
        shot = shots[number]
        shown = hold_if_small(shot.video, HELD)
        return keep(
            f"find{shot.name}", detect_in_shot, shown, shot.colors, shot.camera, shot.anchors,
            options=replace(options, detected=0.0) if number in asked else options,
            progress=silent,
        )  # fmt: skip

    looked = work_on_each(keep, sight, range(len(shots)))
    return [*progress(looked, "Looking for the player in each shot", len(shots))]


def _found(sighting: PlayerDetection) -> Track:
    assert sighting.track is not None  # a usable shot has one
    return sighting.track


def _shot(
    part: slice,
    video: Video,
    camera: CameraPath,
    colors: Colors,
    clicks: Sequence[Pick],
    anchors: TrackAnchors,
) -> _Shot:
    """One of several shots; a player who is clicked or marked in it has the size that is told."""
    picks = part_of_picks(clicks, part)
    sized = {pick.frame for pick in picks if pick.part == "head"}
    sized &= {pick.frame for pick in picks if pick.part == "foot"}
    return _Shot(
        f"@{part.start}",
        part.start,
        video.part(part),
        part_of_path(camera, part),
        replace(colors, height=picked_height(picks)) if sized else colors,
        part_of_anchors(anchors, part),
        tuple(picks),
    )


def _follow_each(
    shots: Sequence[_Shot],
    detected: Sequence[Track],
    options: FollowOptions,
    keep: Keep,
    progress: Progress,
) -> tuple[Track, tuple[Edges, ...], TrackVerification]:
    """As `_follow` of several shots put end to end, the verification in frames of the file."""

    def follow(number: int) -> tuple[Track, tuple[Edges, ...], TrackVerification]:
        return _follow(shots[number], detected[number], options, keep, silent)

    tracks: list[Track] = []
    edges: list[Edges] = []
    verified: list[TrackVerification] = []
    followed = work_on_each(keep, follow, range(len(shots)))
    shown = progress(followed, "Following the player in each shot", len(shots))
    for shot, (track, found, of_track) in zip(shots, shown, strict=True):
        tracks.append(track)
        edges += found
        verified.append(replace(of_track, frames=of_track.frames + shot.first))
    return join_frames(tracks), tuple(edges), join_frames(verified)


def _follow(
    shot: _Shot, detected: Track, options: FollowOptions, keep: Keep, progress: Progress
) -> tuple[Track, tuple[Edges, ...], TrackVerification]:
    """Track and edges of a shot in which the player was found, and what speaks for the track."""
    joined = shot.linked(detected)
    detected = shot.joined_part(detected, joined, options.find.envelope)
    video = hold_if_small(shot.video, HELD)
    background = keep(
        f"background{shot.name}", build_background, video, shot.camera, detected, shot.colors,
        options=options.background, progress=progress,
    )  # fmt: skip
    track = keep(
        f"track{shot.name}", track_player, video, detected, shot.camera, background,
        shot.colors, shot.anchors, options=options.track, progress=progress,
    )  # fmt: skip
    seen, linked = track.confidence > 0, shot.linked(track)
    track = shot.joined_part(track, linked, options.track.envelope)
    edges = keep(
        f"edges{shot.name}", find_edges, video, track, shot.camera, background, shot.colors,
        options=options.edges, progress=progress,
    )  # fmt: skip
    verification = keep(
        f"verify{shot.name}", verify_track, video, track, shot.camera, background,
        shot.colors, shot.anchors, progress=progress,
    )  # fmt: skip
    player = np.flatnonzero(linked & (joined | (track.confidence > 0)))
    if len(player) < len(edges):  # of somebody else nothing is carried
        edges = scatter_edges([edges[t] for t in player], player, len(edges))
    unlinked = (seen & ~linked)[verification.frames]
    return track, edges, replace(verification, unlinked=unlinked)


def follow_marks(
    video: Video,
    marks: Annotations,
    shots: Shots,
    options: FlowOptions,
    keep: Keep,
    progress: Progress,
) -> FlowTracks:
    """Marked joints followed by optical flow within the shots that have any."""
    if len(shots.parts) == 1:
        return keep("flow", track_marked_joints, video, marks, options=options, progress=progress)
    inside = [np.arange(part.start, part.stop) for part in shots.parts]
    shot_marks = [part_of_marks(marks, frames) for frames in inside]
    marked = [n for n, own in enumerate(shot_marks) if np.isfinite(own.joints).any()]

    def track(number: int) -> FlowTracks:
        part = shots.parts[number]
        return keep(
            f"flow@{part.start}", track_marked_joints, video.part(part), shot_marks[number],
            options=options, progress=silent,
        )  # fmt: skip

    followed = work_on_each(keep, track, marked)
    flows = [*progress(followed, "Following marks in each shot", len(marked))]
    frames = [inside[number] for number in marked]
    return scatter_frames(join_frames(flows), np.concatenate(frames), len(video))
