"""Kernels: functions that are compiled for Python when Python calls them, and as parts of others when others do.

numba makes machine code of every function, with everything that it calls inside: of what is called through eight
others, eight times. A part of another kernel needs no machine code of its own.
"""

from collections.abc import Callable
from typing import Any

from numba import _dynfunc, njit  # type: ignore[attr-defined]
from numba.core import types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import register_pass
from numba.core.typed_passes import NativeLowering


def pipelines_with(lowering: type[NativeLowering], state: Any) -> list[Any]:
    """Return numba's passes, with another one that makes machine code, for `CompilerBase.define_pipelines`."""
    manager: Any = DefaultPassBuilder.define_nopython_pipeline(state)
    manager.passes = [(lowering if each is NativeLowering else each, text) for each, text in manager.passes]
    manager.finalize()
    return [manager]


class _PartLibrary(JITCodeLibrary):
    """The code of a function, to be linked into that of others, which is where it is optimised."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalized = True


@register_pass(mutates_CFG=True, analysis_only=False)
class _PartLowering(NativeLowering):
    """numba's pass that makes machine code, which here stops before it does."""

    _name = "lowering_of_a_part"

    def run_pass(self, state: Any) -> bool:
        library: Any = _PartLibrary
        state.library = library(state.targetctx.codegen(), state.func_id.func_qualname)
        state.flags.no_compile = True
        super().run_pass(state)  # type: ignore[no-untyped-call]
        lowered = state["cr"]
        function = lowered.fndesc
        # callers find it by what Python would call; Python cannot, at address 0
        name = _dynfunc.make_function(function.lookup_module(), function.qualname, "", 0, lowered.env, (state.library,))
        state.targetctx.insert_user_function(name, function, [state.library])
        state["cr"] = lowered._replace(cfunc=name)
        return True


class _PartCompiler(CompilerBase):
    """numba's compiler for parts of other functions."""

    def define_pipelines(self) -> list[Any]:
        """Return numba's passes, with `_PartLowering`."""
        return pipelines_with(_PartLowering, self.state)


class Kernel:
    """A function that Python and compiled code can call."""

    def __init__(self, function: Any, for_python: Callable[..., Any], **options: object) -> None:
        """Prepare to compile a function.

        Args:
            function: The function.
            for_python: The function as Python calls it: compiled when it is first called.
            options: Those of numba's `njit`.
        """
        self.function = function
        self.__doc__ = function.__doc__
        self._for_python = for_python
        compiler: Any = njit
        self._part = compiler(pipeline_class=_PartCompiler, no_cpython_wrapper=True, no_cfunc_wrapper=True, **options)(
            function
        )

    @property
    def _numba_type_(self) -> Any:
        """What numba takes it for when compiled code refers to it."""
        return types.Dispatcher(self._part)

    def __call__(self, *arguments: Any) -> Any:
        """Call the function from Python."""
        return self._for_python(*arguments)
