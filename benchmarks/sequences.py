"""The rendered sequences that everything is measured on, described in one place.

Motion capture of tennis strokes (not part of the project; see --mocap) under cameras, looks
and resolutions that differ in everything a user's video may differ in.
"""

from dataclasses import dataclass
from pathlib import Path

from keyrecon.app.console import show
from keyrecon.synthetic.cameras import CameraPlanOptions, View
from keyrecon.synthetic.clips import JoinOptions
from keyrecon.synthetic.sequence import SceneOptions, SynthOptions, synthesize

DATA = Path(__file__).parent.parent.parent / "shared" / "data"


@dataclass(frozen=True)
class Sequence:
    """One rendered video with known truth."""

    name: str
    mocap: tuple[str, ...]
    camera: str
    pan: bool
    seed: int
    width: int = 1280
    player: int = 350
    """Standing height in the picture, px."""
    seconds: float = 36.0
    fps: float = 50


FH, BH, SERVE = "jarua_Derecha_18seg", "jarua_Reves", "jarua_Servicio"
FH2, VOLLEY, SERVE2 = "adorozco_Derecha", "adorozco_VDerecha", "adorozco_Servicio"

TENNIS = (
    Sequence("ground-back-static", (FH, BH), "back", False, 1, player=400),
    Sequence("ground-oblique-pan", (FH, BH), "oblique", True, 2),
    Sequence("serve-side-static", (SERVE,), "side", False, 3),
    Sequence("serve-back-pan", (SERVE,), "back", True, 4, player=300),
    Sequence("mixed-front-static", (FH2, SERVE2), "front", False, 5, player=450),
    Sequence("mixed-side-pan", (FH2, SERVE2), "side", True, 6),
    Sequence("volley-above-static", (VOLLEY, FH2), "above", False, 7, player=250),
    Sequence("all-oblique-small", (BH, VOLLEY, SERVE2), "oblique", False, 8, 640, 170),
)

SECOND = (
    Sequence("jdescobar-back", ("jdescobar_Derecha", "jdescobar_Reves"), "back", False, 21, fps=30),
    Sequence("jduribe-side-pan", ("jduribe_Derecha", "jduribe_VReves"), "side", True, 22, fps=25),
    Sequence(
        "jjmarin-oblique", ("jjmarin_Servicio", "jjmarin_Reves"), "oblique", False, 23, fps=30
    ),
    Sequence("jpmoreno-front-pan", ("jpmoreno_Derecha", "jpmoreno_Servicio"), "front", True, 24),
    Sequence(
        "jsgiraldo-back-pan", ("jsgiraldo_Reves", "jsgiraldo_Servicio"), "back", True, 25, fps=25
    ),
    Sequence("jsguevara-side", ("jsguevara_Reves_10seg", "jsguevara_Servicio"), "side", False, 26),
    Sequence(
        "secheverri-above", ("secheverri_Derecha", "secheverri_Reves"), "above", False, 27, fps=30
    ),
    Sequence(
        "mixed-oblique-pan",
        ("jpmoreno_VDerecha", "jdescobar_Servicio", "jsgiraldo_Derecha"),
        "oblique",
        True,
        28,
        960,
        200,
        fps=30,
    ),
)
"""Seven players that the first table does not have, other looks and cameras, at the rates of
broadcast and phones. Nobody looks at these while a constant is set."""

OTHER = (
    Sequence("dance", ("cmu_05_12_daz",), "oblique", False, 11, seconds=10.0),
    Sequence("soccer-kick", ("cmu_10_06_daz",), "side", False, 12, seconds=4.0),
    Sequence("jumping-jacks", ("cmu_13_30_daz",), "front", False, 13, seconds=20.0),
)


def mocap_files(sequence: Sequence, folder: Path = DATA / "mocap") -> list[Path]:
    """The motion-capture files of a sequence."""
    found = [next(folder.glob(f"*/{name}.bvh"), None) for name in sequence.mocap]
    if None in found:
        raise SystemExit(
            f"No motion capture for {sequence.name} under {folder}; give its folder with --mocap."
        )
    return found


def options_of(sequence: Sequence) -> SynthOptions:
    """What a sequence is rendered with."""
    size = sequence.width, round(sequence.width * 9 / 16)
    camera = CameraPlanOptions(View(sequence.camera), sequence.pan, *size, float(sequence.player))
    clips = JoinOptions(sequence.seconds, sequence.fps)
    return SynthOptions(SceneOptions(sequence.seed, camera), clips)


def render(sequence: Sequence, work: Path, mocap: Path) -> Path:
    """The folder of the rendered sequence; rendered if it is not there."""
    folder = work / sequence.name
    if not (folder / "truth.npz").is_file():
        synthesize(folder, mocap_files(sequence, mocap), options_of(sequence), show)
    return folder
