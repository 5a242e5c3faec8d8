"""keyrecon: 3D motion of one athlete from one ordinary camera and a few annotated keyframes.

Conventions, the same everywhere:

- Pictures are RGB, x right, y down, pixel centres at integers.
- Space has the camera's axes: x right, y down, z away from the camera.
- Angles in radians, time in seconds, frames counted from 0 in presentation order of the
  (trimmed) video, quaternions as scipy orders them (x, y, z, w), unknown numbers NaN.

`prepare` does everything up to the point where a person is needed, `reconstruct` the rest:

    video = keyrecon.open_video("rally.mp4")
    preparation = keyrecon.prepare(video, picks)
    motion = keyrecon.reconstruct(preparation, annotations)
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from keyrecon.body import LSP14 as LSP14
    from keyrecon.body import Skeleton as Skeleton
    from keyrecon.errors import KeyreconError as KeyreconError
    from keyrecon.io.video import open_video as open_video
    from keyrecon.library import reconstruct as reconstruct
    from keyrecon.pipeline import Options as Options
    from keyrecon.pipeline import prepare as prepare
    from keyrecon.records import Annotations as Annotations
    from keyrecon.records import Motion as Motion
    from keyrecon.records import Pick as Pick
    from keyrecon.world.calibration import calibrate_court as calibrate_court

    __version__: str

_PUBLIC = {
    "KeyreconError": "keyrecon.errors",
    "open_video": "keyrecon.io.video",
    "prepare": "keyrecon.pipeline",
    "reconstruct": "keyrecon.library",
    "calibrate_court": "keyrecon.world.calibration",
    "Options": "keyrecon.pipeline",
    "Pick": "keyrecon.records",
    "Annotations": "keyrecon.records",
    "Motion": "keyrecon.records",
    "Skeleton": "keyrecon.body",
    "LSP14": "keyrecon.body",
}
__all__ = ["__version__", *_PUBLIC]


def __getattr__(name: str) -> Any:
    """Load a public name when it is first used, so that the import itself stays light."""
    if name == "__version__":
        return _version()
    if name not in _PUBLIC:
        raise AttributeError(f"module 'keyrecon' has no attribute '{name}'")
    return getattr(import_module(_PUBLIC[name]), name)


def _version() -> str:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("keyrecon")
    except PackageNotFoundError:
        return "0+unknown"
