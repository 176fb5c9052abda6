"""Additions to numba's public interface: the only file of the package that imports numba's internals.

numba makes machine code of every function together with all that it calls: a function called through eight others is
compiled eight times. A part of another kernel needs no machine code of its own, which saves a fifth of compile time.
Functions are called by addresses from an array: code that calls a controller, or Chipmunk, is compiled once, and kept.
"""

import hashlib
import math
import os
import pickle
import re
import sys
import time
import warnings
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import cache
from importlib import import_module
from importlib.metadata import version
from operator import attrgetter
from pathlib import Path
from types import ModuleType
from typing import Any, cast

import numpy as np

from epuck_sim.errors import NumbaError
from epuck_sim.util.jit import PACKAGE, Function, Kernel, digest, open_cache

try:
    import numba
    from llvmlite import binding, ir
    from numba import _dynfunc, from_dtype, njit, typeof, types  # type: ignore[attr-defined]
    from numba.core import cgutils, event
    from numba.core.caching import NullCache
    from numba.core.codegen import JITCodeLibrary
    from numba.core.compiler import CompilerBase, CompileResult, DefaultPassBuilder
    from numba.core.compiler_lock import global_compiler_lock
    from numba.core.compiler_machinery import register_pass
    from numba.core.errors import NumbaTypeError
    from numba.core.imputils import lower_cast, lower_getattr_generic
    from numba.core.runtime.nrt import rtsys
    from numba.core.serialize import dumps
    from numba.core.typed_passes import InlineOverloads, NativeLowering, NopythonRewrites
    from numba.core.untyped_passes import InlineClosureLikes
    from numba.extending import intrinsic, models, register_model, typeof_impl
    from numba.np.arrayobj import array0d_to_scalar, populate_array

    attrgetter("make_function")(_dynfunc)
    attrgetter("RecordingListener", "TimingListener", "register")(event)
    attrgetter("_reduce", "_rebuild")(CompileResult)
    attrgetter("if_unlikely", "unpack_tuple", "pointer_add", "gep")(cgutils)
    attrgetter("_optimize_final_module", "_finalize_final_module", "_get_module_for_linking")(JITCodeLibrary)
except (ImportError, AttributeError) as error:
    said = f"numba {version('numba')}: {error}; install a numba that epuck-sim asks for, >=0.65 and <0.70"
    raise NumbaError(said) from error
if numba.config.DISABLE_JIT:  # type: ignore[attr-defined]
    raise NumbaError("NUMBA_DISABLE_JIT is set, but trials are compiled: unset it; for controllers, use --interpret")

if (_LARGE := "scipy.linalg.cython_blas") not in sys.modules:  # numba only asks here whether it exists
    sys.modules[_LARGE] = ModuleType(_LARGE)
    import_module("numba.np.arraymath")
    del sys.modules[_LARGE]

BLOCK = types.Array(types.uint8, 1, "C")  # numba's type of a block of memory that holds a swarm
INTP = types.intp  # numba's type of a whole number
ADDRESSES = types.Array(types.int64, 1, "C")  # numba's type of the addresses, in this process, of what a swarm calls

WITHOUT_WRAPPERS = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
"""Options of numba's `njit` for functions that compiled code alone calls, which compile in two thirds of the time."""


@lower_cast(types.float64, types.int64)  # type: ignore[untyped-decorator]
def _to_whole_number(context: Any, builder: Any, _from: Any, to: Any, value: Any) -> Any:
    """Convert a float to a whole number; users' code, with checked bounds, raises as in Python, and beyond 64 bits."""
    if context.enable_boundscheck:
        infinite, least, beyond = (ir.Constant(value.type, limit) for limit in (math.inf, -(2.0**63), 2.0**63))
        is_infinite = (builder.fcmp_ordered("==", each, infinite) for each in (value, builder.fneg(value)))
        is_large = builder.fcmp_ordered("<", value, least), builder.fcmp_ordered(">=", value, beyond)
        for is_wrong, error, said in (
            (builder.fcmp_unordered("uno", value, value), ValueError, "cannot convert float NaN to integer"),
            (builder.or_(*is_infinite), OverflowError, "cannot convert float infinity to integer"),
            (builder.or_(*is_large), OverflowError, "Python int too large to convert to C long"),
        ):
            with builder.if_then(is_wrong, likely=False):
                context.call_conv.return_user_exc(builder, error, (said,))
    return builder.fptosi(value, context.get_value_type(to))


@lower_cast(types.Array, types.float64)  # type: ignore[untyped-decorator]
@lower_cast(types.Array, types.int64)  # type: ignore[untyped-decorator]
@lower_cast(types.Array, types.boolean)  # type: ignore[untyped-decorator]
def _to_one_number(context: Any, builder: Any, array: Any, to: Any, value: Any) -> Any:
    """Convert an array to a number only if it has no dimensions; numba would take the first number of any array."""
    if array.ndim:
        raise NumbaTypeError("setting one number with an array")
    return array0d_to_scalar(context, builder, array, to, value)


class _PartLibrary(JITCodeLibrary):  # linked into that of others, which is where it is optimised
    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalized = True


@register_pass(mutates_CFG=True, analysis_only=False)
class _PartLowering(NativeLowering):  # stops before it makes machine code
    _name = "lowering_of_a_part"

    def run_pass(self, state: Any) -> bool:
        library: Any = _PartLibrary
        state.library = library(state.targetctx.codegen(), state.func_id.func_qualname)
        state.flags.no_compile = True
        super().run_pass(state)  # type: ignore[no-untyped-call]
        lowered = state["cr"]
        function = lowered.fndesc
        # callers find it by the function for Python, which Python cannot call at address 0
        name = _dynfunc.make_function(function.lookup_module(), function.qualname, "", 0, lowered.env, (state.library,))
        state.targetctx.insert_user_function(name, function, [state.library])
        state["cr"] = lowered._replace(cfunc=name)
        return True


NEEDLESS = (InlineClosureLikes, InlineOverloads, NopythonRewrites)
"""Passes of numba for closures, inlined overloads, and expressions of arrays."""


class _PartCompiler(CompilerBase):
    def define_pipelines(self) -> list[Any]:
        """Return numba's passes with `_PartLowering`, and without `NEEDLESS`, for which no kernel has any use."""
        manager: Any = DefaultPassBuilder.define_nopython_pipeline(self.state)
        needed = [(each, text) for each, text in manager.passes if each not in NEEDLESS]
        manager.passes = [(_PartLowering if each is NativeLowering else each, text) for each, text in needed]
        manager.finalize()
        return [manager]


def compile_part(function: Any, **options: object) -> Any:
    """Return a function that is compiled as part of others, by numba's `njit` with these options.

    Literal types are widened: numba would compile a part for each constant passed to it or first set in a variable.
    """
    compiler: Any = njit
    part = compiler(pipeline_class=_PartCompiler, **WITHOUT_WRAPPERS, **options)(function)
    find = part.get_call_template
    part.get_call_template = lambda given, named: find([*map(types.unliteral, given)], named)
    return part


typeof_impl.register(Kernel)(lambda kernel, _: typeof(kernel.part))  # in compiled code a kernel is a part of others

SHIPPED = PACKAGE / "compiled"  # folder of a release's compiled code, laid out as a cache folder is: see `make dist`

X86_64_V3 = {"avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe"}
"""Features that x86-64-v3 adds to x86-64-v2, by LLVM's names."""

_features, _settings = binding.get_host_cpu_features(), vars(numba.config)
if _settings["CPU_NAME"] is None and SHIPPED.is_dir() and all(map(_features.get, X86_64_V3)):
    _settings.update(CPU_NAME="x86-64-v3", CPU_FEATURES="")  # as a release is, where this is one

DIGEST_BYTES = hashlib.sha256().digest_size

_Uncached: Any = NullCache


class _Cache(_Uncached):  # type: ignore[misc]
    """Keeps compiled code of a function in files that begin with their digests: what was changed is compiled anew."""

    def __init__(self, function: Any, contents_digest: str) -> None:
        code, file = function.__code__, Path(function.__code__.co_filename)
        self._digest, self._name = contents_digest, f"{file.stem}.{function.__name__}"
        self._made_from = _digest(file.read_bytes()), code.co_firstlineno, code.co_code

    def _path(self, folder: Path, signature: Any, context: Any) -> Path:
        made_from = self._made_from, signature, context.codegen().magic_tuple(), sys.implementation.cache_tag
        return folder / f"{self._name}.{digest([repr(made_from).encode()])}.nbc"

    def load_overload(self, signature: Any, context: Any) -> Any:
        """Return compiled code from the user's cache, else what was shipped; None if there is neither.

        To run it, only numba's memory management is set up; its compiler, which takes a tenth of a second, can wait.
        """
        rtsys.initialize(context)
        for folder in (open_cache(self._digest), SHIPPED / self._digest):
            with suppress(OSError):
                sealed = self._path(folder, signature, context).read_bytes()
                if _digest(contents := sealed[DIGEST_BYTES:]) == sealed[:DIGEST_BYTES]:
                    return CompileResult._rebuild(context, *pickle.loads(contents))
        return None

    def save_overload(self, signature: Any, result: Any) -> None:
        """Keep compiled code that holds no address of this process, or warn, once a folder, that it cannot be kept."""
        module = result.library._get_module_for_linking()
        calls_itself = any(each.name.startswith(".numba.unresolved$") for each in module.global_variables)
        if calls_itself or result.library.has_dynamic_globals:
            return
        path = self._path(open_cache(self._digest), signature, result.target_context)
        part, contents = path.with_suffix(f".{os.urandom(4).hex()}.nbc"), dumps(result._reduce())
        try:
            path.parent.mkdir(exist_ok=True)
            part.write_bytes(_digest(contents) + contents)
            part.replace(path)
        except OSError as error:
            folder = path.parents[1]
            message = f"{folder}: compiled code cannot be kept here; every command compiles it anew: {error.strerror}"
            warnings.warn(f"{message}; make room, or name another folder in NUMBA_CACHE_DIR", stacklevel=1)


def _digest(contents: bytes) -> bytes:
    return hashlib.sha256(contents).digest()


def compile_cached(function: Function, contents_digest: str, *, careful: bool, **options: object) -> Function:
    """Return `function` compiled without fast-math and parallel loops, kept under the digest of all it depends on.

    If `careful`, a division by 0 and an index out of bounds raise, as in Python; else they are undefined.
    """
    compiler: Any = njit  # its types lack some of its options
    choices = {"nogil": True, "boundscheck": careful, "no_cfunc_wrapper": True, **options}
    compiled = compiler(error_model="python" if careful else "numpy", **choices)(function)
    compiled._cache = _Cache(function, contents_digest)
    return cast(Function, compiled)


_recorder, _timer = event.RecordingListener(), event.TimingListener()
for _listener in (_recorder, _timer):
    event.register("numba:compile", _listener)


def compiling() -> tuple[int, Path | None] | None:
    """Return how many functions this process has compiled, and the user's file that is being compiled, if it is one.

    Return None if nothing is being compiled. Cached functions do not count.
    """
    done, begun = set[Any](), []
    for _, each in list(_recorder.buffer):
        code = each.data["dispatcher"].py_func.__code__
        if each.is_start:
            begun.append(code)
        else:
            begun.remove(code)
            done.add(code)
    ours = {PACKAGE, Path(numba.__file__).parent}
    files = [Path(code.co_filename) for code in reversed(begun)]
    file = next((file for file in files if file.suffix == ".py" and ours.isdisjoint(file.parents)), None)
    return (len(done), file) if begun else None


def working_s() -> float:
    """Return the time in seconds on a clock that leaves out what this process spends on compiling."""
    return time.perf_counter() - (_timer.duration if _timer.done else 0.0)


@cache
def function_address(function: Any) -> int:
    """Return the address at which compiled code calls a function of one signature, which numba has compiled."""
    (result,) = function.overloads.values()
    return int(result.library.get_pointer_to_function(result.fndesc.llvm_func_name))


@cache
def address_of(kernel: Any, *further: Any) -> int:
    """Return the address of a kernel (block, addresses, ...) with further arguments of these types, now compiled."""
    compiled = kernel.for_python
    if not compiled.overloads:
        compiled.compile((BLOCK, ADDRESSES, *further))
    return function_address(compiled)


def compile_elsewhere(parts: Mapping[str, tuple[Any, tuple[Any, ...]]], target: str, features: str) -> bytes:
    """Return the object file, for another machine, of parts with their types of arguments, by their names there.

    Optimisation for this machine is off from then on: nothing that the process compiles may be kept on disk.
    """
    for name in ("_optimize_functions", "_optimize_final_module"):
        setattr(JITCodeLibrary, name, lambda *_: None)
    binding.initialize_all_targets()
    binding.initialize_all_asmprinters()
    machine = binding.Target.from_triple(target).create_target_machine(opt=3, features=features)
    whole = binding.parse_assembly("")
    for name, (part, arguments) in parts.items():
        part.compile(arguments)
        result = part.overloads[arguments]
        with global_compiler_lock:
            text = str(result.library._get_module_for_linking())
        text = re.sub(r'^target .*|"target-(cpu|features)"="[^"]*"', "", text, flags=re.MULTILINE)
        of_target = f'target datalayout = "{machine.target_data}"\ntarget triple = "{target}"\n'
        module = binding.parse_assembly(of_target + text)
        for each in (*module.functions, *module.global_variables):
            if not each.is_declaration:
                each.linkage = binding.Linkage.internal
        root = module.get_function(str(result.fndesc.llvm_func_name))
        root.name, root.linkage = name, binding.Linkage.external
        whole.link_in(module)
    whole.verify()
    builder = binding.create_pass_builder(machine, binding.create_pipeline_tuning_options(speed_level=3))
    pruning = binding.create_new_module_pass_manager()  # of reference counts, as numba does
    pruning.add_refprune_pass()
    for passes in (builder.getModulePassManager(), pruning, builder.getModulePassManager()):
        passes.run(whole, builder)
    return bytes(machine.emit_object(whole))


_intrinsic: Callable[[Callable[..., Any]], Any] = intrinsic  # its own type leaves the context among the arguments


def _call_compiled(result: Any) -> Any:
    """Return the generator of a call of a compiled function, which passes on the errors raised there."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        kinds, convention = tuple(signature.args[1]), context.call_conv
        values = cgutils.unpack_tuple(builder, arguments[1], len(kinds))
        function = builder.inttoptr(arguments[0], convention.get_function_type(result, kinds).as_pointer())
        status, value = convention.call_function(builder, function, result, kinds, values)
        with cgutils.if_unlikely(builder, status.is_error):
            convention.return_status_propagate(builder, status)
        return context.get_dummy_value() if result == types.void else value

    return generate


_POINTER = ir.IntType(8).as_pointer()


def _call_c(result: ir.Type) -> Any:
    """Return the generator of a call of a C function: whole numbers are pointers, floats are doubles."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        values = [
            value if isinstance(kind, types.Float) else builder.inttoptr(value, _POINTER)
            for kind, value in zip(signature.args[1], cgutils.unpack_tuple(builder, arguments[1]), strict=True)
        ]
        kind = ir.FunctionType(result, [value.type for value in values])
        returned = builder.call(builder.inttoptr(arguments[0], kind.as_pointer()), values)
        if result == _POINTER:
            return builder.ptrtoint(returned, context.get_value_type(types.intp))
        return context.get_dummy_value() if isinstance(result, ir.VoidType) else returned

    return generate


def _caller(result: Any, generate: Any) -> Any:
    """Return the intrinsic that calls the function at an address with arguments."""

    @_intrinsic
    def call_at(context: Any, address: Any, *arguments: Any) -> Any:  # noqa: ARG001
        kinds = types.Tuple(tuple(map(types.unliteral, arguments)))  # of constants as of other numbers like them
        return result(types.intp, kinds), generate

    return call_at


call = _caller(types.void, _call_compiled(types.void))
"""Calls the compiled function at an address, which returns nothing."""

evaluate = _caller(types.float64, _call_compiled(types.float64))
"""Returns the float of the compiled function at an address."""

call_c = _caller(types.void, _call_c(ir.VoidType()))
"""Calls the C function at an address, which returns nothing; a struct of doubles is given as doubles."""

pointer_from_c = _caller(types.intp, _call_c(_POINTER))
"""Returns the pointer that the C function at an address returns."""

double_from_c = _caller(types.float64, _call_c(ir.DoubleType()))
"""Returns the double that the C function at an address returns."""

vector_from_c = _caller(types.UniTuple(types.float64, 2), _call_c(ir.ArrayType(ir.DoubleType(), 2)))
"""Returns the struct of two doubles that the C function at an address returns: to LLVM, an array is returned alike."""


def record_type(fields: list[tuple[Any, ...]]) -> np.dtype[Any]:
    """Return a type of records whose fields Python reads as attributes, as compiled code does."""
    return np.dtype((np.record, np.dtype(fields, align=True)))


def _array_in(context: Any, builder: Any, kind: Any, data: Any, first: Any, end: Any) -> Any:
    """Return the array of bytes `first` to `end` behind a pointer."""
    size = context.get_constant(types.intp, context.get_abi_sizeof(context.get_data_type(kind.dtype)))
    array = context.make_array(kind)(context, builder)
    # by its address, so that loops vectorise: to LLVM, arrays that begin at one pointer may be one array
    begin = builder.inttoptr(builder.add(builder.ptrtoint(data, first.type), first), array.data.type)
    length = builder.sdiv(builder.sub(end, first), size)
    populate_array(array, data=begin, shape=[length], strides=[size], itemsize=size, meminfo=None)
    return array._getvalue()


@_intrinsic
def array_at(context: Any, block: Any, first: Any, end: Any, dtype: Any) -> Any:  # noqa: ARG001
    """Return `block[first:end].view(dtype)`, not counted as a reference, and compiled thirty times as fast."""
    kind = types.Array(dtype.dtype, 1, "C")

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        block, first, end, _ = arguments
        data = context.make_array(signature.args[0])(context, builder, block).data
        return _array_in(context, builder, kind, data, first, end)

    return kind(block, types.intp, types.intp, dtype), generate


@_intrinsic
def row_at(context: Any, rows: Any, row: Any, length: Any) -> Any:  # noqa: ARG001
    """Return a row of an array that has rows of some length one after the other."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        rows = context.make_array(signature.args[0])(context, builder, arguments[0])
        size = builder.mul(arguments[2], rows.itemsize)
        first = builder.mul(arguments[1], size)
        return _array_in(context, builder, signature.return_type, rows.data, first, builder.add(first, size))

    return rows(rows, types.intp, types.intp), generate


class _Carved(types.NamedTuple):
    """Arrays of a block, in compiled code a pointer to it: they are computed where they are read."""


register_model(_Carved)(models.OpaqueModel)


@lower_getattr_generic(_Carved)  # type: ignore[untyped-decorator]
def _field(context: Any, builder: Any, carved: Any, data: Any, field: str) -> Any:
    """Return an array of a block, or the record that begins it."""
    place = carved.fields.index(field)
    kind, at = carved[place], carved.instance_class.places[place][1]
    if at is None:
        return builder.bitcast(data, context.get_value_type(kind))
    pair = builder.bitcast(cgutils.pointer_add(builder, data, at), context.get_value_type(INTP).as_pointer())
    bounds = [builder.load(cgutils.gep(builder, pair, number)) for number in range(2)]
    for bound in bounds:
        bound.set_metadata("invariant.load", builder.module.add_metadata([]))  # read once, whatever a loop writes
    return _array_in(context, builder, kind, data, *bounds)


@_intrinsic
def carve(context: Any, block: Any, part: Any) -> Any:  # noqa: ARG001
    """Return arrays of a block as a named tuple, which does not own them.

    The tuple's class, `part`, has `places`: for each field, the type of the array and the offset in the block of two
    numbers, at which bytes it begins and ends; for the record that begins the block, None instead of the offset.
    """
    places = part.instance_class.places
    kinds = [from_dtype(dtype) if at is None else types.Array(from_dtype(dtype), 1, "C") for dtype, at in places]

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return context.make_array(signature.args[0])(context, builder, arguments[0]).data

    return _Carved(kinds, part.instance_class)(block, part), generate  # type: ignore[no-untyped-call]


@_intrinsic
def unlikely(context: Any, flag: Any) -> Any:  # noqa: ARG001
    """Return a flag that compiled code expects to be false: the branch that it leads to is placed out of the way."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:  # noqa: ARG001
        boolean = ir.IntType(1)
        kind = ir.FunctionType(boolean, [boolean, boolean])
        expect = builder.module.declare_intrinsic("llvm.expect", [boolean], kind)
        return builder.call(expect, [*arguments, boolean(0)])

    return types.boolean(types.boolean), generate
