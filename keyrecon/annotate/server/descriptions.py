"""What the page must know of a project: the video, the skeleton and the keyframes."""

from typing import Any

from keyrecon.annotate.store.cells import Cells, of_kind
from keyrecon.body import Skeleton
from keyrecon.io.video import Video
from keyrecon.records import Keyframes

Json = dict[str, Any]


def describe_video(video: Video, name: str) -> Json:
    """Name, size and times."""
    return {
        "name": name,
        "n_frames": len(video),
        "fps": video.fps,
        "time": [round(t, 4) for t in video.time.tolist()],
        "width": video.width,
        "height": video.height,
    }


def describe_skeleton(skeleton: Skeleton) -> Json:
    """Joints, limbs named by their outer joint, halves, mirrored pairs, and the guided order."""
    names, lower = skeleton.names, skeleton.is_lower
    return {
        "joints": list(names),
        "parents": list(skeleton.parents),
        "limbs": [
            {
                "name": names[child],
                "parent": names[parent],
                "child": names[child],
                "half": "lower" if lower[child] else "upper",
            }
            for parent, child in skeleton.bones.tolist()
        ],
        "order": [names[joint] for joint in guided_order(skeleton)],
        "halves": {
            half: [n for n, low in zip(names, lower, strict=True) if low == (half == "lower")]
            for half in ("upper", "lower")
        },
        "mirror": [[names[left], names[right]] for left, right in skeleton.mirrored],
    }


def guided_order(skeleton: Skeleton) -> list[int]:
    """Joints from the head down the arms, then down the legs, each limb from the trunk outwards."""
    chains = [
        _chain(skeleton, joint)
        for joint, parent in enumerate(skeleton.parents)
        if parent == skeleton.root
    ]
    chains.sort(key=lambda chain: (skeleton.is_lower[chain[0]], len(chain)))
    head = len(chains[0]) if chains and len(chains[0]) == 1 else 0
    order = [joint for chain in chains for joint in chain]
    return [*order[:head], skeleton.root, *order[head:]]


def _chain(skeleton: Skeleton, joint: int) -> list[int]:
    """A joint and all that hang on it."""
    children = [c for c, parent in enumerate(skeleton.parents) if parent == joint]
    return [joint, *(outer for child in children for outer in _chain(skeleton, child))]


def halves_by_frame(keyframes: Keyframes | None) -> dict[int, str]:
    """Which half of the body each keyframe asks for."""
    if keyframes is None:
        return {}
    upper, lower = ({*half.frames.tolist()} for half in (keyframes.upper, keyframes.lower))
    return {
        frame: "both" if frame in upper & lower else "upper" if frame in upper else "lower"
        for frame in sorted(upper | lower)
    }


def halves_marked(cells: Cells, skeleton: Skeleton) -> dict[int, str]:
    """Which half of the body has marks on each frame that has any."""
    found: dict[int, str] = {}
    for _, frame, joint in of_kind(cells, "mark"):
        half = "lower" if skeleton.is_lower[skeleton.index(joint)] else "upper"
        found[frame] = join_halves(found.get(frame), half)
    return found


def describe_keyframes(
    keyframes: Keyframes | None, cells: Cells, skeleton: Skeleton, known: Json
) -> list[Json]:
    """All frames to annotate: those chosen, the person's own, and others that bear marks."""
    asked, marked = halves_by_frame(keyframes), halves_marked(cells, skeleton)
    own = {int(key[1]): half for key, half in of_kind(cells, "own").items()}
    asked |= {frame: half for frame, half in marked.items() if frame not in asked}
    counts = _represented(keyframes)
    return [
        {
            "frame": frame,
            "half": join_halves(asked.get(frame), own.get(frame)),
            "stands_for": counts.get(frame, 0),
            "why": "",
            "own": frame in own,
            "locked": ("lock", frame) in cells,
            **known.get(frame, {}),
        }
        for frame in sorted({*asked, *own})
    ]


def join_halves(one: str | None, other: str | None) -> str:
    """What two requests for a frame, not both empty, ask for together."""
    found = {one, other} - {None}
    return found.pop() if len(found) == 1 else "both"


def _represented(keyframes: Keyframes | None) -> dict[int, int]:
    """For how many frames each keyframe stands, in either half."""
    if keyframes is None:
        return {}
    counts = {}
    for frame in keyframes.frames.tolist():
        counts[frame] = int(
            ((keyframes.upper.nearest == frame) | (keyframes.lower.nearest == frame)).sum()
        )
    return counts
