"""CSV: one row per frame, everything that is known of every joint in its own columns."""

from pathlib import Path

import numpy as np

from keyrecon.io.durable import write_durably
from keyrecon.io.formats.camera_file import WORLDS
from keyrecon.io.formats.conventions import WITH_WORLD, World, describe_times
from keyrecon.records import SOURCES, Motion


def write_csv(path: Path, motion: Motion, first_frame: int = 0, world: World = None) -> str:
    """Write a table that pandas reads with `read_csv(path, comment="#")`.

    Unknown numbers are empty. The comment lines on top say units, axes and times; returns the
    latter two. `first_frame` is the video's frame that comes first; with joints in the `world`
    every joint has three columns more.
    """
    names = motion.skeleton.names
    head = [
        "# keyrecon motion, relative to the camera",
        f"# x, y, z: {motion.units}, camera axes (x right, y down, z away from the camera)",
        "# u, v: px (u right, v down, pixel centres at integers)",
        f"# confidence: 0 to 1; source: one of {' '.join(SOURCES)}",
        "# frame: the video's, from 0 in presentation order; time: seconds",
        f"# {describe_times(motion)}",
    ]
    columns = ["x", "y", "z", "u", "v", "confidence"]
    known = [motion.points3d, motion.points2d, motion.confidence[..., None]]
    if world is not None:
        head[0] += " (x, y, z) and in the world (world_x, world_y, world_z)"
        columns += ["world_x", "world_y", "world_z"]
        known.append(world.points)
        head.insert(2, f"# world_x, world_y, world_z: m, {WORLDS[world.origin]}")
    columns.append("source")
    head.append(",".join(["frame", "time", *(f"{n}_{c}" for n in names for c in columns)]))
    numbers = np.concatenate(known, axis=2)
    nowhere = np.isnan(motion.points3d).any(axis=2) & (motion.confidence == 0)
    sources = np.where(nowhere, "", np.array(SOURCES)[motion.source])
    rows = []
    for frame, (values, source) in enumerate(zip(numbers, sources, strict=True)):
        cells = [str(first_frame + frame), f"{motion.time[frame]:.6f}"]
        for joint, origin in zip(values, source, strict=True):
            cells += ["" if np.isnan(v) else f"{v:.6g}" for v in joint]
            cells.append(origin)
        rows.append(",".join(cells))
    write_durably(path, "\n".join(head + rows) + "\n")
    return f"camera axes{WITH_WORLD if world is not None else ''}; {describe_times(motion)}"
