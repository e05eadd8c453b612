"""Compiled kernels loaded from the disk as machine code, without the compiler.

numba reads a cached kernel as if another kernel were to be compiled next: it fills its tables of types and functions,
parses the kernel's bitcode and compiles its own runtime. A process that only runs kernels needs none of this. Without
it, loading the 50 kernels of the default method takes half the time and 31 MB instead of 98 MB
(`python -m benchmarks.service --only kernels`). What is left out is done later, when a kernel has to be compiled.
"""

from functools import cache
from typing import Any, Final

from llvmlite import binding as llvm
from numba.core import caching
from numba.core.codegen import CodeLibrary, JITCodeLibrary
from numba.core.compiler import compile_result
from numba.core.runtime import nrt

_AS_MACHINE_CODE: Final = "object"
"""How numba names a kernel that was stored with its machine code."""


class MachineCode(JITCodeLibrary):
    """The machine code of a kernel. Its bitcode is parsed only if a kernel is compiled that calls it."""

    def __init__(self, codegen: Any, name: str, code: bytes, bitcode: bytes) -> None:
        """Copy the code to where it can be executed."""
        CodeLibrary.__init__(self, codegen, name)  # that of the class between them makes empty modules
        self._linking_libraries: list[CodeLibrary] = []
        self._shared_module: Any = None
        self._bitcode = bitcode
        self._disable_inspection = True
        codegen._engine._ee.add_object_file(llvm.ObjectFileRef.from_data(code))
        codegen._engine.finalize_object()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """Address of a function that the code contains."""
        return int(self._codegen._engine.get_function_address(name))

    def _get_module_for_linking(self) -> Any:
        """What a kernel that calls this one is compiled with."""
        if self._shared_module is None:
            self._shared_module = llvm.parse_bitcode(self._bitcode)
            self._codegen._engine._load_defined_symbols(self._shared_module)  # type: ignore[no-untyped-call]
        return self._shared_module


class StoredKernels(caching.CompileResultCacheImpl):
    """How one kernel is stored and read."""

    def rebuild(self, target_context: Any, payload: Any) -> Any:
        """A kernel that can be called, of what was stored of it."""
        (name, kind, stored), described, environment, signature, by_objects, lifted, typed, initial, others = payload
        if kind != _AS_MACHINE_CODE or initial:
            target_context.refresh()
            return super().rebuild(target_context, payload)  # type: ignore[no-untyped-call]
        provide_runtime()
        library = MachineCode(target_context.codegen(), name, *stored)
        function = target_context.get_executable(library, described, environment)
        for other in others:
            library.codegen.set_env(other.env_name, other)
        return compile_result(  # type: ignore[no-untyped-call]
            typing_context=target_context.typing_context,
            target_context=target_context,
            entry_point=function,
            type_annotation=typed,
            signature=signature,
            objectmode=by_objects,
            lifted=lifted,
            fndesc=described,
            library=library,
            environment=environment,
            reload_init=initial,
            referenced_envs=others,
        )


@cache
def provide_runtime() -> None:
    """Let machine code find the functions of numba's runtime, which counts the references to arrays."""
    for name, address in vars(nrt)["_nrt"].c_helpers.items():
        llvm.add_symbol(name if name.startswith("_") else f"NRT_{name}", address)
