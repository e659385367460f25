"""C from expressions: what is generated, compiled, kept and called."""

from .emit import prelude as code_file
from .kernel import LARGEST, FollowKernel, LeafRules, StepKernel, StepMemory, VelocityRules
from .native import compiler, enabled, engine, tell
from .program import Port

__all__ = [
    "LARGEST",
    "FollowKernel",
    "LeafRules",
    "Port",
    "StepKernel",
    "StepMemory",
    "VelocityRules",
    "code_file",
    "compiler",
    "enabled",
    "engine",
    "tell",
]
