"""Functions that are compiled only into what calls them, so that every line becomes machine code once.

numba makes machine code of every function by itself: it links in all that the function calls, optimises that and
translates it, level above level, although only what Python calls is ever run. A *part* stops before that. Its code is
handed on as it is written, and optimised in the function called by Python (an `entry`) that it ends up in: the same
digits in less than half of the seconds. Called from Python after all, a part is compiled by itself, as numba does.
This rests on the inside of numba's compiler, so other versions of numba than those tried get plain `njit`.
"""

import numba
from numba import njit
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler

TRIED = ("0.68",)
"""Versions of numba whose compiler is known to work so."""


class _NoMachineCode:
    """In the place of the code generator, where there is no machine code that could be given its environment."""

    def set_env(self, name, environment):
        pass


class _PartLibrary(JITCodeLibrary):
    """Code that is only ever linked into other code."""

    codegen = _NoMachineCode()

    def _optimize_functions(self, module):
        module.data_layout = self._codegen._data_layout

    def _optimize_final_module(self):
        pass

    def _finalize_final_module(self):
        self._finalized = True

    def get_pointer_to_function(self, name):
        return 0


class _PartCompiler(Compiler):
    """numba's compiler, into a `_PartLibrary` and without what Python would need to call it."""

    def __init__(self, typing_context, target_context, library, *rest):
        library = library or _PartLibrary(target_context.codegen(), "part")
        super().__init__(typing_context, target_context, library, *rest)
        self.state.flags.no_cpython_wrapper = True
        self.state.flags.no_cfunc_wrapper = True


def part(function, **options):
    """As numba's `njit` with these options, for what is called by compiled code."""
    whole = njit(**options)(function)
    if numba.config.DISABLE_JIT or not numba.__version__.startswith(TRIED):
        return whole
    inner = njit(pipeline_class=_PartCompiler, **options)(function)
    inner._insert = lambda *overload: None  # there is nothing that Python could call
    inner._compile_for_args = whole._compile_for_args
    return inner
