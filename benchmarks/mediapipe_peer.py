"""MediaPipe Pose over a video: run by an interpreter that has mediapipe, never by keyrecon.

    python mediapipe_peer.py VIDEO OUT.npz

Writes `points3d` (metres, hips at the origin), `points2d` (px) and `joint_names` of the joints
that MediaPipe shares with keyrecon; frames without a person are NaN.
"""

import sys

import cv2
import mediapipe
import numpy as np

JOINTS = {
    "left_shoulder": 11,
    "right_shoulder": 12,
    "left_elbow": 13,
    "right_elbow": 14,
    "left_wrist": 15,
    "right_wrist": 16,
    "left_hip": 23,
    "right_hip": 24,
    "left_knee": 25,
    "right_knee": 26,
    "left_ankle": 27,
    "right_ankle": 28,
}


def follow(path: str) -> tuple[np.ndarray, np.ndarray]:
    """Joints in space and in the picture, in every frame of a video."""
    space, flat = [], []
    reader = cv2.VideoCapture(path)  # noqa: TID251 - keyrecon is not at hand here
    with mediapipe.solutions.pose.Pose(model_complexity=1) as pose:
        while True:
            more, picture = reader.read()
            if not more:
                return np.array(space), np.array(flat)
            found = pose.process(picture[..., ::-1])
            size = picture.shape[1], picture.shape[0]
            space.append(_pick(found.pose_world_landmarks, 3))
            flat.append(_pick(found.pose_landmarks, 2) * size)


def _pick(landmarks: object, axes: int) -> np.ndarray:
    if landmarks is None:
        return np.full((len(JOINTS), axes), np.nan)
    rows = [landmarks.landmark[index] for index in JOINTS.values()]
    return np.array([[row.x, row.y, row.z] for row in rows])[:, :axes]


if __name__ == "__main__":
    points3d, points2d = follow(sys.argv[1])
    np.savez(sys.argv[2], points3d=points3d, points2d=points2d, joint_names=list(JOINTS))
