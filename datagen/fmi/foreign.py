"""Calls of C functions by address from numba code.

A shared library's functions are known only at run time, as addresses. Passing the address as an argument, rather than
freezing it into the compiled code, lets numba keep what it compiled on disk for the next process. Pointers travel as
64-bit integers; they use the same registers as pointers on every ABI that we build for.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

_CODES: dict[str, Any] = {"i": types.int32, "p": types.int64, "d": types.float64}


def foreign(signature: str) -> Callable[..., Any]:
    """A numba function ``call(address, *arguments)`` for C functions of one signature.

    Parameters
    ----------
    signature
        Return type, a colon, argument types: ``i`` int, ``p`` pointer or size_t, ``d`` double.
        For example ``"i:ppd"``.
    """
    result_code, argument_codes = signature.split(":")
    result = _CODES[result_code]
    arguments = [_CODES[code] for code in argument_codes]

    def codegen(context: Any, builder: Any, called: Any, values: Any) -> Any:
        address, packed = values
        given = zip(cgutils.unpack_tuple(builder, packed), called.args[1].types, arguments, strict=True)
        cast = [context.cast(builder, value, found, wanted) for value, found, wanted in given]
        function_type = ir.FunctionType(
            context.get_value_type(result), [context.get_value_type(wanted) for wanted in arguments]
        )
        pointer = builder.inttoptr(address, function_type.as_pointer())
        return builder.call(pointer, cast)

    def call(typingctx: Any, address: Any, *values: Any) -> Any:
        return result(types.int64, types.StarArgTuple(values)), codegen

    function: Callable[..., Any] = intrinsic(call)
    return function
