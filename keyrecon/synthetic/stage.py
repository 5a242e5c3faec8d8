"""All that frames are drawn from, and the figure at any time between frames."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from keyrecon.synthetic.cameras import CameraMove
from keyrecon.synthetic.court import CourtPicture
from keyrecon.synthetic.figure import FigureSolids, Pointers, build_solids, unit
from keyrecon.synthetic.looks import Look
from keyrecon.synthetic.racket import Implement
from keyrecon.synthetic.shading import Light, Tiles


@dataclass(frozen=True, eq=False)
class Stage:
    """All that a frame is drawn from; frames can be drawn in any order."""

    points: Float[np.ndarray, "T 14 3"]
    """World, metres."""
    pointers: Pointers
    racket: Float[np.ndarray, "T 3 3"]
    """Fist, direction to the tip, direction across; see `racket.racket_frames`."""
    held: Implement
    """What the player swings."""
    move: CameraMove
    background: CourtPicture
    look: Look
    tiles: Tiles
    noise: Int[np.ndarray, "h w 3"]
    """Sensor noise, cut at another place for every frame."""
    exposure: float
    """Share of the time between frames that the shutter is open."""
    seed: int
    toes: Float[np.ndarray, "T 2 3"] | None = None
    """Captured ones, world, metres."""

    def in_camera(self, world: Float[np.ndarray, "*n 3"], frame: int) -> np.ndarray:
        """World points in the camera axes of a frame, metres."""
        return (world - self.move.center) @ self.move.rotation[frame].T

    def project(self, world: Float[np.ndarray, "*n 3"], frame: int) -> np.ndarray:
        """World points in the pixels of a frame."""
        local = self.in_camera(world, frame)
        return local[..., :2] / local[..., 2:] * self.move.focal[frame] + self.move.principal

    def light(self, frame: int) -> Light:
        """Sun and sky in the camera axes of a frame."""
        rotation, look = self.move.rotation[frame], self.look
        return Light(
            rotation @ np.array(look.sun), rotation[:, 1], look.sun_color, look.sunshine,
            look.court.outside,
        )  # fmt: skip


def pose_figure(stage: Stage, times: Float[np.ndarray, "S"]) -> FigureSolids:
    """Solids at times between frames."""
    low = np.minimum(times.astype(int), len(stage.points) - 2)
    share = times - low

    def at(values: np.ndarray) -> np.ndarray:
        weight = share.reshape(-1, *[1] * (values.ndim - 1))
        return values[low] * (1 - weight) + values[low + 1] * weight

    p = stage.pointers
    pointers = Pointers(
        unit(at(p.front)), unit(at(p.face)), unit(at(p.toes)), unit(at(p.racket)),
        unit(at(p.strings)), p.stature, p.left_handed,
    )  # fmt: skip
    return build_solids(at(stage.points), pointers, stage.look.build)
