"""What the report is made from."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from keyrecon.records import Annotations, Comparison, Keyframes, Motion, Track
from keyrecon.report.summary import Truth, arrange_truth
from keyrecon.video import Video


@dataclass(frozen=True, eq=False)
class ReportMaterial:
    """Everything that one run knows; the truth only where there is one."""

    video: Video
    track: Track
    comparison: Comparison
    keyframes: Keyframes
    annotations: Annotations
    motion: Motion
    seconds: Mapping[str, float] = field(default_factory=dict)
    """How long each stage took that was run, seconds."""
    truth: Mapping[str, np.ndarray] | None = None
    """Joints as they really were, frame for frame, as `metrics.read_truth` gives them."""
    options: object = None
    """The options record of the run, to be listed."""

    @cached_property
    def true_joints(self) -> Truth | None:
        """The truth in the order of the skeleton."""
        return None if self.truth is None else arrange_truth(self.truth, self.motion.skeleton)
