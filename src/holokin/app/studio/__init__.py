"""The studio: a page with laws of one robot side by side, with a tool that is dragged or run round a loop.

Uses `job` and `motion`. Read first: `session.py`, `law_group.py`, `studio_page.py`.
"""

from .new_session import open_session, session_of_job, session_of_robot
from .open_studio import studio
from .playback import Motion, Recording, record, record_session
from .server import DEFAULT, Studio
from .session import Session
from .session_job import to_job
from .session_laws import Law, default_laws
from .session_loops import Loop, circle_loop, eight_loop, polygon_loop, reversed_loop
from .session_page import PagePlan, page_plan
from .sliders import Slider
from .standalone_page import PageLoop, WebPage, cusp_loop, web_page
from .states import Cloud, CloudStatus, Judgement, LawState, LawStatus, LeafCusps, Origin, Phase, Snapshot
from .two_paths import LawPaths, TwoPaths

__all__ = [
    "DEFAULT",
    "Cloud",
    "CloudStatus",
    "Judgement",
    "Law",
    "LawPaths",
    "LawState",
    "LawStatus",
    "LeafCusps",
    "Loop",
    "Motion",
    "Origin",
    "PageLoop",
    "PagePlan",
    "Phase",
    "Recording",
    "Session",
    "Slider",
    "Snapshot",
    "Studio",
    "TwoPaths",
    "WebPage",
    "circle_loop",
    "cusp_loop",
    "default_laws",
    "eight_loop",
    "open_session",
    "page_plan",
    "polygon_loop",
    "record",
    "record_session",
    "reversed_loop",
    "session_of_job",
    "session_of_robot",
    "studio",
    "to_job",
    "web_page",
]
