"""Small BVH files."""

import numpy as np
from scipy.spatial.transform import Rotation

LIMBS = (  # name, parent, offset in centimetres of a person of 1.75 m who faces +Z
    ("Hips", None, (0, 0, 0)),
    ("Neck", "Hips", (0, 53, 0)),
    ("Head", "Neck", (0, 10, 0)),
    ("Head end", "Head", (0, 20, 0)),
    *(
        row
        for side, out in (("Right", -1), ("Left", 1))
        for row in (
            (f"{side}Arm", "Neck", (17 * out, -2, 0)),
            (f"{side}ForeArm", f"{side}Arm", (30 * out, 0, 0)),
            (f"{side}Hand", f"{side}ForeArm", (26 * out, 0, 0)),
            (f"{side}UpLeg", "Hips", (10 * out, 0, 0)),
            (f"{side}Leg", f"{side}UpLeg", (0, -43, 0)),
            (f"{side}Foot", f"{side}Leg", (0, -43, 0)),
            (f"{side}Foot end", f"{side}Foot", (0, -8, 15)),
        )
    ),
)


def bvh_text(frames=12, order="ZXY", scale=1.0, rows=LIMBS, axes=(0, 1, 2), seed=0):
    """A BVH file of `rows`, written by recursion, and its points by a slow walk over the tree."""
    rng = np.random.default_rng(seed)
    names = [name for name, _, _ in rows]
    turns = {n: rng.uniform(-25, 25, (frames, 3)) for n in names if not n.endswith(" end")}
    shift = rng.uniform(0, 100, (frames, 3)) * scale
    columns = []

    def block(name, offset, depth):
        pad = "  " * depth
        x, y, z = (offset[a] * scale * (-1 if axes != (0, 1, 2) and k == 1 else 1)
                   for k, a in enumerate(axes))  # fmt: skip
        if name.endswith(" end"):
            return [f"{pad}End Site", f"{pad}{{", f"{pad}  OFFSET {x} {y} {z}", f"{pad}}}"]
        root = depth == 0
        words = ["Xposition", "Yposition", "Zposition"] * root + [f"{a}rotation" for a in order]
        columns.extend([shift] * root + [turns[name]])
        lines = [
            f"{pad}{'ROOT' if root else 'JOINT'} {name}",
            f"{pad}{{",
            f"{pad}  OFFSET {x} {y} {z}",
            f"{pad}  CHANNELS {len(words)} {' '.join(words)}",
        ]
        for child, parent, own in rows:
            if parent == name:
                lines += block(child, own, depth + 1)
        return [*lines, f"{pad}}}"]

    lines = ["HIERARCHY", *block(rows[0][0], rows[0][2], 0), "MOTION"]
    values = np.concatenate(columns, axis=1)
    lines += [f"Frames: {frames}", "Frame Time: 0.0083333"]
    lines += [" ".join(f"{v:.8f}" for v in row) for row in values]
    places = {}
    for t in range(frames):
        world = {}
        for name, parent, offset in rows:
            own = (
                Rotation.from_euler(order, turns[name][t], degrees=True)
                if name in turns
                else Rotation.identity()
            )
            if parent is None:
                world[name] = (shift[t], own)
            else:
                place, turn = world[parent]
                world[name] = (place + turn.apply(np.array(offset) * scale), turn * own)
        for name in names:
            places.setdefault(name, []).append(world[name][0])
    return "\n".join(lines), {n: np.array(p) for n, p in places.items()}
