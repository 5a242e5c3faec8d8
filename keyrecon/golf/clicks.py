"""The few clicks that start a golf fit: joints of one frame, and what is known of the player.

The root, the head, both knees and both ankles suffice (Section 5.1 of the CVPR 2005 paper); any
joint of the Leeds skeleton may be added. `root` is the middle between the hips.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from keyrecon.body import LSP14
from keyrecon.errors import KeyreconError
from keyrecon.golf.records import Camera, InitialJoints

NEEDED = ("head_top", "root", "right_knee", "left_knee", "right_ankle", "left_ankle")
"""Without these nothing can be started; `root` may be given as both hips."""
STATURE = 1.75
"""Metres, where the file does not tell. A wrong one scales the motion; angles hardly depend on it,
and the paper used a rough estimate too (Section 5.2)."""
FOCAL = 1.2
"""Focal length where nobody knows it, picture widths: between a phone's (0.7 to 0.8) and a camera
that was zoomed in from behind the range."""
NEAREST_CAMERA = 2.5
"""Metres from the player to a camera that has all of a swing in its picture: hands and club reach
2.7 m high, and a phone's lens sees as much in an upright picture from there. A clip that is cropped
to the player seems nearer by its width, and perspective comes out too strong."""
ADDRESS_HEIGHT = 0.84
"""From the top of the head to the ankles of a player at address, statures: .84 to .85 in five real
swings whose joints were marked by eye."""
HEAD_DEPTH = 0.06
"""From the top of the head to its centre, player heights: half of a head's, an eighth."""
SHOULDERS = 0.2
"""Height of the middle between the shoulders, share of the way from the head's top to the feet:
roughly the shoulder line of `keyrecon.body`."""
STATURES = (0.8, 2.5)
"""Metres; players from four years on."""
FOCALS = (0.2, 60.0)
"""Focal lengths that lenses have, picture widths: from a fisheye's to a telescope's."""
LONGEST_CLICK_LIMB, SHORTEST_CLICK_LIMB = 0.45, 0.08
"""From the root to a knee and from a knee to its ankle, in heights from head to ankles. On six
real swings 0.20 to 0.33, marked by eye in any frame."""
TRUNK_SHARE = (0.3, 0.75)
"""From the top of the head to the root, likewise; on these swings 0.46 to 0.60."""
WIDEST_STANCE = 0.75
"""Between the ankles, likewise; on these swings at most 0.35."""
SHORTEST_PLAYER = 60.0
"""px from the head to the ankles: below it a shaft, 10 mm, is a third of a pixel."""


@dataclass(frozen=True)
class GolfClicks:
    """What a person clicked in one frame, and roughly knows about player and camera."""

    frame: int
    size: tuple[int, int]
    """Width and height of the pictures, px."""
    joints: Mapping[str, tuple[float, float]]
    """px by name: joints of the Leeds skeleton, and `root` between the hips."""
    hidden: tuple[str, ...] = ()
    """Joints that were clicked though something hides them: they are not tracked."""
    left_handed: bool = False
    stature: float = STATURE
    """Metres."""
    focal: float | None = None
    """px; None where unknown."""
    principal: tuple[float, float] | None = None
    """px; None for the middle of the picture."""


@dataclass(frozen=True, eq=False)
class ClickedPose:
    """The player in the clicked frame, as the stages need it."""

    joints: InitialJoints
    hidden: tuple[str, ...]
    """Joints that are not tracked."""
    size: tuple[int, int]
    """Width and height of the pictures, px."""
    left_handed: bool
    stature: float
    """Metres."""
    camera: Camera
    mirrored: bool = False
    """Whether left and right were exchanged: a left-hander is seen as a right-hander."""

    def has(self, name: str) -> bool:
        """Whether a joint was clicked, or follows from others."""
        return name in self.joints.names or name == "root"

    def place(self, name: str) -> Float[np.ndarray, "2"]:
        """Where a joint was clicked; `root` also from both hips."""
        if name == "root" and name not in self.joints.names:
            return (self.place("right_hip") + self.place("left_hip")) / 2
        return self.joints.places[self.joints.names.index(name)]

    @property
    def frame(self) -> int:
        """The clicked frame."""
        return self.joints.frame

    @property
    def feet(self) -> Float[np.ndarray, "2"]:
        """Between the ankles, px."""
        return (self.place("right_ankle") + self.place("left_ankle")) / 2

    @property
    def head(self) -> Float[np.ndarray, "2"]:
        """Centre of the head, px: below its top, towards the neck or the root."""
        top = self.place("head_top")
        below = self.place("neck" if self.has("neck") else "root") - top
        return top + HEAD_DEPTH * self.height * below / np.linalg.norm(below)

    @property
    def shoulders(self) -> Float[np.ndarray, "2"]:
        """Roughly the middle between the shoulders, px."""
        top = self.place("head_top")
        return top + SHOULDERS * (self.feet - top)

    @property
    def height(self) -> float:
        """From the top of the head to between the ankles, px."""
        return float(np.linalg.norm(self.place("head_top") - self.feet))


def clicked_pose(clicks: GolfClicks) -> ClickedPose:
    """The pose that was clicked, before a camera as far as it is known."""
    width, height = clicks.size
    principal = clicks.principal or ((width - 1) / 2, (height - 1) / 2)
    pose = ClickedPose(
        joints=InitialJoints(
            clicks.frame, tuple(clicks.joints), np.array(list(clicks.joints.values()), float)
        ),
        hidden=clicks.hidden,
        size=clicks.size,
        left_handed=clicks.left_handed,
        stature=clicks.stature,
        camera=Camera(clicks.focal or FOCAL * width, np.array(principal, float)),
    )
    if clicks.focal:
        return pose
    least = NEAREST_CAMERA * pose.height / (ADDRESS_HEIGHT * clicks.stature)
    camera = replace(pose.camera, focal=max(pose.camera.focal, least))
    return replace(pose, camera=camera)


def check_clicks(clicks: GolfClicks, n_frames: int, size: tuple[int, int]) -> None:
    """Raises KeyreconError where clicks do not belong to a video of this length and size."""
    if clicks.size != size:
        turned = " (on its side)" if clicks.size == size[::-1] else ""
        raise KeyreconError(
            f"The clicks were made on pictures of {clicks.size[0]} x {clicks.size[1]} px, but this "
            f"video has {size[0]} x {size[1]}{turned}; click again in this video."
        )
    if not 0 <= clicks.frame < n_frames:
        raise KeyreconError(
            f"The clicks are on frame {clicks.frame}, but the video has frames 0 to {n_frames - 1}."
        )


def check_numbers(clicks: GolfClicks, origin: str) -> None:
    """Stature, focal length, principal point and size as players and cameras have them.

    Raises KeyreconError that names `origin`, the file they come from.
    """
    if min(clicks.size) < 1:
        raise KeyreconError(
            f"{origin}: pictures of {clicks.size[0]} x {clicks.size[1]} px do not exist; "
            "'size' is width and height of the video's pictures."
        )
    if not STATURES[0] <= clicks.stature <= STATURES[1]:
        raise KeyreconError(
            f"{origin}: the stature is {clicks.stature:g}, but it is the player's height in "
            f"metres, {STATURES[0]:g} to {STATURES[1]:g}; leave it out where it is not known."
        )
    shares = np.array(FOCALS) * clicks.size[0]
    if clicks.focal is not None and not shares[0] <= clicks.focal <= shares[1]:
        raise KeyreconError(
            f"{origin}: the focal length is {clicks.focal:g} px, but for pictures "
            f"{clicks.size[0]} px wide lenses have {shares[0]:.0f} to {shares[1]:.0f}; leave it "
            "out where it is not known."
        )
    if clicks.principal is not None:
        middle = np.array(clicks.principal) / clicks.size
        if not (np.abs(middle - 0.5) <= 1).all():
            raise KeyreconError(
                f"{origin}: the principal point ({clicks.principal[0]:g}, "
                f"{clicks.principal[1]:g}) is far outside the picture; leave it out where it is "
                "not known."
            )


def check_joints(clicks: GolfClicks, origin: str) -> None:
    """The joints that a start needs, inside the picture, the right way up, of one person.

    Raises KeyreconError that names `origin`, the file they come from.
    """
    known = {*LSP14.names, "root"}
    if strange := sorted(set(clicks.joints) - known):
        raise KeyreconError(
            f"{origin} clicks '{strange[0][:40]}', which is no joint; use "
            f"{', '.join(sorted(known))}."
        )
    given = set(clicks.joints) | (
        {"root"} if {"right_hip", "left_hip"} <= set(clicks.joints) else set()
    )
    if missing := [name for name in NEEDED if name not in given]:
        raise KeyreconError(f"{origin} lacks a click on {' and '.join(missing)}; add it.")
    if strange := sorted(set(clicks.hidden) - set(clicks.joints)):
        raise KeyreconError(f"{origin}: '{strange[0]}' is hidden but was not clicked; click it.")
    for name, (x, y) in clicks.joints.items():
        if not (0 <= x < clicks.size[0] and 0 <= y < clicks.size[1]):
            raise KeyreconError(
                f"{origin}: the click on {name} at ({x:g}, {y:g}) is outside the picture of "
                f"{clicks.size[0]} x {clicks.size[1]} px."
            )
    _check_posture(clicked_pose(clicks), origin)


def _check_posture(pose: ClickedPose, origin: str) -> None:
    if pose.height < SHORTEST_PLAYER:
        raise KeyreconError(
            f"{origin}: head and ankles are only {pose.height:.0f} px apart; the player must be "
            f"at least {SHORTEST_PLAYER:.0f} px tall. Check the clicks or crop the video."
        )
    aside, down = np.abs(pose.feet - pose.place("head_top"))
    if aside > down:
        raise KeyreconError(
            f"{origin}: the player lies on the side from head to ankles; turn the video upright "
            "and click again."
        )
    head, root, feet = pose.place("head_top")[1], pose.place("root")[1], pose.feet[1]
    if not head < root < feet:
        raise KeyreconError(
            f"{origin}: head, middle of the hips (root) and ankles must be clicked "
            f"from top to bottom, but they are at y = {head:g}, {root:g} and {feet:g}; click the "
            "address posture again."
        )
    for first, second, (least, most) in _LIMB_BOUNDS:
        length = float(np.linalg.norm(pose.place(first) - pose.place(second))) / pose.height
        if not least <= length <= most:
            raise KeyreconError(
                f"{origin}: {first} and {second} are {length:.2f} of the player's height apart, "
                f"where one person has {least:g} to {most:g}; click all joints of one player."
            )


_LIMB = (SHORTEST_CLICK_LIMB, LONGEST_CLICK_LIMB)
_LIMB_BOUNDS = (
    ("head_top", "root", TRUNK_SHARE), ("root", "right_knee", _LIMB), ("root", "left_knee", _LIMB),
    ("right_knee", "right_ankle", _LIMB), ("left_knee", "left_ankle", _LIMB),
    ("right_ankle", "left_ankle", (0.0, WIDEST_STANCE)),
)  # fmt: skip
