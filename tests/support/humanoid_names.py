"""Bones of the exported humanoid whose heads are joints of the Leeds Sports Pose."""

JOINTS = {
    "Neck": "neck", "RightUpLeg": "right_hip", "RightLeg": "right_knee",
    "RightFoot": "right_ankle", "LeftUpLeg": "left_hip", "LeftLeg": "left_knee",
    "LeftFoot": "left_ankle", "RightArm": "right_shoulder", "RightForeArm": "right_elbow",
    "RightHand": "right_wrist", "LeftArm": "left_shoulder", "LeftForeArm": "left_elbow",
    "LeftHand": "left_wrist",
}  # fmt: skip
