"""Kernels as other kernels see them: code to link in, with no way in from Python and no machine
code of their own.

numba compiles every function that a kernel calls as if Python would call it, too: two wrappers that
take its arguments apart, and machine code that nobody runs, since the caller holds all it needs.
Together that is a third of the time.
Here a function has two dispatchers: its own, for Python, and a twin that only kernels see.
"""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import llvmlite.binding as llvm
from numba.core import types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, CompileResult, DefaultPassBuilder
from numba.core.registry import CPUDispatcher

from model.kernels.repeated import Options

# LLVM takes vectors of 256 bits on most processors that have wider ones, for the sake of code that
# mixes both; batches of lanes are nothing but vectors.  The numbers are the same to the bit; other
# processors take no notice.
WIDE = '"prefer-vector-width"="512"'


@contextmanager
def uncollected() -> Iterator[None]:
    """Let cycles of objects lie meanwhile: looking for them is a seventh of the time of
    compiling."""
    if not gc.isenabled():
        yield
        return
    gc.disable()
    try:
        yield
    finally:
        gc.enable()


class Wide(JITCodeLibrary):
    """Code of our own functions, in vectors of 512 bits where the processor has them."""

    def add_ir_module(self, ir_module: Any) -> None:
        """Add a module, its functions marked."""
        for function in ir_module.functions:
            # llvmlite's own `add` knows attributes without a value only
            set.add(function.attributes, WIDE)
        super().add_ir_module(ir_module)


class Linked(Wide):
    """Optimised code that callers link in; the engine that makes machine code never sees it."""

    # the caller's code holds the place (`Kernel`)
    codegen = SimpleNamespace(set_env=lambda name, env: None)

    def _optimize_final_module(self) -> None:
        """Place callees inside and no more: what runs is optimised in the function that holds
        it."""
        made = self._codegen._module_pass_manager(
            loop_vectorize=False, slp_vectorize=False, opt=self._codegen._opt_level, cost="cheap"
        )
        # before numba 0.62 without a builder
        passes, *builder = made if isinstance(made, tuple) else (made,)
        passes.run(self._final_module, *builder)

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """Return 0: there is no machine code."""
        return 0

    def serialize_using_object_code(self) -> tuple[str, str, bytes]:
        """Return what is kept on disk: the code that callers link in, no machine code."""
        return self.name, "linked", self._get_module_for_linking().as_bitcode()

    @classmethod
    def kept(cls, codegen: Any, name: str, code: bytes) -> Linked:
        """Return the library again that was kept on disk."""
        library = cls(codegen, name)
        library._final_module = llvm.parse_bitcode(code)
        library._finalize_final_module()
        return library


class KernelCompiler(Compiler):
    """numba's usual passes into a library of our own kind."""

    library_class: type[Wide] = Wide

    def __init__(self, *given: Any) -> None:
        typing, target, library, args, return_type, flags, local = given
        super().__init__(typing, target, library, args, return_type, Options(flags), local)

    def define_pipelines(self) -> list[Any]:
        """Return the passes."""
        self.state.library = self.library_class(
            self.state.targetctx.codegen(), self.state.func_id.func_qualname
        )
        self.state.library.enable_object_caching()
        return [DefaultPassBuilder.define_nopython_pipeline(self.state)]


class LinkedCompiler(KernelCompiler):
    """The same into a library that is linked only."""

    library_class = Linked


class Twin(CPUDispatcher):
    """A function for callers: compiled once for integers, not once more for each that a caller
    writes as a constant."""

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """Return what numba's type inference asks for, with constants taken as integers."""
        plain = (
            [types.unliteral(a) for a in args],
            {name: types.unliteral(a) for name, a in kws.items()},
        )
        return super().get_call_template(*plain)


class Kernel(CPUDispatcher):
    """A compiled function; kernels that call it get its twin."""

    def __init__(self, py_func: Any, locals: Any = None, targetoptions: Any = None) -> None:
        self.twin: Any = None
        super().__init__(
            py_func, locals or {}, {"nopython": True, **(targetoptions or {})}, KernelCompiler
        )

    def with_twin(self) -> Any:
        """Give this function a twin for callers and return it."""
        options = {**self.targetoptions, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
        self.twin = Twin(self.py_func, targetoptions=options, pipeline_class=LinkedCompiler)
        return self.twin

    @property
    def _numba_type_(self) -> Any:
        return types.Dispatcher(self if self.twin is None else self.twin)

    def compile(self, sig: Any) -> Any:
        """Compile a signature, or read it from the cache; callees are compiled on the way."""
        with uncollected():
            return super().compile(sig)

    def add_overload(self, cres: CompileResult) -> None:
        """Take a compiled signature; the environments of callees lie in this machine code alone."""
        for env in cres._find_referenced_environments():
            cres.codegen.set_env(env.env_name, env)
        super().add_overload(cres)


def rebuilt(target_context: Any, parts: tuple[Any, ...]) -> CompileResult:
    """Return a compiled function from what `CompileResult._reduce` made of it."""
    (
        (name, kind, code),
        fndesc,
        env,
        signature,
        objectmode,
        lifted,
        annotation,
        reload_init,
        environments,
    ) = parts
    if kind != "linked":
        return CompileResult._rebuild(target_context, *parts)
    library = Linked.kept(target_context.codegen(), name, code)
    for again in reload_init:
        again()
    result: Any = CompileResult  # its fields are put together at run time
    return result(
        typing_context=target_context.typing_context,
        target_context=target_context,
        entry_point=target_context.get_executable(library, fndesc, env),
        typing_error=None,
        type_annotation=annotation,
        signature=signature,
        objectmode=objectmode,
        lifted=lifted,
        fndesc=fndesc,
        library=library,
        call_helper=None,
        environment=env,
        metadata=None,
        reload_init=reload_init,
        referenced_envs=environments,
    )
