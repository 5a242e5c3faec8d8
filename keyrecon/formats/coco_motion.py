"""COCO keypoints JSON of every frame: the refined 2D joints, for 2D tools and evaluations."""

import json
from pathlib import Path

import numpy as np

from keyrecon.durable import write_durably
from keyrecon.formats.coco import annotations_to_coco
from keyrecon.records import SOURCES, Annotations, Motion


def write_coco_motion(path: Path, motion: Motion, size: tuple[int, int]) -> None:
    """Write the joints of all frames, px; `size` is the picture's width and height.

    v is 2 where a joint was seen (annotated or propagated) and 1 where it was computed from
    others; confidence and source of every joint stand in `attributes`.
    """
    seen = np.isin(motion.source, [SOURCES.index("annotated"), SOURCES.index("propagated")])
    frames = np.arange(len(motion.time))
    signs = np.zeros((len(frames), len(motion.skeleton.bones)), dtype=np.int64)
    data = annotations_to_coco(
        Annotations(motion.skeleton, frames, motion.points2d, seen, signs), size
    )
    for frame, row in enumerate(data["annotations"]):
        row["keypoints"] = [round(number, 2) for number in row["keypoints"]]
        row["attributes"] = {
            "confidence": motion.confidence[frame].round(4).tolist(),
            "source": [SOURCES[s] for s in motion.source[frame]],
        }
    write_durably(path, json.dumps(data, allow_nan=False))
