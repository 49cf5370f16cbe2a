"""Functions that are compiled only into their callers, so that every line becomes machine code once.

numba compiles every function separately: at each level it links in all callees, optimises and translates the whole,
although only the function that Python calls is ever run. An *inlined function* stops before that: its unoptimised code
is passed on, and optimised in the function called by Python (an *entry*) that contains it. This gives the same digits
in less than half of the compile time. If Python calls it directly, it is compiled separately, as by numba.

All functions align their stack to a cache line. numba aligns it to 16 bytes only, so that three of four vectors that
are spilled to memory straddle two lines: up to 1.4 times the run time, varying from process to process.

This depends on internals of numba's compiler; versions of numba other than those tested use plain `njit`.
"""

import contextlib
import functools
import gc
from types import CodeType

import numba
from llvmlite.binding import Linkage
from numba import njit, types
from numba.core import base, ir
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, Flags
from numba.core.compiler_lock import global_compiler_lock
from numba.core.compiler_machinery import register_pass
from numba.core.errors import TypingError
from numba.core.imputils import lower_constant
from numba.core.registry import CPUDispatcher
from numba.core.targetconfig import ConfigStack
from numba.core.typed_passes import NativeLowering, NopythonRewrites
from numba.core.untyped_passes import InlineClosureLikes, WithLifting
from numba.extending import models, register_model

TRIED = ("0.68",)
"""Versions of numba whose compiler is known to work so."""
LINE = 64
"""Bytes of a cache line, and of the widest register."""


class _AlignedLibrary(JITCodeLibrary):
    """Code of functions whose stack begins on the border of a cache line."""

    def add_ir_module(self, module):
        for function in module.functions:
            if function.blocks:
                function.attributes.alignstack = LINE
                function.attributes.add("nonlazybind")  # means nothing here; llvmlite writes no alignment alone
        super().add_ir_module(module)


class _NoMachineCode:
    """In the place of the code generator, where there is no machine code that could be given its environment."""

    def set_env(self, name, environment):
        pass


class _PartLibrary(_AlignedLibrary):
    """Code of one function that is only ever linked into an entry, together with all that it calls."""

    codegen = _NoMachineCode()

    def _optimize_functions(self, module):
        module.data_layout = self._codegen._data_layout

    def finalize(self):
        self._raise_if_finalized()
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == Linkage.external:
                function.linkage = Linkage.linkonce_odr
        self._shared_module = self._final_module
        self._finalized = True

    def get_pointer_to_function(self, name):
        return 0


class _PartType(types.Dispatcher):
    """The type of an inlined function, which says all there is to say of it.

    Given to another function, numba's own comes with its address in this process, and then machine code is never kept.
    """


register_model(_PartType)(models.OpaqueModel)


@lower_constant(_PartType)
def _no_address(context, builder, part_type, function):
    return context.get_dummy_value()


class _Part(CPUDispatcher):
    """A function that is only ever called by compiled code."""

    def __init__(self, *arguments, **options):
        super().__init__(*arguments, **options)
        self._type.__class__ = _PartType  # numba's table of globals already holds it

    @property
    def _numba_type_(self):
        return self._type

    def get_call_template(self, args, kws):
        """As numba's, but a number that is written there is as good as any: else 0 and n are a function each."""
        plain = [types.unliteral(a) if isinstance(a, _NUMBERS) else a for a in args]
        try:
            return super().get_call_template(plain, kws)
        except TypingError:  # it hangs on the number
            if plain == list(args):
                raise
            return super().get_call_template(args, kws)


_NUMBERS = types.IntegerLiteral, types.BooleanLiteral


def _only_borrows(state):
    """Whether a function makes no array, gets none from what it calls, and hands none back: its callers hold all.

    Arrays of a record that is made of what the caller holds are not new.
    """

    def counted(kind):
        return isinstance(kind, types.Buffer) or (isinstance(kind, types.BaseTuple) and any(map(counted, kind)))

    def borrows(function):
        return getattr(getattr(function, "typing_key", None), "borrows", isinstance(function, types.NamedTupleClass))

    calls = [(node, signature) for node, signature in state.calltypes.items() if getattr(node, "op", None) == "call"]
    made = (signature.return_type for node, signature in calls if not borrows(state.typemap[node.func.name]))
    return not any(map(counted, (state.return_type, *made)))


@register_pass(mutates_CFG=True, analysis_only=False)
class _BorrowingLowering(NativeLowering):
    """numba's lowering; arrays that a function only borrows are not counted: that is half of its lines.

    What Python calls has a wrapper, which counts.
    """

    _name = "borrowing_lowering"

    def run_pass(self, state):
        if state.flags.no_cpython_wrapper and _only_borrows(state):
            state.targetctx = state.targetctx.subtarget(enable_nrt=False)
        return super().run_pass(state)


_NEEDLESS = NopythonRewrites, WithLifting
"""Passes for what none of our functions has, a twentieth of the time: sums of whole arrays as one loop, and `with`; the
one for functions within a function is left out where there are none."""


class _Compiler(Compiler):
    """numba's compiler, without what our functions do not need."""

    def define_pipelines(self):
        nested = any(isinstance(x, CodeType) for x in self.state.func_id.code.co_consts)
        needless = _NEEDLESS if nested else (*_NEEDLESS, InlineClosureLikes)
        pipelines = super().define_pipelines()
        for pipeline in pipelines:
            pipeline._ENFORCING = False  # or numba looks for dead variables after each pass, a tenth of its time
            pipeline.passes = [
                (_BorrowingLowering if kind is NativeLowering else kind, text)
                for kind, text in pipeline.passes
                if kind not in needless
            ]
        return pipelines


class _PartCompiler(_Compiler):
    """Into a `_PartLibrary` and without what Python would need to call it."""

    def __init__(self, typing_context, target_context, library, *rest):
        library = library or _PartLibrary(target_context.codegen(), "part")
        super().__init__(typing_context, target_context, library, *rest)
        self.state.flags.no_cpython_wrapper = True
        self.state.flags.no_cfunc_wrapper = True


class _EntryLibrary(_AlignedLibrary):
    """Code of a function that Python calls, and of all inlined functions below it, each linked in once."""

    def finalize(self):
        for called in _all_below(self):
            self._reload_init.update(called._reload_init)
            part = called._get_module_for_linking().clone()
            _set_linkage(part, Linkage.linkonce_odr, Linkage.weak_odr)  # or what is not called from here were lost
            self._final_module.link_in(part)
        _set_linkage(self._final_module, Linkage.weak_odr, Linkage.linkonce_odr)
        self._linking_libraries = []
        super().finalize()


def _all_below(library, found=None):
    """What a library calls, and what that calls."""
    found = {} if found is None else found
    for called in library._linking_libraries:
        if called not in found:
            found[called] = True
            _all_below(called, found)
    return list(found)


def _set_linkage(module, old, new):
    for function in module.functions:
        if not function.is_declaration and function.linkage == old:
            function.linkage = new


@functools.cache
def _is_frozen():
    """Whether the program keeps objects from the collector itself; asked once, for all of them are counted."""
    return gc.get_freeze_count() > 0


class _Entry(CPUDispatcher):
    """A function that Python calls, compiled without collecting garbage: that takes a twelfth of the time."""

    def compile(self, sig):
        if sig in self.overloads:  # a part called from Python asks each time
            return self.overloads[sig].entry_point
        collecting = gc.isenabled()
        gc.disable()
        if "resolve_function_type" not in vars(self.typingctx):
            self.typingctx.resolve_function_type = _asked_once(self.typingctx.resolve_function_type)
        try:
            # waiting for another process is compiling to who watches numba
            with global_compiler_lock, getattr(self._cache, "alone", contextlib.nullcontext)(sig):
                return super().compile(sig)
        finally:
            if collecting:
                if not _is_frozen():  # all that is new counts as old: or it would be looked through at once
                    gc.freeze()
                    gc.unfreeze()
                gc.enable()


class _EntryCompiler(_Compiler):
    """Into an `_EntryLibrary` that can be kept on the disk."""

    def __init__(self, typing_context, target_context, library, *rest):
        if library is None:
            library = _EntryLibrary(target_context.codegen(), "entry")
            library.enable_object_caching()
        super().__init__(typing_context, target_context, library, *rest)


def _asked_once(ask):
    """numba's question `ask(..., args, kws)` what comes of a function for arguments of these types.

    numba asks again for each operation. While it compiles one function, the first answer is kept, and not beyond: it
    depends on that function's flags, and numba notes with each answer what is to be called.
    """
    known, of = {}, None

    def asked(*question):
        nonlocal of
        *about, args, kws = question
        key, flags = (*about, tuple(args)), ConfigStack.top_or_none()
        try:
            hash(key)
        except TypeError:  # the type of a constant slice has no hash
            return ask(*question)
        if kws or flags is None:
            return ask(*question)
        if flags is of and key in known:
            return known[key]
        answer = ask(*question)
        if flags is not of:  # or another function was compiled meanwhile
            known.clear()
            of = flags
        known[key] = answer
        return answer

    return asked


def _values(flags):
    """What numba's `Flags.values` gives, which asks for each by its name: a thirtieth of the time of a large kernel."""
    return {name: flags._values.get(name, option.default) for name, option in flags.options.items()}


def _variables(instruction, value):
    """What numba's `Inst._rec_list_vars` gives, which makes a list of each value: a twentieth of the time."""
    found = []
    for x in value.values() if isinstance(value, dict) else value if isinstance(value, list | tuple) else (value,):
        if isinstance(x, ir.Var):
            found.append(x)
        elif isinstance(x, ir.Inst):
            found += x.list_vars()
        elif isinstance(x, list | tuple | dict):
            found += _variables(instruction, x)
    return found


def _is_tried():
    return not numba.config.DISABLE_JIT and numba.__version__.startswith(TRIED)


if _is_tried():
    # asked some ten thousand times in a large kernel
    types.BaseFunction.get_call_type = _asked_once(types.BaseFunction.get_call_type)
    base._has_loc = functools.lru_cache(None)(base._has_loc)
    Flags.values = _values
    ir.Inst._rec_list_vars = _variables
    # loads numba's functions of arrays without scipy.linalg, a seventh of a warm run; `dot` loads it when compiled
    from numba.np import linalg

    _asked, linalg.ensure_blas = linalg.ensure_blas, lambda: None
    try:
        import numba.np.arraymath
    finally:
        linalg.ensure_blas = _asked


def _made(dispatcher, compiler, function, options):
    return dispatcher(function, {}, {"nopython": True, "boundscheck": None, **options}, pipeline_class=compiler)


def aligned(function, **options):
    """As numba's `njit` with these options, for what Python calls."""
    return _made(_Entry, _EntryCompiler, function, options) if _is_tried() else njit(**options)(function)


def part(function, **options):
    """As numba's `njit` with these options, for what is called by compiled code."""
    whole = aligned(function, **options)
    if not _is_tried():
        return whole
    inner = _made(_Part, _PartCompiler, function, options)
    inner._insert = lambda *overload: None  # there is nothing that Python could call
    inner._compile_for_args = whole._compile_for_args
    return inner
