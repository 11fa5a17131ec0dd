"""What is answered once is what numba answers each time."""

import operator

import pytest
from numba.core import compiler, ir, types
from numba.core.compiler import Flags
from numba.core.registry import cpu_target

from model.kernels import repeated
from model.kernels.repeated import Options


def branching(a, b):
    """Return something of every kind of instruction."""
    total, pair = 0.0, (a, b)
    for k in range(3):
        if pair[0] > k and not b:
            total += float(abs(a)) * pair[1]
    return total, {1: a}, [b, max(a, b)]


def naive(value):
    """Return the variables in a part of an instruction, looking into everything."""
    if isinstance(value, ir.Var):
        return [value.name]
    if isinstance(value, ir.Inst):
        return [name for part in vars(value).values() for name in naive(part)]
    if isinstance(value, dict):
        return [name for part in value.values() for name in naive(part)]
    if isinstance(value, (list, tuple)):
        return [name for part in value for name in naive(part)]
    return []


def test_every_variable_of_an_instruction_is_listed():
    blocks = compiler.run_frontend(branching).blocks.values()
    instructions = [x for block in blocks for x in block.body]
    assert {type(x) for x in instructions} >= {ir.Assign, ir.Branch, ir.Jump, ir.Return}
    for x in instructions:
        assert sorted(v.name for v in x.list_vars()) == sorted(naive(x)), x


@pytest.mark.parametrize("function", [operator.add, operator.gt, operator.iadd, max])
@pytest.mark.parametrize(
    "kinds", [(types.float64, types.int64), (types.int64, types.int64), (types.boolean,) * 2]
)
def test_a_call_s_type_is_the_one_numba_finds(function, kinds, monkeypatch):
    """The first time and the second, and the implementation that goes with it; what was compiled in
    this process before may be kept with another copy of it."""
    monkeypatch.setattr(repeated, "_known", {})
    context = cpu_target.typing_context
    context.refresh()
    asked = context.resolve_value_type(function)
    wanted = repeated._resolve(asked, context, kinds, {})
    implementation = asked.get_impl_key(wanted)
    for _ in range(2):
        asked._impl_keys.clear()
        found = asked.get_call_type(context, kinds, {})
        assert (found, asked.get_impl_key(found)) == (wanted, implementation)


def test_what_has_no_type_is_refused_each_time():
    context = cpu_target.typing_context
    context.refresh()
    for _ in range(2):
        with pytest.raises(Exception, match="No implementation of function"):
            context.resolve_value_type(operator.add).get_call_type(
                context, (types.none, types.float64), {}
            )


def test_flags_are_the_same_where_all_of_their_values_are():
    """Set to what is usual, or not set."""
    usual, same, other = Options(), Options(), Options()
    same.nrt, other.nrt = Flags().nrt, not Flags().nrt
    for one in (usual, same, other):
        for two in (usual, same, other):
            assert (one == two) == (Flags.__eq__(one, two)) == ((one is other) == (two is other))
    assert usual != 1
    assert len({hash(x) for x in (usual, same)}) == 1
