"""netCDF in the layout of the movement package (Sirmpilatze et al.), dims of its version 0.17."""

from pathlib import Path

import numpy as np

from keyrecon import __version__
from keyrecon.errors import KeyreconError
from keyrecon.io.durable import write_durably
from keyrecon.io.formats.camera_file import WORLDS
from keyrecon.io.formats.conventions import WITH_WORLD, World, describe_times
from keyrecon.records import SOURCES, Motion


def write_netcdf(path: Path, motion: Motion, world: World = None) -> str:
    """Write `position` (time, space, keypoint, individual) and `confidence`, plus `source`.

    Camera axes; metres or body heights as the attribute `space_unit` says, times as `times` says
    and as is returned. With joints in the `world` there is `position_world` besides, whose axes
    and unit are its own attributes. Raises KeyreconError without xarray, h5netcdf and h5py.
    """
    try:
        import h5netcdf  # noqa: F401
        import h5py  # noqa: F401
        import xarray
    except ImportError as fault:
        raise KeyreconError(
            "Writing netCDF needs xarray, h5netcdf and h5py; install them with: "
            "pip install 'keyrecon[netcdf]'"
        ) from fault
    dims, in_space = ("time", "keypoint", "individual"), ("time", "space", "keypoint", "individual")
    data = xarray.Dataset(
        {
            "position": (in_space, motion.points3d.transpose(0, 2, 1)[..., None]),
            "confidence": (dims, motion.confidence[..., None]),
            "source": (dims, motion.source[..., None].astype(np.int8)),
        },
        coords={
            "time": motion.time,
            "space": ["x", "y", "z"],
            "keypoint": list(motion.skeleton.names),
            "individual": ["athlete"],
        },
        attrs={
            "fps": motion.fps,
            "time_unit": "seconds",
            "times": describe_times(motion),
            "space_unit": motion.units,
            "axes": "relative to the camera: x right, y down, z away",
            "source_software": f"keyrecon {__version__}",
            "source_names": ", ".join(SOURCES),
            "ds_type": "poses",
        },
    )
    if world is not None:
        attributes = {"units": "m", "axes": WORLDS[world.origin]}
        placed = world.points.transpose(0, 2, 1)[..., None]
        data["position_world"] = (in_space, placed, attributes)
    write_durably(path, bytes(data.to_netcdf(engine="h5netcdf")))
    return f"camera axes{WITH_WORLD if world is not None else ''}; {describe_times(motion)}"
