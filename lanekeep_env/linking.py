"""numba's compiler for functions that compiled code alone calls: it makes no machine code of them.

numba makes machine code of each function by itself, and keeps beside it the LLVM code that is linked into all that call
it. Of helpers the machine code would never run: a kernel holds their code.
"""

from __future__ import annotations

import copy
from typing import Any, ClassVar

from llvmlite.binding import parse_bitcode
from numba.core import typed_passes, types, untyped_passes
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, CompileResult, Flags, compile_result
from numba.core.compiler_machinery import PassManager
from numba.core.typing import Context

_PART = "part"


class _Part(JITCodeLibrary):
    """LLVM code of a function that cannot be run by itself."""

    #: Whether it is inlined into every caller: then it is optimised for itself, so that in each of them its sums and
    #: products come in one order, which decides what is fused. Of others the kernel's optimisation takes care.
    inlined: bool = False

    @property
    def codegen(self) -> Any:
        return _NoEngine()

    def get_pointer_to_function(self, name: str) -> int:
        self._ensure_finalized()
        return 0

    def _optimize_functions(self, module: Any) -> None:
        module.data_layout = str(self._codegen.target_data)
        passes, builder = self._codegen._function_pass_manager()
        for function in module.functions:
            if not function.is_declaration:
                passes.run(function, builder)

    def _optimize_final_module(self) -> None:
        if self.inlined:
            super()._optimize_final_module()
            return
        passes, builder = self._codegen._module_pass_manager(
            loop_vectorize=False, slp_vectorize=False, opt=0, cost="cheap"
        )
        passes.run(self._final_module, builder)

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True
        self._final_module = self._get_module_for_linking()  # else both are kept

    def serialize_using_object_code(self) -> tuple[str, str, bytes]:
        return self.name, _PART, self._get_module_for_linking().as_bitcode()


class _NoEngine:
    """In the place of numba's engine, where no machine code is; helpers use no objects of Python."""

    def set_env(self, name: str, environment: Any) -> None:
        """Nothing reads it."""


#: What numba does to a function, but for what closures, contexts, literals to unroll and array expressions need.
_PASSES = (
    untyped_passes.TranslateByteCode,
    untyped_passes.FixupArgs,
    untyped_passes.IRProcessing,
    untyped_passes.RewriteSemanticConstants,
    untyped_passes.DeadBranchPrune,
    untyped_passes.GenericRewrites,
    untyped_passes.ReconstructSSA,
    untyped_passes.DeadBranchPrune,
    typed_passes.NopythonTypeInference,
    typed_passes.PreLowerStripPhis,
    typed_passes.IRLegalization,
    typed_passes.AnnotateTypes,
    typed_passes.NativeLowering,
    typed_passes.NoPythonBackend,
)


class _Typing(Context):
    """numba's typing, which tries operators of lists, texts and sets on each pair of numbers: here once a process."""

    _found: ClassVar[dict[Any, Any]] = {}

    def __init__(self, context: Context) -> None:
        self.__dict__ = context.__dict__

    # What numba keeps by context, it keeps for all copies of one.

    def __hash__(self) -> int:
        return id(self.__dict__)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Typing) and other.__dict__ is self.__dict__

    def refresh(self) -> None:
        """Do nothing."""

    def resolve_function_type(self, func: Any, args: Any, kws: Any) -> Any:
        # Only operators: what functions mean depends on the options of the caller as well.
        operator = getattr(getattr(func, "typing_key", None), "__module__", None) == "_operator"
        if not operator or not all(isinstance(one, types.Number) for one in args):
            return super().resolve_function_type(func, args, kws)
        key = func, tuple(args)
        if key not in self._found:
            self._found[key] = super().resolve_function_type(func, args, kws)
        return self._found[key]


class _Known(Flags):
    """Options on numba's stack, hashed and compared for each candidate of each operation: each set is there once."""

    _all: ClassVar[dict[Flags, Flags]] = {}

    def __init__(self, flags: Flags) -> None:
        super().__init__(flags)
        self._hash = super().__hash__()

    def __hash__(self) -> int:
        return self._hash

    def __eq__(self, other: object) -> bool:
        return self is other or bool(super().__eq__(other))

    def copy(self) -> Flags:
        return Flags(self)


class _Flags(Flags):
    """Options of a function; numba puts a copy on its stack."""

    def copy(self) -> Flags:
        known = _Known(self)
        return _Known._all.setdefault(known, known)


class PartCompiler(CompilerBase):
    """Compiles a function for those that call it."""

    def __init__(self, typing: Any, target: Any, *others: Any) -> None:
        # The kernel around it has refreshed both, and no function of ours brings new types.
        target = copy.copy(target)
        target.refresh = _nothing
        super().__init__(_Typing(typing), target, *others)

    def define_pipelines(self) -> list[PassManager]:
        passes = PassManager("part")
        for one in _PASSES:
            passes.add_pass(one, one.__name__)
        passes.finalize()
        return [passes]

    def _compile_bytecode(self) -> CompileResult:
        state = self.state
        state.flags = _Flags(state.flags)
        state.library = _Part(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.inlined = state.flags.forceinline
        # Of thousands of helpers what numba tells of their types would fill gigabytes, and nobody asks.
        return super()._compile_bytecode()._replace(type_annotation=None)


def _nothing() -> None:
    """Do nothing."""


def rebuild(target_context: Any, reduced: tuple[Any, ...]) -> CompileResult:
    """Return what `CompileResult._reduce` took apart."""
    (name, kind, code), described, environment, signature, objectmode, lifted, annotation, reload_init, used = reduced
    if kind != _PART:
        return CompileResult._rebuild(target_context, *reduced)
    for load in reload_init:
        load()
    library = _Part(target_context.codegen(), name)
    library._final_module, library._finalized = parse_bitcode(code), True
    return compile_result(
        target_context=target_context,
        typing_context=target_context.typing_context,
        library=library,
        environment=environment,
        entry_point=target_context.get_executable(library, described, environment),
        fndesc=described,
        type_annotation=annotation,
        signature=signature,
        objectmode=objectmode,
        lifted=lifted,
        reload_init=reload_init,
        referenced_envs=used,
    )
