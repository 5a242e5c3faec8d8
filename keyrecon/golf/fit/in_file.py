"""A swing that was fitted to a film, in every frame of the file and before the camera as it moved.

The film (`observe.film`) lacks frames of the file and stands still. Phases and places between the
fitted frames follow by interpolation; a frame that repeats another has its swing. The camera's
homographies are those of a turn and a zoom, so they turn the fitted swing in camera axes and bring
it closer or farther. Frames before and after the film hold its first and last posture, at a
confidence of 0: nothing was fitted to them.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation, Slerp

from keyrecon.golf.fit.residuals import project
from keyrecon.golf.fit.result import describe_fit
from keyrecon.golf.observe.film import Film
from keyrecon.golf.records import (
    Camera,
    CameraTurns,
    FittedSwing,
    Matches,
    MotionModel,
    Observations,
    RootPose,
    SwingFit,
    SwingState,
)
from keyrecon.numerics.geometry import unit_vectors, warp_points


def observations_in_file(observations: Observations, film: Film) -> Observations:
    """What was observed, in the frames and pictures of the file; masks and matches stay away."""
    back, nearest = np.linalg.inv(film.warps), np.rint(film.film_index).astype(int)
    shown = np.where(film.shows, 1.0, np.nan)[:, None, None]
    initial, camera = observations.initial, observations.camera
    clicked = film.frame_in_file(initial.frame)
    return replace(
        observations,
        camera=replace(camera, principal=camera.principal - film.corner),
        initial=replace(initial, frame=clicked, places=initial.places - film.corner),
        joints=shown * _warp(back, observations.joints[nearest]),
        spread=observations.spread[nearest],
        club=shown * _warp(back, observations.club[nearest]),
        club_spread=observations.club_spread[nearest],
        club_along=observations.club_along[nearest],
        foreground=tuple(
            warp_points(h, observations.foreground[k]) for h, k in zip(back, nearest, strict=True)
        ),
        silhouette_distance=np.zeros((0, 2, 2)),
        matches=Matches(np.zeros(0, np.int64), np.zeros((0, 2)), np.zeros((0, 2))),
        keys=film.keys_in_file(observations.keys),
        phase=np.interp(film.film_index, np.arange(len(observations.phase)), observations.phase),
    )


def _warp(
    homographies: Float[np.ndarray, "F 3 3"], points: Float[np.ndarray, "F n 2"]
) -> Float[np.ndarray, "F n 2"]:
    return warp_points(homographies[:, None], points)


def swing_in_file(
    fitted: FittedSwing,
    observations: Observations,
    film: Film,
    time: Float[np.ndarray, "F"],
    model: MotionModel,
) -> FittedSwing:
    """A fitted swing in every frame of the file; `time` is that of each, seconds of the world."""
    fit = SwingFit(model, fitted.body, _state_at(fitted.state, film.film_index))
    real = observations_in_file(observations, film)
    # Described before the camera of the film first, whose principal point the fit has.
    described = describe_fit(fit, replace(real, camera=observations.camera), time)
    described = replace(described, keys=film.keys_in_file(fitted.keys))
    turned = _follow_camera(described, film, observations.camera, real.camera)
    confidence = turned.motion.confidence * film.shows[:, None]
    motion = replace(turned.motion, keyframes=np.array([real.initial.frame]), confidence=confidence)
    return replace(turned, motion=motion)


def _state_at(state: SwingState, place: Float[np.ndarray, "F"]) -> SwingState:
    """A state between its frames."""
    frames = np.arange(len(state.phase))
    turns = Slerp(frames, Rotation.from_matrix(state.rotation))(place).as_matrix()
    position = np.stack([np.interp(place, frames, c) for c in state.position.T], axis=1)
    each, deviation = state.frame_coefficients, state.deviation
    return replace(
        state,
        phase=np.interp(place, frames, state.phase),
        rotation=turns,
        position=position,
        frame_coefficients=None if each is None else _between(each, place),
        deviation=None if deviation is None else _between(deviation, place),
    )


def _between(values: Float[np.ndarray, "T *n"], place: Float[np.ndarray, "F"]) -> np.ndarray:
    """Values of frames at places between them."""
    low = np.minimum(place.astype(int), len(values) - 2)
    share = (place - low).reshape(-1, *[1] * (values.ndim - 1))
    between: np.ndarray = (1 - share) * values[low] + share * values[low + 1]
    return between


def _follow_camera(
    fitted: FittedSwing, film: Film, standing: Camera, moving: Camera
) -> FittedSwing:
    """The swing in the axes of the camera as it turned and zoomed."""
    joints = fitted.motion.points3d
    turn, zoom = _camera_turns(np.linalg.inv(film.warps), joints, standing, moving)
    pelvis = np.einsum("tij,tj->ti", turn, fitted.pose.origins[:, 0])
    nearer = pelvis / zoom[:, None] - pelvis

    def follow(points: np.ndarray) -> np.ndarray:
        moved: np.ndarray = np.einsum("tij,tnj->tni", turn, points) + nearer[:, None]
        return moved

    pose = RootPose(follow(fitted.pose.origins), turn[:, None] @ fitted.pose.rotations)
    turns = None if film.still else CameraTurns(turn, nearer)
    joints, club = follow(joints), follow(fitted.club)
    pixels, ends = (
        project(p.reshape(-1, 3), moving)[0].reshape(*p.shape[:2], 2) for p in (joints, club)
    )
    scale = moving.focal / joints[..., 2].mean(axis=1)
    motion = replace(fitted.motion, points3d=joints, points2d=pixels, scale=scale)
    return replace(fitted, motion=motion, pose=pose, club=club, club2d=ends, camera=turns)


def _camera_turns(
    back: Float[np.ndarray, "F 3 3"],
    joints: Float[np.ndarray, "F n 3"],
    standing: Camera,
    moving: Camera,
) -> tuple[Float[np.ndarray, "F 3 3"], Float[np.ndarray, "F"]]:
    """Turn of every frame's camera from the film's, and its zoom, as the player shows them.

    `back` are homographies from the film's picture. A path that was fitted as a similarity is not
    that of any turn: the turn closest to its matrix shifts the picture by half of what it does. So
    the lines of sight to the player's joints are turned to where the homography has them.
    """
    pixels = project(joints.reshape(-1, 3), standing)[0].reshape(*joints.shape[:2], 2)
    there = warp_points(back[:, None], pixels)
    middle, new_middle = pixels.mean(axis=1, keepdims=True), there.mean(axis=1, keepdims=True)
    size = np.linalg.norm(pixels - middle, axis=(1, 2))
    zoom = np.linalg.norm(there - new_middle, axis=(1, 2)) / np.maximum(size, 1e-9)
    unzoomed = new_middle + (there - new_middle) / zoom[:, None, None]
    product = np.swapaxes(_sight(unzoomed, moving), 1, 2) @ _sight(pixels, standing)
    u, _, v = np.linalg.svd(product)
    u[..., 2] *= np.sign(np.linalg.det(u @ v))[:, None]
    return u @ v, zoom


def _sight(pixels: Float[np.ndarray, "F n 2"], camera: Camera) -> Float[np.ndarray, "F n 3"]:
    """Lines of sight through pixels."""
    return unit_vectors(np.insert((pixels - camera.principal) / camera.focal, 2, 1.0, axis=2))
