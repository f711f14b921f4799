"""How the stages are compiled.

Two decorators: `stage` for a function that other kernels call, `entry` for one that Python calls,
whose machine code is cached on disk. numba checks only an entry's own file to invalidate its cache,
and would use old code after an edit of a stage. So the cache is in a folder named by a hash of all
sources in `coupled/rig` and of those beside the entry.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import sqlite3
from collections.abc import Callable
from contextlib import ExitStack, suppress
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar, cast, get_type_hints

import numba
import numpy as np
from llvmlite import binding, ir
from numba import types
from numba.core import config
from numba.core.caching import FunctionCache
from numba.core.compiler_lock import global_compiler_lock
from numba.core.registry import CPUDispatcher, cpu_target
from numba.core.runtime import rtsys
from numba.extending import intrinsic

from coupled.errors import InputError
from coupled.files import write_whole
from coupled.timing import timed

# A smaller state of a decay is at rest; subnormal numbers would slow the processor.
TINY = 1e-100
_LONGEST_s = 600.0  # that a process waits for another one's compilation

F = TypeVar("F", bound=Callable[..., Any])


def _call(stage: Any, *arguments: Any) -> Any:
    """Call a stage from Python, which compiles it separately."""
    if not hasattr(stage, "alone"):
        stage.alone = numba.njit(stage.py_func)
    return stage.alone(*arguments)


# A function inlined into the entries, without its interface to Python. LLVM by itself inlines less,
# and reloads a control's numbers at every call: a frame takes 1.3 times as long. The interface to
# Python would take a quarter of the time and the memory of a compilation.
_Stage: Any = type("_Stage", (CPUDispatcher,), {"__call__": _call})
_INLINED = {
    "nopython": True,
    "forceinline": True,
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
}


def stage(function: F) -> F:
    """Compile a function that is inlined into the entries."""
    if config.DISABLE_JIT:
        return function
    return cast(F, _Stage(py_func=function, targetoptions=dict(_INLINED)))


def seldom(function: F) -> F:
    """Compile a stage that few rigs need, not inlined, so as not to slow the common path."""
    if config.DISABLE_JIT:
        return function
    return cast(F, _Stage(py_func=function, targetoptions={**_INLINED, "forceinline": False}))


def entry(function: F, nogil: bool = False) -> F:
    """Compile a function that Python calls, and cache the result on disk.

    If no folder can be written (a read-only install without a writable home, and no
    NUMBA_CACHE_DIR set) it is compiled at its first call in every process instead.
    """
    if config.DISABLE_JIT:
        return function
    chosen = config.CACHE_DIR
    config.CACHE_DIR = _cache_folder(chosen, Path(function.__code__.co_filename).parent)
    try:
        return cast(F, _compiled_once(numba.njit(function, nogil=nogil), _Kept(function)))
    except RuntimeError:  # numba's, if there is no place for a cache
        return cast(F, numba.njit(function, nogil=nogil))
    finally:
        config.CACHE_DIR = chosen


def long_entry(function: F) -> F:
    """Compile an entry that releases the GIL; not worthwhile for a short one."""
    return entry(function, nogil=True)


class _Kept:
    """A cache that loads machine code without the data of a compilation, and compiles it once.

    numba first loads all that it knows of types and of linear algebra, which takes longer than the
    rest of a start; machine code needs only the functions of its memory. What is not on disk is
    compiled by one process while others wait: at once they would also mistake each other's code.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self._cache: Any = FunctionCache(function)
        self.cache_path = Path(self._cache.cache_path)
        self._lock_file = self.cache_path / f"{function.__name__}.lock"
        self.alone = ExitStack()

    def load_overload(self, kinds: Any, context: Any) -> Any:
        """Return what is on disk; else None, with the lock of the entry taken."""
        rtsys.initialize(context)
        found = self._load(kinds, context)
        if found is None and self._locked():  # by now another process may have compiled it
            found = self._load(kinds, context)
        return found

    def save_overload(self, kinds: Any, compiled: Any) -> None:
        self._cache.save_overload(kinds, compiled)

    def _load(self, kinds: Any, context: Any) -> Any:
        with self._cache._guard_against_spurious_io_errors():
            return self._cache._load_overload(kinds, context)
        return None

    def _locked(self) -> bool:
        # SQLite's lock works on every system, and the kernel releases it after a kill.
        with suppress(sqlite3.Error):  # a file system without locks
            lock = sqlite3.connect(self._lock_file, timeout=_LONGEST_s, isolation_level=None)
            self.alone.callback(lock.close)
            lock.execute("BEGIN EXCLUSIVE")
            return True
        return False


def _compiled_once(dispatcher: Any, cache: _Kept) -> Any:
    """Return an entry's dispatcher with its cache, whose lock is released after a compilation."""
    compile_kinds, dispatcher._cache = dispatcher.compile, cache

    def compile_alone(kinds: Any) -> Any:
        with global_compiler_lock, cache.alone:
            return compile_kinds(kinds)

    dispatcher.compile = compile_alone
    return dispatcher


def bound(kernel: F, *arguments: Any) -> F:
    """Return an entry's machine code for arguments of these types.

    Calling it avoids numba's dispatch by the arguments' types, which at every frame costs as much
    as the physics. It accepts only arguments of these types.
    """
    dispatcher: Any = kernel
    with timed("kernels"):
        kinds = tuple(_type_of(argument) for argument in arguments)
        dispatcher.compile(kinds)
    return cast(F, dispatcher.get_overload(kinds))


def _pointer(context: Any, address: Any) -> Any:
    """Return an address as a pointer, for `numba.carray`; inside kernels only."""

    def generate(generator: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.inttoptr(arguments[0], generator.get_value_type(signature.return_type))

    return types.voidptr(types.intp), generate


def _call_at(context: Any, place: Any, address: Any, k: Any) -> Any:
    """Call the machine code at a place with an address and a frame's number; inside kernels."""

    def generate(generator: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        whole = generator.get_value_type(types.intp)
        kind = ir.FunctionType(generator.get_value_type(types.float64), [whole, whole])
        return builder.call(builder.inttoptr(arguments[0], kind.as_pointer()), arguments[1:])

    return types.float64(types.intp, types.intp, types.intp), generate


def _read_at(context: Any, function: Any, node: Any) -> Any:
    """Call `double function(void *)` at an address; inside kernels only."""

    def generate(generator: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        whole = generator.get_value_type(types.intp)
        kind = ir.FunctionType(generator.get_value_type(types.float64), [whole])
        return builder.call(builder.inttoptr(arguments[0], kind.as_pointer()), arguments[1:])

    return types.float64(types.intp, types.intp), generate


def _write_at(context: Any, function: Any, node: Any, value: Any) -> Any:
    """Call `bool function(void *, double)` at an address; inside kernels only."""

    def generate(generator: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        whole, number = (generator.get_value_type(kind) for kind in (types.intp, types.float64))
        kind = ir.FunctionType(ir.IntType(8), [whole, number])
        done = builder.call(builder.inttoptr(arguments[0], kind.as_pointer()), arguments[1:])
        return builder.zext(done, whole)

    return types.intp(types.intp, types.intp, types.float64), generate


pointer: Any = intrinsic(_pointer)
call_at: Any = intrinsic(_call_at)
read_at: Any = intrinsic(_read_at)
write_at: Any = intrinsic(_write_at)
carray: Any = numba.carray


def machine_code(kernel: Any, *arguments: Any) -> int:
    """Return the address of an entry's machine code, for `call_at`; it raises no error.

    A wheel has the code for the platform where it was built. On another platform, and after a
    change of the sources, the entry is compiled.
    """
    if (file := _shipped_file(kernel)) is not None:
        return load(file, kernel.py_func.__name__)
    bound(kernel, *arguments)
    compiled = kernel.overloads[tuple(_type_of(argument) for argument in arguments)]
    name = compiled.fndesc.llvm_cfunc_wrapper_name
    return int(compiled.library.get_pointer_to_function(name))


def function_at(address: int) -> Callable[[int, int], float]:
    """Return the machine code at an address, of two whole numbers, as a function for Python."""
    return cast(
        Callable[[int, int], float],
        ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_int64, ctypes.c_int64)(address),
    )


# What a wheel's code needs of a processor, by architecture: of x86-64 that of the years after 2013.
_LEVELS = {"x86_64": ("x86-64-v3", ("avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe"))}
_SHIPPED = Path(__file__).parents[1] / "shipped" / "machine"
_engines: list[Any] = []  # the code lasts as long as they do


def shippable(kernel: Any) -> tuple[str, bytes]:
    """Return file name and contents of the machine code of an entry of two whole numbers.

    It needs no Python, and the C library's mathematics only, if the entry allocates nothing. An
    entry that raises an error returns 0.
    """
    function, kinds = kernel.py_func, (types.int64, types.int64)
    dispatcher = numba.njit(function, no_cpython_wrapper=True, no_cfunc_wrapper=True)
    dispatcher.compile(kinds)
    compiled = dispatcher.overloads[kinds]
    module, name = binding.parse_assembly(compiled.library.get_llvm_str()), function.__name__
    mangled = compiled.fndesc.mangled_name
    module.link_in(binding.parse_assembly(str(_plain(mangled, name))), preserve=False)
    return _shipped_name(function), _emitted(module, name, _level()[0])


def _plain(mangled: str, name: str) -> Any:
    """Return a module with the function `double name(int64_t, int64_t)`, which calls numba's."""
    module, whole, number = ir.Module(), ir.IntType(64), ir.DoubleType()
    result, fault = number.as_pointer(), ir.IntType(8).as_pointer()
    native = ir.FunctionType(ir.IntType(32), [result, fault.as_pointer(), whole, whole])
    called = ir.Function(module, native, mangled)
    function = ir.Function(module, ir.FunctionType(number, [whole, whole]), name)
    builder = ir.IRBuilder(function.append_basic_block())
    found, raised = builder.alloca(number), builder.alloca(fault)
    builder.store(ir.Constant(number, 0.0), found)
    builder.call(called, [found, raised, *function.args])
    builder.ret(builder.load(found))
    return module


def _level() -> tuple[str, tuple[str, ...]]:
    """Return the processor for which a wheel's code is made, and what it needs of this one."""
    return _LEVELS.get(binding.get_default_triple().partition("-")[0], ("", ()))


def _shipped_name(function: Callable[..., Any]) -> str:
    version = _folder_of_version("", Path(function.__code__.co_filename).parent).name
    return f"{function.__name__}-{version}-{binding.get_default_triple()}.o"


def _shipped_file(kernel: Any) -> Path | None:
    """Return the file of an entry's machine code for this platform, if the package has one."""
    if not _SHIPPED.is_dir():
        return None
    file, has = _SHIPPED / _shipped_name(kernel.py_func), binding.get_host_cpu_features()
    return file if file.is_file() and all(has.get(need) for need in _level()[1]) else None


@lru_cache(maxsize=8)
def load(file: Path, name: str) -> int:
    """Return the address of a function in an object file, loaded for as long as the process."""
    rtsys.initialize(cpu_target.target_context)  # names numba's functions that the code refers to
    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    machine = binding.Target.from_default_triple().create_target_machine()
    engine = binding.create_mcjit_compiler(binding.parse_assembly(""), machine)
    engine.add_object_file(binding.ObjectFileRef.from_data(file.read_bytes()))
    engine.finalize_object()
    _engines.append(engine)
    return int(engine.get_function_address(name))


def object_code(function: Callable[..., Any], name: str, *arguments: Any) -> bytes:
    """Return a function as an object file for a linker, cached on disk.

    It is position-independent code for any processor of this platform, needs no Python, and calls
    the mathematics of the C library only, if the function allocates nothing. The symbol `name`
    follows numba's convention: `int32_t name(RESULT *, void **error, ...)`, 0 without an error,
    with `int64_t` and `double` for arguments like those given. All other symbols are local.
    """
    folder = _folder_of_version(config.CACHE_DIR, Path(function.__code__.co_filename).parent)
    file = folder / f"{name}-{numba.__version__}-{binding.get_default_triple()}.o"
    if file.is_file():
        return file.read_bytes()
    options = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    dispatcher = numba.njit(function, **options)
    kinds = tuple(_type_of(argument) for argument in arguments)
    with timed("kernels"):
        dispatcher.compile(kinds)
        compiled = dispatcher.overloads[kinds]
        code = _object_code(compiled.library, compiled.fndesc.mangled_name, name)
    with suppress(InputError):  # a folder that cannot be written
        write_whole(file, lambda part: part.write_bytes(code))
    return code


def _object_code(library: Any, mangled: str, name: str) -> bytes:
    module = binding.parse_assembly(library.get_llvm_str())
    function = module.get_function(mangled)
    function.visibility, function.name = "hidden", name
    return _emitted(module, name)


def _emitted(module: Any, name: str, processor: str = "") -> bytes:
    """Return a module's object code, for a processor or for any, with one symbol not local."""
    for each in (*module.functions, *module.global_variables):
        if not each.is_declaration:
            each.linkage = "external" if each.name == name else "internal"
    module.verify()
    target = binding.Target.from_default_triple()
    machine = target.create_target_machine(cpu=processor, opt=2, reloc="pic", codemodel="default")
    return bytes(machine.emit_object(module))


def _type_of(argument: Any) -> Any:
    """Return an argument's type, cached; numba takes milliseconds for a control's layout."""
    if isinstance(argument, np.ndarray) and argument.flags.c_contiguous:
        return _type_of_array(argument.dtype, argument.ndim)
    return numba.typeof(argument)


@lru_cache(maxsize=64)
def _type_of_array(dtype: np.dtype[Any], dimensions: int) -> Any:
    return numba.typeof(np.empty((1,) * dimensions, dtype))


def _cache_folder(chosen: str, beside: Path) -> str:
    """Return the folder of this version of the physics, or numba's own if ours is read-only."""
    folder = _folder_of_version(chosen, beside)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return chosen
    return str(folder) if os.access(folder, os.W_OK) else chosen


def compiled_before(kernel: Any) -> bool:
    """Tell whether an entry's machine code is on disk, so that it need not be compiled."""
    if _shipped_file(kernel) is not None:
        return True
    cache = getattr(kernel, "_cache", None)
    folder = Path(str(getattr(cache, "cache_path", "")))
    return any(folder.glob(f"*.{kernel.py_func.__name__}-*.nbc"))


@lru_cache(maxsize=8)
def _folder_of_version(chosen: str, beside: Path) -> Path:
    here = Path(__file__).parent
    digest = hashlib.sha256()
    for source in sorted({*here.glob("*.py"), *beside.glob("*.py")}):
        digest.update(source.read_bytes())
    return Path(chosen or here / "__pycache__") / f"kernels-{digest.hexdigest()[:16]}"


def layout(declaration: type, **shapes: tuple[int, ...]) -> np.dtype[np.void]:
    """Return the memory layout of a class of annotated numbers.

    A `float` becomes a double, an `int` a 64-bit integer; `shapes` names the
    fields that are arrays of doubles.
    """
    return np.dtype(
        [
            (name, np.float64 if kind is not int else np.int64, shapes.get(name, ()))
            for name, kind in get_type_hints(declaration).items()
        ]
    )
