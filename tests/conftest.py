"""Small videos with known frames, shared by the tests."""

import os
import shutil
from fractions import Fraction

import av
import pytest
import shape_checks
from filelock import FileLock
from numbered_pictures import numbered_picture


def pytest_configure():
    """Workers of pytest-xdist have a core each: linear algebra on more would only wait for them."""
    os.environ["OPENBLAS_NUM_THREADS"] = "1"


def pytest_collection_modifyitems(items):
    """Whole jobs first: they take longest, and what is last keeps one core waiting."""
    items.sort(key=lambda item: len(item.path.parts))


@pytest.fixture(scope="module", autouse=True)
def _shapes_are_checked_anew():
    shape_checks.begin_file()


@pytest.fixture(scope="session")
def write_numbered(tmp_path_factory):
    """Write a video of numbered pictures with the given times (ticks of 1/600 s)."""

    def write(name, ticks, options=None, codec="libx264", aspect=None):
        path = tmp_path_factory.mktemp("video") / name
        with av.open(str(path), "w") as container:
            stream = container.add_stream(codec, rate=50, options=options or {})
            stream.width, stream.height, stream.pix_fmt = 128, 64, "yuv420p"
            if aspect is not None:
                stream.codec_context.sample_aspect_ratio = aspect
            stream.time_base = stream.codec_context.time_base = Fraction(1, 600)
            for number, tick in enumerate(ticks):
                frame = av.VideoFrame.from_ndarray(numbered_picture(number), format="rgb24")
                frame.pts, frame.time_base = tick, Fraction(1, 600)
                container.mux(stream.encode(frame))
            container.mux(stream.encode())
        return path

    return write


@pytest.fixture(scope="session")
def made_once(tmp_path_factory):
    """Make a folder once for all files of tests, whichever worker they run in; it is only read."""
    root = tmp_path_factory.getbasetemp()
    root = root.parent if "PYTEST_XDIST_WORKER" in os.environ else root

    def once(name, make):
        folder, whole = root / name, root / f"{name}.whole"
        with FileLock(root / f"{name}.lock"):
            if not whole.exists():
                shutil.rmtree(folder, ignore_errors=True)
                folder.mkdir()
                make(folder)
                whole.touch()
        return folder

    return once


@pytest.fixture(scope="session")
def fitted_swing(made_once):
    """A folder with a film of a swing, its truth and clicks, and a quick fit of it in `project`."""
    from small_swing import fit_small_swing

    return made_once("fitted_swing", fit_small_swing)


@pytest.fixture(scope="session")
def chromium():
    """A browser for all tests that need one."""
    from page_driver import browser

    with browser() as opened:
        yield opened


@pytest.fixture
def visit(chromium):
    """Opens the page of a project, for somebody whom nothing may disturb."""
    from page_driver import SCREEN, Person

    visits = []

    def go(server, screen=SCREEN):
        context = chromium.new_context(viewport=screen)
        visits.append((context, Person(context, server.credentials.address)))
        return visits[-1][1]

    yield go
    for context, person in visits:
        context.close()
        assert person.complaints == []


@pytest.fixture
def folder(tmp_path, write_numbered):
    """A project for a video of 50 numbered pictures, without picks or keyframes."""
    from annotator import new_project

    return new_project(tmp_path / "p", write_numbered("v.mp4", list(range(0, 600, 12))))


@pytest.fixture
def opened(folder):
    """Open that project for annotation; the one opened before is closed."""
    from annotator import open_project

    sessions = []

    def again(*arguments):
        for session in sessions:
            session.close()
        sessions[:] = [open_project(folder, *arguments)]
        return sessions[0]

    yield again
    for session in sessions:
        session.close()


@pytest.fixture
def bare(tmp_path):
    """A project folder that is good enough for a store of marks."""
    (tmp_path / "project.toml").write_text('[video]\npath = "v.mp4"\nfingerprint = "x"\n')
    return tmp_path


@pytest.fixture
def open_store(bare):
    """Open its store; the one opened before is closed."""
    from annotator_files import LIMITS

    from keyrecon.annotate.store.store import Store
    from keyrecon.io.workspace import Workspace

    stores = []

    def again():
        for store in stores:
            store.close()
        stores[:] = [Store(Workspace(bare), LIMITS)]
        return stores[0]

    yield again
    for store in stores:
        store.close()
