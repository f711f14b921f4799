"""How the stages are compiled.

Two decorators: `stage` for a function that other kernels call, `entry` for one that Python calls,
whose machine code is cached on disk. numba checks only an entry's own file to invalidate its cache,
and would use old code after an edit of a stage. So the cache is in a folder named by a hash of all
sources in `coupled/rig` and of those beside the entry.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar, cast, get_type_hints

import numba
import numpy as np
from llvmlite import binding, ir
from numba import types
from numba.core import config
from numba.core.caching import FunctionCache
from numba.core.registry import CPUDispatcher
from numba.core.runtime import rtsys
from numba.extending import intrinsic

from coupled.errors import InputError
from coupled.files import write_whole
from coupled.timing import timed

# A smaller state of a decay is at rest; subnormal numbers would slow the processor.
TINY = 1e-100

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
    chosen = config.CACHE_DIR
    config.CACHE_DIR = _cache_folder(chosen, Path(function.__code__.co_filename).parent)
    try:
        dispatcher = numba.njit(function, nogil=nogil)
        dispatcher._cache = _kept(function)
        return cast(F, dispatcher)
    except RuntimeError:  # numba's, if there is no place for a cache
        return cast(F, numba.njit(function, nogil=nogil))
    finally:
        config.CACHE_DIR = chosen


def long_entry(function: F) -> F:
    """Compile an entry that releases the GIL; not worthwhile for a short one."""
    return entry(function, nogil=True)


def _kept(function: Callable[..., Any]) -> Any:
    """Return a cache that loads machine code without the data of a compilation.

    numba first loads all that it knows of types and of linear algebra, which takes longer than the
    rest of a start; machine code needs only the functions of its memory.
    """
    cache: Any = FunctionCache(function)

    def load_overload(kinds: Any, context: Any) -> Any:
        rtsys.initialize(context)
        with cache._guard_against_spurious_io_errors():
            return cache._load_overload(kinds, context)
        return None

    cache.load_overload = load_overload
    return cache


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


pointer: Any = intrinsic(_pointer)
call_at: Any = intrinsic(_call_at)
carray: Any = numba.carray


def machine_code(kernel: Any, *arguments: Any) -> int:
    """Return the address of an entry's machine code, for `call_at`; it raises no error."""
    bound(kernel, *arguments)
    compiled = kernel.overloads[tuple(_type_of(argument) for argument in arguments)]
    name = compiled.fndesc.llvm_cfunc_wrapper_name
    return int(compiled.library.get_pointer_to_function(name))


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
    for each in (*module.functions, *module.global_variables):
        if not each.is_declaration:
            each.linkage = "internal"
    function = module.get_function(mangled)
    function.linkage, function.visibility, function.name = "external", "hidden", name
    module.verify()
    target = binding.Target.from_default_triple()
    machine = target.create_target_machine(opt=2, reloc="pic", codemodel="default")
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
