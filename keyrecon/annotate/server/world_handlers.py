"""What the server answers about the court and the ground: the camera's part of the page."""

from typing import Literal

from msgspec import Struct

from keyrecon.annotate.server.handlers import ApiRequest, Json
from keyrecon.annotate.server.session import Session
from keyrecon.annotate.store.edits import Frame, Name, check_frame


class CourtPointRequest(Struct, forbid_unknown_fields=True):
    """A named point of the court in a frame; without a place its click is taken away."""

    name: Name
    frame: Frame
    place: tuple[float, float] | None = None


class GroundMarkRequest(Struct, forbid_unknown_fields=True):
    """Both ends of something in a frame."""

    kind: Literal["vertical", "length", "horizon"]
    frame: Frame
    ends: tuple[tuple[float, float], tuple[float, float]]
    metres: float | None = None


class GroundRequest(Struct, forbid_unknown_fields=True):
    """A mark to keep, or one to take away, or else the field of view."""

    mark: GroundMarkRequest | None = None
    removed: GroundMarkRequest | None = None
    field_of_view: float | None = None


def court(session: Session, request: ApiRequest) -> Json:
    """The court's map, and what was clicked of it."""
    describe = session.assistant.court
    return describe() if describe else {}


def court_view(session: Session, request: ApiRequest) -> Json:
    """The court over one frame."""
    describe, frame = session.assistant.court_view, request.path["frame"]
    check_frame(frame, session.limits)
    return describe(session.limits.size, frame) if describe else {}


def court_point(session: Session, request: ApiRequest) -> Json:
    """Keep or drop a clicked point of the court."""
    keep, body = session.assistant.court_point, request.body
    check_frame(body.frame, session.limits)
    return keep(body.name, body.frame, body.place) if keep else {}


def ground(session: Session, request: ApiRequest) -> Json:
    """What was marked on the ground."""
    describe = session.assistant.ground
    return describe() if describe else {}


def ground_view(session: Session, request: ApiRequest) -> Json:
    """The ground over one frame."""
    describe, frame = session.assistant.ground_view, request.path["frame"]
    check_frame(frame, session.limits)
    return describe(session.limits.size, frame) if describe else {}


def change_ground(session: Session, request: ApiRequest) -> Json:
    """Keep or drop a mark on the ground, or the field of view."""
    body, assistant = request.body, session.assistant
    change = assistant.ground_mark if body.mark is not None else assistant.ground_removal
    mark = body.mark or body.removed
    if mark is None:
        return assistant.field_of_view(body.field_of_view) if assistant.field_of_view else {}
    check_frame(mark.frame, session.limits)
    return change(mark.kind, mark.frame, mark.ends, mark.metres) if change else {}
