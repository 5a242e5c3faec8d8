import numpy as np

from keyrecon.body import LSP14
from keyrecon.records import HalfKeyframes, Keyframes
from keyrecon.synthetic.marks import MarkOptions, mark_from_truth


def half(frames, n=20):
    return HalfKeyframes(
        frames=np.array(frames),
        nearest=np.full(n, frames[0]),
        represented=np.ones(n, bool),
        coverage=1.0,
        beta=0.1,
        distance=np.zeros(n),
        printed_count=len(frames),
    )


def test_marks_lie_on_the_asked_half_and_tell_the_nearer_end():
    rng = np.random.default_rng(0)
    points3d = rng.normal(size=(20, 14, 3))
    points2d = 100 * points3d[..., :2]
    keyframes = Keyframes(half([2, 7]), half([7]), reach=10, alpha=0.95)
    marks = mark_from_truth(keyframes, points2d, points3d, options=MarkOptions(noise=0.0))
    assert marks.frames.tolist() == [2, 7]
    assert np.isnan(marks.joints[0, list(LSP14.lower)]).all()
    assert np.allclose(marks.joints[1], points2d[7])
    for bone, (parent, child) in enumerate(LSP14.bones):
        nearer = points3d[7, child, 2] < points3d[7, parent, 2]
        assert marks.nearer[1, bone] == (1 if nearer else -1)
    assert not mark_from_truth(
        keyframes, points2d, points3d, options=MarkOptions(signs=False)
    ).nearer.any()
