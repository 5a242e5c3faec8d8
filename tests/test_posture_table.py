"""Facts about the posture table of the lifting prior (benchmarks/posture_table.py)."""

import sys
from pathlib import Path

import numpy as np
import pytest

from keyrecon.lifting.priors import anatomy

ROOT = Path(__file__).parents[1]
CAPTURES = ROOT.parent / "shared" / "data" / "mocap" / "cmu"


@pytest.mark.skipif(not CAPTURES.is_dir(), reason="no motion capture in ../shared/data/mocap")
def test_the_table_is_what_the_captures_give(monkeypatch, capsys):
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    monkeypatch.setattr(sys, "argv", ["posture_table.py"])
    import posture_table

    posture_table.main()
    printed = {"np": np}
    exec(capsys.readouterr().out, printed)  # it is printed as the module holds it
    for name in ("_MEAN", "_COVARIANCE"):
        held = getattr(anatomy, name)
        assert printed[name].keys() == held.keys()
        for kind, values in held.items():
            np.testing.assert_array_equal(printed[name][kind], values)
