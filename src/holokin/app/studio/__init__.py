"""The studio: a page with strategies of one robot side by side, with a tool that is dragged or run round a loop.

Uses `app/job` and `motion`. Read first: `session.py`, `stage.py`.
"""

from .followers import Loop, circle_loop, eight_loop, polygon_loop, reversed_loop
from .new_session import open_session, session_of_job, session_of_robot
from .playback import Motion, Recording, record, record_session
from .server import DEFAULT, Studio, studio
from .session import Session, to_job
from .standalone_page import PageLoop, PagePlan, WebPage, cusp_loop, page_plan, web_page
from .states import Cloud, CloudStatus, Judgement, LeafCusps, Origin, Phase, Snapshot, StrategyState, StrategyStatus
from .strategies import NamedStrategy, Slider, default_strategies

__all__ = [
    "DEFAULT",
    "Cloud",
    "CloudStatus",
    "Judgement",
    "LeafCusps",
    "Loop",
    "Motion",
    "NamedStrategy",
    "Origin",
    "PageLoop",
    "PagePlan",
    "Phase",
    "Recording",
    "Session",
    "Slider",
    "Snapshot",
    "StrategyState",
    "StrategyStatus",
    "Studio",
    "WebPage",
    "circle_loop",
    "cusp_loop",
    "default_strategies",
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
