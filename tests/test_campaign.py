"""A small share of benchmarks/campaign.py: damaged files, commands with them, absurd options."""

import subprocess
import sys
from pathlib import Path

import pytest

CAMPAIGN = Path(__file__).parent.parent / "benchmarks" / "campaign.py"


@pytest.mark.skipif(sys.platform != "linux", reason="limits of memory are Linux's")
def test_a_campaign_finds_nothing():
    asked = ["--files", "63", "--commands", "4", "--options", "4", "--seed", "1"]
    ran = subprocess.run([sys.executable, CAMPAIGN, *asked], capture_output=True, text=True)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    for name in ("bvh", "c3d", "motion", "journal", "commands", "options"):
        assert f"\n{name} " in f"\n{ran.stdout}"
