"""C from lists of operations: what is generated, compiled, kept and called. The expressions of `symbolic` build on it.

Uses `base`. Read first: `kernel.py`, `emit.py`.

CasADi writes C, too, from the same list of operations. It does not serve here, because one text has to be read as
numbers, as lanes of a vector register and as enclosures, in double and in single precision, under -Wconversion: in
single precision a compiler has 49 complaints about CasADi's C of a Panda's G (1,656 operations). As plain doubles
(gcc -O2, one run, five rounds) it takes 0.71 to 1.04 us a call, and ours 0.48 to 0.64 us: it asks of each argument
and result whether it is there, and keeps its numbers in one array.
"""

from .arm_sheets import SheetsKernel, sheets_kernel
from .emit import Port
from .emit import prelude as code_file
from .kernel import (
    LARGEST,
    EdgeKernel,
    FollowKernel,
    InverseKernel,
    LeafRules,
    SignsKernel,
    StepKernel,
    StepMemory,
    VelocityRules,
    signs_kernel,
    weak,
)
from .toolchain import allowed, compiler, enabled, engine, tell

__all__ = [
    "LARGEST",
    "EdgeKernel",
    "FollowKernel",
    "InverseKernel",
    "LeafRules",
    "Port",
    "SheetsKernel",
    "SignsKernel",
    "StepKernel",
    "StepMemory",
    "VelocityRules",
    "allowed",
    "code_file",
    "compiler",
    "enabled",
    "engine",
    "sheets_kernel",
    "signs_kernel",
    "tell",
    "weak",
]
